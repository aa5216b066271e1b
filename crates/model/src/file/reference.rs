//! Reference pages and JSON Schemas of the vehicle file and the sensors file, from the rules and from the
//! comments of the structures.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::rules::{Kind, Range, Rule, TableRules};
use crate::sensors::{Amplifier, Bus};
use crate::vehicle::Drivetrain;

/// A file that users write.
struct File {
    title: &'static str,
    /// Text before the tables of fields.
    introduction: &'static str,
    /// Sources of the structures.
    sources: &'static [&'static str],
    sections: &'static [TableRules],
    /// Structure of each table.
    structures: &'static [(&'static str, &'static str)],
}

const VEHICLE: File = File {
    title: "Vehicle file",
    introduction: "A vehicle file describes a vehicle in SI units. A tyre can come from a property file \
        ([Tyre property files](tyres.md)). `atvrec vehicle show prowler` prints an \
        example, `atvrec vehicle check` checks a file, and `atvrec vehicle draw` draws its hard-points \
        ([Commands](commands.md#vehicle-and-sensors)).\n\n\
        Axes are those of ISO 8855: x forward, y to the left, z up. Hard-points and centres of gravity of \
        unsprung parts are in the frame of their axle: the origin is on the design ground plane, in the \
        middle plane of the vehicle, below the line through the wheel centres. They are those of the left \
        corner; the right corner is its mirror image. Positions of payloads and of the hitch are in the \
        frame of the front axle. `rear` has the fields of `front`.\n\n\
        A tolerance is the bound of an error of either sign that is equally likely within it; 0 means that the \
        value is exact. The tolerances are those of a workshop that measures what the file contains: \
        [Parameters that are not exact](estimator.md#parameters-that-are-not-exact) says what they do.",
    sources: &[
        include_str!("../vehicle.rs"),
        include_str!("../vehicle/linkages.rs"),
        include_str!("../vehicle/payload.rs"),
        include_str!("../vehicle/pressure.rs"),
        include_str!("../tolerances.rs"),
    ],
    sections: crate::vehicle::SECTIONS,
    structures: &[
        ("", "Vehicle"),
        ("body", "Body"),
        ("body.sprung", "Sprung"),
        ("body.pitch", "Pitch"),
        ("front", "Axle"),
        ("front.unsprung", "Unsprung"),
        ("front.strut", "Strut"),
        ("front.wishbone", "Wishbone"),
        ("front.macpherson", "Macpherson"),
        ("front.five_link", "FiveLink"),
        ("rear.trailing_arm", "TrailingArm"),
        ("rear.live_axle", "LiveAxle"),
        ("rear.leaf_axle", "LeafAxle"),
        ("front.tyre", "Tyre"),
        ("front.tyre.pressure", "TyrePressure"),
        ("steering", "Steering"),
        ("drivetrain", "Drivetrain"),
        ("payload", "Payload"),
        ("hitch", "Hitch"),
        ("tolerances", "VehicleTolerances"),
    ],
};

const SENSORS: File = File {
    title: "Sensors file",
    introduction: "A sensors file describes the sensors of a vehicle in SI units: rates, ranges, wiring, \
        positions and noise. `atvrec sensors show thesis-10bit` prints an example, and \
        `atvrec sensors check` checks a file ([Commands](commands.md#vehicle-and-sensors)).\n\n\
        A tolerance is the bound of an error of either sign that is equally likely within it; 0 means that the \
        value is exact: [Parameters that are not exact](estimator.md#parameters-that-are-not-exact).",
    sources: &[
        include_str!("../sensors.rs"),
        include_str!("../tolerances.rs"),
    ],
    sections: crate::sensors::SECTIONS,
    structures: &[
        ("", "Sensors"),
        ("strain", "StrainChain"),
        ("strain.amplifier", "Amplifier"),
        ("strain.transducer", "Transducer"),
        ("strain.bending", "BendingBridge"),
        ("deflection", "Potentiometers"),
        ("imu", "Imu"),
        ("gnss_velocity", "GnssVelocity"),
        ("gnss_attitude", "GnssAttitude"),
        ("wheel_speed", "WheelSpeed"),
        ("steer", "Steer"),
        ("wheel_angles", "WheelAngles"),
        ("hub_acceleration", "HubAcceleration"),
        ("bus", "Bus"),
        ("tolerances", "SensorsTolerances"),
    ],
};

/// What the source says of a field.
#[derive(Clone, Debug, Default)]
struct Comment {
    meaning: String,
    /// Value without the field; empty for fields that must be there.
    default: String,
}

