//! Every tuned number of the live estimator: name, unit, meaning, source or measured cost, default.
//!
//! [`Tuning`] is grouped by the parts of the estimator. Each part keeps a copy of its group. The
//! table in `docs/filter-spec.md` is generated from these definitions. The numbers can be set for
//! experiments: a configuration file has `[estimator.tuning.<group>]` tables.
//!
//! Numbers that are not tuned stay constants beside the code: physical constants, conversion
//! factors, array sizes, the spacing of the time grid, steps of numerical integration, and limits
//! that keep arithmetic finite.

mod corners;
mod fusion;
mod grip;
mod inertial_forces;
mod latency;
mod limits;
mod mistakes;
mod motion;
mod planar;
mod road;
mod slip;
mod terrain;
mod units;
mod vertical;
mod watch;

pub use corners::{CornerTuning, SteeringWheelTuning, StrutLengthTuning, TiltTuning};
pub use fusion::{
    BalanceTuning, ChannelTuning, ForceNoiseTuning, FusionTuning, MemberTuning, MomentTuning,
    PotentiometerTuning,
};
pub use grip::GripTuning;
pub use inertial_forces::InertialForcesTuning;
pub use latency::LatencyTuning;
pub use limits::LimitsTuning;
pub use mistakes::MistakeTuning;
pub use motion::{AidingTuning, JumpTuning, MotionTuning, ReceiverTuning};
pub use planar::{PlanarInputTuning, PlanarTuning};
pub use road::RoadTuning;
pub use slip::SlipTuning;
pub use terrain::TerrainTuning;
pub use units::UnitTuning;
pub use vertical::{ExpectedTuning, LiftTuning, StaticsTuning};
pub use watch::{
    BiasWatchTuning, HubWatchTuning, ImuConsistencyTuning, InertialWatchTuning,
    ReceiverWatchTuning, RepeatsTuning, SteeringWatchTuning, WatchTuning, WheelWatchTuning,
};

/// Defines a group of tuned numbers once for the structure, its defaults, its documentation and the
/// generated table.
macro_rules! tuning {
    (
        $(#[doc = $about:literal])+
        $name:ident {
            $( $(#[doc = $meaning:literal])+ $field:ident: $type:ty = $default:expr, $unit:literal; )*
            $( group $group:ident: $group_type:ty; )*
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[doc = $meaning])+
                #[doc = ""]
                #[doc = concat!("Unit: ", $unit, "; default: `", stringify!($default), "`.")]
                pub $field: $type,
            )*
            $(
                #[doc = concat!("See [`", stringify!($group_type), "`].")]
                pub $group: $group_type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $( $field: $default, )*
                    $( $group: <$group_type>::default(), )*
                }
            }
        }

        impl $crate::tuning::Group for $name {
            fn about(&self) -> &'static str {
                concat!($($about),+)
            }

            fn parameters(&mut self) -> Vec<$crate::tuning::Parameter<'_>> {
                vec![$(
                    $crate::tuning::Parameter {
                        name: stringify!($field),
                        unit: $unit,
                        meaning: concat!($($meaning),+),
                        value: &mut self.$field,
                    },
                )*]
            }

            fn groups(&mut self) -> Vec<(&'static str, &mut dyn $crate::tuning::Group)> {
                vec![$( (stringify!($group), &mut self.$group), )*]
            }
        }
    };
}
use tuning;

