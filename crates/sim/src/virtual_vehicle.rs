use std::collections::VecDeque;

use model::sensors::Sensors;
use model::vehicle::Vehicle;

use crate::can_bus::CanBus;
use crate::emission::{Emission, Port};
use crate::gnss::{Novatel, Septentrio};
use crate::imu::Imu;
use crate::{Motion, Options, SimError, TruthState};

/// A motion, seen through a vehicle's sensors: an iterator of [`Emission`]s in time order.
pub struct VirtualVehicle {
    motion: Motion,
    imu: Imu,
    novatel: Novatel,
    septentrio: Septentrio,
    can: CanBus,
    /// Emissions made but not yet handed out, by port.
    waiting: [VecDeque<Emission>; Port::ALL.len()],
}

impl VirtualVehicle {
    /// Puts `sensors` on `vehicle` and lets it perform `motion`. Everything random follows from
    /// `seed`.
    ///
    /// # Errors
    /// Rates, resolutions or dimensions that make no sense.
    pub fn new(
        motion: Motion,
        vehicle: &Vehicle,
        sensors: &Sensors,
        options: &Options,
        seed: u64,
    ) -> Result<Self, SimError> {
        Ok(Self {
            imu: Imu::new(&motion, sensors, options, seed)?,
            novatel: Novatel::new(&motion, sensors, options, seed)?,
            septentrio: Septentrio::new(&motion, sensors, options, seed)?,
            can: CanBus::new(&motion, vehicle, sensors, options, seed)?,
            waiting: [const { VecDeque::new() }; Port::ALL.len()],
            motion,
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

    fn produce(&mut self, port: Port) -> Vec<Emission> {
        match port {
            Port::Imu => self.imu.produce(&self.motion).into_iter().collect(),
            Port::Novatel => self.novatel.produce(&self.motion),
            Port::Septentrio => self.septentrio.produce(&self.motion),
            Port::Can0 => self.can.produce(&self.motion),
        }
    }
}

impl Iterator for VirtualVehicle {
    type Item = Emission;

    fn next(&mut self) -> Option<Emission> {
        for (index, port) in Port::ALL.into_iter().enumerate() {
            if self.waiting[index].is_empty() {
                let made = self.produce(port);
                self.waiting[index].extend(made);
            }
        }
        self.waiting
            .iter_mut()
            .filter(|queue| !queue.is_empty())
            .min_by(|a, b| a[0].time_s.total_cmp(&b[0].time_s))?
            .pop_front()
    }
}
