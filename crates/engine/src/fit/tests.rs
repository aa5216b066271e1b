use model::sensors::Sensors;
use sample::{CornerSample, Measurement, Sample, Wheel};
use store::Record;

use super::{Fit, Judgement};
use crate::simulate::drives::of_prowler;
use crate::virtual_drive::Drive;
use crate::{Config, Entry, Error, FileSource, VirtualDrive, simulate};

/// A drive with turns, braking and speeding up, s.
const MINUTE_S: f64 = 60.0;

struct Recorded {
    config: Config,
    samples: Vec<Sample>,
}

impl Recorded {
    fn new(manoeuvre: &str, sensors: &str, seed: u64) -> Self {
        Self::of(&Drive {
            seed,
            duration_s: Some(MINUTE_S),
            ..of_prowler(manoeuvre, sensors)
        })
    }

    fn of(drive: &Drive) -> Self {
        let mut simulated = VirtualDrive::new(drive).expect("a drive");
        let config = simulated.config().expect("a configuration");
        // Decoding needs no estimate.
        let decoding = Config {
            estimator: config.estimator.clone().map(|mut settings| {
                settings.settings.method = estimator::Method::Thesis;
                settings
            }),
            ..config.clone()
        };
        let mut samples = Vec::new();
        simulate(&mut simulated, &decoding, |entry| {
            if let Entry::Record(Record::Sample(sample)) = entry {
                samples.push(*Box::new(sample));
            }
            Ok::<_, Error>(())
        })
        .expect("a simulation");
        Self { config, samples }
    }

    /// The comparison after `mistake` has changed each sample.
    fn with(&self, mistake: impl Fn(&mut Sample)) -> Judgement {
        let mut fit = Fit::new(&self.config).expect("a vehicle");
        for sample in &self.samples {
            let mut sample = sample.clone();
            mistake(&mut sample);
            fit.push(&Record::Sample(sample));
        }
        fit.judge()
    }
}

fn text(judgement: &Judgement) -> String {
    let misfits = judgement
        .misfits
        .iter()
        .map(|misfit| format!("MISFIT {misfit}\n"));
    let undecided = judgement
        .undecided
        .iter()
        .map(|u| format!("UNDECIDED {}: {}\n", u.subject, u.manoeuvre));
    let fits = judgement.fits.iter().map(|fit| format!("FITS {fit}\n"));
    misfits.chain(undecided).chain(fits).collect()
}

fn exchanged(wheel: Wheel, a: Wheel, b: Wheel) -> Wheel {
    match wheel {
        wheel if wheel == a => b,
        wheel if wheel == b => a,
        other => other,
    }
}

fn corner(sample: &mut Sample) -> Option<&mut CornerSample> {
    match &mut sample.measurement {
        Measurement::Corner(corner) => Some(corner),
        _ => None,
    }
}

/// No built-in sensor set on a correct drive has a misfit, with several seeds, and a drive with braking and
/// turns decides everything.
#[test]
fn correct_drives_have_no_misfit() {
    for (k, sensors) in Sensors::builtin_names().enumerate() {
        for seed in [11 + k as u64, 31 + k as u64] {
            let judgement = Recorded::new("mixed-driving", sensors, seed).with(|_| {});
            assert!(
                judgement.misfits.is_empty(),
                "{sensors} {seed}:\n{}",
                text(&judgement)
            );
        }
    }
}

