//! Tyre property files (`.tir`) of the Magic Formula 5.2 and 6.1.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::magic::{Coefficients61, MagicFormula52};
use super::property::Moments;
use crate::file::{Problem, closest};

/// Version of the Magic Formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Edition {
    /// 5.2.
    Mf52,
    /// 6.1.
    Mf61,
}

/// Side of the vehicle on which the tyre was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
    /// The file names no side: the coefficients hold for both.
    Both,
}

impl Side {
    /// Sign of lateral quantities on a wheel of the left or the right side.
    pub(super) fn mirror(self, left: bool) -> f64 {
        match (self, left) {
            (Self::Left, false) | (Self::Right, true) => -1.0,
            _ => 1.0,
        }
    }
}

/// Coefficients of a tyre property file, in SI units. In a vehicle file they are a table with the names
/// of the property file, so that a log contains the tyre.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, Entry>", into = "BTreeMap<String, Entry>")]
pub struct Tir {
    edition: Edition,
    side: Side,
    numbers: BTreeMap<String, f64>,
}

/// A value of a property file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Entry {
    /// A number.
    Number(f64),
    /// A whole number, as TOML distinguishes it.
    Whole(i64),
    /// A text.
    Text(String),
}

/// Units that a file may name.
const UNITS: [(&str, &[&str]); 5] = [
    ("LENGTH", &["METER", "METRE", "M"]),
    ("FORCE", &["NEWTON", "N"]),
    ("ANGLE", &["RADIANS", "RADIAN", "RAD"]),
    ("MASS", &["KG", "KILOGRAM"]),
    ("TIME", &["SECOND", "SEC", "S"]),
];

/// Sections whose coefficients are all known.
const CHECKED: [&str; 7] = [
    "SCALING_COEFFICIENTS",
    "LONGITUDINAL_COEFFICIENTS",
    "OVERTURNING_COEFFICIENTS",
    "LATERAL_COEFFICIENTS",
    "ROLLING_COEFFICIENTS",
    "ALIGNING_COEFFICIENTS",
    "OPERATING_CONDITIONS",
];

/// Numbers of other sections that are used.
const GENERAL: [&str; 14] = [
    "USE_MODE",
    "LONGVL",
    "UNLOADED_RADIUS",
    "WIDTH",
    "INFLPRES",
    "NOMPRES",
    "FNOMIN",
    "VERTICAL_STIFFNESS",
    "VERTICAL_DAMPING",
    "LATERAL_STIFFNESS",
    "PCFY1",
    "PFZ1",
    "FZMIN",
    "FZMAX",
];

/// Scaling factors, pressure terms and relaxation that are used.
const FACTORS: [&str; 48] = [
    "LFZO", "LCX", "LMUX", "LEX", "LKX", "LHX", "LVX", "LGAX", "LCY", "LMUY", "LEY", "LKY", "LHY",
    "LVY", "LGAY", "LTR", "LRES", "LGAZ", "LXAL", "LYKA", "LVYKA", "LS", "LMX", "LVMX", "LMY",
    "LKYC", "LKZC", "LSGAL", "LCZ", "PPX1", "PPX2", "PPX3", "PPX4", "PPY1", "PPY2", "PPY3", "PPY4",
    "PPY5", "PPZ1", "PPZ2", "PPMX1", "PTY1", "PTY2", "PHY3", "QBZ4", "QBZ6", "QSY7", "QSY8",
];

/// Coefficients without influence here: those of transients, turn slip and motorcycle tyres.
const UNUSED: [&str; 21] = [
    "LSGKP", "LGYR", "LIP", "LMUV", "LMP", "LKC", "LCMY", "PTX1", "PTX2", "PTX3", "QTZ1", "MBELT",
    "QSX12", "QSX13", "QSX14", "LMPHI", "LSGAX", "LAMZ", "NOMPRES", "INFLPRES", "MP1",
];

/// Coefficients of the Magic Formula 6.1 that 5.2 does not have.
const ONLY_61: [&str; 38] = [
    "PPX1", "PPX2", "PPX3", "PPX4", "PPY1", "PPY2", "PPY3", "PPY4", "PPY5", "PPZ1", "PPZ2",
    "PPMX1", "RBX3", "RBY4", "PEY5", "PKY4", "PKY5", "PKY6", "PKY7", "QBZ6", "QDZ10", "QDZ11",
    "QSX4", "QSX5", "QSX6", "QSX7", "QSX8", "QSX9", "QSX10", "QSX11", "QSY5", "QSY6", "QSY7",
    "QSY8", "LKYC", "LKZC", "PFZ1", "PCFY1",
];

