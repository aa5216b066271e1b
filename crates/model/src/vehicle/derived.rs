//! What follows from a vehicle's values.

use sample::{STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use super::{Axle, Pitch, Sprung, Tyre, Vehicle};

impl Axle {
    /// Mass of both corners' wheels, uprights and arms, kg; zero where the file gives none.
    #[must_use]
    pub fn unsprung_mass_kg(&self) -> f64 {
        self.unsprung
            .as_ref()
            .map_or(0.0, |corner| 2.0 * corner.total_mass_kg())
    }

    /// Stiffness at one wheel that gives this axle's roll stiffness, bar excluded, N/m:
    /// K_w = 2 K_phi / t^2 (equation 2.30 with the track for s).
    #[must_use]
    pub fn wheel_rate_n_m(&self) -> f64 {
        2.0 * (self.roll_stiffness_n_m_rad - self.anti_roll_bar_n_m_rad) / self.track_m.powi(2)
    }

    /// Damping at one wheel that gives this axle's roll damping, N s/m.
    #[must_use]
    pub fn wheel_damping_n_s_m(&self) -> f64 {
        2.0 * self.roll_damping_n_m_s_rad / self.track_m.powi(2)
    }
}

impl Tyre {
    /// Speed over angular speed of a freely rolling wheel under a load, m: a belted tyre rolls like
    /// a rigid wheel whose radius is smaller by a third of the tyre's deflection.
    #[must_use]
    pub fn rolling_radius_m(&self, load_n: f64) -> f64 {
        self.unloaded_radius_m - load_n / self.vertical_stiffness_n_m.max(1.0) / 3.0
    }
}

impl Vehicle {
    /// Name of a strain channel in messages: that of what it measures on the suspension of this wheel.
    #[must_use]
    pub fn channel_name(&self, wheel: Wheel, channel: StrainChannel) -> &'static str {
        channel.name_on(self.axle(wheel).mounting())
    }

    /// Wheelbase L = a + b, m.
    #[must_use]
    pub fn wheelbase_m(&self) -> f64 {
        self.body.front_axle_to_cg_m + self.body.cg_to_rear_axle_m
    }

    /// Load of a wheel of the vehicle at rest on level ground, N: m g b/(2 L) at the front and
    /// m g a/(2 L) at the rear, with a and b the distances of the front and the rear axle from the
    /// centre of gravity. A centre of gravity left of the middle plane adds
    /// m g y K_phi/(t sum K_phi) to the left wheel of an axle and takes it off the right one.
    #[must_use]
    pub fn static_load_n(&self, wheel: Wheel) -> f64 {
        self.weight_on_n(wheel, self.body.mass_kg, [0.0, self.body.cg_y_m])
    }

    /// The part of the weight of a mass that a wheel carries at rest on level ground, N. The mass is
    /// `ahead_m` forward of the vehicle's centre of gravity and `left_m` left of the vehicle's middle.
    #[must_use]
    pub fn weight_on_n(&self, wheel: Wheel, mass_kg: f64, [ahead_m, left_m]: [f64; 2]) -> f64 {
        let arm_m = if wheel.is_front() {
            self.body.cg_to_rear_axle_m + ahead_m
        } else {
            self.body.front_axle_to_cg_m - ahead_m
        };
        let middle_n = 0.5 * mass_kg * STANDARD_GRAVITY_M_S2 / self.wheelbase_m() * arm_m;
        let moment_n_m = mass_kg * STANDARD_GRAVITY_M_S2 * left_m;
        let axle = self.axle(wheel);
        let stiffness = self.front.roll_stiffness_n_m_rad + self.rear.roll_stiffness_n_m_rad;
        let share = axle.roll_stiffness_n_m_rad / stiffness;
        middle_n + wheel.side() * moment_n_m * share / axle.track_m
    }

    /// A wheel that lifts at rest on level ground, because the centre of gravity is beside or beyond the
    /// wheels, and its static load, N.
    #[must_use]
    pub fn hanging_wheel(&self) -> Option<(Wheel, f64)> {
        let loads = Wheel::ALL.map(|wheel| (wheel, self.static_load_n(wheel)));
        // Not a number is no load either.
        loads
            .into_iter()
            .find(|(_, load_n)| load_n.is_nan() || *load_n <= 0.0)
    }

    /// The axle of a wheel.
    #[must_use]
    pub fn axle(&self, wheel: Wheel) -> &Axle {
        if wheel.is_front() {
            &self.front
        } else {
            &self.rear
        }
    }

    /// Place of a wheel's contact in the design position, forward and left of the centre of gravity,
    /// m.
    #[must_use]
    pub fn wheel_place_m(&self, wheel: Wheel) -> [f64; 2] {
        let ahead_m = if wheel.is_front() {
            self.body.front_axle_to_cg_m
        } else {
            -self.body.cg_to_rear_axle_m
        };
        let left_m = 0.5 * wheel.side() * self.axle(wheel).track_m;
        [ahead_m, left_m - self.body.cg_y_m]
    }

    /// Roll angle of a rigid vehicle whose centre of gravity stands above the outer wheels of the
    /// narrower axle, rad: beyond it, it falls onto its side.
    #[must_use]
    pub fn tipping_angle_rad(&self) -> f64 {
        let track_m = self.front.track_m.min(self.rear.track_m);
        math::atan2(0.5 * track_m, self.body.cg_height_m)
    }

    /// Height of the roll axis above ground, under the centre of gravity, m: straight between both roll
    /// centres.
    #[must_use]
    pub fn roll_axis_height_m(&self) -> f64 {
        let (a, b) = (self.body.front_axle_to_cg_m, self.body.cg_to_rear_axle_m);
        (b * self.front.roll_centre_height_m + a * self.rear.roll_centre_height_m) / (a + b)
    }

    /// Arm h_1 of the sprung mass over the roll axis, m.
    #[must_use]
    pub fn roll_arm_m(&self) -> f64 {
        self.sprung().cg_m[2] - self.roll_axis_height_m()
    }

    /// The sprung part: as the file gives it, otherwise the whole less the unsprung masses, which
    /// are taken at the wheel centres. Without unsprung masses, the whole mass is sprung.
    #[must_use]
    pub fn sprung(&self) -> Sprung {
        match &self.body.sprung {
            Some(sprung) => sprung.clone(),
            None => self.whole_less_unsprung(),
        }
    }

    /// The whole vehicle less the unsprung masses at the wheel centres.
    pub(super) fn whole_less_unsprung(&self) -> Sprung {
        let body = &self.body;
        let corners = [
            (body.front_axle_to_cg_m, &self.front),
            (-body.cg_to_rear_axle_m, &self.rear),
        ];
        let unsprung: f64 = corners
            .iter()
            .map(|(_, axle)| axle.unsprung_mass_kg())
            .sum();
        let mass = body.mass_kg - unsprung;
        let moment = |arm: &dyn Fn(f64, &Axle) -> f64| -> f64 {
            corners
                .iter()
                .map(|(x, axle)| axle.unsprung_mass_kg() * arm(*x, axle))
                .sum()
        };
        let centre = [
            -moment(&|x, _| x) / mass,
            body.cg_y_m * unsprung / mass,
            (body.mass_kg * body.cg_height_m - moment(&|_, axle| axle.tyre.unloaded_radius_m))
                / mass,
        ];
        let [x, y, z] = centre;
        let rise = z - body.cg_height_m;
        let height = |axle: &Axle| axle.tyre.unloaded_radius_m - body.cg_height_m;
        // Mean square of both wheels' places across.
        let across = |axle: &Axle| (0.5 * axle.track_m).powi(2) + body.cg_y_m.powi(2);
        let spin = |axle: &Axle| {
            axle.unsprung.as_ref().map_or([0.0; 3], |corner| {
                let flat = 2.0 * corner.wheel_diametral_inertia_kg_m2;
                [flat, 2.0 * corner.wheel_spin_inertia_kg_m2, flat]
            })
        };
        let own: [f64; 3] =
            std::array::from_fn(|axis| corners.iter().map(|(_, axle)| spin(axle)[axis]).sum());
        let [roll, pitch, yaw] = body.inertia_kg_m2;
        Sprung {
            mass_kg: mass,
            cg_m: centre,
            inertia_kg_m2: [
                roll - own[0]
                    - moment(&|_, axle| across(axle) + height(axle).powi(2))
                    - mass * (y.powi(2) + rise.powi(2)),
                pitch
                    - own[1]
                    - moment(&|x, axle| x.powi(2) + height(axle).powi(2))
                    - mass * (x.powi(2) + rise.powi(2)),
                yaw - own[2]
                    - moment(&|x, axle| x.powi(2) + across(axle))
                    - mass * (x.powi(2) + y.powi(2)),
            ],
            inertia_xz_kg_m2: body.inertia_xz_kg_m2
                - moment(&|x, axle| x * height(axle))
                - mass * x * rise,
        }
    }

    /// The lumped pitch model: as the file gives it, otherwise from the wheel rates that the roll
    /// stiffness implies, K_theta = 2 (K_wf a^2 + K_wr b^2), with the pitch centre at the height
    /// of the roll axis.
    #[must_use]
    pub fn pitch(&self) -> Pitch {
        if let Some(pitch) = self.body.pitch {
            return pitch;
        }
        let (a, b) = (self.body.front_axle_to_cg_m, self.body.cg_to_rear_axle_m);
        let lump = |front: f64, rear: f64| 2.0 * (front * a.powi(2) + rear * b.powi(2));
        Pitch {
            centre_height_m: self.roll_axis_height_m(),
            stiffness_n_m_rad: lump(self.front.wheel_rate_n_m(), self.rear.wheel_rate_n_m()),
            damping_n_m_s_rad: lump(
                self.front.wheel_damping_n_s_m(),
                self.rear.wheel_damping_n_s_m(),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn static_loads_carry_the_weight_and_balance_about_the_centre_of_gravity() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let [fl, fr, rl, rr] = Wheel::ALL.map(|wheel| vehicle.static_load_n(wheel));
        let weight_n = vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2;
        assert!((fl + fr + rl + rr - weight_n).abs() < 1e-9);
        let moment_n_m = (fl + fr) * vehicle.body.front_axle_to_cg_m
            - (rl + rr) * vehicle.body.cg_to_rear_axle_m;
        assert!(moment_n_m.abs() < 1e-9, "{moment_n_m}");
        assert!(fl == fr && rl == rr);
    }
}
