//! A drive whose signals come in other units gives the forces of the drive in counts.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{
    CanFrame, LogTime, Measurement, Payload, STANDARD_GRAVITY_M_S2, StrainChannel, Wheel,
};
use sim::{Output, Port};
use store::Record;
use wire::crossbow440::{Decoder, PacketRate};
use wire::dbc::Database;

use super::drives::of_prowler;
use super::*;
use crate::FileSource;
use crate::config::{Config, PROJECT_DBC_TEXT};
use crate::virtual_drive::{Drive, Ports};

/// Largest difference of the forces (root mean square), parts of the largest force: steps of 0.01 mm and
/// 0.01 km/h in the place of counts, and the clock of another bus for the inertial unit.
const DIFFERENCE_MAX: f64 = 0.0005;

/// Strain as floating-point numbers in N, deflections in hundredths of a mm, wheel speeds in km/h and rpm,
/// the inertial unit in g and deg/s on CAN.
fn other_dbc() -> String {
    let mut text = "VERSION \"\"\nBU_: A\n".to_owned();
    let mut floats = String::new();
    let mut message = |id: u32, name: &str, signals: &[(&str, u32, u32, f64, &str)]| {
        let bytes = signals.iter().map(|s| (s.1 + s.2).div_ceil(8)).max();
        let _ = writeln!(text, "BO_ {id} {name}: {} A", bytes.unwrap_or(0));
        for (signal, start, bits, factor, unit) in signals {
            let _ = writeln!(
                text,
                " SG_ {signal} : {start}|{bits}@1- ({factor},0) [0|0] \"{unit}\" A"
            );
            if *bits == 32 {
                let _ = writeln!(floats, "SIG_VALTYPE_ {id} {signal} : 1;");
            }
        }
        text.push('\n');
    };
    for (corner, id) in [("FL", 272), ("FR", 304), ("RL", 320), ("RR", 336)] {
        let names = ["upper_front", "upper_rear", "lower_front", "lower_rear"];
        let arms = [0, 1, 2, 3].map(|i| (names[i as usize], 32 * i, 32, 1.0, "N"));
        message(id, &format!("Strain_{corner}"), &arms);
        let rest = [
            ("tie_rod", 0, 32, 0.001, "kN"),
            ("deflection", 32, 16, 0.01, "mm"),
        ];
        message(id + 1, &format!("Corner_{corner}"), &rest);
    }
    message(512, "Steering", &[("hand_wheel_angle", 0, 32, 1.0, "deg")]);
    let speeds = [
        ("FL", 0, 16, 0.01, "km/h"),
        ("FR", 16, 16, 0.01, "km/h"),
        ("RL", 32, 16, 0.1, "rpm"),
        ("RR", 48, 16, 0.1, "rpm"),
    ];
    message(528, "WheelSpeed", &speeds);
    let axes = ["x", "y", "z"];
    for (id, name, unit) in [(1000, "Force", "g"), (1001, "Rate", "deg/s")] {
        let signals = [0, 1, 2].map(|i| (axes[i as usize], 32 * i, 32, 1.0, unit));
        message(id, name, &signals);
    }
    text + &floats
}

/// Turns the bytes of the virtual vehicle into frames of the other DBC file.
struct Recoder {
    own: Database,
    other: Database,
    imu: Decoder,
    vehicle: Vehicle,
    sensors: Sensors,
}

impl Recoder {
    fn new() -> Self {
        Self {
            own: Database::parse(PROJECT_DBC_TEXT.as_bytes()).expect("the built-in file"),
            other: Database::parse(other_dbc().as_bytes()).expect("a DBC file"),
            imu: Decoder::new(PacketRate::default()),
            vehicle: Vehicle::builtin("prowler").expect("built in"),
            sensors: Sensors::builtin("thesis-10bit").expect("built in"),
        }
    }

    /// The value that the other file has for one of the built-in file.
    fn value(&self, signal: &str, value: f64) -> f64 {
        if StrainChannel::from_name(signal).is_some() {
            let scale = self.sensors.strain.axial_scale().expect("gauges");
            let kilo = if signal == "tie_rod" { 1e-3 } else { 1.0 };
            return kilo * scale.load(value);
        }
        let rolling_m = |wheel| {
            let tyre = &self.vehicle.axle(wheel).tyre;
            tyre.rolling_radius_m(self.vehicle.static_load_n(wheel))
        };
        match (signal, Wheel::from_abbreviation(signal)) {
            ("deflection", _) => 1000.0 * self.sensors.deflection.scale().load(value),
            (_, Some(wheel @ (Wheel::FrontLeft | Wheel::FrontRight))) => {
                3.6 * value * rolling_m(wheel)
            }
            (_, Some(_)) => value * 60.0 / std::f64::consts::TAU,
            _ => value,
        }
    }

