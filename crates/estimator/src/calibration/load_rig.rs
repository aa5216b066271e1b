//! Gains of the gauges from known forces on a wheel (thesis section 5.3.1), and their wiring.
//!
//! The linkage's statics say what each known force makes of each member. A channel that is what it
//! is called follows its own member:
//!
//! counts = offset + m / gain
//!
//! with the member's force m (N, or N m of bending) and a prior on the gain from the sensors file.
//! A channel that follows another member is swapped with it, one that follows the lower arm's
//! bending is wired for it, one that falls where it should rise is inverted. The sensitivity matrix,
//! counts for a newton of F_x, F_y and F_z, is found beside it by least squares with the geometry
//! and the nominal gain as its prior: directions that the rig did not push in stay what the geometry
//! says.

use std::fmt;

use model::sensors::Sensors;
use model::suspension::{ChannelKind, Corner, CornerMotion, CornerStatics, TyreFrame, Wrench};
use model::vehicle::Vehicle;
use nalgebra::{Matrix4, Vector3, Vector4};
use sample::{STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use super::zero::axle_of;
use super::{Calibration, ChannelCalibration, Resolved};
use crate::EstimatorError;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::whiteness;

const WHAT: &str = "load-rig";
/// Least number of loads on a corner.
const LOADS_NEEDED: usize = 5;
/// Least spread (rms) of the force along each axis, N.
const SPREAD_NEEDED_N: [f64; 3] = [100.0, 100.0, 300.0];
/// What the sensors file leaves open of a gain, as a part of it.
const GAIN_PRIOR: f64 = 0.2;
/// What the geometry leaves open of a sensitivity, as a part of its size.
const GEOMETRY_PRIOR: f64 = 0.1;
/// Deviation of the geometry's prediction, as a part of the greatest change that it predicts.
const GEOMETRY_SIGMA: f64 = 0.002;
/// Least part of a channel's changes that its member must explain.
const EXPLAINED: f64 = 0.9;
/// Least greatest change of a channel, counts, that tells anything.
const CHANGE_NEEDED: f64 = 4.0;
/// A gain this many times the nominal one, or its reciprocal, is not the nominal wiring.
const GAIN_WITHIN: f64 = 2.0;

/// One known load on one wheel, everything at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigLoad {
    /// The wheel.
    pub wheel: Wheel,
    /// Force on a plate in the wheel's place, N: forward and left at the hub, up below it.
    pub force_n: [f64; 3],
    /// Compression of the strut from its design length, m.
    pub compression_m: f64,
    /// Hand wheel, straight ahead 0, rad.
    pub hand_wheel_rad: f64,
    /// Mean counts of each strain channel and their deviations.
    pub counts: [Option<[f64; 2]>; StrainChannel::COUNT],
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadRig {
    /// Gains and offsets with their deviations, notes on wiring.
    pub findings: Findings,
    /// Counts for one newton of F_x, F_y, F_z of each channel.
    pub sensitivity: Vec<(Wheel, StrainChannel, [f64; 3])>,
    /// What is wrong with which channel.
    pub faults: Vec<WiringFault>,
    /// The calibration with gains and offsets in it.
    pub calibration: Calibration,
}

/// Something wrong with a channel's wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WiringFault {
    /// Corner.
    pub wheel: Wheel,
    /// Channel.
    pub channel: StrainChannel,
    /// What it is.
    pub kind: WiringKind,
}

/// What is wrong with a channel's wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WiringKind {
    /// It falls where it should rise.
    Inverted,
    /// It reads another channel's member.
    Swapped(StrainChannel),
    /// It reads the arm's bending.
    Bending,
    /// It does not react.
    NoReaction,
    /// It is at an end of its range, or silent, whatever the load.
    Silent,
    /// It leaves its range under most loads.
    OutOfRange,
    /// It follows nothing that the linkage knows.
    Unexplained,
}

