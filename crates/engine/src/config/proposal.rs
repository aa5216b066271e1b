//! Proposed roles of the signals of DBC files, from their names and units.
//!
//! The table [`ROWS`] says which words of a name belong to which role. A new role needs a row. Whether a
//! role accepts the unit of a signal is decided where the roles of a configuration are read
//! ([`roles`]), and nowhere else.

mod names;

use std::collections::BTreeMap;

use wire::dbc::{Database, MessageDef, SignalDef};

use super::roles;
use model::file::{ErrorCollector, Section};
use names::{Name, Place};

/// A phrase: its words are in the name of a signal or of its message, in any order.
type Phrase = &'static [&'static str];

/// Which names belong to a role.
struct Row {
    /// Name of the role. Parts in braces are found in the name of the signal.
    role: &'static str,
    /// One of these phrases is sufficient.
    sure: &'static [Phrase],
    /// One of these phrases is a hint.
    hint: &'static [Phrase],
    /// With one of these words, the signal is something else.
    without: &'static [&'static str],
}

/// Words of devices on a wheel.
const ON_A_WHEEL: &[&str] = &["wheel", "whl", "hub", "fl", "fr", "rl", "rr", "engine"];

/// The roles. A signal gets the first role that its name fits.
const ROWS: [Row; 12] = [
    Row {
        role: "steer_{side}",
        sure: &[
            &["steer", "rod"],
            &["steering", "rod"],
            &["rack", "travel"],
            &["rack", "position"],
        ],
        hint: &[
            &["tie", "rod", "travel"],
            &["tie", "rod", "position"],
            &["rack"],
        ],
        without: &["force", "strain", "speed", "rate"],
    },
    Row {
        role: "steer",
        sure: &[
            &["steer", "angle"],
            &["steering", "angle"],
            &["hand", "wheel", "angle"],
            &["steering", "wheel", "position"],
        ],
        hint: &[&["steer"], &["steering"], &["sas"]],
        without: &["speed", "rate", "velocity", "rod", "rack", "road", "force"],
    },
    Row {
        role: "wheel_angle.{wheel}",
        sure: &[&["wheel", "angle"], &["wheel", "angles"]],
        hint: &[],
        without: &[
            "hand", "steer", "steering", "speed", "rate", "rl", "rr", "rear",
        ],
    },
    Row {
        role: "tyre_pressure.{wheel}",
        sure: &[
            &["tyre", "pressure"],
            &["tire", "pressure"],
            &["tyrepressure"],
            &["tirepressure"],
            &["inflation", "pressure"],
            &["tpms", "pressure"],
        ],
        hint: &[&["tpms"]],
        without: &[
            "temperature",
            "temp",
            "warning",
            "state",
            "status",
            "target",
        ],
    },
    Row {
        role: "hitch_force.{axis}",
        sure: &[
            &["hitch"],
            &["drawbar"],
            &["towbar"],
            &["tow", "force"],
            &["trailer", "force"],
        ],
        hint: &[&["coupling"]],
        without: &["angle", "speed"],
    },
    Row {
        role: "hub_acceleration.{wheel}.{axis}",
        sure: &[
            &["hub"],
            &["upright"],
            &["knuckle"],
            &["unsprung"],
            &["wheel", "accel"],
            &["wheel", "acceleration"],
        ],
        hint: &[&["accel"], &["acceleration"], &["acc"]],
        without: &["speed", "spd", "force", "strain"],
    },
    Row {
        role: "acceleration.{axis}",
        sure: &[
            &["imu", "acc"],
            &["imu", "accel"],
            &["imu", "acceleration"],
            &["imu", "ax"],
            &["imu", "ay"],
            &["imu", "az"],
            &["specific", "force"],
            &["lateral", "acceleration"],
            &["longitudinal", "acceleration"],
            &["vertical", "acceleration"],
        ],
        hint: &[],
        without: ON_A_WHEEL,
    },
    Row {
        role: "rate.{axis}",
        sure: &[
            &["yaw", "rate"],
            &["roll", "rate"],
            &["pitch", "rate"],
            &["imu", "rate"],
            &["imu", "gyro"],
            &["angular", "rate"],
        ],
        hint: &[&["gyro"], &["yawrate"]],
        without: ON_A_WHEEL,
    },
    Row {
        role: "speed.forward",
        sure: &[
            &["vehicle", "speed"],
            &["ground", "speed"],
            &["car", "speed"],
        ],
        hint: &[&["vehicle", "spd"]],
        without: ON_A_WHEEL,
    },
    Row {
        role: "wheel_speed.{wheel}",
        sure: &[
            &["wheel", "speed"],
            &["wheel", "spd"],
            &["whl", "speed"],
            &["whl", "spd"],
            &["wheelspeed"],
            &["wheel", "velocity"],
            &["wheel", "rpm"],
            &["wss"],
        ],
        hint: &[&["speed"], &["spd"], &["rpm"]],
        without: &[
            "direction",
            "dir",
            "sign",
            "pulse",
            "accel",
            "acceleration",
            "steer",
            "steering",
        ],
    },
    Row {
        role: "strain.{wheel}.{channel}",
        sure: &[
            &["strain"],
            &["gauge"],
            &["bridge"],
            &["tie", "rod"],
            &["toe", "link"],
            &["bending"],
        ],
        hint: &[&["arm"], &["wishbone"], &["link"], &["leg"]],
        without: &["travel", "position"],
    },
    Row {
        role: "deflection.{wheel}",
        sure: &[
            &["deflection"],
            &["suspension", "travel"],
            &["susp", "travel"],
            &["spring", "travel"],
            &["damper", "travel"],
            &["shock", "travel"],
            &["strut", "travel"],
            &["wheel", "travel"],
            &["damper", "position"],
            &["damper", "pos"],
            &["shock", "pos"],
            &["spring", "potentiometer"],
        ],
        hint: &[
            &["travel"],
            &["damper"],
            &["shock"],
            &["suspension"],
            &["susp"],
            &["ride", "height"],
        ],
        without: &["speed", "velocity", "force"],
    },
];

