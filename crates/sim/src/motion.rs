mod ground;
mod wheel;

use model::road::RoadClass;
use model::vehicle::Vehicle;
use nalgebra::{Matrix3, Rotation3, Vector3};
use sample::{ForceFrame, ForceSource, PerWheel, TyreForce};

use crate::SimError;
use crate::linkage::{Linkage, struts_alone};
use crate::slope::Slope;

pub use ground::WheelGround;
pub(crate) use ground::{spindle, spindle_on_ground, unit};
pub use wheel::WheelMotion;

/// Everything that is true at one instant. `NaN` stands for what the motion does not tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthState {
    /// Seconds since the motion's start.
    pub time_s: f64,
    /// Position of the centre of gravity from the motion's origin on the ground: east, north,
    /// up, m.
    pub position_m: [f64; 3],
    /// Roll, right side down positive, rad.
    pub roll_rad: f64,
    /// Pitch, nose down positive, rad.
    pub pitch_rad: f64,
    /// Yaw from east, left positive, unwrapped, rad.
    pub yaw_rad: f64,
    /// Velocity of the centre of gravity, body axes, m/s.
    pub velocity_body_m_s: [f64; 3],
    /// Angular rate, body axes, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Angular acceleration, body axes, rad/s^2.
    pub rate_derivative_rad_s2: [f64; 3],
    /// Specific force at the centre of gravity, body axes, m/s^2 (+g along z at rest).
    pub specific_force_m_s2: [f64; 3],
    /// Acceleration of the centre of gravity without gravity, body axes, m/s^2.
    pub acceleration_m_s2: [f64; 3],
    /// Steering-wheel angle, left positive, rad.
    pub steering_wheel_rad: f64,
    /// Bank of the ground, right side down positive, rad.
    pub bank_rad: f64,
    /// Grade of the ground, nose down positive, rad.
    pub grade_rad: f64,
    /// Force of a load on the hitch, body axes, N; `None` without one.
    pub hitch_force_n: Option<[f64; 3]>,
    /// Each corner.
    pub wheels: PerWheel<WheelTruth>,
}

/// What is true at one corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelTruth {
    /// Force of the ground on the tyre, contact frame, N.
    pub force_n: [f64; 3],
    /// Moment of the ground on the tyre about the contact point, contact frame, N m.
    pub moment_n_m: [f64; 3],
    /// Angular speed, forward positive, rad/s.
    pub angular_speed_rad_s: f64,
    /// Steer angle of the wheel, left positive, rad.
    pub steer_rad: f64,
    /// Displacement of the inner end of the tie rod beside the rack's, by toe compliance and play, m, left
    /// positive.
    pub rod_shift_m: f64,
    /// Tyre slip angle, rad.
    pub slip_angle_rad: f64,
    /// Longitudinal slip; `NaN` where the motion does not tell it.
    pub longitudinal_slip: f64,
    /// Friction coefficient below the tyre.
    pub friction: f64,
    /// Length of the strut between its mounts, m.
    pub strut_length_m: f64,
    /// Axial force, tension positive, N: upper front, upper rear, lower front and lower rear tube
    /// (lower ones outboard of the strut's mount), tie rod.
    pub link_force_n: [f64; 5],
    /// Force of the upright on the lower arm at the ball joint, chassis axes, N.
    pub lower_ball_force_n: [f64; 3],
    /// Position of the lower ball joint, chassis axes from the point on the design ground below
    /// the centre of gravity, m.
    pub lower_ball_m: [f64; 3],
    /// The part of that force that is normal to the lower arm's plane, upward positive, N.
    pub ball_normal_n: f64,
    /// Bending moments of the tube of a live axle at its section about the axle's x and z axes, of the outboard part
    /// on the rest, N m.
    pub tube_bending_n_m: [f64; 2],
    /// The wheel on its ground, if the motion tells it.
    pub ground: Option<WheelGround>,
    /// How the wheel moves over the earth, if the motion tells it.
    pub motion: Option<WheelMotion>,
}

