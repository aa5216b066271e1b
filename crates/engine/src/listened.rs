//! What the data of a few seconds say against the configuration: rates, ranges of counts, axes of
//! accelerometers, load of the bus.

mod ranges;
mod values;

use std::collections::BTreeMap;

use acq::SourceKind;
use estimator::calibration::hub::WrongAxes;
use sample::{HubAccelerationSample, LogTime, Measurement, PerWheel, Sample, SourceId, Wheel};
use sim::Port;
use store::Record;

use crate::Config;
use crate::config::{Meaning, Role, Source};
use ranges::{Ranges, WrongRange};
use values::Values;

/// Most that a rate may differ from the sensors file's, parts of it.
const RATE_TOLERANCE: f64 = 0.2;
/// Fewest messages that a rate is judged by.
const MESSAGES_MIN: u64 = 10;
/// Shortest time that a rate is judged by, s.
const TIME_MIN_S: f64 = 0.5;

/// Rate of the steering-wheel angle, whichever device measures it.
const STEER: &str = "steer.rate_hz or steer_potentiometers.rate_hz";

/// Decoded data of some seconds.
#[derive(Debug, Default)]
pub struct Listened {
    rates: BTreeMap<&'static str, Rate>,
    hubs: PerWheel<[Mean; 3]>,
    /// Specific force of each inertial unit.
    units: BTreeMap<SourceId, [Mean; 3]>,
    values: Values,
    /// Counts of the corners; `None` without a vehicle.
    ranges: Option<Ranges>,
}

#[derive(Debug)]
struct Rate {
    first: LogTime,
    last: LogTime,
    count: u64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Listened {
    /// No data yet, to be compared with a configuration.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let settings = config.estimator.as_ref();
        Self {
            ranges: settings.map(|settings| Ranges::new(&settings.sensors)),
            ..Self::default()
        }
    }

    /// Takes a record of an engine.
    pub fn push(&mut self, record: &Record) {
        if let Record::Sample(sample) = record {
            self.push_sample(sample);
        }
    }

    fn push_sample(&mut self, sample: &Sample) {
        let mut came = |field| {
            let rate = self.rates.entry(field).or_insert(Rate {
                first: sample.log_time,
                last: sample.log_time,
                count: 0,
            });
            rate.last = sample.log_time;
            rate.count += 1;
        };
        self.values.push(sample);
        if let (Some(ranges), Measurement::Corner(corner)) = (&mut self.ranges, &sample.measurement)
        {
            ranges.push(corner);
        }
        match &sample.measurement {
            Measurement::Corner(corner) if corner.wheel == Wheel::FrontLeft => {
                // The first channel of the arms: a corner's counts come in two frames.
                if corner.strain_counts[0].is_some() {
                    came("strain.rate_hz");
                }
                if corner.deflection_counts.is_some() {
                    came("deflection.rate_hz");
                }
            }
            Measurement::Steer(_) => came(STEER),
            Measurement::WheelSpeed(_) => came("wheel_speed.rate_hz"),
            Measurement::Imu(imu) => {
                came("imu.rate_hz");
                let unit = self.units.entry(sample.source).or_default();
                for (mean, value) in unit.iter_mut().zip(imu.specific_force_m_s2) {
                    if value.is_finite() {
                        mean.sum += value;
                        mean.count += 1.0;
                    }
                }
            }
            Measurement::HubAcceleration(hub) => {
                if hub.wheel == Wheel::FrontLeft {
                    came("hub_acceleration.rate_hz");
                }
                let axes = hub.specific_force_m_s2.into_iter();
                for (mean, value) in self.hubs[hub.wheel].iter_mut().zip(axes) {
                    if let Some(value) = value {
                        mean.sum += value;
                        mean.count += 1.0;
                    }
                }
            }
            _ => {}
        }
    }

    /// Last values of a source that the estimator or a reader uses, each with its unit: the signals of
    /// roles, or the measurements.
    #[must_use]
    pub fn values(&self, source: &Source) -> Vec<String> {
        self.values.of(source)
    }

    /// What does not fit the configuration, each with its remedy.
    #[must_use]
    pub fn warnings(&self, config: &Config) -> Vec<String> {
        let mut warnings = self.rates_and_hubs(config);
        if config.estimator.is_some() {
            warnings.extend(self.turned_units(config));
        }
        let wrong = self.wrong_ranges(config).into_iter();
        warnings.extend(wrong.map(|wrong| format!("{}: {}", wrong.channels, wrong.beyond)));
        warnings
    }

    /// Channels with counts that the sensors file does not allow.
    pub(crate) fn wrong_ranges(&self, config: &Config) -> Vec<WrongRange> {
        let (ranges, settings) = (self.ranges.as_ref(), config.estimator.as_ref());
        let both = ranges.zip(settings);
        both.map_or_else(Vec::new, |(ranges, settings)| {
            ranges.wrong(&settings.vehicle)
        })
    }

