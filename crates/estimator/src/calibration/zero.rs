//! Zeros of strain bridges and potentiometers from wheels that hang free (thesis section 3.5), and
//! what is wrong with a channel.
//!
//! The thesis takes the legs of a hanging wheel to be free of load. They carry wheel, upright and
//! arms against coil and droop stop; the zero is what is left without these forces:
//!
//! offset = mean of the counts - F_hanging / gain

mod faults;
mod loads;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Mounting, PerWheel, StrainChannel, Wheel};

use self::faults::{SATURATED, faults_of};
use self::loads::CornerLoads;
use super::rest::Rest;
use super::{Calibration, Channel, ChannelCalibration, Resolved};
use crate::EstimatorError;
use crate::corners::link_of;
use crate::finding::{Figure, Finding, Findings, Refusal, Series};
use crate::statics::AXIAL;
use crate::statistics::{SIGMAS_95, interval_95};

pub use faults::{ChannelFault, FaultKind};
pub use loads::rest_roll_pitch_rad;

/// What is looked for, in messages.
const WHAT: &str = "zero";
/// How long a drive is that a drifting channel has to serve, s: what its offset may go astray.
const DRIVE_S: f64 = 300.0;
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
    /// Steering wheel with the wheels hanging, and on the ground, rad.
    pub steering_wheel_rad: [f64; 2],
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

/// Finds the zeros.
///
/// # Errors
/// A vehicle whose corners have neither hard-points nor motion ratios, strain channels without hard-points and
/// without a matrix, a calibration of another vehicle, wheels that do not hang.
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
        corners.push(CornerLoads::new(input, &resolved, wheel)?);
    }
    refuse_unless_hanging(input, &resolved, &corners)?;
    for (wheel, loads) in Wheel::ALL.into_iter().zip(&corners) {
        for channel in StrainChannel::ALL {
            let chain = &resolved.corners[wheel].strain[channel.index()];
            // A channel that the sensors file or the suspension does not have.
            let is_fitted = !chain.dead && is_on(input.vehicle, wheel, channel);
            if !is_fitted && input.hanging[wheel].strain[channel.index()].is_none() {
                continue;
            }
            let said = Said::new(input, wheel, Some(channel));
            let i = channel.index();
            let expected = [loads.hanging[i], loads.standing[i]];
            let by_weight = input.weight_sigma * expected[0];
            let model_sigma = math::hypot(by_weight, loads.sigma[i]);
            zero.channel(wheel, Some(channel), chain, &said, expected, model_sigma);
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

/// Whether the suspension of a wheel has what a channel measures.
fn is_on(vehicle: &Vehicle, wheel: Wheel, channel: StrainChannel) -> bool {
    let is_axial = AXIAL.contains(&channel);
    match vehicle.axle(wheel).mounting() {
        Some(Mounting::SolidAxle) => {
            let side = usize::from(!wheel.is_left());
            !is_axial || link_of(side, channel.index()).is_some()
        }
        Some(Mounting::Strut | Mounting::TrailingArm) => is_axial,
        Some(Mounting::Transducer) | None => true,
    }
}

/// What a channel said, hanging and standing, and what the sensors file says of it.
struct Said<'a> {
    hanging: Option<&'a Rest>,
    standing: Option<&'a Rest>,
    noise_counts: f64,
    mounting: Option<Mounting>,
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
            mounting: input.vehicle.axle(wheel).mounting(),
            noise_counts: if channel.is_some() {
                input.sensors.strain.noise_counts
            } else {
                input.sensors.deflection.noise_counts
            },
        }
    }
}

impl Zero {
    /// One channel: `expected` are its values hanging and on the ground, in its own unit, and `model_sigma` is the
    /// standard deviation of the first.
    fn channel(
        &mut self,
        wheel: Wheel,
        channel: Option<StrainChannel>,
        chain: &Channel,
        said: &Said<'_>,
        expected: [f64; 2],
        model_sigma: f64,
    ) {
        let faults = faults_of(chain, said, expected);
        let inverted = faults.contains(&FaultKind::Inverted);
        // A gain that is known to be negative is the wiring's already.
        let gain = if inverted { -chain.gain } else { chain.gain };
        let corner = self.calibration.corner.entry(wheel).or_default();
        let row = channel.and_then(|channel| {
            let matrix = corner.matrix.as_mut()?;
            matrix.channel.get_mut(&channel)
        });
        let has_row = row.is_some();
        if let Some(row) = row.filter(|_| inverted) {
            row.invert();
        }
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
            let sigma = math::hypot(rest.mean_sigma, model_sigma / gain);
            *slot = ChannelCalibration {
                offset_counts: Some(offset),
                offset_sigma_counts: Some(math::hypot(sigma, drift.unwrap_or(0.0))),
                gain_per_count: if inverted && !has_row {
                    Some(gain)
                } else {
                    slot.gain_per_count
                },
                dead: false,
                temperature: slot.temperature,
            };
            let name = channel.map_or("deflection", |channel| channel.name_on(said.mounting));
            self.findings.findings.push(Finding {
                name: format!("{wheel} {name} offset"),
                value: offset,
                unit: "counts".to_owned(),
                sigma,
                interval: Some(interval(rest, offset, sigma)),
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
                mounting: said.mounting,
                kind,
            }));
    }
}

/// Interval of an offset by the bootstrap of the readings, which knows neither the model's error nor the converter's
/// steps, as wide as its standard deviation.
fn interval(rest: &Rest, offset: f64, sigma: f64) -> [f64; 2] {
    let is_wide = |[low, high]: &[f64; 2]| high - low > 1e-9 * sigma;
    match rest.interval.filter(is_wide) {
        Some([low, high]) => {
            let widen = (2.0 * SIGMAS_95 * sigma / (high - low)).max(1.0);
            [low, high].map(|end| offset + widen * (end - rest.mean))
        }
        None => interval_95(offset, sigma),
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
            (rest.saturated <= SATURATED && !(rest.unmoved && chain.frozen_after.is_some()))
                .then(|| chain.gain * (rest.mean - chain.offset_counts) - loads.compression_m[0])
        })
        .collect();
    away_m.sort_by(f64::total_cmp);
    let refused = |refusal: Refusal| Err(EstimatorError::from(refusal.of(WHAT)));
    let Some(middle_m) = away_m.get(away_m.len() / 2).copied() else {
        return refused(Refusal::Missing {
            what: String::new(),
            channel: "living deflection channel".to_owned(),
            help: "the wheels cannot be seen to hang: each channel is absent, frozen or at an end of its range; \
                   mend a potentiometer, or mount one whose range contains the droop stop"
                .to_owned(),
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
