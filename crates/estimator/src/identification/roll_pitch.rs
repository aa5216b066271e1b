//! Roll and pitch stiffness, by Ryu's regression and by Gillespie's formula (section 2.4.4 of the
//! thesis), and why they differ.
//!
//! Ryu regresses the roll moment on roll angle and rate. With the centre of gravity's acceleration,
//!
//! m_s h_1 a_y = (K_phi - m_s g h_1) phi + B_phi phi' + I phi'' + offset,
//!
//! so the slope is the *net* stiffness: the 2743 N m/rad that the thesis calls irregular lies near
//! m_s g h_1, which has to be added back where the acceleration is the centre of gravity's (what an
//! accelerometer on the rolled body reads holds g sin(phi), and gives K_phi itself). The thesis has
//! no inertia term; without it the stiffness comes out 9 % low on a drive of 0.05 to 0.6 Hz. Pitch
//! likewise: -m_s h_p a_x = (K_theta - m_s g h_p) theta + B_theta theta' + I theta'' + offset.
//!
//! What is regressed here is the angle on the moment and its own rate,
//!
//! phi = offset + (M - I phi'')/(K - m_s g h_1) - tau phi', B = tau (K - m_s g h_1),
//!
//! because the moment is the quieter of the two, and with the vehicle file's inertia, because at
//! one frequency I cannot be told from K (a sine gives K - I omega^2 and no more).
//!
//! Wheels and uprights lean too, by kappa phi: what the camber of the linkage leaves of the roll
//! angle. Their weight and inertia m_u at the height h_u, their spin momentum sum(I_w/R_0) V, which
//! the yaw rate turns, and the righting moment c_z b^2/12 of each tread act on roll through kappa,
//!
//! (m_s h_1 + sum kappa (m_u h_u + I_w/R_0)) a_y
//!   = (K_phi - m_s g h_1 - sum kappa^2 (m_u g h_u - c_z b^2/12)) phi + B_phi phi' + ...,
//!
//! with V r nearly a_y: 11 % of the moment on the Prowler, whose stiffness would else come out 10 %
//! low. Without hard-points kappa is zero, as in the four-wheel model.
//!
//! Gillespie's K_phi = K_w t^2/2 for each axle (equation 2.30, which the thesis evaluates for the
//! front axle alone and with 1.44 m in the place of the track for pitch) holds the springs only. The
//! regression finds body against ground: the springs in series with the tyres, whose own stiffness
//! in roll is k_t t^2/2, with whatever linkage, bars and friction add.

use model::suspension::Corner;
use model::vehicle::{Axle, Vehicle};
use nalgebra::{DMatrix, DVector};
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use super::Drive;
use super::drive::{series, span_of};
use super::signals::{slope, smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Span};
use crate::regression::{Fit, least_squares};

const WHAT: &str = "roll and pitch stiffness";
const ADVICE: &str = "steer a slow sine (such as the manoeuvre slow-sine) for roll, speed up and \
                      brake (such as launch-brake) for pitch";
/// Least usable data, s.
const DATA_MIN_S: f64 = 6.0;
/// How well a vehicle file knows the moment of inertia, a part of it,
const INERTIA_DOUBT: f64 = 0.03;
/// and the lean of the wheels.
const LEAN_DOUBT: f64 = 0.15;
/// The same of the arm of the sprung mass over the pitch centre, which the suspension moves as it travels.
const PITCH_ARM_DOUBT: f64 = 0.02;
/// Least standard deviation of the angle, rad.
const ANGLE_MIN_RAD: f64 = 0.008;

/// What must be known of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Sprung mass m_s, kg.
    pub sprung_mass_kg: f64,
    /// Arm h_1 of the sprung mass over the roll axis, m.
    pub roll_arm_m: f64,
    /// Arm h_p of the sprung mass over the pitch centre, m.
    pub pitch_arm_m: f64,
    /// Roll and pitch inertia of the sprung mass about its own centre of gravity, kg m^2.
    pub inertia_kg_m2: [f64; 2],
    /// Height of the sprung mass's centre of gravity over the whole vehicle's, m.
    pub sprung_rise_m: f64,
    /// Each axle.
    pub axles: [AxleBody; 2],
}

