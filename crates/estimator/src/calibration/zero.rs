//! Zeros of strain bridges and potentiometers from wheels that hang free (thesis section 3.5), and
//! what is wrong with a channel.
//!
//! The thesis takes the legs of a hanging wheel to be free of load. They carry wheel, upright and
//! arms against coil and droop stop; the zero is what is left without these forces:
//!
//! offset = mean of the counts - F_hanging / gain

use std::fmt;

use model::sensors::Sensors;
use model::suspension::{
    ChannelKind, Corner, CornerMotion, CornerStatics, MemberForces, SuspensionError, TyreFrame,
    Wrench, ground_plane,
};
use model::vehicle::{Axle, Vehicle};
use nalgebra::Vector3;
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use super::rest::Rest;
use super::{Calibration, Channel, ChannelCalibration, Resolved};
use crate::EstimatorError;
use crate::finding::{Figure, Finding, Findings, Refusal, Series};

/// What is looked for, in messages.
const WHAT: &str = "zero";
/// Drift is named beyond this many standard deviations, and beyond this size, counts/s.
const DRIFT: [f64; 2] = [4.5, 0.02];
/// How long a drive is that a drifting channel has to serve, s: what its offset may go astray.
const DRIVE_S: f64 = 300.0;
/// Short means that differ this much more than noise lets them are a fault.
const UNSTEADY: f64 = 3.0;
/// Noise beyond this multiple of the sensors file's is a fault.
const NOISY: f64 = 3.0;
/// Part of readings at the range's end that makes a channel saturated.
const SATURATED: f64 = 0.2;
/// Part of the range that an offset may take before it is named.
const FAR_OFF: f64 = 0.25;
/// Least expected change from hanging to standing that tells a sign, counts.
const TELLING_COUNTS: f64 = 8.0;
/// Measured change over the expected one: below the first the channel is inverted, below the second
/// (in size) it does not react, above the third (in size) it reads bending.
const RATIOS: [f64; 3] = [-0.35, 0.3, 2.6];
/// How far the strut may be from where it hangs, m.
const HANGING_WITHIN_M: f64 = 0.015;

/// What a corner's channels say at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CornerRest {
    /// Strain channels in the order of [`StrainChannel::ALL`].
    pub strain: [Option<Rest>; StrainChannel::COUNT],
    /// Spring potentiometer.
    pub deflection: Option<Rest>,
}

/// What the zero is found from.
#[derive(Clone, Copy, Debug)]
pub struct ZeroInput<'a> {
    /// The vehicle, with linkage, strut and unsprung masses.
    pub vehicle: &'a Vehicle,
    /// Its sensors.
    pub sensors: &'a Sensors,
    /// What is known already; its gains are used.
    pub known: &'a Calibration,
    /// Channels with all wheels hanging.
    pub hanging: &'a PerWheel<CornerRest>,
    /// Channels with all wheels on the ground, after the tyres have rolled free of their scrub:
    /// what tells signs and wiring.
    pub standing: Option<&'a PerWheel<CornerRest>>,
    /// Specific force with the wheels hanging, body axes, m/s^2: how the stands tilt the body;
    /// (0, 0, g) on level ones.
    pub specific_force_m_s2: [f64; 3],
    /// Hand wheel with the wheels hanging, and on the ground, rad.
    pub hand_wheel_rad: [f64; 2],
    /// Standard deviation of the hanging forces of the model, as a part of them.
    pub weight_sigma: f64,
}

/// The zeros.
#[derive(Clone, Debug, PartialEq)]
pub struct Zero {
    /// Offsets with their deviations, and the notes on faults.
    pub findings: Findings,
    /// What is wrong with which channel.
    pub faults: Vec<ChannelFault>,
    /// The calibration with the zeros in it.
    pub calibration: Calibration,
}

/// Something wrong with a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelFault {
    /// Corner.
    pub wheel: Wheel,
    /// Strain channel; without one, the spring potentiometer.
    pub channel: Option<StrainChannel>,
    /// What it is.
    pub kind: FaultKind,
}

