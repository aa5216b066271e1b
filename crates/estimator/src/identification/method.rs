//! One method applied to a recorded drive: what it found, and which fields of the vehicle file that
//! replaces.

use model::vehicle::{Tyre, Vehicle};

use super::{
    Overrides, Recorded, aligning, camber, cornering, friction, inertia, pressure, response,
    roll_centre, roll_pitch, slip, toe, tyre, understeer,
};
use crate::EstimatorError;
use crate::finding::{Findings, Refusal};

/// Names of the axles, front first.
pub(super) const AXLES: [&str; 2] = ["front", "rear"];

/// Sensors on which the estimates of a drive depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Rates and accelerations.
    Inertia,
    /// Speed over ground and sideslip.
    Velocity,
    /// The steering wheel.
    Steer,
    /// Tyre forces.
    Strain,
    /// Wheel speeds.
    WheelSpeed,
}

impl Sense {
    /// Name of the channel.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inertia => "inertial unit",
            Self::Velocity => "GNSS velocity",
            Self::Steer => "steer angle",
            Self::Strain => "strain",
            Self::WheelSpeed => "wheel speed",
        }
    }
}

/// A method of identification that takes a drive.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// Cornering stiffness of the axles.
    Cornering,
    /// Tyre models of these kinds.
    Tyre(Vec<tyre::Kind>),
    /// Roll and pitch stiffness and damping.
    RollPitch,
    /// Yaw inertia.
    YawInertia,
    /// Understeer gradient.
    Understeer,
    /// Step and frequency response, whichever the drive has.
    Response {
        /// Least step of the steer angle, rad.
        step_min_rad: f64,
        /// Length of the windows of the frequency response, s.
        window_s: f64,
    },
    /// Friction of the tyres.
    Friction,
    /// Longitudinal stiffness of the tyres.
    Slip,
    /// Camber stiffness of the tyres.
    Camber,
    /// Pneumatic trail of the tyres.
    Aligning,
    /// Toe compliance and play of the front wheels.
    Toe,
}

/// What a method found.
#[derive(Clone, Debug, Default)]
pub struct Identified {
    /// The findings.
    pub results: Vec<Findings>,
    /// Fields of the vehicle file that they replace.
    pub overrides: Overrides,
}

impl Identified {
    /// Adds the results of another method; its fields go before those of this one.
    pub fn extend(&mut self, other: Self) {
        self.results.extend(other.results);
        self.overrides.extend(other.overrides);
    }
}

