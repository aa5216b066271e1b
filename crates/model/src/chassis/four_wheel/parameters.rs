use nalgebra::Matrix3;
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use super::constants::Constants;
use crate::tyre::{Brush, Tyre};
use crate::vehicle::{Axle, Vehicle};

/// One axle, as the four-wheel model sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct AxleParameters {
    /// Distance x of the axle ahead of the centre of gravity, m; negative at the rear.
    pub ahead_m: f64,
    /// Track t, m.
    pub track_m: f64,
    /// Roll-centre height h_r, m.
    pub roll_centre_height_m: f64,
    /// Roll stiffness K_phi, N m/rad.
    pub roll_stiffness_n_m_rad: f64,
    /// Roll damping B_phi, N m s/rad.
    pub roll_damping_n_m_s_rad: f64,
    /// Unsprung mass m_u of the axle, kg.
    pub unsprung_mass_kg: f64,
    /// Height h_u of the unsprung mass, m.
    pub unsprung_height_m: f64,
    /// Road-wheel steer per roll angle, left positive.
    pub roll_steer: f64,
    /// Tyre.
    pub tyre: Tyre,
    /// Radius R that carries spin to the ground and force to the wheel, m.
    pub rolling_radius_m: f64,
    /// Spin inertia of one wheel, kg m^2.
    pub spin_inertia_kg_m2: f64,
    /// Relaxation length sigma, m; zero for none.
    pub relaxation_length_m: f64,
    /// Rolling resistance coefficient.
    pub rolling_resistance: f64,
}

/// Parameters of the four-wheel model. After changing any of them, call [`Parameters::prepare`].
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Total mass m, kg.
    pub mass_kg: f64,
    /// Sprung mass m_s, kg.
    pub sprung_mass_kg: f64,
    /// Height h of the whole vehicle's centre of gravity, m.
    pub cg_height_m: f64,
    /// Centre of gravity left of the middle plane, m.
    pub cg_left_m: f64,
    /// Yaw inertia I_z of the whole, kg m^2.
    pub yaw_inertia_kg_m2: f64,
    /// Roll inertia I_x of the sprung part about its centre of gravity, kg m^2.
    pub roll_inertia_kg_m2: f64,
    /// Pitch inertia I_y of the sprung part about its centre of gravity, kg m^2.
    pub pitch_inertia_kg_m2: f64,
    /// Product of inertia I_xz, kg m^2.
    pub inertia_xz_kg_m2: f64,
    /// Arm h_s of the sprung mass above the roll axis, m.
    pub roll_arm_m: f64,
    /// Arm h_p of the sprung mass above the pitch centre, m.
    pub pitch_arm_m: f64,
    /// Height h_pc of the pitch centre, m.
    pub pitch_centre_height_m: f64,
    /// Pitch stiffness K_theta, N m/rad.
    pub pitch_stiffness_n_m_rad: f64,
    /// Pitch damping B_theta, N m s/rad.
    pub pitch_damping_n_m_s_rad: f64,
    /// Drag, N s^2/m^2.
    pub drag_n_s2_m2: f64,
    /// Gravity g, m/s^2.
    pub gravity_m_s2: f64,
    /// Speed below which slip without relaxation is blended, m/s.
    pub low_speed_m_s: f64,
    /// Passes of the loop between loads and forces, one at least. Two, the default, leave some
    /// 1e-5 of the forces in steady turning; each further pass divides that by about 50.
    pub load_passes: usize,
    /// Front axle.
    pub front: AxleParameters,
    /// Rear axle.
    pub rear: AxleParameters,
    prepared: Prepared,
}

/// What the equations take from the parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Prepared {
    pub constants: Constants,
    /// Brush tyres of the wheels and whether their stiffnesses grow with the load, where both
    /// axles have such tyres.
    pub brushes: Option<(Brush<[f64; 4]>, bool)>,
    /// The form that both axles share, if they do.
    pub shared: Shared,
}

