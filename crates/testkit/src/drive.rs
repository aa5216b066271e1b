//! A drive of the virtual vehicle in the form of a truth run, as long as one wants.

use model::vehicle::Vehicle;
use sample::Wheel;
use sim::{Manoeuvre, Motion, TruthState};

use crate::truth::{RATE_HZ, Run};

/// A manoeuvre once, or on end for at least `span_s` where its end joins its beginning.
pub fn virtual_drive(vehicle: &Vehicle, manoeuvre: Manoeuvre, span_s: f64) -> Run {
    let lap = manoeuvre.drive(vehicle).expect("the vehicle can be driven");
    let laps = (span_s / lap.duration_s()).ceil().max(1.0);
    of_motion(&lap.repeated(laps as u32), manoeuvre.name())
}

/// A motion as a run of this name.
pub fn of_motion(motion: &Motion, name: &str) -> Run {
    let rows = (motion.duration_s() * RATE_HZ) as usize;
    let mut columns = sim::Columns::new();
    for row in 0..rows {
        let state = motion.at(row as f64 / RATE_HZ);
        for (name, value) in of_body(&state).into_iter().chain(of_wheels(&state)) {
            columns.entry(name).or_default().push(value);
        }
    }
    Run {
        name: name.to_owned(),
        rows,
        columns,
    }
}

type Named = Vec<(String, f64)>;

fn named<const N: usize>(names: [&str; N], values: [f64; N]) -> Named {
    names.map(str::to_owned).into_iter().zip(values).collect()
}

fn of_body(state: &TruthState) -> Named {
    let motion = state.motion();
    [
        named(["p", "q", "r"], state.rate_rad_s),
        named(["pdot", "qdot", "rdot"], state.rate_derivative_rad_s2),
        named(["vx_body", "vy_body", "vz_body"], state.velocity_body_m_s),
        named(["fx_body", "fy_body", "fz_body"], state.specific_force_m_s2),
        named(
            ["roll", "pitch", "yaw"],
            [state.roll_rad, state.pitch_rad, state.yaw_rad],
        ),
        named(["bank", "grade"], [state.bank_rad, state.grade_rad]),
        named(
            ["hitch_Fx", "hitch_Fy", "hitch_Fz"],
            state.hitch_force_n.unwrap_or_default(),
        ),
        named(
            ["beta", "handwheel"],
            [motion.sideslip_rad, state.steering_wheel_rad],
        ),
    ]
    .concat()
}

fn of_wheels(state: &TruthState) -> Named {
    let of = |wheel: Wheel| {
        let truth = &state.wheels[wheel];
        let links = [
            "UCA_tubeF_T",
            "UCA_tubeB_T",
            "LCA_tubeF_T",
            "LCA_tubeB_T",
            "tierod_T",
        ];
        let columns = [
            named(["Fx", "Fy", "Fz"], truth.force_n),
            named(links, truth.link_force_n),
            named(
                ["omega", "spring_len", "mu", "ball_normal"],
                [
                    truth.angular_speed_rad_s,
                    truth.strut_length_m,
                    truth.friction,
                    truth.ball_normal_n,
                ],
            ),
        ];
        let wheel = wheel.abbreviation();
        columns
            .concat()
            .into_iter()
            .map(move |(name, value)| (format!("{wheel}_{name}"), value))
    };
    Wheel::ALL.into_iter().flat_map(of).collect()
}
