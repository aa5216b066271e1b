//! Understeer, sideslip and roll gradient from steady circular driving (ISO 4138, constant radius).
//!
//! On a path of curvature kappa = r/V the front wheels need the angle
//!
//! delta = atan(L kappa) + K_us z(a_y) - offset,  dz/da_y -> 1 as a_y -> 0,
//!
//! where K_us is the understeer gradient at small lateral acceleration. Subtracting the measured
//! curvature rather than a radius that was meant takes out what the driver strays. Driven to both
//! sides, as the standard asks, the circle tells the offset from the gradient: of the one the sign
//! stays, of the other it turns. To one side only what a_y grows by does, and the findings say so.
//! A free bend is hardly told apart on a circle, where a_y never comes near zero: the bend z is the
//! vehicle file's, which its tyres' grip and trail, the load's transfer, rolling resistance and the
//! moment between the sides make (see [`cornering`]): that of the front axle's slip angle less the
//! rear one's at the file's stiffness,
//!
//! z = q(a_y)/q'(0),  q = b z_f/C_f - a z_r/C_r,
//!
//! and a_y where these nearly cancel (a neutral vehicle). A trail that shortens as the tyre begins to
//! slide takes back what the grip bends. z is not zero at a_y = 0: the front wheels' rolling
//! resistance is steered against at any. It holds whatever the ground makes of the stiffness, as long
//! as both axles have the same of it; what grip (30 %), trail (20 %) and load transfer (5 %) may be off
//! by is in the deviations. The sideslip angle follows
//! beta = b kappa - s z_r, the roll angle phi = g a_y, each with an offset.

use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
use sample::STANDARD_GRAVITY_M_S2;

use super::Drive;
use super::cornering;
use super::drive::{series, span_of};
use super::signals::{mean, slope, smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Span};
use crate::regression::{Fit, least_squares};

const WHAT: &str = "understeer gradient";
const ADVICE: &str = "drive a circle of constant radius (ISO 4138) with the speed rising slowly from \
                      walking pace until 4 m/s^2 or more, such as the manoeuvre circle";
const ONE_SIDE: &str = "the circle was driven to one side, so that only the rise of the steer angle with \
                        lateral acceleration separates the gradient from an offset of the steer \
                        angle; drive to the other side in the same log";
/// Least usable data, s.
const DATA_MIN_S: f64 = 10.0;
/// Least range of lateral acceleration, m/s^2.
const RANGE_MIN_M_S2: f64 = 1.2;
/// Greatest standard deviation of the curvature, part of its mean.
const STRAY_MAX: f64 = 0.1;
/// What the grip's inverse may be off the vehicle file's by, part of it (standard deviation): the bend
/// goes with it.
const GRIP_DOUBT: f64 = 0.3;
/// The same of the tyres' trail and of the lateral acceleration at which wheels would lift.
const TRAIL_DOUBT: f64 = 0.2;
const TRANSFER_DOUBT: f64 = 0.05;
/// Below this part of the larger of b/C_f and a/C_r their difference has no bend of its own.
const NEUTRAL: f64 = 0.1;

/// What must be known of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Lengths, grip and load transfer; infinite grip and lift for a straight characteristic.
    pub axles: cornering::Body,
    /// Cornering stiffness of the front and the rear axle at rest, both tyres, N/rad; only their
    /// ratio is used.
    pub stiffness_n_rad: [f64; 2],
}

