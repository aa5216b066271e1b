//! A spin: the car slides to a halt with all wheels across, turning about itself, stands, and drives
//! on.

use super::surrogate::{Errors, GRAVITY_M_S2, Row};

const ROW_S: f64 = 0.01;
const FRICTION: f64 = 0.8;
/// Yaw acceleration that begins it, and its greatest yaw rate.
const TURN_RAD_S2: f64 = 4.0;
const TURN_MAX_RAD_S: f64 = 2.0;
/// Yaw rate of a straight.
const STRAIGHT_RAD_S: f64 = 0.01;
const STANDS_S: f64 = 2.0;
const PULLS_AWAY_M_S2: f64 = 3.0;

/// The drive with a spin on the first straight after the row `from`, sensed with these errors; what
/// follows comes as much later.
pub fn inserted(rows: &[Row], from: usize, errors: &Errors) -> Vec<Row> {
    let straight = |row: &Row| (row.yaw_rate_rad_s - errors.gyro_rad_s).abs() < STRAIGHT_RAD_S;
    let ahead = rows[from..].iter().position(straight);
    let at = from + ahead.expect("a straight");
    let mut all = rows[..at].to_vec();
    let first = rows[at];
    let (mut speed, mut slip) = (first.speed_m_s, first.sideslip_rad);
    let mut turn = first.yaw_rate_rad_s;
    let turned = turn.signum();
    while speed > 0.0 {
        let rate = if speed < 2.0 {
            -2.0 * turn
        } else {
            turned * TURN_RAD_S2
        };
        turn = (turn + ROW_S * rate).clamp(-TURN_MAX_RAD_S, TURN_MAX_RAD_S);
        let push = -FRICTION * GRAVITY_M_S2 * math::sin(slip);
        all.push(Row {
            time_s: 0.0,
            speed_m_s: speed * math::cos(slip),
            steer_rad: errors.steer_rad - 0.2 * turned,
            yaw_rate_rad_s: errors.gyro_rad_s + turn,
            lateral_m_s2: errors.accel_m_s2 + push,
            sideslip_rad: slip,
        });
        speed -= ROW_S * FRICTION * GRAVITY_M_S2;
        slip -= ROW_S * turn;
    }
    let mut speed = -PULLS_AWAY_M_S2 * STANDS_S;
    while speed < first.speed_m_s {
        all.push(Row {
            time_s: 0.0,
            speed_m_s: speed.max(0.0),
            steer_rad: errors.steer_rad,
            yaw_rate_rad_s: errors.gyro_rad_s,
            lateral_m_s2: errors.accel_m_s2,
            sideslip_rad: 0.0,
        });
        speed += ROW_S * PULLS_AWAY_M_S2;
    }
    all.extend_from_slice(&rows[at..]);
    for (k, row) in all.iter_mut().enumerate() {
        row.time_s = k as f64 * ROW_S;
    }
    all
}
