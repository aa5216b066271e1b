use atvrec_estimator::calibration::gnss::{GnssFound, GnssInput, Vectors, gnss};
use atvrec_estimator::calibration::imu::ImuSignal;
use atvrec_estimator::finding::{Findings, Refusal};
use nalgebra::{Rotation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::STANDARD_GRAVITY_M_S2;

use crate::coverage::covers;

const ANTENNA_M: [f64; 3] = [-0.6, 0.1, 1.1];
const IMU_M: [f64; 3] = [-0.45, 0.0, 0.15];
const LATENCY_S: [f64; 2] = [0.018, -0.007];
const AVERAGING_S: f64 = 0.05;
/// What `imu` leaves of the unit's misalignment, deviation about each axis, rad.
const MISALIGNMENT_RAD: f64 = 1e-3;

/// A drive that turns so much, and that rolls and pitches so much, rad/s.
struct Drive {
    turning: f64,
    leaning: f64,
}

impl Drive {
    fn attitude(&self, t: f64) -> Rotation3<f64> {
        let (w, k) = (self.turning, 1.1);
        let yaw = 0.3 + w / k * (1.0 - math::cos(k * t));
        let roll = self.leaning / 2.3 * math::sin(2.3 * t);
        let pitch = self.leaning / 3.1 * math::sin(3.1 * t);
        Rotation3::from_euler_angles(roll, pitch, yaw)
    }

    /// Velocity of the unit, earth axes.
    fn velocity(&self, t: f64) -> Vector3<f64> {
        let speed = 8.0 + 3.0 * math::sin(0.37 * t);
        self.attitude(t) * Vector3::new(speed, 0.0, 0.0)
    }

    fn rate(&self, t: f64) -> Vector3<f64> {
        const STEP_S: f64 = 1e-4;
        let [before, after] = [-STEP_S, STEP_S].map(|step| self.attitude(t + step));
        (before.inverse() * after).scaled_axis() / (2.0 * STEP_S)
    }

    fn force(&self, t: f64) -> Vector3<f64> {
        const STEP_S: f64 = 1e-4;
        let change = self.velocity(t + STEP_S) - self.velocity(t - STEP_S);
        let up = Vector3::z() * STANDARD_GRAVITY_M_S2;
        self.attitude(t).inverse() * (change / (2.0 * STEP_S) + up)
    }

    /// Velocity of a point `r` from the unit, earth axes, as a receiver averages it.
    fn averaged(&self, t: f64, r: Vector3<f64>) -> Vector3<f64> {
        let parts = (0..10).map(|k| {
            let t = t + ((f64::from(k) + 0.5) / 10.0 - 0.5) * AVERAGING_S;
            self.velocity(t) + self.attitude(t) * self.rate(t).cross(&r)
        });
        parts.sum::<Vector3<f64>>() / 10.0
    }
}

fn found(drive: &Drive, seed: u64, duration_s: f64) -> Result<GnssFound, Refusal> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| -> f64 {
        let unit: f64 = StandardNormal.sample(&mut random);
        sigma * unit
    };
    let grid = |step_s: f64| -> Vec<f64> {
        (0..(duration_s / step_s) as usize)
            .map(|k| k as f64 * step_s)
            .collect()
    };
    let (imu_s, velocity_s, attitude_s) = (grid(0.01), grid(0.05), grid(0.1));
    let turn = Rotation3::new(Vector3::from_fn(|_, _| noise(MISALIGNMENT_RAD)));
    let (mut force, mut rate) = (Vec::new(), Vec::new());
    for t in &imu_s {
        force.push(<[f64; 3]>::from(turn * drive.force(*t)).map(|f| f + noise(0.03)));
        rate.push(<[f64; 3]>::from(turn * drive.rate(*t)).map(|w| w + noise(0.005)));
    }
    let lever = Vector3::from(ANTENNA_M) - Vector3::from(IMU_M);
    let velocity: Vec<[f64; 3]> = velocity_s
        .iter()
        .map(|t| {
            let velocity = drive.averaged(t - LATENCY_S[0], lever);
            <[f64; 3]>::from(velocity).map(|v| v + noise(0.03))
        })
        .collect();
    let attitude: Vec<[f64; 3]> = attitude_s
        .iter()
        .map(|t| {
            let (roll, pitch, yaw) = drive.attitude(t - LATENCY_S[1]).euler_angles();
            [
                yaw + 0.01 + noise(0.005),
                pitch + noise(0.009),
                roll + noise(0.009),
            ]
        })
        .collect();
    gnss(&GnssInput {
        receiver: "test",
        imu: ImuSignal {
            time_s: &imu_s,
            force_m_s2: &force,
            rate_rad_s: &rate,
        },
        velocity: Vectors {
            time_s: &velocity_s,
            value: &velocity,
        },
        attitude: Vectors {
            time_s: &attitude_s,
            value: &attitude,
        },
        sigma: [0.03, 0.005, 0.009, 0.009],
        averaging_s: AVERAGING_S,
        imu_sigma: [0.03, 0.005],
        imu_m: IMU_M,
        antenna_m: [-0.5, 0.0, 1.0],
    })
}

