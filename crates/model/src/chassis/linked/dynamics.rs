//! Equations of motion.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::parameters::Outboard;
use super::{Inputs, Parameters, STATES, State};
use crate::Error;
use crate::road::{Ground, GroundContact};
use crate::suspension::StrutForce;
use crate::suspension::linkage::{Coordinates, OutboardPart};
use crate::tyre::{Contact, rolling_resistance_n_m, saturated, steady_slip, tread_moment};

/// What one wheel does. Vectors in vehicle axes unless another frame is told.
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
    let [[sr, cr], [sp, cp], [sy, cy]] = [0, 1, 2].map(|axis: usize| {
        let (sin, cos) = math::sin_cos(state.attitude_rad[axis]);
        [sin, cos]
    });
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
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

/// A tyre on its ground.
struct TyreForces {
    contact: GroundContact,
    axes: Matrix3<f64>,
    force: Vector3<f64>,
    moment: Vector3<f64>,
    about_centre: Vector3<f64>,
    velocity: Vector3<f64>,
    carrier_rate: Vector3<f64>,
    slips: [f64; 2],
    slip_rates: [f64; 2],
    spin: f64,
}

impl TyreForces {
    fn new<G: Ground + ?Sized>(
        parameters: &Parameters,
        state: &State,
        earth: &Matrix3<f64>,
        place: &CornerPlace,
        ground: &G,
        i: usize,
    ) -> Self {
        let corner = &parameters.corners[i];
        let file = &corner.tyre_file;
        let (wheel, s) = (&place.outboard.wheel, place.outboard.spindle);
        let r = wheel.point_m - parameters.sprung_cg_m;
        let turning = state.rate_rad_s;
        let carrier_rate = turning + wheel.rotation.rate(place.rate);
        let velocity = state.velocity_m_s + turning.cross(&r) + wheel.travel.rate(place.rate);
        let contact = ground.contact(
            state.position_m + earth * r,
            earth * s,
            file.unloaded_radius_m,
            file.width_m,
        );
        let normal = earth.transpose() * contact.normal;
        let lean = normal.dot(&s);
        let in_plane = normal - s * lean;
        let upright = in_plane.norm();
        let closing = -normal.dot(&velocity) / upright;
        let load_n = if contact.depth_m > 0.0 {
            let spring = file.vertical_stiffness_n_m * contact.depth_m;
            (spring + file.vertical_damping_n_s_m * closing).max(0.0)
        } else {
            0.0
        };
        let ahead = s.cross(&normal) / upright;
        let left = normal.cross(&ahead);
        let foot = in_plane * ((contact.depth_m - file.unloaded_radius_m) / upright);
        let sliding = (velocity + carrier_rate.cross(&foot)).dot(&left);
        let rolling = velocity.dot(&ahead);
        let slip_speed = state.wheel_speed_rad_s[i] * corner.rolling_radius_m - rolling;
        let low = parameters.low_speed_m_s;
        let (slips, slip_rates) = if file.relaxation_length_m > 0.0 {
            let slips = [state.slip_tangent[i], state.slip_ratio[i]];
            let rate = |slip: f64, speed: f64| {
                crate::tyre::relaxed_rate(slip, speed, rolling, file.relaxation_length_m)
            };
            (slips, [rate(slips[0], sliding), rate(slips[1], slip_speed)])
        } else {
            let steady = |speed: f64| steady_slip(speed, rolling, low);
            ([steady(sliding), steady(slip_speed)], [0.0; 2])
        };
        let forces = corner.tyre.forces(&Contact {
            load_n,
            slip_tangent: slips[0],
            slip_ratio: slips[1],
            camber_rad: math::asin(lean.clamp(-1.0, 1.0)),
            friction_scale: contact.friction,
            stiffness_scale: 1.0,
        });
        let spin = state.wheel_speed_rad_s[i] - carrier_rate.dot(&s);
        let resistance = file.rolling_resistance + contact.resistance;
        let tilt = lean / upright;
        let moment = Vector3::new(
            -tread_moment(file.width_m, file.vertical_stiffness_n_m, load_n, tilt),
            rolling_resistance_n_m(resistance, load_n, corner.rolling_radius_m, spin),
            forces.aligning_n_m,
        );
        let force = Vector3::new(forces.longitudinal_n, forces.lateral_n, load_n);
        let axes = Matrix3::from_columns(&[ahead, left, normal]);
        Self {
            contact,
            axes,
            force,
            moment,
            about_centre: foot.cross(&(axes * force)) + axes * moment,
            velocity,
            carrier_rate,
            slips,
            slip_rates,
            spin,
        }
    }

    fn power_w(&self, spindle: Vector3<f64>, wheel_speed_rad_s: f64) -> f64 {
        let about_spindle = self.about_centre.dot(&spindle);
        let across = self.about_centre - spindle * about_spindle;
        (self.axes * self.force).dot(&self.velocity)
            + across.dot(&self.carrier_rate)
            + about_spindle * wheel_speed_rad_s
    }
}

/// Drive and brake torque of one wheel.
struct Torques {
    on_wheel: f64,
    /// The part that the chassis reacts.
    on_chassis: f64,
}