impl fmt::Display for WiringFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} ", self.wheel, self.channel.name())?;
        match self.kind {
            WiringKind::Inverted => write!(
                f,
                "is wired the other way round; its gain is written negative"
            ),
            WiringKind::Swapped(other) => write!(
                f,
                "reads {}: its plug is in the wrong place; it is called dead until that is mended",
                other.name()
            ),
            WiringKind::Bending => write!(
                f,
                "reads bending: its gauges stand in adjacent arms of the bridge; it is called dead"
            ),
            WiringKind::NoReaction => write!(f, "does not react to load; it is called dead"),
            WiringKind::Silent => write!(
                f,
                "gives no reading within its range; it is called dead, look at gauge and cable"
            ),
            WiringKind::OutOfRange => write!(
                f,
                "leaves its range under load: its gauges stand in adjacent arms of the bridge, \
                 where they read bending, or its gain is too high; it is called dead"
            ),
            WiringKind::Unexplained => write!(
                f,
                "follows no member of the linkage; it is called dead, look at gauge and cable"
            ),
        }
    }
}

/// Finds gains and wiring.
///
/// # Errors
/// Too few loads on a corner, loads that leave a direction out, a vehicle without linkage.
pub fn load_rig(
    vehicle: &Vehicle,
    sensors: &Sensors,
    known: &Calibration,
    loads: &[RigLoad],
) -> Result<LoadRig, EstimatorError> {
    let resolved = Resolved::new(sensors, known)?;
    let mut rig = LoadRig {
        findings: Findings {
            what: "gains of the strain bridges".to_owned(),
            ..Findings::default()
        },
        sensitivity: Vec::new(),
        faults: Vec::new(),
        calibration: known.clone(),
    };
    for wheel in Wheel::ALL {
        let rows: Vec<&RigLoad> = loads.iter().filter(|load| load.wheel == wheel).collect();
        if rows.is_empty() {
            let note = format!("{wheel} was not loaded; its gains stay as they were");
            rig.findings.notes.push(note);
            continue;
        }
        enough(wheel, &rows).map_err(|refusal| refusal.of(WHAT))?;
        let members = rows
            .iter()
            .map(|load| members(vehicle, sensors, load))
            .collect::<Result<Vec<_>, _>>()?;
        rig.corner(&resolved, wheel, &rows, &members);
    }
    if rig.sensitivity.is_empty() {
        return Err(Refusal::Missing {
            what: WHAT.to_owned(),
            channel: "load on any wheel".to_owned(),
            help: "mark each load while it is on, such as `atvrec mark \"rig FL 0 0 1000\"` \
                   (forward, left, up in N)"
                .to_owned(),
        }
        .into());
    }
    let notes: Vec<String> = rig.faults.iter().map(ToString::to_string).collect();
    rig.findings.notes.extend(notes);
    Ok(rig)
}

fn enough(wheel: Wheel, rows: &[&RigLoad]) -> Result<(), Refusal> {
    let refuse = |quantity: String, found: f64, needed: f64, unit: &str| {
        Err(Refusal::NotExcited {
            what: String::new(),
            quantity,
            found,
            needed,
            unit: unit.to_owned(),
            help: "push the wheel up, forward, backward, left and right".to_owned(),
        })
    };
    if rows.len() < LOADS_NEEDED {
        let name = format!("number of loads on {wheel}");
        return refuse(name, rows.len() as f64, LOADS_NEEDED as f64, "-");
    }
    for (axis, name) in ["F_x", "F_y", "F_z"].into_iter().enumerate() {
        let values: Vec<f64> = rows.iter().map(|row| row.force_n[axis]).collect();
        let spread = spread(&values);
        if spread < SPREAD_NEEDED_N[axis] {
            let name = format!("spread of {name} on {wheel} (rms)");
            return refuse(name, spread, SPREAD_NEEDED_N[axis], "N");
        }
    }
    Ok(())
}

