//! A tyre model from measured force and slip (section 2.3 of the thesis).
//!
//! Any tyre of `model::tyre` is fitted in pure lateral slip by nonlinear least squares of the
//! lateral force, with an offset of the slip angle: stiffness at a reference load, how it grows
//! with load, friction, and what shape the model has beside. What the data do not move is held: the
//! load's influence where the load hardly varies, friction where the tyre never used 0.4 of its
//! grip.

use model::tyre::{
    Contact, Curve, Law, MagicFormula52, MagicFormula89, Offset, Physical, Rational, Stiffness,
    Tyre,
};
use nalgebra::{DMatrix, DVector};

use super::drive::{series, span_of};
use super::signals::{mean, spread};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Span};
use crate::regression::{Fit, Nonlinear, nonlinear};

const WHAT: &str = "tyre model";
const ADVICE: &str = "drive from straight ahead up to the limit of grip, to both sides";
/// Least data, rows.
const ROWS_MIN: usize = 100;
/// Least standard deviation of the slip angle, rad.
const SLIP_MIN_RAD: f64 = 0.01;
/// Utilisation of grip, |F_y|/F_z, below which friction cannot be told.
pub(super) const UTILISATION_MIN: f64 = 0.4;
/// Standard deviation of a friction that is held, as a part of it: another surface.
const FRICTION_SIGMA: f64 = 0.2;
/// Standard deviation of the load, part of its mean, below which its influence cannot be told.
const LOAD_SPREAD_MIN: f64 = 0.08;

/// Force and slip of one tyre, or of like tyres one after the other; columns of one length, `NaN`
/// where unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// Interval between rows, s.
    pub dt_s: f64,
    /// Normal load, N.
    pub load_n: Vec<f64>,
    /// Slip angle, rad.
    pub slip_angle_rad: Vec<f64>,
    /// Lateral force in the wheel's frame, N.
    pub lateral_n: Vec<f64>,
}

/// Which model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// F_y = -C alpha.
    Linear,
    /// Fiala's parabola.
    Fiala,
    /// The thesis's exponential.
    Exponential,
    /// Dugoff.
    Dugoff,
    /// Magic Formula of 1989.
    Magic89,
    /// Magic Formula 5.2.
    Magic52,
    /// Rational curves after TMeasy.
    Rational,
}

impl Kind {
    /// All models.
    pub const ALL: [Self; 7] = [
        Self::Linear,
        Self::Fiala,
        Self::Exponential,
        Self::Dugoff,
        Self::Magic89,
        Self::Magic52,
        Self::Rational,
    ];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Fiala => "fiala",
            Self::Exponential => "exponential",
            Self::Dugoff => "dugoff",
            Self::Magic89 => "magic-formula-89",
            Self::Magic52 => "magic-formula-52",
            Self::Rational => "rational",
        }
    }

    /// Names, units, start values and sizes of the parameters behind stiffness, offset, load
    /// exponent and friction.
    fn shape(self) -> &'static [(&'static str, f64, f64)] {
        match self {
            Self::Linear | Self::Fiala | Self::Exponential | Self::Dugoff => &[],
            Self::Magic89 | Self::Magic52 => &[("curvature_e", -0.5, 0.5)],
            Self::Rational => &[("peak_slip", 0.4, 0.1)],
        }
    }
}

/// Position of the common parameters.
const STIFFNESS: usize = 0;
const OFFSET: usize = 1;
const EXPONENT: usize = 2;
const FRICTION: usize = 3;

const COMMON: [(&str, &str); 4] = [
    ("cornering_stiffness", "N/rad"),
    ("slip_angle_offset", "rad"),
    ("load_exponent", "-"),
    ("friction", "-"),
];

/// The tyre that a parameter vector means: stiffness at the reference load, slip-angle offset, load
/// exponent, friction, shape.
fn tyre(kind: Kind, p: &[f64], reference_load_n: f64) -> Tyre {
    let (stiffness, exponent, friction) = (p[STIFFNESS], p[EXPONENT], p[FRICTION].max(1e-3));
    let physical = |law| {
        Tyre::Physical(Physical {
            law,
            cornering: Stiffness::Power {
                at_reference: stiffness,
                reference_load_n,
                exponent,
            },
            slip: Stiffness::Constant(1.0),
            friction,
            sliding_friction: friction,
            camber_stiffness_n_rad: 0.0,
            contact_length_m: 0.0,
        })
    };
    match kind {
        Kind::Linear => physical(Law::Linear),
        Kind::Fiala => physical(Law::Fiala),
        Kind::Exponential => physical(Law::Exponential),
        Kind::Dugoff => physical(Law::Dugoff),
        Kind::Magic89 => Tyre::MagicFormula89(Box::new(magic89(p, reference_load_n))),
        Kind::Magic52 => Tyre::MagicFormula52(Box::new(magic52(p, reference_load_n))),
        Kind::Rational => Tyre::Rational(Box::new(rational(p, reference_load_n))),
    }
}