impl Default for WheelTruth {
    fn default() -> Self {
        Self {
            force_n: [f64::NAN; 3],
            moment_n_m: [f64::NAN; 3],
            angular_speed_rad_s: f64::NAN,
            steer_rad: f64::NAN,
            rod_shift_m: 0.0,
            slip_angle_rad: f64::NAN,
            longitudinal_slip: f64::NAN,
            friction: f64::NAN,
            strut_length_m: f64::NAN,
            link_force_n: [f64::NAN; 5],
            lower_ball_force_n: [f64::NAN; 3],
            lower_ball_m: [f64::NAN; 3],
            ball_normal_n: f64::NAN,
            tube_bending_n_m: [f64::NAN; 2],
            ground: None,
            motion: None,
        }
    }
}

impl Default for TruthState {
    /// At rest and level; what a motion may leave out is `NaN`.
    fn default() -> Self {
        Self {
            time_s: 0.0,
            position_m: [0.0; 3],
            roll_rad: 0.0,
            pitch_rad: 0.0,
            yaw_rad: 0.0,
            velocity_body_m_s: [0.0; 3],
            rate_rad_s: [0.0; 3],
            rate_derivative_rad_s2: [0.0; 3],
            specific_force_m_s2: [0.0, 0.0, sample::STANDARD_GRAVITY_M_S2],
            acceleration_m_s2: [0.0; 3],
            steering_wheel_rad: 0.0,
            bank_rad: 0.0,
            grade_rad: 0.0,
            hitch_force_n: None,
            wheels: PerWheel([WheelTruth::default(); 4]),
        }
    }
}

impl TruthState {
    /// The motion in the form that the estimator publishes, without standard deviations.
    #[must_use]
    pub fn motion(&self) -> sample::Motion {
        let [velocity_x_m_s, velocity_y_m_s, _] = self.velocity_body_m_s;
        let [forward, leftward] = self.velocity_along_ground_m_s();
        sample::Motion {
            velocity_x_m_s,
            velocity_y_m_s,
            sideslip_rad: if math::hypot(forward, leftward) > 0.0 {
                math::atan2(leftward, forward)
            } else {
                0.0
            },
            sideslip_sigma_rad: f64::NAN,
            roll_rad: self.roll_rad,
            pitch_rad: self.pitch_rad,
            rate_rad_s: self.rate_rad_s,
            acceleration_m_s2: self.acceleration_m_s2,
            steer_rad: PerWheel::from_fn(|wheel| self.wheels[wheel].steer_rad),
            slip_angle_rad: PerWheel::from_fn(|wheel| self.wheels[wheel].slip_angle_rad),
            longitudinal_slip: PerWheel::from_fn(|wheel| self.wheels[wheel].longitudinal_slip),
            longitudinal_slip_sigma: PerWheel([f64::NAN; 4]),
            bank_rad: self.bank_rad,
            grade_rad: self.grade_rad,
        }
    }

    /// The tyre forces in the contact frame, in the form that the estimator publishes, without standard
    /// deviations.
    #[must_use]
    pub fn tyre_forces(&self) -> PerWheel<TyreForce> {
        PerWheel::from_fn(|wheel| TyreForce {
            force_n: self.wheels[wheel].force_n,
            source: ForceSource::Model,
            ..TyreForce::default()
        })
    }

    /// The same with the moments about the wheel centre in the wheel-carrier frame; `None` unless the
    /// motion tells all wheels on their ground.
    #[must_use]
    pub fn carrier_forces(&self) -> Option<PerWheel<TyreForce>> {
        let all = self.wheels.0.map(|wheel| {
            let ground = wheel.ground?;
            let moment = ground.moment_n_m(ForceFrame::WheelCarrier);
            Some(TyreForce {
                force_n: ground.force_n(ForceFrame::WheelCarrier),
                moment_n_m: moment.unwrap_or([f64::NAN; 3]),
                source: ForceSource::Model,
                ..TyreForce::default()
            })
        });
        let known: Vec<TyreForce> = all.into_iter().flatten().collect();
        known.try_into().ok().map(PerWheel)
    }

    /// Friction coefficient of the ground under each wheel, where the motion tells it.
    #[must_use]
    pub fn friction(&self) -> Option<PerWheel<f64>> {
        let friction = PerWheel::from_fn(|wheel| self.wheels[wheel].friction);
        friction.0.iter().all(|f| f.is_finite()).then_some(friction)
    }