impl Method {
    /// Name of the command.
    #[must_use]
    pub const fn title(&self) -> &'static str {
        match self {
            Self::Cornering => "cornering",
            Self::Tyre(_) => "tyre",
            Self::RollPitch => "roll-pitch",
            Self::YawInertia => "inertia",
            Self::Understeer => "understeer",
            Self::Response { .. } => "response",
            Self::Friction => "friction",
            Self::Slip => "slip",
            Self::Camber => "camber",
            Self::Aligning => "aligning",
            Self::Toe => "toe",
        }
    }

    /// What is looked for, in words.
    #[must_use]
    pub const fn what(&self) -> &'static str {
        match self {
            Self::Cornering => "cornering stiffness",
            Self::Tyre(_) => "tyre model",
            Self::RollPitch => "roll stiffness",
            Self::YawInertia => "moment of inertia",
            Self::Understeer => "understeer gradient",
            Self::Response { .. } => "response",
            Self::Friction => "friction",
            Self::Slip => "longitudinal stiffness",
            Self::Camber => "camber stiffness",
            Self::Aligning => "aligning moment",
            Self::Toe => "toe compliance",
        }
    }

    /// What must have been measured in the drive: estimates without it are the vehicle file's.
    #[must_use]
    pub const fn senses(&self) -> &'static [Sense] {
        match self {
            Self::Cornering | Self::Understeer => &[Sense::Inertia, Sense::Velocity, Sense::Steer],
            Self::Tyre(_) | Self::Friction | Self::Camber => {
                &[Sense::Inertia, Sense::Velocity, Sense::Steer, Sense::Strain]
            }
            Self::Slip => &[
                Sense::Inertia,
                Sense::Velocity,
                Sense::WheelSpeed,
                Sense::Strain,
            ],
            Self::Toe => &[Sense::Inertia, Sense::Steer, Sense::Strain],
            Self::Aligning => &[Sense::Inertia, Sense::Velocity, Sense::Strain],
            Self::RollPitch => &[Sense::Inertia],
            Self::YawInertia => &[Sense::Inertia, Sense::Strain],
            Self::Response { .. } => &[Sense::Inertia, Sense::Steer],
        }
    }

    /// Applies the method; `seed` is that of the bootstrap.
    ///
    /// # Errors
    /// If the drive does not tell what is looked for.
    pub fn identify(&self, recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
        let mut found = self.apply(recorded, seed)?;
        pressure::to_nominal(&mut found.overrides, recorded);
        Ok(found)
    }

    fn apply(&self, recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
        match self {
            Self::Cornering => cornering(recorded, seed),
            Self::Tyre(kinds) => tyre(recorded, kinds, seed),
            Self::RollPitch => roll_pitch(recorded, seed),
            Self::YawInertia => yaw_inertia(recorded, seed),
            Self::Understeer => {
                let body = understeer::Body::of(&recorded.vehicle);
                let options = understeer::Options {
                    seed,
                    ..understeer::Options::default()
                };
                let found = understeer::identify(&recorded.drive, &body, &options)?;
                Ok(Identified {
                    results: vec![found],
                    ..Identified::default()
                })
            }
            Self::Response {
                step_min_rad,
                window_s,
            } => response(recorded, *step_min_rad, *window_s, seed),
            Self::Friction => friction(recorded, seed),
            Self::Slip => slip(recorded, seed),
            Self::Camber => camber(recorded, seed),
            Self::Aligning => aligning(recorded, seed),
            Self::Toe => toe(recorded, seed),
        }
    }
}

fn cornering(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    let options = cornering::Options {
        seed,
        ..cornering::Options::default()
    };
    let vehicle = &recorded.vehicle;
    let result = cornering::of_vehicle(&recorded.drive, vehicle, &options)?;
    let mut overrides = Overrides::default();
    let body = &vehicle.body;
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let weight_n = body.mass_kg * sample::STANDARD_GRAVITY_M_S2;
    let axles = [(&vehicle.front, b), (&vehicle.rear, a)];
    for (name, (axle, arm)) in AXLES.into_iter().zip(axles) {
        // The file's stiffness is one tyre's, at its reference load.
        let load_n = 0.5 * weight_n * arm / (a + b);
        let at_load = math::powf(load_n / axle.tyre.reference_load_n, axle.tyre.load_exponent);
        let of_axle = result.value(&format!("cornering_stiffness_{name}"))[0];
        let key = format!("{name}.tyre.cornering_stiffness_n_rad");
        overrides.set(&key, 0.5 * of_axle / at_load);
    }
    Ok(Identified {
        results: vec![result],
        overrides,
    })
}

fn tyre(
    recorded: &Recorded,
    kinds: &[tyre::Kind],
    seed: u64,
) -> Result<Identified, EstimatorError> {
    let mut found = Identified::default();
    let mut refusals = Vec::new();
    for (axle, name) in AXLES.into_iter().enumerate() {
        let file = [&recorded.vehicle.front.tyre, &recorded.vehicle.rear.tyre][axle];
        let data = recorded.tyre(axle);
        for kind in kinds {
            let held = [file.load_exponent, file.friction];
            match tyre::fit(&data, *kind, file.reference_load_n, held, seed) {
                Ok((mut result, _)) => {
                    result.what = format!("{name} {}", result.what);
                    pressure::note(&mut result, recorded, axle);
                    if *kind == tyre::Kind::Fiala {
                        tyre_overrides(&mut found.overrides, name, &result);
                    }
                    found.results.push(result);
                }
                Err(refusal) => refusals.push((format!("{name} {}", kind.name()), refusal)),
            }
        }
    }
    let notes: Vec<String> = refusals
        .iter()
        .map(|(part, refusal)| format!("{part}: {refusal}"))
        .collect();
    match (found.results.last_mut(), refusals.into_iter().next()) {
        (None, Some((part, refusal))) => return Err(part_refused(part, refusal)),
        (Some(last), _) => last.notes.extend(notes),
        (None, None) => {}
    }
    Ok(found)
}

