//! Decodes CAN frames to signals and measurements.

mod convert;
mod parts;

use std::sync::Arc;

use model::sensors::{HubAcceleration, Potentiometers, StrainChain};
use sample::{
    CanFrame, ControlSample, CornerSample, Counts, DeviceTime, HubAccelerationSample, LogTime,
    Measurement, NANOS_PER_SECOND, PerWheel, Sample, Signal, SignalFrame, SourceId, SteerSample,
    StrainChannel, Wheel, WheelSpeedSample,
};
use wire::column::Quantity;
use wire::dbc::{Database, MessageDef, SignalDef, parameter_group, source_address};
use wire::j1939::{self, Lamps, Transport};

use crate::config::{CanMeaning, Estimator, Role, Travel, WheelRate};

pub use convert::Conversion;
use parts::Parts;

/// Largest plausible age of a kernel stamp, ns; an older stamp is ignored.
const KERNEL_DELAY_MAX_NS: i64 = 10 * NANOS_PER_SECOND;

/// Time from the kernel's stamp of a frame to its arrival, ns; zero if the wall clock was set between.
pub fn kernel_delay_ns(realtime_ns: i64, kernel_ns: i64) -> i64 {
    let delay_ns = realtime_ns.saturating_sub(kernel_ns);
    if (0..=KERNEL_DELAY_MAX_NS).contains(&delay_ns) {
        delay_ns
    } else {
        0
    }
}

/// Name of the message with the active trouble codes of a sender.
pub const DM1: &str = "DM1";
/// Most trouble codes of a message that are in the log.
const CODES_MAX: usize = 50;

/// Decodes the frames of one bus.
pub struct CanDecoder {
    databases: Vec<Decodable>,
    scales: Scales,
    /// Measurements whose parts come in several messages.
    parts: Parts,
    /// J1939 messages of several frames.
    transport: Transport,
}

/// What turns signals into measurements, beside the DBC files.
#[derive(Clone, Debug, Default)]
pub struct Scales {
    /// Chain of the strain channels; without it, a signal that is not in counts measures nothing.
    pub strain: Option<StrainChain>,
    /// Scale of the spring potentiometers; without it, a signal that is not in counts measures nothing.
    pub deflection: Option<Potentiometers>,
    /// Rolling radius of each wheel, m; without it, a wheel speed in m/s measures nothing.
    pub rolling_radius_m: PerWheel<Option<f64>>,
    /// Scale of the hub accelerometers' counts; without it, there are counts alone.
    pub hub: Option<HubAcceleration>,
    /// Travel of the steering rack for an angle of the steering wheel, m/rad; without it, the
    /// potentiometers along the tie rods measure nothing.
    pub rack_m_rad: Option<f64>,
    /// Scale of the counts of the potentiometers along the tie rods, if these measure the steering wheel
    /// in the place of an encoder.
    pub rods: Option<Potentiometers>,
}

impl Scales {
    /// Scales of the sensors and the vehicle of a configuration.
    pub fn of(estimator: Option<&Estimator>) -> Self {
        let Some(Estimator {
            sensors, vehicle, ..
        }) = estimator
        else {
            return Self::default();
        };
        Self {
            strain: Some(sensors.strain.clone()),
            deflection: Some(sensors.deflection.clone()),
            rolling_radius_m: PerWheel::from_fn(|wheel| {
                let tyre = &vehicle.axle(wheel).tyre;
                let radius_m = tyre.rolling_radius_m(vehicle.static_load_n(wheel));
                (radius_m > 0.0).then_some(radius_m)
            }),
            hub: sensors.hub_acceleration.clone(),
            rack_m_rad: vehicle.steering.rack_m_rad,
            rods: sensors.steer_potentiometers.clone(),
        }
    }
}

struct Decodable {
    database: Database,
    /// Plan of each message.
    plans: Vec<Plan>,
}