    /// Rates and tables that differ from the sensors file, and hub accelerometers that are turned.
    pub(crate) fn rates_and_hubs(&self, config: &Config) -> Vec<String> {
        let Some(settings) = &config.estimator else {
            return Vec::new();
        };
        let sensors = &settings.sensors;
        let hub_hz = sensors.hub_acceleration.as_ref().map(|hub| hub.rate_hz);
        let encoder_hz = sensors.steer.as_ref().map(|encoder| encoder.rate_hz);
        let rods_hz = sensors
            .steer_potentiometers
            .as_ref()
            .map(|pots| pots.rate_hz);
        let steer_hz = encoder_hz.or(rods_hz);
        let told = [
            ("strain.rate_hz", Some(sensors.strain.rate_hz)),
            ("deflection.rate_hz", Some(sensors.deflection.rate_hz)),
            (STEER, steer_hz),
            ("wheel_speed.rate_hz", Some(sensors.wheel_speed.rate_hz)),
            ("imu.rate_hz", Some(sensors.imu.rate_hz)),
            ("hub_acceleration.rate_hz", hub_hz),
        ];
        let mut warnings = Vec::new();
        for (field, told_hz) in told {
            let found_hz = self.rates.get(field).and_then(Rate::hz);
            match (found_hz, told_hz) {
                (Some(_), Some(0.0)) => {
                    let table = field.split('.').next().unwrap_or_default();
                    warnings.push(format!(
                        "readings of {table} arrive, but the sensors file has no table [{table}]; add it, \
                         because values and noise of the readings follow from it"
                    ));
                }
                (Some(found), Some(told)) if (found / told - 1.0).abs() > RATE_TOLERANCE => {
                    warnings.push(format!(
                        "{field} of the sensors file is {told} Hz, but {found:.0} messages a second \
                         arrive; correct the sensors file or the rate of the device"
                    ));
                }
                (Some(_), None) => warnings.push(
                    "hub accelerations arrive, but the sensors file has no table \
                     [hub_acceleration]; add it, otherwise they are recorded as counts alone"
                        .to_owned(),
                ),
                _ => {}
            }
        }
        for wheel in Wheel::ALL {
            let mean = self.hubs[wheel].map(Mean::value);
            if let Some(wrong) = WrongAxes::find(wheel, mean) {
                let corner = wheel.abbreviation();
                warnings.push(format!("hub accelerometer {corner}: {wrong}"));
            }
        }
        warnings
    }

    /// Inertial units on which gravity does not show upward on z.
    fn turned_units(&self, config: &Config) -> Vec<String> {
        let turned = self.units.iter().filter_map(|(id, means)| {
            let wrong = WrongAxes::find(Wheel::FrontLeft, means.map(Mean::value))?;
            let source = config.sources.iter().find(|source| source.spec.id == *id)?;
            let remedy = match source.meaning {
                Meaning::Can(_) => {
                    "give the roles acceleration and rate the signals of the axes that point forward, left \
                     and up (a minus before a signal turns its sign)"
                }
                _ => "mount it with x forward, y to the left and z up",
            };
            let name = &source.spec.name;
            let axis = HubAccelerationSample::AXES[wrong.axis];
            let z = means[2].value().map_or_else(
                || "is not measured".to_owned(),
                |z| format!("reads {z:.1} m/s^2"),
            );
            Some(format!(
                "source {name}: the inertial unit's z axis {z}, the largest mean is {:.1} m/s^2 on {axis} \
                 instead of +9.8 m/s^2 on z; {remedy}",
                wrong.value_m_s2
            ))
        });
        turned.collect()
    }
}