impl Body {
    /// What the vehicle file says.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        let axles = cornering::Body::of(vehicle);
        let (a, b) = (axles.front_axle_to_cg_m, axles.cg_to_rear_axle_m);
        let stiffness_n_rad =
            [(&vehicle.front.tyre, b), (&vehicle.rear.tyre, a)].map(|(tyre, arm)| {
                let load_n = 0.5 * axles.mass_kg * STANDARD_GRAVITY_M_S2 * arm / (a + b);
                let at_load = math::powf(load_n / tyre.reference_load_n, tyre.load_exponent);
                2.0 * tyre.cornering_stiffness_n_rad * at_load
            });
        Self {
            axles,
            stiffness_n_rad,
        }
    }

    /// The same with a value off by its doubt: the ground's grip, the tyres' trail, the load's transfer.
    fn varied(&self) -> [Self; 3] {
        let with = |change: &dyn Fn(&mut cornering::Body)| {
            let mut body = *self;
            change(&mut body.axles);
            body
        };
        [
            with(&|axles| axles.grip_n = axles.grip_n.map(|n| n / (1.0 + GRIP_DOUBT))),
            with(&|axles| axles.trail_m = axles.trail_m.map(|m| m * (1.0 + TRAIL_DOUBT))),
            with(&|axles| axles.lift_m_s2 = axles.lift_m_s2.map(|a| a * (1.0 + TRANSFER_DOUBT))),
        ]
    }

    /// z of a lateral acceleration under a steer angle of this size to the same side, m/s^2.
    fn bent(&self, lateral_m_s2: f64, steer_rad: f64) -> f64 {
        let front = self.axles.cg_to_rear_axle_m / self.stiffness_n_rad[0];
        let rear = self.axles.front_axle_to_cg_m / self.stiffness_n_rad[1];
        if (front - rear).abs() < NEUTRAL * front.max(rear) {
            return lateral_m_s2;
        }
        of_slope_one(lateral_m_s2, |size| {
            let pull = |axle| self.axles.steady_pull_m_s2(axle, size, steer_rad);
            front * pull(0) - rear * pull(1)
        })
    }

    /// z of an axle.
    fn bent_axle(&self, axle: usize, lateral_m_s2: f64, steer_rad: f64) -> f64 {
        of_slope_one(lateral_m_s2, |size| {
            self.axles.steady_pull_m_s2(axle, size, steer_rad)
        })
    }
}

/// What becomes of the size of a lateral acceleration, to its side, over its slope where that is small.
fn of_slope_one(lateral_m_s2: f64, bent: impl Fn(f64) -> f64) -> f64 {
    const STEP_M_S2: f64 = 1e-3;
    let slope = (bent(STEP_M_S2) - bent(0.0)) / STEP_M_S2;
    bent(lateral_m_s2.abs()) / slope * lateral_m_s2.signum()
}

/// Which rows count as steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Cut-off of the low-pass that all signals go through, Hz.
    pub cutoff_hz: f64,
    /// Least speed, m/s.
    pub speed_min_m_s: f64,
    /// Greatest lateral acceleration, m/s^2.
    pub lateral_max_m_s2: f64,
    /// Greatest rate of the speed, m/s^2.
    pub speed_rate_max_m_s2: f64,
    /// Greatest yaw acceleration, rad/s^2.
    pub yaw_acceleration_max_rad_s2: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            cutoff_hz: 0.5,
            speed_min_m_s: 2.0,
            lateral_max_m_s2: 2.5,
            speed_rate_max_m_s2: 0.5,
            yaw_acceleration_max_rad_s2: 0.15,
            seed: 1,
        }
    }
}

/// Signals of the steady rows.
struct Steady {
    lateral_m_s2: Vec<f64>,
    curvature_1_m: Vec<f64>,
    steer_rad: Vec<f64>,
    sideslip_rad: Option<Vec<f64>>,
    roll_rad: Option<Vec<f64>>,
    span: Span,
}

impl Steady {
    fn curvatures(&self) -> impl Iterator<Item = f64> {
        self.curvature_1_m.iter().map(|curvature| curvature.abs())
    }

    /// Whether a tenth of the rows at least turns to either side.
    fn to_both_sides(&self) -> bool {
        let rows = self.curvature_1_m.len();
        let left = self.curvature_1_m.iter().filter(|c| **c > 0.0).count();
        10 * left.min(rows - left) >= rows
    }
}