/// What the frames of a message have in common, prepared so that a frame copies no texts.
struct Plan {
    /// Name in the log.
    name: Arc<str>,
    /// Each signal, in the order of the definition.
    signals: Vec<SignalPlan>,
    /// Latency, s, where it is not that of the source.
    latency_s: Option<f64>,
}

struct SignalPlan {
    name: Arc<str>,
    unit: Arc<str>,
    role: Option<Role>,
    /// How the values become counts, if the role is a channel of a converter.
    conversion: Conversion,
    /// Name in the log of a value that is recorded under its name.
    control: Option<(Arc<str>, Arc<str>)>,
    /// The integer that means that there is no value.
    absent: Option<i64>,
}

/// Labels of the value that means that there is none.
const ABSENT: [&str; 4] = ["absent", "sna", "not available", "signal not available"];

impl SignalPlan {
    fn new(signal: &SignalDef) -> Self {
        let absent = signal.labels.iter().find(|(_, label)| {
            let label = label.trim().to_lowercase().replace('_', " ");
            ABSENT.contains(&label.as_str())
        });
        Self {
            name: signal.name.as_str().into(),
            unit: signal.unit.as_str().into(),
            role: None,
            conversion: Conversion::Unknown,
            control: None,
            absent: absent.map(|(value, _)| *value),
        }
    }

    /// Gives the signal a role. What the sensors file lacks is an error of the configuration.
    fn set_role(&mut self, role: Role, signal: &SignalDef, scales: &Scales) {
        self.role = Some(role);
        self.conversion = conversion(role, signal, scales)
            .ok()
            .flatten()
            .unwrap_or(Conversion::Unknown);
        if let Role::Control(value, _) = role {
            self.control = Some((value.name().into(), value.unit().into()));
        }
    }
}

/// How the values of a signal with a role become counts; `None` if the role has none.
///
/// # Errors
/// When the sensors file does not have what the unit of the signal needs.
pub fn conversion(
    role: Role,
    signal: &SignalDef,
    scales: &Scales,
) -> Result<Option<Conversion>, model::Error> {
    match role {
        Role::Strain(_, channel, unit) => {
            Conversion::of_strain(unit, channel, signal, scales.strain.as_ref()).map(Some)
        }
        Role::Deflection(_, travel) => {
            Conversion::of_travel(travel, signal, scales.deflection.as_ref()).map(Some)
        }
        Role::SteerRod(_, travel) if !matches!(travel, Travel::Length(_)) => {
            Conversion::of_travel(travel, signal, scales.rods.as_ref()).map(Some)
        }
        _ => Ok(None),
    }
}

impl Plan {
    fn new(message: &MessageDef, name: &str, latency_s: Option<f64>) -> Self {
        let signals = message.signals.iter().map(SignalPlan::new);
        Self {
            name: name.into(),
            signals: signals.collect(),
            latency_s,
        }
    }
}

/// Arrival of frames.
#[derive(Clone, Copy, Debug)]
pub struct Arrived {
    /// Source.
    pub source: SourceId,
    /// Time on the log clock.
    pub log_time: LogTime,
    /// Time from the sampling of a message to its kernel stamp, s.
    pub latency_s: f64,
    /// How late the frame is by its stamps, or by the rate of its identifier, ns.
    pub late_ns: i64,
}

impl Arrived {
    /// Sample of a measurement in a frame.
    fn sample(&self, frame: &CanFrame, measurement: Measurement) -> Sample {
        Sample {
            source: self.source,
            log_time: self.log_time,
            valid_time: self.instant(),
            device_time: frame.hardware_ns.map(DeviceTime::AdapterNanos),
            measurement,
        }
    }

    /// Time of a frame.
    fn instant(&self) -> LogTime {
        self.log_time
            .offset_nanos(-self.late_ns)
            .offset_seconds(-self.latency_s)
    }
}

