//! Named masses that a vehicle carries or not.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Body, Sprung, Vehicle};
use crate::Error;
use crate::sensors::Sensors;

/// A mass that can be put on the vehicle: driver, passenger, fuel, cargo. It belongs to the sprung part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Payload {
    /// Name, for people and for marks.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Its centre of gravity in the front axle's frame: forward and left of, and above, the point on
    /// the design ground below the middle of the front wheel centres, m.
    pub position_m: [f64; 3],
    /// Its moments of inertia about its own centre of gravity, kg m^2; zero for a point mass.
    #[serde(default)]
    pub inertia_kg_m2: [f64; 3],
}

/// Mass, centre of gravity and inertia of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of gravity, in the frame of who asks, m.
    pub cg_m: [f64; 3],
    /// Moments of inertia about the centre of gravity, kg m^2.
    pub moments_kg_m2: [f64; 3],
    /// Products of inertia about the centre of gravity, integrals of x y, y z and x z over the mass,
    /// kg m^2.
    pub products_kg_m2: [f64; 3],
}

impl MassProperties {
    /// Both bodies together: each one's inertia is moved to the common centre of gravity by the
    /// parallel-axis theorem.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        let mass_kg = self.mass_kg + other.mass_kg;
        let weigh =
            |i: usize| (self.mass_kg * self.cg_m[i] + other.mass_kg * other.cg_m[i]) / mass_kg;
        let cg_m = [weigh(0), weigh(1), weigh(2)];
        let mut together = Self {
            mass_kg,
            cg_m,
            moments_kg_m2: [0.0; 3],
            products_kg_m2: [0.0; 3],
        };
        for part in [self, other] {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|i| part.cg_m[i] - cg_m[i]);
            let moved = [y * y + z * z, x * x + z * z, x * x + y * y];
            let skewed = [x * y, y * z, x * z];
            for axis in 0..3 {
                together.moments_kg_m2[axis] +=
                    part.moments_kg_m2[axis] + part.mass_kg * moved[axis];
                together.products_kg_m2[axis] +=
                    part.products_kg_m2[axis] + part.mass_kg * skewed[axis];
            }
        }
        together
    }

    /// Tensor of inertia about the centre of gravity, kg m^2: its entries beside the diagonal are the
    /// negative products.
    #[must_use]
    pub fn tensor_kg_m2(&self) -> Matrix3<f64> {
        let [xx, yy, zz] = self.moments_kg_m2;
        let [xy, yz, xz] = self.products_kg_m2.map(|product| -product);
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }
}

impl Payload {
    /// Its mass, centre of gravity in the front axle's frame, and inertia.
    #[must_use]
    pub fn mass_properties(&self) -> MassProperties {
        MassProperties {
            mass_kg: self.mass_kg,
            cg_m: self.position_m,
            moments_kg_m2: self.inertia_kg_m2,
            products_kg_m2: [0.0; 3],
        }
    }
}

/// A vehicle with payloads on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The vehicle with their masses.
    pub vehicle: Vehicle,
    /// How far the centre of gravity has moved, vehicle axes, m.
    pub cg_shift_m: Vector3<f64>,
}

impl Loaded {
    /// The sensors with their positions from the moved centre of gravity. The sensors file counts
    /// from that of the vehicle without payload.
    #[must_use]
    pub fn sensors(&self, sensors: &Sensors) -> Sensors {
        let mut moved = sensors.clone();
        for place in [
            &mut moved.imu.position_m,
            &mut moved.gnss_velocity.antenna_m,
            &mut moved.gnss_attitude.antenna_m,
        ] {
            *place = (Vector3::from(*place) - self.cg_shift_m).into();
        }
        moved
    }
}

impl Vehicle {
    /// The whole vehicle as its file says, without payload, in the front axle's frame.
    #[must_use]
    pub fn mass_properties(&self) -> MassProperties {
        let body = &self.body;
        MassProperties {
            mass_kg: body.mass_kg,
            cg_m: [-body.front_axle_to_cg_m, body.cg_y_m, body.cg_height_m],
            moments_kg_m2: body.inertia_kg_m2,
            products_kg_m2: [0.0, 0.0, body.inertia_xz_kg_m2],
        }
    }

