//! The vehicle as a three-dimensional scene, 20 times a second: `/tf` and `/scene`.
//!
//! Frames: `earth` (east, north, up; origin at the start), `vehicle` (origin on the design ground
//! plane below the centre of gravity), `wheel_fl`, `wheel_fr`, `wheel_rl`, `wheel_rr` (wheel carrier).
//! The place in `earth` is dead reckoning from the estimated motion; GNSS velocity gives the heading.
//! It is for pictures, and drifts.

use estimator::{Estimator, WheelPlacement};
use sample::{
    Estimate, ForceFrame, LogTime, Measurement, Motion, NANOS_PER_SECOND, Sample, TyreForce, Wheel,
};
use store::{Form, Record, Scene, SceneEntity, Shape, Transform};

/// Spacing of the messages.
const PERIOD_NS: u64 = NANOS_PER_SECOND as u64 / 20;
/// Spacing of the shapes that do not change, and of the path.
const STILL_NS: u64 = NANOS_PER_SECOND as u64;
/// Longest step of the dead reckoning; across a longer gap the vehicle stands.
const STEP_MAX_S: f64 = 0.1;
/// Speed from which GNSS velocity gives the heading, m/s.
const COURSE_SPEED_M_S: f64 = 2.0;
/// Part of the heading's error that one GNSS velocity removes.
const COURSE_GAIN: f64 = 0.05;
/// Force of an arrow of 1 m, N.
const FORCE_N_M: f64 = 3000.0;
/// Force below which there is no arrow, N.
const FORCE_MIN_N: f64 = 20.0;
/// Distance between points of the path, m, and their largest number.
const PATH_SPACING_M: f64 = 1.0;
const PATH_POINTS: usize = 200;

const EARTH: &str = "earth";
const VEHICLE: &str = "vehicle";
const IDENTITY: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const BODY: [f64; 4] = [0.35, 0.45, 0.6, 0.6];
const TYRE: [f64; 4] = [0.15, 0.15, 0.15, 0.9];
const FORCE: [f64; 4] = [0.9, 0.45, 0.1, 1.0];
const UNCERTAINTY: [f64; 4] = [0.9, 0.45, 0.1, 0.3];
const GROUND: [f64; 4] = [0.45, 0.4, 0.3, 0.5];
const PATH: [f64; 4] = [0.2, 0.6, 0.9, 1.0];

/// Makes the scene from estimates.
#[derive(Debug, Default)]
pub struct SceneMaker {
    /// Heading from east, left positive, rad.
    yaw_rad: f64,
    /// Whether GNSS has given the heading.
    has_course: bool,
    /// Place of the centre of gravity over ground, m.
    place_m: [f64; 2],
    last: Option<LogTime>,
    /// Sideslip and speed of the last estimate.
    moving: [f64; 2],
    /// Numbers of the last periods with messages.
    sent: u64,
    still_sent: u64,
    path: Vec<[f64; 2]>,
}

