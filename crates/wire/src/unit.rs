//! Units of physical quantities: each dimension with its units, their factors to SI, and the texts that
//! files use for them.

use std::f64::consts::{PI, TAU};

use sample::STANDARD_GRAVITY_M_S2;

/// What kind of unit a quantity has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// m/s^2.
    Acceleration,
    /// rad/s.
    AngularRate,
    /// rad.
    Angle,
    /// m/s.
    Speed,
    /// m.
    Length,
    /// N.
    Force,
    /// N m.
    Moment,
    /// m/m.
    Strain,
    /// V/V: output of a bridge over its excitation.
    BridgeRatio,
    /// V.
    Voltage,
    /// Pa.
    Pressure,
    /// Degrees Celsius.
    Temperature,
    /// Part of a whole.
    Ratio,
    /// Converter counts.
    Counts,
    /// Whatever the file says.
    Free,
}

/// A unit: its name, and the factor that takes it to the SI unit of its dimension.
pub type Unit = (&'static str, f64);

const DEGREE: f64 = PI / 180.0;

impl Dimension {
    /// All dimensions with units of their own.
    pub const ALL: [Self; 14] = [
        Self::Acceleration,
        Self::AngularRate,
        Self::Angle,
        Self::Speed,
        Self::Length,
        Self::Force,
        Self::Moment,
        Self::Strain,
        Self::BridgeRatio,
        Self::Voltage,
        Self::Pressure,
        Self::Temperature,
        Self::Ratio,
        Self::Counts,
    ];

    /// Units by name, with the factor that takes them to SI.
    #[must_use]
    pub fn units(self) -> &'static [Unit] {
        match self {
            Self::Acceleration => &[
                ("m/s^2", 1.0),
                ("m/s2", 1.0),
                ("g", STANDARD_GRAVITY_M_S2),
                ("mg", 1e-3 * STANDARD_GRAVITY_M_S2),
            ],
            Self::AngularRate => &[
                ("rad/s", 1.0),
                ("deg/s", DEGREE),
                ("rpm", TAU / 60.0),
                ("rev/s", TAU),
            ],
            Self::Angle => &[("rad", 1.0), ("deg", DEGREE)],
            Self::Speed => &[
                ("m/s", 1.0),
                ("km/h", 1.0 / 3.6),
                ("mph", 0.447_04),
                ("kn", 1852.0 / 3600.0),
            ],
            Self::Length => &[
                ("m", 1.0),
                ("mm", 1e-3),
                ("cm", 1e-2),
                ("um", 1e-6),
                ("in", 0.0254),
                ("ft", 0.3048),
            ],
            Self::Force => &[
                ("N", 1.0),
                ("daN", 10.0),
                ("kN", 1000.0),
                ("lbf", 4.448_221_615_260_5),
            ],
            Self::Moment => &[("Nm", 1.0), ("kNm", 1000.0), ("lbf ft", 1.355_817_948_331)],
            Self::Strain => &[("um/m", 1e-6), ("mm/m", 1e-3), ("m/m", 1.0)],
            Self::BridgeRatio => &[("mV/V", 1e-3), ("uV/V", 1e-6), ("V/V", 1.0)],
            Self::Voltage => &[("V", 1.0), ("mV", 1e-3)],
            Self::Pressure => &[
                ("Pa", 1.0),
                ("kPa", 1e3),
                ("MPa", 1e6),
                ("bar", 1e5),
                ("psi", 6_894.757_293_168),
            ],
            Self::Temperature => &[("degC", 1.0)],
            Self::Ratio => &[("%", 0.01), ("1", 1.0)],
            Self::Counts => &[("counts", 1.0)],
            Self::Free => &[],
        }
    }

    /// The unit that a text means, such as that of a units row or of a DBC file, with its factor; `None`
    /// if the text is not clear.
    #[must_use]
    pub fn unit_of_text(self, text: &str) -> Option<Unit> {
        let plain = plain(text);
        let units = self.units().iter();
        let found = units
            .clone()
            .find(|(name, _)| name.to_lowercase() == plain)
            .copied();
        // Counts have no unit, or that of a bare number.
        let bare = || {
            let is_bare = self == Self::Counts && COUNTS.contains(&plain.as_str());
            units.clone().next().copied().filter(|_| is_bare)
        };
        found.or_else(bare)
    }

    /// Factor that takes `unit` to SI.
    #[must_use]
    pub fn factor(self, unit: &str) -> Option<f64> {
        if self == Self::Free {
            return Some(1.0);
        }
        let found = self.units().iter().find(|(name, _)| *name == unit);
        found.map(|(_, factor)| *factor)
    }

    /// The names of the units, for a message.
    #[must_use]
    pub fn unit_names(self) -> Vec<&'static str> {
        self.units().iter().map(|(name, _)| *name).collect()
    }
}

/// Texts of files that have no name for a converter's count.
const COUNTS: [&str; 13] = [
    "", "-", "count", "cnt", "cnts", "bit", "bits", "lsb", "raw", "adc", "digit", "digits", "inc",
];