/// MacPherson struts, with hard-points of both axles, and of the front axle alone in the configuration.
#[test]
fn struts_are_compared_wherever_the_linkage_is_known() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../testdata/vehicle-with-struts.toml"
    );
    let mut recorded = Recorded::of(&Drive {
        vehicle: FileSource::Path(file.into()),
        duration_s: Some(MINUTE_S),
        ..of_prowler("mixed-driving", "thesis-10bit")
    });
    for has_rear_points in [true, false] {
        if let Some(settings) = &mut recorded.config.estimator
            && !has_rear_points
        {
            let rear = &mut settings.vehicle.rear;
            rear.macpherson = None;
            rear.strut.as_mut().expect("a strut").motion_ratio = Some(0.97);
        }
        let judgement = recorded.with(|_| {});
        let told = text(&judgement);
        assert!(judgement.misfits.is_empty(), "{told}");
        for subject in ["spring deflection", "strain"] {
            let line = format!("FITS {subject}: order and signs of the wheels");
            assert!(told.contains(&line), "{line} is absent from\n{told}");
        }
        let reversed = recorded.with(|sample| {
            if let Some(corner) = corner(sample).filter(|c| c.wheel == Wheel::FrontLeft) {
                corner.strain_counts[2] = corner.strain_counts[2].map(|c| mirrored(c.number()));
            }
        });
        let told = text(&reversed);
        assert!(told.contains("MISFIT strain FL lower_front"), "{told}");
    }
}

/// Ground, slope and driving style are no mistakes of the configuration.
#[test]
fn correct_drives_on_other_ground_have_no_misfit() {
    let drives = [
        "circle",
        "steer-sweep",
        "launch-brake",
        "hillside",
        "trail",
        "reverse",
    ];
    for manoeuvre in drives {
        let judgement = Recorded::new(manoeuvre, "thesis-10bit", 12).with(|_| {});
        assert!(
            judgement.misfits.is_empty(),
            "{manoeuvre}:\n{}",
            text(&judgement)
        );
    }
}

/// A recording without motion decides nothing, and the manoeuvres that decide are named.
#[test]
fn a_quiet_recording_names_the_manoeuvres_that_decide() {
    let judgement = Recorded::new("washboard", "thesis-10bit", 12).with(|sample| {
        if let Measurement::GnssVelocity(velocity) = &mut sample.measurement {
            velocity.velocity_enu_m_s = [0.0; 3];
        }
    });
    let text = text(&judgement);
    for line in [
        "UNDECIDED inertial unit, yaw rate: drive turns to both sides",
        "UNDECIDED inertial unit, forward and left axis: speed up and brake",
        "UNDECIDED wheel speeds against GNSS speed: drive faster",
        "UNDECIDED spring deflection: brake firmly",
        "UNDECIDED strain: drive turns to both sides",
    ] {
        assert!(text.contains(line), "{line} is absent from\n{text}");
    }
}