const LEVEL: Drive = Drive {
    turning: 0.7,
    leaning: 0.0,
};

const FLAT_TRUTHS: [(&str, f64); 4] = [
    ("test antenna x", ANTENNA_M[0]),
    ("test antenna y", ANTENNA_M[1]),
    ("test velocity latency", LATENCY_S[0]),
    ("test attitude latency", LATENCY_S[1]),
];

/// A minute without roll and pitch; the height, which it does not tell, is kept.
fn flat(seed: u64) -> Findings {
    let found = found(&LEVEL, seed, 60.0).expect("found");
    let height_m = found.velocity.antenna_m.map(|m| m[2]);
    assert_eq!(height_m, Some(1.0), "height is not told");
    found.findings
}

#[test]
fn place_and_latency_come_out_of_a_drive_with_turns() {
    for seed in 0..3 {
        let found = flat(seed);
        for ((name, truth), most) in FLAT_TRUTHS.into_iter().zip([0.06, 0.03, 0.006, 0.006]) {
            let [value, sigma] = found.value(name);
            assert!((value - truth).abs() < most, "{name} {value} +- {sigma}");
        }
    }
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_cover_place_and_latency_as_often_as_they_say() {
    covers(0..200, &FLAT_TRUTHS, flat);
}

/// Rates of roll and pitch of 0.05 rad/s (rms) for two minutes.
fn height(seed: u64) -> Findings {
    let rolling = Drive {
        turning: 0.7,
        leaning: 0.07,
    };
    found(&rolling, seed, 120.0).expect("found").findings
}

#[test]
fn roll_and_pitch_tell_the_place_to_three_centimetres_and_latencies_to_two_milliseconds() {
    for seed in 0..3 {
        let found = height(seed);
        let within = |name: &str, truth: f64, most: f64| {
            let [value, sigma] = found.value(name);
            println!("{name} {:.5} +- {sigma:.5}", value - truth);
            assert!((value - truth).abs() < most, "{name} {value} +- {sigma}");
        };
        for (axis, truth) in ["x", "y", "z"].into_iter().zip(ANTENNA_M) {
            within(&format!("test antenna {axis}"), truth, 0.03);
        }
        for (what, truth) in ["velocity", "attitude"].into_iter().zip(LATENCY_S) {
            within(&format!("test {what} latency"), truth, 0.002);
        }
    }
}

/// Little roll and pitch: the gyros' noise is a good part of what moves the antenna, in a minute as in
/// more.
#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_cover_the_height_and_noise_does_not_shorten_it() {
    let gentle = Drive {
        turning: 0.7,
        leaning: 0.035,
    };
    let all: Vec<Findings> = (0..200)
        .map(|seed| found(&gentle, seed, 60.0).expect("found").findings)
        .collect();
    let errors = all
        .iter()
        .map(|one| one.value("test antenna z")[0] - ANTENNA_M[2]);
    let mean_m = errors.sum::<f64>() / 200.0;
    println!("height off by {mean_m} m on average");
    assert!(mean_m.abs() < 0.004, "{mean_m}");
    covers(0..200, &[("test antenna z", ANTENNA_M[2])], |seed| {
        all[seed as usize].clone()
    });
}

#[test]
fn a_drive_without_turns_or_too_short_is_refused() {
    let refusal = found(
        &Drive {
            turning: 0.0,
            leaning: 0.0,
        },
        1,
        60.0,
    )
    .unwrap_err()
    .to_string();
    assert!(refusal.contains("quick turns"), "{refusal}");
    let refusal = found(&LEVEL, 1, 10.0).unwrap_err().to_string();
    assert!(refusal.contains("s of usable data"), "{refusal}");
}