impl SceneMaker {
    /// Takes a measurement: GNSS velocity corrects the heading.
    pub fn sample(&mut self, sample: &Sample) {
        let Measurement::GnssVelocity(gnss) = &sample.measurement else {
            return;
        };
        let [east, north, _] = gnss.velocity_enu_m_s;
        let [sideslip, speed] = self.moving;
        let moves = math::hypot(east, north) > COURSE_SPEED_M_S && speed > COURSE_SPEED_M_S;
        if !moves || sideslip.is_nan() {
            return;
        }
        let error = wrapped(math::atan2(north, east) - sideslip - self.yaw_rad);
        if self.has_course {
            self.yaw_rad = wrapped(self.yaw_rad + COURSE_GAIN * error);
        } else {
            // The path so far turns with the vehicle.
            let (sin, cos) = math::sin_cos(error);
            for [x, y] in self.path.iter_mut().chain([&mut self.place_m]) {
                (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
            }
            self.yaw_rad = wrapped(self.yaw_rad + error);
            self.has_course = true;
        }
    }

    /// Takes the newest estimates of `records`, the last of which is the estimator's state, and
    /// appends the messages that are due.
    pub fn advance(&mut self, estimator: &Estimator, from: usize, records: &mut Vec<Record>) {
        let mut newest = None;
        for record in &records[from..] {
            if let Record::Estimate(estimate) = record {
                self.reckon(estimate.time, &estimate.motion);
                newest = Some(estimate);
            }
        }
        let Some(estimate) = newest.filter(|e| e.time.0 / PERIOD_NS > self.sent) else {
            return;
        };
        self.sent = estimate.time.0 / PERIOD_NS;
        let motion = &estimate.motion;
        if motion.roll_rad.is_nan() || motion.pitch_rad.is_nan() {
            return;
        }
        let wheels = estimator.wheel_placements(&motion.steer_rad);
        let transforms = Record::Transforms {
            time: estimate.time,
            transforms: self.transforms(motion, estimator.cg_height_m(), &wheels.0),
        };
        let is_still_due = estimate.time.0 / STILL_NS > self.still_sent;
        self.still_sent = estimate.time.0 / STILL_NS;
        let scene = Record::Scene(self.scene(estimate, &wheels.0, is_still_due));
        records.extend([transforms, scene]);
    }

    /// Dead reckoning to the time of an estimate.
    fn reckon(&mut self, time: LogTime, motion: &Motion) {
        let last = self.last.replace(time);
        self.moving = [motion.sideslip_rad, motion.velocity_x_m_s];
        let step_s = last.map_or(0.0, |last| time.seconds_since(last));
        let [_, q, r] = motion.rate_rad_s;
        let [vx, vy] = [motion.velocity_x_m_s, motion.velocity_y_m_s];
        let values = [q, r, vx, motion.roll_rad, motion.pitch_rad];
        if step_s > STEP_MAX_S || values.iter().any(|value| value.is_nan()) {
            return;
        }
        let vy = if vy.is_nan() { 0.0 } else { vy };
        let (sin_roll, cos_roll) = math::sin_cos(motion.roll_rad);
        let (sin_pitch, cos_pitch) = math::sin_cos(motion.pitch_rad);
        self.yaw_rad =
            wrapped(self.yaw_rad + step_s * (sin_roll * q + cos_roll * r) / cos_pitch.max(0.1));
        let forward = cos_pitch * vx + sin_pitch * sin_roll * vy;
        let left = cos_roll * vy;
        let (sin, cos) = math::sin_cos(self.yaw_rad);
        self.place_m[0] += step_s * (cos * forward - sin * left);
        self.place_m[1] += step_s * (sin * forward + cos * left);
        let [x, y] = self.place_m;
        let is_far = |[px, py]: &[f64; 2]| math::hypot(x - px, y - py) >= PATH_SPACING_M;
        if self.path.last().is_none_or(is_far) {
            if self.path.len() == PATH_POINTS {
                self.path.remove(0);
            }
            self.path.push(self.place_m);
        }
    }

    fn transforms(
        &self,
        motion: &Motion,
        cg_height_m: f64,
        wheels: &[WheelPlacement; 4],
    ) -> Vec<Transform> {
        let rotation = body_rotation(self.yaw_rad, motion.pitch_rad, motion.roll_rad);
        // The centre of gravity stays at its height; the body turns about it.
        let [dx, dy, dz] = rotated(rotation, [0.0, 0.0, -cg_height_m]);
        let [x, y] = self.place_m;
        let body = Transform {
            parent: EARTH.to_owned(),
            child: VEHICLE.to_owned(),
            translation_m: [x + dx, y + dy, cg_height_m + dz],
            rotation_xyzw: rotation,
        };
        let wheels = Wheel::ALL.into_iter().zip(wheels);
        let wheels = wheels.map(|(wheel, placement)| Transform {
            parent: VEHICLE.to_owned(),
            child: wheel_frame(wheel),
            translation_m: placement.centre_m,
            rotation_xyzw: placement.carrier_xyzw,
        });
        std::iter::once(body).chain(wheels).collect()
    }

    fn scene(&self, estimate: &Estimate, wheels: &[WheelPlacement; 4], with_still: bool) -> Scene {
        let mut entities = Vec::new();
        for (wheel, placement) in Wheel::ALL.into_iter().zip(wheels) {
            let force = &estimate.forces(ForceFrame::WheelCarrier)[wheel];
            entities.push(SceneEntity {
                id: format!("force_{}", name(wheel)),
                frame: wheel_frame(wheel),
                shapes: force_shapes(force, placement.radius_m),
            });
            entities.push(SceneEntity {
                id: format!("ground_{}", name(wheel)),
                frame: VEHICLE.to_owned(),
                shapes: vec![Shape {
                    form: Form::Box {
                        size_m: [0.6, 0.5, 0.01],
                    },
                    position_m: placement.contact_m,
                    rotation_xyzw: placement.ground_xyzw,
                    colour_rgba: GROUND,
                }],
            });
            if with_still {
                entities.push(tyre(wheel, placement));
            }
        }
        if with_still {
            entities.push(body(wheels));
            entities.push(self.path_line());
        }
        Scene {
            time: estimate.time,
            entities,
        }
    }

    fn path_line(&self) -> SceneEntity {
        let points = self.path.iter().chain([&self.place_m]);
        SceneEntity {
            id: "path".to_owned(),
            frame: EARTH.to_owned(),
            shapes: vec![Shape {
                form: Form::Line {
                    points_m: points.map(|[x, y]| [*x, *y, 0.0]).collect(),
                    thickness_px: 3.0,
                },
                position_m: [0.0; 3],
                rotation_xyzw: IDENTITY,
                colour_rgba: PATH,
            }],
        }
    }
}

fn name(wheel: Wheel) -> String {
    wheel.abbreviation().to_ascii_lowercase()
}

fn wheel_frame(wheel: Wheel) -> String {
    format!("wheel_{}", name(wheel))
}

/// Arrow of a force on the tyre, and an ellipsoid of one standard deviation at its tip. No shape of an
/// unknown force.
fn force_shapes(force: &TyreForce, radius_m: f64) -> Vec<Shape> {
    let [x, y, z] = force.force_n;
    let size_n = math::hypot(math::hypot(x, y), z);
    if size_n.is_nan() || size_n < FORCE_MIN_N {
        return Vec::new();
    }
    let tail = [0.0, 0.0, -radius_m];
    let mut shapes = vec![Shape {
        form: Form::Arrow {
            length_m: size_n / FORCE_N_M,
            diameter_m: 0.05,
        },
        position_m: tail,
        rotation_xyzw: rotation_from_x([x / size_n, y / size_n, z / size_n]),
        colour_rgba: FORCE,
    }];
    if force.sigma_n.iter().all(|sigma| sigma.is_finite()) {
        let tip = |i: usize| tail[i] + force.force_n[i] / FORCE_N_M;
        shapes.push(Shape {
            form: Form::Ellipsoid {
                size_m: force.sigma_n.map(|sigma| 2.0 * sigma / FORCE_N_M),
            },
            position_m: [tip(0), tip(1), tip(2)],
            rotation_xyzw: IDENTITY,
            colour_rgba: UNCERTAINTY,
        });
    }
    shapes
}

fn tyre(wheel: Wheel, placement: &WheelPlacement) -> SceneEntity {
    let diameter = 2.0 * placement.radius_m;
    let width = if placement.width_m > 0.0 {
        placement.width_m
    } else {
        0.4 * diameter
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    SceneEntity {
        id: format!("tyre_{}", name(wheel)),
        frame: wheel_frame(wheel),
        shapes: vec![Shape {
            form: Form::Cylinder {
                size_m: [diameter, diameter, width],
            },
            position_m: [0.0; 3],
            // The cylinder's z axis is the spindle.
            rotation_xyzw: [half, 0.0, 0.0, half],
            colour_rgba: TYRE,
        }],
    }
}

/// A box between the wheels.
fn body(wheels: &[WheelPlacement; 4]) -> SceneEntity {
    let [front, rear] = [wheels[0].centre_m[0], wheels[2].centre_m[0]];
    let width = wheels[0].centre_m[1] - wheels[1].centre_m[1];
    let radius = wheels[0].radius_m;
    SceneEntity {
        id: "body".to_owned(),
        frame: VEHICLE.to_owned(),
        shapes: vec![Shape {
            form: Form::Box {
                size_m: [front - rear, 0.6 * width, 1.6 * radius],
            },
            position_m: [0.5 * (front + rear), 0.0, 2.0 * radius],
            rotation_xyzw: IDENTITY,
            colour_rgba: BODY,
        }],
    }
}

/// An angle in [-π, π].
fn wrapped(angle: f64) -> f64 {
    let (sin, cos) = math::sin_cos(angle);
    math::atan2(sin, cos)
}

/// Rotation that takes vehicle axes to earth axes: yaw, then pitch, then roll.
fn body_rotation(yaw: f64, pitch: f64, roll: f64) -> [f64; 4] {
    let [(sy, cy), (sp, cp), (sr, cr)] = [yaw, pitch, roll].map(|a| math::sin_cos(0.5 * a));
    [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
}

/// Rotation that takes the x axis to a unit vector.
fn rotation_from_x([x, y, z]: [f64; 3]) -> [f64; 4] {
    // Half-way between both: axis (0, -z, y), 1 + cos.
    let w = 1.0 + x;
    if w < 1e-9 {
        return [0.0, 0.0, 1.0, 0.0];
    }
    let norm = (w * w + z * z + y * y).sqrt();
    [0.0, -z / norm, y / norm, w / norm]
}

/// A vector in the axes that the quaternion rotates to.
fn rotated([qx, qy, qz, qw]: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let axis = [qx, qy, qz];
    let t = cross(axis, [x, y, z]).map(|v| 2.0 * v);
    let u = cross(axis, t);
    [
        x + qw * t[0] + u[0],
        y + qw * t[1] + u[1],
        z + qw * t[2] + u[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: [f64; 3], b: [f64; 3]) {
        for (a, b) in a.into_iter().zip(b) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn rotations_follow_the_signs_of_the_axes() {
        let quarter = std::f64::consts::FRAC_PI_2;
        // Yaw left takes forward to north (left of east).
        near(
            rotated(body_rotation(quarter, 0.0, 0.0), [1.0, 0.0, 0.0]),
            [0.0, 1.0, 0.0],
        );
        // Nose down takes forward down.
        near(
            rotated(body_rotation(0.0, quarter, 0.0), [1.0, 0.0, 0.0]),
            [0.0, 0.0, -1.0],
        );
        // Right side down takes left up.
        near(
            rotated(body_rotation(0.0, 0.0, quarter), [0.0, 1.0, 0.0]),
            [0.0, 0.0, 1.0],
        );
        for unit in [[0.0, 0.6, 0.8], [-1.0, 0.0, 0.0], [0.36, -0.48, 0.8]] {
            near(rotated(rotation_from_x(unit), [1.0, 0.0, 0.0]), unit);
        }
    }

    fn motion(speed: f64, yaw_rate: f64) -> Motion {
        Motion {
            velocity_x_m_s: speed,
            rate_rad_s: [0.0, 0.0, yaw_rate],
            ..Motion::default()
        }
    }

    /// A circle of 10 m/s and 0.5 rad/s has a radius of 20 m.
    #[test]
    fn dead_reckoning_closes_a_circle() {
        let mut scene = SceneMaker::default();
        let turn_s = std::f64::consts::TAU / 0.5;
        let steps = (turn_s / 0.01).round() as u64;
        let mut farthest: f64 = 0.0;
        for step in 0..=steps {
            scene.reckon(LogTime(step * 10_000_000), &motion(10.0, 0.5));
            let [x, y] = scene.place_m;
            farthest = farthest.max(math::hypot(x, y));
        }
        let [x, y] = scene.place_m;
        assert!(math::hypot(x, y) < 0.2, "{x} {y}");
        assert!((farthest - 40.0).abs() < 0.2, "{farthest}");
        assert!(scene.path.len() > 100);
    }

    #[test]
    fn the_vehicle_stands_across_a_gap() {
        let mut scene = SceneMaker::default();
        scene.reckon(LogTime(0), &motion(10.0, 0.0));
        scene.reckon(LogTime(60_000_000_000), &motion(10.0, 0.0));
        assert_eq!(scene.place_m, [0.0; 2]);
    }
}