/// Finds the gradients of a vehicle.
///
/// Findings: `understeer_gradient` (rad/(m/s^2), at the road wheels, at small lateral
/// acceleration), `steer_offset` (what the steer angle reads too much, rad), and where sideslip and
/// roll are known `sideslip_gradient` (-d(beta)/d(a_y), rad/(m/s^2)) and `roll_gradient`
/// (rad/(m/s^2)). Beside: characteristic (or critical) speed, the path's mean radius and the
/// gradient at the greatest lateral acceleration that was used.
///
/// # Errors
/// Missing signals, too little steady driving, a range of lateral acceleration that is too small,
/// a path whose curvature is not constant.
pub fn identify(drive: &Drive, body: &Body, options: &Options) -> Result<Findings, Refusal> {
    drive.require(
        WHAT,
        &["speed", "yaw rate", "lateral acceleration", "steer angle"],
    )?;
    let steady = steady(drive, options)?;
    let rear_m = body.axles.cg_to_rear_axle_m;
    let wheelbase_m = body.axles.front_axle_to_cg_m + rear_m;
    let straight = |lateral: f64| lateral;
    let mean_rad = mean(steady.steer_rad.iter().map(|steer| steer.abs()));
    let bent = |body: Body| move |lateral: f64| body.bent(lateral, mean_rad);
    let bent_rear = |body: Body| move |lateral: f64| body.bent_axle(1, lateral, mean_rad);
    let steer: Vec<f64> = steady
        .steer_rad
        .iter()
        .zip(&steady.curvature_1_m)
        .map(|(steer, curvature)| steer - math::atan(wheelbase_m * curvature))
        .collect();
    let both_sides = steady.to_both_sides();
    let own = bent(*body);
    let others = body.varied().map(bent);
    let main = Gradient::varied(&steady.lateral_m_s2, &steer, &own, &others, both_sides)?;
    let mut found = Findings {
        what: WHAT.to_owned(),
        ..Findings::default()
    };
    let seed = options.seed;
    found
        .findings
        .push(main.finding("understeer_gradient", "rad/(m/s^2)", 1, 1.0, &steady, seed));
    found
        .findings
        .push(main.finding("steer_offset", "rad", 0, 1.0, &steady, seed));
    if let Some(sideslip) = &steady.sideslip_rad {
        let turned: Vec<f64> = sideslip
            .iter()
            .zip(&steady.curvature_1_m)
            .map(|(sideslip, curvature)| sideslip - math::atan(rear_m * curvature))
            .collect();
        let own = bent_rear(*body);
        let others = body.varied().map(bent_rear);
        let fit = Gradient::varied(&steady.lateral_m_s2, &turned, &own, &others, both_sides)?;
        let unit = "rad/(m/s^2)";
        found
            .findings
            .push(fit.finding("sideslip_gradient", unit, 1, -1.0, &steady, seed));
    }
    if let Some(roll) = &steady.roll_rad {
        let fit = Gradient::fit(&steady.lateral_m_s2, roll, &straight, false)?;
        found
            .findings
            .push(fit.finding("roll_gradient", "rad/(m/s^2)", 1, 1.0, &steady, seed));
    }
    beside(&mut found, &main, &steady, wheelbase_m);
    if !both_sides {
        found.notes.push(ONE_SIDE.to_owned());
    }
    found.figures = vec![figure(&main, &steady, &steer)];
    Ok(found)
}

fn steady(drive: &Drive, options: &Options) -> Result<Steady, Refusal> {
    let dt_s = drive.dt_s;
    let low = |values: &[f64]| smooth(values, dt_s, options.cutoff_hz);
    let step = stride(dt_s, options.cutoff_hz);
    let lateral = low(&drive.lateral_m_s2);
    let speed = low(&drive.speed_m_s);
    let yaw_rate = low(&drive.yaw_rate_rad_s);
    let steer = low(&drive.steer_rad);
    let speed_rate = slope(&drive.speed_m_s, dt_s, options.cutoff_hz);
    let yaw_dot = slope(&drive.yaw_rate_rad_s, dt_s, options.cutoff_hz);
    let mut left_out = [0_usize; 6];
    let rows: Vec<usize> = (0..drive.rows())
        .step_by(step)
        .filter(|&row| {
            let good = [
                speed[row] >= options.speed_min_m_s,
                lateral[row].abs() <= options.lateral_max_m_s2,
                speed_rate[row].abs() <= options.speed_rate_max_m_s2,
                yaw_dot[row].abs() <= options.yaw_acceleration_max_rad_s2,
                steer[row].is_finite(),
            ];
            let first = good.iter().position(|good| !good);
            if let Some(reason) = first {
                left_out[reason] += 1;
            }
            first.is_none()
        })
        .collect();
    let curvature = |row: usize| yaw_rate[row] / speed[row];
    let even = rows.len();
    let rows = on_the_circle(&rows, &curvature);
    left_out[5] = even - rows.len();
    let span = span_of(&rows, dt_s, step);
    if span.used_s < DATA_MIN_S {
        let why = why_left_out(
            &left_out.map(|rows| rows as f64 * step as f64 * dt_s),
            options,
        );
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s: span.used_s,
            needed_s: DATA_MIN_S,
            help: why + ADVICE,
        });
    }
    let pick = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
    let optional = |values: &[f64]| -> Option<Vec<f64>> {
        let picked = (!values.is_empty()).then(|| pick(&low(values)))?;
        picked
            .iter()
            .all(|value| value.is_finite())
            .then_some(picked)
    };
    let steady = Steady {
        lateral_m_s2: pick(&lateral),
        curvature_1_m: rows.iter().map(|&row| curvature(row)).collect(),
        steer_rad: pick(&steer),
        sideslip_rad: optional(&drive.sideslip_rad),
        roll_rad: optional(&drive.roll_rad),
        span,
    };
    check(&steady)?;
    Ok(steady)
}

