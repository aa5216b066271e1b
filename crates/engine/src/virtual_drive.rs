//! Virtual vehicle with its drive, and the configuration for its ports.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use estimator::Calibration;
use estimator::calibration::{ChannelCalibration, HubCalibration, Resolved};
use model::road::RoadClass;
use model::sensors::Sensors;
use model::steering::Toe;
use model::vehicle::Vehicle;
use sample::{LogTime, PerWheel, StrainChannel, Wheel};
use sim::{
    InertialUnit, Manoeuvre, Motion, Options, Port, TruthState, VelocityReceiver, VirtualVehicle,
};
use store::{Ground, InjectedFault, Pose, Record, Session, Truth, WheelGround};
use wire::dbc::Database;
use wire::gps_time::unix_ns_from_gps;
use wire::line;

use crate::config::{FileKind, Files, GivenFile, PROJECT_DBC_TEXT, TOML_MAX, read_text};
use crate::replay::FileSource;
use crate::{Config, Error, Result, session};

/// Course of a virtual vehicle.
#[derive(Clone, Debug)]
pub enum Course {
    /// The manoeuvre with this name.
    Manoeuvre(String),
    /// The motion in a file of another simulator (Parquet or CSV).
    Truth(PathBuf),
}

/// Inputs of a simulation.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Course of the vehicle.
    pub course: Course,
    /// Road of the manoeuvre: `iso8608:` and a class, or the path of a road file; without it the
    /// manoeuvre's own ground.
    pub road: Option<String>,
    /// Vehicle file, or the name of a built-in vehicle.
    pub vehicle: FileSource,
    /// Sensors file, or the name of a built-in sensor set.
    pub sensors: FileSource,
    /// Payloads of the vehicle file that are on the vehicle.
    pub payload: Vec<String>,
    /// Seed of the sensor noise.
    pub seed: u64,
    /// Hidden errors, faults and delays.
    pub options: Options,
    /// Longest duration, s; only mixed driving is repeated until this duration.
    pub duration_s: Option<f64>,
}

/// A virtual vehicle and its inputs.
pub struct VirtualDrive {
    /// Vehicle that performs the motion.
    pub vehicle: VirtualVehicle,
    /// Name of the drive, for people.
    pub drive: String,
    /// True calibration.
    pub true_calibration: Calibration,
    /// Name or path of the vehicle file.
    vehicle_file: String,
    /// Name or path of the sensors file.
    sensors_file: String,
    /// Payloads on the vehicle.
    payload: Vec<String>,
    /// Files that were given as text.
    given: Vec<GivenFile>,
    options: Options,
    /// Bit rate of the CAN bus, bit/s.
    can_bit_rate: u32,
    /// Latencies of the messages on the bus, s, by identifier.
    can_latencies_s: Vec<(u32, f64)>,
    /// Ports of devices that are not fitted.
    not_fitted: Vec<Port>,
    seed: u64,
    duration_s: f64,
}