/// A signal with one of these words is no measurement that a role has.
const NO_MEASUREMENT: [&str; 37] = [
    "alive",
    "calibration",
    "cmd",
    "command",
    "checksum",
    "counter",
    "crc",
    "desired",
    "error",
    "err",
    "fault",
    "limit",
    "max",
    "min",
    "offset",
    "quality",
    "req",
    "request",
    "requested",
    "sensitivity",
    "setpoint",
    "sigma",
    "state",
    "status",
    "std",
    "supply",
    "target",
    "temp",
    "temperature",
    "time",
    "timestamp",
    "torque",
    "valid",
    "validity",
    "version",
    "voltage",
    "warning",
];

/// A signal that may have a role.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Proposed {
    /// Name of the role below `[source.<name>.roles]`; with braces where the name of the signal does
    /// not show which one it is.
    pub role: String,
    /// `Message.Signal`.
    pub signal: String,
    /// Unit of the signal in the DBC file.
    pub unit: String,
    /// Why a person must decide; `None` if the name and the unit are clear.
    pub doubt: Option<String>,
}

/// Proposes roles, in the order of the table, then of the files.
#[must_use]
pub fn propose(databases: &[Database]) -> Vec<Proposed> {
    let mut candidates = Vec::new();
    for message in databases.iter().flat_map(Database::messages) {
        for signal in &message.signals {
            candidates.extend(Candidate::of(message, signal));
        }
    }
    // The first file with a message decodes it.
    let mut known = std::collections::BTreeSet::new();
    candidates.retain(|candidate| known.insert(candidate.signal.clone()));
    let mut sure: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for candidate in candidates.iter_mut().filter(|c| c.is_complete()) {
        candidate.refused = refusal(&candidate.role, &candidate.signal, databases);
        if candidate.is_sure && candidate.refused.is_none() {
            let signals = sure.entry(candidate.role.clone()).or_default();
            signals.push(candidate.signal.clone());
        }
    }
    candidates.sort_by_key(|candidate| candidate.row);
    let proposed = candidates.into_iter();
    proposed.filter_map(|c| c.proposed(&sure)).collect()
}

/// A signal whose name fits a row.
struct Candidate {
    row: usize,
    role: String,
    signal: String,
    unit: String,
    is_sure: bool,
    /// Why the role does not accept the signal.
    refused: Option<String>,
}

