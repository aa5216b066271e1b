//! Reading sensors files, and those that ship with the project.

mod chain;

use std::path::Path;

use super::Sensors;
use crate::Error;
use crate::file::FileErrors;
use crate::file::rules::Kind::{Choice, Choices, Integer, Number, Table, Text, Vector};
use crate::file::rules::Range::{NonNegative, Positive, Within};
use crate::file::rules::{self, Checked, Kind, Rule, TableRules, may, must};
use crate::tolerances::OF_SENSORS;

/// All that is wrong with a sensors file.
pub type SensorsErrors = FileErrors;

const FILES: &[(&str, &str)] = &[
    (
        "thesis-10bit",
        include_str!("../../sensors/thesis-10bit.toml"),
    ),
    (
        "full-bridge-16bit",
        include_str!("../../sensors/full-bridge-16bit.toml"),
    ),
    (
        "full-bridge-16bit-bending",
        include_str!("../../sensors/full-bridge-16bit-bending.toml"),
    ),
    (
        "thesis-10bit-hub",
        include_str!("../../sensors/thesis-10bit-hub.toml"),
    ),
    (
        "full-bridge-16bit-hub",
        include_str!("../../sensors/full-bridge-16bit-hub.toml"),
    ),
    (
        "full-bridge-16bit-bending-hub",
        include_str!("../../sensors/full-bridge-16bit-bending-hub.toml"),
    ),
    (
        "full-bridge-16bit-bending-500hz-hub",
        include_str!("../../sensors/full-bridge-16bit-bending-500hz-hub.toml"),
    ),
    (
        "second-vehicle-16bit",
        include_str!("../../sensors/second-vehicle-16bit.toml"),
    ),
    (
        "second-vehicle-10bit",
        include_str!("../../sensors/second-vehicle-10bit.toml"),
    ),
];

const BRIDGES: Kind = Choice(&[
    "quarter",
    "half_axial",
    "half_bending",
    "half_poisson",
    "full_poisson",
    "full_bending",
]);
const RATE: Rule = must("rate_hz", Number(Positive(1e5)));
const PLACE: Kind = Vector(3, Within(-30.0, 30.0));
const LATENCY: Rule = must("latency_s", Number(NonNegative(5.0)));

