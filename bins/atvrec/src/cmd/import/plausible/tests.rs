use sample::{
    GnssPosition, GnssVelocity, GroundSpeedSample, ImuSample, PerWheel, WheelSpeedSample,
};

use super::*;

/// A drive with a standing start and turns, whose channels are scaled by mistakes.
#[derive(Clone, Copy)]
struct Scales {
    speed: f64,
    track: f64,
    lateral: f64,
    rate: f64,
    gravity: f64,
    wheels: f64,
}

const RIGHT: Scales = Scales {
    speed: 1.0,
    track: 1.0,
    lateral: 1.0,
    rate: 1.0,
    gravity: 1.0,
    wheels: 1.0,
};

fn findings(scales: Scales) -> Vec<Finding> {
    let mut drive = Drive::default();
    let mut east = 0.0;
    for row in 0..6000_u64 {
        let time = LogTime(1_000_000_000_000 + row * 10_000_000);
        let t = row as f64 * 0.01;
        let speed = (2.0 * (t - 5.0)).clamp(0.0, 15.0);
        let rate = if speed > 0.0 {
            0.3 * math::sin(0.7 * t)
        } else {
            0.0
        };
        east += speed * 0.01;
        drive.push(
            time,
            &Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: scales.speed * speed,
                leftward_m_s: None,
            }),
        );
        // Roll adds a tenth of gravity, and the inertial unit has a noise.
        let noise = 0.1 * math::sin(row as f64 * 12.9);
        drive.push(
            time,
            &Measurement::Imu(ImuSample {
                specific_force_m_s2: [
                    scales.lateral * noise,
                    scales.lateral * (1.1 * speed * rate + noise),
                    scales.lateral * scales.gravity * STANDARD_GRAVITY_M_S2,
                ],
                angular_rate_rad_s: [0.0, 0.0, scales.rate * rate],
                valid: true,
                ..ImuSample::default()
            }),
        );
        let wheel = Some(scales.wheels * speed / 0.3);
        drive.push(
            time,
            &Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s: PerWheel([wheel; 4]),
            }),
        );
        if row % 20 == 0 {
            drive.push(
                time,
                &Measurement::GnssPosition(GnssPosition {
                    latitude_rad: 0.8,
                    longitude_rad: 0.2 + east / (6.378e6 * math::cos(0.8)),
                    height_m: 0.0,
                    ..GnssPosition::default()
                }),
            );
            drive.push(
                time,
                &Measurement::GnssVelocity(GnssVelocity {
                    velocity_enu_m_s: [scales.track * speed, 0.0, 0.0],
                    ..GnssVelocity::default()
                }),
            );
        }
    }
    drive.findings(Some(0.3))
}

#[test]
fn right_units_are_plausible() {
    assert_eq!(findings(RIGHT), []);
}

/// Mistakes of units, and the question that names each.
fn mistakes() -> Vec<(Scales, &'static str)> {
    let g = STANDARD_GRAVITY_M_S2;
    let lateral = |lateral| Scales { lateral, ..RIGHT };
    let rate = |rate| Scales { rate, ..RIGHT };
    let speed = |speed| Scales { speed, ..RIGHT };
    let wheels = |wheels| Scales { wheels, ..RIGHT };
    vec![
        (lateral(1.0 / g), "is it in g?"),
        (lateral(g), "is it in m/s^2, not in g?"),
        (rate(DEGREE), "is the yaw rate in deg/s?"),
        (
            rate(1.0 / DEGREE),
            "is the yaw rate in rad/s, not in deg/s?",
        ),
        (speed(KM_H), "is the speed in km/h?"),
        (speed(1.0 / KM_H), "is the speed in m/s, not in km/h?"),
        (speed(MPH), "is the speed in mph?"),
        (speed(KNOT), "is the speed in kn?"),
        (
            Scales {
                gravity: 0.0,
                ..RIGHT
            },
            "has gravity been subtracted?",
        ),
        (wheels(RPM), "are the wheel speeds in rpm?"),
        (wheels(DEGREE), "are the wheel speeds in deg/s?"),
        (
            Scales {
                track: KM_H,
                ..RIGHT
            },
            "the receiver's speed in km/h?",
        ),
    ]
}

#[test]
fn each_wrong_unit_is_named() {
    for (scales, unit) in mistakes() {
        let found = findings(scales);
        let named = |finding: &Finding| match finding {
            Finding::Error(text) => text.contains(unit),
            Finding::Warning(_) => false,
        };
        assert!(found.iter().any(named), "{unit}: {found:#?}");
    }
}