/// What is wrong with a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// No reading at all.
    Silent,
    /// At the lower end of the range: a wire is off.
    Dead,
    /// At the upper end of the range.
    Saturated,
    /// Every reading is the same.
    Frozen,
    /// The level runs away.
    Drifting {
        /// How fast, counts/s.
        counts_per_s: f64,
    },
    /// The level jumps or wanders.
    Unsteady,
    /// More noise than the sensors file says.
    Noisy {
        /// How much, counts.
        counts: f64,
    },
    /// The zero is far from the middle of the range.
    FarOff {
        /// Zero, counts.
        counts: f64,
    },
    /// It falls where it should rise.
    Inverted,
    /// It does not react to load: a bridge that is not glued, or wired to read bending where there
    /// is none.
    NoReaction {
        /// Change from hanging to standing that was expected, counts.
        expected: f64,
        /// Change that was found, counts.
        found: f64,
    },
    /// It reacts far too strongly: its gauges stand in adjacent arms of the bridge (thesis section
    /// 5.2.1).
    Bending {
        /// Change from hanging to standing that was expected, counts.
        expected: f64,
        /// Change that was found, counts.
        found: f64,
    },
}

impl FaultKind {
    /// Whether the channel is of no use until it is mended.
    #[must_use]
    pub const fn disables(self) -> bool {
        matches!(
            self,
            Self::Silent
                | Self::Dead
                | Self::Saturated
                | Self::Frozen
                | Self::NoReaction { .. }
                | Self::Bending { .. }
        )
    }
}

impl fmt::Display for ChannelFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channel = self.channel.map_or("deflection", StrainChannel::name);
        write!(f, "{} {channel} ", self.wheel)?;
        match self.kind {
            FaultKind::Silent => write!(f, "sends nothing; it is called dead"),
            FaultKind::Dead => write!(
                f,
                "is dead: the converter stands at 0, look for a torn wire"
            ),
            FaultKind::Saturated => {
                write!(
                    f,
                    "is saturated at the top of its range; balance the bridge"
                )
            }
            FaultKind::Frozen => write!(f, "is frozen: every reading is the same"),
            FaultKind::Drifting { counts_per_s } => write!(
                f,
                "drifts by {counts_per_s:.3} counts/s; let it warm up, or look at glue and moisture"
            ),
            FaultKind::Unsteady => write!(f, "is unsteady: its level jumps or wanders"),
            FaultKind::Noisy { counts } => write!(f, "is noisy: {counts:.1} counts"),
            FaultKind::FarOff { counts } => write!(
                f,
                "has its zero at {counts:.0} counts, far from the middle; balance the bridge"
            ),
            FaultKind::Inverted => {
                write!(
                    f,
                    "is wired the other way round; its gain is written negative"
                )
            }
            FaultKind::NoReaction { expected, found } => write!(
                f,
                "does not react to load ({found:.0} counts where {expected:.0} were expected): \
                 look at glue and wiring; it is called dead"
            ),
            FaultKind::Bending { expected, found } => write!(
                f,
                "reads bending ({found:.0} counts where {expected:.0} were expected): its gauges \
                 stand in adjacent arms of the bridge; it is called dead"
            ),
        }
    }
}