fn tyre_overrides(overrides: &mut Overrides, axle: &str, result: &Findings) {
    let fields = [
        ("cornering_stiffness", "cornering_stiffness_n_rad"),
        ("load_exponent", "load_exponent"),
        ("friction", "friction"),
    ];
    for (name, field) in fields {
        if let Some(finding) = result.get(name) {
            overrides.set(&format!("{axle}.tyre.{field}"), finding.value);
        }
    }
}

fn roll_pitch(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    let mut overrides = Overrides::default();
    // The moment acts about the roll axis that the linkage has.
    let vehicle = &roll_centre::of_linkage(&recorded.vehicle);
    for (name, axle) in AXLES.into_iter().zip([&vehicle.front, &vehicle.rear]) {
        let key = format!("{name}.roll_centre_height_m");
        overrides.set(&key, axle.roll_centre_height_m);
    }
    let body = roll_pitch::Body::of(vehicle);
    let options = roll_pitch::Options {
        seed,
        ..roll_pitch::Options::default()
    };
    let result = roll_pitch::identify(&recorded.drive, &body, &options)?;
    roll_overrides(&mut overrides, vehicle, &result);
    Ok(Identified {
        results: vec![result],
        overrides,
    })
}

/// Toe of the front wheels that have a sensor.
fn toe(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    let mut found = Identified::default();
    let steering = &recorded.vehicle.steering;
    let mut compliance_rad_n = steering.toe_compliance_rad_n;
    let mut play_rad = steering.toe_play_rad;
    for (side, name) in ["left", "right"].into_iter().enumerate() {
        let data = recorded.toe(side);
        if data.difference_rad.iter().all(|angle| angle.is_nan()) {
            continue;
        }
        let result = toe::identify(&data, side, recorded.drive.dt_s, seed)?;
        compliance_rad_n[side] = result.value(&format!("toe_compliance_{name}"))[0];
        play_rad[side] = result.value(&format!("toe_play_{name}"))[0].max(0.0);
        found.results.push(result);
    }
    if found.results.is_empty() {
        return Err(Refusal::Missing {
            what: Method::Toe.what().to_owned(),
            channel: "angle of a front wheel".to_owned(),
            help: "record a sensor at a front wheel as the role steer_left or steer_right, with an angle as its unit"
                .to_owned(),
        }
        .into());
    }
    let overrides = &mut found.overrides;
    overrides.set_list("steering.toe_compliance_rad_n", &compliance_rad_n);
    overrides.set_list("steering.toe_play_rad", &play_rad);
    Ok(found)
}

/// The axles' roll stiffness in the proportion of the file, their sum as found; pitch where it was
/// found.
fn roll_overrides(overrides: &mut Overrides, vehicle: &Vehicle, result: &Findings) {
    let axles = [&vehicle.front, &vehicle.rear];
    let stiffness_n_m_rad: f64 = axles.iter().map(|axle| axle.roll_stiffness_n_m_rad).sum();
    let damping_n_m_s_rad: f64 = axles.iter().map(|axle| axle.roll_damping_n_m_s_rad).sum();
    if let (Some(stiffness), Some(damping)) =
        (result.get("roll_stiffness"), result.get("roll_damping"))
    {
        for (name, axle) in AXLES.into_iter().zip(axles) {
            let stiffness = stiffness.value * axle.roll_stiffness_n_m_rad / stiffness_n_m_rad;
            overrides.set(&format!("{name}.roll_stiffness_n_m_rad"), stiffness);
            let damping = damping.value.max(0.0) * axle.roll_damping_n_m_s_rad / damping_n_m_s_rad;
            if damping.is_finite() {
                overrides.set(&format!("{name}.roll_damping_n_m_s_rad"), damping);
            }
        }
    }
    if let (Some(stiffness), Some(damping)) =
        (result.get("pitch_stiffness"), result.get("pitch_damping"))
    {
        let centre_m = vehicle.pitch().centre_height_m;
        overrides.set("body.pitch.centre_height_m", centre_m);
        overrides.set("body.pitch.stiffness_n_m_rad", stiffness.value);
        overrides.set("body.pitch.damping_n_m_s_rad", damping.value.max(0.0));
    }
}

