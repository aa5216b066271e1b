//! Figures of forces, motion and grip.

use super::curves::{Curves, Spec};
use super::{Candidate, NO_ESTIMATES, WHEELS, panel, timed};
use crate::drive::Grip;
use crate::options::Quantity;
use crate::plot::{Data, Panel, Pen, Trace};

const NO_FORCES: &str = "no tyre forces are estimated; they need a vehicle file, and an inertial unit \
     with a speed and the steering wheel, or sensors on the suspension";

/// Forces of the wheels, and those of the axles.
pub fn forces(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let axes = [
        (
            "y",
            "lateral",
            "Lateral force",
            "Left is positive: in a left turn all four are positive. The band is one standard deviation.",
        ),
        (
            "z",
            "vertical",
            "Vertical force",
            "Load of each wheel. A curve that runs towards zero is a wheel about to lift.",
        ),
        (
            "x",
            "longitudinal",
            "Longitudinal force",
            "Drive is positive, braking negative.",
        ),
    ];
    for (axis, id, title, caption) in axes {
        let mut panels = Vec::new();
        for (wheel, heading) in WHEELS {
            let column = format!("{wheel}.{axis}_n");
            let sigma = format!("{wheel}.{axis}_sigma_n");
            let label = format!("F{axis} ({})", curves.unit(Quantity::Force));
            let spec = Spec::new("estimate", &column, Quantity::Force)
                .sigma(&sigma)
                .important();
            let drive = curves.drive;
            let reference = curves.reference.map(|r| (&r.forces, r));
            let mut pair = curves.compared(&drive.forces, reference, &label, &[spec]);
            let model = Spec::new("model", &column, Quantity::Force).pen(Pen::Expected);
            pair[0].traces.extend(curves.curve(&drive.model, model));
            pair[0].heading = heading.to_owned();
            panels.extend(pair);
        }
        all.push((timed(id, title, caption, panels), NO_FORCES));
    }
    axle_forces(curves, all);
}

/// Sums of both wheels of an axle: of the estimated forces, or of those of the model.
fn axle_forces(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let (factor, unit) = curves.options.units.of(Quantity::Force);
    let mut panels = Vec::new();
    for (heading, [left, right]) in [("front axle", ["fl", "fr"]), ("rear axle", ["rl", "rr"])] {
        let mut one = panel(format!("Fy ({unit})"), None);
        one.heading = heading.to_owned();
        for (frame, name, pen) in [
            (&drive.forces, "estimate", Pen::Measured),
            (&drive.model, "model", Pen::Expected),
        ] {
            let sides = [left, right].map(|wheel| frame.get(&format!("{wheel}.y_n")));
            let [Some(left), Some(right)] = sides else {
                continue;
            };
            let sum = left.iter().zip(right);
            let sum = sum
                .map(|(a, b)| (f64::from(a + b) * factor) as f32)
                .collect();
            let spec = Spec::new(name, "", Quantity::Force).pen(pen);
            one.traces
                .extend(curves.of_values(&frame.time_s, sum, None, spec));
        }
        panels.push(one);
    }
    let caption = "Lateral force of both wheels of an axle together.";
    all.push((
        timed("axle-forces", "Axle forces", caption, panels),
        NO_ESTIMATES,
    ));
}

