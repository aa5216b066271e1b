//! Mistakes in words.

use model::vehicle::Vehicle;
use sample::Wheel;

use super::evidence::right_angles;
use super::{Hypothesis, Judged};
use crate::fusion::relations::{CHANNELS, channel_of};
use crate::statistics::SIGMAS_95;

/// Whether a gain can be that of a usual mistake.
fn is_near(gain: f64, usual: f64, wide: f64) -> bool {
    (gain - usual).abs() < wide.max(0.1 * usual.abs())
}

/// Subject, cause and remedy.
type Words = (String, String, &'static str);

/// Cause of a channel that does not show the force.
const NOT_MEASURED: &str = "it does not measure the force of its member: the gauges are wired for bending, or do not strain";

/// What was found, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Described {
    /// What is wrong, such as `front left upper_front: sign`.
    pub subject: String,
    /// The likely cause with its numbers and intervals of 95 %.
    pub cause: String,
    /// What to do.
    pub remedy: String,
}

impl Judged {
    /// The factor of a wrong gain, by which the reading has to be divided: exactly that of a usual mistake, or the
    /// estimate if it is known within a part `known`. `None` if the channel does not measure its member, or the
    /// factor is not known.
    pub(crate) fn usual_gain(&self, known: f64) -> Option<f64> {
        let (gain, wide) = (1.0 - self.value[0], SIGMAS_95 * self.sigma[0]);
        // An inverted sign, a quarter bridge for a half bridge, and the other way round.
        let usual = [-1.0, 0.5, 2.0]
            .into_iter()
            .find(|usual| is_near(gain, *usual, wide));
        usual.or_else(|| (self.sigma[0] < known * gain.abs()).then_some(gain))
    }

    /// In words.
    #[must_use]
    pub fn describe(&self, vehicle: &Vehicle, count_n: &[f64; CHANNELS]) -> Described {
        let (subject, cause, remedy) = self
            .of_channels(vehicle, count_n)
            .unwrap_or_else(|| self.of_body());
        Described {
            subject,
            cause,
            remedy: remedy.to_owned(),
        }
    }

    /// A parameter with its interval.
    fn with_interval(&self, i: usize, scale: f64, unit: &str, digits: usize) -> String {
        let [value, half] = [self.value[i], SIGMAS_95 * self.sigma[i]].map(|x| x * scale);
        format!("{value:.digits$} ± {:.digits$} {unit}", half.abs())
    }

    /// Mistakes of the strain channels: subject, cause, remedy.
    fn of_channels(&self, vehicle: &Vehicle, count_n: &[f64; CHANNELS]) -> Option<Words> {
        let name = |at: usize| {
            let (wheel, channel) = channel_of(at);
            let wheel = Wheel::ALL[wheel];
            format!("{wheel} {}", vehicle.channel_name(wheel, channel))
        };
        Some(match self.hypothesis {
            Hypothesis::Zeros => {
                let counts = |i: usize| (self.value[i] / count_n[i]).abs();
                let largest = (0..CHANNELS).map(counts).fold(0.0, f64::max);
                let known = (0..CHANNELS)
                    .filter(|i| SIGMAS_95 * (self.sigma[*i] / count_n[*i]).abs() < 5.0)
                    .count();
                (
                    "zeros of the strain channels".to_owned(),
                    format!(
                        "the bridges were not zeroed: their offsets differ from the calibration by up to \
                         {largest:.0} counts; {known} of {CHANNELS} are known within 5 counts"
                    ),
                    "run `atvrec calibrate zero` with the vehicle on jackstands",
                )
            }
            Hypothesis::Offset(at) => (
                format!("{}: offset", name(at)),
                format!(
                    "its zero is off by {}",
                    self.with_interval(0, 1.0 / count_n[at], "counts", 1)
                ),
                "run `atvrec calibrate zero` with the vehicle on jackstands, and look at the bridge",
            ),
            Hypothesis::Gain(at) => (
                format!("{}: gain", name(at)),
                gain_cause(1.0 - self.value[0], SIGMAS_95 * self.sigma[0]),
                "look at the wiring of the bridge and at the gain resistor, and correct the sensors file or the calibration",
            ),
            Hypothesis::Bent(at) => (
                format!("{}: gauges", name(at)),
                NOT_MEASURED.to_owned(),
                "look at the wiring of the bridge; until then, the channel is not used",
            ),
            Hypothesis::Exchanged(wheel, pair) => {
                let [a, b] = pair.map(|i| name(5 * wheel + i));
                (
                    format!("{a} and {b}"),
                    "the two channels are exchanged".to_owned(),
                    "exchange their plugs, or their places in the configuration",
                )
            }
            Hypothesis::Corners([a, b]) => (
                format!("{} and {}", Wheel::ALL[a], Wheel::ALL[b]),
                "the channels of the two corners are exchanged".to_owned(),
                "exchange the plugs of the two amplifiers, or the wheels in the configuration",
            ),
            _ => return None,
        })
    }

