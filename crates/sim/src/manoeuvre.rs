use model::vehicle::Vehicle;

use crate::{Motion, SimError};

/// A manoeuvre that the model drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manoeuvre {
    /// A circle of 15.24 m (50 ft) radius at slowly rising speed.
    Circle,
    /// Sine steer at 0.3 Hz.
    SlowSine,
    /// Sine steer at 0.7 Hz.
    FastSine,
    /// A step of the hand wheel.
    StepSteer,
    /// Sine steer from asphalt onto gravel.
    AsphaltToGravel,
    /// Full throttle from rest, then hard braking.
    LaunchBrake,
    /// On jackstands, lowered, then at rest on the ground.
    Jackstand,
}

impl Manoeuvre {
    /// All manoeuvres.
    pub const ALL: [Self; 7] = [
        Self::Circle,
        Self::SlowSine,
        Self::FastSine,
        Self::StepSteer,
        Self::AsphaltToGravel,
        Self::LaunchBrake,
        Self::Jackstand,
    ];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Circle => "circle",
            Self::SlowSine => "slow-sine",
            Self::FastSine => "fast-sine",
            Self::StepSteer => "step-steer",
            Self::AsphaltToGravel => "asphalt-to-gravel",
            Self::LaunchBrake => "launch-brake",
            Self::Jackstand => "jackstand",
        }
    }

    /// One line for a person who chooses.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::Circle => "left turn of 15.24 m radius, speed rising slowly",
            Self::SlowSine => "sine steer at 0.3 Hz",
            Self::FastSine => "sine steer at 0.7 Hz",
            Self::StepSteer => "a step of the hand wheel at constant speed",
            Self::AsphaltToGravel => "sine steer, the surface changing from asphalt to gravel",
            Self::LaunchBrake => "launch from rest, then hard braking",
            Self::Jackstand => "on jackstands, lowered to the ground, at rest",
        }
    }

    /// The manoeuvre of this name.
    ///
    /// # Errors
    /// A name that none has; the message lists all.
    pub fn by_name(name: &str) -> Result<Self, SimError> {
        Self::ALL
            .into_iter()
            .find(|manoeuvre| manoeuvre.name() == name)
            .ok_or_else(|| SimError::UnknownManoeuvre {
                name: name.to_owned(),
                known: Self::ALL.map(Self::name).join(", "),
            })
    }

    /// Lets a driver perform it with a model of `vehicle`.
    ///
    /// # Errors
    /// A vehicle file that lacks what the model needs.
    pub fn drive(self, vehicle: &Vehicle) -> Result<Motion, SimError> {
        Err(SimError::VehicleLacks {
            vehicle: vehicle.name.clone(),
            missing: "driven model",
            needed_for: self.name(),
        })
    }
}