/// Measurements in the signals of a frame.
#[derive(Default)]
struct Measured {
    steer_rad: Option<f64>,
    /// Travel of the tie rods, left and right, and of the rack, m.
    rods_m: [Option<f64>; 3],
    speeds_rad_s: PerWheel<Option<f64>>,
    corners: PerWheel<Option<CornerSample>>,
    hubs: PerWheel<Option<HubAccelerationSample>>,
    /// Values that are recorded under their names.
    controls: Vec<Signal>,
    /// Parts of measurements of other devices.
    parts: Vec<(Quantity, f64)>,
    /// Whether the receiver has a solution.
    is_solved: Option<bool>,
}

impl CanDecoder {
    /// Decoder with the DBC files and roles of a bus.
    pub fn new(meaning: &CanMeaning, scales: Scales) -> Self {
        let mut databases: Vec<Decodable> = meaning
            .databases
            .iter()
            .zip(meaning.names.iter().zip(&meaning.latencies_s))
            .map(|(database, (names, latencies_s))| Decodable {
                plans: database
                    .messages()
                    .iter()
                    .zip(names.iter().zip(latencies_s))
                    .map(|(message, (name, latency_s))| Plan::new(message, name, *latency_s))
                    .collect(),
                database: database.clone(),
            })
            .collect();
        let mut parts = Parts::default();
        for role in &meaning.roles {
            let Some(Decodable { database, plans }) = databases.get_mut(role.database) else {
                continue;
            };
            let message = database.messages().get(role.message);
            let signal = message.and_then(|message| message.signals.get(role.signal));
            let plan = plans.get_mut(role.message);
            let plan = plan.and_then(|plan| plan.signals.get_mut(role.signal));
            if let (Some(plan), Some(signal)) = (plan, signal) {
                plan.set_role(role.role, signal, &scales);
            }
            if let Role::Quantity(quantity, _) = role.role {
                parts.expect(quantity);
            }
        }
        Self {
            databases,
            scales,
            parts,
            transport: Transport::default(),
        }
    }

    /// Decodes a frame, and the message that it completes, and appends the samples.
    pub fn push(&mut self, arrived: &Arrived, frame: &CanFrame, sink: &mut Vec<Sample>) {
        if frame.flags.error || frame.flags.remote {
            return;
        }
        self.decode(arrived, frame, frame.id, frame.bytes(), sink);
        let is_extended = frame.flags.extended;
        if is_extended && parameter_group(frame.id) == j1939::DM1 {
            self.diagnose(arrived, frame, frame.id, frame.bytes(), sink);
        }
        if let Some(whole) = self.transport.push(frame, arrived.log_time.0) {
            self.decode(arrived, frame, whole.id, &whole.data, sink);
            if parameter_group(whole.id) == j1939::DM1 {
                self.diagnose(arrived, frame, whole.id, &whole.data, sink);
            }
        }
    }

    /// Appends the active trouble codes of a sender, unless a DBC file has their message.
    fn diagnose(
        &self,
        arrived: &Arrived,
        frame: &CanFrame,
        id: u32,
        data: &[u8],
        sink: &mut Vec<Sample>,
    ) {
        let mut databases = self.databases.iter();
        if databases.any(|known| known.database.position(id, true).is_some()) {
            return;
        }
        let Some((lamps, codes)) = j1939::trouble_codes(data) else {
            return;
        };
        let signal = |name: String, value: f64| Signal {
            name: name.into(),
            value,
            unit: "".into(),
        };
        let lamps = Lamps::NAMES.into_iter().zip(lamps.states);
        let mut signals: Vec<Signal> = lamps
            .map(|(name, state)| signal(format!("lamp_{name}"), f64::from(state)))
            .collect();
        signals.push(signal("codes".to_owned(), codes.len() as f64));
        for (number, code) in codes.iter().enumerate().take(CODES_MAX) {
            let n = number + 1;
            signals.push(signal(format!("spn_{n}"), f64::from(code.parameter)));
            signals.push(signal(format!("fmi_{n}"), f64::from(code.failure)));
            signals.push(signal(format!("count_{n}"), f64::from(code.occurrences)));
        }
        signals.extend(identity(id));
        sink.push(arrived.sample(
            frame,
            Measurement::Signals(SignalFrame {
                message: DM1.into(),
                id,
                signals,
            }),
        ));
    }