/// Which condition leaves out most of a drive; `left_out_s` are the times that the conditions leave out,
/// in the order in which they are tested.
fn why_left_out(left_out_s: &[f64; 6], options: &Options) -> String {
    let reasons = [
        format!("the speed is below {} m/s", options.speed_min_m_s),
        format!(
            "the lateral acceleration is above {} m/s^2",
            options.lateral_max_m_s2
        ),
        format!(
            "the speed changes by more than {} m/s^2",
            options.speed_rate_max_m_s2
        ),
        format!(
            "the yaw rate changes by more than {} rad/s^2",
            options.yaw_acceleration_max_rad_s2
        ),
        "the steer angle is unknown".to_owned(),
        "the curvature is not within a fifth of that of the circle".to_owned(),
    ];
    let all = left_out_s.iter().zip(reasons);
    let most = all.max_by(|(a, _), (b, _)| a.total_cmp(b));
    match most {
        Some((left_out_s, reason)) if *left_out_s > 0.0 => {
            format!("{left_out_s:.0} s are left out because {reason}; ")
        }
        _ => String::new(),
    }
}

/// Rows whose curvature to either side is within a fifth of the middle one: what comes before and
/// after the circle is left out.
fn on_the_circle(rows: &[usize], curvature: &dyn Fn(usize) -> f64) -> Vec<usize> {
    let mut sorted: Vec<f64> = rows.iter().map(|&row| curvature(row).abs()).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(&middle) = sorted.get(sorted.len() / 2) else {
        return Vec::new();
    };
    rows.iter()
        .copied()
        .filter(|&row| (curvature(row).abs() - middle).abs() <= 0.2 * middle)
        .collect()
}

fn check(steady: &Steady) -> Result<(), Refusal> {
    let extreme = |pick: fn(f64, f64) -> f64, start: f64| {
        steady
            .lateral_m_s2
            .iter()
            .map(|a| a.abs())
            .fold(start, pick)
    };
    let range = extreme(f64::max, 0.0) - extreme(f64::min, f64::INFINITY);
    if range < RANGE_MIN_M_S2 {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the range of lateral acceleration on the circle".to_owned(),
            found: range,
            needed: RANGE_MIN_M_S2,
            unit: "m/s^2".to_owned(),
            help: format!(
                "the circle was driven between {:.1} and {:.1} m/s^2; let the speed rise slowly from \
                 walking pace until 4 m/s^2 or more",
                extreme(f64::min, f64::INFINITY),
                extreme(f64::max, 0.0)
            ),
        });
    }
    let curvatures: Vec<f64> = steady.curvatures().collect();
    let stray = spread(&curvatures) / mean(curvatures.iter().copied());
    if stray > STRAY_MAX {
        return Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: "standard deviation of the path's curvature over its mean".to_owned(),
            value: stray,
            expected: format!("{STRAY_MAX} at most; {ADVICE}"),
        });
    }
    Ok(())
}

/// A line over what lateral acceleration becomes.
struct Gradient<'a> {
    fit: Fit,
    bent: &'a dyn Fn(f64) -> f64,
}

impl<'a> Gradient<'a> {
    /// Columns 1 and z; where both sides are driven, the side: what drag and rolling resistance turn
    /// against the bend does not grow with it. To one side it cannot be told from the offset.
    fn fit(
        lateral: &[f64],
        values: &[f64],
        bent: &'a dyn Fn(f64) -> f64,
        both_sides: bool,
    ) -> Result<Self, Refusal> {
        let columns = if both_sides { 3 } else { 2 };
        let design = DMatrix::from_fn(lateral.len(), columns, |i, j| match j {
            0 => 1.0,
            1 => bent(lateral[i]),
            _ => lateral[i].signum(),
        });
        let response = DVector::from_column_slice(values);
        let fit =
            least_squares(&design, &response).map_err(|refusal| refusal.of(WHAT).advise(ADVICE))?;
        Ok(Self { fit, bent })
    }