/// D = mu F_z; the slope at the reference load and its growth there give a_3 and a_5 with
/// a_4 = 1.82, the published value.
fn magic89(p: &[f64], reference_load_n: f64) -> MagicFormula89 {
    const A4: f64 = 1.82;
    let load_kn = reference_load_n / 1000.0;
    // Growth of sin(a_4 atan(a_5 F)): n = a_4 x cot(a_4 atan x)/(1 + x^2) with x = a_5 F, solved
    // for x; it falls from 1 at x = 0.
    let growth = |x: f64| {
        let angle = A4 * math::atan(x);
        A4 * x / (1.0 + x * x) * math::cos(angle) / math::sin(angle)
    };
    let wanted = p[EXPONENT].clamp(0.05, 0.999);
    let (mut low, mut high) = (1e-6, 1.15);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if growth(middle) > wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    let x = 0.5 * (low + high);
    let per_degree = p[STIFFNESS] * 1f64.to_radians();
    let mut formula = MagicFormula89::default();
    let a = &mut formula.lateral.0;
    *a = [0.0; 13];
    a[1] = 1000.0 * p[FRICTION];
    a[2] = per_degree / math::sin(A4 * math::atan(x));
    a[3] = A4;
    a[4] = x / load_kn;
    a[7] = p[4];
    formula
}

/// P_DY1 = -mu at any load; K_y = P_KY1 F_z0 sin(2 atan(F_z/(P_KY2 F_z0))) has the given slope and
/// growth at the reference load, which is F_z0.
fn magic52(p: &[f64], reference_load_n: f64) -> MagicFormula52 {
    // With x = 1/P_KY2: sin(2 atan x) = 2x/(1+x^2) grows with the power n = (1-x^2)/(1+x^2).
    let n = p[EXPONENT].clamp(-0.9, 0.999);
    let x = ((1.0 - n) / (1.0 + n)).sqrt();
    let mut formula = MagicFormula52 {
        nominal_load_n: reference_load_n,
        ..MagicFormula52::default()
    };
    let y = &mut formula.lateral;
    (y.pdy1, y.pdy2, y.pdy3) = (-p[FRICTION], 0.0, 0.0);
    (y.pey1, y.pey2, y.pey3, y.pey4) = (p[4], 0.0, 0.0, 0.0);
    y.pky1 = -p[STIFFNESS] / reference_load_n * (1.0 + x * x) / (2.0 * x);
    (y.pky2, y.pky3) = (1.0 / x, 0.0);
    (y.phy1, y.phy2, y.phy3) = (0.0, 0.0, 0.0);
    (y.pvy1, y.pvy2, y.pvy3, y.pvy4) = (0.0, 0.0, 0.0, 0.0);
    formula
}

/// Curves at the reference load and at twice that load; the tyre slides at 0.92 of its peak from
/// 2.5 times the peak's slip.
fn rational(p: &[f64], reference_load_n: f64) -> Rational {
    let slip = p[4].max(1e-3);
    let curve = |times: f64| {
        let peak_n = p[FRICTION] * times * reference_load_n;
        // Below this slope the rational function has a pole near its peak.
        let slope_n = (p[STIFFNESS] * math::powf(times, p[EXPONENT])).max(0.5 * peak_n / slip);
        Curve {
            slope_n,
            peak_n,
            peak_slip: slip,
            sliding_n: 0.92 * peak_n,
            sliding_slip: 2.5 * slip,
        }
    };
    let offset = Offset {
        at_rest: 0.0,
        first_zero: 0.3,
        last_zero: 0.8,
    };
    Rational {
        nominal_load_n: reference_load_n,
        greatest_load_n: 10.0 * reference_load_n,
        longitudinal: [curve(1.0), curve(2.0)],
        lateral: [curve(1.0), curve(2.0)],
        offset: [offset; 2],
        radius_m: 0.3,
        vertical_stiffness_n_m: 1e5,
    }
}