/// What must be known of an axle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxleBody {
    /// Track t, m.
    pub track_m: f64,
    /// Roll-centre height h_r, m.
    pub roll_centre_height_m: f64,
    /// Unsprung mass m_u, kg.
    pub unsprung_mass_kg: f64,
    /// Height h_u of the unsprung mass, m.
    pub unsprung_height_m: f64,
    /// Part of the lateral force that the axle carries: b/L at the front, a/L at the rear.
    pub share: f64,
    /// Roll stiffness of the axle's springs and bar by equation 2.30, N m/rad.
    pub springs_n_m_rad: f64,
    /// Roll stiffness of the axle's tyres k_t t^2/2, N m/rad.
    pub tyres_n_m_rad: f64,
    /// Part kappa of the body's roll by which the wheels lean against the ground.
    pub lean: f64,
    /// Spin inertia over radius of both wheels, kg m.
    pub spin_kg_m: f64,
    /// Righting moment of both treads per lean, N m/rad.
    pub tread_n_m_rad: f64,
}

impl AxleBody {
    /// An axle that carries `share` of the lateral force, with its linkage where it has one.
    fn of(axle: &Axle, corner: Option<&Corner>, share: f64) -> Self {
        let rates = corner.and_then(|corner| {
            let pose = corner.pose_at_jounce(0.0, 0.0).ok()?;
            Some(corner.rates(&pose))
        });
        let springs = match (&axle.strut, rates) {
            (Some(strut), Some(rates)) => {
                let ratio = rates.motion_ratio();
                0.5 * strut.stiffness_n_m * ratio.powi(2) * axle.track_m.powi(2)
                    + axle.anti_roll_bar_n_m_rad
            }
            _ => axle.roll_stiffness_n_m_rad,
        };
        let tyre = &axle.tyre;
        let unsprung = axle.unsprung.as_ref();
        let spin = unsprung.map_or(0.0, |parts| parts.wheel_spin_inertia_kg_m2);
        Self {
            track_m: axle.track_m,
            roll_centre_height_m: axle.roll_centre_height_m,
            unsprung_mass_kg: axle.unsprung_mass_kg(),
            unsprung_height_m: tyre.unloaded_radius_m,
            share,
            springs_n_m_rad: springs,
            tyres_n_m_rad: 0.5 * tyre.vertical_stiffness_n_m * axle.track_m.powi(2),
            // The left wheel drops by half the track for a radian of roll.
            lean: rates.map_or(0.0, |rates| {
                let turned = rates.strut.rotation.x / rates.strut.wheel_centre.z;
                1.0 - 0.5 * axle.track_m * turned
            }),
            spin_kg_m: 2.0 * spin / tyre.unloaded_radius_m,
            tread_n_m_rad: tyre.vertical_stiffness_n_m * tyre.width_m.powi(2) / 6.0,
        }
    }

    /// Moment of the leaning parts for each lateral acceleration, kg m.
    fn leaning_kg_m(&self) -> f64 {
        self.lean * (self.unsprung_mass_kg * self.unsprung_height_m + self.spin_kg_m)
    }

    /// What the leaning parts take from the stiffness, N m/rad.
    fn falling_n_m_rad(&self) -> f64 {
        let weight_n = self.unsprung_mass_kg * STANDARD_GRAVITY_M_S2;
        self.lean.powi(2) * (weight_n * self.unsprung_height_m - self.tread_n_m_rad)
    }
}

impl Body {
    /// What the vehicle file says. Wheel rates and lean are those of the hard-points where there are
    /// any, otherwise the springs are those of the file's roll stiffness and the wheels stay upright.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        let sprung = vehicle.sprung();
        let (a, b) = (
            vehicle.body.front_axle_to_cg_m,
            vehicle.body.cg_to_rear_axle_m,
        );
        let axle = |axle: &Axle, wheel: Wheel, share: f64| {
            AxleBody::of(axle, Corner::of(vehicle, wheel).ok().as_ref(), share)
        };
        Self {
            sprung_mass_kg: sprung.mass_kg,
            roll_arm_m: vehicle.roll_arm_m(),
            pitch_arm_m: sprung.cg_m[2] - vehicle.pitch().centre_height_m,
            inertia_kg_m2: [sprung.inertia_kg_m2[0], sprung.inertia_kg_m2[1]],
            sprung_rise_m: sprung.cg_m[2] - vehicle.body.cg_height_m,
            axles: [
                axle(&vehicle.front, Wheel::FrontLeft, b / (a + b)),
                axle(&vehicle.rear, Wheel::RearLeft, a / (a + b)),
            ],
        }
    }
}

