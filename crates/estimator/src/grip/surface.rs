//! What the grip says of the ground to others: its friction, and what it leaves unknown.

use sample::{LogTime, PerWheel, TyreForce};

use super::Grip;

impl Grip {
    /// Factor of each axle on the vehicle file's friction that the drive has shown. An axle whose friction is not
    /// known has the factor of the other one, because both are on the same ground. `None` if neither is known.
    #[must_use]
    pub fn found_friction(&self, now: LogTime) -> Option<[f64; 2]> {
        let [front, rear] = [0, 1].map(|axle| {
            let found = self.axle(axle, now).friction?;
            Some(found / self.axles[axle].friction)
        });
        Some([front.or(rear)?, rear.or(front)?])
    }

    /// How much larger the slip angle of an axle can be than that of [`Self::slip_angle`], rad: with a friction that
    /// is no higher than the part in use, the tyres slide.
    #[must_use]
    pub fn slip_surplus(&self, axle: usize, forces: &PerWheel<TyreForce>) -> Option<f64> {
        let a = &self.axles[axle];
        let pair = [&forces.0[2 * axle], &forces.0[2 * axle + 1]];
        let lateral: f64 = pair.iter().map(|f| f.force_n[1]).sum();
        let loads = pair.map(|f| f.force_n[2].max(0.0));
        let load: f64 = loads.iter().sum();
        let stiffness: f64 = loads.iter().map(|n| a.stiffness_at(*n)).sum();
        let known = lateral.is_finite() && load > self.tuning.load_min_n && stiffness > 0.0;
        known.then(|| {
            let sliding = math::atan(a.state[3] * lateral.abs() / stiffness);
            let implied = self
                .slip_angle(axle, forces)
                .map_or(0.0, |(slip, _)| slip.abs());
            (sliding - implied).max(0.0)
        })
    }
}