/// Finds the zeros.
///
/// # Errors
/// A vehicle without linkage, a calibration of another vehicle, wheels that do not hang.
pub fn zero(input: &ZeroInput<'_>) -> Result<Zero, EstimatorError> {
    if input.known.vehicle != input.vehicle.name {
        return Err(EstimatorError::OtherVehicle {
            expected: input.vehicle.name.clone(),
            found: input.known.vehicle.clone(),
        });
    }
    let resolved = Resolved::new(input.sensors, input.known)?;
    let mut zero = Zero {
        findings: Findings {
            what: "zeros of strain bridges and potentiometers".to_owned(),
            ..Findings::default()
        },
        faults: Vec::new(),
        calibration: input.known.clone(),
    };
    let mut corners = Vec::new();
    for wheel in Wheel::ALL {
        corners.push(CornerLoads::new(input, wheel)?);
    }
    refuse_unless_hanging(input, &resolved, &corners)?;
    for (wheel, loads) in Wheel::ALL.into_iter().zip(&corners) {
        for channel in StrainChannel::ALL {
            let chain = &resolved.corners[wheel].strain[channel.index()];
            // A channel that the sensors file does not have.
            if chain.dead && input.hanging[wheel].strain[channel.index()].is_none() {
                continue;
            }
            let said = Said::new(input, wheel, Some(channel));
            let i = channel.index();
            let expected = [loads.hanging[i], loads.standing[i]];
            zero.channel(
                wheel,
                Some(channel),
                chain,
                &said,
                expected,
                input.weight_sigma,
            );
        }
        let said = Said::new(input, wheel, None);
        let chain = &resolved.corners[wheel].deflection;
        zero.channel(wheel, None, chain, &said, loads.compression_m, 0.0);
    }
    if input.standing.is_none() {
        zero.findings.notes.push(
            "signs and wiring were not checked: lower the vehicle, roll it until the tyres have \
             let go of their scrub, and let it stand in the same log"
                .to_owned(),
        );
    }
    let notes = zero.faults.iter().map(ToString::to_string);
    zero.findings.notes.extend(notes.collect::<Vec<_>>());
    zero.findings
        .figures
        .push(figure(input, &corners, &resolved));
    Ok(zero)
}

/// Loads that the model expects of a corner's channels.
struct CornerLoads {
    /// Channels' values with the wheel hanging.
    hanging: [f64; StrainChannel::COUNT],
    /// Channels' values on level ground.
    standing: [f64; StrainChannel::COUNT],
    /// Compression from the design length, hanging and on the ground, m.
    compression_m: [f64; 2],
}

impl CornerLoads {
    fn new(input: &ZeroInput<'_>, wheel: Wheel) -> Result<Self, EstimatorError> {
        let told = |error: SuspensionError| EstimatorError::Suspension(error.to_string());
        let vehicle = input.vehicle;
        let axle = axle_of(vehicle, wheel);
        let corner = Corner::of(vehicle, wheel).map_err(told)?;
        let rack = |hand_wheel_rad: f64| {
            if wheel.is_front() {
                vehicle.steering.rack_m_rad.unwrap_or(0.0) * hand_wheel_rad
            } else {
                0.0
            }
        };
        let gravity = Vector3::from(input.specific_force_m_s2);
        let hanging = corner
            .hanging(axle, rack(input.hand_wheel_rad[0]), gravity)
            .map_err(told)?;
        let arm_m = input
            .sensors
            .strain
            .bending_moment_per_ball_normal_m()
            .unwrap_or(0.0);
        let standing = standing(vehicle, &corner, rack(input.hand_wheel_rad[1])).map_err(told)?;
        let design_m = axle.strut.as_ref().map_or_else(
            || corner.design_strut_length_m(),
            |strut| strut.design_length_m,
        );
        Ok(Self {
            hanging: values(&hanging.members, hanging.ball_normal_n * arm_m),
            standing: values(&standing.0, standing.1 * arm_m),
            compression_m: [
                design_m - hanging.pose.strut_length_m,
                design_m - standing.2,
            ],
        })
    }
}

/// How the body stands on its springs on level ground, by the vehicle file: roll (right side down)
/// and pitch (nose down) from the axes of the hard-points, rad.
///
/// # Errors
/// A vehicle without linkage.
pub fn rest_roll_pitch_rad(vehicle: &Vehicle) -> Result<[f64; 2], EstimatorError> {
    let told = |error: SuspensionError| EstimatorError::Suspension(error.to_string());
    let mut poses = Vec::new();
    for wheel in Wheel::ALL {
        let corner = Corner::of(vehicle, wheel).map_err(told)?;
        let length_m = standing(vehicle, &corner, 0.0).map_err(told)?.2;
        poses.push(corner.pose(length_m, 0.0).map_err(told)?);
    }
    let tyre = |wheel: Wheel| &axle_of(vehicle, wheel).tyre;
    let plane = ground_plane(
        &PerWheel::from_fn(|wheel| poses[wheel.index()]),
        &PerWheel::from_fn(|wheel| tyre(wheel).unloaded_radius_m),
        &PerWheel::from_fn(|wheel| {
            static_load_n(vehicle, wheel) / tyre(wheel).vertical_stiffness_n_m
        }),
        &PerWheel([1.0; 4]),
    );
    Ok(plane.map_or([0.0; 2], |plane| plane.body_roll_pitch_rad()))
}

