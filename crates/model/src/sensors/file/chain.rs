//! Rules between the fields of the strain chain: its channels are given by gauges and amplifier, or by their
//! calibration.

use crate::sensors::StrainChain;
use crate::strain::Given;

/// A mistake that shows only between fields.
pub(super) struct Mistake {
    pub field: String,
    pub value: String,
    pub message: String,
    pub remedy: String,
}

impl Mistake {
    fn new(field: String, value: impl ToString, message: impl Into<String>, remedy: &str) -> Self {
        Self {
            field,
            value: value.to_string(),
            message: message.into(),
            remedy: remedy.to_owned(),
        }
    }
}

/// Channels of one kind, axial or bending.
struct Channels {
    table: &'static str,
    given: Given,
    per_count: &'static str,
    per_mv_v: &'static str,
    /// Fields of gauges and amplifier, and whether the file has them.
    of_gauges: [(&'static str, bool); 2],
}

/// What is wrong between the fields of a strain chain.
pub(super) fn problems(strain: &StrainChain) -> Vec<Mistake> {
    if strain.is_not_fitted() {
        return Vec::new();
    }
    let mut found: Vec<Mistake> = thick_wall(strain).into_iter().collect();
    found.extend(beside_transducer(strain));
    let axial = Channels {
        table: "strain",
        given: strain.given(),
        per_count: "n_per_count",
        per_mv_v: "n_per_mv_v",
        of_gauges: [
            ("bridge", strain.bridge.is_some()),
            ("gain_resistor_ohm", strain.gain_resistor_ohm.is_some()),
        ],
    };
    let bending = strain.bending.as_ref().map(|bending| Channels {
        table: "strain.bending",
        given: bending.given(),
        per_count: "n_m_per_count",
        per_mv_v: "n_m_per_mv_v",
        of_gauges: [
            ("bridge", bending.bridge.is_some()),
            ("gain_resistor_ohm", bending.gain_resistor_ohm.is_some()),
        ],
    });
    for channels in [Some(axial), bending].into_iter().flatten() {
        let calibrations = channels.calibrations();
        found.extend(channels.contradictions(&calibrations));
        for missing in channels.missing(strain, calibrations.first().map(|first| first.0)) {
            if found.iter().all(|known| known.field != missing.field) {
                found.push(missing);
            }
        }
    }
    found
}

fn thick_wall(strain: &StrainChain) -> Option<Mistake> {
    let (wall, diameter) = strain.tube_wall_m.zip(strain.tube_outer_diameter_m)?;
    let message = format!("is more than half the tube's diameter of {diameter} m");
    let field = "strain.tube_wall_m".to_owned();
    (2.0 * wall > diameter).then(|| Mistake::new(field, wall, message, "check its unit"))
}

/// Fields that no chain of wheel-force transducers has.
fn beside_transducer(strain: &StrainChain) -> Vec<Mistake> {
    let Some(_) = strain.transducer else {
        return Vec::new();
    };
    let fields = [
        ("strain.bending", strain.bending.is_some()),
        ("strain.bridge", strain.bridge.is_some()),
        ("strain.um_m_per_mv_v", strain.um_m_per_mv_v.is_some()),
    ];
    let message = "is of gauges on the suspension, but strain.transducer is in their place";
    let given = fields.into_iter().filter(|(_, is_there)| *is_there);
    given
        .map(|(field, _)| {
            let remedy = "remove it, and give the force of one count as n_per_count";
            Mistake::new(field.to_owned(), "given", message, remedy)
        })
        .collect()
}

impl Channels {
    fn field(&self, name: &str) -> String {
        format!("{}.{name}", self.table)
    }

    /// The calibrations that the file has.
    fn calibrations(&self) -> Vec<(&'static str, f64)> {
        let all = [
            (self.per_count, self.given.per_count),
            (self.per_mv_v, self.given.per_mv_v),
            ("um_m_per_mv_v", self.given.um_m_per_mv_v),
        ];
        let there = all.into_iter();
        there
            .filter_map(|(name, value)| Some((name, value?)))
            .collect()
    }

    /// Fields that say the same thing twice.
    fn contradictions(&self, calibrations: &[(&'static str, f64)]) -> Vec<Mistake> {
        let mut found = Vec::new();
        let Some((first, value)) = calibrations.first() else {
            return found;
        };
        if *value == 0.0 {
            let remedy =
                "write what one unit of the signal stands for; negative if it falls with tension";
            found.push(Mistake::new(
                self.field(first),
                value,
                "must not be 0",
                remedy,
            ));
        }
        for (second, value) in &calibrations[1..] {
            let message = format!("stands beside {}, but one is enough", self.field(first));
            let field = self.field(second);
            found.push(Mistake::new(field, value, message, "keep one of both"));
        }
        for (name, is_there) in self.of_gauges {
            if is_there {
                let message = format!(
                    "is of gauges and amplifier, but {} is in their place",
                    self.field(first)
                );
                let field = self.field(name);
                found.push(Mistake::new(field, "given", message, "keep one of both"));
            }
        }
        found
    }

    /// Fields that the channels need and the file does not have.
    fn missing(&self, strain: &StrainChain, calibration: Option<&str>) -> Vec<Mistake> {
        let tube = [
            (
                "tube_outer_diameter_m",
                strain.tube_outer_diameter_m.is_some(),
            ),
            ("tube_wall_m", strain.tube_wall_m.is_some()),
            ("youngs_modulus_pa", strain.youngs_modulus_pa.is_some()),
        ];
        let gauge = [
            ("poisson_ratio", strain.poisson_ratio.is_some()),
            ("gauge_factor", strain.gauge_factor.is_some()),
            ("excitation_v", strain.excitation_v.is_some()),
        ];
        let shared = |fields: &[(&str, bool)]| -> Vec<(String, bool)> {
            let named = fields.iter();
            named
                .map(|(name, is_there)| (format!("strain.{name}"), *is_there))
                .collect()
        };
        let own = self
            .of_gauges
            .map(|(name, is_there)| (self.field(name), is_there));
        let (needed, reason) = match calibration {
            None => (
                [shared(&tube), shared(&gauge), own.to_vec()].concat(),
                format!(
                    "is missing, and no {}, {} or um_m_per_mv_v is in its place",
                    self.per_count, self.per_mv_v
                ),
            ),
            Some("um_m_per_mv_v") => (
                shared(&tube),
                "is missing, and um_m_per_mv_v needs it".to_owned(),
            ),
            Some(_) => (Vec::new(), String::new()),
        };
        let absent = needed.into_iter().filter(|(_, is_there)| !is_there);
        absent
            .map(|(field, _)| {
                let remedy = "add it, or give the chain by its calibration";
                Mistake::new(field, "none", reason.clone(), remedy)
            })
            .collect()
    }
}