/// Coefficients of the Magic Formula 5.2 that 6.1 does not have.
const ONLY_52: [&str; 7] = ["PHY3", "LGAX", "LGAY", "LGAZ", "PTY1", "PTY2", "LSGAL"];

/// Coefficients without which there is no tyre.
const NEEDED: [&str; 13] = [
    "FNOMIN",
    "UNLOADED_RADIUS",
    "PCX1",
    "PDX1",
    "PKX1",
    "RBX1",
    "RCX1",
    "PCY1",
    "PDY1",
    "PKY1",
    "PKY2",
    "RBY1",
    "RCY1",
];

/// A value of a property file with its line.
struct Line {
    number: usize,
    section: String,
    name: String,
    value: String,
}

/// Lines `NAME = value` of a property file. A `$` or `!` begins a comment. A value in quotes is a text.
fn lines(text: &str) -> Vec<Line> {
    let mut section = String::new();
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split(['$', '!']).next().unwrap_or_default().trim();
        if let Some(name) = line.strip_prefix('[').and_then(|l| l.split(']').next()) {
            section = name.trim().to_uppercase();
        } else if let Some((name, value)) = line.split_once('=') {
            found.push(Line {
                number: index + 1,
                section: section.clone(),
                name: name.trim().to_uppercase(),
                value: value.trim().trim_matches(['\'', '"']).trim().to_owned(),
            });
        }
    }
    found
}

/// All names that a property file may have in its sections of coefficients.
fn known() -> Vec<String> {
    let formulas = MagicFormula52::names()
        .chain(Coefficients61::NAMES.iter().copied())
        .chain(Moments::NAMES.iter().copied())
        .map(str::to_uppercase);
    let others = GENERAL.iter().chain(&FACTORS).chain(&UNUSED);
    formulas
        .chain(others.map(|name| (*name).to_owned()))
        .collect()
}

impl Tir {
    /// Reads a property file. `file` is only named in messages.
    ///
    /// # Errors
    /// All mistakes at once, each with its line, name, value and remedy.
    pub fn parse(text: &str, file: &str) -> Result<Self, Vec<Problem>> {
        let lines = lines(text);
        let mut problems = Vec::new();
        let mut entries = BTreeMap::new();
        let known = known();
        for line in &lines {
            let fault = match line.section.as_str() {
                "UNITS" => unit_fault(line),
                section => {
                    let is_checked = CHECKED.contains(&section);
                    match entry(line, &known, is_checked) {
                        Ok(Some(value)) => {
                            entries.insert(line.name.clone(), value);
                            None
                        }
                        Ok(None) => None,
                        Err(fault) => Some(fault),
                    }
                }
            };
            if let Some((message, help)) = fault {
                problems.push(problem(
                    file,
                    line.number,
                    &line.name,
                    &line.value,
                    message,
                    help,
                ));
            }
        }
        match Self::from_entries(&entries) {
            Ok(tir) if problems.is_empty() => return Ok(tir),
            Ok(_) => {}
            Err(faults) => problems.extend(faults.into_iter().map(|fault| {
                let line = lines.iter().find(|line| line.name == fault.name);
                let number = line.map_or(0, |line| line.number);
                problem(
                    file,
                    number,
                    &fault.name,
                    &fault.value,
                    fault.message,
                    fault.help,
                )
            })),
        }
        Err(problems)
    }

    /// The coefficients as a table on one line, which replaces the name of the file in a vehicle file.
    pub(crate) fn to_inline(&self) -> String {
        let entries: BTreeMap<String, Entry> = self.clone().into();
        let fields = entries.iter().map(|(name, value)| match value {
            Entry::Number(number) => format!("{name} = {number:?}"),
            Entry::Whole(number) => format!("{name} = {number}"),
            Entry::Text(text) => format!("{name} = \"{text}\""),
        });
        format!("{{ {} }}", fields.collect::<Vec<_>>().join(", "))
    }