    /// Mistakes of the mass, the inertial unit and the struts: subject, cause, remedy.
    fn of_body(&self) -> Words {
        let of = |i, scale, unit, digits| self.with_interval(i, scale, unit, digits);
        match self.hypothesis {
            Hypothesis::Payload => self.payload_text(),
            Hypothesis::Tilted(axis) => (
                "inertial unit: direction".to_owned(),
                format!(
                    "it is turned against the sensors file by {} about {}",
                    of(0, 1f64.to_degrees(), "degrees", 1),
                    ["x", "y", "z"][axis],
                ),
                "run `atvrec calibrate imu`, or correct imu.misalignment_rad",
            ),
            Hypothesis::Turned(k) => (
                "inertial unit: axes".to_owned(),
                format!("its axes are turned by right angles: {}", axes_of(k)),
                "correct imu.misalignment_rad or the mounting",
            ),
            Hypothesis::Moved => (
                "inertial unit: position".to_owned(),
                format!(
                    "it is {} ahead of, {} left of and {} above the place in the sensors file",
                    of(0, 1.0, "m", 2),
                    of(1, 1.0, "m", 2),
                    of(2, 1.0, "m", 2),
                ),
                "measure imu.position_m again",
            ),
            Hypothesis::Unit(is_large) => (
                "accelerometers: unit".to_owned(),
                if is_large {
                    "the readings are 9.8 times too large: values in m/s² are taken for g"
                } else {
                    "the readings are 9.8 times too small: values in g are taken for m/s²"
                }
                .to_owned(),
                "correct the unit of the role or of the protocol",
            ),
            Hypothesis::Hitched => (
                "hitch".to_owned(),
                format!(
                    "a force acts on the vehicle that is not configured: {} along x and {} along z, and a mass of {} \
                     that is towed",
                    of(0, 1.0, "N", 0),
                    of(2, 1.0, "N", 0),
                    of(3, 1.0, "kg", 0),
                ),
                "record the force on the hitch, or drive without a load on it",
            ),
            Hypothesis::Strut(wheel) => (
                format!("{} strut", Wheel::ALL[wheel]),
                format!(
                    "its force differs from the vehicle file by {}, and its rate by {}",
                    of(0, 1.0, "N", 0),
                    of(1, 100.0, "%", 0),
                ),
                "run `atvrec calibrate weight`, and check the spring in the vehicle file",
            ),
            Hypothesis::Several => self.several_text(),
            // `of_channels` describes them.
            Hypothesis::Zeros
            | Hypothesis::Offset(_)
            | Hypothesis::Gain(_)
            | Hypothesis::Bent(_)
            | Hypothesis::Exchanged(..)
            | Hypothesis::Corners(_) => (String::new(), String::new(), ""),
        }
    }

    fn several_text(&self) -> Words {
        (
            "configuration".to_owned(),
            format!(
                "more than one thing is wrong: the readings contradict the configuration by {:.0} times their errors, \
                 and no mistake explains that alone",
                self.value[0],
            ),
            "check wiring, order, signs and zeros of all strain channels, the mounting of the inertial unit, and what is \
             loaded; then drive again",
        )
    }

    fn payload_text(&self) -> Words {
        let mass_kg = self.value[0];
        let place = |i: usize| {
            let value = self.value[i] / mass_kg;
            let part = math::hypot(self.sigma[i], value * self.sigma[0]) / mass_kg;
            (value, SIGMAS_95 * part.abs())
        };
        let [(x, wide_x), (y, wide_y)] = [1, 2].map(place);
        let along = if x < 0.0 { "behind" } else { "ahead of" };
        let across = if y < 0.0 { "right" } else { "left" };
        let (size, kind) = if mass_kg < 0.0 {
            ("less", "of what is missing")
        } else {
            ("more", "of the load")
        };
        (
            "mass of the vehicle".to_owned(),
            format!(
                "the vehicle has {:.0} ± {:.0} kg {size} than the vehicle file; the centre {kind} is {:.2} ± {wide_x:.2} \
                 m {along} and {:.2} ± {wide_y:.2} m {across} of the centre of gravity",
                mass_kg.abs(),
                SIGMAS_95 * self.sigma[0],
                x.abs(),
                y.abs(),
            ),
            "add a payload to the vehicle file, and select it",
        )
    }
}

/// Cause of a gain with half the width of its interval.
fn gain_cause(gain: f64, wide: f64) -> String {
    let near = |usual: f64| is_near(gain, usual, wide);
    let cause = if near(-1.0) {
        "its sign is inverted: the bridge is wired the other way round"
    } else if gain.abs() < wide.max(0.2) {
        NOT_MEASURED
    } else if near(0.5) {
        "it reads half of the force: a quarter bridge in place of a half bridge"
    } else if near(2.0) {
        "it reads twice the force: a half bridge in place of a quarter bridge"
    } else {
        "its gain is wrong: look at the gain resistor"
    };
    format!("{cause} (factor {gain:.2} ± {wide:.2})")
}

/// Where the axes of an inertial unit that is turned by right angles point.
fn axes_of(rotation: usize) -> String {
    let turned = right_angles(rotation + 1);
    let names = ["forward", "left", "up", "backward", "right", "down"];
    let told = (0..3).map(|axis| {
        // Row of the sensor's axis: its direction in the axes of the body.
        let row = turned.row(axis);
        let k = row.transpose().iamax();
        let name = names[if row[k] > 0.0 { k } else { k + 3 }];
        format!("{} points {name}", ["x", "y", "z"][axis])
    });
    told.collect::<Vec<_>>().join(", ")
}
