use sample::Wheel;

use crate::file::FileErrors;
use crate::suspension::SuspensionError;

/// What can go wrong in this crate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A vehicle or sensors file has mistakes.
    #[error(transparent)]
    File(#[from] FileErrors),
    /// No vehicle or sensors file of this name ships with the project.
    #[error("{name:?} is not a built-in {kind}; use one of {known}, or the path of a file")]
    UnknownName {
        /// Vehicle or sensors.
        kind: &'static str,
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// No payload of this name.
    #[error("vehicle {vehicle:?} has no payload {name:?}; {known}")]
    UnknownPayload {
        /// The vehicle's name.
        vehicle: String,
        /// The name asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// Payloads move the centre of gravity past the wheels.
    #[error(
        "with {payloads} on it, vehicle {vehicle:?} does not stand: the static load of {wheel} is \
         {load_n:.0} N; check mass_kg and position_m of the payload"
    )]
    NotStanding {
        /// The vehicle's name.
        vehicle: String,
        /// The payloads that are on.
        payloads: String,
        /// A wheel that lifts.
        wheel: Wheel,
        /// Its static load, N.
        load_n: f64,
    },
    /// An argument is not finite or lies outside of its range.
    #[error("{argument} = {value} {unit}: must be {expected}")]
    Argument {
        /// The argument.
        argument: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// What it must be.
        expected: &'static str,
    },
    /// The vehicle file lacks a part that this model needs.
    #[error("vehicle {vehicle:?} has no {part}, which {model} needs; add it to the vehicle file")]
    MissingPart {
        /// The vehicle's name.
        vehicle: String,
        /// Dotted name of the missing part.
        part: &'static str,
        /// The model that needs it.
        model: &'static str,
    },
    /// The sensors file lacks a field that something needs.
    #[error("the sensors file has no {field}, which this needs; add it")]
    MissingField {
        /// Dotted name of the missing field.
        field: &'static str,
    },
    /// A linkage cannot be built, or cannot take a position.
    #[error(transparent)]
    Suspension(#[from] SuspensionError),
    /// No steady state exists or none was found.
    #[error(
        "no equilibrium at {speed_m_s} m/s on a radius of {radius_m} m (residual \
         {residual_m_s2:.3e} m/s^2); use a lower speed or a larger radius"
    )]
    NoEquilibrium {
        /// Speed asked for, m/s.
        speed_m_s: f64,
        /// Radius asked for, m.
        radius_m: f64,
        /// Largest acceleration left over, m/s^2.
        residual_m_s2: f64,
    },
    /// The adaptive integrator cannot meet its tolerance.
    #[error(
        "the step shrank to {step_s:.3e} s at t = {time_s} s without meeting the tolerance; loosen \
         it, or look for a stiff or non-finite part of the model"
    )]
    StepTooSmall {
        /// Time reached, s.
        time_s: f64,
        /// Step tried, s.
        step_s: f64,
    },
}

/// Refuses an argument that is not finite or not in its range.
pub(crate) fn require(
    holds: bool,
    argument: &'static str,
    value: f64,
    unit: &'static str,
    expected: &'static str,
) -> Result<(), Error> {
    if holds && value.is_finite() {
        Ok(())
    } else {
        Err(Error::Argument {
            argument,
            value,
            unit,
            expected,
        })
    }
}