    fn from_entries(entries: &BTreeMap<String, Entry>) -> Result<Self, Vec<Fault>> {
        let mut faults = Vec::new();
        let edition = edition(entries).map_err(|fault| faults.push(fault)).ok();
        let side = side(entries).map_err(|fault| faults.push(fault)).ok();
        let number = |name: &str| match entries.get(name) {
            Some(Entry::Number(number)) => Some(*number),
            Some(Entry::Whole(number)) => Some(*number as f64),
            _ => None,
        };
        for name in NEEDED {
            match number(name) {
                None => faults.push(Fault::new(
                    name,
                    "",
                    "is missing",
                    "add it to the .tir file",
                )),
                Some(0.0) => faults.push(Fault::new(name, "0", "must not be 0", FIT)),
                Some(_) => {}
            }
        }
        ranges(&number, &mut faults);
        let known = known();
        for name in entries.keys() {
            let is_known = ["FITTYP", "TYRESIDE"].contains(&name.as_str()) || known.contains(name);
            if !is_known {
                faults.push(unknown(name, &known));
            }
        }
        match (edition, side) {
            (Some(edition), Some(side)) if faults.is_empty() => Ok(Self {
                edition,
                side,
                numbers: entries
                    .keys()
                    .filter(|name| *name != "FITTYP")
                    .filter_map(|name| Some((name.clone(), number(name)?)))
                    .collect(),
            }),
            _ => Err(faults),
        }
    }

    pub(crate) fn edition(&self) -> Edition {
        self.edition
    }

    pub(crate) fn side(&self) -> Side {
        self.side
    }

    /// A number of the file.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.numbers.get(name).copied()
    }

    pub(super) fn number_or(&self, name: &str, default: f64) -> f64 {
        self.number(name).unwrap_or(default)
    }

    pub(super) fn is_of_mf61_alone(name: &str) -> bool {
        ONLY_61.contains(&name)
    }

    /// Change of the inflation pressure from the nominal one, in parts (4.E2b); 0 without a pressure.
    pub(super) fn pressure_change(&self) -> f64 {
        match (self.number("INFLPRES"), self.number("NOMPRES")) {
            (Some(pressure), Some(nominal)) if nominal > 0.0 => (pressure - nominal) / nominal,
            _ => 0.0,
        }
    }

    /// Nominal inflation pressure NOMPRES, Pa, of a file whose formula has terms of the pressure.
    pub(crate) fn nominal_pressure_pa(&self) -> Option<f64> {
        let nominal_pa = self.number("NOMPRES").filter(|nominal| *nominal > 0.0);
        nominal_pa.filter(|_| self.edition == Edition::Mf61)
    }

    /// The same tyre at another inflation pressure, Pa.
    pub(crate) fn inflated(&self, pressure_pa: f64) -> Self {
        let mut tir = self.clone();
        tir.numbers.insert("INFLPRES".to_owned(), pressure_pa);
        tir
    }

    /// Vertical stiffness, N/m.
    pub(crate) fn vertical_stiffness_n_m(&self) -> Option<f64> {
        let pressed = 1.0 + self.number_or("PFZ1", 0.0) * self.pressure_change();
        let scale = self.number_or("LCZ", 1.0);
        let stiffness = self.number("VERTICAL_STIFFNESS")? * pressed * scale;
        (stiffness > 0.0).then_some(stiffness)
    }

    /// Lateral relaxation length at the nominal load, m: P_TY1 sin(2 atan(1/P_TY2)) R_0 in 5.2,
    /// cornering over lateral stiffness in 6.1; 0 without coefficients.
    pub(super) fn relaxation_length_m(&self, cornering_n_rad: f64) -> f64 {
        let number = |name: &str| self.number_or(name, 0.0);
        match self.edition {
            Edition::Mf52 if number("PTY2") != 0.0 => {
                let grown = math::sin(2.0 * math::atan(1.0 / number("PTY2")));
                number("PTY1") * grown * number("UNLOADED_RADIUS") * self.number_or("LSGAL", 1.0)
            }
            Edition::Mf61 if number("LATERAL_STIFFNESS") > 0.0 => {
                cornering_n_rad / number("LATERAL_STIFFNESS")
            }
            _ => 0.0,
        }
    }

    /// What the file has that is not used, or that is worth a second look, given the static load of the
    /// tyre, N.
    pub(crate) fn warnings(&self, static_load_n: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        let (own, others): (_, &[&str]) = match self.edition {
            Edition::Mf52 => ("5.2", &ONLY_61),
            Edition::Mf61 => ("6.1", &ONLY_52),
        };
        let is_set = |name: &&&str| {
            let plain = if name.starts_with('L') || **name == "QSY7" {
                1.0
            } else {
                0.0
            };
            let plain = if **name == "PKY4" { 2.0 } else { plain };
            self.number(name).is_some_and(|value| value != plain)
        };
        let foreign: Vec<&str> = others.iter().filter(is_set).copied().collect();
        if !foreign.is_empty() {
            let names = foreign.join(", ");
            warnings.push(format!(
                "{names}: not part of the Magic Formula {own} and not used; check FITTYP"
            ));
        }
        let unused = ["LMUV", "QSX12", "QSX13", "QSX14"];
        let set = unused
            .into_iter()
            .filter(|name| self.number_or(name, 0.0) != 0.0);
        let set: Vec<&str> = set.collect();
        if !set.is_empty() {
            warnings.push(format!("{}: not modelled and not used", set.join(", ")));
        }
        if self
            .number("USE_MODE")
            .is_some_and(|mode| mode.abs() % 10.0 == 5.0)
        {
            let text = "USE_MODE asks for turn slip, which is not modelled: steady-state combined slip \
                        is used";
            warnings.push(text.to_owned());
        }
        let least = self.number_or("FZMIN", 0.0);
        let most = self.number_or("FZMAX", f64::INFINITY);
        if !(least..=most).contains(&static_load_n) {
            warnings.push(format!(
                "the static load {static_load_n:.0} N is outside of the range of loads {least:.0} to \
                 {most:.0} N (FZMIN, FZMAX): beyond it friction coefficients are those at the limit"
            ));
        }
        warnings
    }
}