/// The comments of the fields of a structure.
fn comments(sources: &[&str], structure: &str) -> BTreeMap<String, Comment> {
    let head = format!("pub struct {structure} {{");
    let body = sources.iter().find_map(|text| {
        let (_, after) = text.split_once(&head)?;
        after.split_once("\n}").map(|(body, _)| body)
    });
    let mut found = BTreeMap::new();
    let (mut meaning, mut attributes) = (String::new(), String::new());
    for line in body.expect(structure).lines().map(str::trim) {
        if let Some(text) = line.strip_prefix("///") {
            if !meaning.is_empty() {
                meaning.push(' ');
            }
            meaning += text.trim();
        } else if line.starts_with("#[") {
            attributes += line;
        } else if let Some((name, kind)) = line
            .strip_prefix("pub ")
            .and_then(|field| field.split_once(": "))
        {
            let default = match kind.trim_end_matches(',') {
                _ if !attributes.contains("default") => "",
                _ if attributes.contains("\"unset_one\"") => "1, or from `tir`",
                _ if attributes.contains("\"unset\"") => "0, or from `tir`",
                kind if kind.starts_with("Option") => "none",
                "f64" => "0",
                "[f64; 2]" => "[0, 0]",
                "[f64; 3]" => "[0, 0, 0]",
                kind if kind.starts_with("Vec") || kind.starts_with("BTreeMap") => "none",
                "Drivetrain" => &inline(&Drivetrain::default()),
                "Amplifier" => &inline(&Amplifier::default()),
                "Bus" => &inline(&Bus::default()),
                "StrainChain" | "Potentiometers" | "Imu" | "GnssVelocity" | "GnssAttitude"
                | "WheelSpeed" => "not fitted",
                "u8" => "16",
                "StrutOn" => "`\"upright\"`",
                kind => panic!("{kind} has no default value here"),
            };
            let meaning = std::mem::take(&mut meaning);
            // A comment can state what holds without the field.
            let (meaning, default) = match meaning.split_once(" Without it: ") {
                Some((meaning, without)) => (meaning, without.trim_end_matches('.')),
                None => (meaning.as_str(), default),
            };
            let comment = Comment {
                meaning: meaning.to_owned(),
                default: default.to_owned(),
            };
            found.insert(name.to_owned(), comment);
            attributes.clear();
        }
    }
    found
}

/// A table on one line.
fn inline(table: &impl serde::Serialize) -> String {
    let value = toml::Value::try_from(table).expect("a table");
    format!("`{value}`")
}

fn number(range: Range) -> String {
    match range {
        Range::Finite => String::new(),
        Range::Positive(most) => format!("above 0, at most {most}"),
        Range::NonNegative(most) => format!("0 to {most}"),
        Range::Within(least, most) => format!("{least} to {most}"),
    }
}

/// The values of a field, for people.
fn values(kind: Kind) -> String {
    let listed = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(|name| format!("`\"{name}\"`")).collect();
        names.join(", ")
    };
    match kind {
        Kind::Table => "table".into(),
        Kind::Tables => "list of tables".into(),
        Kind::Text => "text".into(),
        Kind::Texts => "texts by name".into(),
        Kind::Flag => "`true` or `false`".into(),
        Kind::Number(range) => number(range),
        Kind::Integer(least, most) => format!("whole number, {least} to {most}"),
        Kind::Vector(count, range) => format!("{count} numbers, {}", number(range))
            .trim_end_matches(", ")
            .to_owned(),
        Kind::Pairs => "pairs of numbers".into(),
        Kind::TyreFile => "name of a `.tir` file, or its coefficients as a table".into(),
        Kind::Choice(names) => format!("one of {}", listed(names)),
        Kind::Choices(names) => format!("some of {}", listed(names)),
    }
}

impl File {
    fn structure(&self, tables: &[&str]) -> &'static str {
        let mut known = self.structures.iter();
        let found = known.find(|(table, _)| tables.contains(table));
        found.expect("a structure for each table").1
    }

    fn page(&self) -> String {
        let mut page = format!("# {}\n\n{}\n", self.title, self.introduction);
        for section in self.sections {
            let comments = comments(self.sources, self.structure(section.tables));
            let names: Vec<String> = (section.tables.iter())
                .map(|table| match *table {
                    "payload" => "`[[payload]]`".to_owned(),
                    table => format!("`[{table}]`"),
                })
                .collect();
            let heading = match section.tables {
                [""] => "Top of the file".to_owned(),
                _ => names.join(" and "),
            };
            let _ = write!(
                page,
                "\n## {heading}\n\n| field | meaning | values | without it |\n|---|---|---|---|\n"
            );
            for Rule {
                field,
                kind,
                required,
                unless,
            } in section.rules
            {
                let Comment { meaning, default } = &comments[*field];
                let default = match (required, unless) {
                    (true, Some(_)) => "error, or from `tir`",
                    (true, None) => "error",
                    (false, _) => default,
                };
                let values = values(*kind);
                let _ = writeln!(page, "| `{field}` | {meaning} | {values} | {default} |");
            }
        }
        page
    }

    /// The JSON Schema, for editors.
    fn schema(&self) -> String {
        let mut root = json!({});
        for section in self.sections {
            let comments = comments(self.sources, self.structure(section.tables));
            for table in section.tables {
                let mut at = &mut root;
                for part in table.split('.').filter(|part| !part.is_empty()) {
                    at = &mut at["properties"][part];
                    if at["type"] == "array" {
                        at = &mut at["items"];
                    }
                }
                let object = object(section.rules, &comments);
                match at {
                    Value::Object(present) => present.extend(object),
                    _ => *at = Value::Object(object),
                }
            }
        }
        root["$schema"] = json!("http://json-schema.org/draft-07/schema#");
        root["title"] = json!(self.title);
        format!("{root:#}\n")
    }
}

