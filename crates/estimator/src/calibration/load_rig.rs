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
//!
//! A corner whose vehicle file has no hard-points is described by a matrix that the loads alone give
//! ([`crate::calibration::matrix`]).

mod faults;
mod matrix;
mod table;

use model::sensors::Sensors;
use model::suspension::{ChannelKind, Corner, CornerStatics, Wrench};
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{StrainChannel, Wheel};

use self::table::{Line, Table, spread};
use super::{Calibration, ChannelCalibration, Resolved};
use crate::EstimatorError;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::whiteness;
use crate::statistics::interval_95;

pub use faults::{WiringFault, WiringKind};

const WHAT: &str = "load-rig";
/// Least number of loads on a corner.
const LOADS_NEEDED: usize = 5;
/// Least spread (rms) of the force along each axis, N.
const SPREAD_NEEDED_N: [f64; 3] = [100.0, 100.0, 300.0];

/// One known load on one wheel, everything at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigLoad {
    /// The wheel.
    pub wheel: Wheel,
    /// Force on a plate in the wheel's place, N: forward, left, up.
    pub force_n: [f64; 3],
    /// Point through which it acts, from the wheel centre, m: forward, left, up. Zero at the hub.
    pub at_m: [f64; 3],
    /// Compression of the strut from its design length, m.
    pub compression_m: f64,
    /// Steering wheel, straight ahead 0, rad.
    pub steering_wheel_rad: f64,
    /// Mean counts of each strain channel and their deviations.
    pub counts: [Option<[f64; 2]>; StrainChannel::COUNT],
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadRig {
    /// Gains and offsets with their deviations, notes on wiring.
    pub findings: Findings,
    /// Counts for one newton of F_x, F_y, F_z of each channel: at the hub; of a corner without geometry F_y at
    /// the contact point.
    pub sensitivity: Vec<(Wheel, StrainChannel, [f64; 3])>,
    /// What is wrong with which channel.
    pub faults: Vec<WiringFault>,
    /// The calibration with gains and offsets in it.
    pub calibration: Calibration,
}

/// Finds gains and wiring.
///
/// # Errors
/// Too few loads on a corner, loads on a solid axle, loads that leave a direction out, a linkage that does not
/// assemble, a corner without geometry whose channels do not tell the three forces apart.
pub fn load_rig(
    vehicle: &Vehicle,
    sensors: &Sensors,
    known: &Calibration,
    loads: &[RigLoad],
) -> Result<LoadRig, EstimatorError> {
    let by_matrix = |wheel: Wheel| {
        let axle = vehicle.axle(wheel);
        !axle.has_hard_points() && !axle.is_solid()
    };
    let mut known = known.clone();
    // A matrix that is found again can be one that nobody could use.
    for load in loads.iter().filter(|load| by_matrix(load.wheel)) {
        known.corner.entry(load.wheel).or_default().matrix = None;
    }
    let resolved = Resolved::new(sensors, &known)?;
    let mut rig = LoadRig {
        findings: Findings {
            what: "gains of the strain bridges".to_owned(),
            ..Findings::default()
        },
        sensitivity: Vec::new(),
        faults: Vec::new(),
        calibration: known,
    };
    for wheel in Wheel::ALL {
        let rows: Vec<&RigLoad> = loads.iter().filter(|load| load.wheel == wheel).collect();
        if rows.is_empty() {
            let note = format!("{wheel} was not loaded; its gains stay as they were");
            rig.findings.notes.push(note);
            continue;
        }
        if vehicle.axle(wheel).is_solid() {
            return Err(EstimatorError::Suspension(format!(
                "{wheel} is on a solid axle, whose links share each load with those of the other wheel; find the gains \
                 of its links and tubes with `calibrate member`, and their zeros with `calibrate zero`"
            )));
        }
        if by_matrix(wheel) {
            rig.matrix_corner(vehicle, &resolved, wheel, &rows)?;
            continue;
        }
        enough(wheel, &rows).map_err(|refusal| refusal.of(WHAT))?;
        let members = rows
            .iter()
            .map(|load| members(vehicle, sensors, load))
            .collect::<Result<Vec<_>, _>>()?;
        rig.corner(vehicle, &resolved, wheel, &rows, &members);
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

/// What a load makes of each channel's member, by the linkage: N of tension, N m of bending.
///
/// # Errors
/// A vehicle without linkage, a strut or a rack beyond the linkage's reach.
pub fn members(
    vehicle: &Vehicle,
    sensors: &Sensors,
    load: &RigLoad,
) -> Result<[f64; StrainChannel::COUNT], EstimatorError> {
    let told =
        |error: model::suspension::SuspensionError| EstimatorError::Suspension(error.to_string());
    let corner = Corner::of(vehicle, load.wheel).map_err(told)?;
    let axle = vehicle.axle(load.wheel);
    let rack_m = if load.wheel.is_front() {
        vehicle.steering.rack_m_rad.unwrap_or(0.0) * load.steering_wheel_rad
    } else {
        0.0
    };
    let length_m = corner.design_strut_length_m() - load.compression_m;
    let pose = corner.pose(length_m, rack_m).map_err(told)?;
    let kind = ChannelKind::BallNormal;
    let load_n = load.force_n[2];
    let statics =
        CornerStatics::standing(&corner, &pose, axle, Vector3::z(), load_n, kind).map_err(told)?;
    // A force at the hub has the moment h z x F about the contact point.
    let pressed_m = (load_n / axle.tyre.vertical_stiffness_n_m).max(0.0);
    let height_m = axle.tyre.unloaded_radius_m - pressed_m;
    let arm_m = Vector3::from(load.at_m) + Vector3::z() * height_m;
    let force_n = Vector3::from(load.force_n);
    let members = statics.members(&Wrench {
        force_n,
        moment_n_m: arm_m.cross(&force_n),
    });
    let arm_m = sensors.strain.bending_moment_per_ball_normal_m();
    let moment = statics.ball_normal_n(&members) * arm_m.unwrap_or(1.0);
    let forces = members.to_vector();
    Ok([
        forces[0], forces[1], forces[2], forces[3], forces[4], moment, moment,
    ])
}

impl LoadRig {
    fn corner(
        &mut self,
        vehicle: &Vehicle,
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
        let mounting = vehicle.axle(wheel).mounting();
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
                    self.unread(vehicle, wheel, channel, !read.is_empty());
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
                mounting,
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
                temperature: slot.temperature,
            };
            let name = vehicle.channel_name(wheel, channel);
            self.tell(wheel, channel, name, &table, &line);
            figure.series.push(Series {
                name: name.to_owned(),
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
    fn unread(&mut self, vehicle: &Vehicle, wheel: Wheel, channel: StrainChannel, sometimes: bool) {
        let corner = self.calibration.corner.entry(wheel).or_default();
        corner.strain.entry(channel).or_default().dead = true;
        self.faults.push(WiringFault {
            wheel,
            channel,
            mounting: vehicle.axle(wheel).mounting(),
            kind: if sometimes {
                WiringKind::OutOfRange
            } else {
                WiringKind::Silent
            },
        });
    }

    fn tell(
        &mut self,
        wheel: Wheel,
        channel: StrainChannel,
        channel_name: &str,
        table: &Table,
        line: &Line,
    ) {
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
                name: format!("{wheel} {channel_name} {name}"),
                value,
                unit: of.to_owned(),
                sigma,
                interval: Some(interval_95(value, sigma)),
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