/// Figures of the motion.
pub fn motion(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    speed(curves, all);
    super::steer::all(curves, all);
    let rates = [
        Spec::new("roll rate", "roll_rate_rad_s", Quantity::Rate).pen(Pen::Other(0)),
        Spec::new("pitch rate", "pitch_rate_rad_s", Quantity::Rate).pen(Pen::Other(1)),
        Spec::new("yaw rate", "yaw_rate_rad_s", Quantity::Rate)
            .pen(Pen::Other(2))
            .important(),
    ];
    let panels = labelled(curves, "rate", &rates);
    all.push((
        timed("rates", "Angular rates", "Body axes.", panels),
        NO_ESTIMATES,
    ));
    slip(curves, all);
    rollover(curves, all);
    let attitude = [
        Spec::new("roll", "roll_rad", Quantity::Angle)
            .pen(Pen::Other(0))
            .important(),
        Spec::new("pitch", "pitch_rad", Quantity::Angle)
            .pen(Pen::Other(1))
            .important(),
    ];
    let panels = labelled(curves, "angle", &attitude);
    let caption = "Right side down and nose down are positive.";
    all.push((
        timed("attitude", "Roll and pitch", caption, panels),
        NO_ESTIMATES,
    ));
    let acceleration = [
        Spec::new("forward", "acceleration_m_s2.x", Quantity::Acceleration)
            .pen(Pen::Other(0))
            .important(),
        Spec::new("leftward", "acceleration_m_s2.y", Quantity::Acceleration)
            .pen(Pen::Other(1))
            .important(),
    ];
    let panels = labelled(curves, "acceleration", &acceleration);
    let caption = "Of the centre of gravity, without gravity.";
    all.push((
        timed("acceleration", "Acceleration", caption, panels),
        NO_ESTIMATES,
    ));
}

/// Panels of the motion with the unit of their first curve in the label.
fn labelled(curves: &mut Curves<'_>, name: &str, specs: &[Spec<'_>]) -> Vec<Panel> {
    let label = format!("{name} ({})", curves.unit(specs[0].quantity));
    curves.motion_panels(&label, specs)
}

/// Sideslip and slip angles.
fn slip(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let sideslip = Spec::new("sideslip", "sideslip_rad", Quantity::Angle)
        .sigma("sideslip_sigma_rad")
        .important()
        .needs_speed();
    let panels = labelled(curves, "sideslip", &[sideslip]);
    let caption = "At the centre of gravity, with one standard deviation. Below walking pace the \
                   angle means little and is left out.";
    all.push((
        timed("sideslip", "Sideslip angle", caption, panels),
        NO_ESTIMATES,
    ));
    let mut panels = Vec::new();
    for (wheel, heading) in WHEELS {
        let column = format!("{wheel}.slip_angle_rad");
        let spec = Spec::new("slip angle", &column, Quantity::Angle).needs_speed();
        let mut pair = labelled(curves, "slip angle", &[spec]);
        heading.clone_into(&mut pair[0].heading);
        panels.extend(pair);
    }
    let caption = "A positive slip angle gives a negative lateral force.";
    all.push((
        timed("slip-angles", "Slip angles", caption, panels),
        NO_ESTIMATES,
    ));
}

fn speed(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let label = format!("speed ({})", curves.unit(Quantity::Speed));
    let spec = Spec::new("speed", "velocity_x_m_s", Quantity::Speed).important();
    let mut panels = curves.motion_panels(&label, &[spec]);
    let (factor, _) = curves.options.units.of(Quantity::Speed);
    let drive = curves.drive;
    for (index, (topic, frame)) in drive.sensors.iter().enumerate() {
        let parts = ["east", "north"].map(|axis| frame.get(&format!("velocity_m_s.{axis}")));
        let [Some(east), Some(north)] = parts else {
            continue;
        };
        let speed = east
            .iter()
            .zip(north)
            .map(|(east, north)| (math::hypot((*east).into(), (*north).into()) * factor) as f32);
        let name = format!("antenna of {}", topic.trim_start_matches("/gnss/"));
        let spec = Spec::new(&name, "", Quantity::Speed).pen(Pen::Other(index));
        let speed = speed.collect();
        panels[0]
            .traces
            .extend(curves.of_values(&frame.time_s, speed, None, spec));
    }
    let caption = "Estimated forward speed, and what the receivers report.";
    all.push((timed("speed", "Speed", caption, panels), NO_ESTIMATES));
}