/// What to do about coefficients that fit no tyre.
const FIT: &str = "check the fit of the tyre";

/// A mistake that shows only between values.
struct Fault {
    name: String,
    value: String,
    message: String,
    help: String,
}

impl Fault {
    fn new(name: &str, value: &str, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            name: name.to_owned(),
            value: value.to_owned(),
            message: message.into(),
            help: help.into(),
        }
    }
}

fn unknown(name: &str, known: &[String]) -> Fault {
    let names: Vec<&str> = known.iter().map(String::as_str).collect();
    let help = match closest(name, &names) {
        Some(near) => format!("did you mean {near}?"),
        None => "remove it, or check the section that it stands in".to_owned(),
    };
    Fault::new(
        name,
        "",
        "is no coefficient of the Magic Formula 5.2 or 6.1",
        help,
    )
}

/// Values that no tyre has.
fn ranges(number: &dyn Fn(&str) -> Option<f64>, faults: &mut Vec<Fault>) {
    let mut check = |name: &str, least: f64, most: f64, unit: &str| {
        if let Some(value) = number(name).filter(|value| !(least..=most).contains(value)) {
            let message = format!("must lie between {least} and {most} {unit}");
            let help = format!(
                "give it in {}",
                if unit.is_empty() { "SI units" } else { unit }
            );
            faults.push(Fault::new(name, &value.to_string(), message, help));
        }
    };
    check("FNOMIN", 10.0, 1e6, "N");
    check("UNLOADED_RADIUS", 0.02, 3.0, "m");
    check("WIDTH", 0.0, 3.0, "m");
    check("INFLPRES", 1e4, 2e6, "Pa");
    check("NOMPRES", 1e4, 2e6, "Pa");
    check("VERTICAL_DAMPING", 0.0, 1e6, "N s/m");
    check("PKX1", 1.0, 500.0, "");
    check("LFZO", 0.01, 100.0, "");
    let pair = |low: &str, high: &str| Some((number(low)?, number(high)?));
    if let Some((low, high)) = pair("FZMIN", "FZMAX").filter(|(low, high)| low >= high) {
        let message = format!("is not below FZMAX = {high}");
        faults.push(Fault::new(
            "FZMIN",
            &low.to_string(),
            message,
            "exchange the two",
        ));
    }
    // D_y and K_y have one sign in the axes of ISO 8855 with a negative slope.
    if let Some((slope, peak)) = pair("PKY1", "PDY1").filter(|(slope, _)| *slope > 0.0) {
        let message = format!(
            "gives a positive lateral force at a positive slip angle (PDY1 = {peak}): the axes are not \
             those of ISO 8855"
        );
        let help = "convert the coefficients to the W axes of TYDEX (ISO), where PKY1 is negative";
        faults.push(Fault::new("PKY1", &slope.to_string(), message, help));
    }
    let rolls = ["QSY3", "QSY4"]
        .iter()
        .any(|name| number(name).is_some_and(|v| v != 0.0));
    if rolls && number("LONGVL").is_none_or(|speed| speed <= 0.0) {
        let message = "is missing, and QSY3 or QSY4 need it";
        faults.push(Fault::new(
            "LONGVL",
            "",
            message,
            "add the speed of the measurement, m/s",
        ));
    }
}