/// What a load makes of each channel's member: N of tension, N m of bending.
fn members(
    vehicle: &Vehicle,
    sensors: &Sensors,
    load: &RigLoad,
) -> Result<[f64; StrainChannel::COUNT], EstimatorError> {
    let told =
        |error: model::suspension::SuspensionError| EstimatorError::Suspension(error.to_string());
    let corner = Corner::of(vehicle, load.wheel).map_err(told)?;
    let axle = axle_of(vehicle, load.wheel);
    let unsprung = axle
        .unsprung
        .as_ref()
        .ok_or_else(|| EstimatorError::Suspension("unsprung masses are missing".to_owned()))?;
    let rack_m = if load.wheel.is_front() {
        vehicle.steering.rack_m_rad.unwrap_or(0.0) * load.hand_wheel_rad
    } else {
        0.0
    };
    let length_m = corner.design_strut_length_m() - load.compression_m;
    let pose = corner.pose(length_m, rack_m).map_err(told)?;
    let pressed_m = load.force_n[2] / axle.tyre.vertical_stiffness_n_m;
    let frame = TyreFrame::new(
        &pose,
        Vector3::z(),
        axle.tyre.unloaded_radius_m,
        pressed_m.max(0.0),
    );
    let motion = CornerMotion::at_rest(Vector3::z() * STANDARD_GRAVITY_M_S2);
    let statics = CornerStatics::new(
        &corner,
        &pose,
        &frame,
        unsprung,
        &motion,
        ChannelKind::BallNormal,
    )
    .map_err(told)?;
    // Forward and left at hub height: about the contact point they have the moment h z x F.
    let [x, y, _] = load.force_n;
    let height_m = axle.tyre.unloaded_radius_m - pressed_m.max(0.0);
    let members = statics.members(&Wrench {
        force_n: load.force_n.into(),
        moment_n_m: Vector3::new(-height_m * y, height_m * x, 0.0),
    });
    let arm_m = sensors.strain.bending_moment_per_ball_normal_m();
    let moment = members.sixth_n * arm_m.unwrap_or(1.0);
    let forces = members.to_vector();
    Ok([
        forces[0], forces[1], forces[2], forces[3], forces[4], moment, moment,
    ])
}

impl LoadRig {
    fn corner(
        &mut self,
        resolved: &Resolved,
        wheel: Wheel,
        rows: &[&RigLoad],
        members: &[[f64; StrainChannel::COUNT]],
    ) {
        let mut figure = Figure {
            title: format!("{wheel}: counts against the member's force"),
            x_label: "force by the linkage (N, bending N m)".to_owned(),
            y_label: "counts from the zero".to_owned(),
            series: Vec::new(),
        };
        for channel in StrainChannel::ALL {
            let i = channel.index();
            let read: Vec<(usize, [f64; 2])> = rows
                .iter()
                .enumerate()
                .filter_map(|(k, row)| Some((k, row.counts[i]?)))
                .collect();
            if read.len() < LOADS_NEEDED {
                let absent = resolved.corners[wheel].strain[i].dead && read.is_empty();
                if !absent {
                    self.unread(wheel, channel, !read.is_empty());
                }
                continue;
            }
            let table = Table {
                counts: read.iter().map(|(_, counts)| counts[0]).collect(),
                sigma: read.iter().map(|(_, counts)| counts[1]).collect(),
                force: read.iter().map(|(k, _)| rows[*k].force_n).collect(),
                member: read.iter().map(|(k, _)| members[*k]).collect(),
            };
            let nominal = resolved.corners[wheel].strain[i].gain.abs();
            let fault = table.wiring(channel, nominal);
            self.faults.extend(fault.map(|kind| WiringFault {
                wheel,
                channel,
                kind,
            }));
            let sign = if fault == Some(WiringKind::Inverted) {
                -1.0
            } else {
                1.0
            };
            let sensitivity = table.sensitivity(i, sign / nominal);
            self.sensitivity.push((wheel, channel, sensitivity));
            let corner = self.calibration.corner.entry(wheel).or_default();
            let slot = corner.strain.entry(channel).or_default();
            if fault.is_some_and(|kind| kind != WiringKind::Inverted) {
                slot.dead = true;
                continue;
            }
            let line = table.line(i, sign / nominal);
            *slot = ChannelCalibration {
                offset_counts: Some(line.offset[0]),
                offset_sigma_counts: Some(line.offset[1]),
                gain_per_count: Some(1.0 / line.slope[0]),
                dead: false,
            };
            self.tell(wheel, channel, &table, &line);
            figure.series.push(Series {
                name: channel.name().to_owned(),
                line: false,
                x: table.member.iter().map(|member| member[i]).collect(),
                y: table
                    .counts
                    .iter()
                    .map(|count| count - line.offset[0])
                    .collect(),
            });
        }
        self.findings.figures.push(figure);
    }

