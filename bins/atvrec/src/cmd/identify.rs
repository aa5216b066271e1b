//! `atvrec identify`: identify parameters of the vehicle from logs of drives.

mod handling;
mod outputs;
mod overrides;
mod ride;

use anyhow::Context;
use estimator::finding::{Findings, Refusal};
use estimator::identification::{
    Drive, cornering, friction, inertia, response, roll_centre, roll_pitch, tyre, understeer,
};
use model::steering::SteeringGear;
use model::vehicle::Vehicle;

use crate::cli::{
    IdentifyArgs, IdentifyCommand, InertiaArgs, PendulumKind, ResponseArgs, RollCentreArgs,
    TyreArgs,
};
use crate::cmd::findings;
use crate::exit::{Outcome, UsageError};

use outputs::Outputs;
use overrides::Overrides;
use ride::{Ride, Sense};

/// What a drive's slip angles rest on, and its tyre forces.
const TURNS: [Sense; 3] = [Sense::Inertia, Sense::Velocity, Sense::Steer];
const FORCES: [Sense; 4] = [Sense::Inertia, Sense::Velocity, Sense::Steer, Sense::Strain];

/// Names of the axles, front first.
const AXLES: [&str; 2] = ["front", "rear"];
/// Rounds in which the steer angle is freed of the steering wheel's offset.
const OFFSET_ROUNDS: usize = 2;

/// What a command found.
struct Found {
    title: &'static str,
    vehicle: String,
    logs: Vec<String>,
    results: Vec<Findings>,
    overrides: Overrides,
}

/// Runs the command.
pub fn run(command: &IdentifyCommand) -> anyhow::Result<Outcome> {
    let outputs = Outputs::check(command)?;
    let (found, output) = match command {
        IdentifyCommand::Cornering(args) => (cornering(args)?, &args.output),
        IdentifyCommand::Tyre(args) => (tyre(args)?, &args.shared.output),
        IdentifyCommand::RollPitch(args) => (roll_pitch(args)?, &args.output),
        IdentifyCommand::Inertia(args) => (inertia(args)?, &args.shared.output),
        IdentifyCommand::RollCentre(args) => (roll_centre(args)?, &args.output),
        IdentifyCommand::Understeer(args) => (understeer(args)?, &args.output),
        IdentifyCommand::Response(args) => (response(args)?, &args.shared.output),
        IdentifyCommand::Friction(args) => (friction(args)?, &args.output),
        IdentifyCommand::Handling(args) => return handling::run(args),
    };
    outputs.write(&found)?;
    findings::print(&found.results, output.json)?;
    Ok(Outcome::Good)
}

impl Found {
    fn new(title: &'static str, ride: &Ride) -> Self {
        Self {
            title,
            vehicle: ride.vehicle.name.clone(),
            logs: ride.logs.clone(),
            results: Vec::new(),
            overrides: Overrides::default(),
        }
    }
}

fn cornering(args: &IdentifyArgs) -> anyhow::Result<Found> {
    let mut ride = Ride::read(args, "cornering stiffness", &TURNS)?;
    let mut found = Found::new("cornering", &ride);
    let options = cornering::Options {
        seed: args.seed,
        ..cornering::Options::default()
    };
    let vehicle = &ride.vehicle;
    let body = cornering::Body::of(&roll_centre::of_linkage(vehicle));
    let mut result = cornering::identify(&ride.drive, &body, &options)?;
    if let Ok(gear) = SteeringGear::from_vehicle(vehicle) {
        result = free_of_offset(&mut ride.drive, &gear, result, |drive| {
            cornering::identify(drive, &body, &options)
        })?;
    }
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
        found.overrides.set(&key, 0.5 * of_axle / at_load);
    }
    found.results.push(result);
    Ok(found)
}