    /// Decodes the data of an identifier, which a frame completed.
    fn decode(
        &mut self,
        arrived: &Arrived,
        frame: &CanFrame,
        id: u32,
        data: &[u8],
        sink: &mut Vec<Sample>,
    ) {
        let found = self.databases.iter().find_map(|decodable| {
            let position = decodable.database.position(id, frame.flags.extended)?;
            let message = &decodable.database.messages()[position];
            Some((message, &decodable.plans[position]))
        });
        let Some((message, plan)) = found else {
            return;
        };
        let arrived = Arrived {
            latency_s: plan.latency_s.unwrap_or(arrived.latency_s),
            ..*arrived
        };
        let mut emit = |measurement| sink.push(arrived.sample(frame, measurement));
        let (mut signals, measured) = decode(message, plan, data, &self.scales);
        if message.j1939 {
            signals.extend(identity(id));
        }
        emit(Measurement::Signals(SignalFrame {
            message: Arc::clone(&plan.name),
            id,
            signals,
        }));
        if let Some(is_solved) = measured.is_solved {
            self.parts.take_fix(is_solved);
        }
        let time = arrived.instant();
        for measurement in self.parts.take(id, time, &measured.parts) {
            emit(measurement);
        }
        for corner in measured.corners.0.into_iter().flatten() {
            emit(Measurement::Corner(corner));
        }
        for hub in measured.hubs.0.into_iter().flatten() {
            emit(Measurement::HubAcceleration(hub));
        }
        let by_rods = measured.by_rods_rad(self.scales.rack_m_rad);
        let by_encoder = measured.steer_rad.filter(|_| self.scales.rods.is_none());
        if let Some(steering_wheel_rad) = by_encoder.or(by_rods) {
            emit(Measurement::Steer(SteerSample { steering_wheel_rad }));
        }
        if !measured.controls.is_empty() {
            let values = measured.controls;
            emit(Measurement::Control(ControlSample { values }));
        }
        if measured.speeds_rad_s.0.iter().any(Option::is_some) {
            emit(Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s: measured.speeds_rad_s,
            }));
        }
    }
}

/// What tells the senders of a parameter group apart.
fn identity(id: u32) -> [Signal; 2] {
    let signal = |name: &str, value: f64| Signal {
        name: name.into(),
        value,
        unit: "".into(),
    };
    [
        signal(store::CAN_ID, f64::from(id)),
        signal(store::SOURCE_ADDRESS, f64::from(source_address(id))),
    ]
}