/// A text in lower case without decoration, in the spelling of [`Dimension::units`].
fn plain(text: &str) -> String {
    let plain = text
        .trim_matches(|c: char| c.is_whitespace() || "[](){}".contains(c))
        .to_lowercase()
        .replace('²', "^2")
        .replace("**", "^")
        .replace('°', "deg")
        .replace(['µ', 'μ'], "u")
        .replace('ε', "e")
        .replace(['·', '*'], "")
        .replace(' ', "");
    let known = match plain.as_str() {
        "kph" | "kmh" | "kmph" => "km/h",
        "mi/h" | "miles/h" => "mph",
        "knots" | "kt" | "kts" => "kn",
        "degrees" | "degree" => "deg",
        "radians" | "radian" => "rad",
        "degs" | "deg/sec" | "dps" | "degrees/s" | "degree/s" => "deg/s",
        "rad/sec" | "rads" => "rad/s",
        "1/min" | "min^-1" | "rev/min" | "r/min" | "u/min" => "rpm",
        "hz" | "1/s" | "rps" => "rev/s",
        "m/sec" | "mps" => "m/s",
        "m/s/s" | "m/sec^2" | "mps2" => "m/s^2",
        "metres" | "meters" | "metre" | "meter" => "m",
        "inch" | "inches" | "\"" => "in",
        "gs" | "g's" => "g",
        "newton" | "newtons" => "n",
        "lb-ft" | "lbft" | "ft-lb" | "ftlb" | "lbf-ft" | "lbfft" => "lbf ft",
        "n-m" => "nm",
        "ustrain" | "microstrain" | "ue" | "uepsilon" | "um/m(strain)" => "um/m",
        "volt" | "volts" => "v",
        "c" | "celsius" | "degcelsius" => "degc",
        "percent" | "pct" => "%",
        other => other,
    };
    known.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each unit with the value of one of it in SI units, by an independent definition.
    #[test]
    fn one_of_each_unit_in_si_units() {
        use Dimension as D;
        let gravity = 9.806_65;
        let pound = 0.453_592_37 * gravity;
        let degree = TAU / 360.0;
        let cases: &[(D, &[&str], f64)] = &[
            (D::Acceleration, &["m/s^2", "m/s2", "m/s²", "mps2"], 1.0),
            (D::Acceleration, &["g", "G", "[g]"], gravity),
            (D::Acceleration, &["mg"], gravity / 1000.0),
            (D::AngularRate, &["rad/s", "rad/sec"], 1.0),
            (D::AngularRate, &["deg/s", "°/s", "dps"], degree),
            (D::AngularRate, &["rpm", "1/min"], 6.0 * degree),
            (D::AngularRate, &["rev/s", "Hz", "1/s"], 360.0 * degree),
            (D::Angle, &["rad"], 1.0),
            (D::Angle, &["deg", "degree", "degrees", "°"], degree),
            (D::Speed, &["m/s"], 1.0),
            (D::Speed, &["km/h", "kph", "KPH"], 1000.0 / 3600.0),
            (D::Speed, &["mph"], 1609.344 / 3600.0),
            (D::Speed, &["kn", "knots"], 1852.0 / 3600.0),
            (D::Length, &["m"], 1.0),
            (D::Length, &["cm"], 0.01),
            (D::Length, &["mm"], 0.001),
            (D::Length, &["um", "µm"], 1e-6),
            (D::Length, &["in", "inch"], 0.0254),
            (D::Length, &["ft"], 12.0 * 0.0254),
            (D::Force, &["N"], 1.0),
            (D::Force, &["daN"], 10.0),
            (D::Force, &["kN", "KN"], 1000.0),
            (D::Force, &["lbf"], pound),
            (D::Moment, &["Nm", "N m", "N*m", "N·m"], 1.0),
            (D::Moment, &["kNm"], 1000.0),
            (D::Moment, &["lbf ft", "ft-lb"], pound * 0.3048),
            (
                D::Strain,
                &["um/m", "µm/m", "μm/m", "microstrain", "ustrain", "µε"],
                1e-6,
            ),
            (D::Strain, &["mm/m"], 1e-3),
            (D::Strain, &["m/m"], 1.0),
            (D::BridgeRatio, &["mV/V"], 1e-3),
            (D::BridgeRatio, &["uV/V", "µV/V"], 1e-6),
            (D::BridgeRatio, &["V/V"], 1.0),
            (D::Voltage, &["V", "Volt"], 1.0),
            (D::Voltage, &["mV"], 1e-3),
            (D::Pressure, &["Pa"], 1.0),
            (D::Pressure, &["kPa"], 1e3),
            (D::Pressure, &["MPa"], 1e6),
            (D::Pressure, &["bar"], 1e5),
            (D::Pressure, &["psi"], pound / 0.0254_f64.powi(2)),
            (D::Temperature, &["degC", "°C", "C"], 1.0),
            (D::Ratio, &["%"], 0.01),
            (D::Ratio, &["1"], 1.0),
            (D::Counts, &["counts", "count", "", "bits", "LSB"], 1.0),
        ];
        for (dimension, texts, expected) in cases {
            for text in *texts {
                let (name, factor) = dimension.unit_of_text(text).expect(text);
                assert!((factor / expected - 1.0).abs() < 1e-12, "{text}: {factor}");
                assert_eq!(dimension.factor(name), Some(factor), "{text}");
            }
        }
        for dimension in Dimension::ALL {
            for (name, _) in dimension.units() {
                let told = |case: &&(D, &[&str], f64)| case.0 == dimension && case.1.contains(name);
                assert!(cases.iter().any(|case| told(&case)), "{name} has no case");
            }
        }
    }

    #[test]
    fn a_text_of_another_dimension_is_no_unit() {
        for (dimension, text) in [
            (Dimension::Length, "deg"),
            (Dimension::Length, ""),
            (Dimension::AngularRate, "deg"),
            (Dimension::Force, "Nm"),
            (Dimension::Counts, "mm"),
            (Dimension::Strain, "mV/V"),
            (Dimension::Strain, "um"),
        ] {
            assert_eq!(dimension.unit_of_text(text), None, "{dimension:?} {text}");
        }
    }
}