    /// The same, its deviations widened by what each other bend makes of it.
    fn varied(
        lateral: &[f64],
        values: &[f64],
        bent: &'a dyn Fn(f64) -> f64,
        others: &[impl Fn(f64) -> f64],
        both_sides: bool,
    ) -> Result<Self, Refusal> {
        let mut found = Self::fit(lateral, values, bent, both_sides)?;
        let own = found.fit.coefficients.clone();
        for other in others {
            let moved = Gradient::fit(lateral, values, other, both_sides)?;
            let pairs = moved.fit.coefficients.iter().zip(&own);
            let moved: Vec<f64> = pairs.map(|(moved, own)| moved - own).collect();
            found.fit.doubt(&DVector::from_vec(moved));
        }
        Ok(found)
    }

    fn at(&self, lateral: f64) -> f64 {
        let [offset, gradient] = [self.fit.coefficients[0], self.fit.coefficients[1]];
        let side = self.fit.coefficients.get(2).copied().unwrap_or(0.0);
        offset + gradient * (self.bent)(lateral) + side * lateral.signum()
    }

    /// Slope at a lateral acceleration.
    fn slope_at(&self, lateral: f64) -> f64 {
        const STEP_M_S2: f64 = 1e-3;
        (self.at(lateral + STEP_M_S2) - self.at(lateral - STEP_M_S2)) / (2.0 * STEP_M_S2)
    }

    fn finding(
        &self,
        name: &str,
        unit: &str,
        column: usize,
        sign: f64,
        steady: &Steady,
        seed: u64,
    ) -> Finding {
        let intervals = self.fit.intervals(seed, |moved| vec![sign * moved[column]]);
        Finding {
            name: name.to_owned(),
            value: sign * self.fit.coefficients[column],
            unit: unit.to_owned(),
            sigma: self.fit.sigma(column),
            interval: intervals.map(|intervals| intervals[0]),
            condition: self.fit.condition,
            excitation: (column == 1).then(|| Excitation {
                rms: self.fit.excitation[1],
                unit: "m/s^2".to_owned(),
            }),
            whiteness: Some(self.fit.whiteness),
            span: steady.span,
        }
    }
}

fn beside(found: &mut Findings, main: &Gradient<'_>, steady: &Steady, wheelbase_m: f64) {
    let mut add = |name: &str, value: f64, unit: &str| {
        found.beside.push((name.to_owned(), value, unit.to_owned()));
    };
    let gradient = main.fit.coefficients[1];
    let speed = (wheelbase_m / gradient.abs()).sqrt();
    let kind = if gradient > 0.0 {
        "characteristic_speed"
    } else {
        "critical_speed"
    };
    add(kind, speed, "m/s");
    add("radius", mean(steady.curvatures()).recip(), "m");
    let most = steady
        .lateral_m_s2
        .iter()
        .map(|a| a.abs())
        .fold(0.0, f64::max);
    add("lateral_acceleration_max", most, "m/s^2");
    add(
        "understeer_gradient_at_lateral_acceleration_max",
        main.slope_at(most),
        "rad/(m/s^2)",
    );
}

fn figure(main: &Gradient<'_>, steady: &Steady, steer: &[f64]) -> Figure {
    let degrees = |values: &[f64]| values.iter().map(|v| v.to_degrees()).collect::<Vec<_>>();
    let mut line = steady.lateral_m_s2.clone();
    line.sort_by(f64::total_cmp);
    let fitted: Vec<f64> = line.iter().map(|a| main.at(*a)).collect();
    Figure {
        title: "Steer angle beyond Ackermann's against lateral acceleration".to_owned(),
        x_label: "lateral acceleration (m/s²)".to_owned(),
        y_label: "steer angle less atan(L r/V) (°)".to_owned(),
        series: vec![
            series(
                "measured",
                false,
                steady.lateral_m_s2.clone(),
                degrees(steer),
            ),
            series("fit", true, line, degrees(&fitted)),
        ],
    }
}