    /// Rotation of vectors from body axes into earth axes (east, north, up): yaw, then pitch, then
    /// roll.
    #[must_use]
    pub fn earth_from_body(&self) -> Rotation3<f64> {
        let (sr, cr) = math::sin_cos(self.roll_rad);
        let (sp, cp) = math::sin_cos(self.pitch_rad);
        let (sy, cy) = math::sin_cos(self.yaw_rad);
        Rotation3::from_matrix_unchecked(Matrix3::new(
            cy * cp,
            cy * sp * sr - sy * cr,
            cy * sp * cr + sy * sr,
            sy * cp,
            sy * sp * sr + cy * cr,
            sy * sp * cr - cy * sr,
            -sp,
            cp * sr,
            cp * cr,
        ))
    }

    /// The direction up, a unit vector in body axes.
    #[must_use]
    pub fn up_body(&self) -> Vector3<f64> {
        self.earth_from_body().matrix().row(2).transpose()
    }

    /// Normal of the plane that bank and grade describe, a unit vector in body axes.
    #[must_use]
    pub fn ground_normal_body(&self) -> Vector3<f64> {
        let normal = Rotation3::from_euler_angles(self.bank_rad, self.grade_rad, self.yaw_rad)
            * Vector3::z();
        self.earth_from_body().inverse() * normal
    }

    /// Velocity along the heading and to its left, both in the horizontal plane, m/s.
    fn velocity_along_ground_m_s(&self) -> [f64; 2] {
        let [x, y, z] = self.velocity_body_m_s;
        let (sr, cr) = math::sin_cos(self.roll_rad);
        let (sp, cp) = math::sin_cos(self.pitch_rad);
        [cp * x + sp * (sr * y + cr * z), cr * y - sr * z]
    }

    /// The state between `a` (weight 0) and `b` (weight 1), each member linear.
    fn between(a: &Self, b: &Self, weight: f64) -> Self {
        let l = |x: f64, y: f64| x + (y - x) * weight;
        Self {
            time_s: l(a.time_s, b.time_s),
            position_m: mix(&a.position_m, &b.position_m, weight),
            roll_rad: l(a.roll_rad, b.roll_rad),
            pitch_rad: l(a.pitch_rad, b.pitch_rad),
            yaw_rad: l(a.yaw_rad, b.yaw_rad),
            velocity_body_m_s: mix(&a.velocity_body_m_s, &b.velocity_body_m_s, weight),
            rate_rad_s: mix(&a.rate_rad_s, &b.rate_rad_s, weight),
            rate_derivative_rad_s2: mix(
                &a.rate_derivative_rad_s2,
                &b.rate_derivative_rad_s2,
                weight,
            ),
            specific_force_m_s2: mix(&a.specific_force_m_s2, &b.specific_force_m_s2, weight),
            acceleration_m_s2: mix(&a.acceleration_m_s2, &b.acceleration_m_s2, weight),
            steering_wheel_rad: l(a.steering_wheel_rad, b.steering_wheel_rad),
            bank_rad: l(a.bank_rad, b.bank_rad),
            grade_rad: l(a.grade_rad, b.grade_rad),
            hitch_force_n: (a.hitch_force_n.as_ref().zip(b.hitch_force_n.as_ref()))
                .map(|(a, b)| mix(a, b, weight)),
            wheels: PerWheel::from_fn(|wheel| {
                WheelTruth::between(&a.wheels[wheel], &b.wheels[wheel], weight)
            }),
        }
    }
}

impl WheelTruth {
    fn between(a: &Self, b: &Self, weight: f64) -> Self {
        let l = |x: f64, y: f64| x + (y - x) * weight;
        Self {
            force_n: mix(&a.force_n, &b.force_n, weight),
            moment_n_m: mix(&a.moment_n_m, &b.moment_n_m, weight),
            angular_speed_rad_s: l(a.angular_speed_rad_s, b.angular_speed_rad_s),
            steer_rad: l(a.steer_rad, b.steer_rad),
            rod_shift_m: l(a.rod_shift_m, b.rod_shift_m),
            slip_angle_rad: l(a.slip_angle_rad, b.slip_angle_rad),
            longitudinal_slip: l(a.longitudinal_slip, b.longitudinal_slip),
            friction: l(a.friction, b.friction),
            strut_length_m: l(a.strut_length_m, b.strut_length_m),
            link_force_n: mix(&a.link_force_n, &b.link_force_n, weight),
            lower_ball_force_n: mix(&a.lower_ball_force_n, &b.lower_ball_force_n, weight),
            lower_ball_m: mix(&a.lower_ball_m, &b.lower_ball_m, weight),
            ball_normal_n: l(a.ball_normal_n, b.ball_normal_n),
            tube_bending_n_m: mix(&a.tube_bending_n_m, &b.tube_bending_n_m, weight),
            ground: (a.ground.as_ref().zip(b.ground.as_ref()))
                .map(|(a, b)| WheelGround::between(a, b, weight)),
            motion: (a.motion.as_ref().zip(b.motion.as_ref()))
                .map(|(a, b)| WheelMotion::between(a, b, weight)),
        }
    }
}

