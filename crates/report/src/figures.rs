//! Which figures a report has.

use sample::text::html;
use sample::{AxleGrip, Motion, Parameters, PerWheel, Rollover, TyreForce, Wheel};

use crate::drive::{Drive, Series};
use crate::plot::{Figure, Panel, Pen, Trace};

const TIME: &str = "time since the start (s)";

/// All figures that the log has data for.
pub fn all(drive: &Drive) -> Vec<Figure> {
    let mut figures = vec![
        speed(drive),
        steer(drive),
        rates(drive),
        sideslip(drive),
        slip_angles(drive),
        forces(
            drive,
            1,
            "lateral",
            "Lateral force",
            "lateral force F<sub>y</sub> (N)",
            LATERAL,
        ),
        forces(
            drive,
            2,
            "vertical",
            "Vertical force",
            "vertical force F<sub>z</sub> (N)",
            VERTICAL,
        ),
        forces(
            drive,
            0,
            "longitudinal",
            "Longitudinal force",
            "longitudinal force F<sub>x</sub> (N)",
            LONGITUDINAL,
        ),
        rollover(drive),
        roll_pitch(drive),
        acceleration(drive),
        grip(drive),
        track(drive),
    ];
    figures.retain(Figure::has_data);
    figures
}

const LATERAL: &str = "The model's expectation against what the strain gauges and the linkage's \
     statics say, for each wheel. Left is positive: in a left turn all four are positive.";
const VERTICAL: &str = "Load of each wheel. A curve that runs towards zero is a wheel about to \
     lift.";
const LONGITUDINAL: &str = "Drive is positive, braking negative.";

fn speed(drive: &Drive) -> Figure {
    let mut traces = motion(drive, "speed v<sub>x</sub>", |m| m.velocity_x_m_s);
    for (index, (name, series)) in drive.gnss_speed_m_s.iter().enumerate() {
        traces.push(Trace {
            name: format!("{} (antenna)", html(name)),
            pen: Pen::Other(index),
            x: series.time_s.clone(),
            y: series.values.clone(),
        });
    }
    single(
        "speed",
        "Speed",
        "Estimated forward speed and what the receivers report.",
        "speed (m/s)",
        traces,
    )
}

fn steer(drive: &Drive) -> Figure {
    let mut traces = vec![Trace {
        name: "steering wheel / 10".into(),
        pen: Pen::Other(0),
        x: drive.steering_wheel_rad.time_s.clone(),
        y: drive
            .steering_wheel_rad
            .map(|angle| angle.to_degrees() / 10.0),
    }];
    for (index, wheel) in [Wheel::FrontLeft, Wheel::FrontRight]
        .into_iter()
        .enumerate()
    {
        traces.push(Trace {
            name: format!("road wheel {wheel}"),
            pen: Pen::Other(index + 1),
            x: drive.estimate.time_s.clone(),
            y: drive.estimate.map(|m| m.steer_rad[wheel].to_degrees()),
        });
    }
    single(
        "steer",
        "Steer angle",
        "Steering wheel, and both front wheels by the steering map or the linkage.",
        "angle (deg)",
        traces,
    )
}

fn rates(drive: &Drive) -> Figure {
    let mut traces = Vec::new();
    for (axis, name) in ["roll rate", "pitch rate", "yaw rate"]
        .into_iter()
        .enumerate()
    {
        traces.push(Trace {
            name: name.into(),
            pen: Pen::Other(axis),
            x: drive.estimate.time_s.clone(),
            y: drive.estimate.map(|m| m.rate_rad_s[axis].to_degrees()),
        });
    }
    single(
        "rates",
        "Angular rates",
        "Body axes.",
        "rate (deg/s)",
        traces,
    )
}

fn sideslip(drive: &Drive) -> Figure {
    let traces = motion(drive, "sideslip", |m| m.sideslip_rad.to_degrees());
    single(
        "sideslip",
        "Sideslip angle",
        "At the centre of gravity. Below walking pace the angle means little and is left out.",
        "sideslip (deg)",
        slow_left_out(drive, traces),
    )
}

