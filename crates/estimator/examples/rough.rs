//! Experiment.
#![allow(
    clippy::all,
    clippy::pedantic,
    clippy::disallowed_methods,
    missing_docs
)]
use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::strain::Lag;
use model::suspension::Corner;
use nalgebra::{Rotation3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::{Estimate, HubAccelerationSample, LogTime, Measurement, Sample, SourceId, Wheel};
use std::path::Path;
use testkit::sensing;
use testkit::truth::{self, Run};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let mut runs = vec![];
    let mut sets = vec![];
    let mut seeds = vec![11u64];
    let mut tuning = String::new();
    let mut events = false;
    for a in &args {
        if let Some((k, v)) = a.split_once('=') {
            if k == "seeds" {
                seeds = v.split(',').map(|s| s.parse().unwrap()).collect();
            } else if k == "events" {
                events = true;
            } else {
                tuning += &format!("{k} = {v}\n");
            }
        } else if "ABab".contains(a.as_str()) {
            sets.push(a.clone());
        } else {
            runs.push(a.clone());
        }
    }
    let tuning = toml::from_str(&tuning).unwrap();
    if sets.is_empty() {
        sets = vec!["A".into()];
    }
    let mut worst = std::collections::BTreeMap::<String, [f64; 18]>::new();
    for name in &runs {
        let folder = if name.starts_with('r') {
            "truth-rough"
        } else {
            "truth"
        };
        let run = Run::read(Path::new(&format!(
            "../shared/data/{folder}/{name}.parquet"
        )));
        for set in &sets {
            for seed in &seeds {
                let found = one(&run, set, *seed, tuning, events);
                let w = worst.entry(set.clone()).or_insert([
                    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e9, 1e9, 1e9, 1e9, 1e9, 1e9, 0.0, 0.0, 0.0, 0.0,
                    0.0, 0.0,
                ]);
                for k in 0..6 {
                    w[k] = w[k].max(found[k]);
                    w[6 + k] = w[6 + k].min(found[6 + k]);
                    w[12 + k] = w[12 + k].max(found[6 + k]);
                }
            }
        }
    }
    for (set, w) in worst {
        println!(
            "WORST {set} causal {:.2} {:.2} {:.2} lag {:.2} {:.2} {:.2}  nees {:.2}-{:.2} {:.2}-{:.2} {:.2}-{:.2} lag {:.2}-{:.2} {:.2}-{:.2} {:.2}-{:.2}",
            w[0],
            w[1],
            w[2],
            w[3],
            w[4],
            w[5],
            w[6],
            w[12],
            w[7],
            w[13],
            w[8],
            w[14],
            w[9],
            w[15],
            w[10],
            w[16],
            w[11],
            w[17]
        );
    }
}