/// Finds again what the steering wheel's own offset bends: the gear makes more of it at one angle than at
/// another, where the regression knows one offset of the road wheels. What other methods find stays
/// that of the steer angle as it was read.
fn free_of_offset(
    drive: &mut Drive,
    gear: &SteeringGear,
    mut result: Findings,
    find: impl Fn(&Drive) -> Result<Findings, Refusal>,
) -> Result<Findings, Refusal> {
    let road = |hand_rad: f64| {
        let [left, right, ..] = gear.road_wheels(hand_rad, 0.0);
        0.5 * (left + right)
    };
    let middle_rad = gear.hand_wheel_rad(0.0);
    let mut beside = std::mem::take(&mut result.beside);
    let mut offset_rad = 0.0;
    for _ in 0..OFFSET_ROUNDS {
        let left_rad = result.value("steer_offset")[0];
        let more_rad = gear.hand_wheel_rad(left_rad) - middle_rad;
        offset_rad += more_rad;
        for steer_rad in &mut drive.steer_rad {
            let hand_rad = gear.hand_wheel_rad(*steer_rad);
            *steer_rad += road(hand_rad - more_rad) - road(hand_rad);
        }
        result = find(drive)?;
    }
    let taken_rad = road(middle_rad + offset_rad);
    for finding in &mut result.findings {
        if finding.name == "steer_offset" {
            finding.value += taken_rad;
            finding.interval = finding.interval.map(|ends| ends.map(|end| end + taken_rad));
            let hand_rad = gear.hand_wheel_rad(finding.value) - middle_rad;
            beside.push((
                "steer_offset_at_hand_wheel".to_owned(),
                hand_rad,
                "rad".to_owned(),
            ));
        }
    }
    Ok(Findings { beside, ..result })
}

fn tyre(args: &TyreArgs) -> anyhow::Result<Found> {
    let kinds = kinds(args.model.as_deref())?;
    let ride = Ride::read(&args.shared, "tyre model", &FORCES)?;
    let mut found = Found::new("tyre", &ride);
    let mut refusals = Vec::new();
    for (axle, name) in AXLES.into_iter().enumerate() {
        let file = [&ride.vehicle.front.tyre, &ride.vehicle.rear.tyre][axle];
        let data = ride.tyre(axle);
        for kind in &kinds {
            let held = [file.load_exponent, file.friction];
            match tyre::fit(&data, *kind, file.reference_load_n, held, args.shared.seed) {
                Ok((mut result, _)) => {
                    result.what = format!("{name} {}", result.what);
                    if *kind == tyre::Kind::Fiala {
                        tyre_overrides(&mut found.overrides, name, &result);
                    }
                    found.results.push(result);
                }
                Err(refusal) => {
                    refusals.push((format!("{name} {}", kind.name()), refusal));
                }
            }
        }
    }
    if let (true, Some((what, refusal))) = (found.results.is_empty(), refusals.first()) {
        return Err(anyhow::Error::new(refusal.clone()).context(what.clone()));
    }
    if let Some(last) = found.results.last_mut() {
        let notes = refusals
            .iter()
            .map(|(what, refusal)| format!("{what}: {refusal}"));
        last.notes.extend(notes);
    }
    Ok(found)
}