/// Breaks the curves of angles that have no meaning at rest.
fn slow_left_out(drive: &Drive, mut traces: Vec<Trace>) -> Vec<Trace> {
    const SLOWEST_M_S: f64 = 1.0;
    for trace in &mut traces {
        let series = if trace.pen == Pen::Truth {
            &drive.truth
        } else {
            &drive.estimate
        };
        for (value, motion) in trace.y.iter_mut().zip(&series.values) {
            if motion.velocity_x_m_s.abs() < SLOWEST_M_S {
                *value = f64::NAN;
            }
        }
    }
    traces
}

fn slip_angles(drive: &Drive) -> Figure {
    let panels = wheels("slip angle (deg)", |wheel| {
        let traces = motion(drive, "slip angle", |m| {
            m.slip_angle_rad[wheel].to_degrees()
        });
        slow_left_out(drive, traces)
    });
    Figure {
        id: "slip-angles".into(),
        title: "Slip angles".into(),
        caption: "A positive slip angle gives a negative lateral force.".into(),
        panels,
        x_label: TIME.into(),
        equal_axes: false,
    }
}

fn forces(
    drive: &Drive,
    axis: usize,
    id: &'static str,
    title: &'static str,
    label: &str,
    caption: &'static str,
) -> Figure {
    let panels = wheels(label, |wheel| {
        vec![
            force(&drive.expected, "model", Pen::Expected, wheel, axis),
            force(&drive.measured, "measured", Pen::Measured, wheel, axis),
            force(&drive.truth_forces, "truth", Pen::Truth, wheel, axis),
        ]
    });
    Figure {
        id: id.into(),
        title: title.into(),
        caption: caption.into(),
        panels,
        x_label: TIME.into(),
        equal_axes: false,
    }
}

fn force(
    series: &Series<PerWheel<TyreForce>>,
    name: &str,
    pen: Pen,
    wheel: Wheel,
    axis: usize,
) -> Trace {
    Trace {
        name: name.into(),
        pen,
        x: series.time_s.clone(),
        y: series.map(|forces| forces[wheel].force_n[axis]),
    }
}

fn rollover(drive: &Drive) -> Figure {
    let mut traces = Vec::new();
    let mut curve = |name: &str, pen, ratio: fn(&Rollover) -> f64| {
        traces.push(Trace {
            name: name.into(),
            pen,
            x: drive.rollover.time_s.clone(),
            y: drive.rollover.map(ratio),
        });
    };
    curve("front axle", Pen::Other(0), |r| {
        r.axle_load_transfer_ratio[0]
    });
    curve("rear axle", Pen::Other(1), |r| {
        r.axle_load_transfer_ratio[1]
    });
    curve("vehicle", Pen::Measured, |r| r.load_transfer_ratio);
    single(
        "rollover",
        "Load-transfer ratio",
        "Right less left over the sum of the loads. At 1 the left wheels, at -1 the right wheels of \
         an axle are off the ground; the vehicle tips over where it gets there itself.",
        "load-transfer ratio (–)",
        traces,
    )
}

fn roll_pitch(drive: &Drive) -> Figure {
    let mut traces = motion(drive, "roll", |m| m.roll_rad.to_degrees());
    for mut trace in motion(drive, "pitch", |m| m.pitch_rad.to_degrees()) {
        if trace.pen == Pen::Measured {
            trace.pen = Pen::Other(1);
        }
        traces.push(trace);
    }
    single(
        "attitude",
        "Roll and pitch",
        "Right side down and nose down are positive.",
        "angle (deg)",
        traces,
    )
}