impl Candidate {
    fn of(message: &MessageDef, signal: &SignalDef) -> Option<Self> {
        let mut name = Name::new(&message.name, &signal.name);
        if name.has_any(&NO_MEASUREMENT) {
            return None;
        }
        let fits = |phrases: &[Phrase], row: &Row| {
            !name.has_any(row.without) && phrases.iter().any(|phrase| name.has_all(phrase))
        };
        let sure = ROWS.iter().position(|row| fits(row.sure, row));
        let row = sure.or_else(|| ROWS.iter().position(|row| fits(row.hint, row)))?;
        let mut role = ROWS[row].role.to_owned();
        for place in Place::ALL {
            if let Some(value) = role.contains(place.pattern()).then(|| name.take(place)) {
                role = role.replace(place.pattern(), value.unwrap_or(place.pattern()));
            }
        }
        let candidate = Self {
            row,
            role,
            signal: format!("{}.{}", message.name, signal.name),
            unit: signal.unit.trim().to_owned(),
            is_sure: sure.is_some(),
            refused: None,
        };
        // A hint alone, without the place, says nothing.
        (candidate.is_sure || candidate.is_complete()).then_some(candidate)
    }

    fn is_complete(&self) -> bool {
        !self.role.contains('{')
    }

    /// The proposal; `None` if a clear one is better or the unit contradicts a hint.
    fn proposed(self, sure: &BTreeMap<String, Vec<String>>) -> Option<Proposed> {
        let clear = sure.get(&self.role).map_or(&[][..], Vec::as_slice);
        let doubt = if !self.is_complete() {
            let open = Place::ALL.into_iter();
            let open = open.filter(|place| self.role.contains(place.pattern()));
            let open: Vec<&str> = open.map(Place::question).collect();
            Some(format!("its name does not say {}", open.join(" and ")))
        } else if let (Some(reason), true) = (&self.refused, self.is_sure) {
            Some(reason.clone())
        } else if self.refused.is_some() || (!self.is_sure && !clear.is_empty()) {
            return None;
        } else if !self.is_sure {
            Some("its name is only a hint; compare it with the documents of the device".to_owned())
        } else if clear.len() > 1 {
            let others = clear.iter().filter(|signal| **signal != self.signal);
            let others: Vec<&str> = others.map(String::as_str).collect();
            Some(format!("{} fits too; keep one of them", others.join(", ")))
        } else {
            None
        };
        Some(Proposed {
            role: self.role,
            signal: self.signal,
            unit: self.unit,
            doubt,
        })
    }
}