tuning! {
    /// All tuned numbers of the live estimator.
    Tuning {
        /// A reading that is older than this is not used. Corner and steering readings arrive every
        /// 10 ms.
        fresh_s: f64 = 0.1, "s";
        /// Time for which the last force of a load on the hitch is used.
        hitch_held_s: f64 = 0.5, "s";
        /// Age of the last accepted GNSS velocity from which wheel speeds and tyre slip replace it.
        gnss_silent_s: f64 = 0.3, "s";
        /// Age of the last accepted GNSS attitude from which tyre slip replaces it.
        heading_silent_s: f64 = 1.0, "s";
        /// Time for which the receivers of a vehicle without linkages must be heard after a silence before the
        /// inertial navigation replaces the single-track filter.
        navigation_hold_s: f64 = 5.0, "s";
        /// Time that attitude and biases need after a start, also in a bend. Before that, slip
        /// angles do not update the grip estimate, and a further start is not reported as a
        /// divergence.
        settling_s: f64 = 2.0, "s";
        /// Time without a further start after which a filter that diverged is reported as settled.
        recovery_s: f64 = 3.0, "s";
        /// Speed above which the lift of a wheel is judged: wheels of a vehicle on jacks hang.
        lift_speed_min_m_s: f64 = 1.5, "m/s";
        /// Smallest standard deviation of the gyros that the filters use, whatever the sensors file
        /// states.
        gyro_sigma_min_rad_s: f64 = 1e-4, "rad/s";
        /// Smallest standard deviation of the accelerometers that the filters use.
        accel_sigma_min_m_s2: f64 = 0.005, "m/s²";
        /// Smallest standard deviation of GNSS velocity that the motion filter uses.
        velocity_sigma_min_m_s: f64 = 0.005, "m/s";
        /// Smallest standard deviation of GNSS heading, roll and pitch that the motion filter uses.
        attitude_sigma_min_rad: f64 = 1e-4, "rad";
        group motion: MotionTuning;
        group watch: WatchTuning;
        group corners: CornerTuning;
        group fusion: FusionTuning;
        group mistakes: MistakeTuning;
        group units: UnitTuning;
        group latency: LatencyTuning;
        group process_noise: ProcessNoiseTuning;
        group statics: StaticsTuning;
        group expected: ExpectedTuning;
        group grip: GripTuning;
        group lift: LiftTuning;
        group road: RoadTuning;
        group slip: SlipTuning;
        group limits: LimitsTuning;
        group terrain: TerrainTuning;
        group planar: PlanarTuning;
        group inertial_forces: InertialForcesTuning;
        group pressure: PressureTuning;
    }
}

tuning! {
    /// Inflation pressures of the tyres (`estimator/pressure.rs`).
    PressureTuning {
        /// Time constant of the low-pass filter: a tyre warms up or loses air in minutes.
        time_s: f64 = 30.0, "s";
        /// Relative change of an axle's pressure at which its tyres change. It changes a stiffness by at most 2 %.
        change: f64 = 0.01, "1";
        /// Largest pressure that a sensor can report: above it, the sensor is not connected.
        most_pa: f64 = 2e6, "Pa";
    }
}

tuning! {
    /// Adaptation of process noise to the filter's own corrections (`process_noise.rs`).
    ProcessNoiseTuning {
        /// Weight of one step in the fading mean of corrections: about five steps.
        recent: f64 = 0.2, "1";
        /// Weight of one step in the means of products and of squares: about an eighth of a second.
        slow: f64 = 0.08, "1";
        /// Largest product that enters the mean: one large correction must not change the density.
        product_max: f64 = 0.2, "1";
        /// Correlation that is attributed to coloured measurement noise and not to the process.
        colour: f64 = 0.035, "1";
        /// Mean square of normalised corrections below which the density shrinks faster. The value
        /// is 1 in a consistent filter and somewhat lower where measurement noise is overstated.
        small: f64 = 0.45, "1";
        /// Gain of that faster shrinking.
        small_gain: f64 = 0.15, "1";
        /// Largest square that enters the mean of squares.
        square_max: f64 = 3.0, "1";
        /// Largest relative decrease and increase of the density in one step.
        step: [f64; 2] = [0.1, 0.15], "1";
        /// Weight of the half of the states with the larger squared mean: one axle adapts almost
        /// like all wheels.
        half: f64 = 0.85, "1";
        /// Limit of one normalised correction.
        correction_max: f64 = 5.0, "σ";
    }
}

/// A group of tuned numbers.
pub trait Group {
    /// What the group is for.
    fn about(&self) -> &'static str;

    /// Its own numbers.
    fn parameters(&mut self) -> Vec<Parameter<'_>>;

    /// Its sub-groups by name.
    fn groups(&mut self) -> Vec<(&'static str, &mut dyn Group)>;
}

/// A tuned number, or a few that belong together.
pub struct Parameter<'a> {
    /// Name of the field.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Meaning and source.
    pub meaning: &'static str,
    /// The value.
    pub value: &'a mut dyn Numbers,
}

/// A value of a [`Parameter`], seen as a list of numbers.
pub trait Numbers {
    /// The numbers.
    fn numbers(&self) -> Vec<f64>;

