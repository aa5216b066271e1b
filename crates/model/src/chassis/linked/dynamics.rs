//! Equations of motion.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};

use super::parameters::Outboard;
use super::tyres::{Torques, TyreForces};
use super::{Inputs, Parameters, STATES, State};
use crate::Error;
use crate::road::{Ground, GroundContact};
use crate::suspension::linkage::{Coordinates, OutboardPart};
use crate::suspension::{StrutForce, SuspensionError};

/// What one wheel does. Vectors in vehicle axes unless another frame is stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelOutputs {
    /// Contact with the ground, earth axes.
    pub contact: GroundContact,
    /// Axes of the contact frame: ahead in the wheel plane, to the left, along the ground's normal.
    pub vehicle_from_contact: Matrix3<f64>,
    /// Force of the ground on the tyre, contact frame, N.
    pub force_n: Vector3<f64>,
    /// Moment of the ground on the tyre about the contact point, contact frame, N m.
    pub moment_n_m: Vector3<f64>,
    /// Moment of the ground on the tyre about the wheel centre, N m.
    pub centre_moment_n_m: Vector3<f64>,
    /// Power that the ground's force and moment do on the wheel, W.
    pub tyre_power_w: f64,
    /// Tangent of the slip angle that the tyre sees.
    pub slip_tangent: f64,
    /// Longitudinal slip that the tyre sees.
    pub slip_ratio: f64,
    /// Spin against the carrier: what a wheel-speed sensor reads, rad/s.
    pub spin_rad_s: f64,
    /// Torque of a half-shaft on the wheel, reacted by the chassis, N m.
    pub axle_torque_n_m: f64,
    /// Wheel centre, m.
    pub centre_m: Vector3<f64>,
    /// Unit vector of the spindle.
    pub spindle: Vector3<f64>,
    /// Velocity of the wheel centre over the earth, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Acceleration of the wheel centre over the earth, without gravity, m/s^2.
    pub acceleration_m_s2: Vector3<f64>,
    /// Mass times acceleration of wheel and carrier, N.
    pub inertia_n: Vector3<f64>,
    /// Force of spring, damper and stops, N.
    pub strut: StrutForce,
}

/// What the vehicle does at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// Rate of the state.
    pub rate: State,
    /// Specific force at the sprung part's centre of gravity, vehicle axes, m/s^2.
    pub specific_force_m_s2: Vector3<f64>,
    /// The wheels.
    pub wheels: [WheelOutputs; 4],
}

/// Rotation of vectors from vehicle axes into earth axes: yaw, then pitch, then roll.
pub(super) fn earth_from_vehicle(state: &State) -> Matrix3<f64> {
    let a = state.attitude_rad;
    Rotation3::from_euler_angles(a.x, a.y, a.z).into_inner()
}

/// Place and rates of one corner.
pub(super) struct CornerPlace {
    pub outboard: Outboard,
    pub rate: Coordinates,
}

impl CornerPlace {
    pub(super) fn all(parameters: &Parameters, state: &State) -> Result<[Self; 4], Error> {
        let corner = |i: usize| -> Result<Self, Error> {
            let corner = &parameters.corners[i];
            let at = Coordinates {
                strut: state.strut_m[i],
                rack: state.rack[i],
            };
            Ok(Self {
                outboard: corner.suspension.outboard(at, &corner.unsprung)?,
                rate: Coordinates {
                    strut: state.strut_rate_m_s[i],
                    rack: state.rack_rate[i],
                },
            })
        };
        Ok([corner(0)?, corner(1)?, corner(2)?, corner(3)?])
    }

    /// How much higher the wheel centre stands than in the design position, m.
    pub(super) fn jounce_m(&self, parameters: &Parameters, i: usize) -> f64 {
        self.outboard.wheel.point_m.z - parameters.corners[i].design_height_m
    }
}

/// What is summed over bodies: the equations of the body, and one row of a strut.
struct Equations {
    mass: f64,
    lever: Vector3<f64>,
    inertia: Matrix3<f64>,
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

/// The equation of one strut length: mass l'' + column (a, w') = push.
#[derive(Clone, Copy)]
struct StrutRow {
    column: SVector<f64, 6>,
    mass: f64,
    push: f64,
}

/// What is the same for all parts of one corner.
struct Moving<'a> {
    parameters: &'a Parameters,
    turning: Vector3<f64>,
    gravity: Vector3<f64>,
    rate: Coordinates,
    rack_acceleration: f64,
}