impl Mean {
    fn value(self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
}

impl Rate {
    fn hz(&self) -> Option<f64> {
        let span_s = self.last.seconds_since(self.first);
        let enough = self.count >= MESSAGES_MIN && span_s >= TIME_MIN_S;
        enough.then(|| (self.count - 1) as f64 / span_s)
    }
}

/// Buses whose configured bit rate cannot carry the sensors of the sensors file, if they send the frames
/// of the project's DBC.
#[must_use]
pub fn bus_warnings(config: &Config) -> Vec<String> {
    let Some(settings) = &config.estimator else {
        return Vec::new();
    };
    let buses = config.sources.iter().filter_map(|source| {
        let bit_rate = match &source.spec.kind {
            SourceKind::Can(can) => can.link.as_ref()?.bit_rate?,
            SourceKind::Slcan(slcan) => slcan.bit_rate?,
            SourceKind::Serial(_) => return None,
        };
        let Meaning::Can(can) = &source.meaning else {
            return None;
        };
        let strain = |role: &crate::config::RoleOf| matches!(role.role, Role::Strain(..));
        can.roles.iter().any(strain).then_some((source, bit_rate))
    });
    let loads = buses.filter_map(|(source, bit_rate)| {
        let options = sim::Options {
            can_bit_rate: Some(bit_rate),
            ..sim::Options::default()
        };
        let loads = sim::port_loads(&settings.sensors, &options);
        let load = loads.into_iter().find(|load| load.port == Port::Can0)?;
        let most = 100.0 * load.share_max();
        (load.share() > load.share_max()).then(|| {
            format!(
                "source {}: the sensors file asks for {load}, but at most {most:.0} % can be used; \
                 raise the bit rate of the bus, or lower a rate",
                source.spec.name
            )
        })
    });
    loads.collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use sample::ImuSample;

    use super::*;

    fn config(sensors: &str, bit_rate: u32) -> Config {
        let text = format!(
            "[source.bus]\nkind = \"slcan\"\ndevice = \"/dev/x\"\nbitrate = {bit_rate}\n\
             [vehicle]\nfile = \"prowler\"\nsensors = \"{sensors}\"\n"
        );
        Config::from_text(&text, Path::new(".")).expect("a configuration")
    }

    /// Two seconds of hub accelerations at a rate, gravity on one axis.
    fn listened(rate_hz: f64, axis: usize) -> Listened {
        let mut listened = Listened::default();
        for k in 0..(2.0 * rate_hz) as u32 {
            for wheel in Wheel::ALL {
                let mut hub = HubAccelerationSample::empty(wheel);
                hub.specific_force_m_s2 = [Some(0.1); 3];
                let turned = wheel == Wheel::FrontRight;
                hub.specific_force_m_s2[if turned { axis } else { 2 }] = Some(9.7);
                let time = LogTime(0).offset_seconds(f64::from(k) / rate_hz);
                listened.push(&Record::Sample(Sample {
                    source: SourceId(0),
                    log_time: time,
                    valid_time: time,
                    device_time: None,
                    measurement: Measurement::HubAcceleration(hub),
                }));
            }
        }
        listened
    }

    #[test]
    fn rates_and_axes_that_do_not_fit_are_named() {
        let config = config("thesis-10bit-hub", 500_000);
        assert_eq!(listened(100.0, 2).warnings(&config), [""; 0]);
        let slow = listened(50.0, 2).warnings(&config);
        assert_eq!(slow.len(), 1, "{slow:?}");
        assert!(slow[0].contains("hub_acceleration.rate_hz of the sensors file is 100 Hz, but 50"));
        let turned = listened(100.0, 0).warnings(&config);
        assert_eq!(turned.len(), 1, "{turned:?}");
        assert!(
            turned[0].contains("FR: gravity shows as 9.7 m/s^2 on x"),
            "{turned:?}"
        );
    }

    /// An inertial unit with gravity on an axis, at rest.
    fn with_unit(axis: usize, sensors: &str) -> Vec<String> {
        let mut listened = Listened::default();
        for k in 0..200 {
            let time = LogTime(0).offset_seconds(0.01 * f64::from(k));
            let mut imu = ImuSample {
                specific_force_m_s2: [0.1; 3],
                ..ImuSample::default()
            };
            imu.specific_force_m_s2[axis] = 9.8;
            listened.push(&Record::Sample(Sample {
                source: SourceId(0),
                log_time: time,
                valid_time: time,
                device_time: None,
                measurement: Measurement::Imu(imu),
            }));
        }
        let text = format!(
            "[source.bus]\nkind = \"can\"\ninterface = \"can0\"\n\
             [vehicle]\nfile = \"prowler\"\nsensors = \"{sensors}\"\n"
        );
        let directory = tempfile::tempdir().expect("a directory");
        std::fs::write(directory.path().join("none.toml"), "name = \"none\"\n").expect("written");
        let config = Config::from_text(&text, directory.path()).expect("a configuration");
        listened.warnings(&config)
    }

    #[test]
    fn an_inertial_unit_that_is_turned_or_not_in_the_sensors_file_is_named() {
        assert_eq!(with_unit(2, "thesis-10bit"), [""; 0]);
        let turned = with_unit(0, "thesis-10bit");
        assert_eq!(turned.len(), 1, "{turned:?}");
        let told = "source bus: the inertial unit's z axis reads 0.1 m/s^2, the largest mean is 9.8 m/s^2 on x";
        assert!(turned[0].contains(told), "{turned:?}");
        let unknown = with_unit(2, "none.toml");
        assert_eq!(unknown.len(), 1, "{unknown:?}");
        assert!(unknown[0].contains("has no table [imu]"), "{unknown:?}");
    }

    #[test]
    fn a_bus_that_cannot_carry_its_sensors_is_named() {
        assert_eq!(bus_warnings(&config("thesis-10bit-hub", 500_000)), [""; 0]);
        let fast = "full-bridge-16bit-bending-500hz-hub";
        assert_eq!(bus_warnings(&config(fast, 1_000_000)), [""; 0]);
        let told = bus_warnings(&config(fast, 500_000));
        assert!(
            told[0].contains("source bus") && told[0].contains("110.9 %"),
            "{told:?}"
        );
    }
}