    /// The vehicle with these payloads of its file on it: mass, centre of gravity and inertia of the
    /// whole and of the sprung part. Of the products of inertia the models use I_xz.
    ///
    /// # Errors
    /// A name that the file does not have, for which the message lists those there are; payloads with
    /// which a wheel lifts at rest.
    pub fn loaded(&self, names: &[impl AsRef<str>]) -> Result<Loaded, Error> {
        let bare = self.mass_properties();
        let mut loaded = Loaded {
            vehicle: self.clone(),
            cg_shift_m: Vector3::zeros(),
        };
        if names.is_empty() {
            return Ok(loaded);
        }
        let mut whole = bare;
        let mut sprung = self.body.sprung.as_ref().map(|sprung| MassProperties {
            mass_kg: sprung.mass_kg,
            cg_m: [
                bare.cg_m[0] + sprung.cg_m[0],
                bare.cg_m[1] + sprung.cg_m[1],
                sprung.cg_m[2],
            ],
            moments_kg_m2: sprung.inertia_kg_m2,
            products_kg_m2: [0.0, 0.0, sprung.inertia_xz_kg_m2],
        });
        for name in names {
            let payload = self.payload(name.as_ref())?.mass_properties();
            whole = whole.with(&payload);
            sprung = sprung.map(|sprung| sprung.with(&payload));
        }
        let [x, y, z] = whole.cg_m;
        let wheelbase_m = self.wheelbase_m();
        let body = &mut loaded.vehicle.body;
        *body = Body {
            mass_kg: whole.mass_kg,
            front_axle_to_cg_m: -x,
            cg_to_rear_axle_m: wheelbase_m + x,
            cg_y_m: y,
            cg_height_m: z,
            inertia_kg_m2: whole.moments_kg_m2,
            inertia_xz_kg_m2: whole.products_kg_m2[2],
            sprung: sprung.map(|sprung| Sprung {
                mass_kg: sprung.mass_kg,
                cg_m: [sprung.cg_m[0] - x, sprung.cg_m[1] - y, sprung.cg_m[2]],
                inertia_kg_m2: sprung.moments_kg_m2,
                inertia_xz_kg_m2: sprung.products_kg_m2[2],
            }),
            ..body.clone()
        };
        loaded.vehicle.require_standing(names)?;
        loaded.cg_shift_m = Vector3::from(whole.cg_m) - Vector3::from(bare.cg_m);
        Ok(loaded)
    }

    fn require_standing(&self, names: &[impl AsRef<str>]) -> Result<(), Error> {
        let Some((wheel, load_n)) = self.hanging_wheel() else {
            return Ok(());
        };
        let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
        Err(Error::NotStanding {
            vehicle: self.name.clone(),
            payloads: names.join(", "),
            wheel,
            load_n,
        })
    }

