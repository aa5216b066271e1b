use std::collections::VecDeque;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{PerWheel, StrainChannel};

use crate::can_bus::CanBus;
use crate::controllers::Controller;
use crate::emission::{Emission, Port};
use crate::faults::LineFaults;
use crate::gnss::{Novatel, Septentrio};
use crate::hidden::Hidden;
use crate::imu::Imu;
use crate::load::check_loads;
use crate::serial_line::SerialLine;
use crate::{Motion, Options, SimError, TruthState};

/// A motion, seen through a vehicle's sensors: an iterator of [`Emission`]s in time order.
pub struct VirtualVehicle {
    motion: Motion,
    hidden: Hidden,
    imu: Imu,
    novatel: Novatel,
    septentrio: Septentrio,
    can: CanBus,
    controllers: Vec<Controller>,
    /// What happens on the way, and how long a byte takes, by port.
    lines: [(LineFaults, f64); Port::ALL.len()],
    /// Emissions made but not yet handed out, by port.
    waiting: [VecDeque<Emission>; Port::ALL.len()],
}

impl VirtualVehicle {
    /// Puts `sensors` on `vehicle` and lets it perform `motion`, completed by
    /// [`Motion::complete`]. Everything random follows from
    /// `seed`.
    ///
    /// # Errors
    /// Rates, resolutions, dimensions or faults that make no sense; a linkage that cannot stand as the
    /// motion says.
    pub fn new(
        mut motion: Motion,
        vehicle: &Vehicle,
        sensors: &Sensors,
        options: &Options,
        seed: u64,
    ) -> Result<Self, SimError> {
        options.faults.check()?;
        check_loads(sensors, options)?;
        motion.complete(vehicle)?;
        let hidden = Hidden::draw(&options.hidden, seed);
        let sensors = &hidden.applied(sensors);
        Ok(Self {
            imu: Imu::new(&motion, sensors, options, seed)?,
            novatel: Novatel::new(&motion, sensors, options, &hidden, seed)?,
            septentrio: Septentrio::new(&motion, sensors, options, &hidden, seed)?,
            can: CanBus::new(&motion, vehicle, sensors, options, &hidden, seed)?,
            controllers: Port::ALL
                .into_iter()
                .filter_map(|port| {
                    Controller::new(port, &motion, vehicle, options, seed).transpose()
                })
                .collect::<Result<_, _>>()?,
            lines: Port::ALL.map(|port| {
                let baud = match port {
                    Port::Imu => options.imu_baud,
                    Port::Novatel => options.novatel_baud,
                    Port::Septentrio => options.septentrio_baud,
                    Port::Can0 => options.can_bit_rate(sensors),
                    Port::Steering | Port::Throttle | Port::Brake => options.controller_baud,
                };
                let faults = LineFaults::new(port, &options.faults, seed);
                (faults, SerialLine::byte_time_s(baud))
            }),
            waiting: [const { VecDeque::new() }; Port::ALL.len()],
            motion,
            hidden,
        })
    }

    /// How long the motion lasts, s. The last messages leave a little later.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.motion.duration_s()
    }

    /// What is true at a time.
    #[must_use]
    pub fn truth_at(&self, time_s: f64) -> TruthState {
        self.motion.at(time_s)
    }

    /// The motion being performed.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// The inertial unit's biases of this run, sensor axes: specific force in m/s^2, rate in
    /// rad/s.
    #[must_use]
    pub fn imu_biases(&self) -> ([f64; 3], [f64; 3]) {
        self.imu.biases()
    }

    /// The hidden errors of this run.
    #[must_use]
    pub fn hidden(&self) -> &Hidden {
        &self.hidden
    }

    /// The hub accelerometers of this run: the turn from the carrier's to the sensor's axes about x,
    /// y, z, rad, and the bias, sensor axes, m/s^2; `None` without hub accelerometers. A fault's turn
    /// is not in it.
    #[must_use]
    pub fn hub_accelerometers(&self) -> Option<PerWheel<([f64; 3], [f64; 3])>> {
        self.can.hubs().map(PerWheel)
    }

    /// What the device of the steering wheel reads straight ahead in this run, as an angle of the steering
    /// wheel, rad.
    #[must_use]
    pub fn steer_offset_rad(&self) -> f64 {
        self.can.steer_offset_rad()
    }

    /// Zero, rad, and gain of the sensors of the left and the right front wheel's angle in this run: angle =
    /// gain (reading - zero). `None` without such sensors.
    #[must_use]
    pub fn wheel_angles(&self) -> Option<[[f64; 2]; 2]> {
        self.can.wheel_angles()
    }

    /// What each corner's converters give at zero in this run: each strain channel that there is
    /// without load, the potentiometer at the design length.
    #[must_use]
    pub fn zero_counts(&self) -> PerWheel<([Option<f64>; StrainChannel::COUNT], f64)> {
        PerWheel(self.can.zeros())
    }

    fn produce(&mut self, port: Port) -> Vec<Emission> {
        match port {
            Port::Imu => self.imu.produce(&self.motion).into_iter().collect(),
            Port::Novatel => self.novatel.produce(&self.motion),
            Port::Septentrio => self.septentrio.produce(&self.motion),
            Port::Can0 => self.can.produce(&self.motion),
            Port::Steering | Port::Throttle | Port::Brake => self
                .controllers
                .iter_mut()
                .find(|controller| controller.port() == port)
                .and_then(|controller| controller.produce(&self.motion))
                .into_iter()
                .collect(),
        }
    }
}

impl Iterator for VirtualVehicle {
    type Item = Emission;

    fn next(&mut self) -> Option<Emission> {
        for (index, port) in Port::ALL.into_iter().enumerate() {
            // A whole epoch may be lost on the way: go on until something arrives.
            while self.waiting[index].is_empty() {
                let made = self.produce(port);
                if made.is_empty() {
                    break;
                }
                let (faults, byte_time_s) = &mut self.lines[index];
                let arriving = made
                    .into_iter()
                    .filter_map(|e| faults.pass(e, *byte_time_s));
                self.waiting[index].extend(arriving);
            }
        }
        self.waiting
            .iter_mut()
            .filter(|queue| !queue.is_empty())
            .min_by(|a, b| a[0].time_s.total_cmp(&b[0].time_s))?
            .pop_front()
    }
}
