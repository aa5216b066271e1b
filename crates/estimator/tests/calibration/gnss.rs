use estimator::calibration::gnss::{GnssFound, GnssInput, Vectors, gnss};
use estimator::calibration::imu::ImuSignal;
use estimator::finding::{Findings, Refusal};
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

/// A drive that turns so much, and that rolls and pitches so much, rad/s.
struct Drive {
    turning: f64,
    leaning: f64,
}

impl Drive {
    fn attitude(&self, t: f64) -> Rotation3<f64> {
        let (w, k) = (self.turning, 1.1);
        let yaw = 0.3 + w / k * (1.0 - (k * t).cos());
        let roll = self.leaning / 2.3 * (2.3 * t).sin();
        let pitch = self.leaning / 3.1 * (3.1 * t).sin();
        Rotation3::from_euler_angles(roll, pitch, yaw)
    }

    /// Velocity of the unit, earth axes.
    fn velocity(&self, t: f64) -> Vector3<f64> {
        let speed = 8.0 + 3.0 * (0.37 * t).sin();
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
    let (mut force, mut rate) = (Vec::new(), Vec::new());
    for t in &imu_s {
        force.push(<[f64; 3]>::from(drive.force(*t)).map(|f| f + noise(0.03)));
        rate.push(<[f64; 3]>::from(drive.rate(*t)).map(|w| w + noise(0.005)));
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

/// How many of this many seeds have place and latency within 1.96 of their deviations, and the
/// greatest errors.
fn coverage(seeds: u64) -> ([u64; 4], [f64; 4]) {
    let (mut inside, mut worst) = ([0; 4], [0.0_f64; 4]);
    for seed in 0..seeds {
        let found = found(&LEVEL, seed, 60.0).expect("found");
        let parts = [
            ("test antenna x", ANTENNA_M[0]),
            ("test antenna y", ANTENNA_M[1]),
            ("test velocity latency", LATENCY_S[0]),
            ("test attitude latency", LATENCY_S[1]),
        ];
        for (k, (name, truth)) in parts.into_iter().enumerate() {
            let [value, sigma] = found.findings.value(name);
            inside[k] += u64::from((value - truth).abs() < 1.96 * sigma);
            worst[k] = worst[k].max((value - truth).abs());
        }
        assert_eq!(
            found.velocity.antenna_m.map(|m| m[2]),
            Some(1.0),
            "height is not told"
        );
    }
    (inside, worst)
}

#[test]
fn place_and_latency_come_out_of_a_drive_with_turns() {
    let (_, worst) = coverage(3);
    assert!(worst[0] < 0.06 && worst[1] < 0.03, "{worst:?}");
    assert!(worst[2] < 0.006 && worst[3] < 0.006, "{worst:?}");
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_cover_place_and_latency_as_often_as_they_say() {
    let (inside, worst) = coverage(200);
    println!("{inside:?} of 200, at worst {worst:?}");
    assert!(
        inside.iter().all(|count| (180..=196).contains(count)),
        "{inside:?}"
    );
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

/// Little roll and pitch: the gyros' noise is a good part of what moves the antenna.
#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_cover_the_height_and_noise_does_not_shorten_it() {
    let gentle = Drive {
        turning: 0.7,
        leaning: 0.035,
    };
    let all: Vec<Findings> = (0..200)
        .map(|seed| found(&gentle, seed, 120.0).expect("found").findings)
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