impl Torques {
    fn new(parameters: &Parameters, inputs: &Inputs, spin: f64, i: usize) -> Self {
        let corner = &parameters.corners[i];
        let drive = inputs.drive_n_m[i];
        let brake = -inputs.brake_n_m[i] * saturated(spin);
        let by_chassis = |torque: f64, reacts: bool| if reacts { torque } else { 0.0 };
        Self {
            on_wheel: drive + brake,
            on_chassis: by_chassis(drive, corner.drive_on_chassis)
                + by_chassis(brake, !corner.brake_on_carrier),
        }
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
    let earth = earth_from_vehicle(state);
    let gravity = earth.transpose() * Vector3::new(0.0, 0.0, -parameters.gravity_m_s2);
    let places = CornerPlace::all(parameters, state)?;
    let tyres =
        [0, 1, 2, 3].map(|i| TyreForces::new(parameters, state, &earth, &places[i], ground, i));
    let mut body = Equations::of_the_body(parameters, state, inputs, gravity);
    let mut struts = [StrutForce::default(); 4];
    let mut rows = [StrutRow {
        column: SVector::zeros(),
        mass: 0.0,
        push: 0.0,
    }; 4];
    for i in 0..4 {
        let (corner, place, tyre) = (&parameters.corners[i], &places[i], &tyres[i]);
        let moving = moving(parameters, state, inputs, gravity, place, i);
        let s = place.outboard.spindle;
        let torques = Torques::new(parameters, inputs, tyre.spin, i);
        let on_carrier = torques.on_wheel - torques.on_chassis;
        let momentum = corner.unsprung.wheel_spin_inertia_kg_m2 * state.wheel_speed_rad_s[i];
        let across = tyre.about_centre - s * tyre.about_centre.dot(&s);
        let moment = across - tyre.carrier_rate.cross(&s) * momentum - s * on_carrier;
        let [wheel, others @ ..] = &place.outboard.parts;
        let row = &mut rows[i];
        body.add(row, &moving, wheel, [tyre.axes * tyre.force, moment]);
        for part in others {
            body.add(row, &moving, part, [Vector3::zeros(); 2]);
        }
        body.moment -= s * torques.on_chassis;
        struts[i] = corner
            .strut
            .force(state.strut_m[i], state.strut_rate_m_s[i]);
        let higher_m = place.jounce_m(parameters, i) - places[i ^ 1].jounce_m(parameters, i ^ 1);
        let bar_n = corner.bar_n_m * higher_m;
        row.push += struts[i].total_n() - bar_n * place.outboard.wheel.travel.by_strut.z;
    }
    let (body_rate, strut_rate) =
        body.solve(&rows)
            .ok_or(crate::suspension::SuspensionError::Degenerate {
                what: "the masses of the vehicle do not make a positive definite inertia",
            })?;
    let acceleration = body_rate.fixed_rows::<3>(0).into_owned();
    let turning_dot = body_rate.fixed_rows::<3>(3).into_owned();
    let rate = State {
        position_m: earth * state.velocity_m_s,
        attitude_rad: attitude_rates(state),
        velocity_m_s: acceleration - state.rate_rad_s.cross(&state.velocity_m_s),
        rate_rad_s: turning_dot,
        strut_m: state.strut_rate_m_s,
        strut_rate_m_s: strut_rate,
        rack: state.rack_rate,
        rack_rate: inputs.rack_acceleration,
        wheel_speed_rad_s: std::array::from_fn(|i| {
            let torque = Torques::new(parameters, inputs, tyres[i].spin, i).on_wheel
                + tyres[i].about_centre.dot(&places[i].outboard.spindle);
            torque / parameters.corners[i].unsprung.wheel_spin_inertia_kg_m2
        }),
        slip_tangent: std::array::from_fn(|i| tyres[i].slip_rates[0]),
        slip_ratio: std::array::from_fn(|i| tyres[i].slip_rates[1]),
    };
    let wheel = |i: usize| {
        let (place, tyre) = (&places[i], &tyres[i]);
        let moving = moving(parameters, state, inputs, gravity, place, i);
        let accelerated = |part: &OutboardPart| {
            let r = part.cg.point_m - parameters.sprung_cg_m;
            acceleration
                + turning_dot.cross(&r)
                + part.cg.travel.by_strut * strut_rate[i]
                + moving.bias(part)
        };
        let [wheel, carrier, ..] = &place.outboard.parts;
        WheelOutputs {
            contact: tyre.contact,
            vehicle_from_contact: tyre.axes,
            force_n: tyre.force,
            moment_n_m: tyre.moment,
            centre_moment_n_m: tyre.about_centre,
            tyre_power_w: tyre.power_w(place.outboard.spindle, state.wheel_speed_rad_s[i]),
            slip_tangent: tyre.slips[0],
            slip_ratio: tyre.slips[1],
            spin_rad_s: tyre.spin,
            axle_torque_n_m: Torques::new(parameters, inputs, tyre.spin, i).on_chassis,
            centre_m: place.outboard.wheel.point_m,
            spindle: place.outboard.spindle,
            velocity_m_s: tyre.velocity,
            acceleration_m_s2: accelerated(wheel),
            inertia_n: accelerated(wheel) * wheel.mass_kg + accelerated(carrier) * carrier.mass_kg,
            strut: struts[i],
        }
    };
    Ok(Outputs {
        rate,
        specific_force_m_s2: acceleration - gravity,
        wheels: [wheel(0), wheel(1), wheel(2), wheel(3)],
    })
}

fn moving<'a>(
    parameters: &'a Parameters,
    state: &State,
    inputs: &Inputs,
    gravity: Vector3<f64>,
    place: &CornerPlace,
    i: usize,
) -> Moving<'a> {
    Moving {
        parameters,
        turning: state.rate_rad_s,
        gravity,
        rate: place.rate,
        rack_acceleration: inputs.rack_acceleration[i],
    }
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
        Ok(outputs(parameters, &state, inputs, ground)?
            .rate
            .to_vector())
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