/// Schema of a table.
fn object(rules: &[Rule], comments: &BTreeMap<String, Comment>) -> Map<String, Value> {
    let mut properties = Map::new();
    for Rule { field, kind, .. } in rules {
        let mut property = property(*kind);
        property["description"] = json!(comments[*field].meaning);
        properties.insert((*field).to_owned(), property);
    }
    let required = |is_given: bool| -> Vec<&str> {
        let rules = rules.iter().filter(|rule| rule.required);
        let rules = rules.filter(|rule| rule.unless.is_some() == is_given);
        rules.map(|rule| rule.field).collect()
    };
    let mut object = json!({
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "required": required(false),
    });
    if let Some(other) = rules.iter().find_map(|rule| rule.unless) {
        object["anyOf"] = json!([{ "required": [other] }, { "required": required(true) }]);
    }
    match object {
        Value::Object(object) => object,
        _ => Map::new(),
    }
}

fn property(kind: Kind) -> Value {
    let ranged = |range| match range {
        Range::Finite => json!({ "type": "number" }),
        Range::Positive(most) => {
            json!({ "type": "number", "exclusiveMinimum": 0.0, "maximum": most })
        }
        Range::NonNegative(most) => json!({ "type": "number", "minimum": 0.0, "maximum": most }),
        Range::Within(least, most) => {
            json!({ "type": "number", "minimum": least, "maximum": most })
        }
    };
    match kind {
        Kind::Table => json!({ "type": "object" }),
        Kind::Tables => json!({ "type": "array", "items": { "type": "object" } }),
        Kind::Text => json!({ "type": "string" }),
        Kind::Texts => {
            json!({ "type": "object", "additionalProperties": { "type": "string" } })
        }
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Number(range) => ranged(range),
        Kind::Integer(least, most) => {
            json!({ "type": "integer", "minimum": least, "maximum": most })
        }
        Kind::Vector(count, range) => {
            json!({ "type": "array", "items": ranged(range), "minItems": count, "maxItems": count })
        }
        Kind::Pairs => {
            let pair = json!({
                "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2
            });
            json!({ "type": "array", "items": pair })
        }
        Kind::TyreFile => json!({ "type": ["string", "object"] }),
        Kind::Choice(names) => json!({ "enum": names }),
        Kind::Choices(names) => {
            json!({ "type": "array", "items": { "enum": names }, "uniqueItems": true })
        }
    }
}

#[test]
fn the_reference_of_the_files_is_current() {
    for (file, name) in [(VEHICLE, "vehicle-file"), (SENSORS, "sensors-file")] {
        testkit::assert_file(&format!("docs/{name}.md"), file.page());
        testkit::assert_file(&format!("docs/{name}.schema.json"), file.schema());
    }
}

/// Each built-in file has the fields of the schema only, and all that it requires.
#[test]
fn built_in_files_follow_the_schemas() {
    fn fits(schema: &Value, value: &toml::Value, name: &str) {
        match value {
            toml::Value::Table(table) if schema["properties"].is_object() => {
                for required in schema["required"].as_array().into_iter().flatten() {
                    let required = required.as_str().unwrap_or_default();
                    assert!(table.contains_key(required), "{name}: no {required}");
                }
                for (field, value) in table {
                    let property = &schema["properties"][field];
                    assert!(property.is_object(), "{name}.{field} is not in the schema");
                    fits(property, value, &format!("{name}.{field}"));
                }
            }
            toml::Value::Float(number) => {
                let least = (schema["minimum"].as_f64()).or(schema["exclusiveMinimum"].as_f64());
                assert!(least.is_none_or(|least| *number >= least), "{name}");
                let most = schema["maximum"].as_f64();
                assert!(most.is_none_or(|most| *number <= most), "{name}");
            }
            toml::Value::Array(values) => {
                for value in values {
                    fits(&schema["items"], value, name);
                }
            }
            _ => {}
        }
    }
    let check = |file: &File, name: &str, text: &str| {
        let schema = serde_json::from_str(&file.schema()).expect("JSON");
        let value: toml::Table = toml::from_str(text).expect("TOML");
        fits(&schema, &toml::Value::Table(value), name);
    };
    for name in crate::vehicle::Vehicle::builtin_names() {
        let text = crate::vehicle::Vehicle::builtin_text(name).expect(name);
        check(&VEHICLE, name, text);
    }
    for name in crate::sensors::Sensors::builtin_names() {
        let text = crate::sensors::Sensors::builtin_text(name).expect(name);
        check(&SENSORS, name, text);
    }
}