    fn payload(&self, name: &str) -> Result<&Payload, Error> {
        let found = self.payload.iter().find(|payload| payload.name == name);
        found.ok_or_else(|| Error::UnknownPayload {
            vehicle: self.name.clone(),
            name: name.to_owned(),
            known: match &self.payload[..] {
                [] => "it has none; add a table [[payload]]".to_owned(),
                some => {
                    let names: Vec<_> = some.iter().map(|p| p.name.as_str()).collect();
                    format!("use one of {}", names.join(", "))
                }
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use sample::{STANDARD_GRAVITY_M_S2, Wheel};

    use super::*;

    const BOX: &str = "\n[[payload]]\nname = \"box\"\nmass_kg = 100.0\n\
                       position_m = [-0.8, 0.3, 0.95]\ninertia_kg_m2 = [2.083, 3.75, 4.333]\n";

    fn with_box() -> Vehicle {
        let text = format!("{}{BOX}", Vehicle::builtin_text("prowler").unwrap());
        Vehicle::from_toml(&text, "v.toml").unwrap()
    }

    /// An independent simulator's vehicle and its payload of 100 kg: mass properties of both together.
    #[test]
    fn mass_properties_add_by_parallel_axes() {
        let vehicle = MassProperties {
            mass_kg: 1560.0,
            cg_m: [0.0, 0.042, 0.69],
            moments_kg_m2: [632.7, 2219.3, 2388.8],
            products_kg_m2: [11.4, -2.0, -19.3],
        };
        let payload = MassProperties {
            mass_kg: 100.0,
            cg_m: [-0.8, -0.35, 0.95],
            moments_kg_m2: [2.083, 3.75, 4.333],
            products_kg_m2: [0.0; 3],
        };
        let both = vehicle.with(&payload);
        assert_eq!(both.mass_kg, 1660.0);
        for (found, told) in both.cg_m.into_iter().zip([-0.0482, 0.0184, 0.7057]) {
            assert!((found - told).abs() < 5e-5, "{found} {told}");
        }
        let tensor = both.tensor_kg_m2();
        let told = [
            (0, 0, 655.5),
            (1, 1, 2289.6),
            (2, 2, 2467.7),
            (0, 1, -40.9),
            (0, 2, 38.9),
            (1, 2, 11.5),
        ];
        for (row, column, told) in told {
            let found = tensor[(row, column)];
            // The vehicle's own values are printed to a tenth.
            assert!((found - told).abs() < 0.15, "{row}{column}: {found} {told}");
        }
    }

    #[test]
    fn a_loaded_vehicle_carries_its_weight_and_balances() {
        let vehicle = with_box();
        let loaded = vehicle.loaded(&["box"]).unwrap();
        let heavy = &loaded.vehicle;
        assert_eq!(heavy.body.mass_kg, vehicle.body.mass_kg + 100.0);
        assert!((heavy.wheelbase_m() - vehicle.wheelbase_m()).abs() < 1e-12);
        let [fl, fr, rl, rr] = Wheel::ALL.map(|wheel| heavy.static_load_n(wheel));
        let weight_n = heavy.body.mass_kg * STANDARD_GRAVITY_M_S2;
        assert!((fl + fr + rl + rr - weight_n).abs() < 1e-9);
        let about_x = Wheel::ALL.map(|wheel| {
            let [_, left_m] = heavy.wheel_place_m(wheel);
            left_m * heavy.static_load_n(wheel)
        });
        assert!(about_x.iter().sum::<f64>().abs() < 1e-9, "{about_x:?}");
        assert!(fl > fr && rl > rr);
        let sprung = heavy.sprung().mass_kg - vehicle.sprung().mass_kg;
        assert!((sprung - 100.0).abs() < 1e-9);
        let shift = loaded.cg_shift_m;
        assert!((shift.y - 30.0 / heavy.body.mass_kg).abs() < 1e-12);
        let sensors = Sensors::builtin("thesis-10bit").unwrap();
        let moved = loaded.sensors(&sensors).imu.position_m;
        assert!((moved[1] - sensors.imu.position_m[1] + shift.y).abs() < 1e-12);
        // Nothing on it: the bits of the file.
        let none: [&str; 0] = [];
        let bare = vehicle.loaded(&none).unwrap();
        assert_eq!(
            (bare.vehicle, bare.cg_shift_m),
            (vehicle.clone(), Vector3::zeros())
        );
        let unknown = vehicle.loaded(&["driver"]).unwrap_err().to_string();
        assert!(
            unknown.contains("driver") && unknown.contains("box"),
            "{unknown}"
        );
    }

    /// With its own sprung table, whose parts add up to the whole, the sprung part is the same as without.
    #[test]
    fn a_given_sprung_part_is_loaded_as_a_derived_one() {
        let mut vehicle = with_box();
        let derived = vehicle.loaded(&["box"]).unwrap().vehicle.sprung();
        vehicle.body.sprung = Some(vehicle.sprung());
        let given = vehicle.loaded(&["box"]).unwrap().vehicle.sprung();
        assert!((given.mass_kg - derived.mass_kg).abs() < 1e-9);
        for axis in 0..3 {
            assert!((given.cg_m[axis] - derived.cg_m[axis]).abs() < 1e-9);
            let apart = given.inertia_kg_m2[axis] - derived.inertia_kg_m2[axis];
            assert!(apart.abs() < 1e-6, "{axis}: {apart}");
        }
    }

    /// 100 kg 5 m left of the middle lift the right wheels; the same load at the middle does not.
    #[test]
    fn a_payload_beside_the_wheels_is_refused() {
        let mut vehicle = with_box();
        vehicle.payload[0].position_m = [-0.6, 5.0, 0.5];
        let told = vehicle.loaded(&["box"]).unwrap_err().to_string();
        for part in ["box", "FR is -", "position_m"] {
            assert!(told.contains(part), "{told}");
        }
        vehicle.payload[0].position_m[1] = 0.0;
        assert!(vehicle.loaded(&["box"]).is_ok());
    }

    #[test]
    fn a_centre_of_gravity_beside_the_wheels_is_refused() {
        let text = Vehicle::builtin_text("prowler").unwrap();
        let text = text.replacen("[body]", "[body]\ncg_y_m = 0.9", 1);
        let told = Vehicle::from_toml(&text, "v.toml").unwrap_err().to_string();
        assert!(
            told.contains("body.cg_y_m") && told.contains("FR is -"),
            "{told}"
        );
    }

    /// What two loads carry together is what each carries alone, so that the loads with a payload are
    /// those without it and the payload's weight.
    #[test]
    fn the_weight_of_a_payload_adds_to_the_static_loads() {
        let vehicle = with_box();
        let payload = &vehicle.payload[0];
        let [x, y, _] = payload.position_m;
        let ahead_m = x + vehicle.body.front_axle_to_cg_m;
        let loaded = vehicle.loaded(&["box"]).unwrap().vehicle;
        for wheel in Wheel::ALL {
            let sum_n = vehicle.static_load_n(wheel)
                + vehicle.weight_on_n(wheel, payload.mass_kg, [ahead_m, y]);
            assert!(
                (loaded.static_load_n(wheel) - sum_n).abs() < 1e-9,
                "{wheel}"
            );
        }
    }

    #[test]
    fn mistakes_of_a_payload_are_named() {
        let text = Vehicle::builtin_text("prowler").unwrap();
        let told = |payload: &str| {
            let text = format!("{text}\n{payload}");
            Vehicle::from_toml(&text, "v.toml").unwrap_err().to_string()
        };
        let negative = told(&BOX.replace("100.0", "-100.0"));
        assert!(negative.contains("payload[0].mass_kg"), "{negative}");
        let unknown = told(&BOX.replace("mass_kg", "mass"));
        assert!(unknown.contains("payload[0].mass"), "{unknown}");
        let twice = told(&format!("{BOX}{BOX}"));
        assert!(twice.contains("payload[1].name"), "{twice}");
    }
}