/// Fits a model. `reference_load_n` is the load that the stiffness is given for; `held` are load
/// exponent and friction, used where the data cannot tell them.
///
/// Findings: `cornering_stiffness` (one tyre at the reference load, N/rad), `slip_angle_offset`
/// (rad), `load_exponent`, `friction`, and the model's shape parameter. Beside: root mean square of
/// the residual, and Akaike's criterion, by which models of one log compare.
///
/// # Errors
/// Columns that differ in length, too little data, slip that does not move, a fit that does not
/// settle.
pub fn fit(
    data: &Data,
    kind: Kind,
    reference_load_n: f64,
    held: [f64; 2],
    seed: u64,
) -> Result<(Findings, Tyre), Refusal> {
    let rows = usable(data)?;
    let pick = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
    let (load, slip, force) = (
        pick(&data.load_n),
        pick(&data.slip_angle_rad),
        pick(&data.lateral_n),
    );
    let mut notes = Vec::new();
    let free = free_parameters(kind, &load, &force, held, &mut notes);
    let shape = kind.shape();
    let mut start = vec![start_stiffness(&slip, &force), 0.0, held[0], held[1]];
    let mut scale = vec![start[0], 0.01, 0.3, 0.2];
    start.extend(shape.iter().map(|(_, value, _)| *value));
    scale.extend(shape.iter().map(|(_, _, size)| *size));
    let full = |some: &[f64]| {
        let mut all = start.clone();
        for (place, value) in free.iter().zip(some) {
            all[*place] = *value;
        }
        all
    };
    let model = |all: &[f64]| -> Vec<f64> {
        let tyre = tyre(kind, all, reference_load_n);
        load.iter()
            .zip(&slip)
            .map(|(load, slip)| {
                tyre.forces(&Contact::lateral(*load, slip - all[OFFSET]))
                    .lateral_n
            })
            .collect()
    };
    let problem = Nonlinear {
        start: free.iter().map(|place| start[*place]).collect(),
        scale: free.iter().map(|place| scale[*place]).collect(),
        iterations: 200,
    };
    let with_grip = |part: f64| {
        nonlinear(&problem, |some| {
            let mut all = full(some);
            all[FRICTION] *= part;
            let expected = model(&all);
            force.iter().zip(expected).map(|(f, e)| f - e).collect()
        })
        .map_err(|refusal| refusal.of(WHAT).advise(ADVICE))
    };
    let mut fitted = with_grip(1.0)?;
    let all = full(&fitted.coefficients);
    if kind != Kind::Linear && !free.contains(&FRICTION) {
        // What follows from a friction that is held is as uncertain as this friction.
        let other = DVector::from_vec(with_grip(1.0 + FRICTION_SIGMA)?.coefficients);
        fitted.doubt(&(other - DVector::from_column_slice(&fitted.coefficients)));
    }
    let span = span_of(&rows, data.dt_s, 1);
    let mut found = findings(kind, &fitted, &free, span, seed);
    found.beside = beside(&fitted, free.len(), reference_load_n);
    found.notes = notes;
    found.figures = vec![figure(kind, &slip, &force, &model(&all))];
    Ok((found, tyre(kind, &all, reference_load_n)))
}

/// Root mean square of the residual, Akaike's criterion and reference load.
fn beside(fit: &Fit, parameters: usize, reference_load_n: f64) -> Vec<(String, f64, String)> {
    let rms = fit.residual_rms();
    let size = fit.residuals.len() as f64;
    let criterion = 2.0 * size * math::ln(rms) + 2.0 * parameters as f64;
    [
        ("residual_rms", rms, "N"),
        ("akaike_criterion", criterion, "-"),
        ("reference_load", reference_load_n, "N"),
    ]
    .map(|(name, value, unit)| (name.to_owned(), value, unit.to_owned()))
    .to_vec()
}

fn usable(data: &Data) -> Result<Vec<usize>, Refusal> {
    let expected = data.load_n.len();
    for (name, column) in [
        ("slip angle", &data.slip_angle_rad),
        ("lateral force", &data.lateral_n),
    ] {
        if column.len() != expected {
            return Err(Refusal::Length {
                what: WHAT.to_owned(),
                name: name.to_owned(),
                found: column.len(),
                expected,
            });
        }
    }
    let rows: Vec<usize> = (0..expected)
        .filter(|&row| {
            data.load_n[row] > 50.0 && (data.slip_angle_rad[row] + data.lateral_n[row]).is_finite()
        })
        .collect();
    if rows.is_empty() {
        return Err(Refusal::Missing {
            what: WHAT.to_owned(),
            channel: "lateral force with load and slip angle".to_owned(),
            help: "it needs strain and deflection for the forces, GNSS for the slip angles"
                .to_owned(),
        });
    }
    if rows.len() < ROWS_MIN {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s: rows.len() as f64 * data.dt_s,
            needed_s: ROWS_MIN as f64 * data.dt_s,
            help: ADVICE.to_owned(),
        });
    }
    let slips: Vec<f64> = rows.iter().map(|&row| data.slip_angle_rad[row]).collect();
    let found = spread(&slips);
    if found < SLIP_MIN_RAD {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the slip angle's standard deviation".to_owned(),
            found,
            needed: SLIP_MIN_RAD,
            unit: "rad".to_owned(),
            help: ADVICE.to_owned(),
        });
    }
    Ok(rows)
}