    /// A channel without enough readings within its range.
    fn unread(&mut self, wheel: Wheel, channel: StrainChannel, sometimes: bool) {
        let corner = self.calibration.corner.entry(wheel).or_default();
        corner.strain.entry(channel).or_default().dead = true;
        self.faults.push(WiringFault {
            wheel,
            channel,
            kind: if sometimes {
                WiringKind::OutOfRange
            } else {
                WiringKind::Silent
            },
        });
    }

    fn tell(&mut self, wheel: Wheel, channel: StrainChannel, table: &Table, line: &Line) {
        let i = channel.index();
        let member: Vec<f64> = table.member.iter().map(|member| member[i]).collect();
        let bends = matches!(
            channel,
            StrainChannel::LowerFrontBending | StrainChannel::LowerRearBending
        );
        let (gain_unit, unit) = if bends {
            ("N m/count", "N m")
        } else {
            ("N/count", "N")
        };
        let gain = 1.0 / line.slope[0];
        let parts = [
            ("gain", gain, line.slope[1] * gain * gain, gain_unit),
            ("offset", line.offset[0], line.offset[1], "counts"),
        ];
        for (name, value, sigma, of) in parts {
            self.findings.findings.push(Finding {
                name: format!("{wheel} {} {name}", channel.name()),
                value,
                unit: of.to_owned(),
                sigma,
                interval: Some([value - 1.96 * sigma, value + 1.96 * sigma]),
                condition: line.condition,
                excitation: Some(Excitation {
                    rms: spread(&member),
                    unit: unit.to_owned(),
                }),
                whiteness: Some(whiteness(&line.residuals)),
                span: Span {
                    rows: member.len(),
                    ..Span::default()
                },
            });
        }
    }
}

/// One channel's counts, the known forces, and what they make of each member.
struct Table {
    counts: Vec<f64>,
    sigma: Vec<f64>,
    force: Vec<[f64; 3]>,
    member: Vec<[f64; StrainChannel::COUNT]>,
}

/// counts = offset + slope member.
struct Line {
    offset: [f64; 2],
    slope: [f64; 2],
    condition: f64,
    residuals: Vec<f64>,
}

impl Table {
    /// What is wrong, if anything.
    fn wiring(&self, channel: StrainChannel, nominal: f64) -> Option<WiringKind> {
        let own = self.explained(channel.index());
        let change = spread(&self.counts);
        let expected = spread(&self.column(channel.index())) / nominal;
        if change < 0.15 * expected.max(CHANGE_NEEDED) {
            return (expected > CHANGE_NEEDED).then_some(WiringKind::NoReaction);
        }
        let sound = own.0 > EXPLAINED
            && (1.0 / GAIN_WITHIN..GAIN_WITHIN).contains(&(own.1.abs() * nominal));
        let best = StrainChannel::ALL
            .into_iter()
            .take(6)
            .map(|other| (other, self.explained(other.index())))
            .max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let better = best
            .filter(|(other, (part, _))| *other != channel && 1.0 - part < 0.25 * (1.0 - own.0));
        match better {
            Some((other, (part, _))) if part > EXPLAINED && !sound => {
                if other == StrainChannel::LowerFrontBending {
                    Some(WiringKind::Bending)
                } else {
                    Some(WiringKind::Swapped(other))
                }
            }
            _ if sound && own.1 < 0.0 => Some(WiringKind::Inverted),
            _ if sound => None,
            _ if own.0 > EXPLAINED && own.1.abs() * nominal > GAIN_WITHIN => {
                Some(WiringKind::Bending)
            }
            _ => Some(WiringKind::Unexplained),
        }
    }