impl Moving<'_> {
    /// b_j: the part's acceleration without a, w' and l''.
    fn bias(&self, part: &OutboardPart) -> Vector3<f64> {
        let (w, travel) = (self.turning, &part.cg.travel);
        let r = part.cg.point_m - self.parameters.sprung_cg_m;
        w.cross(&w.cross(&r))
            + w.cross(&travel.rate(self.rate)) * 2.0
            + travel.bend(self.rate, self.rack_acceleration)
    }
}

impl Equations {
    fn of_the_body(
        parameters: &Parameters,
        state: &State,
        inputs: &Inputs,
        gravity: Vector3<f64>,
    ) -> Self {
        let (w, inertia) = (state.rate_rad_s, parameters.sprung_inertia_kg_m2);
        let speed = state.velocity_m_s.x;
        let drag = Vector3::x() * (-parameters.drag_n_s2_m2 * speed * speed.abs());
        let arm = inputs.hitch_m - parameters.sprung_cg_m;
        Self {
            mass: parameters.sprung_mass_kg,
            lever: Vector3::zeros(),
            inertia,
            force: gravity * parameters.sprung_mass_kg + drag + inputs.hitch_force_n,
            moment: (inertia * w).cross(&w) + arm.cross(&inputs.hitch_force_n),
        }
    }

    /// Adds one part with the force and moment that act on it.
    fn add(
        &mut self,
        row: &mut StrutRow,
        moving: &Moving<'_>,
        part: &OutboardPart,
        [force, moment]: [Vector3<f64>; 2],
    ) {
        let r = part.cg.point_m - moving.parameters.sprung_cg_m;
        let (m, inertia) = (part.mass_kg, &part.inertia_kg_m2);
        let (travel, rotation) = (&part.cg.travel, &part.cg.rotation);
        let relative = rotation.rate(moving.rate);
        let own = moving.turning + relative;
        let turned =
            moving.turning.cross(&relative) + rotation.bend(moving.rate, moving.rack_acceleration);
        let force = force + (moving.gravity - moving.bias(part)) * m;
        let moment = moment - inertia * turned - own.cross(&(inertia * own));
        self.mass += m;
        self.lever += r * m;
        self.inertia += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * m + inertia;
        self.force += force;
        self.moment += r.cross(&force) + moment;
        let (along, about) = (travel.by_strut, rotation.by_strut);
        let turn = inertia * about;
        let lever = r.cross(&along) * m + turn;
        for axis in 0..3 {
            row.column[axis] += along[axis] * m;
            row.column[3 + axis] += lever[axis];
        }
        row.mass += m * along.norm_squared() + about.dot(&turn);
        row.push += along.dot(&force) + about.dot(&moment);
    }

    /// (a, w') and the l'' of all struts; the latter are eliminated first.
    fn solve(&self, rows: &[StrutRow; 4]) -> Option<(SVector<f64, 6>, [f64; 4])> {
        let mut left = SMatrix::<f64, 6, 6>::zeros();
        let across = self.lever.cross_matrix();
        left.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(Matrix3::identity() * self.mass));
        left.fixed_view_mut::<3, 3>(0, 3).copy_from(&-across);
        left.fixed_view_mut::<3, 3>(3, 0).copy_from(&across);
        left.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.inertia);
        let mut right = SVector::<f64, 6>::zeros();
        right.fixed_rows_mut::<3>(0).copy_from(&self.force);
        right.fixed_rows_mut::<3>(3).copy_from(&self.moment);
        for row in rows {
            left -= row.column * row.column.transpose() / row.mass;
            right -= row.column * (row.push / row.mass);
        }
        let found = left.cholesky()?.solve(&right);
        let struts = rows.map(|row| (row.push - row.column.dot(&found)) / row.mass);
        Some((found, struts))
    }
}

/// One instant: places, tyres and torques of all wheels.
struct Instant<'a> {
    parameters: &'a Parameters,
    state: &'a State,
    inputs: &'a Inputs,
    /// Gravity in vehicle axes.
    gravity: Vector3<f64>,
    places: [CornerPlace; 4],
    tyres: [TyreForces; 4],
    torques: [Torques; 4],
}

