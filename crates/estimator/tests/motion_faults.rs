//! Faults of the sensors of motion, on truth runs: each is named, what it says is left out, and it is
//! used again when it is good.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's helpers stand outside its functions"
)]

#[path = "truth/judge.rs"]
mod judge;
#[path = "truth/run.rs"]
mod run;
#[path = "truth/sensing.rs"]
mod sensing;

use estimator::{Calibration, Settings};
use judge::{estimate, force_errors, motion_errors};
use model::sensors::Sensors;
use run::Run;
use sample::{EventKind, Measurement, Wheel};

const RUNS: [&str; 4] = ["b_circle", "c_sine03", "d_sine_mu", "f_launch_brake"];

/// When faults begin and end, s.
const FAULT_S: f64 = 8.0;
const HEALED_S: f64 = 12.0;

struct Case {
    name: &'static str,
    spoil: fn(&mut Measurement, &mut Option<[f64; 4]>),
}

const CASES: [Case; 14] = [
    Case {
        name: "none",
        spoil: |_, _| {},
    },
    Case {
        name: "velocity hangs",
        spoil: |m, held| {
            if let Measurement::GnssVelocity(gnss) = m {
                let [x, y, z] = gnss.velocity_enu_m_s;
                let [x, y, z, _] = *held.get_or_insert([x, y, z, 0.0]);
                gnss.velocity_enu_m_s = [x, y, z];
            }
        },
    },
    Case {
        name: "velocity +3",
        spoil: |m, _| {
            if let Measurement::GnssVelocity(gnss) = m {
                gnss.velocity_enu_m_s[0] += 3.0;
            }
        },
    },
    Case {
        name: "heading hangs",
        spoil: |m, held| {
            if let Measurement::GnssAttitude(gnss) = m {
                let yaw = gnss.yaw_rad.unwrap_or(0.0);
                gnss.yaw_rad = Some(held.get_or_insert([yaw; 4])[0]);
            }
        },
    },
    Case {
        name: "heading +0.3",
        spoil: |m, _| {
            if let Measurement::GnssAttitude(gnss) = m {
                gnss.yaw_rad = gnss.yaw_rad.map(|a| a + 0.3);
            }
        },
    },
    Case {
        name: "accel x +15",
        spoil: |m, _| {
            if let Measurement::Imu(imu) = m {
                imu.specific_force_m_s2[0] += 15.0;
            }
        },
    },
    Case {
        name: "accel y -40",
        spoil: |m, _| {
            if let Measurement::Imu(imu) = m {
                imu.specific_force_m_s2[1] = -40.0;
            }
        },
    },
    Case {
        name: "accel y +2",
        spoil: |m, _| {
            if let Measurement::Imu(imu) = m {
                imu.specific_force_m_s2[1] += 2.0;
            }
        },
    },
    Case {
        name: "accel z dead",
        spoil: |m, _| {
            if let Measurement::Imu(imu) = m {
                imu.specific_force_m_s2[2] = 0.0;
            }
        },
    },
    Case {
        name: "hand wheel hangs",
        spoil: |m, held| {
            if let Measurement::Steer(steer) = m {
                steer.hand_wheel_rad = held.get_or_insert([steer.hand_wheel_rad; 4])[0];
            }
        },
    },
    Case {
        name: "hand wheel dead",
        spoil: |m, _| {
            if let Measurement::Steer(steer) = m {
                steer.hand_wheel_rad = 0.0;
            }
        },
    },
    Case {
        name: "hand wheel +2",
        spoil: |m, _| {
            if let Measurement::Steer(steer) = m {
                steer.hand_wheel_rad += 2.0;
            }
        },
    },
    Case {
        name: "wheel speed dead",
        spoil: |m, _| {
            if let Measurement::WheelSpeed(speeds) = m {
                speeds.angular_speed_rad_s[Wheel::FrontLeft] = Some(0.0);
            }
        },
    },
    Case {
        name: "gyro z +2",
        spoil: |m, _| {
            if let Measurement::Imu(imu) = m {
                imu.angular_rate_rad_s[2] += 2.0;
            }
        },
    },
];

#[test]
fn faults_of_motion_are_named() {
    if run::directory().is_none() {
        return;
    }
    let vehicle = run::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    for name in RUNS {
        let run = Run::load(name);
        let good = sensing::samples(&run, &vehicle, &sensors, 1);
        for case in &CASES {
            if std::env::var("CASE").is_ok_and(|c| !case.name.contains(&c))
                || std::env::var("RUN").is_ok_and(|c| !name.contains(&c))
            {
                continue;
            }
            let mut samples = good.clone();
            let mut held = None;
            for sample in &mut samples {
                let time_s = sample.log_time.seconds_since(sensing::START);
                if (FAULT_S..HEALED_S).contains(&time_s) {
                    (case.spoil)(&mut sample.measurement, &mut held);
                }
            }
            let result = estimate(
                &vehicle,
                &sensors,
                &calibration,
                Settings::default(),
                &samples,
            );
            let force = force_errors(&run, &vehicle, &result);
            let motion = motion_errors(&run, &result);
            let told: Vec<_> = result
                .events
                .iter()
                .filter(|e| {
                    matches!(
                        e.kind,
                        EventKind::SensorFault(_)
                            | EventKind::SensorRecovered(_)
                            | EventKind::FilterReset
                            | EventKind::SurfaceChange(_)
                    )
                })
                .map(|e| {
                    (
                        e.time.seconds_since(sensing::START),
                        format!("{:?}", e.kind),
                    )
                })
                .collect();
            eprintln!(
                "{name:15} {:17} {force:.2?} % {motion:.3?} deg {told:.2?}",
                case.name
            );
        }
    }
}