fn rollover(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let curve = |curves: &mut Curves<'_>, name, column: &str, pen| {
        let spec = Spec::new(name, column, Quantity::Number).pen(pen);
        let spec = match pen {
            Pen::Measured => spec.sigma("load_transfer_ratio_sigma").important(),
            _ => spec,
        };
        curves.curve(&drive.rollover, spec)
    };
    let traces = [
        curve(curves, "vehicle", "load_transfer_ratio", Pen::Measured),
        curve(
            curves,
            "front axle",
            "front.load_transfer_ratio",
            Pen::Other(0),
        ),
        curve(
            curves,
            "rear axle",
            "rear.load_transfer_ratio",
            Pen::Other(1),
        ),
    ];
    let caption = "Right less left over the sum of the loads. At 1 the left wheels, at -1 the right \
                   wheels are off the ground.";
    let panels = vec![panel("load-transfer ratio", traces.into_iter().flatten())];
    all.push((
        timed("rollover", "Load-transfer ratio", caption, panels),
        "no wheel loads are estimated",
    ));
}

/// Stiffness and friction of the tyres.
pub fn grip(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let drawn = &drive.learnt.drawn;
    let x: Vec<f64> = drawn.iter().map(|report| report.time_s).collect();
    type Pick = fn(&Grip) -> f32;
    let parts: [(&str, usize, bool, Pick); 3] = [
        ("stiffness factor", 0, false, |grip| grip.stiffness_factor),
        ("friction", 2, false, |grip| grip.friction),
        ("friction, at least", 2, true, |grip| grip.friction_min),
    ];
    let mut one = panel("factor, coefficient", None);
    for (axle, name) in ["front", "rear"].into_iter().enumerate() {
        for (what, colour, is_point, pick) in parts {
            let of_axle = drawn.iter().map(|report| &report.grip[axle]);
            let y: Vec<f64> = of_axle.map(|grip| pick(grip).into()).collect();
            if y.iter().any(|value| value.is_finite()) {
                one.traces.push(Trace {
                    name: format!("{what}, {name}"),
                    pen: match is_point {
                        true => Pen::Points(colour + axle),
                        false => Pen::Other(colour + axle),
                    },
                    data: Data::Own { x: x.clone(), y },
                });
            }
        }
    }
    let caption = "Factors on the cornering stiffnesses of the vehicle file, and the friction \
                   coefficient. While too little of it is used to see it, points say what it is at \
                   least.";
    all.push((
        timed("grip", "Grip", caption, vec![one]),
        "no grip is estimated (/estimate/parameters)",
    ));
    innovations(curves, all, &x);
}

fn innovations(curves: &Curves<'_>, all: &mut Vec<Candidate>, x: &[f64]) {
    let mut one: Panel = panel("mean y²/S", None);
    for kind in sample::InnovationKind::ALL {
        let drawn = curves.drive.learnt.drawn.iter();
        let y: Vec<f64> = drawn
            .map(|report| report.innovations[kind.index()].into())
            .collect();
        if y.iter().any(|value| value.is_finite()) {
            one.traces.push(Trace {
                name: kind.name().replace('_', " "),
                pen: Pen::Other(kind.index()),
                data: Data::Own { x: x.to_vec(), y },
            });
        }
    }
    let caption = "Normalised innovation squared of each second, by the kind of measurement. It is 1 \
                   where the standard deviations of the filter hold.";
    all.push((
        timed("innovations", "Innovations (NIS)", caption, vec![one]),
        "the log has no statistics of innovations",
    ));
}

/// Values by which the track can be coloured.
pub fn colours(curves: &mut Curves<'_>) -> Vec<Trace> {
    let drive = curves.drive;
    let label = |name: &str, unit: &str| format!("{name} ({unit})");
    let motion = [
        ("speed", "velocity_x_m_s", Quantity::Speed),
        (
            "lateral acceleration",
            "acceleration_m_s2.y",
            Quantity::Acceleration,
        ),
        ("sideslip", "sideslip_rad", Quantity::Angle),
        ("roll", "roll_rad", Quantity::Angle),
    ];
    let mut all = Vec::new();
    for (name, column, quantity) in motion {
        let name = label(name, curves.unit(quantity));
        let spec = Spec::new(&name, column, quantity).important();
        let spec = match column {
            "sideslip_rad" => spec.needs_speed(),
            _ => spec,
        };
        all.extend(curves.curve(&drive.motion, spec));
    }
    let spec = Spec::new(
        "load-transfer ratio",
        "load_transfer_ratio",
        Quantity::Number,
    );
    all.extend(curves.curve(&drive.rollover, spec.important()));
    all
}
