//! Manoeuvres on ground that is not a plane.

use std::f64::consts::TAU;

use model::road::{Road, SoftGround};
use model::vehicle::Vehicle;

use crate::driver::Plan;
use crate::driver::rough::{Course, Hitch, Profile, RoughPlan, drive_rough};
use crate::driver::{Intent, STATES_PER_S};
use crate::jackstand::smooth;
use crate::{Manoeuvre, Motion, SimError};

impl Manoeuvre {
    /// The road file that belongs to the manoeuvre; none where the ground is a plane.
    #[must_use]
    pub const fn road_text(self) -> Option<&'static str> {
        Some(match self {
            Self::RoughRoad => include_str!("../../roads/rough-road.toml"),
            Self::Rocks => include_str!("../../roads/rocks.toml"),
            Self::Washboard => include_str!("../../roads/washboard.toml"),
            Self::TwistDitch => include_str!("../../roads/twist-ditch.toml"),
            Self::Jump => include_str!("../../roads/jump.toml"),
            Self::Trail => include_str!("../../roads/trail.toml"),
            Self::HillsideRough => include_str!("../../roads/hillside-rough.toml"),
            Self::Reverse => include_str!("../../roads/reverse.toml"),
            Self::Tow => include_str!("../../roads/tow.toml"),
            _ => return None,
        })
    }

    /// The road of the manoeuvre; none where the ground is a plane.
    ///
    /// # Errors
    /// A road file with mistakes, which none has that ships.
    pub fn road(self) -> Result<Option<Road>, SimError> {
        let no_files = |name: &str| Err(format!("no file {name} ships with the manoeuvre"));
        let read = |text| Road::from_toml(text, self.name(), &no_files);
        let road = self.road_text().map(read).transpose();
        road.map_err(|errors| SimError::Model(errors.into()))
    }

    /// Lets a driver perform it on a road, with the model of the vehicle on its linkages.
    ///
    /// # Errors
    /// A manoeuvre with a ground of its own that no road replaces, a road that the tyres cannot
    /// climb, and all errors of [`drive_rough`].
    pub fn drive_on(self, vehicle: &Vehicle, road: &Road) -> Result<Motion, SimError> {
        let plan = self.rough_plan(vehicle).or_else(|| {
            let plan = self.plan()?;
            let is_flat = plan.surface_line.is_none() && plan.slope.is_none();
            is_flat.then(|| of_flat(plan))
        });
        let Some(plan) = plan else {
            return Err(SimError::OwnGround {
                manoeuvre: self.name(),
                road: road.name().to_owned(),
            });
        };
        let tyres = [&vehicle.front.tyre, &vehicle.rear.tyre];
        let radius_m = tyres[0].unloaded_radius_m.min(tyres[1].unloaded_radius_m);
        (road.check_climb(radius_m)).map_err(|errors| SimError::Model(errors.into()))?;
        let ground = SoftGround::new(road, vehicle);
        let motion = drive_rough(self.name(), vehicle, &ground, &plan)?;
        let ends = |axis: usize| {
            let places = motion.states().iter().map(|state| state.position_m[axis]);
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
                [low.min(at), high.max(at)]
            })
        };
        let class = road.class_in(ends(0), ends(1));
        Ok(motion.with_road_class(class))
    }

    /// What the driver intends on rough ground; none for manoeuvres on a plane.
    fn rough_plan(self, vehicle: &Vehicle) -> Option<RoughPlan> {
        Some(match self {
            Self::RoughRoad => plan(
                42.0,
                |t| 10.0 - 2.1 * math::cos(TAU * t / 30.0),
                // Straight on, then S-curves.
                line(|x| 3.5 * smooth((x - 60.0) / 60.0) * math::sin(TAU * (x - 60.0) / 85.0)),
            ),
            Self::Rocks => plan(
                50.0,
                |t| 4.5 - 1.2 * math::cos(TAU * t / 25.0),
                line(|x| 3.0 * smooth((x - 90.0) / 30.0) * math::sin(TAU * (x - 90.0) / 50.0)),
            ),
            Self::Washboard => plan(
                40.0,
                |t| 4.7 + 7.7 * smooth((t - 2.0) / 36.0),
                line(|_| 0.0),
            ),
            Self::TwistDitch => plan(
                42.0,
                |t| 2.0 - 0.4 * math::cos(TAU * t / 20.0),
                line(|_| 0.0),
            ),
            Self::Jump => plan(34.0, |t| 6.6 + 2.4 * smooth(t / 26.0), line(|_| 0.0)),
            Self::Trail => plan(90.0, trail_speed, line(trail_line)),
            Self::HillsideRough => plan(
                46.0,
                |_| 5.0,
                Course::Curvature(Box::new(|t| smooth((t - 3.0) / 3.0) / 20.0)),
            ),
            Self::Reverse => plan(
                46.0,
                |t| {
                    let forward = 2.5 * (1.0 - smooth((t - 8.0) / 4.0));
                    let back = 2.5 * (smooth((t - 15.0) / 4.0) - smooth((t - 40.0) / 4.0));
                    forward - back
                },
                Course::SteeringWheel(Box::new(|t| 0.9 * math::sin(TAU * t / 16.0))),
            ),
            Self::Tow => RoughPlan {
                hitch: Some(hitch(vehicle)),
                ..plan(
                    40.0,
                    |t| 4.0 + 2.0 * smooth((t - 24.0) / 6.0),
                    line(|x| 2.0 * smooth((x - 40.0) / 30.0) * math::sin(TAU * (x - 40.0) / 60.0)),
                )
            },
            _ => return None,
        })
    }
}

