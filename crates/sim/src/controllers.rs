//! The Prowler's steering, throttle and brake controllers (thesis, appendix A): each writes its
//! position to a serial port, one line a reading.

use model::vehicle::Vehicle;
use sample::{STANDARD_GRAVITY_M_S2, Wheel};
use wire::line::{Format, Role};

use crate::can_bus::period_s;
use crate::emission::{Emission, Output, Port};
use crate::random::Noise;
use crate::serial_line::SerialLine;
use crate::{Motion, Options, SimError, TruthState};

/// Counts of one turn of the steering's and of the brake's encoder (thesis, appendix A).
const STEERING_PULSES: f64 = 4000.0;
const BRAKE_PULSES: f64 = 2000.0;
/// Steps of the throttle's motor from closed to open; assumed, the thesis does not tell.
const THROTTLE_STEPS: f64 = 1000.0;
/// Drive acceleration at open throttle, and deceleration at the end of the brake's travel, in g.
const OPEN_THROTTLE_G: f64 = 0.5;
const FULL_BRAKE_G: f64 = 1.0;
/// Travel of the brake's actuator, rad.
const BRAKE_TRAVEL_RAD: f64 = std::f64::consts::PI;

impl Port {
    /// How the controller at this port writes; `None` where there is none.
    #[must_use]
    pub fn line_format(self) -> Option<Format> {
        match self {
            Self::Steering => Some(Format::encoder(
                "steering_wheel",
                STEERING_PULSES,
                Role::Control,
            )),
            Self::Throttle => {
                let mut format = Format::encoder("throttle", 1.0, Role::Control);
                format.fields[0].scale = 1.0 / THROTTLE_STEPS;
                format.fields[0].unit = "1".to_owned();
                Some(format)
            }
            Self::Brake => Some(Format::encoder("brake", BRAKE_PULSES, Role::Control)),
            Self::Imu | Self::Novatel | Self::Septentrio | Self::Can0 => None,
        }
    }
}

/// One controller and its line.
pub(crate) struct Controller {
    port: Port,
    format: Format,
    /// Weight, N, and rolling resistance, front and rear, which pedals are judged against.
    weight_n: f64,
    rolling_resistance: [f64; 2],
    line: SerialLine,
    noise_line: Noise,
    period_s: f64,
    count: u64,
    end_s: f64,
}

impl Controller {
    /// The controller at `port`; `None` where there is none.
    pub(crate) fn new(
        port: Port,
        motion: &Motion,
        vehicle: &Vehicle,
        options: &Options,
        seed: u64,
    ) -> Result<Option<Self>, SimError> {
        let Some(format) = port.line_format() else {
            return Ok(None);
        };
        Ok(Some(Self {
            port,
            format,
            weight_n: vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2,
            rolling_resistance: [&vehicle.front, &vehicle.rear]
                .map(|axle| axle.tyre.rolling_resistance),
            line: SerialLine::new(options.controller_baud),
            noise_line: Noise::new(seed, &format!("{} line", port.name())),
            period_s: period_s("controller_rate_hz", options.controller_rate_hz)?,
            count: 0,
            end_s: motion.duration_s(),
        }))
    }

    /// Where it stands.
    pub(crate) fn port(&self) -> Port {
        self.port
    }

    /// The next line; none at the end.
    pub(crate) fn produce(&mut self, motion: &Motion) -> Option<Emission> {
        let time_s = self.count as f64 * self.period_s;
        if time_s > self.end_s {
            return None;
        }
        self.count += 1;
        let mut bytes = Vec::with_capacity(8);
        self.format
            .encode(&[self.position(&motion.at(time_s))], &mut bytes);
        // A controller's program notices its timer within its own loop.
        let ready_s = time_s + self.noise_line.delay(100e-6);
        Some(Emission {
            time_s: self.line.send(ready_s, bytes.len()),
            port: self.port,
            output: Output::Bytes(bytes),
        })
    }

    /// Where the actuator stands, in the unit of the line's format. Throttle and brake follow from
    /// the drive and brake forces that the tyres carry, so that any motion has them.
    fn position(&self, state: &TruthState) -> f64 {
        match self.port {
            Port::Throttle => between_stops(self.drive_g(state) / OPEN_THROTTLE_G),
            Port::Brake => BRAKE_TRAVEL_RAD * between_stops(-self.drive_g(state) / FULL_BRAKE_G),
            _ => state.steering_wheel_rad,
        }
    }

    /// Drive force of all tyres, without what rolling resistance takes, in parts of the weight;
    /// negative when braking.
    fn drive_g(&self, state: &TruthState) -> f64 {
        let force_n: f64 = Wheel::ALL
            .into_iter()
            .map(|wheel| {
                let truth = &state.wheels[wheel];
                let rolling = self.rolling_resistance[usize::from(!wheel.is_front())];
                truth.force_n[0]
                    + rolling * truth.force_n[2] * math::tanh(truth.angular_speed_rad_s)
            })
            .sum();
        force_n / self.weight_n
    }
}

/// From 0 to 1; what the motion does not tell is 0.
fn between_stops(part: f64) -> f64 {
    if part.is_nan() {
        0.0
    } else {
        part.clamp(0.0, 1.0)
    }
}