fn acceleration(drive: &Drive) -> Figure {
    let mut traces = motion(drive, "longitudinal", |m| m.acceleration_m_s2[0]);
    for mut trace in motion(drive, "lateral", |m| m.acceleration_m_s2[1]) {
        if trace.pen == Pen::Measured {
            trace.pen = Pen::Other(1);
        }
        traces.push(trace);
    }
    single(
        "acceleration",
        "Acceleration",
        "Of the centre of gravity, without gravity.",
        "acceleration (m/s²)",
        traces,
    )
}

fn grip(drive: &Drive) -> Figure {
    type Axle = fn(&Parameters) -> &AxleGrip;
    let axles: [(&str, Axle); 2] = [("front", |p| &p.front), ("rear", |p| &p.rear)];
    let mut traces = Vec::new();
    for (index, (name, axle)) in axles.into_iter().enumerate() {
        let mut curve = |what: &str, pen, number: fn(&AxleGrip) -> f64| {
            traces.push(Trace {
                name: format!("{what}, {name}"),
                pen,
                x: drive.learnt.time_s.clone(),
                y: drive.learnt.map(|learnt| number(axle(learnt))),
            });
        };
        curve("stiffness factor", Pen::Other(index), |grip| {
            grip.stiffness_factor
        });
        curve("friction", Pen::Other(index + 2), |grip| {
            grip.friction.unwrap_or(f64::NAN)
        });
        curve("friction, at least", Pen::Points(index + 2), |grip| {
            grip.friction.map_or(grip.friction_min, |_| f64::NAN)
        });
    }
    traces.retain(|trace| trace.y.iter().any(|value| value.is_finite()));
    single(
        "grip",
        "Grip",
        "Factors on the vehicle file's cornering stiffnesses, and the friction coefficient. While \
         too little of it is used to see it, points say what it is at least.",
        "factor, coefficient (–)",
        traces,
    )
}

fn track(drive: &Drive) -> Figure {
    let traces = drive
        .track_m
        .iter()
        .enumerate()
        .map(|(index, (name, points))| Trace {
            name: html(name),
            pen: Pen::Other(index),
            x: points.iter().map(|point| point[0]).collect(),
            y: points.iter().map(|point| point[1]).collect(),
        });
    Figure {
        x_label: "east (m)".into(),
        equal_axes: true,
        ..single(
            "track",
            "Track",
            "Where the antennas went, from their first position.",
            "north (m)",
            traces.collect(),
        )
    }
}

/// The estimate of a quantity and, where there is one, its truth.
fn motion(drive: &Drive, name: &str, mut quantity: impl FnMut(&Motion) -> f64) -> Vec<Trace> {
    let mut traces = vec![Trace {
        name: name.into(),
        pen: Pen::Measured,
        x: drive.estimate.time_s.clone(),
        y: drive.estimate.map(&mut quantity),
    }];
    if !drive.truth.is_empty() {
        traces.push(Trace {
            name: format!("{name}, truth"),
            pen: Pen::Truth,
            x: drive.truth.time_s.clone(),
            y: drive.truth.map(&mut quantity),
        });
    }
    traces
}

fn single(
    id: &'static str,
    title: &'static str,
    caption: &'static str,
    y_label: &str,
    traces: Vec<Trace>,
) -> Figure {
    let panels = vec![Panel {
        heading: String::new(),
        y_label: y_label.into(),
        traces,
    }];
    Figure {
        id: id.into(),
        title: title.into(),
        caption: caption.into(),
        panels,
        x_label: TIME.into(),
        equal_axes: false,
    }
}

fn wheels(label: &str, mut traces: impl FnMut(Wheel) -> Vec<Trace>) -> Vec<Panel> {
    Wheel::ALL
        .into_iter()
        .map(|wheel| Panel {
            heading: match wheel {
                Wheel::FrontLeft => "front left",
                Wheel::FrontRight => "front right",
                Wheel::RearLeft => "rear left",
                Wheel::RearRight => "rear right",
            }
            .into(),
            y_label: if wheel.is_left() {
                label.into()
            } else {
                String::new()
            },
            traces: traces(wheel),
        })
        .collect()
}