impl VirtualDrive {
    /// Creates the virtual vehicle.
    ///
    /// # Errors
    /// If a file cannot be read or has errors, or if the vehicle cannot perform the course.
    pub fn new(drive: &Drive) -> Result<Self> {
        let mut given = Vec::new();
        let vehicle_file = drive.vehicle.name(FileKind::Vehicle, &mut given);
        let sensors_file = drive.sensors.name(FileKind::Sensors, &mut given);
        let mut files = Files::on_disk(PathBuf::new()).with_given(given.clone());
        let vehicle = files.read_text(&vehicle_file, FileKind::Vehicle)?;
        let vehicle = Vehicle::from_toml(&vehicle, &vehicle_file)?;
        let sensors = files.read_text(&sensors_file, FileKind::Sensors)?;
        let sensors = Sensors::from_toml(&sensors, &sensors_file)?;
        let loaded = vehicle
            .loaded(&drive.payload)
            .map_err(estimator::EstimatorError::from)?;
        let placed = loaded.sensors(&sensors);
        let mut vehicle = loaded.vehicle;
        if let Some(toe) = &drive.options.toe {
            bend(&mut vehicle, toe, &drive.course)?;
        }
        if let Some(pressures_pa) = drive.options.tyre_pressure_pa {
            vehicle = inflated(&vehicle, &vehicle_file, pressures_pa, &drive.course)?;
        }
        let vehicle = vehicle;
        let (motion, name) = motion(drive, &vehicle)?;
        let motion = repeated(motion, drive.duration_s);
        let own_s = motion.duration_s();
        let duration_s = drive.duration_s.map_or(own_s, |asked_s| asked_s.min(own_s));
        if let Some(asked_s) = drive.duration_s.filter(|asked_s| *asked_s > own_s) {
            tracing::warn!(
                "{name} lasts {own_s:.1} s, so that it ends before the {asked_s} s of --for"
            );
        }
        let truth = vehicle.name.clone();
        let options = drive.options.clone();
        let vehicle = VirtualVehicle::new(motion, &vehicle, &placed, &options, drive.seed)?;
        if !vehicle.motion().has_link_forces() {
            tracing::warn!(
                "the strain channels are absent: the vehicle file {vehicle_file} has no hard-points \
                 (a linkage, strut and unsprung of both axles), or a live axle, and the motion does not \
                 have the forces of all links"
            );
        }
        Ok(Self {
            true_calibration: true_calibration(&truth, &sensors, &vehicle, options.toe.as_ref())?,
            vehicle,
            drive: name,
            vehicle_file,
            sensors_file,
            payload: drive.payload.clone(),
            given,
            can_bit_rate: options.can_bit_rate(&sensors),
            can_latencies_s: sim::frame_latencies_s(&sensors, &options),
            not_fitted: [
                (Port::Imu, sensors.imu.is_not_fitted()),
                (Port::Novatel, sensors.gnss_velocity.is_not_fitted()),
                (Port::Septentrio, sensors.gnss_attitude.is_not_fitted()),
            ]
            .into_iter()
            .filter_map(|(port, is_absent)| is_absent.then_some(port))
            .collect(),
            options,
            seed: drive.seed,
            duration_s,
        })
    }

    /// Duration of the drive, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Start of the drive on the log clock of a simulation: UTC of the receivers.
    pub fn start(&self) -> LogTime {
        let gps = self.options.gps_start;
        let unix_ns = unix_ns_from_gps(gps.week, f64::from(gps.time_of_week_ms) / 1e3);
        LogTime(unix_ns.max(0) as u64)
    }

    /// Session of a log of the drive.
    pub fn session(&self, config: &Config) -> Session {
        let run_id = format!("simulate-{}-{}", self.drive, self.seed);
        let faults = self.options.faults.sensors().into_iter();
        Session {
            injected_faults: Some(
                faults
                    .map(|(sensor, span)| InjectedFault {
                        sensor,
                        from_s: span.start,
                        to_s: span.end,
                    })
                    .collect(),
            ),
            ..session::simulated(config, &run_id, self.start())
        }
    }

    /// Configuration of a simulation without ports.
    ///
    /// # Errors
    /// If it has errors.
    pub fn config(&self) -> Result<Config> {
        let ports = Ports {
            directory: Path::new("virtual"),
            can: None,
        };
        let files = Files::on_disk(PathBuf::from(".")).with_given(self.given.clone());
        Config::from_files(&self.configuration(&ports), files)
    }

    /// Record of the truth at `time_s` of the drive.
    pub fn truth(&self, time_s: f64) -> Record {
        let state = self.vehicle.truth_at(time_s);
        Record::Truth(Box::new(Truth {
            time: self.start().offset_seconds(time_s),
            motion: state.motion(),
            carrier: state.carrier_forces(),
            contact: Some(state.tyre_forces()),
            ground: ground(&state, self.vehicle.motion().road_class()),
            pose: Some(Pose {
                position_enu_m: state.position_m,
                yaw_rad: state.yaw_rad,
                pitch_rad: state.pitch_rad,
                roll_rad: state.roll_rad,
            }),
            friction: state.friction(),
        }))
    }