/// The axle of a wheel.
pub(crate) fn axle_of(vehicle: &Vehicle, wheel: Wheel) -> &Axle {
    if wheel.is_front() {
        &vehicle.front
    } else {
        &vehicle.rear
    }
}

/// Load of a wheel on level ground at rest, N.
pub(crate) fn static_load_n(vehicle: &Vehicle, wheel: Wheel) -> f64 {
    let body = &vehicle.body;
    let arm_m = if wheel.is_front() {
        body.cg_to_rear_axle_m
    } else {
        body.front_axle_to_cg_m
    };
    0.5 * body.mass_kg * STANDARD_GRAVITY_M_S2 * arm_m / vehicle.wheelbase_m()
}

/// Members, ball-normal force and strut length of a corner on level ground under its static load.
fn standing(
    vehicle: &Vehicle,
    corner: &Corner,
    rack_m: f64,
) -> Result<(MemberForces, f64, f64), SuspensionError> {
    let wheel = corner.wheel;
    let axle = axle_of(vehicle, wheel);
    let load_n = static_load_n(vehicle, wheel);
    let (Some(strut), Some(unsprung)) = (&axle.strut, &axle.unsprung) else {
        return Err(SuspensionError::Missing {
            axle: if wheel.is_front() { "front" } else { "rear" },
            table: "strut",
        });
    };
    let motion = CornerMotion::at_rest(Vector3::z() * STANDARD_GRAVITY_M_S2);
    let wrench = Wrench {
        force_n: Vector3::z() * load_n,
        ..Wrench::default()
    };
    let mut length_m = corner.design_strut_length_m();
    for _ in 0..60 {
        let pose = corner.pose(length_m, rack_m)?;
        let compression_m = load_n / axle.tyre.vertical_stiffness_n_m;
        let radius_m = axle.tyre.unloaded_radius_m;
        let frame = TyreFrame::new(&pose, Vector3::z(), radius_m, compression_m);
        let statics =
            CornerStatics::new(corner, &pose, &frame, unsprung, &motion, ChannelKind::Strut)?;
        let members = statics.members(&wrench);
        let missing_n = members.sixth_n - strut.force(length_m, 0.0).total_n();
        let step_m = (-missing_n / strut.stiffness_at(length_m)).clamp(-0.01, 0.01);
        if step_m.abs() < 1e-7 {
            return Ok((members, statics.ball_normal_n(&members), length_m));
        }
        length_m += step_m;
    }
    Err(SuspensionError::OutOfReach {
        what: "strut length on the ground",
        value: length_m,
        unit: "m",
    })
}

fn values(members: &MemberForces, moment_n_m: f64) -> [f64; StrainChannel::COUNT] {
    [
        members.upper_front_n,
        members.upper_rear_n,
        members.lower_front_n,
        members.lower_rear_n,
        members.tie_rod_n,
        moment_n_m,
        moment_n_m,
    ]
}

/// What a channel said, hanging and standing, and what the sensors file says of it.
struct Said<'a> {
    hanging: Option<&'a Rest>,
    standing: Option<&'a Rest>,
    noise_counts: f64,
}

impl<'a> Said<'a> {
    fn new(input: &ZeroInput<'a>, wheel: Wheel, channel: Option<StrainChannel>) -> Self {
        let of = |corner: &'a CornerRest| match channel {
            Some(channel) => corner.strain[channel.index()].as_ref(),
            None => corner.deflection.as_ref(),
        };
        Self {
            hanging: of(&input.hanging[wheel]),
            standing: input.standing.and_then(|corners| of(&corners[wheel])),
            noise_counts: if channel.is_some() {
                input.sensors.strain.noise_counts
            } else {
                input.sensors.deflection.noise_counts
            },
        }
    }
}