fn yaw_inertia(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    let drive = &recorded.drive;
    let mut result = inertia::yaw(
        &recorded.yaw_moment_n_m(),
        &drive.yaw_rate_rad_s,
        drive.dt_s,
        seed,
    )?;
    if recorded.fused {
        result.notes.push(
            "the forces in the log are from the fusion filter, which uses the inertia in the vehicle \
             file; for an independent value, replay the log with --method thesis"
                .to_owned(),
        );
    }
    let mut overrides = Overrides::default();
    let [roll, pitch, _] = recorded.vehicle.body.inertia_kg_m2;
    let yaw = result.value("yaw_inertia")[0];
    overrides.set_list("body.inertia_kg_m2", &[roll, pitch, yaw]);
    Ok(Identified {
        results: vec![result, inertia::by_formula(&recorded.vehicle)],
        overrides,
    })
}

/// Step and frequency response, whichever the drive has.
fn response(
    recorded: &Recorded,
    step_min_rad: f64,
    window_s: f64,
    seed: u64,
) -> Result<Identified, EstimatorError> {
    let step = response::step(&recorded.drive, step_min_rad);
    let frequency = response::frequency(&recorded.drive, window_s, seed);
    let results = match (step, frequency) {
        (Ok(step), Ok(frequency)) => vec![step, frequency],
        (Ok(mut one), Err(refusal)) | (Err(refusal), Ok(mut one)) => {
            one.notes.push(refusal.to_string());
            vec![one]
        }
        (Err(refusal), Err(frequency)) => {
            let part = format!(
                "the drive gives neither a step response nor a frequency response: {frequency}"
            );
            return Err(part_refused(part, refusal));
        }
    };
    Ok(Identified {
        results,
        ..Identified::default()
    })
}

fn friction(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    of_axles(recorded, |axle, file| {
        let data = recorded.tyre(axle);
        let result = friction::identify(&data, file.reference_load_n, file.load_exponent, seed)?;
        let value = result.value("friction")[0];
        Ok((result, Some(("friction", value))))
    })
}

fn slip(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    let tyres = [&recorded.vehicle.front.tyre, &recorded.vehicle.rear.tyre];
    let options = tyres.map(|file| slip::Options {
        dt_s: recorded.drive.dt_s,
        reference_load_n: file.reference_load_n,
        load_exponent: file.load_exponent,
        friction: file.friction,
        radius_m: file.unloaded_radius_m,
        vertical_stiffness_n_m: file.vertical_stiffness_n_m,
        seed,
    });
    let wheels = [0, 1].map(|axle| recorded.rolling(axle));
    let found = slip::identify(wheels.each_ref(), options.each_ref());
    of_axles(recorded, |axle, _| {
        let result = found[axle].clone()?;
        let value = result.value("slip_stiffness")[0];
        Ok((result, Some(("slip_stiffness_n", value))))
    })
}

fn camber(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    of_axles(recorded, |axle, file| {
        let options = camber::Options {
            dt_s: recorded.drive.dt_s,
            reference_load_n: file.reference_load_n,
            load_exponent: file.load_exponent,
            friction: file.friction,
            file_stiffness_n_rad: file.camber_stiffness_n_rad,
            vertical_m_s2: recorded.vertical_m_s2,
            seed,
        };
        let result = camber::identify(&recorded.cambered(axle), &options)?;
        let value = result.value("camber_stiffness")[0].max(0.0);
        Ok((result, Some(("camber_stiffness_n_rad", value))))
    })
}