    /// Configuration whose sources are the ports of this vehicle, at `ports`.
    pub fn configuration(&self, ports: &Ports<'_>) -> String {
        let mut text = String::from(
            "# Sources of the virtual vehicle. docs/configuration.md describes every field.\n\n",
        );
        let mut table = |name: Port, lines: &[(&str, String)]| {
            if self.not_fitted.contains(&name) {
                return;
            }
            let _ = writeln!(text, "[source.{}]", name.name());
            for (key, value) in lines {
                let _ = writeln!(text, "{key} = {value}");
            }
            text.push('\n');
        };
        let options = &self.options;
        table(
            Port::Imu,
            &[
                ("kind", quoted(inertial_kind(options.inertial_unit))),
                ("device", quoted(&ports.serial(Port::Imu))),
                ("baud", options.imu_baud.to_string()),
                // The message on the line.
                (
                    "latency_s",
                    seconds(line_time_s(
                        options.inertial_unit.message_bytes() as u32,
                        options.imu_baud,
                    )),
                ),
            ],
        );
        let mut receiver = |port: Port, baud: u32, processing_s: f64, bytes: u32| {
            let delay_s = seconds(processing_s + line_time_s(bytes, baud));
            table(
                port,
                &[
                    ("kind", quoted("gnss")),
                    ("device", quoted(&ports.serial(port))),
                    ("baud", baud.to_string()),
                    ("latency_s", delay_s),
                ],
            );
        };
        receiver(
            Port::Novatel,
            options.novatel_baud,
            options.novatel_processing_s,
            first_bytes(options.velocity_receiver),
        );
        receiver(
            Port::Septentrio,
            options.septentrio_baud,
            options.septentrio_processing_s,
            80,
        );
        table(Port::Can0, &self.can_lines(ports));
        text.push_str(&self.can_latencies());
        for port in Port::ALL {
            if let Some(format) = port.line_format() {
                text.push_str(&self.controller_lines(port, &format, ports));
            }
        }
        let _ = write!(
            text,
            "[vehicle]\nfile = {}\nsensors = {}\n{}\n[storage]\ndirectory = \"logs\"\n",
            quoted(&self.vehicle_file),
            quoted(&self.sensors_file),
            payload_line(&self.payload),
        );
        text
    }

    /// Source of a controller. Its data is only recorded: the estimator uses the steering-wheel angle
    /// on CAN, which has a higher rate and a smaller latency.
    fn controller_lines(&self, port: Port, format: &line::Format, ports: &Ports<'_>) -> String {
        let (name, baud) = (port.name(), self.options.controller_baud);
        let mut text = format!(
            "[source.{name}]\nkind = \"line\"\ndevice = {}\nbaud = {baud}\n\
             latency_s = {}\nsilent_after_s = 1.0\n",
            quoted(&ports.serial(port)),
            // A count of four figures with sign and line end.
            seconds(line_time_s(7, baud)),
        );
        for field in &format.fields {
            let _ = write!(
                text,
                "[source.{name}.fields.{}]\nindex = {}\nscale = {:?}\nunit = {}\n",
                field.name,
                field.index,
                field.scale,
                quoted(&field.unit),
            );
        }
        text.push('\n');
        text
    }

    /// Latencies of the messages on the bus: the devices sample at the same instant, and their frames wait
    /// for each other.
    fn can_latencies(&self) -> String {
        let mut text = format!("[source.{}.message_latency_s]\n", Port::Can0.name());
        let project = Database::parse(PROJECT_DBC_TEXT.as_bytes());
        for message in project.iter().flat_map(Database::messages) {
            let mut known = self.can_latencies_s.iter();
            if let Some((_, latency_s)) = known.find(|(id, _)| *id == message.id) {
                let _ = writeln!(text, "{} = {}", message.name, seconds(*latency_s));
            }
        }
        text.push('\n');
        text
    }

    fn can_lines(&self, ports: &Ports<'_>) -> Vec<(&'static str, String)> {
        match ports.can {
            Some(interface) => vec![("kind", quoted("can")), ("interface", quoted(interface))],
            None => vec![
                ("kind", quoted("slcan")),
                ("device", quoted(&ports.serial(Port::Can0))),
                ("bitrate", self.can_bit_rate.to_string()),
            ],
        }
    }
}

/// The wheels of a state on their ground, and the class of the road; `None` if the motion tells the
/// ground of no wheel.
fn ground(state: &TruthState, road_class: Option<RoadClass>) -> Option<Ground> {
    let wheels = PerWheel::from_fn(|wheel| {
        let truth = &state.wheels[wheel];
        let length_m = truth.strut_length_m;
        (truth.ground).map_or_else(WheelGround::default, |found| WheelGround {
            normal_body: found.normal_body,
            spindle_body: found.spindle_body,
            centre_acceleration_m_s2: found.centre_acceleration_m_s2,
            unsprung_inertia_n: found.unsprung_inertia_n,
            ground_height_m: found.ground_height_m,
            strut_length_m: length_m.is_finite().then_some(length_m),
        })
    });
    let is_known = state.wheels.0.iter().any(|wheel| wheel.ground.is_some());
    is_known.then_some(Ground {
        wheels,
        road_class: road_class.map(|class| class.letter().to_string()),
    })
}