fn kinds(name: Option<&str>) -> anyhow::Result<Vec<tyre::Kind>> {
    let Some(name) = name else {
        return Ok(tyre::Kind::ALL.to_vec());
    };
    let known = tyre::Kind::ALL.map(tyre::Kind::name).join(", ");
    tyre::Kind::ALL
        .into_iter()
        .find(|kind| kind.name() == name)
        .map(|kind| vec![kind])
        .ok_or_else(|| {
            UsageError(format!(
                "\"{name}\" is not a tyre model; use one of: {known}"
            ))
            .into()
        })
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

fn roll_pitch(args: &IdentifyArgs) -> anyhow::Result<Found> {
    let ride = Ride::read(args, "roll stiffness", &[Sense::Inertia])?;
    let mut found = Found::new("roll-pitch", &ride);
    // The moment acts about the roll axis that the linkage has.
    let vehicle = &roll_centre::of_linkage(&ride.vehicle);
    for (name, axle) in AXLES.into_iter().zip([&vehicle.front, &vehicle.rear]) {
        let key = format!("{name}.roll_centre_height_m");
        found.overrides.set(&key, axle.roll_centre_height_m);
    }
    let body = roll_pitch::Body::of(vehicle);
    let options = roll_pitch::Options {
        seed: args.seed,
        ..roll_pitch::Options::default()
    };
    let result = roll_pitch::identify(&ride.drive, &body, &options)?;
    roll_overrides(&mut found.overrides, vehicle, &result);
    found.results.push(result);
    Ok(found)
}

/// The axles' roll stiffness in the proportion of the file, their sum as found; pitch where it was
/// found.
fn roll_overrides(overrides: &mut Overrides, vehicle: &Vehicle, result: &Findings) {
    let axles = [&vehicle.front, &vehicle.rear];
    let sums = [
        axles
            .map(|axle| axle.roll_stiffness_n_m_rad)
            .iter()
            .sum::<f64>(),
        axles
            .map(|axle| axle.roll_damping_n_m_s_rad)
            .iter()
            .sum::<f64>(),
    ];
    if let (Some(stiffness), Some(damping)) =
        (result.get("roll_stiffness"), result.get("roll_damping"))
    {
        for (name, axle) in AXLES.into_iter().zip(axles) {
            let stiffness = stiffness.value * axle.roll_stiffness_n_m_rad / sums[0];
            overrides.set(&format!("{name}.roll_stiffness_n_m_rad"), stiffness);
            let damping = damping.value.max(0.0) * axle.roll_damping_n_m_s_rad / sums[1];
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

fn inertia(args: &InertiaArgs) -> anyhow::Result<Found> {
    if let Some(kind) = args.pendulum {
        return pendulum(args, kind);
    }
    let ride = Ride::read(
        &args.shared,
        "moment of inertia",
        &[Sense::Inertia, Sense::Strain],
    )?;
    let mut found = Found::new("inertia", &ride);
    let drive = &ride.drive;
    let mut result = inertia::yaw(
        &ride.yaw_moment_n_m(),
        &drive.yaw_rate_rad_s,
        drive.dt_s,
        args.shared.seed,
    )?;
    if ride.fused {
        result.notes.push(
            "the forces in the log are from the fusion filter, which uses the inertia in the vehicle \
             file; for an independent value, replay the log with --method thesis"
                .to_owned(),
        );
    }
    let [roll, pitch, _] = ride.vehicle.body.inertia_kg_m2;
    let yaw = result.value("yaw_inertia")[0];
    found
        .overrides
        .set_list("body.inertia_kg_m2", &[roll, pitch, yaw]);
    found.results = vec![result, inertia::by_formula(&ride.vehicle)];
    Ok(found)
}

fn pendulum(args: &InertiaArgs, kind: PendulumKind) -> anyhow::Result<Found> {
    let needs = |value: Option<f64>, name: &str| {
        value.ok_or_else(|| UsageError(format!("this kind of pendulum needs --{name}")))
    };
    let record = ride::Swing::read(&args.shared, &args.axis)?;
    let mass_kg = args.mass_kg.unwrap_or(record.vehicle.body.mass_kg);
    let hung = match kind {
        PendulumKind::Compound => inertia::Pendulum::Compound {
            mass_kg,
            distance_m: needs(args.arm_m, "arm-m")?,
        },
        PendulumKind::Wires => inertia::Pendulum::Wires {
            mass_kg,
            radius_m: needs(args.arm_m, "arm-m")?,
            length_m: needs(args.length_m, "length-m")?,
        },
        PendulumKind::Springs => inertia::Pendulum::Springs {
            stiffness_n_m_rad: needs(args.stiffness_n_m_rad, "stiffness-n-m-rad")?,
        },
    };
    let seed = args.shared.seed;
    let result = inertia::pendulum(
        &record.rate_rad_s,
        record.dt_s,
        hung,
        args.fixture_kg_m2,
        seed,
    )?;
    let mut overrides = Overrides::default();
    let mut moments = record.vehicle.body.inertia_kg_m2;
    let axis = ["x", "y", "z"].iter().position(|axis| *axis == args.axis);
    moments[axis.unwrap_or(2)] = result.value("inertia")[0];
    overrides.set_list("body.inertia_kg_m2", &moments);
    Ok(Found {
        title: "inertia",
        vehicle: record.vehicle.name.clone(),
        logs: record.logs,
        results: vec![result, inertia::by_formula(&record.vehicle)],
        overrides,
    })
}

fn roll_centre(args: &RollCentreArgs) -> anyhow::Result<Found> {
    let vehicle = ride::vehicle_file(&args.vehicle)?;
    let result = roll_centre::identify(&vehicle)?;
    let mut overrides = Overrides::default();
    for name in AXLES {
        let height_m = result.value(&format!("roll_centre_height_{name}"))[0];
        overrides.set(&format!("{name}.roll_centre_height_m"), height_m);
    }
    Ok(Found {
        title: "roll-centre",
        vehicle: vehicle.name,
        logs: Vec::new(),
        results: vec![result],
        overrides,
    })
}

fn understeer(args: &IdentifyArgs) -> anyhow::Result<Found> {
    let ride = Ride::read(args, "understeer gradient", &TURNS)?;
    let mut found = Found::new("understeer", &ride);
    let body = understeer::Body::of(&ride.vehicle);
    let options = understeer::Options {
        seed: args.seed,
        ..understeer::Options::default()
    };
    found
        .results
        .push(understeer::identify(&ride.drive, &body, &options)?);
    Ok(found)
}

/// Step and frequency response, whichever the drive tells.
fn response(args: &ResponseArgs) -> anyhow::Result<Found> {
    let ride = Ride::read(&args.shared, "response", &[Sense::Inertia, Sense::Steer])?;
    let mut found = Found::new("response", &ride);
    let step = response::step(&ride.drive, args.step_min_deg.to_radians());
    let frequency = response::frequency(&ride.drive, args.window_s, args.shared.seed);
    match (step, frequency) {
        (Ok(step), Ok(frequency)) => found.results = vec![step, frequency],
        (Ok(mut one), Err(refusal)) | (Err(refusal), Ok(mut one)) => {
            one.notes.push(refusal.to_string());
            found.results = vec![one];
        }
        (Err(step), Err(frequency)) => {
            return Err(step).context(format!(
                "the drive gives neither a step response nor a frequency response: {frequency}"
            ));
        }
    }
    Ok(found)
}

fn friction(args: &IdentifyArgs) -> anyhow::Result<Found> {
    let ride = Ride::read(args, "friction", &FORCES)?;
    let mut found = Found::new("friction", &ride);
    let mut refusals: Vec<(&str, Refusal)> = Vec::new();
    for (axle, name) in AXLES.into_iter().enumerate() {
        let file = [&ride.vehicle.front.tyre, &ride.vehicle.rear.tyre][axle];
        let data = ride.tyre(axle);
        match friction::identify(&data, file.reference_load_n, file.load_exponent, args.seed) {
            Ok(mut result) => {
                result.what = format!("{name} {}", result.what);
                let value = result.value("friction")[0];
                found.overrides.set(&format!("{name}.tyre.friction"), value);
                found.results.push(result);
            }
            Err(refusal) => refusals.push((name, refusal)),
        }
    }
    match (found.results.first_mut(), refusals.first()) {
        (None, Some((name, refusal))) => {
            Err(anyhow::Error::new(refusal.clone()).context(format!("{name} axle")))
        }
        (Some(first), Some((name, refusal))) => {
            first.notes.push(format!("{name} axle: {refusal}"));
            Ok(found)
        }
        _ => Ok(found),
    }
}