pub(crate) const SECTIONS: &[TableRules] = &[
    TableRules {
        tables: &[""],
        rules: &[
            must("name", Text),
            may("strain", Table),
            may("deflection", Table),
            may("imu", Table),
            may("gnss_velocity", Table),
            may("gnss_attitude", Table),
            may("wheel_speed", Table),
            may("steer", Table),
            may("steer_potentiometers", Table),
            may("wheel_angles", Table),
            may("hub_acceleration", Table),
            may("bus", Table),
            may("tolerances", Table),
        ],
    },
    TableRules {
        tables: &["strain"],
        rules: &[
            RATE,
            may("tube_outer_diameter_m", Number(Positive(1.0))),
            may("tube_wall_m", Number(Positive(0.5))),
            may("youngs_modulus_pa", Number(Within(1e8, 1e12))),
            may("poisson_ratio", Number(Within(0.0, 0.5))),
            may("gauge_factor", Number(Positive(300.0))),
            may("excitation_v", Number(Positive(100.0))),
            may("bridge", BRIDGES),
            may("gain_resistor_ohm", Number(Positive(1e6))),
            may("n_per_count", Number(Within(-1e6, 1e6))),
            may("n_per_mv_v", Number(Within(-1e9, 1e9))),
            may("um_m_per_mv_v", Number(Within(-1e6, 1e6))),
            may("amplifier", Table),
            may("bending", Table),
            may("transducer", Table),
            must("lag_hz", Number(Positive(1e6))),
            may("adc_bits", Integer(4, 32)),
            must("noise_counts", Number(NonNegative(65_535.0))),
            must("zero_error_counts", Number(NonNegative(65_535.0))),
        ],
    },
    TableRules {
        tables: &["strain.amplifier"],
        rules: &[
            must("base_gain", Number(NonNegative(1e6))),
            must("gain_ohm", Number(Positive(1e9))),
        ],
    },
    TableRules {
        tables: &["strain.bending"],
        rules: &[
            may("bridge", BRIDGES),
            may("gain_resistor_ohm", Number(Positive(1e6))),
            may("n_m_per_count", Number(Within(-1e6, 1e6))),
            may("n_m_per_mv_v", Number(Within(-1e9, 1e9))),
            may("um_m_per_mv_v", Number(Within(-1e6, 1e6))),
            must("distance_from_ball_joint_m", Number(Positive(2.0))),
        ],
    },
    TableRules {
        tables: &["strain.transducer"],
        rules: &[
            must("outboard_mass_kg", Number(NonNegative(1e4))),
            must("sigma_part", Number(Within(0.0, 0.2))),
        ],
    },
    TableRules {
        tables: &["deflection", "steer_potentiometers"],
        rules: &[
            RATE,
            must("span_m", Number(Positive(5.0))),
            must("adc_bits", Integer(4, 32)),
            must("noise_counts", Number(NonNegative(65_535.0))),
            must("zero_error_counts", Number(NonNegative(65_535.0))),
            may("excitation_v", Number(Positive(100.0))),
        ],
    },
    TableRules {
        tables: &["imu"],
        rules: &[
            RATE,
            must("position_m", PLACE),
            must("misalignment_rad", Vector(3, Within(-0.5, 0.5))),
            must("accel_noise_m_s2", Number(NonNegative(100.0))),
            must("gyro_noise_rad_s", Number(NonNegative(10.0))),
            must("accel_bias_m_s2", Number(NonNegative(100.0))),
            must("gyro_bias_rad_s", Number(NonNegative(10.0))),
        ],
    },
    TableRules {
        tables: &["gnss_velocity"],
        rules: &[
            RATE,
            must("antenna_m", PLACE),
            must("velocity_noise_m_s", Number(NonNegative(100.0))),
            must("position_noise_m", Number(NonNegative(1e4))),
            LATENCY,
            must("averaging_s", Number(NonNegative(5.0))),
        ],
    },
    TableRules {
        tables: &["gnss_attitude"],
        rules: &[
            RATE,
            must("antenna_m", PLACE),
            must("heading_noise_rad", Number(NonNegative(3.2))),
            must("roll_pitch_noise_rad", Number(NonNegative(3.2))),
            LATENCY,
        ],
    },
    TableRules {
        tables: &["wheel_speed"],
        rules: &[RATE, must("noise_fraction", Number(NonNegative(1.0)))],
    },
    TableRules {
        tables: &["steer"],
        rules: &[RATE, must("noise_rad", Number(NonNegative(3.2)))],
    },
    TableRules {
        tables: &["wheel_angles"],
        rules: &[
            RATE,
            must("noise_rad", Number(NonNegative(3.2))),
            must("zero_error_rad", Number(NonNegative(3.2))),
            must("gain_error_fraction", Number(NonNegative(0.9))),
        ],
    },
    TableRules {
        tables: &["hub_acceleration"],
        rules: &[
            RATE,
            must("axes", Choices(&["x", "y", "z"])),
            must("range_m_s2", Number(Within(1.0, 1e5))),
            must("adc_bits", Integer(4, 16)),
            must("lag_hz", Number(Positive(1e6))),
            must("noise_m_s2", Number(NonNegative(100.0))),
            must("bias_m_s2", Number(NonNegative(100.0))),
            must("misalignment_rad", Number(NonNegative(0.5))),
            must("position_m", Vector(3, Within(-1.0, 1.0))),
        ],
    },
    TableRules {
        tables: &["bus"],
        rules: &[
            must("name", Text),
            must("bit_rate", Integer(5_000, 1_000_000)),
        ],
    },
    TableRules {
        tables: &["tolerances"],
        rules: OF_SENSORS,
    },
];

impl Sensors {
    /// Reads a sensors file. `path` is only named in messages.
    ///
    /// # Errors
    /// All mistakes at once, each with its line, field, value and remedy.
    pub fn from_toml(text: &str, path: impl AsRef<Path>) -> Result<Self, SensorsErrors> {
        let mut checked: Checked<Self> = rules::read(text, path.as_ref(), SECTIONS)?;
        for problem in chain::problems(&checked.value.strain) {
            checked.note(
                &problem.field,
                problem.value,
                problem.message,
                problem.remedy,
            );
        }
        let (encoder, rods) = (&checked.value.steer, &checked.value.steer_potentiometers);
        if encoder.is_some() && rods.is_some() {
            checked.note(
                "steer",
                "both".to_owned(),
                "there must be one of the tables [steer] and [steer_potentiometers], not both"
                    .into(),
                "keep the table of the device that measures the steering wheel".into(),
            );
        }
        checked.finish()
    }