/// A form of both axles for which there is a kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Shared {
    Relaxing,
    Immediate,
    #[default]
    Mixed,
}

impl Prepared {
    fn of(parameters: &Parameters) -> Self {
        Self {
            constants: Constants::of(parameters),
            brushes: parameters.brushes(),
            shared: parameters.shared_form(),
        }
    }
}

impl Parameters {
    /// The parameters of a vehicle. The sprung part's roll and pitch inertia are about its own
    /// centre of gravity; rolling radius and spin inertia come from the tyre where the file has no
    /// unsprung masses (a wheel of 1/40 of the vehicle's mass, as a hoop of 0.6 of the radius).
    #[must_use]
    pub fn from_vehicle(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        let sprung = vehicle.sprung();
        let pitch = vehicle.pitch();
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let mut parameters = Self {
            mass_kg: body.mass_kg,
            sprung_mass_kg: sprung.mass_kg,
            cg_height_m: body.cg_height_m,
            cg_left_m: body.cg_y_m,
            yaw_inertia_kg_m2: body.inertia_kg_m2[2],
            roll_inertia_kg_m2: sprung.inertia_kg_m2[0],
            pitch_inertia_kg_m2: sprung.inertia_kg_m2[1],
            inertia_xz_kg_m2: body.inertia_xz_kg_m2,
            roll_arm_m: vehicle.roll_arm_m(),
            pitch_arm_m: sprung.cg_m[2] - pitch.centre_height_m,
            pitch_centre_height_m: pitch.centre_height_m,
            pitch_stiffness_n_m_rad: pitch.stiffness_n_m_rad,
            pitch_damping_n_m_s_rad: pitch.damping_n_m_s_rad,
            drag_n_s2_m2: body.drag_n_s2_m2,
            gravity_m_s2: STANDARD_GRAVITY_M_S2,
            low_speed_m_s: 0.5,
            load_passes: 2,
            front: axle(vehicle, &vehicle.front, a, Wheel::FrontLeft, 0),
            rear: axle(vehicle, &vehicle.rear, -b, Wheel::RearLeft, 1),
            prepared: Prepared::default(),
        };
        parameters.prepare();
        parameters
    }

    /// Brings what is derived from the parameters up to date.
    pub fn prepare(&mut self) {
        self.prepared = Prepared::of(self);
    }

    /// What is derived from the parameters. In debug builds it must be up to date.
    #[inline]
    pub(super) fn prepared(&self) -> &Prepared {
        debug_assert!(
            self.prepared == Prepared::of(self),
            "four-wheel parameters were changed without Parameters::prepare"
        );
        &self.prepared
    }

    /// Inverse of the mass matrix of (v' + u r, r', phi''); zeros where there is none.
    pub(super) fn inverse_mass_matrix(&self) -> Matrix3<f64> {
        let lever = self.sprung_mass_kg * self.roll_arm_m;
        let matrix = Matrix3::new(
            self.mass_kg,
            0.0,
            -lever,
            0.0,
            self.yaw_inertia_kg_m2,
            -self.inertia_xz_kg_m2,
            -lever,
            -self.inertia_xz_kg_m2,
            self.roll_inertia_kg_m2 + lever * self.roll_arm_m,
        );
        matrix.try_inverse().unwrap_or_else(Matrix3::zeros)
    }

    fn brushes(&self) -> Option<(Brush<[f64; 4]>, bool)> {
        let (front, grows) = Brush::of(&self.front.tyre)?;
        let (rear, grows_too) = Brush::of(&self.rear.tyre)?;
        (grows == grows_too).then(|| (Brush::of_wheels([front, rear]), grows))
    }

    fn shared_form(&self) -> Shared {
        let axles = [&self.front, &self.rear];
        if axles.iter().any(|axle| axle.roll_steer != 0.0) || self.load_passes != 2 {
            return Shared::Mixed;
        }
        match axles.map(|axle| axle.relaxation_length_m > 0.0) {
            [true, true] => Shared::Relaxing,
            [false, false] => Shared::Immediate,
            _ => Shared::Mixed,
        }
    }