fn one(
    run: &Run,
    set: &str,
    seed: u64,
    tuning: atvrec_estimator::tuning::Tuning,
    events: bool,
) -> [f64; 12] {
    let vehicle = truth::vehicle();
    let hub = "ab".contains(set) && run.columns.contains_key("FL_wcw_a_x");
    let file = if "Aa".contains(set) {
        "thesis-10bit"
    } else {
        "full-bridge-16bit-bending"
    };
    let mut sensors = Sensors::builtin(file).unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let mut samples = sensing::samples(run, vehicle, &sensors, seed);
    if hub {
        sensors = Sensors::builtin(&format!("{file}-hub")).unwrap();
        sensors.hub_acceleration.as_mut().unwrap().position_m = [0.0; 3];
        add_hubs(run, seed, &mut samples);
        samples.sort_by_key(|s| s.log_time);
    }
    let start = std::time::Instant::now();
    let settings = Settings {
        tuning,
        ..Settings::default()
    };
    let mut estimator = Estimator::new(vehicle, &sensors, &calibration, settings).unwrap();
    let mut causal: Vec<(usize, Estimate)> = vec![];
    let mut lagged: Vec<(usize, Estimate)> = vec![];
    let mut lines = vec![];
    let bias_on = std::env::var("BIAS").is_ok();
    let mut innovations = None;
    for sample in &samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(x) => causal.push((testkit::scoring::row(&x), x)),
            Output::Lagged(x) => lagged.push((testkit::scoring::row(&x), x)),
            Output::Event(e) => lines.push(format!(
                "{:.2} {:?}",
                e.time.seconds_since(sensing::START),
                e.kind
            )),
            Output::Parameters(p) => innovations = Some(p),
            _ => {}
        });
        estimator.push(sample);
    }
    let elapsed = start.elapsed().as_secs_f64();
    let truth = carrier_truth(run);
    let mut line = format!("{:14} {} {:3}", run.name, set, seed);
    let mut result = [0.0; 12];
    for (k, all) in [&causal, &lagged].into_iter().enumerate() {
        let mut worst = [0.0f64; 3];
        let mut nees = [0.0; 3];
        for (w, wheel) in Wheel::ALL.into_iter().enumerate() {
            for axis in 0..3 {
                let peak = truth
                    .iter()
                    .map(|r| r[w][axis].abs())
                    .fold(vehicle.static_load_n(wheel), f64::max);
                let (mut sum, mut n, mut z2, mut mean, mut sig) = (0.0, 0.0, 0.0, 0.0, 0.0);
                for (row, x) in all {
                    if *row < 400 || *row >= run.rows {
                        continue;
                    }
                    let e = x.carrier[wheel].force_n[axis] - truth[*row][w][axis];
                    sum += e * e;
                    mean += e;
                    sig += x.carrier[wheel].sigma_n[axis];
                    z2 += (e / x.carrier[wheel].sigma_n[axis]).powi(2);
                    n += 1.0;
                }
                if bias_on {
                    println!(
                        "  {k} {wheel:?} {axis} rms {:.1} mean {:.1} sigma {:.1} peak {:.0}",
                        (sum / n as f64).sqrt(),
                        mean / n,
                        sig / n,
                        peak
                    );
                }
                worst[axis] = worst[axis].max(100.0 * (sum / n).sqrt() / peak);
                nees[axis] += z2 / n / 4.0;
            }
        }
        for a in 0..3 {
            result[3 * k + a] = worst[a];
            result[6 + 3 * k + a] = nees[a];
        }
        line += &format!(
            " | {:5.2} {:5.2} {:5.2} nees {:5.2} {:5.2} {:6.2}",
            worst[0], worst[1], worst[2], nees[0], nees[1], nees[2]
        );
    }
    if std::env::var("TRACE").is_ok() {
        for (row, x) in causal
            .iter()
            .step_by(std::env::var("TRACE").unwrap().parse().unwrap())
        {
            if *row >= run.rows {
                continue;
            }
            let t = truth[*row];
            println!(
                "t {:.2} {}",
                *row as f64 / 200.0,
                (0..4)
                    .map(|w| format!("{:.0}/{:.0}", x.carrier.0[w].force_n[2], t[w][2]))
                    .collect::<Vec<_>>()
                    .join(" ")
            );
        }
    }
    let result_motion = testkit::scoring::Estimated {
        estimates: causal.into_iter().map(|c| c.1).collect(),
        events: vec![],
    };
    let m = testkit::scoring::motion_errors(run, &result_motion);
    println!("{line} | m {m:.2?} ev {} {elapsed:.1}s", lines.len());
    if events {
        for l in lines {
            println!("    {l}");
        }
    }
    result
}