/// A plan that begins at the origin at the speed that is wanted there.
fn plan(duration_s: f64, speed_m_s: impl Fn(f64) -> f64 + 'static, course: Course) -> RoughPlan {
    RoughPlan {
        duration_s,
        rows_per_s: STATES_PER_S,
        start_m: [0.0; 2],
        start_yaw_rad: 0.0,
        start_speed_m_s: speed_m_s(0.0),
        speed_m_s: Box::new(speed_m_s),
        course,
        hitch: None,
    }
}

fn line(north_m: impl Fn(f64) -> f64 + 'static) -> Course {
    Course::Line(Box::new(north_m))
}

/// A plan of level ground, driven on a road.
fn of_flat(flat: Plan) -> RoughPlan {
    let course = match flat.steering {
        Intent::SteeringWheel(angle) => Course::SteeringWheel(Box::new(angle) as Profile),
        Intent::Curvature(path) => Course::Curvature(Box::new(path) as Profile),
    };
    RoughPlan {
        start_speed_m_s: flat.start_speed_m_s,
        ..plan(flat.duration_s, flat.speed_m_s, course)
    }
}

/// Height of the hitch above the design ground, and its distance behind the rear axle, m, of a vehicle whose file has
/// no hitch.
const HITCH_HEIGHT_M: f64 = 0.35;
const HITCH_BEHIND_M: f64 = 0.45;
/// Pull of the load that is towed, N.
const TOW_N: f64 = 400.0;

/// The load pulls back from 6 s on, and from the left after 16 s, as a trailer in a curve does.
fn hitch(vehicle: &Vehicle) -> Hitch {
    let body = &vehicle.body;
    let default_m = [
        -vehicle.wheelbase_m() - HITCH_BEHIND_M,
        body.cg_y_m,
        HITCH_HEIGHT_M,
    ];
    let [x, y, z] = (vehicle.hitch.as_ref()).map_or(default_m, |hitch| hitch.position_m);
    Hitch {
        point_m: [x + body.front_axle_to_cg_m, y - body.cg_y_m, z],
        force_n: Box::new(|t| {
            let pull_n = TOW_N * smooth((t - 6.0) / 2.0);
            let side = 0.25 * smooth((t - 16.0) / 2.0);
            [-pull_n, side * pull_n, -0.1 * pull_n]
        }),
    }
}

/// Speed on the trail: slow over bumps and stones, fast between, braked on gravel.
fn trail_speed(time_s: f64) -> f64 {
    let change =
        |from_s: f64, over_s: f64, by_m_s: f64| by_m_s * smooth((time_s - from_s) / over_s);
    4.0 + change(3.0, 6.0, 4.0)
        + change(11.0, 2.5, -5.0)
        + change(26.0, 6.0, 4.0)
        + change(42.0, 5.0, -2.0)
        + change(58.0, 6.0, 4.4)
        + change(72.0, 3.0, -7.0)
        + change(79.0, 5.0, 5.0)
}

/// Line of the trail, north over east, m.
fn trail_line(east_m: f64) -> f64 {
    2.5 * smooth((east_m - 10.0) / 40.0) * math::sin(TAU * (east_m - 10.0) / 70.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_road_that_ships_is_read() {
        let vehicle = Vehicle::builtin("prowler").expect("a vehicle");
        for manoeuvre in Manoeuvre::ALL {
            let road = manoeuvre.road().unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(road.is_some(), manoeuvre.rough_plan(&vehicle).is_some());
            if let Some(road) = road {
                assert_eq!(road.name(), manoeuvre.name());
                road.check_climb(0.3)
                    .unwrap_or_else(|errors| panic!("{errors}"));
            }
        }
    }
}
