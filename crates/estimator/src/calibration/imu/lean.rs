//! How the body leans by its springs and tyres.

use model::suspension::{Corner, CornerPose, ground_plane};
use model::vehicle::Vehicle;
use sample::{PerWheel, Wheel};

use super::lean_rad;

/// What leans a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leaning {
    /// Compression of the springs from the design length, m.
    pub compression_m: PerWheel<f64>,
    /// Specific force along x and y, m/s^2. What it is off by is taken off with the lean at rest.
    pub force_m_s2: [f64; 2],
    /// Steering wheel from straight ahead, rad.
    pub steering_wheel_rad: f64,
}

/// How a vehicle's body leans.
#[derive(Clone, Debug)]
pub struct Lean {
    vehicle: Vehicle,
    linkage: Option<Linkage>,
}

impl Lean {
    /// `None` where the vehicle file has neither hard-points nor motion ratios.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Option<Self> {
        let linkage = Linkage::of(vehicle);
        (linkage.is_some() || lean_rad(vehicle, &PerWheel::default()).is_some()).then(|| Self {
            vehicle: vehicle.clone(),
            linkage,
        })
    }

    /// Roll (right side down) and pitch (nose down) of the body against flat ground, rad. By the
    /// motion ratios alone ([`lean_rad`]) without hard-points. `None` beyond the linkage's reach.
    #[must_use]
    pub fn roll_pitch_rad(&self, now: &Leaning) -> Option<[f64; 2]> {
        match &self.linkage {
            Some(linkage) => linkage.roll_pitch_rad(now),
            None => lean_rad(&self.vehicle, &now.compression_m),
        }
    }
}

/// Springs, linkage and tyres of a vehicle.
///
/// The potentiometers tell where each wheel stands against the body. What a tyre gives way by they
/// do not tell, since the linkage carries a part of its load: f_x moves m f_x h/L from one axle to
/// the other, f_y leans the body on its tyres by m f_y h/sum(k_z t^2/4), with the height h of the
/// centre of gravity, the wheelbase L, the tyres' stiffness k_z and the track t.
#[derive(Clone, Debug)]
struct Linkage {
    corners: PerWheel<Corner>,
    design_m: PerWheel<f64>,
    radius_m: PerWheel<f64>,
    /// Compression of the tyres at rest, m.
    pressed_m: PerWheel<f64>,
    /// Its change for 1 m/s^2 along x and along y, m.
    pressed_by_m: PerWheel<[f64; 2]>,
    rack_m_rad: f64,
}

impl Linkage {
    /// `None` where the vehicle file has no hard-points or struts.
    fn of(vehicle: &Vehicle) -> Option<Self> {
        let corner = |wheel: Wheel| {
            let design_m = vehicle.axle(wheel).strut.as_ref()?.design_length_m;
            Some((Corner::of(vehicle, wheel).ok()?, design_m))
        };
        let [Some(fl), Some(fr), Some(rl), Some(rr)] = Wheel::ALL.map(corner) else {
            return None;
        };
        let body = &vehicle.body;
        let tyre = |wheel: Wheel| &vehicle.axle(wheel).tyre;
        let stiffness = |wheel: Wheel| tyre(wheel).vertical_stiffness_n_m;
        let side_m = |wheel: Wheel| 0.5 * wheel.side() * vehicle.axle(wheel).track_m;
        let stiff = Wheel::ALL.map(|wheel| stiffness(wheel) * side_m(wheel).powi(2));
        let moment = body.mass_kg * body.cg_height_m;
        let rolled = moment / stiff.into_iter().sum::<f64>();
        let pressed_by_m = |wheel: Wheel| {
            let ahead = if wheel.is_front() { 1.0 } else { -1.0 };
            let moved_n = 0.5 * moment / vehicle.wheelbase_m();
            [-ahead * moved_n / stiffness(wheel), -rolled * side_m(wheel)]
        };
        Some(Self {
            design_m: PerWheel([fl.1, fr.1, rl.1, rr.1]),
            corners: PerWheel([fl.0, fr.0, rl.0, rr.0]),
            radius_m: PerWheel::from_fn(|wheel| tyre(wheel).unloaded_radius_m),
            pressed_m: PerWheel::from_fn(|wheel| vehicle.static_load_n(wheel) / stiffness(wheel)),
            pressed_by_m: PerWheel::from_fn(pressed_by_m),
            rack_m_rad: vehicle.steering.rack_m_rad.unwrap_or(0.0),
        })
    }

    /// `None` beyond the linkage's reach.
    fn roll_pitch_rad(&self, now: &Leaning) -> Option<[f64; 2]> {
        let pose = |wheel: Wheel| -> Option<CornerPose> {
            let rack_m = if wheel.is_front() {
                self.rack_m_rad * now.steering_wheel_rad
            } else {
                0.0
            };
            let length_m = self.design_m[wheel] - now.compression_m[wheel];
            self.corners[wheel].pose(length_m, rack_m).ok()
        };
        let [Some(fl), Some(fr), Some(rl), Some(rr)] = Wheel::ALL.map(pose) else {
            return None;
        };
        let pressed_m = PerWheel::from_fn(|wheel| {
            let by = self.pressed_by_m[wheel];
            self.pressed_m[wheel] + by[0] * now.force_m_s2[0] + by[1] * now.force_m_s2[1]
        });
        let poses = PerWheel([fl, fr, rl, rr]);
        let plane = ground_plane(&poses, &self.radius_m, &pressed_m, &PerWheel([1.0; 4]))?;
        Some(plane.body_roll_pitch_rad())
    }
}
