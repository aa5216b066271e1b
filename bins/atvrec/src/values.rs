//! Values of a running recorder as text: for `status`, `top` and the line of `record`. All read the
//! JSON of the control socket.

use std::borrow::Cow;
use std::fmt::Write as _;

use sample::text::printable;
use sample::{NextLift, Rollover, Wheel};
use serde_json::Value;

/// Age from which an estimate is shown as stale, s.
const STALE_S: f64 = 0.5;

/// A text of the status in one line.
pub fn text(value: &Value) -> Cow<'_, str> {
    printable(value.as_str().unwrap_or_default())
}

/// The sources, without the recorder itself.
pub fn sources(status: &Value) -> impl Iterator<Item = &Value> {
    let all = status["sources"].as_array().into_iter().flatten();
    all.filter(|source| source["name"] != "recorder")
}

/// Duration in the largest fitting unit.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{:.0} ms", s * 1000.0),
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Seconds since the instant of a log time in the status.
pub fn age_s(status: &Value, time: &Value) -> Option<f64> {
    let now = status["now_ns"].as_u64()?;
    Some((now as f64 - time.as_u64()? as f64) / 1e9)
}

/// The estimate, if it is recent.
pub fn recent(status: &Value) -> Option<&Value> {
    let estimate = &status["estimate"];
    let age = age_s(status, &estimate["time"])?;
    (age < STALE_S).then_some(estimate)
}

/// A number; `–` where it is unknown.
pub fn number(value: &Value, decimals: usize) -> String {
    value
        .as_f64()
        .map_or_else(|| "–".to_owned(), |value| fixed(value, decimals))
}

/// A number with these decimals; a zero has no sign.
fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| matches!(c, '0' | '.')) => zero.to_owned(),
        _ => text,
    }
}

/// An angle in degrees.
pub fn degrees(value: &Value) -> String {
    value
        .as_f64()
        .map_or_else(|| "–".to_owned(), |value| fixed(value.to_degrees(), 1))
}

/// Whether a wheel carries no load.
pub fn is_off_ground(estimate: &Value, wheel: Wheel) -> bool {
    let time = &estimate["rollover"]["time_to_lift_s"][wheel.index()];
    time.as_f64().is_some_and(|time_s| time_s <= 0.0)
}

/// Time until a wheel lifts, s, if it is near, or that the wheel is off the ground.
pub fn lift(estimate: &Value, wheel: Wheel) -> String {
    let time = &estimate["rollover"]["time_to_lift_s"][wheel.index()];
    match time.as_f64() {
        _ if is_off_ground(estimate, wheel) => "in air".to_owned(),
        Some(time_s) if time_s > Rollover::NEAR_S => "–".to_owned(),
        _ => number(time, 1),
    }
}

/// The wheel that lifts next, if its lift is near.
pub fn next_lift(status: &Value) -> Option<NextLift> {
    serde_json::from_value(status["next_lift"].clone()).ok()
}

/// Size in bytes as text.
pub fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e6 => format!("{:.1} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.2} GB", b / 1e9),
    }
}

/// The state in one line.
pub fn line(status: &Value) -> String {
    let mut line = text(&status["writing"]).into_owned();
    if let Some(since_s) = status["since_s"].as_f64() {
        let _ = write!(line, " {}", duration(since_s));
    }
    let disk = &status["disk"];
    let _ = write!(line, " | {}", size(disk["bytes"].as_f64().unwrap_or(0.0)));
    if let Some(lasts_s) = disk["lasts_s"].as_f64() {
        let _ = write!(line, ", disk {}", duration(lasts_s));
    }
    let silent: Vec<_> = sources(status)
        .filter(|source| source["age_s"].as_f64().is_none_or(|age| age > 1.0))
        .map(|source| text(&source["name"]))
        .collect();
    if !silent.is_empty() {
        let _ = write!(line, " | silent: {}", silent.join(", "));
    }
    match recent(status) {
        Some(estimate) => {
            let load = |wheel: usize| number(&estimate["carrier"][wheel]["force_n"][2], 0);
            let motion = &estimate["motion"];
            let _ = write!(
                line,
                " | F_z {} {} {} {} N, LTR {}, {} m/s",
                load(0),
                load(1),
                load(2),
                load(3),
                number(&estimate["rollover"]["load_transfer_ratio"], 2),
                number(&motion["velocity_x_m_s"], 1),
            );
        }
        None => line.push_str(" | no estimate"),
    }
    let lost = status["lost"].as_object().into_iter().flatten();
    let lost: u64 = lost.filter_map(|(_, count)| count.as_u64()).sum();
    if lost > 0 {
        let _ = write!(line, " | {lost} lost");
    }
    line
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn status() -> Value {
        json!({
            "now_ns": 10_000_000_000_u64,
            "writing": "recording",
            "since_s": 75.0,
            "sources": [
                {"name": "imu", "age_s": 0.01},
                {"name": "can0", "age_s": 3.0},
                {"name": "recorder", "age_s": null},
            ],
            "lost": {"device": 0},
            "disk": {"bytes": 2_500_000, "lasts_s": 36_000.0},
            "estimate": {
                "time": 9_990_000_000_u64,
                "motion": {"velocity_x_m_s": 8.04},
                "carrier": [
                    {"force_n": [0.0, 0.0, 1000.4]}, {"force_n": [0.0, 0.0, 1100.0]},
                    {"force_n": [0.0, 0.0, 900.0]}, {"force_n": [null, null, null]},
                ],
                "rollover": {"load_transfer_ratio": 0.05},
            },
        })
    }

    #[test]
    fn a_zero_has_no_sign() {
        let texts = [-0.04, -0.06, 0.0, 12.0].map(|value| number(&json!(value), 1));
        assert_eq!(texts, ["0.0", "-0.1", "0.0", "12.0"]);
        assert_eq!(number(&json!(-0.4), 0), "0");
        assert_eq!(degrees(&json!(-0.0005)), "0.0");
    }

    #[test]
    fn the_line_has_state_size_silence_and_forces() {
        let mut status = status();
        assert_eq!(
            line(&status),
            "recording 75.0 s | 2.5 MB, disk 10.0 h | silent: can0 | F_z 1000 1100 900 – N, LTR \
             0.05, 8.0 m/s"
        );
        status["now_ns"] = json!(12_000_000_000_u64);
        assert!(line(&status).ends_with("| no estimate"));
    }

    #[test]
    fn a_wheel_off_the_ground_has_no_time() {
        let estimate = json!({"rollover": {"time_to_lift_s": [0.0, 0.04, null, 93.5]}});
        let texts = Wheel::ALL.map(|wheel| lift(&estimate, wheel));
        assert_eq!(
            texts,
            ["in air", "0.0", "–", "–"],
            "a lift far ahead is no news"
        );
    }

    #[test]
    fn the_next_wheel_to_lift_is_read() {
        let next = NextLift {
            wheel: Wheel::RearLeft,
            time_s: 0.5,
        };
        assert_eq!(next_lift(&json!({ "next_lift": next })), Some(next));
        assert_eq!(next_lift(&json!({ "next_lift": null })), None);
    }
}