fn mix<const N: usize>(a: &[f64; N], b: &[f64; N], weight: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * weight)
}

/// A motion: states in time order, linear in between, driven once or several times on end.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    name: String,
    states: Vec<TruthState>,
    /// Where each lap begins: east, north, m.
    lap_starts_m: Vec<[f64; 2]>,
    /// What a person notes on the way: seconds from the start, text.
    marks: Vec<(f64, String)>,
    tips_over: bool,
    road_class: Option<RoadClass>,
}

impl Motion {
    /// A motion from its states. The first state's time becomes zero, yaw is unwrapped.
    ///
    /// # Errors
    /// Fewer than two states, or times that do not rise.
    pub fn new(name: &str, mut states: Vec<TruthState>) -> Result<Self, SimError> {
        if states.len() < 2 {
            return Err(SimError::TooShort {
                found: states.len(),
            });
        }
        for row in 1..states.len() {
            let (previous_s, time_s) = (states[row - 1].time_s, states[row].time_s);
            let rises = time_s > previous_s;
            if !rises {
                return Err(SimError::TimeOrder {
                    row: row + 1,
                    time_s,
                    previous_s,
                });
            }
            let turn = std::f64::consts::TAU;
            let step = states[row].yaw_rad - states[row - 1].yaw_rad;
            states[row].yaw_rad -= turn * (step / turn).round();
        }
        let start_s = states[0].time_s;
        for state in &mut states {
            state.time_s -= start_s;
        }
        let [east_m, north_m, _] = states[0].position_m;
        Ok(Self {
            name: name.to_owned(),
            states,
            lap_starts_m: vec![[east_m, north_m]],
            marks: Vec::new(),
            tips_over: false,
            road_class: None,
        })
    }

    /// The same motion with marks: seconds from its start, in order, and texts.
    #[must_use]
    pub fn with_marks(mut self, marks: Vec<(f64, String)>) -> Self {
        self.marks = marks;
        self
    }

    /// What a person notes on the way: seconds from the start, in order, and texts.
    #[must_use]
    pub fn marks(&self) -> &[(f64, String)] {
        &self.marks
    }

    /// The same motion `laps` times on end (at least once), each lap beginning where and in the
    /// direction in which the one before ended. It should end as it begins, in speed and steer:
    /// what differs is a jump.
    #[must_use]
    pub fn repeated(mut self, laps: u32) -> Self {
        let (first, last) = (&self.states[0], &self.states[self.states.len() - 1]);
        let way = [0, 1].map(|axis| last.position_m[axis] - first.position_m[axis]);
        let mut start = self.lap_starts_m[0];
        self.lap_starts_m = (0..laps.max(1))
            .map(|lap| {
                let this = start;
                start = ahead(this, self.lap_turn_rad() * f64::from(lap), way);
                this
            })
            .collect();
        self
    }

    /// The same motion on a slope, where it was one in the slope's own axes.
    pub(crate) fn laid_on(mut self, slope: &Slope) -> Self {
        for state in &mut self.states {
            slope.lay(state);
        }
        let [east_m, north_m, _] = self.states[0].position_m;
        self.lap_starts_m = vec![[east_m, north_m]];
        self
    }

    /// The same motion, which ends because the vehicle tips over, or not.
    pub(crate) fn with_end(mut self, tips_over: bool) -> Self {
        self.tips_over = tips_over;
        self
    }

    /// Whether the motion ended before its time because the vehicle tipped over.
    #[must_use]
    pub fn tips_over(&self) -> bool {
        self.tips_over
    }

    /// The same motion on a road of this class, if the road has one.
    pub(crate) fn with_road_class(mut self, class: Option<RoadClass>) -> Self {
        self.road_class = class;
        self
    }