/// Location of the ports of the virtual vehicle.
pub struct Ports<'a> {
    /// Directory of the links to the pseudo-terminals.
    pub directory: &'a Path,
    /// SocketCAN interface, instead of SLCAN on a pseudo-terminal.
    pub can: Option<&'a str>,
}

impl Ports<'_> {
    fn serial(&self, port: Port) -> String {
        self.directory.join(port.name()).display().to_string()
    }
}

/// Repeats mixed driving until the requested duration; every other drive keeps its own duration.
fn repeated(motion: Motion, asked_s: Option<f64>) -> Motion {
    let laps = asked_s.map_or(1.0, |asked_s| (asked_s / motion.duration_s()).ceil());
    if motion.name() == Manoeuvre::MixedDriving.name() && !motion.tips_over() {
        motion.repeated(laps as u32)
    } else {
        motion
    }
}

fn motion(drive: &Drive, vehicle: &Vehicle) -> Result<(Motion, String)> {
    let name = match &drive.course {
        Course::Manoeuvre(name) => name,
        Course::Truth(path) => {
            let motion = Motion::open(path)?;
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            return Ok((motion, format!("truth-{name}")));
        }
    };
    let manoeuvre = Manoeuvre::by_name(name)?;
    let driven = match &drive.road {
        Some(road) => manoeuvre.drive_on(vehicle, &crate::road::read(road, drive.seed)?),
        None => manoeuvre.drive(vehicle),
    };
    let motion = driven.map_err(|source| Error::Manoeuvre {
        manoeuvre: name.clone(),
        source: Box::new(source),
    })?;
    if motion.tips_over() {
        let end_s = motion.duration_s();
        tracing::warn!("the vehicle rolls over after {end_s:.1} s, which ends {name}");
    }
    Ok((motion, name.clone()))
}

/// Gives a vehicle toe compliance and play of its front wheels.
///
/// # Errors
/// Values that no steering gear has; a motion of a file, whose wheels stand as the file says.
fn bend(vehicle: &mut Vehicle, toe: &Toe, course: &Course) -> Result<()> {
    if let Course::Truth(path) = course {
        return Err(Error::ToeOfTruth { path: path.clone() });
    }
    let limits = [
        (
            "toe.compliance_rad_n",
            toe.compliance_rad_n,
            -1e-3,
            1e-3,
            "-0.001 to 0.001 rad/N",
        ),
        ("toe.play_rad", toe.play_rad, 0.0, 0.5, "0 to 0.5 rad"),
    ];
    for (name, values, least, most, expected) in limits {
        let mut values = values.into_iter();
        if let Some(value) = values.find(|value| !(least..=most).contains(value)) {
            let name = name.to_owned();
            return Err(sim::SimError::BadParameter {
                name,
                value,
                expected,
            }
            .into());
        }
    }
    vehicle.steering.toe_compliance_rad_n = toe.compliance_rad_n;
    vehicle.steering.toe_play_rad = toe.play_rad;
    Ok(())
}

/// The vehicle on tyres at inflation pressures, Pa.
///
/// # Errors
/// Pressures that no tyre has; tyres that do not depend on their pressure; a motion of a file, whose tyres are those of
/// the file.
fn inflated(
    vehicle: &Vehicle,
    name: &str,
    pressures_pa: [f64; 4],
    course: &Course,
) -> Result<Vehicle> {
    if let Course::Truth(path) = course {
        return Err(Error::PressureOfTruth { path: path.clone() });
    }
    let mut all = pressures_pa.into_iter();
    if let Some(value) = all.find(|pressure| !(1e3..=1.3e6).contains(pressure)) {
        return Err(sim::SimError::BadParameter {
            name: "tyre_pressure_pa".to_owned(),
            value,
            expected: "1000 to 1300000 Pa",
        }
        .into());
    }
    if !vehicle.depends_on_pressure() {
        return Err(Error::NoPressureLaw {
            vehicle: name.to_owned(),
        });
    }
    Ok(vehicle.at_pressures(&PerWheel(pressures_pa)))
}