    fn frames(&mut self, port: Port, output: &Output) -> Vec<CanFrame> {
        let mut frames = Vec::new();
        match (port, output) {
            (Port::Can0, Output::Can(frame)) => {
                let message = self.own.message_of(frame).expect("a known message");
                let other = self.other.by_name(&message.name).expect("the same message");
                let values: Vec<(&str, f64)> = message
                    .decode(frame.bytes())
                    .filter(|value| other.position(&value.signal.name).is_some())
                    .map(|v| {
                        (
                            v.signal.name.as_str(),
                            self.value(&v.signal.name, v.physical),
                        )
                    })
                    .collect();
                frames.push(other.encode(&values).expect("values in range"));
            }
            (Port::Imu, Output::Bytes(bytes)) => {
                let mut samples = Vec::new();
                self.imu
                    .push(bytes, |item| samples.extend(item.measurements));
                for sample in samples {
                    let Measurement::Imu(imu) = sample else {
                        continue;
                    };
                    let force = imu.specific_force_m_s2.map(|v| v / STANDARD_GRAVITY_M_S2);
                    let rate = imu.angular_rate_rad_s.map(f64::to_degrees);
                    for (name, [x, y, z]) in [("Force", force), ("Rate", rate)] {
                        let message = self.other.by_name(name).expect("a message");
                        let frame = message.encode(&[("x", x), ("y", y), ("z", z)]);
                        frames.push(frame.expect("values in range"));
                    }
                }
            }
            _ => {}
        }
        frames
    }
}

fn slow_sine() -> Drive {
    of_prowler("slow-sine", "thesis-10bit")
}

/// The configuration of the virtual vehicle with the inertial unit on the bus of the other DBC file.
fn in_other_units(mut text: String) -> String {
    let start = text.find("[source.imu]").expect("an inertial unit");
    let end = start + text[start..].find("\n\n").expect("the table's end");
    let line = text[start..end].find("latency_s = ").expect("a latency");
    let latency = text[start + line..].lines().next().expect("a line");
    let latency = latency.trim_start_matches("latency_s = ").to_owned();
    text.replace_range(start..end, "");
    let bus = "interface = \"can0\"\n";
    let dbc = format!("{bus}dbc = [\"other.dbc\"]\n");
    text = text.replace(bus, &dbc);
    let heading = "[source.can0.message_latency_s]\n";
    let latencies = format!("{heading}Force = {latency}\nRate = {latency}\n");
    text = text.replace(heading, &latencies);
    text = text
        .lines()
        .filter(|line| !line.starts_with("SteerRods") && !line.starts_with("Hub_"))
        .map(|line| format!("{line}\n"))
        .collect();
    for (role, message) in [("acceleration", "Force"), ("rate", "Rate")] {
        let _ = writeln!(text, "[source.can0.roles.{role}]");
        for axis in ["x", "y", "z"] {
            let _ = writeln!(text, "{axis} = \"{message}.{axis}\"");
        }
    }
    text
}