    /// Class of the road by ISO 8608, if the whole way has one.
    #[must_use]
    pub fn road_class(&self) -> Option<RoadClass> {
        self.road_class
    }

    /// The manoeuvre's or the file's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Seconds from the first to the last state, over all laps.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.lap_s() * f64::from(self.laps())
    }

    /// The states of the first lap, the first at time zero.
    #[must_use]
    pub fn states(&self) -> &[TruthState] {
        &self.states
    }

    /// The state at a time; before the start the first one, after the end the last one.
    #[must_use]
    pub fn at(&self, time_s: f64) -> TruthState {
        let lap = self.lap_at(time_s);
        let state = match self.place(time_s) {
            (row, None) => self.states[row],
            (row, Some(weight)) => {
                TruthState::between(&self.states[row], &self.states[row + 1], weight)
            }
        };
        self.on_lap(state, lap)
    }

    /// Where a time lies among the states of a lap: the row before it, and how far to the next one;
    /// none before the first and behind the last one.
    pub(crate) fn place(&self, time_s: f64) -> (usize, Option<f64>) {
        let local_s = time_s - f64::from(self.lap_at(time_s)) * self.lap_s();
        let after = self.states.partition_point(|state| state.time_s <= local_s);
        match (after.checked_sub(1), self.states.get(after)) {
            (None, _) => (0, None),
            (Some(last), None) => (last, None),
            (Some(before), Some(b)) => {
                let a = &self.states[before];
                (before, Some((local_s - a.time_s) / (b.time_s - a.time_s)))
            }
        }
    }

    /// The state number `row`, counted over all laps; a lap's last state is the next one's first.
    pub(crate) fn row(&self, row: usize) -> Option<TruthState> {
        let steps = self.states.len() - 1;
        let (lap, local) = (row / steps, row % steps);
        match u32::try_from(lap) {
            Ok(lap) if lap < self.laps() => Some(self.on_lap(self.states[local], lap)),
            Ok(lap) if lap == self.laps() && local == 0 => {
                Some(self.on_lap(self.states[steps], lap - 1))
            }
            _ => None,
        }
    }

    /// The lap at a time; before the start the first one, after the end the last one.
    fn lap_at(&self, time_s: f64) -> u32 {
        // The cast takes negative numbers and NaN to 0.
        ((time_s / self.lap_s()).floor() as u32).min(self.laps() - 1)
    }

    fn lap_s(&self) -> f64 {
        self.states.last().map_or(0.0, |state| state.time_s)
    }

    fn laps(&self) -> u32 {
        self.lap_starts_m.len() as u32
    }

    /// How far one lap turns, rad.
    fn lap_turn_rad(&self) -> f64 {
        self.states[self.states.len() - 1].yaw_rad - self.states[0].yaw_rad
    }

    /// A state of the first lap as one of a later lap.
    fn on_lap(&self, mut state: TruthState, lap: u32) -> TruthState {
        let turn_rad = self.lap_turn_rad() * f64::from(lap);
        if lap > 0 {
            let first = &self.states[0];
            let place = |at: [f64; 2]| {
                let own = [0, 1].map(|axis| at[axis] - first.position_m[axis]);
                ahead(self.lap_starts_m[lap as usize], turn_rad, own)
            };
            let [east_m, north_m, _] = state.position_m;
            [state.position_m[0], state.position_m[1]] = place([east_m, north_m]);
            for wheel in state
                .wheels
                .0
                .iter_mut()
                .flat_map(|wheel| &mut wheel.motion)
            {
                wheel.on_lap(place, turn_rad);
            }
        }
        state.yaw_rad += turn_rad;
        state.time_s += self.lap_s() * f64::from(lap);
        state
    }

    /// Fills in from the vehicle's linkage what the states do not tell: the ball-joint force's
    /// part that bends the lower arm, and, computed forward from the tyre forces, strut lengths,
    /// link forces and steer angles. A vehicle without hard-points leaves link forces unknown; its
    /// strut lengths follow from the motion ratio, where there is one.
    ///
    /// # Errors
    /// A linkage that cannot stand as the motion says.
    pub fn complete(&mut self, vehicle: &Vehicle) -> Result<(), SimError> {
        match Linkage::new(vehicle)? {
            Some(linkage) => linkage.complete(&mut self.states)?,
            None => struts_alone(vehicle, &mut self.states),
        }
        Ok(())
    }

    /// Whether every state tells the axial forces of all links: of a double wishbone, of a MacPherson strut, or of both
    /// links of a live axle.
    #[must_use]
    pub fn has_link_forces(&self) -> bool {
        self.states.iter().all(|state| {
            state.wheels.0.iter().all(|wheel| {
                let [upper, _, lower, ..] = wheel.link_force_n;
                let is_live = wheel.tube_bending_n_m.iter().all(|m| m.is_finite());
                wheel.link_force_n.iter().all(|f| f.is_finite())
                    || is_live && upper.is_finite() && lower.is_finite()
            })
        })
    }
}