    /// Lateral acceleration at which a rigid vehicle tips, g t/(2 h) with the track weighted by
    /// the axles' loads, m/s^2.
    #[must_use]
    pub fn rigid_rollover_m_s2(&self) -> f64 {
        let (a, b) = (self.front.ahead_m, -self.rear.ahead_m);
        let track = (b * self.front.track_m + a * self.rear.track_m) / (a + b);
        0.5 * self.gravity_m_s2 * track / self.cg_height_m
    }

    /// Lateral acceleration at which the inner wheel of each axle lifts in steady turning, small
    /// roll angles, as long as the other axle's still stands, m/s^2.
    #[must_use]
    pub fn lift_m_s2(&self) -> [f64; 2] {
        let stiffness = self.front.roll_stiffness_n_m_rad + self.rear.roll_stiffness_n_m_rad;
        let lever = self.sprung_mass_kg * self.roll_arm_m;
        let roll = lever / (stiffness - lever * self.gravity_m_s2);
        let (a, b) = (self.front.ahead_m, -self.rear.ahead_m);
        [(&self.front, b), (&self.rear, a)].map(|(axle, share)| {
            let mass = self.mass_kg * share / (a + b);
            let moment = axle.roll_stiffness_n_m_rad * roll
                + (mass - axle.unsprung_mass_kg) * axle.roll_centre_height_m
                + axle.unsprung_mass_kg * axle.unsprung_height_m;
            0.5 * mass * self.gravity_m_s2 * axle.track_m / moment
        })
    }

    /// The axle of a wheel, by the wheel's index.
    #[inline(always)]
    #[must_use]
    pub fn axle(&self, wheel: usize) -> &AxleParameters {
        if wheel < 2 { &self.front } else { &self.rear }
    }

    /// Position (x, y) of a wheel from the centre of gravity, m.
    #[inline(always)]
    #[must_use]
    pub fn wheel_position_m(&self, wheel: usize) -> [f64; 2] {
        let axle = self.axle(wheel);
        let side = if wheel.is_multiple_of(2) { 0.5 } else { -0.5 };
        [axle.ahead_m, side * axle.track_m - self.cg_left_m]
    }

    /// Wheelbase L, m.
    #[inline(always)]
    #[must_use]
    pub fn wheelbase_m(&self) -> f64 {
        self.front.ahead_m - self.rear.ahead_m
    }
}

fn axle(
    vehicle: &Vehicle,
    axle: &Axle,
    ahead_m: f64,
    wheel: Wheel,
    index: usize,
) -> AxleParameters {
    let tyre = &axle.tyre;
    let rolling_radius_m = tyre.rolling_radius_m(vehicle.static_load_n(wheel));
    AxleParameters {
        ahead_m,
        track_m: axle.track_m,
        roll_centre_height_m: axle.roll_centre_height_m,
        roll_stiffness_n_m_rad: axle.roll_stiffness_n_m_rad,
        roll_damping_n_m_s_rad: axle.roll_damping_n_m_s_rad,
        unsprung_mass_kg: axle.unsprung_mass_kg(),
        unsprung_height_m: tyre.unloaded_radius_m,
        roll_steer: vehicle.steering.roll_steer[index],
        tyre: Tyre::from_vehicle(tyre),
        rolling_radius_m,
        spin_inertia_kg_m2: axle.unsprung.as_ref().map_or_else(
            || vehicle.body.mass_kg / 40.0 * (0.6 * tyre.unloaded_radius_m).powi(2),
            |corner| corner.wheel_spin_inertia_kg_m2,
        ),
        relaxation_length_m: tyre.relaxation_length_m,
        rolling_resistance: tyre.rolling_resistance,
    }
}
