use estimator::calibration::gnss::{GnssFound, GnssInput, Vectors, gnss};
use estimator::calibration::imu::ImuSignal;
use estimator::finding::Refusal;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::STANDARD_GRAVITY_M_S2;

const ANTENNA_M: [f64; 3] = [-0.6, 0.1, 1.1];
const IMU_M: [f64; 3] = [-0.45, 0.0, 0.15];
const LATENCY_S: [f64; 2] = [0.018, -0.007];

/// A level drive: yaw, yaw rate, speed and acceleration at a time.
struct Drive {
    turning: f64,
}

impl Drive {
    fn at(&self, t: f64) -> [f64; 4] {
        let (w, k) = (self.turning, 1.1);
        let yaw = 0.3 + w / k * (1.0 - (k * t).cos());
        let speed = 8.0 + 3.0 * (0.37 * t).sin();
        [yaw, w * (k * t).sin(), speed, 3.0 * 0.37 * (0.37 * t).cos()]
    }

    /// Velocity of a point `r` from the unit, earth axes.
    fn velocity(&self, t: f64, r: [f64; 3]) -> [f64; 3] {
        let [yaw, rate, speed, _] = self.at(t);
        let (sine, cosine) = yaw.sin_cos();
        let body = [speed - rate * r[1], rate * r[0]];
        [
            cosine * body[0] - sine * body[1],
            sine * body[0] + cosine * body[1],
            0.0,
        ]
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
        let [_, r, v, a] = drive.at(*t);
        force.push([a, v * r, STANDARD_GRAVITY_M_S2].map(|f| f + noise(0.03)));
        rate.push([0.0, 0.0, r].map(|w| w + noise(0.005)));
    }
    let lever: [f64; 3] = std::array::from_fn(|i| ANTENNA_M[i] - IMU_M[i]);
    let velocity: Vec<[f64; 3]> = velocity_s
        .iter()
        .map(|t| {
            drive
                .velocity(t - LATENCY_S[0], lever)
                .map(|v| v + noise(0.03))
        })
        .collect();
    let attitude: Vec<[f64; 3]> = attitude_s
        .iter()
        .map(|t| {
            let yaw = drive.at(t - LATENCY_S[1])[0] + 0.01;
            [yaw + noise(0.005), noise(0.009), noise(0.009)]
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
        imu_sigma: [0.03, 0.005],
        imu_m: IMU_M,
        antenna_m: [-0.5, 0.0, 1.0],
    })
}

/// How many of this many seeds have place and latency within 1.96 of their deviations, and the
/// greatest errors.
fn coverage(seeds: u64) -> ([u64; 4], [f64; 4]) {
    let (mut inside, mut worst) = ([0; 4], [0.0_f64; 4]);
    for seed in 0..seeds {
        let found = found(&Drive { turning: 0.7 }, seed, 60.0).expect("found");
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
#[ignore = "a campaign of minutes: `make campaigns`"]
fn intervals_cover_place_and_latency_as_often_as_they_say() {
    let (inside, worst) = coverage(200);
    println!("{inside:?} of 200, at worst {worst:?}");
    assert!(
        inside.iter().all(|count| (180..=196).contains(count)),
        "{inside:?}"
    );
}

#[test]
fn a_drive_without_turns_or_too_short_is_refused() {
    let refusal = found(&Drive { turning: 0.0 }, 1, 60.0)
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("quick turns"), "{refusal}");
    let refusal = found(&Drive { turning: 0.7 }, 1, 10.0)
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("s of usable data"), "{refusal}");
}