/// What the equations are solved to.
struct Solution {
    /// a and w'.
    acceleration: Vector3<f64>,
    turning: Vector3<f64>,
    /// l''.
    struts: [f64; 4],
}

impl<'a> Instant<'a> {
    fn new<G: Ground + ?Sized>(
        parameters: &'a Parameters,
        state: &'a State,
        inputs: &'a Inputs,
        ground: &G,
    ) -> Result<Self, Error> {
        let earth = earth_from_vehicle(state);
        let places = CornerPlace::all(parameters, state)?;
        let tyres =
            [0, 1, 2, 3].map(|i| TyreForces::new(parameters, state, &earth, &places[i], ground, i));
        Ok(Self {
            parameters,
            state,
            inputs,
            gravity: earth.transpose() * Vector3::new(0.0, 0.0, -parameters.gravity_m_s2),
            torques: [0, 1, 2, 3].map(|i| Torques::new(parameters, inputs, tyres[i].spin, i)),
            places,
            tyres,
        })
    }

    fn moving(&self, i: usize) -> Moving<'a> {
        Moving {
            parameters: self.parameters,
            turning: self.state.rate_rad_s,
            gravity: self.gravity,
            rate: self.places[i].rate,
            rack_acceleration: self.inputs.rack_acceleration[i],
        }
    }

    fn strut(&self, i: usize) -> StrutForce {
        let (length_m, rate_m_s) = (self.state.strut_m[i], self.state.strut_rate_m_s[i]);
        self.parameters.corners[i].strut.force(length_m, rate_m_s)
    }

    fn solve(&self) -> Result<Solution, Error> {
        let mut body =
            Equations::of_the_body(self.parameters, self.state, self.inputs, self.gravity);
        let mut rows = [StrutRow {
            column: SVector::zeros(),
            mass: 0.0,
            push: 0.0,
        }; 4];
        for (i, row) in rows.iter_mut().enumerate() {
            let (corner, tyre) = (&self.parameters.corners[i], &self.tyres[i]);
            let (place, moving) = (&self.places[i].outboard, self.moving(i));
            let (s, torques) = (place.spindle, &self.torques[i]);
            let spin_inertia = corner.unsprung.wheel_spin_inertia_kg_m2;
            let momentum = spin_inertia * self.state.wheel_speed_rad_s[i];
            let across = tyre.about_centre - s * tyre.about_centre.dot(&s);
            let moment = across
                - tyre.carrier_rate.cross(&s) * momentum
                - s * (torques.on_wheel - torques.on_chassis);
            let [wheel, others @ ..] = &place.parts;
            body.add(row, &moving, wheel, [tyre.axes * tyre.force, moment]);
            for part in others {
                body.add(row, &moving, part, [Vector3::zeros(); 2]);
            }
            body.moment -= s * torques.on_chassis;
            let jounce_m = |i: usize| self.places[i].jounce_m(self.parameters, i);
            let bar_n = corner.bar_n_m * (jounce_m(i) - jounce_m(i ^ 1));
            row.push += self.strut(i).total_n() - bar_n * place.wheel.travel.by_strut.z;
        }
        let (body_rate, struts) = body.solve(&rows).ok_or(SuspensionError::Degenerate {
            what: "the masses of the vehicle do not make a positive definite inertia",
        })?;
        Ok(Solution {
            acceleration: body_rate.fixed_rows::<3>(0).into_owned(),
            turning: body_rate.fixed_rows::<3>(3).into_owned(),
            struts,
        })
    }

    fn rate(&self, solution: &Solution) -> State {
        let state = self.state;
        State {
            position_m: earth_from_vehicle(state) * state.velocity_m_s,
            attitude_rad: attitude_rates(state),
            velocity_m_s: solution.acceleration - state.rate_rad_s.cross(&state.velocity_m_s),
            rate_rad_s: solution.turning,
            strut_m: state.strut_rate_m_s,
            strut_rate_m_s: solution.struts,
            rack: state.rack_rate,
            rack_rate: self.inputs.rack_acceleration,
            wheel_speed_rad_s: std::array::from_fn(|i| {
                let spindle = self.places[i].outboard.spindle;
                let torque = self.torques[i].on_wheel + self.tyres[i].about_centre.dot(&spindle);
                torque / self.parameters.corners[i].unsprung.wheel_spin_inertia_kg_m2
            }),
            slip_tangent: std::array::from_fn(|i| self.tyres[i].slip_rates[0]),
            slip_ratio: std::array::from_fn(|i| self.tyres[i].slip_rates[1]),
        }
    }

    fn wheel(&self, solution: &Solution, i: usize) -> WheelOutputs {
        let (place, tyre, moving) = (&self.places[i].outboard, &self.tyres[i], self.moving(i));
        let accelerated = |part: &OutboardPart| {
            let r = part.cg.point_m - self.parameters.sprung_cg_m;
            solution.acceleration
                + solution.turning.cross(&r)
                + part.cg.travel.by_strut * solution.struts[i]
                + moving.bias(part)
        };
        let [wheel, carrier, ..] = &place.parts;
        WheelOutputs {
            contact: tyre.contact,
            vehicle_from_contact: tyre.axes,
            force_n: tyre.force,
            moment_n_m: tyre.moment,
            centre_moment_n_m: tyre.about_centre,
            tyre_power_w: tyre.power_w(place.spindle, self.state.wheel_speed_rad_s[i]),
            slip_tangent: tyre.slips[0],
            slip_ratio: tyre.slips[1],
            spin_rad_s: tyre.spin,
            axle_torque_n_m: self.torques[i].on_chassis,
            centre_m: place.wheel.point_m,
            spindle: place.spindle,
            velocity_m_s: tyre.velocity,
            acceleration_m_s2: accelerated(wheel),
            inertia_n: accelerated(wheel) * wheel.mass_kg + accelerated(carrier) * carrier.mass_kg,
            strut: self.strut(i),
        }
    }
}