/// The parameters that the data tell.
fn free_parameters(
    kind: Kind,
    load: &[f64],
    force: &[f64],
    held: [f64; 2],
    notes: &mut Vec<String>,
) -> Vec<usize> {
    let mut free = vec![STIFFNESS, OFFSET];
    let varies = spread(load) / mean(load.iter().copied());
    if varies >= LOAD_SPREAD_MIN {
        free.push(EXPONENT);
    } else {
        notes.push(format!(
            "the load varies by {:.1} % only: the load exponent is held at {}",
            100.0 * varies,
            held[0]
        ));
    }
    let most = percentile_99(force.iter().zip(load).map(|(f, l)| f.abs() / l).collect());
    if kind == Kind::Linear {
        return free;
    }
    if most >= UTILISATION_MIN {
        free.push(FRICTION);
        free.extend((0..kind.shape().len()).map(|k| FRICTION + 1 + k));
    } else {
        notes.push(format!(
            "the tyre used {most:.2} of its load, less than {UTILISATION_MIN}: friction is held at \
             {}, and the shape with it",
            held[1]
        ));
    }
    free
}

/// Greatest part of its load that a tyre used: 99th percentile of |F_y|/F_z.
pub(super) fn utilisation(data: &Data) -> f64 {
    let rows = data.lateral_n.iter().zip(&data.load_n);
    percentile_99(
        rows.filter(|(_, load)| **load > 50.0)
            .map(|(force, load)| force.abs() / load)
            .filter(|part| part.is_finite())
            .collect(),
    )
}

pub(super) fn percentile_99(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values
        .get(values.len().saturating_sub(1) * 99 / 100)
        .copied()
        .unwrap_or(0.0)
}

/// Least squares of force on the smaller half of the slip angles.
fn start_stiffness(slip: &[f64], force: &[f64]) -> f64 {
    let limit = 0.7 * spread(slip);
    let (mut above, mut below) = (0.0, 0.0);
    for (slip, force) in slip
        .iter()
        .zip(force)
        .filter(|(slip, _)| slip.abs() < limit)
    {
        above -= slip * force;
        below += slip * slip;
    }
    if below > 0.0 && above > 0.0 {
        above / below
    } else {
        5000.0
    }
}

fn findings(kind: Kind, fit: &Fit, free: &[usize], span: Span, seed: u64) -> Findings {
    let intervals = fit.intervals(seed, <[f64]>::to_vec);
    let named = |place: usize| {
        COMMON.get(place).copied().unwrap_or_else(|| {
            kind.shape()
                .get(place - COMMON.len())
                .map_or(("shape", "-"), |(name, _, _)| (name, "-"))
        })
    };
    let findings = free.iter().enumerate().map(|(j, place)| {
        let (name, unit) = named(*place);
        Finding {
            name: name.to_owned(),
            value: fit.coefficients[j],
            unit: unit.to_owned(),
            sigma: fit.sigma(j),
            interval: intervals.as_ref().map(|intervals| intervals[j]),
            condition: fit.condition,
            excitation: Some(Excitation {
                rms: fit.excitation[j],
                unit: format!("N/({unit})"),
            }),
            whiteness: Some(fit.whiteness),
            span,
        }
    });
    let covariance: &DMatrix<f64> = &fit.covariance;
    Findings {
        what: format!("{WHAT} ({})", kind.name()),
        findings: findings.collect(),
        covariance: (0..free.len())
            .map(|i| (0..free.len()).map(|j| covariance[(i, j)]).collect())
            .collect(),
        ..Findings::default()
    }
}

fn figure(kind: Kind, slip: &[f64], force: &[f64], expected: &[f64]) -> Figure {
    let degrees: Vec<f64> = slip.iter().map(|v| v.to_degrees()).collect();
    Figure {
        title: format!("Lateral force against slip angle ({})", kind.name()),
        x_label: "slip angle (°)".to_owned(),
        y_label: "lateral force (N)".to_owned(),
        series: vec![
            series("measured", false, degrees.clone(), force.to_vec()),
            series("model", false, degrees, expected.to_vec()),
        ],
    }
}