    fn column(&self, member: usize) -> Vec<f64> {
        self.member.iter().map(|row| row[member]).collect()
    }

    /// The part of the counts' changes that a member explains, and counts for one unit of it.
    fn explained(&self, member: usize) -> (f64, f64) {
        let x = self.column(member);
        let n = x.len() as f64;
        let (mx, my) = (
            x.iter().sum::<f64>() / n,
            self.counts.iter().sum::<f64>() / n,
        );
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (x, y) in x.iter().zip(&self.counts) {
            xx += (x - mx).powi(2);
            xy += (x - mx) * (y - my);
            yy += (y - my).powi(2);
        }
        if xx > 0.0 && yy > 0.0 {
            (xy * xy / (xx * yy), xy / xx)
        } else {
            (0.0, 0.0)
        }
    }

    /// The channel's line, with the sensors file's slope as its prior.
    fn line(&self, member: usize, slope: f64) -> Line {
        let x = self.column(member);
        let most = x.iter().fold(0.0_f64, |most, x| most.max(x.abs())) * slope.abs();
        let mut normal = nalgebra::Matrix2::new(0.0, 0.0, 0.0, 1.0 / (GAIN_PRIOR * slope).powi(2));
        let mut right = nalgebra::Vector2::new(0.0, slope * normal[(1, 1)]);
        for (k, x) in x.iter().enumerate() {
            let weight = 1.0 / (self.sigma[k].powi(2) + (GEOMETRY_SIGMA * most).powi(2)).max(1e-6);
            let row = nalgebra::Vector2::new(1.0, *x);
            normal += row * row.transpose() * weight;
            right += row * self.counts[k] * weight;
        }
        let covariance = normal.try_inverse().unwrap_or_default();
        let solution = covariance * right;
        let residuals = x.iter().zip(&self.counts);
        let residuals: Vec<f64> = residuals
            .map(|(x, y)| y - solution[0] - solution[1] * x)
            .collect();
        let correlation =
            covariance[(0, 1)].abs() / (covariance[(0, 0)] * covariance[(1, 1)]).sqrt();
        Line {
            offset: [solution[0], covariance[(0, 0)].sqrt()],
            slope: [solution[1], covariance[(1, 1)].sqrt()],
            condition: ((1.0 + correlation) / (1.0 - correlation).max(1e-9)).sqrt(),
            residuals,
        }
    }

    /// Counts for a newton of F_x, F_y, F_z, the geometry's with the nominal slope as the prior.
    fn sensitivity(&self, member: usize, slope: f64) -> [f64; 3] {
        let x = self.column(member);
        let none = Vector4::zeros();
        let geometry = self.solve(&x, &vec![1.0; x.len()], none, 1e-9);
        let mut prior = geometry * slope;
        prior[3] = 512.0;
        let size = prior.fixed_rows::<3>(0).norm();
        let strength = 1.0 / (GEOMETRY_PRIOR * size).powi(2).max(1e-12);
        let weights: Vec<f64> = self
            .sigma
            .iter()
            .map(|s| 1.0 / s.powi(2).max(1e-4))
            .collect();
        let found = self.solve(&self.counts, &weights, prior, strength);
        [found[0], found[1], found[2]]
    }

    /// Weighted least squares of `y` on the forces and a constant, drawn to a prior.
    fn solve(
        &self,
        y: &[f64],
        weights: &[f64],
        prior: Vector4<f64>,
        strength: f64,
    ) -> Vector4<f64> {
        let mut normal = Matrix4::from_diagonal(&Vector4::new(strength, strength, strength, 1e-9));
        let mut right = normal * prior;
        for ((force, y), weight) in self.force.iter().zip(y).zip(weights) {
            let row = Vector4::new(force[0], force[1], force[2], 1.0);
            normal += row * row.transpose() * *weight;
            right += row * *y * *weight;
        }
        normal
            .try_inverse()
            .map_or(prior, |inverse| inverse * right)
    }
}

/// Root mean square from the mean.
fn spread(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}