/// How the signals are filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Cut-off of the low-pass that all signals go through, Hz.
    pub cutoff_hz: f64,
    /// Greatest acceleration in the plane that is looked at, m/s^2: beyond, a wheel may lift.
    pub acceleration_max_m_s2: f64,
    /// Least speed, m/s.
    pub speed_min_m_s: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            cutoff_hz: 2.0,
            acceleration_max_m_s2: 5.0,
            speed_min_m_s: 1.0,
            seed: 1,
        }
    }
}

/// Finds roll stiffness and damping, and the same of pitch, as far as the drive moves
/// them; with the wheels' loads each axle's share of the roll stiffness.
///
/// Findings: `roll_stiffness` (N m/rad, body against ground), `roll_damping` (N m s/rad),
/// the same of `pitch`; `roll_stiffness_front`, `roll_stiffness_rear`.
/// Beside: Gillespie's values of the springs, and in series with the tyres.
///
/// # Errors
/// Missing signals, too little data, neither roll nor pitch moved.
pub fn identify(drive: &Drive, body: &Body, options: &Options) -> Result<Findings, Refusal> {
    drive.require(WHAT, &["lateral acceleration", "roll angle"])?;
    let weight = body.sprung_mass_kg * STANDARD_GRAVITY_M_S2;
    let leaning: f64 = body.axles.iter().map(AxleBody::leaning_kg_m).sum();
    let falling: f64 = body.axles.iter().map(AxleBody::falling_n_m_rad).sum();
    let roll = Plane {
        name: "roll",
        angle_rad: &drive.roll_rad,
        acceleration_m_s2: &drive.lateral_m_s2,
        lever_kg_m: body.sprung_mass_kg * body.roll_arm_m + leaning,
        inertia_kg_m2: body.inertia_kg_m2[0]
            + body.sprung_mass_kg * body.roll_arm_m * body.sprung_rise_m,
        gravity_n_m: weight * body.roll_arm_m + falling,
        leaning_kg_m: leaning,
        falling_n_m: falling,
        arm_doubt: 0.0,
    };
    let pitch = Plane {
        name: "pitch",
        angle_rad: &drive.pitch_rad,
        acceleration_m_s2: &drive.longitudinal_m_s2,
        lever_kg_m: -body.sprung_mass_kg * body.pitch_arm_m,
        inertia_kg_m2: body.inertia_kg_m2[1]
            + body.sprung_mass_kg * body.pitch_arm_m * body.sprung_rise_m,
        gravity_n_m: weight * body.pitch_arm_m,
        leaning_kg_m: 0.0,
        falling_n_m: 0.0,
        arm_doubt: PITCH_ARM_DOUBT,
    };
    let mut found = Findings {
        what: WHAT.to_owned(),
        ..Findings::default()
    };
    let rolled = roll.regress(drive, options).map(|mut one| {
        found.findings.append(&mut one.findings);
        found.figures.append(&mut one.figures);
    });
    let pitched = pitch.regress(drive, options).map(|mut one| {
        found.findings.append(&mut one.findings);
        found.figures.append(&mut one.figures);
    });
    match (rolled, pitched) {
        (Err(refusal), Err(_)) => return Err(refusal),
        (Err(refusal), Ok(())) | (Ok(()), Err(refusal)) => found.notes.push(refusal.to_string()),
        (Ok(()), Ok(())) => {}
    }
    if found.get("roll_stiffness").is_some() {
        for (axle, name) in ["front", "rear"].into_iter().enumerate() {
            if let Ok(finding) = by_loads(drive, body, axle, name, options) {
                found.findings.push(finding);
            }
        }
    }
    beside(&mut found, body);
    Ok(found)
}