/// Rate of the state, with forces and accelerations of the wheels.
///
/// # Errors
/// A strut length or rack travel that the linkage does not reach.
pub fn outputs<G: Ground + ?Sized>(
    parameters: &Parameters,
    state: &State,
    inputs: &Inputs,
    ground: &G,
) -> Result<Outputs, Error> {
    let instant = Instant::new(parameters, state, inputs, ground)?;
    let solution = instant.solve()?;
    Ok(Outputs {
        rate: instant.rate(&solution),
        specific_force_m_s2: solution.acceleration - instant.gravity,
        wheels: [0, 1, 2, 3].map(|i| instant.wheel(&solution, i)),
    })
}

/// Rates of roll, pitch and yaw.
fn attitude_rates(state: &State) -> Vector3<f64> {
    let (sr, cr) = math::sin_cos(state.attitude_rad.x);
    let (sp, cp) = math::sin_cos(state.attitude_rad.y);
    let [p, q, r]: [f64; 3] = state.rate_rad_s.into();
    let turn = (q * sr + r * cr) / cp;
    Vector3::new(p + turn * sp, q * cr - r * sr, turn)
}

/// One step of the classical Runge-Kutta rule of fourth order, inputs held.
///
/// # Errors
/// A strut length or rack travel that the linkage does not reach.
pub fn step<G: Ground + ?Sized>(
    parameters: &Parameters,
    state: &State,
    inputs: &Inputs,
    ground: &G,
    step_s: f64,
) -> Result<State, Error> {
    let rate = |x: &SVector<f64, STATES>| -> Result<SVector<f64, STATES>, Error> {
        let state = State::from_vector(x);
        let instant = Instant::new(parameters, &state, inputs, ground)?;
        Ok(instant.rate(&instant.solve()?).to_vector())
    };
    runge_kutta(&state.to_vector(), step_s, rate).map(|next| State::from_vector(&next))
}

/// The rule of [`step`] for any rate that can fail.
pub(super) fn runge_kutta<const N: usize>(
    x: &SVector<f64, N>,
    step_s: f64,
    rate: impl Fn(&SVector<f64, N>) -> Result<SVector<f64, N>, Error>,
) -> Result<SVector<f64, N>, Error> {
    let first = rate(x)?;
    let second = rate(&(x + first * (0.5 * step_s)))?;
    let third = rate(&(x + second * (0.5 * step_s)))?;
    let fourth = rate(&(x + third * step_s))?;
    Ok(x + (first + (second + third) * 2.0 + fourth) * (step_s / 6.0))
}