fn decode(
    message: &MessageDef,
    plan: &Plan,
    data: &[u8],
    scales: &Scales,
) -> (Vec<Signal>, Measured) {
    let mut measured = Measured::default();
    let mut signals = Vec::with_capacity(message.signals.len());
    for value in message.decode(data) {
        let signal = &plan.signals[value.index];
        signals.push(Signal {
            name: Arc::clone(&signal.name),
            value: value.physical,
            unit: Arc::clone(&signal.unit),
        });
        let is_absent =
            signal.absent.is_some() && signal.absent == value.signal.integer(value.bits);
        match signal.role.filter(|_| !is_absent) {
            Some(Role::Steer(factor)) => measured.steer_rad = Some(value.physical * factor),
            Some(Role::SteerRod(side, travel)) => {
                measured.rods_m[side as usize] = match travel {
                    Travel::Length(factor) => Some(value.physical * factor),
                    _ => (scales.rods.as_ref().zip(signal.conversion.counts(&value)))
                        .and_then(|(pots, counts)| pots.travel_m(counts)),
                };
            }
            Some(Role::Rack(factor)) => measured.rods_m[2] = Some(value.physical * factor),
            Some(Role::WheelSpeed(wheel, rate)) => {
                let radius_m = scales.rolling_radius_m[wheel];
                measured.speeds_rad_s[wheel] = match rate {
                    WheelRate::Angular(factor) => Some(value.physical * factor),
                    WheelRate::Rolling(factor) => radius_m.map(|r| value.physical * factor / r),
                };
            }
            Some(Role::Deflection(wheel, _)) => {
                let corner = measured.corner(wheel);
                corner.deflection_counts = signal.conversion.counts(&value);
            }
            Some(Role::Strain(wheel, channel, _)) => {
                let corner = measured.corner(wheel);
                corner.strain_counts[channel.index()] = signal.conversion.counts(&value);
            }
            Some(Role::Quantity(quantity, factor)) => {
                measured.parts.push((quantity, value.physical * factor));
            }
            Some(Role::Fix) => measured.is_solved = Some(value.physical != 0.0),
            Some(Role::HubAcceleration(wheel, axis, factor)) => {
                let hub = measured.hubs[wheel].get_or_insert(HubAccelerationSample::empty(wheel));
                let counts = Conversion::Counts.counts(&value).map(Counts::number);
                let counts = counts.map(|counts| counts as i32);
                hub.counts[axis] = counts.filter(|_| factor.is_none());
                hub.specific_force_m_s2[axis] = match factor {
                    Some(factor) => Some(value.physical * factor),
                    None => (scales.hub.as_ref())
                        .zip(hub.counts[axis])
                        .and_then(|(scale, count)| scale.specific_force_m_s2(count)),
                };
            }
            Some(Role::Control(_, factor)) => {
                let names = signal.control.iter();
                measured.controls.extend(names.map(|(name, unit)| Signal {
                    name: Arc::clone(name),
                    value: value.physical * factor,
                    unit: Arc::clone(unit),
                }));
            }
            None => {}
        }
    }
    (signals, measured)
}

impl Measured {
    /// Steering-wheel angle by the mean travel of the tie rods in the frame, rad. Both rods hang on the
    /// rack, so that their inner ends travel alike.
    fn by_rods_rad(&self, rack_m_rad: Option<f64>) -> Option<f64> {
        let known = || self.rods_m.into_iter().flatten();
        let count = known().count();
        let rack_m_rad = rack_m_rad.filter(|rack| *rack != 0.0 && count > 0)?;
        Some(known().sum::<f64>() / count as f64 / rack_m_rad)
    }