fn aligning(recorded: &Recorded, seed: u64) -> Result<Identified, EstimatorError> {
    of_axles(recorded, |axle, file| {
        let pressed_m = file.reference_load_n / file.vertical_stiffness_n_m;
        let options = aligning::Options {
            dt_s: recorded.drive.dt_s,
            reference_load_n: file.reference_load_n,
            friction: file.friction,
            cornering_n_rad: file.cornering_stiffness_n_rad,
            // A sixth of the length of the contact patch.
            file_trail_m: (2.0 * file.unloaded_radius_m * pressed_m).sqrt() / 3.0,
            seed,
        };
        // The vehicle file has no field for the trail.
        Ok((
            aligning::identify(&recorded.aligning(axle), &options)?,
            None,
        ))
    })
}

/// Findings of an axle, and a field of its tyre that they replace.
type OfAxle = (Findings, Option<(&'static str, f64)>);

/// Applies a method to each axle. An axle that is refused is a note of the other one.
fn of_axles(
    recorded: &Recorded,
    identify: impl Fn(usize, &Tyre) -> Result<OfAxle, Refusal>,
) -> Result<Identified, EstimatorError> {
    let mut found = Identified::default();
    let mut refusals: Vec<(String, Refusal)> = Vec::new();
    for (axle, name) in AXLES.into_iter().enumerate() {
        let file = [&recorded.vehicle.front.tyre, &recorded.vehicle.rear.tyre][axle];
        match identify(axle, file) {
            Ok((mut result, field)) => {
                result.what = format!("{name} {}", result.what);
                if let Some((field, value)) = field {
                    found.overrides.set(&format!("{name}.tyre.{field}"), value);
                }
                found.results.push(result);
            }
            Err(refusal) => refusals.push((format!("{name} axle"), refusal)),
        }
    }
    match (found.results.first_mut(), refusals.into_iter().next()) {
        (None, Some((part, refusal))) => return Err(part_refused(part, refusal)),
        (Some(first), Some((part, refusal))) => first.notes.push(format!("{part}: {refusal}")),
        _ => {}
    }
    Ok(found)
}

fn part_refused(part: String, refusal: Refusal) -> EstimatorError {
    EstimatorError::Part {
        part,
        refusal: Box::new(refusal),
    }
}

/// Inertia of a vehicle that swings as a pendulum: its rate about `axis` (0 to 2 for x to z), rad/s,
/// on a grid of `dt_s`.
///
/// # Errors
/// As [`inertia::pendulum`].
pub fn swing(
    vehicle: &Vehicle,
    rate_rad_s: &[f64],
    dt_s: f64,
    axis: usize,
    hung: inertia::Pendulum,
    fixture_kg_m2: f64,
    seed: u64,
) -> Result<Identified, EstimatorError> {
    let result = inertia::pendulum(rate_rad_s, dt_s, hung, fixture_kg_m2, seed)?;
    let mut moments = vehicle.body.inertia_kg_m2;
    moments[axis] = result.value("inertia")[0];
    let mut overrides = Overrides::default();
    overrides.set_list("body.inertia_kg_m2", &moments);
    Ok(Identified {
        results: vec![result, inertia::by_formula(vehicle)],
        overrides,
    })
}

/// Height of both roll centres, from the vehicle's hard-points.
///
/// # Errors
/// As [`roll_centre::identify`].
pub fn roll_centres(vehicle: &Vehicle) -> Result<Identified, EstimatorError> {
    let result = roll_centre::identify(vehicle)?;
    let mut overrides = Overrides::default();
    for name in AXLES {
        let height_m = result.value(&format!("roll_centre_height_{name}"))[0];
        overrides.set(&format!("{name}.roll_centre_height_m"), height_m);
    }
    Ok(Identified {
        results: vec![result],
        overrides,
    })
}