/// Why a configuration with this role would be refused.
fn refusal(role: &str, signal: &str, databases: &[Database]) -> Option<String> {
    let value = toml::Value::String(signal.to_owned());
    let text = format!("[roles]\n{role} = {value}\n");
    let mut collector = ErrorCollector::new("", &text);
    let table = collector.parse()?;
    let mut top = Section::new("", table);
    let section = top.section("roles", &mut collector);
    roles::read(section, databases, &mut collector);
    top.finish(&mut collector);
    let problem = collector.into_problems().into_iter().next()?;
    Some(format!("{}; {}", problem.message, problem.help))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::PROJECT_DBC_TEXT;

    fn database(signals: &[(&str, &str, &str)]) -> Database {
        let mut text = "VERSION \"\"\nBU_: A\n".to_owned();
        for (number, (message, signal, unit)) in signals.iter().enumerate() {
            text += &format!(
                "BO_ {} {message}: 8 A\n SG_ {signal} : 0|16@1- (0.1,0) [0|0] \"{unit}\" A\n",
                256 + number
            );
        }
        Database::parse(text.as_bytes()).expect("a DBC file")
    }

    fn proposed(signals: &[(&str, &str, &str)]) -> Vec<Proposed> {
        propose(&[database(signals)])
    }

    /// Roles of a text, as a configuration reads them.
    fn read(text: &str, databases: &[Database]) -> Vec<roles::RoleOf> {
        let text = format!("[roles]\n{text}");
        let mut collector = ErrorCollector::new("", &text);
        let table = collector.parse().expect("TOML");
        let mut top = Section::new("", table);
        let section = top.section("roles", &mut collector);
        let mut found = roles::read(section, databases, &mut collector);
        for role in &mut found {
            role.at = None;
        }
        assert!(collector.is_empty(), "{:?}", collector.into_problems());
        found
    }

    #[test]
    fn the_built_in_file_gets_exactly_the_built_in_roles() {
        let databases = [Database::parse(PROJECT_DBC_TEXT.as_bytes()).expect("a DBC file")];
        let proposals = propose(&databases);
        let doubtful: Vec<_> = proposals.iter().filter(|p| p.doubt.is_some()).collect();
        assert!(doubtful.is_empty(), "{doubtful:?}");
        let lines: Vec<String> = proposals
            .iter()
            .map(|p| format!("{} = \"{}\"\n", p.role, p.signal))
            .collect();
        let wanted = read("", &databases);
        assert_eq!(read(&lines.concat(), &databases), wanted);
        assert_eq!(lines.len(), wanted.len());
        assert!(lines.len() > 50, "{}", lines.len());
    }

    #[test]
    fn names_of_other_makers_are_understood() {
        for (message, signal, unit, role) in [
            ("SAS", "SteeringWheelAngle", "deg", "steer"),
            ("IMU", "AccelX", "g", "acceleration.x"),
            ("ESP", "LateralAcceleration", "m/s^2", "acceleration.y"),
            ("ESP", "YawRate", "deg/s", "rate.z"),
            ("IMU_Gyro", "Roll_Rate", "deg/s", "rate.x"),
            ("Dash", "VehicleSpeed", "km/h", "speed.forward"),
            ("STEER_ANGLE_SENSOR", "STEER_ANGLE", "deg", "steer"),
            ("ABS1", "WhlSpdFrL", "rpm", "wheel_speed.FL"),
            ("ABS1", "WHEEL_SPEED_RR", "rad/s", "wheel_speed.RR"),
            ("Wheels", "FrontRightWheelSpeed", "rpm", "wheel_speed.FR"),
            (
                "WheelSpeeds_Rear",
                "Wheel_Speed_Left_Rear",
                "rpm",
                "wheel_speed.RL",
            ),
            ("Susp", "DamperTravel_LR", "count", "deflection.RL"),
            (
                "Box",
                "UpperRearStrain_FrontLeft",
                "count",
                "strain.FL.upper_rear",
            ),
            ("StrainRR", "TieRod", "count", "strain.RR.tie_rod"),
            ("Upright_FL", "AccZ", "g", "hub_acceleration.FL.z"),
            ("Trailer", "HitchForceLong", "kN", "hitch_force.x"),
        ] {
            let found = proposed(&[(message, signal, unit)]);
            assert_eq!(found.len(), 1, "{message}.{signal}: {found:?}");
            assert_eq!(found[0].role, role, "{message}.{signal}");
            assert_eq!(found[0].doubt, None, "{message}.{signal}");
        }
    }

    #[test]
    fn other_signals_get_no_role() {
        for (message, signal, unit) in [
            ("SAS", "SteeringWheelSpeed", "deg/s"),
            ("EPS", "SteeringTorque", "Nm"),
            ("EPS", "SteerAngleRequest", "deg"),
            ("ABS1", "WheelSpeedFL_Valid", ""),
            ("Strain_FL", "Temperature", "degC"),
            ("ENGINE", "EngineSpeed", "rpm"),
            ("GPS", "Latitude", "deg"),
            ("Cabin", "SeatPosition", "mm"),
        ] {
            let found = proposed(&[(message, signal, unit)]);
            assert_eq!(found, [], "{message}.{signal}");
        }
    }

    #[test]
    fn doubts_have_their_reason() {
        let doubt = |signals: &[(&str, &str, &str)], at: usize| {
            let found = proposed(signals);
            let doubt = found[at].doubt.clone();
            (found[at].role.clone(), doubt.expect("a doubt"))
        };
        let (role, reason) = doubt(&[("Box1", "strain_upper_front", "count")], 0);
        assert_eq!(role, "strain.{wheel}.upper_front");
        assert!(reason.contains("which wheel"), "{reason}");
        let (_, reason) = doubt(&[("SAS", "SteeringAngle", "Nm")], 0);
        assert!(reason.contains("\"Nm\""), "{reason}");
        let two = [("A", "SteerAngle", "deg"), ("B", "SteerAngle", "deg")];
        assert!(doubt(&two, 0).1.contains("B.SteerAngle fits too"));
        assert!(doubt(&two, 1).1.contains("A.SteerAngle fits too"));
        let (role, reason) = doubt(&[("A", "SpeedFL", "rpm")], 0);
        assert_eq!(role, "wheel_speed.FL");
        assert!(reason.contains("only a hint"), "{reason}");
        // A clear name wins over a hint.
        let found = proposed(&[("A", "SpeedFL", "rpm"), ("A2", "WheelSpeedFL", "rpm")]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].signal, "A2.WheelSpeedFL");
    }
}
