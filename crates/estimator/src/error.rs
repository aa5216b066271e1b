/// Why an estimator or a calibration could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimatorError {
    /// The calibration was made for another vehicle.
    #[error(
        "the calibration is for \"{found}\", the vehicle file is \"{expected}\"; \
         calibrate this vehicle, or name the right files"
    )]
    OtherVehicle {
        /// Name in the vehicle file.
        expected: String,
        /// Name in the calibration.
        found: String,
    },
    /// A value cannot be used.
    #[error("{name} = {value} is not usable; expected {expected}")]
    Value {
        /// Dotted name of the value.
        name: String,
        /// The value.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// The text is not a calibration file.
    #[error("the calibration does not parse: {0}")]
    Parse(String),
    /// The sensors file's values make no sensor.
    #[error("{0}")]
    Sensors(String),
    /// The data do not tell what was looked for.
    #[error(transparent)]
    Refused(#[from] crate::finding::Refusal),
    /// Recordings do not serve a step of the calibration.
    #[error(transparent)]
    Recording(#[from] crate::calibration::RecordingError),
    /// The data do not tell it for any part; this is the first of them.
    #[error("{part}")]
    Part {
        /// The part: an axle, a tyre model.
        part: String,
        /// Why.
        #[source]
        refusal: Box<crate::finding::Refusal>,
    },
    /// The channels of a corner do not tell the three forces of its wheel apart.
    #[error(
        "{name} is singular: the channels {channels} have a condition number of {condition:.1e} (at most {most} is \
         accepted) and do not measure {direction}; add or repair a gauge that reacts to {force}, or correct the matrix",
        most = crate::calibration::matrix::CONDITION_MAX
    )]
    Matrix {
        /// Dotted name of the matrix.
        name: String,
        /// Names of the channels.
        channels: String,
        /// Condition number of their sensitivities to the three forces.
        condition: f64,
        /// The force that they do not measure, by its parts.
        direction: String,
        /// The force of the axis that is nearest to it.
        force: &'static str,
    },
    /// The loads on a corner without geometry do not tell the three forces apart.
    #[error(
        "load-rig: the loads on {wheel} do not tell the response to {direction} (condition number {condition:.1e}); \
         add loads along it that pass through the contact point, such as `atvrec mark \"{mark}\"` and \
         `atvrec mark \"{back}\"`"
    )]
    Unloaded {
        /// The wheel.
        wheel: String,
        /// The force, by its parts.
        direction: String,
        /// Largest over smallest standard deviation of the response to a force.
        condition: f64,
        /// A mark of a load that helps.
        mark: String,
        /// The mark of the load the other way.
        back: String,
    },
    /// A matrix is given for a wheel of a live axle.
    #[error(
        "corner.{wheel}.matrix is not usable: the vehicle file has a live axle there, which couples both wheels; \
         remove the matrix, or the table live_axle"
    )]
    MatrixOnLiveAxle {
        /// The wheel's table.
        wheel: &'static str,
    },
    /// The vehicle's steering cannot be used.
    #[error(transparent)]
    Vehicle(#[from] model::Error),
    /// The vehicle's linkage cannot be used.
    #[error("{0}")]
    Suspension(String),
}
