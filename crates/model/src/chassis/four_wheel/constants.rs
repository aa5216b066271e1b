use super::{AxleParameters, Parameters};
use crate::scalar::each;

/// What the parameters come to.
///
/// Wheel by wheel in lists, so that four wheels make one vector; what an axle has stands at both of
/// its wheels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Constants {
    /// Position of each wheel from the centre of gravity.
    pub ahead: [f64; 4],
    pub left: [f64; 4],
    pub radius: [f64; 4],
    /// Rolling resistance moment per load, m.
    pub resistance: [f64; 4],
    pub inverse_spin: [f64; 4],
    pub length: [f64; 4],
    pub inverse_length: [f64; 4],
    pub roll_steer: [f64; 4],
    /// What a wheel's force to the left, less what its force ahead, adds to v' + u r + g sin(bank).
    pub felt: [[f64; 4]; 2],
    /// The same of r'.
    pub yaw: [[f64; 4]; 2],
    /// What an aligning moment adds to both.
    pub aligning: [f64; 2],
    /// What the springs' roll moment adds to both, and to phi''.
    pub rolling: [f64; 3],
    /// phi'' of the two, by what forces add to them.
    pub roll_by: [f64; 2],
    /// Load that an axle's right wheel has more: K_phi/t and B_phi/t,
    pub swaying: [[f64; 4]; 2],
    /// h_r/t and m_u (h_u - h_r)/t,
    pub transfer: [[f64; 4]; 2],
    /// what the springs' roll moment comes to through the felt acceleration,
    pub transfer_by_rolling: [f64; 4],
    /// and by felt acceleration in steady turning.
    pub steady_transfer: [f64; 4],
    /// Twice the share of the weight on each wheel.
    pub share: [f64; 4],
    /// Load that a wheel has more by pitch, pitch rate and longitudinal force.
    pub pitch_transfer: [[f64; 4]; 3],
    /// m_s g h_s, K_phi, B_phi.
    pub roll: [f64; 3],
    /// m_s g h_p, K_theta, B_theta.
    pub pitch: [f64; 3],
    /// Drag over mass, 1/m.
    pub drag: f64,
    pub inverse_mass: f64,
    /// theta'' by longitudinal force, -m_s h_p/(I m), by moment, 1/I, and by a = F/m.
    pub pitching: [f64; 3],
    pub low_speed: f64,
    pub passes: usize,
}

impl Constants {
    pub(super) fn of(p: &Parameters) -> Self {
        let g = p.gravity_m_s2;
        let of = |value: fn(&AxleParameters) -> f64| each(|i| value(p.axle(i)));
        let per_track =
            |value: fn(&AxleParameters) -> f64| each(|i| value(p.axle(i)) / p.axle(i).track_m);
        let shares = [-p.rear.ahead_m, p.front.ahead_m].map(|arm| arm / p.wheelbase_m());
        let share = each(|i| shares[i / 2]);
        // A centre of gravity aside of the middle loads the wheels of its side, each axle by its roll
        // stiffness.
        let stiffness = p.front.roll_stiffness_n_m_rad + p.rear.roll_stiffness_n_m_rad;
        let offset = each(|i| {
            let axle = p.axle(i);
            let side = if i.is_multiple_of(2) { 2.0 } else { -2.0 };
            let part = axle.roll_stiffness_n_m_rad / stiffness / axle.track_m;
            // Without roll stiffness nothing says which axle takes it.
            if p.cg_left_m == 0.0 {
                0.0
            } else {
                side * p.cg_left_m * part
            }
        });
        let inverse = p.inverse_mass_matrix();
        let row = |i: usize| [inverse[(i, 0)], inverse[(i, 1)], inverse[(i, 2)]];
        let [felt, yaw, roll] = [row(0), row(1), row(2)];
        let position = each(|i| p.wheel_position_m(i));
        let by_forces = |row: [f64; 3]| {
            [
                each(|i| row[0] + position[i][0] * row[1]),
                each(|i| position[i][1] * row[1]),
            ]
        };
        let height = per_track(|axle| axle.roll_centre_height_m);
        let unsprung = per_track(|axle| {
            axle.unsprung_mass_kg * (axle.unsprung_height_m - axle.roll_centre_height_m)
        });
        let lever = p.sprung_mass_kg * p.roll_arm_m;
        let inverse_roll = (p.roll_inertia_kg_m2 + lever * p.roll_arm_m).recip();
        let pitch_lever = p.sprung_mass_kg * p.pitch_arm_m;
        let inverse_pitch = (p.pitch_inertia_kg_m2 + pitch_lever * p.pitch_arm_m).recip();
        let onto_front = |by: f64| {
            let half = 0.5 * by / p.wheelbase_m();
            [half, half, -half, -half]
        };
        Self {
            ahead: each(|i| position[i][0]),
            left: each(|i| position[i][1]),
            radius: of(|axle| axle.rolling_radius_m),
            resistance: of(|axle| axle.rolling_resistance * axle.rolling_radius_m),
            inverse_spin: of(|axle| axle.spin_inertia_kg_m2.recip()),
            length: of(|axle| axle.relaxation_length_m),
            inverse_length: of(|axle| axle.relaxation_length_m.recip()),
            roll_steer: of(|axle| axle.roll_steer),
            felt: by_forces(felt),
            yaw: by_forces(yaw),
            aligning: [felt[1], yaw[1]],
            rolling: [felt[2], yaw[2], roll[2]],
            roll_by: [lever * inverse_roll, p.inertia_xz_kg_m2 * inverse_roll],
            swaying: [
                per_track(|axle| axle.roll_stiffness_n_m_rad),
                per_track(|axle| axle.roll_damping_n_m_s_rad),
            ],
            transfer: [height, unsprung],
            transfer_by_rolling: each(|i| unsprung[i] * felt[2]),
            steady_transfer: each(|i| share[i] * p.mass_kg * height[i] + unsprung[i]),
            share: each(|i| share[i] + offset[i]),
            pitch_transfer: [
                onto_front(p.pitch_stiffness_n_m_rad),
                onto_front(p.pitch_damping_n_m_s_rad),
                onto_front(-p.pitch_centre_height_m),
            ],
            roll: [
                lever * g,
                p.front.roll_stiffness_n_m_rad + p.rear.roll_stiffness_n_m_rad,
                p.front.roll_damping_n_m_s_rad + p.rear.roll_damping_n_m_s_rad,
            ],
            pitch: [
                pitch_lever * g,
                p.pitch_stiffness_n_m_rad,
                p.pitch_damping_n_m_s_rad,
            ],
            drag: p.drag_n_s2_m2 / p.mass_kg,
            inverse_mass: p.mass_kg.recip(),
            pitching: [
                -pitch_lever * inverse_pitch / p.mass_kg,
                inverse_pitch,
                -pitch_lever * inverse_pitch,
            ],
            low_speed: p.low_speed_m_s,
            passes: p.load_passes,
        }
    }
}