/// The point that lies `way` from `start`, once the way is turned left.
fn ahead(start: [f64; 2], turn_rad: f64, way: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = math::sin_cos(turn_rad);
    [
        start[0] + cos * way[0] - sin * way[1],
        start[1] + sin * way[0] + cos * way[1],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_time(time_s: f64, yaw_rad: f64) -> TruthState {
        TruthState {
            time_s,
            yaw_rad,
            ..TruthState::default()
        }
    }

    /// ISO 8855: a rolled and pitched body that moves along its heading does not slip sideways.
    #[test]
    fn sideslip_is_that_of_the_horizontal_plane() {
        let mut state = TruthState {
            roll_rad: 0.2,
            pitch_rad: 0.03,
            yaw_rad: 0.7,
            ..TruthState::default()
        };
        let (sin, cos) = math::sin_cos(state.yaw_rad + 0.1);
        let body_from_earth = state.earth_from_body().inverse();
        state.velocity_body_m_s = (body_from_earth * Vector3::new(cos, sin, 0.0)).into();
        assert!((state.motion().sideslip_rad - 0.1).abs() < 1e-12);
    }

    #[test]
    fn interpolates_and_unwraps_yaw() {
        let motion =
            Motion::new("m", vec![at_time(5.0, 3.1), at_time(6.0, -3.1)]).expect("two states");
        assert_eq!(motion.duration_s(), 1.0);
        let middle = motion.at(0.5);
        assert!((middle.yaw_rad - std::f64::consts::PI).abs() < 1e-12);
        assert_eq!(motion.at(-1.0).yaw_rad, 3.1);
        assert_eq!(motion.at(9.0).time_s, 1.0);
    }

    #[test]
    fn laps_go_on_from_where_the_last_one_ended() {
        let corner = |time_s, east, north, yaw_rad| TruthState {
            position_m: [east, north, 0.5],
            ..at_time(time_s, yaw_rad)
        };
        // One side of a square: 10 m ahead, then a quarter turn to the left.
        let side = vec![
            corner(0.0, 1.0, 2.0, 0.0),
            corner(1.0, 11.0, 2.0, 0.0),
            corner(2.0, 11.0, 2.0, std::f64::consts::FRAC_PI_2),
        ];
        let square = Motion::new("square", side).expect("a motion").repeated(4);
        assert_eq!(square.duration_s(), 8.0);
        for (time_s, east, north) in [(1.0, 11.0, 2.0), (3.0, 11.0, 12.0), (4.5, 6.0, 12.0)] {
            let found = square.at(time_s);
            assert!((found.position_m[0] - east).abs() < 1e-12, "{found:?}");
            assert!((found.position_m[1] - north).abs() < 1e-12, "{found:?}");
            assert_eq!(found.time_s, time_s);
        }
        let end = square.at(8.0);
        assert!((end.position_m[0] - 1.0).abs() < 1e-12 && end.time_s == 8.0);
        let rows: Vec<f64> = (0..)
            .map_while(|row| square.row(row))
            .map(|s| s.time_s)
            .collect();
        assert_eq!(rows, (0..=8).map(f64::from).collect::<Vec<_>>());
    }

    #[test]
    fn refuses_time_that_does_not_rise() {
        assert!(matches!(
            Motion::new("m", vec![at_time(1.0, 0.0), at_time(1.0, 0.0)]),
            Err(SimError::TimeOrder { row: 2, .. })
        ));
        assert!(Motion::new("m", vec![at_time(0.0, 0.0), at_time(f64::NAN, 0.0)]).is_err());
        assert!(matches!(
            Motion::new("m", vec![]),
            Err(SimError::TooShort { found: 0 })
        ));
    }
}