fn add_hubs(run: &Run, seed: u64, samples: &mut Vec<Sample>) {
    let vehicle = truth::vehicle();
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 1000);
    for wheel in Wheel::ALL {
        let corner = Corner::of(vehicle, wheel).unwrap();
        let w = wheel.abbreviation();
        let bias: [f64; 3] = std::array::from_fn(|_| rng.random_range(-0.3..0.3));
        let mut lags: Option<[Lag; 3]> = None;
        let mut rack = 0.0;
        for row in 0..run.rows {
            let r = attitude(run, row).inverse();
            let a =
                Vector3::from(["x", "y", "z"].map(|a| run.column(&format!("{w}_wcw_a_{a}"))[row]));
            let f = r * (a + Vector3::z() * sample::STANDARD_GRAVITY_M_S2);
            let l = run.column(&format!("{w}_spring_len"))[row];
            let strut = vehicle.axle(wheel).strut.as_ref().unwrap();
            let l = l - strut.design_length_m + corner.design_strut_length_m();
            let steer = run.column(&format!("{w}_steer"))[row];
            if wheel.is_front() {
                for _ in 0..3 {
                    let p = corner.pose(l, rack).unwrap();
                    let q = corner.pose(l, rack + 1e-4).unwrap();
                    rack += (steer - p.steer_rad()) / ((q.steer_rad() - p.steer_rad()) / 1e-4);
                }
            }
            let pose = corner.pose(l, rack).unwrap();
            let u = pose.vehicle_from_upright.transpose() * f;
            let lags =
                lags.get_or_insert_with(|| std::array::from_fn(|k| Lag::settled(40.0, u[k])));
            for k in 0..3 {
                lags[k].advance(if row == 0 { 0.0 } else { 1.0 / truth::RATE_HZ }, u[k]);
            }
            if row % 2 != 0 {
                continue;
            }
            let time: LogTime = sensing::START.offset_seconds(row as f64 / truth::RATE_HZ);
            samples.push(Sample {
                source: SourceId(9),
                log_time: time.offset_seconds(0.001),
                valid_time: time,
                device_time: None,
                measurement: Measurement::HubAcceleration(HubAccelerationSample {
                    wheel,
                    specific_force_m_s2: std::array::from_fn(|k| {
                        let n: f64 = StandardNormal.sample(&mut rng);
                        Some(lags[k].output() + bias[k] + 0.1 * n)
                    }),
                    counts: [None; 3],
                }),
            });
        }
    }
}

fn attitude(run: &Run, row: usize) -> Rotation3<f64> {
    let [roll, pitch, yaw] = run.vector(["roll", "pitch", "yaw"], row);
    Rotation3::from_euler_angles(roll, pitch, yaw)
}

fn spindle(run: &Run, w: &str, row: usize) -> Vector3<f64> {
    let n = normal(run, w, row);
    let st = run.column(&format!("{w}_steer"))[row];
    let camber = run.column(&format!("{w}_camber"))[row];
    let a = st.cos() * n.y - st.sin() * n.x;
    let b = n.z;
    let el = (camber.sin() / a.hypot(b)).asin() - a.atan2(b);
    Vector3::new(-st.sin() * el.cos(), st.cos() * el.cos(), el.sin())
}

fn normal(run: &Run, w: &str, row: usize) -> Vector3<f64> {
    if run.columns.contains_key(&format!("{w}_n_chassis_x")) {
        Vector3::from(["x", "y", "z"].map(|a| run.column(&format!("{w}_n_chassis_{a}"))[row]))
            .normalize()
    } else {
        attitude(run, row).inverse() * Vector3::z()
    }
}

fn carrier_truth(run: &Run) -> Vec<[[f64; 3]; 4]> {
    (0..run.rows).map(|row| carrier_row(run, row)).collect()
}

fn carrier_row(run: &Run, row: usize) -> [[f64; 3]; 4] {
    std::array::from_fn(|i| {
        let w = Wheel::ALL[i].abbreviation();
        let s = spindle(run, w, row);
        let n = normal(run, w, row);
        let force = if run.columns.contains_key(&format!("{w}_Fchassis_x")) {
            Vector3::from(["x", "y", "z"].map(|a| run.column(&format!("{w}_Fchassis_{a}"))[row]))
        } else {
            let x = s.cross(&n).normalize();
            let f = ["x", "y", "z"].map(|a| run.column(&format!("{w}_F{a}"))[row]);
            x * f[0] + n.cross(&x) * f[1] + n * f[2]
        };
        let x = s.cross(&Vector3::z()).normalize();
        let z = x.cross(&s);
        [force.dot(&x), force.dot(&s), force.dot(&z)]
    })
}