/// Roll, or pitch.
struct Plane<'a> {
    name: &'static str,
    angle_rad: &'a [f64],
    acceleration_m_s2: &'a [f64],
    /// Moment per acceleration.
    lever_kg_m: f64,
    /// What the moment spends on angular acceleration; the centre of gravity whose acceleration is
    /// known lies below the sprung mass's own.
    inertia_kg_m2: f64,
    /// What gravity takes from the stiffness.
    gravity_n_m: f64,
    /// The parts of lever and gravity that come with the wheels' lean.
    leaning_kg_m: f64,
    falling_n_m: f64,
    /// What the arm may be off, part of it.
    arm_doubt: f64,
}

impl Plane<'_> {
    /// Stiffness and damping of offset, 1/K and -tau.
    fn parameters(&self, c: &[f64]) -> Vec<f64> {
        vec![c[1].recip() + self.gravity_n_m, -c[2] / c[1]]
    }

    fn regress(&self, drive: &Drive, options: &Options) -> Result<Findings, Refusal> {
        let what = format!("{} stiffness", self.name);
        let dt_s = drive.dt_s;
        let cut = options.cutoff_hz;
        let step = stride(dt_s, cut);
        let angle = smooth(self.angle_rad, dt_s, cut);
        let acceleration = smooth(self.acceleration_m_s2, dt_s, cut);
        let rate = slope(self.angle_rad, dt_s, cut);
        let rate_dot = slope(&slope(self.angle_rad, dt_s, 4.0 * cut), dt_s, cut);
        let rows: Vec<usize> = (0..angle.len().min(acceleration.len()))
            .step_by(step)
            .filter(|&row| {
                (angle[row] + rate_dot[row]).is_finite()
                    && acceleration[row].abs() <= options.acceleration_max_m_s2
                    && drive
                        .speed_m_s
                        .get(row)
                        .is_none_or(|v| *v >= options.speed_min_m_s)
            })
            .collect();
        let span = span_of(&rows, dt_s, step);
        enough(&what, &span)?;
        let pick = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
        let (angle, acceleration) = (pick(&angle), pick(&acceleration));
        let moved = spread(&angle);
        if moved < ANGLE_MIN_RAD {
            return Err(Refusal::NotExcited {
                what,
                quantity: format!("the {} angle's standard deviation", self.name),
                found: moved,
                needed: ANGLE_MIN_RAD,
                unit: "rad".to_owned(),
                help: ADVICE.to_owned(),
            });
        }
        let spent = pick(&rate_dot);
        let moment: Vec<f64> = acceleration
            .iter()
            .zip(&spent)
            .map(|(a, alpha)| self.lever_kg_m * a - self.inertia_kg_m2 * alpha)
            .collect();
        let rate = pick(&rate);
        let design = DMatrix::from_fn(rows.len(), 3, |i, j| match j {
            0 => 1.0,
            1 => moment[i],
            _ => rate[i],
        });
        let response = DVector::from_column_slice(&angle);
        let told = |refusal: Refusal| refusal.of(&what).advise(ADVICE);
        let mut fit = least_squares(&design, &response).map_err(told)?;
        fit.doubt(&self.inertia_doubt(&fit, &spent));
        fit.doubt(&self.lean_doubt(&fit));
        fit.doubt(&self.lever_doubt(&fit));
        let stiffness = self.parameters(&fit.coefficients)[0];
        if stiffness < self.gravity_n_m {
            return Err(Refusal::Value {
                what,
                name: "stiffness".to_owned(),
                value: stiffness,
                expected: format!(
                    "more than m_s g h = {:.0} N m/rad, below which the body would fall over; \
                     look at the signs of angle and acceleration",
                    self.gravity_n_m
                ),
            });
        }
        Ok(self.findings(&fit, span, options.seed, (angle, moment)))
    }

    /// What the coefficients would move by if the inertia were off by its doubt.
    fn inertia_doubt(&self, fit: &Fit, angular_rad_s2: &[f64]) -> DVector<f64> {
        let by_moment = fit.coefficients[1] * INERTIA_DOUBT * self.inertia_kg_m2;
        fit.leverage.transpose() * DVector::from_column_slice(angular_rad_s2) * by_moment
    }

    /// The same of the lean.
    fn lean_doubt(&self, fit: &Fit) -> DVector<f64> {
        let slope = fit.coefficients[1];
        let by_lever = slope * LEAN_DOUBT * self.leaning_kg_m / self.lever_kg_m;
        let by_gravity = slope * slope * 2.0 * LEAN_DOUBT * self.falling_n_m;
        DVector::from_vec(vec![0.0, -by_lever - by_gravity, 0.0])
    }

    /// The same of the arm, with which lever and gravity grow.
    fn lever_doubt(&self, fit: &Fit) -> DVector<f64> {
        let slope = fit.coefficients[1];
        let moved = self.arm_doubt * slope * (1.0 + slope * self.gravity_n_m);
        DVector::from_vec(vec![0.0, moved, 0.0])
    }

    fn findings(
        &self,
        fit: &Fit,
        span: Span,
        seed: u64,
        (angle, moment): (Vec<f64>, Vec<f64>),
    ) -> Findings {
        let values = self.parameters(&fit.coefficients);
        let (slope, lag) = (fit.coefficients[1], fit.coefficients[2]);
        let by_slope = [-slope.powi(-2), lag * slope.powi(-2)];
        let by_lag = [0.0, -slope.recip()];
        let jacobian = DMatrix::from_fn(2, 3, |i, j| [0.0, by_slope[i], by_lag[i]][j]);
        let covariance = fit.propagated(&jacobian);
        let intervals = fit.intervals(seed, |moved| self.parameters(moved));
        let parts = [
            ("stiffness", "N m/rad", "N m"),
            ("damping", "N m s/rad", "rad/s"),
        ];
        let findings = parts
            .iter()
            .enumerate()
            .map(|(j, (name, unit, regressor))| Finding {
                name: format!("{}_{name}", self.name),
                value: values[j],
                unit: (*unit).to_owned(),
                sigma: covariance[(j, j)].max(0.0).sqrt(),
                interval: intervals.as_ref().map(|intervals| intervals[j]),
                condition: fit.condition,
                excitation: Some(Excitation {
                    rms: fit.excitation[j + 1],
                    unit: (*regressor).to_owned(),
                }),
                whiteness: Some(fit.whiteness),
                span,
            });
        let degrees: Vec<f64> = angle.iter().map(|v| v.to_degrees()).collect();
        let most = moment.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let line = vec![-most, most];
        let fitted = line
            .iter()
            .map(|v| (fit.coefficients[0] + fit.coefficients[1] * v).to_degrees())
            .collect();
        Findings {
            findings: findings.collect(),
            figures: vec![Figure {
                title: format!("Moment of the sprung mass against {} angle", self.name),
                x_label: format!("{} angle (°)", self.name),
                y_label: "moment (N m)".to_owned(),
                series: vec![
                    series("measured", false, degrees, moment),
                    series("net stiffness", true, fitted, line),
                ],
            }],
            ..Findings::default()
        }
    }
}

