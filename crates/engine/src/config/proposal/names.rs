//! Words of the names of signals, and the wheel, side, axis and channel in them.

/// Something in a name that completes a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    Wheel,
    Side,
    Axis,
    Channel,
}

/// A value, and the words of which all are in the name; the words are one after the other.
type Value = (&'static str, &'static [&'static [&'static str]]);

const FRONT: &[&str] = &["front", "frnt", "frt", "fr", "f"];
const REAR: &[&str] = &["rear", "rr", "r", "re"];
const LEFT: &[&str] = &["left", "lft", "lh", "le", "l"];
const RIGHT: &[&str] = &["right", "rght", "rgt", "rt", "rh", "ri", "r"];

/// Wheels as one word.
const CORNERS: [(&str, &[&str]); 4] = [
    ("FL", &["fl", "lf", "vl"]),
    ("FR", &["fr", "rf", "vr"]),
    ("RL", &["rl", "lr", "hl"]),
    ("RR", &["rr", "hr"]),
];

/// Wheels as two words: axle and side.
const WHEELS: [Value; 4] = [
    ("FL", &[FRONT, LEFT]),
    ("FR", &[FRONT, RIGHT]),
    ("RL", &[REAR, LEFT]),
    ("RR", &[REAR, RIGHT]),
];

const SIDES: [Value; 2] = [("left", &[LEFT]), ("right", &[RIGHT])];

const AXES: [Value; 3] = [
    (
        "x",
        &[&["x", "ax", "fx", "lon", "long", "longitudinal", "roll"]],
    ),
    ("y", &[&["y", "ay", "fy", "lat", "lateral", "pitch"]]),
    ("z", &[&["z", "az", "fz", "vert", "vertical", "yaw"]]),
];

const UPPER: &[&str] = &["upper", "upr", "top"];
const LOWER: &[&str] = &["lower", "lwr", "low", "bottom"];

/// Strain channels; bending before axial, which has fewer words.
const CHANNELS: [Value; 17] = [
    ("lower_front_bending", &[LOWER, &["front"], &["bending"]]),
    ("lower_rear_bending", &[LOWER, &["rear"], &["bending"]]),
    ("lower_front_bending", &[&["bending"], LOWER, &["front"]]),
    ("lower_rear_bending", &[&["bending"], LOWER, &["rear"]]),
    ("strut_side_x", &[&["strut"], &["side"], &["x"]]),
    ("strut_side_y", &[&["strut"], &["side"], &["y"]]),
    ("upper_front", &[UPPER, &["front"]]),
    ("upper_rear", &[UPPER, &["rear"]]),
    ("lower_front", &[LOWER, &["front"]]),
    ("lower_rear", &[LOWER, &["rear"]]),
    ("tube_bending_x", &[&["tube"], &["bending"], &["x"]]),
    ("tube_bending_z", &[&["tube"], &["bending"], &["z"]]),
    ("upper_link", &[UPPER, &["link"]]),
    ("lower_link", &[LOWER, &["link"]]),
    ("panhard_rod", &[&["panhard"]]),
    ("tie_rod", &[&["tie"], &["rod"]]),
    ("tie_rod", &[&["toe"], &["link"]]),
];

impl Place {
    /// The order in which they are taken out of a name: a wheel can contain the word of a side.
    pub const ALL: [Self; 4] = [Self::Wheel, Self::Side, Self::Axis, Self::Channel];

    /// The place in the name of a role.
    pub const fn pattern(self) -> &'static str {
        match self {
            Self::Wheel => "{wheel}",
            Self::Side => "{side}",
            Self::Axis => "{axis}",
            Self::Channel => "{channel}",
        }
    }

    /// What a name does not say.
    pub const fn question(self) -> &'static str {
        match self {
            Self::Wheel => "which wheel (FL, FR, RL, RR)",
            Self::Side => "which side (left, right)",
            Self::Axis => "which axis (x, y, z)",
            Self::Channel => "which strain channel (upper_front, ...)",
        }
    }
}

/// Words of a signal and of its message, in lower case and without the plural.
pub struct Name {
    message: Vec<String>,
    signal: Vec<String>,
}

impl Name {
    pub fn new(message: &str, signal: &str) -> Self {
        Self {
            message: words(message),
            signal: words(signal),
        }
    }

    fn has(&self, word: &str) -> bool {
        let mut all = self.message.iter().chain(&self.signal);
        all.any(|found| found == word)
    }

    pub fn has_all(&self, words: &[&str]) -> bool {
        words.iter().all(|word| self.has(word))
    }