    /// Replaces the numbers. The error says what is expected instead.
    ///
    /// # Errors
    /// Wrong count; a value that is not finite; a fraction where a count is expected; a value that
    /// is not above zero where the present one is.
    fn replace(&mut self, numbers: &[f64]) -> Result<(), String>;
}

impl Numbers for f64 {
    fn numbers(&self) -> Vec<f64> {
        vec![*self]
    }

    fn replace(&mut self, numbers: &[f64]) -> Result<(), String> {
        let mut array = [*self];
        array.replace(numbers)?;
        [*self] = array;
        Ok(())
    }
}

impl Numbers for u32 {
    fn numbers(&self) -> Vec<f64> {
        vec![f64::from(*self)]
    }

    fn replace(&mut self, numbers: &[f64]) -> Result<(), String> {
        match numbers {
            [count] if count.fract() == 0.0 && (1.0..=1e9).contains(count) => {
                *self = *count as Self;
                Ok(())
            }
            _ => Err("a whole number from 1 to 1000000000".to_owned()),
        }
    }
}

impl<const N: usize> Numbers for [f64; N] {
    fn numbers(&self) -> Vec<f64> {
        self.to_vec()
    }

    fn replace(&mut self, numbers: &[f64]) -> Result<(), String> {
        let Ok(new) = Self::try_from(numbers) else {
            return Err(match N {
                1 => "one number".to_owned(),
                _ => format!("a list of {N} numbers"),
            });
        };
        if !new.iter().all(|number| number.is_finite()) {
            return Err("finite numbers".to_owned());
        }
        // Deviations, gates and time constants are positive; zero would divide by zero.
        if new
            .iter()
            .zip(self.iter())
            .any(|(new, now)| *now > 0.0 && *new <= 0.0)
        {
            return Err("a number above 0".to_owned());
        }
        *self = new;
        Ok(())
    }
}

/// One number of a [`Tuning`] by its place.
#[derive(Clone, Debug, PartialEq)]
pub struct NumberPath {
    /// Dotted name of the parameter, such as `motion.gate_sigma`.
    pub name: String,
    /// Position in the parameter's list.
    pub index: usize,
    /// The number.
    pub value: f64,
}

impl Tuning {
    /// All numbers in the order of the specification.
    #[must_use]
    pub fn numbers(mut self) -> Vec<NumberPath> {
        let mut found = Vec::new();
        walk(&mut self, "", &mut |name, parameter| {
            for (index, value) in parameter.value.numbers().into_iter().enumerate() {
                found.push(NumberPath {
                    name: name.to_owned(),
                    index,
                    value,
                });
            }
        });
        found
    }

    /// This tuning with one number replaced.
    ///
    /// # Errors
    /// As [`Tuning::replace`].
    pub fn with(mut self, name: &str, index: usize, value: f64) -> Result<Self, String> {
        let mut numbers = None;
        walk(&mut self, "", &mut |found, parameter| {
            if found == name {
                numbers = Some(parameter.value.numbers());
            }
        });
        let mut numbers = numbers.unwrap_or_default();
        if let Some(number) = numbers.get_mut(index) {
            *number = value;
        }
        self.replace(name, &numbers).map(|()| self)
    }

    /// Replaces the numbers of the parameter with this dotted name.
    ///
    /// # Errors
    /// A value that the parameter does not allow, or a name that does not exist; the text says what
    /// is expected.
    pub fn replace(&mut self, name: &str, numbers: &[f64]) -> Result<(), String> {
        let mut result = Err(format!(
            "no tuning parameter is called {name}; docs/filter-spec.md lists all of them"
        ));
        walk(self, "", &mut |found, parameter| {
            if found == name {
                let default = parameter.value.numbers();
                result = parameter.value.replace(numbers).map_err(|expected| {
                    let unit = parameter.unit;
                    format!(
                        "{name} = {numbers:?} found where {expected} is expected; the value is \
                         {default:?} (unit: {unit})"
                    )
                });
            }
        });
        result
    }
}

/// Visits every parameter of a group and of its sub-groups with its dotted name.
pub fn walk(group: &mut dyn Group, prefix: &str, visit: &mut dyn FnMut(&str, &mut Parameter<'_>)) {
    for mut parameter in group.parameters() {
        visit(&format!("{prefix}{}", parameter.name), &mut parameter);
    }
    for (name, group) in group.groups() {
        walk(group, &format!("{prefix}{name}."), visit);
    }
}