/// A mistake: name, change of each sample, beginning of the subject and part of the text of the misfits.
type Mistake = (&'static str, fn(&mut Sample), &'static str, &'static str);

const MISTAKES: [Mistake; 20] = [
    (
        "unit on its side",
        |s| turn_unit(s, |[x, y, z]| [x, z, -y]),
        "inertial unit, direction of gravity",
        "90 degrees from the z axis, towards +y",
    ),
    (
        "unit upside down",
        |s| turn_unit(s, |[x, y, z]| [x, -y, -z]),
        "inertial unit",
        "179 degrees from the z axis, towards -z",
    ),
    (
        "unit tilted by 12 degrees",
        |s| {
            turn_unit(s, |[x, y, z]| {
                [x, 0.978 * y + 0.208 * z, 0.978 * z - 0.208 * y]
            })
        },
        "inertial unit, direction of gravity",
        "11 degrees from the z axis, towards +y",
    ),
    (
        "unit turned by half a turn",
        |s| turn_unit(s, |[x, y, z]| [-x, -y, z]),
        "inertial unit, forward",
        "turned by",
    ),
    (
        "unit turned by a quarter",
        |s| turn_unit(s, |[x, y, z]| [y, -x, z]),
        "inertial unit, forward",
        "turned by 9",
    ),
    // Both axes still follow the motion, each with a part of the other.
    (
        "unit turned by 30 degrees",
        |s| turn_unit(s, |[x, y, z]| [0.866 * x + 0.5 * y, 0.866 * y - 0.5 * x, z]),
        "inertial unit, forward",
        "turned by",
    ),
    (
        "specific force in g",
        |s| {
            unit(s, |imu| {
                imu.specific_force_m_s2 = imu.specific_force_m_s2.map(|f| f / 9.80665)
            })
        },
        "inertial unit",
        "g is taken for m/s^2",
    ),
    (
        "rates in degrees",
        |s| {
            unit(s, |imu| {
                imu.angular_rate_rad_s = imu.angular_rate_rad_s.map(f64::to_degrees)
            })
        },
        "inertial unit, yaw rate",
        "degrees are taken for radians",
    ),
    (
        "yaw rate reversed",
        |s| unit(s, |imu| imu.angular_rate_rad_s[2] *= -1.0),
        "inertial unit, yaw rate",
        "sign is reversed",
    ),
    (
        "roll rate reversed",
        |s| unit(s, |imu| imu.angular_rate_rad_s[0] *= -1.0),
        "inertial unit, roll rate",
        "a roll that lifts the left side is positive",
    ),
    (
        "steering reversed",
        |s| {
            if let Measurement::Steer(steer) = &mut s.measurement {
                steer.steering_wheel_rad *= -1.0
            }
        },
        "steering-wheel angle",
        "sign is reversed",
    ),
    (
        "steering in degrees",
        |s| {
            if let Measurement::Steer(steer) = &mut s.measurement {
                steer.steering_wheel_rad = steer.steering_wheel_rad.to_degrees()
            }
        },
        "steering-wheel angle",
        "degrees are taken for radians",
    ),
    (
        "wheel speeds in km/h",
        |s| {
            speeds(s, |speeds| {
                speeds.map(|speed| speed.map(|speed| 3.6 * speed))
            })
        },
        "wheel speed ",
        "km/h is taken for m/s",
    ),
    (
        "front wheel speeds exchanged",
        |s| speeds(s, |[a, b, c, d]| [b, a, c, d]),
        "wheel speeds, order",
        "FL and FR are exchanged",
    ),
    (
        "deflection FL and FR exchanged",
        |s| {
            deflection(s, |wheel| {
                exchanged(wheel, Wheel::FrontLeft, Wheel::FrontRight)
            })
        },
        "spring deflection, order",
        "FL, FR are exchanged",
    ),
    (
        "deflection FL and RL exchanged",
        |s| {
            deflection(s, |wheel| {
                exchanged(wheel, Wheel::FrontLeft, Wheel::RearLeft)
            })
        },
        "spring deflection, order",
        "FL, RL are exchanged",
    ),
    (
        "deflection RL reversed",
        |s| {
            if let Some(corner) = corner(s).filter(|c| c.wheel == Wheel::RearLeft) {
                corner.deflection_counts = corner.deflection_counts.map(|c| mirrored(c.number()))
            }
        },
        "spring deflection, order",
        "sign of RL is reversed",
    ),
    (
        "deflection RR with a wrong zero",
        |s| {
            if let Some(corner) = corner(s).filter(|c| c.wheel == Wheel::RearRight) {
                corner.deflection_counts = corner
                    .deflection_counts
                    .map(|c| sample::Counts::Converter((c.number() + 350.0) as i32));
            }
        },
        "spring deflection RR, load at rest",
        "run `atvrec calibrate zero`",
    ),
    (
        "strain FL and FR exchanged",
        |s| {
            strain(s, |wheel| {
                exchanged(wheel, Wheel::FrontLeft, Wheel::FrontRight)
            })
        },
        "strain, order",
        "FL, FR are exchanged",
    ),
    (
        "strain channel reversed",
        |s| {
            if let Some(corner) = corner(s).filter(|c| c.wheel == Wheel::FrontLeft) {
                corner.strain_counts[2] = corner.strain_counts[2].map(|c| mirrored(c.number()))
            }
        },
        "strain FL lower_front",
        "opposite sign",
    ),
];

fn mirrored(counts: f64) -> sample::Counts {
    sample::Counts::Converter((1024.0 - counts) as i32)
}

fn unit(sample: &mut Sample, change: impl Fn(&mut sample::ImuSample)) {
    if let Measurement::Imu(imu) = &mut sample.measurement {
        change(imu);
    }
}

fn turn_unit(sample: &mut Sample, turn: impl Fn([f64; 3]) -> [f64; 3]) {
    unit(sample, |imu| {
        imu.specific_force_m_s2 = turn(imu.specific_force_m_s2);
        imu.angular_rate_rad_s = turn(imu.angular_rate_rad_s);
    });
}

fn speeds(sample: &mut Sample, change: impl Fn([Option<f64>; 4]) -> [Option<f64>; 4]) {
    if let Measurement::WheelSpeed(speeds) = &mut sample.measurement {
        speeds.angular_speed_rad_s.0 = change(speeds.angular_speed_rad_s.0);
    }
}

/// Gives the counts of the potentiometers to other wheels. A message has either these or those of strain, or both.
fn deflection(sample: &mut Sample, other: impl Fn(Wheel) -> Wheel) {
    if let Some(corner) = corner(sample) {
        corner.wheel = other(corner.wheel);
        corner.strain_counts = [None; 7];
    }
}

fn strain(sample: &mut Sample, other: impl Fn(Wheel) -> Wheel) {
    if let Some(corner) = corner(sample) {
        corner.wheel = other(corner.wheel);
        corner.deflection_counts = None;
    }
}

/// A drive with braking on a straight decides the sign of the pitch rate, and one without says so.
#[test]
fn a_reversed_pitch_rate_is_named_after_braking() {
    let recorded = Recorded::new("launch-brake", "thesis-10bit", 12);
    let told = text(&recorded.with(|_| {}));
    assert!(told.contains("FITS inertial unit, pitch rate: "), "{told}");
    assert!(!told.contains("MISFIT"), "{told}");
    let reversed = |s: &mut Sample| unit(s, |imu| imu.angular_rate_rad_s[1] *= -1.0);
    let told = text(&recorded.with(reversed));
    let misfit =
        "MISFIT inertial unit, pitch rate: its integral against the direction of gravity: ";
    assert!(told.contains(misfit), "{told}");
    assert!(
        told.contains("a pitch that lowers the front is positive"),
        "{told}"
    );
    assert_eq!(told.matches("MISFIT").count(), 1, "{told}");
    assert!(
        told.contains("UNDECIDED inertial unit, roll rate: drive firm turns"),
        "{told}"
    );
}

/// Counts beyond the bits of the sensors file are named with their channels.
#[test]
fn counts_beyond_the_stated_bits_are_named() {
    let mut recorded = Recorded::new("mixed-driving", "full-bridge-16bit", 12);
    let settings = recorded.config.estimator.as_mut().expect("a vehicle");
    settings.sensors.strain.adc_bits = 12;
    let told = text(&recorded.with(|_| {}));
    for part in [
        "MISFIT strain FL upper_front, FL upper_rear,",
        "strain.adc_bits = 12 of the sensors file allows 0 to 4095",
        "next step: set strain.adc_bits to the bits of the device's converter, at least 16",
    ] {
        assert!(told.contains(part), "{part} is absent from\n{told}");
    }
    assert!(!told.contains("MISFIT deflection"), "{told}");
}

/// Each mistake is named by its subject and its cause, and nothing else is.
#[test]
fn mistakes_are_named_with_their_cause() {
    let recorded = Recorded::new("mixed-driving", "thesis-10bit", 12);
    let mut failed = String::new();
    for (name, mistake, subject, cause) in MISTAKES {
        let judgement = recorded.with(mistake);
        let own = judgement
            .misfits
            .iter()
            .all(|misfit| misfit.subject.starts_with(subject));
        let named = judgement
            .misfits
            .iter()
            .any(|misfit| misfit.to_string().contains(cause));
        if !own || !named {
            failed += &format!("{name}: own {own}, named {named}\n{}\n", text(&judgement));
        }
    }
    assert!(failed.is_empty(), "{failed}");
}