    /// Names of the sensors files that ship with the project; the first is the default.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        FILES.iter().map(|(name, _)| *name)
    }

    /// Text of a sensors file that ships with the project.
    #[must_use]
    pub fn builtin_text(name: &str) -> Option<&'static str> {
        FILES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, text)| *text)
    }

    /// Sensors that ship with the project.
    ///
    /// # Errors
    /// Where no sensors file has this name; the message lists those there are.
    pub fn builtin(name: &str) -> Result<Self, Error> {
        let text = Self::builtin_text(name).ok_or_else(|| Error::UnknownName {
            kind: "sensors file",
            name: name.to_owned(),
            known: Self::builtin_names().collect::<Vec<_>>().join(", "),
        })?;
        Ok(Self::from_toml(text, format!("{name}.toml"))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::Bridge;

    #[test]
    fn builtin_files_differ_as_their_names_say() {
        let read = |name| Sensors::builtin(name).unwrap().strain;
        let thesis = read("thesis-10bit");
        assert_eq!(
            (thesis.adc_bits, thesis.bridge),
            (10, Some(Bridge::HalfAxial))
        );
        assert!(thesis.bending.is_none());
        let full = read("full-bridge-16bit");
        assert_eq!(
            (full.adc_bits, full.bridge),
            (16, Some(Bridge::FullPoisson))
        );
        assert!(full.bending.is_none());
        let bending = read("full-bridge-16bit-bending").bending.unwrap();
        assert_eq!(bending.bridge, Some(Bridge::FullBending));
    }

    /// A set with hub accelerometers is the set without them otherwise, and all have the same ones.
    #[test]
    fn hub_sets_differ_by_their_accelerometers_alone() {
        let all: Vec<_> = Sensors::builtin_names()
            .filter_map(|name| Some((name, name.strip_suffix("-hub")?)))
            .map(|(name, base)| (Sensors::builtin(name).unwrap(), base))
            .collect();
        assert_eq!(all.len(), 4);
        for (hub, base) in &all {
            assert_eq!(hub.hub_acceleration, all[0].0.hub_acceleration, "{base}");
            let fast = base.strip_suffix("-500hz");
            let mut base = Sensors::builtin(fast.unwrap_or(base)).unwrap();
            base.name.clone_from(&hub.name);
            base.hub_acceleration.clone_from(&hub.hub_acceleration);
            if fast.is_some() {
                (base.strain.rate_hz, base.strain.lag_hz) = (500.0, 100.0);
                base.bus.bit_rate = 1_000_000;
            }
            assert_eq!(*hub, base);
        }
        let hub = all[0].0.hub_acceleration.as_ref().unwrap();
        assert!((hub.range_m_s2 / sample::STANDARD_GRAVITY_M_S2 - 32.0).abs() < 1e-9);
        assert_eq!(hub.specific_force_m_s2(32_768), Some(0.0));
        assert_eq!(
            (hub.specific_force_m_s2(0), hub.specific_force_m_s2(65_534)),
            (None, None)
        );
        assert_eq!(
            hub.position_of_m(sample::Wheel::FrontRight),
            [0.0, 0.03, 0.0]
        );
    }

    #[test]
    fn one_device_measures_the_steering_wheel() {
        let text = Sensors::builtin_text("thesis-10bit").unwrap();
        let start = text.find("[steer]").unwrap();
        let encoder = &text[start..start + text[start..].find("\n\n").unwrap()];
        let rods = "[steer_potentiometers]\nrate_hz = 100.0\nspan_m = 0.2\nadc_bits = 12\n\
                    noise_counts = 1.0\nzero_error_counts = 2.0\n";
        let sensors = Sensors::from_toml(&text.replace(encoder, rods), "s.toml").unwrap();
        let pots = sensors.steer_potentiometers.unwrap();
        assert_eq!(sensors.steer, None);
        assert_eq!(pots.travel_m(2048 + 1024), Some(0.05));
        assert_eq!((pots.travel_m(0), pots.travel_m(4095)), (None, None));
        let both = format!("{encoder}\n{rods}");
        let error = Sensors::from_toml(&text.replace(encoder, &both), "s.toml").unwrap_err();
        let told = "[steer] and [steer_potentiometers], not both";
        assert!(error.to_string().contains(told), "{error}");
        let none = Sensors::from_toml(&text.replace(encoder, ""), "s.toml").unwrap();
        assert!(none.steer.is_none() && none.steer_potentiometers.is_none());
    }

    #[test]
    fn a_table_that_the_file_does_not_have_is_of_a_device_that_is_not_fitted() {
        let sensors = Sensors::from_toml("name = \"none\"\n", "s.toml").unwrap();
        assert!(sensors.strain.is_not_fitted() && sensors.deflection.is_not_fitted());
        assert!(sensors.imu.is_not_fitted() && sensors.wheel_speed.is_not_fitted());
        assert!(sensors.gnss_velocity.is_not_fitted() && sensors.gnss_attitude.is_not_fitted());
        let text = toml::to_string(&sensors).unwrap();
        assert_eq!(Sensors::from_toml(&text, "s.toml").unwrap(), sensors);
        let thesis = Sensors::builtin("thesis-10bit").unwrap();
        assert!(!thesis.strain.is_not_fitted() && !thesis.imu.is_not_fitted());
    }

    #[test]
    fn a_chain_is_given_in_one_way() {
        let chain = |fields: &str| {
            let text = format!(
                "name = \"own\"\n[strain]\nrate_hz = 100.0\nlag_hz = 50.0\nnoise_counts = 1.0\n\
                 zero_error_counts = 1.0\n{fields}"
            );
            Sensors::from_toml(&text, "s.toml").map_err(|error| error.to_string())
        };
        assert_eq!(chain("n_per_count = -0.5\n").unwrap().strain.adc_bits, 16);
        chain("n_per_mv_v = 9000.0\n").unwrap();
        let tube = "tube_outer_diameter_m = 0.03\ntube_wall_m = 0.002\nyoungs_modulus_pa = 2e11\n";
        chain(&format!("um_m_per_mv_v = 1500.0\n{tube}")).unwrap();
        for (fields, told) in [
            ("", "strain.gauge_factor"),
            ("um_m_per_mv_v = 1500.0\n", "strain.tube_wall_m"),
            ("n_per_count = 0.0\n", "must not be 0"),
            (
                "n_per_count = 1.0\nn_per_mv_v = 1.0\n",
                "stands beside strain.n_per_count",
            ),
            ("n_per_count = 1.0\nbridge = \"quarter\"\n", "strain.bridge"),
        ] {
            let error = chain(fields).unwrap_err();
            assert!(error.contains(told), "{fields}: {error}");
        }
    }

    #[test]
    fn axes_are_named_once_each() {
        let text = Sensors::builtin_text("thesis-10bit-hub").unwrap();
        let told = |axes: &str| {
            let text = text.replace(r#"axes = ["x", "y", "z"]"#, axes);
            Sensors::from_toml(&text, "s.toml").map_err(|e| e.to_string())
        };
        assert!(
            told(r#"axes = ["z"]"#)
                .unwrap()
                .hub_acceleration
                .unwrap()
                .measures(2)
        );
        for wrong in [
            r#"axes = ["z", "z"]"#,
            "axes = []",
            r#"axes = ["up"]"#,
            "axes = 3",
        ] {
            let error = told(wrong).unwrap_err();
            assert!(error.contains("hub_acceleration.axes"), "{error}");
        }
    }

    /// Sensors files and logs from before the table existed mean the thesis's amplifier.
    #[test]
    fn another_amplifier_is_data_and_none_is_that_of_the_thesis() {
        let text = Sensors::builtin_text("thesis-10bit").unwrap();
        let newtons = |text: &str| {
            let sensors = Sensors::from_toml(text, "s.toml").unwrap();
            sensors.strain.axial_scale().unwrap().load_per_count()
        };
        let table = "[strain.amplifier]\nbase_gain = 5.0\ngain_ohm = 80000.0\n";
        assert!(text.contains(table));
        assert_eq!(newtons(&text.replace(table, "")), newtons(text));
        let other = text.replace("= 5.0\ngain_ohm = 80000.0", "= 1.0\ngain_ohm = 49400.0");
        let ratio = newtons(&other) / newtons(text);
        assert!((ratio - 805.0 / 495.0).abs() < 1e-12, "{ratio}");
        let none = text.replace("gain_ohm = 80000.0", "gain_ohm = 0.0");
        assert!(Sensors::from_toml(&none, "s.toml").is_err());
    }

    #[test]
    fn all_mistakes_are_told_at_once_with_their_lines() {
        let text = Sensors::builtin_text("thesis-10bit")
            .unwrap()
            .replace("half_axial", "half_axle")
            .replace(
                "adc_bits = 10\nnoise_counts = 1.0\nzero_error_counts = 0.5\n\n#",
                "adc_bits = 40\n\n#",
            );
        let errors = Sensors::from_toml(&text, "s.toml").unwrap_err();
        let fields: Vec<_> = errors.problems.iter().map(|p| p.field.as_str()).collect();
        for field in [
            "strain.bridge",
            "strain.adc_bits",
            "strain.noise_counts",
            "strain.zero_error_counts",
        ] {
            assert!(fields.contains(&field), "{errors}");
        }
        assert!(
            errors.to_string().contains("s.toml:11: strain.bridge"),
            "{errors}"
        );
    }
}