/// An axle's roll stiffness from its wheels' loads:
/// t (N_R - N_L)/2 - F_ys h_r - m_u a_y h_u = K phi + B phi' + offset with the sprung part's
/// lateral force F_ys = share m_s a_y.
fn by_loads(
    drive: &Drive,
    body: &Body,
    axle: usize,
    name: &str,
    options: &Options,
) -> Result<Finding, Refusal> {
    let what = format!("roll stiffness of the {name} axle");
    let [left, right] = [&drive.loads_n.0[2 * axle], &drive.loads_n.0[2 * axle + 1]];
    if left.len() != drive.rows() || right.len() != drive.rows() {
        return Err(Refusal::Missing {
            what,
            channel: "wheel load".to_owned(),
            help: "it needs the deflection channels".to_owned(),
        });
    }
    let (dt_s, cut) = (drive.dt_s, options.cutoff_hz);
    let step = stride(dt_s, cut);
    let AxleBody {
        track_m,
        roll_centre_height_m,
        unsprung_mass_kg,
        unsprung_height_m,
        share,
        ..
    } = body.axles[axle];
    let moment: Vec<f64> = (0..drive.rows())
        .map(|row| {
            let sprung = share * body.sprung_mass_kg * roll_centre_height_m;
            let unsprung = unsprung_mass_kg * unsprung_height_m;
            0.5 * track_m * (right[row] - left[row]) - (sprung + unsprung) * drive.lateral_m_s2[row]
        })
        .collect();
    let moment = smooth(&moment, dt_s, cut);
    let angle = smooth(&drive.roll_rad, dt_s, cut);
    let rate = slope(&drive.roll_rad, dt_s, cut);
    let lateral = smooth(&drive.lateral_m_s2, dt_s, cut);
    let rows: Vec<usize> = (0..drive.rows())
        .step_by(step)
        .filter(|&row| {
            (moment[row] + angle[row] + rate[row]).is_finite()
                && lateral[row].abs() <= options.acceleration_max_m_s2
                && drive
                    .speed_m_s
                    .get(row)
                    .is_none_or(|v| *v >= options.speed_min_m_s)
        })
        .collect();
    let span = span_of(&rows, dt_s, step);
    enough(&what, &span)?;
    let design = DMatrix::from_fn(rows.len(), 3, |i, j| match j {
        0 => 1.0,
        1 => angle[rows[i]],
        _ => rate[rows[i]],
    });
    let response = DVector::from_fn(rows.len(), |i, _| moment[rows[i]]);
    let fit = least_squares(&design, &response).map_err(|r| r.of(&what).advise(ADVICE))?;
    let intervals = fit.intervals(options.seed, |moved| vec![moved[1]]);
    Ok(Finding {
        name: format!("roll_stiffness_{name}"),
        value: fit.coefficients[1],
        unit: "N m/rad".to_owned(),
        sigma: fit.sigma(1),
        interval: intervals.map(|intervals| intervals[0]),
        condition: fit.condition,
        excitation: Some(Excitation {
            rms: fit.excitation[1],
            unit: "rad".to_owned(),
        }),
        whiteness: Some(fit.whiteness),
        span,
    })
}