/// Reads the options of a virtual vehicle from a file.
///
/// # Errors
/// If the file cannot be read or has errors.
pub fn read_options(path: &Path) -> Result<Options> {
    let text = read_text(path, TOML_MAX).map_err(|source| Error::OptionsUnreadable {
        path: path.to_owned(),
        source,
    })?;
    toml::from_str(&text).map_err(|cause| Error::Options {
        path: path.to_owned(),
        cause: Box::new(cause),
    })
}

/// True calibration of the virtual vehicle.
fn true_calibration(
    name: &str,
    sensors: &Sensors,
    vehicle: &VirtualVehicle,
    toe: Option<&Toe>,
) -> Result<Calibration> {
    let mut calibration = Calibration::nominal(name);
    let nominal = Resolved::new(sensors, &calibration)?;
    let hidden = vehicle.hidden();
    let zeros = vehicle.zero_counts();
    for wheel in Wheel::ALL {
        let (strain, pot) = zeros[wheel];
        let corner = calibration.corner.entry(wheel).or_default();
        corner.deflection.offset_counts = Some(pot);
        for channel in StrainChannel::ALL {
            let i = channel.index();
            let Some(zero) = strain[i] else { continue };
            let gain = nominal.corners[wheel].strain[i].gain * hidden.bridge_gain_factor[wheel][i];
            let found = ChannelCalibration {
                offset_counts: Some(zero),
                gain_per_count: Some(gain),
                ..ChannelCalibration::default()
            };
            corner.strain.insert(channel, found);
        }
    }
    if let Some(hubs) = vehicle.hub_accelerometers() {
        for wheel in Wheel::ALL {
            let (turn_rad, bias_m_s2) = hubs[wheel];
            let hub = &mut calibration
                .corner
                .entry(wheel)
                .or_default()
                .hub_acceleration;
            *hub = HubCalibration {
                bias_m_s2: Some(bias_m_s2),
                misalignment_rad: Some(turn_rad),
                ..HubCalibration::default()
            };
        }
    }
    let sum = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] + b[i]);
    let (accel, gyro) = vehicle.imu_biases();
    calibration.steer.offset_rad = vehicle.steer_offset_rad();
    if let Some([left, right]) = vehicle.wheel_angles() {
        calibration.steer.wheel_angle_offset_rad = [left[0], right[0]];
        calibration.steer.wheel_angle_gain = Some([left[1], right[1]]);
    }
    if let Some(toe) = toe {
        calibration.steer.toe_compliance_rad_n = Some(toe.compliance_rad_n);
        calibration.steer.toe_play_rad = Some(toe.play_rad);
    }
    calibration.imu.accel_bias_m_s2 = accel;
    calibration.imu.gyro_bias_rad_s = gyro;
    calibration.imu.misalignment_rad = Some(sum(
        sensors.imu.misalignment_rad,
        hidden.imu_misalignment_rad,
    ));
    calibration.gnss_velocity.antenna_m = Some(sum(
        sensors.gnss_velocity.antenna_m,
        hidden.velocity_antenna_m,
    ));
    calibration.gnss_velocity.latency_s = Some(hidden.velocity_latency_s);
    calibration.gnss_attitude.latency_s = Some(hidden.attitude_latency_s);
    calibration.gnss_attitude.attitude_offset_rad = hidden.attitude_offset_rad;
    Ok(calibration)
}

/// Line of a configuration with the payloads; none without any.
fn payload_line(names: &[String]) -> String {
    if names.is_empty() {
        return String::new();
    }
    let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    format!("payload = [{}]\n", names.join(", "))
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn seconds(value: f64) -> String {
    format!("{value:.6}")
}

/// Duration of `bytes` on a serial line at `baud`, 8N1, s.
const fn inertial_kind(unit: InertialUnit) -> &'static str {
    match unit {
        InertialUnit::Crossbow440 => "crossbow440",
        InertialUnit::Vectornav | InertialUnit::VectornavAscii => "vectornav",
    }
}

/// Bytes of BESTPOS or NAV-PVT, the first message of an epoch.
const fn first_bytes(receiver: VelocityReceiver) -> u32 {
    match receiver {
        VelocityReceiver::Novatel => 104,
        VelocityReceiver::Ublox => 100,
    }
}

fn line_time_s(bytes: u32, baud: u32) -> f64 {
    f64::from(bytes) * 10.0 / f64::from(baud)
}
