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
    /// The vehicle's steering cannot be used.
    #[error(transparent)]
    Vehicle(#[from] model::Error),
    /// The vehicle's linkage cannot be used.
    #[error("{0}")]
    Suspension(String),
}