fn edition(entries: &BTreeMap<String, Entry>) -> Result<Edition, Fault> {
    let help = "fit the tyre as Magic Formula 5.2 (FITTYP 6 or 52) or 6.1 (FITTYP 61)";
    let written = match entries.get("FITTYP") {
        Some(Entry::Number(number)) => number.to_string(),
        Some(Entry::Whole(number)) => number.to_string(),
        Some(Entry::Text(text)) => text.to_uppercase(),
        None => return Err(Fault::new("FITTYP", "", "is missing", help)),
    };
    match written.as_str() {
        "6" | "52" | "MF52" | "PAC2002" => Ok(Edition::Mf52),
        "61" | "MF61" => Ok(Edition::Mf61),
        other => Err(Fault::new(
            "FITTYP",
            other,
            "is a tyre model that is not supported",
            help,
        )),
    }
}

fn side(entries: &BTreeMap<String, Entry>) -> Result<Side, Fault> {
    match entries.get("TYRESIDE") {
        None => Ok(Side::Both),
        Some(Entry::Text(text)) => match text.to_uppercase().as_str() {
            "LEFT" => Ok(Side::Left),
            "RIGHT" => Ok(Side::Right),
            "SYMMETRIC" | "BOTH" => Ok(Side::Both),
            _ => Err(Fault::new(
                "TYRESIDE",
                text,
                "is no side",
                "write LEFT or RIGHT",
            )),
        },
        Some(_) => Err(Fault::new(
            "TYRESIDE",
            "",
            "is a number",
            "write LEFT or RIGHT",
        )),
    }
}

type LineFault = (String, String);

/// Unit that is not SI.
fn unit_fault(line: &Line) -> Option<LineFault> {
    let (_, accepted) = UNITS.iter().find(|(name, _)| *name == line.name)?;
    let is_si = accepted.contains(&line.value.to_uppercase().as_str());
    (!is_si && !line.value.is_empty()).then(|| {
        let unit = accepted[0].to_lowercase();
        (
            format!("is not the SI unit {unit}"),
            format!("convert the file to {unit}; only SI units are read"),
        )
    })
}

/// The value of a line, if it is used.
fn entry(line: &Line, known: &[String], is_checked: bool) -> Result<Option<Entry>, LineFault> {
    // The format of older files names the formula.
    if line.name == "FITTYP" || line.name == "TYRESIDE" {
        let whole = line.value.parse::<i64>().map(Entry::Whole);
        return Ok(Some(whole.unwrap_or(Entry::Text(line.value.clone()))));
    }
    let is_known = known.contains(&line.name);
    if !is_known {
        if is_checked {
            let fault = unknown(&line.name, known);
            return Err((fault.message, fault.help));
        }
        return Ok(None);
    }
    if line.value.is_empty() {
        return Ok(None);
    }
    // Fortran writes exponents with D.
    let number = line.value.replace(['D', 'd'], "e").parse::<f64>();
    match number {
        Ok(number) if number.is_finite() => Ok(Some(Entry::Number(number))),
        _ => Err(("is not a finite number".into(), "give a number".into())),
    }
}

fn problem(
    file: &str,
    line: usize,
    name: &str,
    value: &str,
    message: String,
    help: String,
) -> Problem {
    Problem {
        file: file.to_owned(),
        line,
        column: 0,
        field: name.to_owned(),
        value: value.to_owned(),
        message,
        help,
    }
}

impl TryFrom<BTreeMap<String, Entry>> for Tir {
    type Error = String;

    fn try_from(entries: BTreeMap<String, Entry>) -> Result<Self, String> {
        Self::from_entries(&entries).map_err(|faults| {
            let texts = faults.iter().map(|fault| {
                let value = if fault.value.is_empty() { "" } else { " = " };
                format!(
                    "{}{value}{}: {}; {}",
                    fault.name, fault.value, fault.message, fault.help
                )
            });
            texts.collect::<Vec<_>>().join("; ")
        })
    }
}

impl From<Tir> for BTreeMap<String, Entry> {
    fn from(tir: Tir) -> Self {
        let fittyp = match tir.edition {
            Edition::Mf52 => 52,
            Edition::Mf61 => 61,
        };
        let side = match tir.side {
            Side::Left => Some("LEFT"),
            Side::Right => Some("RIGHT"),
            Side::Both => None,
        };
        let numbers = tir.numbers.into_iter();
        let mut entries: Self = numbers.map(|(name, n)| (name, Entry::Number(n))).collect();
        entries.insert("FITTYP".to_owned(), Entry::Whole(fittyp));
        if let Some(side) = side {
            entries.insert("TYRESIDE".to_owned(), Entry::Text(side.to_owned()));
        }
        entries
    }
}