fn enough(what: &str, span: &Span) -> Result<(), Refusal> {
    if span.used_s >= DATA_MIN_S {
        return Ok(());
    }
    Err(Refusal::TooShort {
        what: what.to_owned(),
        found_s: span.used_s,
        needed_s: DATA_MIN_S,
        help: ADVICE.to_owned(),
    })
}

fn beside(found: &mut Findings, body: &Body) {
    let unit = "N m/rad";
    let [ryu, _] = found.value("roll_stiffness");
    let mut add = |name: &str, value: f64| {
        found.beside.push((name.to_owned(), value, unit.to_owned()));
    };
    let springs: f64 = body.axles.iter().map(|axle| axle.springs_n_m_rad).sum();
    let in_series =
        |axle: &AxleBody| (axle.springs_n_m_rad.recip() + axle.tyres_n_m_rad.recip()).recip();
    let with_tyres: f64 = body.axles.iter().map(in_series).sum();
    let falling: f64 = body.axles.iter().map(AxleBody::falling_n_m_rad).sum();
    let gravity = body.sprung_mass_kg * STANDARD_GRAVITY_M_S2 * body.roll_arm_m + falling;
    add(
        "gillespie_roll_stiffness_front",
        body.axles[0].springs_n_m_rad,
    );
    add(
        "gillespie_roll_stiffness_rear",
        body.axles[1].springs_n_m_rad,
    );
    add("gillespie_roll_stiffness", springs);
    add("gillespie_roll_stiffness_with_tyres", with_tyres);
    add("gravity_roll_stiffness", gravity);
    if ryu.is_finite() {
        add("ryu_net_roll_stiffness", ryu - gravity);
        found.notes.push(format!(
            "the regression's slope is {:.0} N m/rad, the net stiffness; with what gravity \
             takes, {gravity:.0}, it is {ryu:.0}, body against ground. Equation 2.30 gives {springs:.0} for \
             the springs of both axles and {with_tyres:.0} in series with the tyres",
            ryu - gravity
        ));
    }
}