    /// Whether a word of the signal is one of these.
    pub fn has_any(&self, words: &[&str]) -> bool {
        self.signal
            .iter()
            .any(|found| words.contains(&found.as_str()))
    }

    /// Finds a value and removes its words. The name of the signal has priority over that of the
    /// message.
    pub fn take(&mut self, place: Place) -> Option<&'static str> {
        let take = |words| match place {
            Place::Wheel => take_wheel(words),
            Place::Side => take_first(words, &SIDES),
            Place::Axis => take_first(words, &AXES),
            Place::Channel => take_first(words, &CHANNELS),
        };
        let found = take(&mut self.signal).or_else(|| take(&mut self.message));
        found.or_else(|| self.take_over_both(place))
    }

    /// A value of which the first words are in the message and the others in the signal.
    fn take_over_both(&self, place: Place) -> Option<&'static str> {
        let mut all = [&self.message[..], &self.signal[..]].concat();
        match place {
            Place::Wheel => take_wheel(&mut all),
            Place::Channel => take_first(&mut all, &CHANNELS),
            Place::Side | Place::Axis => None,
        }
    }
}

fn take_wheel(words: &mut Vec<String>) -> Option<&'static str> {
    if let Some(value) = take_first(words, &WHEELS) {
        return Some(value);
    }
    // The side before the axle, in full words: "r" and "rr" mean both.
    for (value, parts) in WHEELS {
        let turned = [&parts[1][..1], &parts[0][..1]];
        if let Some(at) = find(words, &turned) {
            words.drain(at..at + 2);
            return Some(value);
        }
    }
    for (value, names) in CORNERS {
        if let Some(at) = words.iter().position(|word| names.contains(&word.as_str())) {
            words.remove(at);
            return Some(value);
        }
    }
    None
}

fn take_first(words: &mut Vec<String>, values: &[Value]) -> Option<&'static str> {
    let found = values
        .iter()
        .find_map(|(value, parts)| Some((value, find(words, parts)?, parts.len())));
    let (value, at, count) = found?;
    words.drain(at..at + count);
    Some(value)
}

/// Where the parts are, one after the other.
fn find(words: &[String], parts: &[&[&str]]) -> Option<usize> {
    words.windows(parts.len()).position(|window| {
        let mut both = window.iter().zip(parts);
        both.all(|(word, part)| part.contains(&word.as_str()))
    })
}

/// Splits at characters that are no letters, and where the case or the kind of a character changes:
/// `WheelSpeedFL_2` is `wheel`, `speed`, `fl`, `2`.
fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words = vec![String::new()];
    for (at, letter) in letters.iter().enumerate() {
        let before = at.checked_sub(1).map(|at| letters[at]);
        let after = letters.get(at + 1);
        let begins = before.is_some_and(|before| {
            let rises = before.is_lowercase() && letter.is_uppercase();
            let ends = before.is_uppercase()
                && letter.is_uppercase()
                && after.is_some_and(|after| after.is_lowercase());
            rises || ends || before.is_numeric() != letter.is_numeric()
        });
        if begins || !letter.is_alphanumeric() {
            words.push(String::new());
        }
        if letter.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(letter.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    for word in &mut words {
        if word.len() > 3 && word.ends_with('s') && !word.ends_with("ss") && word != "status" {
            word.pop();
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_split_into_words() {
        for (name, parts) in [
            ("WheelSpeedFL_2", &["wheel", "speed", "fl", "2"][..]),
            ("WHEEL_SPEEDS", &["wheel", "speed"]),
            ("FLWheelSpd", &["fl", "wheel", "spd"]),
            ("Steering.AngleStatus", &["steering", "angle", "status"]),
        ] {
            assert_eq!(words(name), parts, "{name}");
        }
    }

    #[test]
    fn words_of_a_wheel_are_not_those_of_a_channel() {
        let mut name = Name::new("Box", "UpperRear_FrontLeft");
        assert_eq!(name.take(Place::Wheel), Some("FL"));
        assert_eq!(name.take(Place::Channel), Some("upper_rear"));
        let mut name = Name::new("Corner_RL", "lower_front_bending");
        assert_eq!(name.take(Place::Wheel), Some("RL"));
        assert_eq!(name.take(Place::Channel), Some("lower_front_bending"));
        assert_eq!(Name::new("Front", "Left").take(Place::Wheel), Some("FL"));
        assert_eq!(Name::new("Box", "lower_arm").take(Place::Channel), None);
    }
}