    fn corner(&mut self, wheel: Wheel) -> &mut CornerSample {
        self.corners[wheel].get_or_insert(CornerSample {
            wheel,
            strain_counts: [None; StrainChannel::COUNT],
            deflection_counts: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use model::strain::ABSENT_COUNT;
    use sample::{CanFlags, Side};

    use super::*;
    use crate::config::RoleOf;

    const DBC: &[u8] = b"VERSION \"\"\n\nBU_: Box\n\nBO_ 1 Rods: 8 Box\n \
        SG_ left : 0|16@1- (0.1,0) [0|0] \"mm\" Box\n SG_ right : 16|16@1+ (1,0) [0|0] \"count\" Box\n \
        SG_ angle : 32|16@1- (0.001,0) [0|0] \"rad\" Box\n";

    /// Steering-wheel angle of a frame with these roles of the signals.
    fn angle_rad(roles: &[(usize, Role)], fields: [u16; 3], rods: bool) -> Option<f64> {
        let roles = roles.iter().map(|&(signal, role)| RoleOf {
            database: 0,
            message: 0,
            signal,
            role,
            at: None,
        });
        let databases = vec![Database::parse(DBC).expect("a DBC file")];
        let meaning = CanMeaning::new(databases, roles.collect());
        let pots = Potentiometers {
            rate_hz: 100.0,
            span_m: 0.1,
            adc_bits: 10,
            noise_counts: 1.0,
            zero_error_counts: 0.0,
            excitation_v: None,
        };
        let scales = Scales {
            rack_m_rad: Some(0.01),
            rods: rods.then_some(pots),
            ..Scales::default()
        };
        let mut data = [0; 64];
        for (bytes, field) in data.chunks_exact_mut(2).zip(fields) {
            bytes.copy_from_slice(&field.to_le_bytes());
        }
        let frame = CanFrame {
            id: 1,
            flags: CanFlags::default(),
            len: 8,
            data,
            kernel_ns: None,
            hardware_ns: None,
        };
        let arrived = Arrived {
            late_ns: 0,
            source: SourceId(0),
            log_time: LogTime(1_000_000_000),
            latency_s: 0.0,
        };
        let mut samples = Vec::new();
        CanDecoder::new(&meaning, scales).push(&arrived, &frame, &mut samples);
        samples.iter().find_map(|sample| match &sample.measurement {
            Measurement::Steer(steer) => Some(steer.steering_wheel_rad),
            _ => None,
        })
    }

    #[test]
    fn tie_rods_in_metres_and_in_counts_give_the_steering_wheel() {
        let millimetres = (0, Role::SteerRod(Side::Left, Travel::Length(1e-3)));
        let counts = (1, Role::SteerRod(Side::Right, Travel::Counts));
        let encoder = (2, Role::Steer(1.0));
        // 5 mm to the left; a quarter of the span, 25 mm; 0.3 rad.
        let fields = [50, 768, 300];
        let close = |found: Option<f64>, expected: f64| {
            assert!(
                (found.expect("an angle") - expected).abs() < 1e-12,
                "{found:?}"
            );
        };
        close(angle_rad(&[millimetres], fields, false), 0.5);
        close(angle_rad(&[counts], fields, true), 2.5);
        close(angle_rad(&[millimetres, counts], fields, true), 1.5);
        // At an end of its range, or absent, the other one counts alone.
        close(
            angle_rad(&[millimetres, counts], [50, 1023, 300], true),
            0.5,
        );
        close(
            angle_rad(&[millimetres, counts], [50, ABSENT_COUNT, 300], true),
            0.5,
        );
        // Counts without a scale measure nothing.
        assert_eq!(angle_rad(&[counts], fields, false), None);
        // The sensors file tells which device measures the steering wheel.
        close(angle_rad(&[counts, encoder], fields, true), 2.5);
        close(angle_rad(&[counts, encoder], fields, false), 0.3);
        close(angle_rad(&[millimetres, encoder], fields, false), 0.3);
        assert_eq!(angle_rad(&[encoder], fields, true), None);
    }

    /// Decoded messages of frames, as `message: signals`.
    fn decoded(databases: &[&str], frames: &[(u32, bool)]) -> Vec<String> {
        let parse = |text: &&str| Database::parse(text.as_bytes()).expect("a DBC file");
        let databases = databases.iter().map(parse).collect();
        let mut decoder =
            CanDecoder::new(&CanMeaning::new(databases, Vec::new()), Scales::default());
        let mut samples = Vec::new();
        let arrived = Arrived {
            late_ns: 0,
            source: SourceId(0),
            log_time: LogTime(1_000_000_000),
            latency_s: 0.0,
        };
        for (number, (id, extended)) in frames.iter().enumerate() {
            let flags = CanFlags {
                extended: *extended,
                ..CanFlags::default()
            };
            let frame = CanFrame::new(*id, flags, &[number as u8; 8]).expect("eight bytes");
            decoder.push(&arrived, &frame, &mut samples);
        }
        let signals = samples.iter().map(|sample| match &sample.measurement {
            Measurement::Signals(frame) => {
                let each = frame.signals.iter();
                let each = each.map(|s| format!("{}={}", s.name, s.value));
                format!("{}: {}", frame.message, each.collect::<Vec<_>>().join(" "))
            }
            other => panic!("{other:?}"),
        });
        signals.collect()
    }

    #[test]
    fn messages_of_one_name_have_names_of_their_own() {
        let file = |id: u32, signal: &str| {
            format!(
                "VERSION \"\"\nBU_: A\nBO_ {id} M: 8 A\n SG_ {signal} : 0|8@1+ (1,0) [0|0] \"\" A\n"
            )
        };
        let files = [file(256, "s"), file(257, "t")];
        let found = decoded(&[&files[0], &files[1]], &[(256, false), (257, false)]);
        assert_eq!(found, ["M: s=0", "M_101: t=1"]);
    }

    #[test]
    fn senders_of_a_parameter_group_are_told_apart() {
        let file = "VERSION \"\"\nBU_: A\nBO_ 2566845440 TIRE: 8 A\n \
            SG_ s : 0|8@1+ (1,0) [0|0] \"\" A\n\
            BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n\
            BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n\
            BA_ \"VFrameFormat\" BO_ 2566845440 3;\n";
        let found = decoded(&[file], &[(0x18FE_F433, true), (0x18FE_F434, true)]);
        let expected = [
            "TIRE: s=0 j1939_can_id=419361843 j1939_source_address=51",
            "TIRE: s=1 j1939_can_id=419361844 j1939_source_address=52",
        ];
        assert_eq!(found, expected);
    }

    /// A message of 20 bytes to all, and trouble codes in one frame.
    #[test]
    fn messages_of_several_frames_and_trouble_codes_are_decoded() {
        let file = "VERSION \"\"\nBU_: A\nBO_ 2566841342 LONG: 20 A\n \
            SG_ late : 128|16@1+ (1,0) [0|0] \"\" A\n\
            BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n\
            BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n\
            BA_ \"VFrameFormat\" BO_ 2566841342 3;\n";
        let group = parameter_group(2_566_841_342);
        let database = Database::parse(file.as_bytes()).expect("a DBC file");
        let meaning = CanMeaning::new(vec![database], Vec::new());
        let mut decoder = CanDecoder::new(&meaning, Scales::default());
        let [g0, g1, g2, _] = group.to_le_bytes();
        let frames: [(u32, [u8; 8]); 5] = [
            (0x1CEC_FF33, [32, 20, 0, 3, 0xFF, g0, g1, g2]),
            (0x1CEB_FF33, [1, 0, 1, 2, 3, 4, 5, 6]),
            (0x1CEB_FF33, [2, 7, 8, 9, 10, 11, 12, 13]),
            (0x1CEB_FF33, [3, 14, 15, 16, 1, 18, 19, 0xFF]),
            (
                0x18FE_CA00,
                [0x04, 0xFF, 0xB8, 0x04, 0x03, 0x0A, 0xFF, 0xFF],
            ),
        ];
        let mut samples = Vec::new();
        for (number, (id, data)) in frames.into_iter().enumerate() {
            let flags = CanFlags {
                extended: true,
                ..CanFlags::default()
            };
            let frame = CanFrame::new(id, flags, &data).expect("eight bytes");
            let arrived = Arrived {
                late_ns: 0,
                source: SourceId(0),
                log_time: LogTime(1_000_000_000 + 50_000_000 * number as u64),
                latency_s: 0.0,
            };
            decoder.push(&arrived, &frame, &mut samples);
        }
        let signals: Vec<_> = samples
            .iter()
            .filter_map(|sample| match &sample.measurement {
                Measurement::Signals(frame) => Some(frame),
                _ => None,
            })
            .collect();
        let value = |frame: &SignalFrame, name: &str| {
            let mut all = frame.signals.iter();
            all.find(|signal| *signal.name == *name).map(|s| s.value)
        };
        assert_eq!(signals.len(), 2, "{signals:?}");
        assert_eq!(&*signals[0].message, "LONG");
        assert_eq!(value(signals[0], "late"), Some(f64::from(1 << 8 | 16)));
        assert_eq!(value(signals[0], "j1939_source_address"), Some(51.0));
        assert_eq!(&*signals[1].message, DM1);
        let expected = [
            ("lamp_amber_warning", 1.0),
            ("codes", 1.0),
            ("spn_1", 1208.0),
            ("fmi_1", 3.0),
        ];
        for (name, expected) in expected {
            assert_eq!(value(signals[1], name), Some(expected), "{name}");
        }
    }
}