impl Zero {
    /// One channel: `expected` are its values hanging and on the ground, in its own unit.
    fn channel(
        &mut self,
        wheel: Wheel,
        channel: Option<StrainChannel>,
        chain: &Channel,
        said: &Said<'_>,
        expected: [f64; 2],
        weight_sigma: f64,
    ) {
        let faults = faults_of(chain, said, expected);
        let inverted = faults.contains(&FaultKind::Inverted);
        // A gain that is known to be negative is the wiring's already.
        let gain = if inverted { -chain.gain } else { chain.gain };
        let corner = self.calibration.corner.entry(wheel).or_default();
        let slot = match channel {
            Some(channel) => corner.strain.entry(channel).or_default(),
            None => &mut corner.deflection,
        };
        slot.dead = faults.iter().any(|fault| fault.disables());
        if let Some(rest) = said.hanging.filter(|_| !slot.dead) {
            let offset = rest.mean - expected[0] / gain;
            let drift = faults.iter().find_map(|fault| match fault {
                FaultKind::Drifting { counts_per_s } => Some(counts_per_s.abs() * DRIVE_S),
                _ => None,
            });
            let model = weight_sigma * expected[0] / gain;
            let sigma = rest.mean_sigma.hypot(model);
            *slot = ChannelCalibration {
                offset_counts: Some(offset),
                offset_sigma_counts: Some(sigma.hypot(drift.unwrap_or(0.0))),
                gain_per_count: if inverted {
                    Some(gain)
                } else {
                    slot.gain_per_count
                },
                dead: false,
            };
            let shift = offset - rest.mean;
            let name = channel.map_or("deflection", StrainChannel::name);
            self.findings.findings.push(Finding {
                name: format!("{wheel} {name} offset"),
                value: offset,
                unit: "counts".to_owned(),
                sigma,
                interval: rest.interval.map(|ends| ends.map(|end| end + shift)),
                condition: 1.0,
                excitation: None,
                whiteness: Some(rest.whiteness),
                span: rest.span,
            });
        }
        self.faults
            .extend(faults.into_iter().map(|kind| ChannelFault {
                wheel,
                channel,
                kind,
            }));
    }
}

fn faults_of(chain: &Channel, said: &Said<'_>, expected: [f64; 2]) -> Vec<FaultKind> {
    let Some(rest) = said.hanging else {
        return vec![FaultKind::Silent];
    };
    let full = f64::from(chain.counts_max) + 1.0;
    if rest.saturated > SATURATED {
        let dead = rest.mean < 0.5 * full;
        return vec![if dead {
            FaultKind::Dead
        } else {
            FaultKind::Saturated
        }];
    }
    if rest.unmoved && chain.noisy {
        return vec![FaultKind::Frozen];
    }
    let mut faults = Vec::new();
    let slope = rest.slope_per_s.abs();
    if slope > DRIFT[0] * rest.slope_sigma && slope > DRIFT[1] {
        faults.push(FaultKind::Drifting {
            counts_per_s: rest.slope_per_s,
        });
    }
    if rest.unsteadiness > UNSTEADY {
        faults.push(FaultKind::Unsteady);
    }
    if rest.noise > NOISY * said.noise_counts.hypot(1.0 / 12.0_f64.sqrt()) {
        faults.push(FaultKind::Noisy { counts: rest.noise });
    }
    let drifted = slope
        * said
            .standing
            .map_or(0.0, |s| s.span.from_s - rest.span.from_s);
    let wiring = said.standing.and_then(|standing| {
        wiring(
            chain,
            rest,
            standing,
            (expected[1] - expected[0]) / chain.gain,
            drifted,
        )
    });
    let turned = wiring == Some(FaultKind::Inverted);
    let gain = if turned { -chain.gain } else { chain.gain };
    let offset = rest.mean - expected[0] / gain;
    if (offset / full - 0.5).abs() > FAR_OFF {
        faults.push(FaultKind::FarOff { counts: offset });
    }
    faults.extend(wiring);
    faults
}

