//! The steps of a calibration, each from recordings and from what the steps before it found.

mod gnss;
mod hub;
mod imu;
mod marked;
mod temperature;
mod zero;

use crate::EstimatorError;
use crate::finding::Findings;

use super::{Calibration, Recording, RecordingError};

/// A step of the calibration.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Zeros of strain and deflection, on stands and on the ground.
    Zero {
        /// Standard deviation of the vehicle's weight, parts of it.
        weight_sigma: f64,
    },
    /// Biases and misalignment of the inertial unit.
    Imu,
    /// Lever arms, delays and misalignment of the receivers.
    Gnss,
    /// Weight on scales.
    Weight {
        /// Reading of the scales in each recording, FL FR RL RR, N, or kg with `kg` behind; empty
        /// where marks have it.
        scales: Vec<String>,
    },
    /// Strain under known loads.
    LoadRig,
    /// Road wheels against the steering wheel, on turn plates.
    Steer {
        /// Standard deviation of a reading of the plates, rad.
        plate_sigma_rad: f64,
    },
    /// Rolling radii.
    WheelRadius,
    /// Biases and axes of the hub accelerometers.
    Hub,
    /// Drift of the strain channels with temperature.
    Temperature,
}

/// What a step found.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// What was known, with what was found.
    pub calibration: Calibration,
    /// What was found, with its deviations.
    pub findings: Vec<Findings>,
}

impl Step {
    /// Name of the command.
    #[must_use]
    pub const fn title(&self) -> &'static str {
        match self {
            Self::Zero { .. } => "zero",
            Self::Imu => "imu",
            Self::Gnss => "gnss",
            Self::Weight { .. } => "weight",
            Self::LoadRig => "load-rig",
            Self::Steer { .. } => "steer",
            Self::WheelRadius => "wheel-radius",
            Self::Hub => "hub",
            Self::Temperature => "temperature",
        }
    }

    /// Does the step with recordings of one vehicle.
    ///
    /// # Errors
    /// If the recordings are not of one vehicle, or do not tell what is looked for.
    pub fn calibrate(
        &self,
        recordings: &[Recording],
        known: &Calibration,
    ) -> Result<Calibrated, EstimatorError> {
        check_one_vehicle(recordings)?;
        let mut found = match self {
            Self::Zero { weight_sigma } => zero::zero(self.one(recordings)?, known, *weight_sigma),
            Self::Imu => imu::imu(recordings, known),
            Self::Gnss => gnss::gnss(self.one(recordings)?, known),
            Self::Weight { scales } => marked::weight(recordings, known, scales),
            Self::LoadRig => marked::load_rig(recordings, known),
            Self::Steer { plate_sigma_rad } => {
                marked::steer(self.one(recordings)?, known, *plate_sigma_rad)
            }
            Self::WheelRadius => gnss::wheel_radius(self.one(recordings)?, known),
            Self::Hub => hub::hub(recordings, known),
            Self::Temperature => temperature::temperature(recordings, known),
        }?;
        if matches!(self, Self::Zero { .. } | Self::LoadRig) {
            temperature::keep_drift(recordings, known, &mut found);
        }
        Ok(found)
    }

    /// The only recording of a step that takes one.
    fn one<'r>(&self, recordings: &'r [Recording]) -> Result<&'r Recording, RecordingError> {
        match recordings {
            [one] => Ok(one),
            _ => Err(RecordingError::NotOne {
                step: self.title(),
                logs: recordings.iter().map(|r| r.name.clone()).collect(),
            }),
        }
    }
}

fn check_one_vehicle(recordings: &[Recording]) -> Result<(), RecordingError> {
    let first = recordings.first().ok_or(RecordingError::None)?;
    let names = |of: &Recording| Box::new([of.vehicle.name.clone(), of.sensors.name.clone()]);
    let other = recordings
        .iter()
        .find(|other| other.vehicle.name != first.vehicle.name || other.sensors != first.sensors);
    match other {
        None => Ok(()),
        Some(other) => Err(RecordingError::OtherVehicle {
            log: other.name.clone(),
            found: names(other),
            first: first.name.clone(),
            expected: names(first),
        }),
    }
}