/// The forces of a drive; with a recoder, of its signals in other units.
fn forces(mut recoder: Option<Recoder>) -> BTreeMap<LogTime, [[f64; 3]; 4]> {
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("other.dbc"), other_dbc()).expect("written");
    let mut simulated = VirtualDrive::new(&slow_sine()).expect("a drive");
    let ports = Ports {
        directory: Path::new("virtual"),
        can: Some("can0"),
    };
    let mut text = simulated.configuration(&ports);
    if recoder.is_some() {
        text = in_other_units(text);
    }
    let mut config = Config::from_text(&text, directory.path()).expect("a configuration");
    let settings = config.estimator.as_mut().expect("an estimator");
    settings.calibration = simulated.true_calibration.clone();
    let start = simulated.start();
    let mut found = BTreeMap::new();
    let mut sink = |entry| {
        if let Entry::Record(Record::Estimate(estimate)) = entry
            && estimate.time > start.offset_seconds(2.0)
        {
            found.insert(
                estimate.time,
                estimate.measured.0.map(|force| force.force_n),
            );
        }
        Ok::<_, Error>(())
    };
    let mut feed = Feed::new(&config).expect("a feed");
    let id = |port: Port| {
        let mut sources = config.sources.iter();
        let found = sources.find(|source| source.spec.name == port.name());
        found.map(|source| source.spec.id)
    };
    let mut ticks = 0_u64;
    while let Some(emission) = simulated.vehicle.next() {
        if emission.time_s > simulated.duration_s() {
            break;
        }
        while ticks as f64 * TICK_S <= emission.time_s {
            let time = start.offset_seconds(ticks as f64 * TICK_S);
            feed.push(SourceId::HOST, time, Payload::Tick, &mut sink)
                .expect("a tick");
            ticks += 1;
        }
        let recoded = recoder
            .as_mut()
            .map(|recoder| recoder.frames(emission.port, &emission.output))
            .filter(|frames| !frames.is_empty());
        let (port, payload) = match (recoded, emission.output) {
            (Some(frames), _) => (Port::Can0, Payload::Can(frames)),
            (None, Output::Bytes(bytes)) => (emission.port, Payload::Bytes(bytes)),
            (None, Output::Can(frame)) => (emission.port, Payload::Can(vec![frame])),
        };
        if let Some(source) = id(port) {
            let time = start.offset_seconds(emission.time_s);
            feed.push(source, time, payload, &mut sink)
                .expect("an arrival");
        }
    }
    found
}

/// Without tables of strain, attitude and wheel speeds the vehicle is driven and its motion is estimated.
#[test]
fn a_vehicle_without_some_devices_is_driven_and_estimated() {
    let text = Sensors::builtin_text("thesis-10bit").expect("built in");
    let mut kept = String::new();
    let mut is_kept = true;
    for line in text.lines() {
        if let Some(table) = line.strip_prefix('[') {
            let dropped = ["strain", "gnss_attitude", "wheel_speed"];
            is_kept = !dropped.iter().any(|name| table.starts_with(name));
        }
        if is_kept {
            kept += &format!("{line}\n");
        }
    }
    let mut simulated = VirtualDrive::new(&Drive {
        sensors: FileSource::Text(kept),
        duration_s: Some(20.0),
        ..slow_sine()
    })
    .expect("a drive");
    let config = simulated.config().expect("a configuration");
    let names: Vec<&str> = config
        .sources
        .iter()
        .map(|s| s.spec.name.as_str())
        .collect();
    assert!(
        names.contains(&"imu") && !names.contains(&"septentrio"),
        "{names:?}"
    );
    let limits = crate::scope::limits(&config);
    assert!(limits[0].contains("has no table [strain]"), "{limits:?}");
    let (mut estimates, mut corners, mut strains, mut others) = (0, 0, 0, 0);
    let end = simulated.start().offset_seconds(15.0);
    simulate(&mut simulated, &config, |entry| {
        match entry {
            Entry::Record(Record::Estimate(estimate)) if estimate.time > end => {
                let speed = estimate.motion.velocity_x_m_s;
                assert!((5.0..10.0).contains(&speed), "{speed}");
                estimates += 1;
            }
            Entry::Record(Record::Sample(sample)) => match sample.measurement {
                Measurement::Corner(corner) => {
                    corners += u32::from(corner.deflection_counts.is_some());
                    strains += u32::from(corner.strain_counts.iter().any(Option::is_some));
                }
                Measurement::WheelSpeed(_) | Measurement::GnssAttitude(_) => others += 1,
                _ => {}
            },
            _ => {}
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    assert!(estimates > 400 && corners > 7000, "{estimates} {corners}");
    assert_eq!((strains, others), (0, 0));
}

#[test]
fn engineering_units_on_can_give_the_forces_of_counts() {
    let [counts, units] = [None, Some(Recoder::new())].map(forces);
    assert!(counts.len() > 2000 && units.len().abs_diff(counts.len()) < 5);
    for axis in 0..3 {
        let (mut squares, mut number, mut peak) = (0.0, 0.0, 0.0_f64);
        for (time, expected) in &counts {
            let Some(found) = units.get(time) else {
                continue;
            };
            for wheel in 0..4 {
                let [found, expected] = [found, expected].map(|forces| forces[wheel][axis]);
                squares += (found - expected).powi(2);
                number += 1.0;
                peak = peak.max(expected.abs());
            }
        }
        let part = f64::sqrt(squares / number) / peak;
        println!("axis {axis}: {part:.6} of {peak:.0} N, {number} values");
        assert!(part < DIFFERENCE_MAX, "axis {axis}: {part} of {peak} N");
    }
}