/// What the change from hanging to standing says of a channel's wiring.
fn wiring(
    chain: &Channel,
    hanging: &Rest,
    standing: &Rest,
    expected: f64,
    drifted: f64,
) -> Option<FaultKind> {
    let found = standing.mean - hanging.mean;
    let bending = FaultKind::Bending { expected, found };
    let room = if expected > 0.0 {
        f64::from(chain.counts_max) - hanging.mean
    } else {
        hanging.mean
    };
    if standing.saturated > SATURATED && expected.abs() < 0.7 * room {
        return Some(bending);
    }
    // A channel that hardly feels the load is told by reacting all the same.
    if expected.abs() < TELLING_COUNTS + drifted {
        let most = RATIOS[2] * (TELLING_COUNTS + drifted) + expected.abs();
        return (found.abs() > most).then_some(bending);
    }
    let ratio = found / expected;
    if ratio.abs() > RATIOS[2] {
        Some(bending)
    } else if ratio < RATIOS[0] {
        Some(FaultKind::Inverted)
    } else if ratio < RATIOS[1] {
        Some(FaultKind::NoReaction { expected, found })
    } else {
        None
    }
}

/// Refuses a log on which the potentiometers do not stand where hanging wheels put them.
fn refuse_unless_hanging(
    input: &ZeroInput<'_>,
    resolved: &Resolved,
    corners: &[CornerLoads],
) -> Result<(), EstimatorError> {
    let mut away_m: Vec<f64> = Wheel::ALL
        .into_iter()
        .zip(corners)
        .filter_map(|(wheel, loads)| {
            let rest = input.hanging[wheel].deflection.as_ref()?;
            let chain = &resolved.corners[wheel].deflection;
            (rest.saturated <= SATURATED && !(rest.unmoved && chain.noisy))
                .then(|| chain.gain * (rest.mean - chain.offset_counts) - loads.compression_m[0])
        })
        .collect();
    away_m.sort_by(f64::total_cmp);
    let refused = |refusal: Refusal| Err(EstimatorError::from(refusal.of(WHAT)));
    let Some(middle_m) = away_m.get(away_m.len() / 2).copied() else {
        return refused(Refusal::Missing {
            what: String::new(),
            channel: "living deflection channel".to_owned(),
            help: "the wheels cannot be seen to hang; mend a potentiometer".to_owned(),
        });
    };
    if middle_m.abs() <= HANGING_WITHIN_M {
        return Ok(());
    }
    refused(Refusal::Value {
        what: String::new(),
        name: "spring deflection (median of the corners, from where the wheels hang)".to_owned(),
        value: middle_m,
        expected: format!(
            "at most {HANGING_WITHIN_M} m; put the vehicle on stands so that all wheels hang, for \
             10 s or more"
        ),
    })
}

/// Measured against expected change from hanging to standing.
fn figure(input: &ZeroInput<'_>, corners: &[CornerLoads], resolved: &Resolved) -> Figure {
    let (mut expected, mut found) = (Vec::new(), Vec::new());
    for (wheel, loads) in Wheel::ALL.into_iter().zip(corners) {
        let Some(standing) = input.standing else {
            break;
        };
        for channel in StrainChannel::ALL {
            let i = channel.index();
            let pair = (&input.hanging[wheel].strain[i], &standing[wheel].strain[i]);
            if let (Some(hanging), Some(standing)) = pair {
                let gain = resolved.corners[wheel].strain[i].gain;
                expected.push((loads.standing[i] - loads.hanging[i]) / gain);
                found.push(standing.mean - hanging.mean);
            }
        }
    }
    let (low, high) = expected.iter().fold((0.0_f64, 0.0_f64), |(low, high), x| {
        (low.min(*x), high.max(*x))
    });
    Figure {
        title: "From hanging to standing".to_owned(),
        x_label: "expected change (counts)".to_owned(),
        y_label: "measured change (counts)".to_owned(),
        series: vec![
            Series {
                name: "channels".to_owned(),
                line: false,
                x: expected,
                y: found,
            },
            Series {
                name: "as the model says".to_owned(),
                line: true,
                x: vec![low, high],
                y: vec![low, high],
            },
        ],
    }
}
