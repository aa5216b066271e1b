//! Decodes CAN frames to signals and measurements.

mod convert;
mod measured;
mod parts;

use std::sync::Arc;

use model::sensors::{HubAcceleration, Potentiometers, StrainChain};
use sample::{
    CanFrame, ControlSample, DeviceTime, LogTime, Measurement, NANOS_PER_SECOND, PerWheel, Sample,
    Signal, SignalFrame, SourceId, SteerSample, WheelSpeedSample,
};
use wire::dbc::{Database, MessageDef, SignalDef, parameter_group, source_address};
use wire::j1939::{self, Lamps, Transport};

use crate::config::{CanMeaning, Estimator, Role, Travel};

pub use convert::Conversion;
use measured::decode;
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
    identity: Identity,
    sync: Option<Sync>,
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
    /// Its place among the messages whose latencies are not known.
    uncertain: Option<usize>,
    /// Whether the sync frame marks its sampling.
    is_marked: bool,
}

/// The frame that marks the sampling of messages.
struct Sync {
    id: (u32, bool),
    offset_s: f64,
    within_ns: i64,
    /// When the last one was on the bus.
    last: Option<LogTime>,
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
            uncertain: None,
            is_marked: false,
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
    /// When the sync frame says that the message was sampled.
    pub sampled: Option<LogTime>,
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

    /// When the frame was on the bus.
    fn on_bus(&self) -> LogTime {
        self.log_time.offset_nanos(-self.late_ns)
    }

    /// When the message was sampled.
    fn instant(&self) -> LogTime {
        self.sampled
            .unwrap_or_else(|| self.on_bus().offset_seconds(-self.latency_s))
    }
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
        if let Some(sync) = &meaning.sync {
            for (decodable, marks) in databases.iter_mut().zip(&sync.marks) {
                for (plan, is_marked) in decodable.plans.iter_mut().zip(marks) {
                    plan.is_marked = *is_marked;
                }
            }
        }
        Self {
            databases,
            scales,
            parts,
            transport: Transport::default(),
            identity: Identity::default(),
            sync: meaning.sync.as_ref().map(|sync| Sync {
                id: sync.id,
                offset_s: sync.offset_s,
                within_ns: i64::try_from(sync.within.as_nanos()).unwrap_or(i64::MAX),
                last: None,
            }),
        }
    }

    /// The latency of this message is not known: samples of it belong to this place.
    pub fn set_uncertain(&mut self, [database, message]: [usize; 2], place: usize) {
        let decodable = self.databases.get_mut(database);
        if let Some(plan) = decodable.and_then(|decodable| decodable.plans.get_mut(message)) {
            plan.uncertain = Some(place);
        }
    }

    /// Decodes a frame, and the message that it completes, and appends the samples. Returns the place of the message
    /// among those whose latencies are not known, if it is one of them.
    pub fn push(
        &mut self,
        arrived: &Arrived,
        frame: &CanFrame,
        sink: &mut Vec<Sample>,
    ) -> Option<usize> {
        if frame.flags.error || frame.flags.remote {
            return None;
        }
        if let Some(sync) = &mut self.sync
            && sync.id == (frame.id, frame.flags.extended)
        {
            sync.last = Some(arrived.on_bus());
        }
        let mut uncertain = self.decode(arrived, frame, frame.id, frame.bytes(), sink);
        let is_extended = frame.flags.extended;
        if is_extended && parameter_group(frame.id) == j1939::DM1 {
            self.diagnose(arrived, frame, frame.id, frame.bytes(), sink);
        }
        if let Some(whole) = self.transport.push(frame, arrived.log_time.0) {
            uncertain = (self.decode(arrived, frame, whole.id, &whole.data, sink)).or(uncertain);
            if parameter_group(whole.id) == j1939::DM1 {
                self.diagnose(arrived, frame, whole.id, &whole.data, sink);
            }
        }
        uncertain
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
        signals.extend(self.identity.signals(id));
        sink.push(arrived.sample(
            frame,
            Measurement::Signals(SignalFrame {
                message: DM1.into(),
                id,
                signals,
            }),
        ));
    }

    /// When the sync frame says that a message was sampled.
    fn sampled(&self, arrived: &Arrived) -> Option<LogTime> {
        let sync = self.sync.as_ref()?;
        let since_ns = arrived.on_bus() - sync.last?;
        let sampled = sync.last?.offset_seconds(sync.offset_s);
        (0..=sync.within_ns)
            .contains(&since_ns)
            .then(|| sampled.min(arrived.log_time))
    }

    /// Decodes the data of an identifier, which a frame completed. Returns the same as [`push`](Self::push).
    fn decode(
        &mut self,
        arrived: &Arrived,
        frame: &CanFrame,
        id: u32,
        data: &[u8],
        sink: &mut Vec<Sample>,
    ) -> Option<usize> {
        let found = self.databases.iter().find_map(|decodable| {
            let position = decodable.database.position(id, frame.flags.extended)?;
            let message = &decodable.database.messages()[position];
            Some((message, &decodable.plans[position]))
        });
        let (message, plan) = found?;
        let uncertain = plan.uncertain;
        let arrived = Arrived {
            latency_s: plan.latency_s.unwrap_or(arrived.latency_s),
            sampled: plan.is_marked.then(|| self.sampled(arrived)).flatten(),
            ..*arrived
        };
        let mut emit = |measurement| sink.push(arrived.sample(frame, measurement));
        let (mut signals, measured) = decode(message, plan, data, &self.scales);
        if message.j1939 {
            signals.extend(self.identity.signals(id));
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
        let by_rods = measured.by_rods_rad(self.scales.rack_m_rad);
        for corner in measured.corners {
            emit(Measurement::Corner(corner));
        }
        for hub in measured.hubs {
            emit(Measurement::HubAcceleration(hub));
        }
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
        uncertain
    }
}

/// Names of the signals that tell the senders of a parameter group apart.
struct Identity {
    id: Arc<str>,
    address: Arc<str>,
    unit: Arc<str>,
}

impl Default for Identity {
    fn default() -> Self {
        Self {
            id: store::CAN_ID.into(),
            address: store::SOURCE_ADDRESS.into(),
            unit: "".into(),
        }
    }
}

impl Identity {
    fn signals(&self, id: u32) -> [Signal; 2] {
        let values = [
            (&self.id, f64::from(id)),
            (&self.address, f64::from(source_address(id))),
        ];
        values.map(|(name, value)| Signal {
            name: Arc::clone(name),
            value,
            unit: Arc::clone(&self.unit),
        })
    }
}

#[cfg(test)]
mod tests;
