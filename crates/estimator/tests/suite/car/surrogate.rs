//! A car that shares nothing with the filter's model: four tyres by the Magic Formula with combined
//! slip, load-dependent stiffness and friction, relaxation, roll, compliant steering, roll steer,
//! a road with bank and grade, and a driver who laps it.

use math::Random;

use super::road::{Lap, Road};

pub const GRAVITY_M_S2: f64 = 9.806_65;
/// Step of the integration, s, and steps from row to row.
const DT_S: f64 = 0.001;
const STEPS_A_ROW: usize = 10;
/// Longitudinal stiffness over cornering stiffness.
const SLIP_RATIO: f64 = 1.3;
/// Pace of the laps.
const PACES: [f64; 8] = [0.85, 0.96, 0.98, 0.93, 0.99, 0.95, 0.97, 1.0];

/// An axle's tyres and suspension.
#[derive(Clone, Copy)]
pub struct AxleOfCar {
    pub track_m: f64,
    /// Friction at the static load, and its fall for a doubled load.
    pub friction: f64,
    pub friction_fall: f64,
    /// Cornering stiffness over load at the static load, 1/rad, and the load, over the static one,
    /// at which stiffness is greatest.
    pub stiffness: f64,
    pub load_of_greatest: f64,
    /// Shape C and curvature E of the Magic Formula.
    pub shape: f64,
    pub curvature: f64,
    pub relaxation_m: f64,
    pub roll_stiffness_n_m_rad: f64,
    /// Steer towards less slip by lateral force, rad/N, and steer by roll.
    pub compliance_rad_n: f64,
    pub roll_steer: f64,
}

#[derive(Clone, Copy)]
pub struct Car {
    pub mass_kg: f64,
    pub front_m: f64,
    pub rear_m: f64,
    pub cg_height_m: f64,
    pub yaw_inertia_kg_m2: f64,
    pub roll_inertia_kg_m2: f64,
    pub roll_arm_m: f64,
    pub roll_damping: f64,
    pub axles: [AxleOfCar; 2],
    pub drive_front: f64,
    pub brake_front: f64,
    pub drag_n_s2_m2: f64,
}

/// Errors of the sensors; noise of speed, steer, yaw rate and lateral acceleration.
#[derive(Clone, Copy)]
pub struct Errors {
    pub steer_rad: f64,
    pub steer_gain: f64,
    pub gyro_rad_s: f64,
    pub accel_m_s2: f64,
    pub speed_gain: f64,
    pub imu_height_m: f64,
    pub noise: [f64; 4],
}

/// A row of 100 Hz: what the sensors say, and the truth.
#[derive(Clone, Copy)]
pub struct Row {
    pub time_s: f64,
    pub speed_m_s: f64,
    pub steer_rad: f64,
    pub yaw_rate_rad_s: f64,
    pub lateral_m_s2: f64,
    pub sideslip_rad: f64,
}

/// Drives for `seconds`.
pub fn drive(car: &Car, lap: &Lap, errors: &Errors, seconds: f64) -> Vec<Row> {
    let mut motion = Driven::new(car, lap);
    let mut rows = Vec::new();
    for step in 0..(seconds / DT_S) as usize {
        let time_s = step as f64 * DT_S;
        if step.is_multiple_of(STEPS_A_ROW) {
            motion.drive_on();
        }
        let grip = 1.0 + lap.drift * (time_s / seconds - 0.5);
        motion.step(grip);
        if step.is_multiple_of(STEPS_A_ROW) {
            rows.push(motion.sensed(time_s, errors));
        }
    }
    rows
}

/// Car, driver and where they are.
struct Driven<'c> {
    car: &'c Car,
    lap: &'c Lap,
    road: Road,
    random: Random,
    still_n: [f64; 2],
    speed: f64,
    lateral: f64,
    yaw_rate: f64,
    roll: f64,
    roll_rate: f64,
    roll_acceleration: f64,
    along_m_s2: f64,
    side_m_s2: f64,
    force_n: [[f64; 2]; 4],
    /// Longitudinal slip and lagged slip angle of each tyre.
    slip: [[f64; 2]; 4],
    place_m: f64,
    beside_m: f64,
    heading: f64,
    /// Unsteadiness of pace, hand and line.
    wander: [f64; 3],
    pace: f64,
    hand: f64,
    floated: f64,
    steer: f64,
}

impl<'c> Driven<'c> {
    fn new(car: &'c Car, lap: &'c Lap) -> Self {
        let load_n = 0.5 * car.mass_kg * GRAVITY_M_S2 / (car.front_m + car.rear_m);
        Self {
            car,
            lap,
            road: Road::new(lap),
            random: Random::new(lap.seed ^ 0x5EED),
            still_n: [load_n * car.rear_m, load_n * car.front_m],
            speed: 10.0,
            lateral: 0.0,
            yaw_rate: 0.0,
            roll: 0.0,
            roll_rate: 0.0,
            roll_acceleration: 0.0,
            along_m_s2: 0.0,
            side_m_s2: 0.0,
            force_n: [[0.0; 2]; 4],
            slip: [[0.0; 2]; 4],
            place_m: 0.0,
            beside_m: 0.0,
            heading: 0.0,
            wander: [0.0; 3],
            pace: 0.8,
            hand: 0.0,
            floated: 0.0,
            steer: 0.0,
        }
    }

    /// What the driver decides every hundredth of a second: the front slip for the force that the
    /// line asks for, no more than the tyre's best, on top of where the front axle goes.
    fn drive_on(&mut self) {
        let lap_number = (self.place_m / self.road.length_m()) as usize;
        self.pace += 0.005 * (PACES[lap_number % PACES.len()] + self.wander[0] - self.pace);
        for (i, (time_s, size)) in [(6.0_f64, 0.03), (0.4, 0.004), (3.0, 0.5)]
            .into_iter()
            .enumerate()
        {
            let push = size * (0.02 / time_s).sqrt() * self.random.normal();
            self.wander[i] += push - self.wander[i] * 0.01 / time_s;
        }
        let (v, front) = (self.speed, &self.car.axles[0]);
        let ahead = self.road.at(&self.road.curvature, self.place_m + 0.25 * v);
        let beside = (self.beside_m - self.wander[2]).clamp(-3.0, 3.0);
        let course = (self.heading + self.lateral / v).clamp(-0.3, 0.3);
        let want = ahead - 0.6 / (v * v) * beside - 1.5 / v * course;
        let part = (v * v * want / (front.friction * GRAVITY_M_S2)).clamp(-0.93, 0.93);
        let slip = front.friction / front.stiffness * part / math::cbrt(1.0 - part.abs().powi(3));
        let bent = front.compliance_rad_n * 2.0 * self.still_n[0] * front.friction * part;
        let floats = math::atan((self.lateral + self.car.front_m * self.yaw_rate) / v);
        self.floated += 0.03 * (floats - self.floated);
        let aim = self.floated
            + slip
            + bent
            + 0.15 * (v * want - self.yaw_rate)
            + self.wander[1] * (10.0 / v.max(8.0));
        self.hand += 0.25 * (aim.clamp(-0.4, 0.4) - self.hand);
    }

    /// Drive and brake force that the driver asks for; less while the rear slides.
    fn demand_n(&self) -> f64 {
        let (car, v) = (self.car, self.speed);
        let rear = ((self.lateral - car.rear_m * self.yaw_rate) / v).abs();
        let best = car.axles[1].friction / car.axles[1].stiffness;
        let loose = (rear / best - 0.9).clamp(0.0, 1.0);
        let aim = self.pace * self.road.at(&self.road.speed, self.place_m + 0.3 * v);
        let push = (2.5 * (aim - v)).clamp(-self.lap.brake_m_s2, self.lap.push_m_s2);
        let slope = GRAVITY_M_S2 * self.road.at(&self.road.grade, self.place_m);
        car.mass_kg * (push * (1.0 - loose) + slope) + car.drag_n_s2_m2 * v * v
    }

    fn step(&mut self, grip: f64) {
        let car = self.car;
        self.steer += ((self.hand - self.steer) * DT_S / 0.03).clamp(-2.0 * DT_S, 2.0 * DT_S);
        let demand_n = self.demand_n();
        let (mut sum_n, mut moment) = ([0.0; 2], 0.0);
        for i in 0..4 {
            self.tyre(i, demand_n, grip);
            let (x, y) = self.place_of(i);
            let (sin, cos) = if i < 2 {
                math::sin_cos(self.steer)
            } else {
                (0.0, 1.0)
            };
            let [along, across] = self.force_n[i];
            let (fx, fy) = (along * cos - across * sin, across * cos + along * sin);
            sum_n[0] += fx;
            sum_n[1] += fy;
            moment += x * fy - y * fx;
        }
        let v = self.speed;
        self.along_m_s2 = (sum_n[0] - car.drag_n_s2_m2 * v * v) / car.mass_kg;
        self.side_m_s2 = sum_n[1] / car.mass_kg;
        let leaning = self.side_m_s2 + GRAVITY_M_S2 * self.roll;
        let tip = car.mass_kg * car.roll_arm_m * leaning
            - self.roll_stiffness() * self.roll
            - car.roll_damping * self.roll_rate;
        self.roll_acceleration = tip / car.roll_inertia_kg_m2;
        let slope = GRAVITY_M_S2 * self.road.at(&self.road.grade, self.place_m);
        let bank = GRAVITY_M_S2 * self.road.at(&self.road.bank, self.place_m);
        let k = self.road.at(&self.road.curvature, self.place_m);
        self.speed += DT_S * (self.along_m_s2 - slope + self.yaw_rate * self.lateral);
        self.speed = self.speed.max(3.0);
        self.lateral += DT_S * (self.side_m_s2 + bank - self.yaw_rate * self.speed);
        self.yaw_rate += DT_S * moment / car.yaw_inertia_kg_m2;
        self.roll_rate += DT_S * self.roll_acceleration;
        self.roll += DT_S * self.roll_rate;
        let (sin, cos) = math::sin_cos(self.heading);
        let gone = (self.speed * cos - self.lateral * sin) / (1.0 - k * self.beside_m).max(0.2);
        self.place_m += DT_S * gone;
        self.beside_m += DT_S * (self.speed * sin + self.lateral * cos);
        self.heading += DT_S * (self.yaw_rate - k * gone);
    }

    fn roll_stiffness(&self) -> f64 {
        let axles = &self.car.axles;
        axles.iter().map(|axle| axle.roll_stiffness_n_m_rad).sum()
    }

    /// Where a wheel stands; even ones left, front ones first.
    fn place_of(&self, i: usize) -> (f64, f64) {
        let half = 0.5 * self.car.axles[i / 2].track_m;
        let x = if i < 2 {
            self.car.front_m
        } else {
            -self.car.rear_m
        };
        (x, if i.is_multiple_of(2) { half } else { -half })
    }

    fn load_n(&self, i: usize) -> f64 {
        let (car, axle) = (self.car, &self.car.axles[i / 2]);
        let length = car.front_m + car.rear_m;
        let ahead = car.mass_kg * self.along_m_s2 * car.cg_height_m / (2.0 * length);
        let arm = if i < 2 { car.rear_m } else { car.front_m } / length;
        let direct = car.mass_kg * self.side_m_s2 * (car.cg_height_m - car.roll_arm_m) * arm;
        let whole = self.roll_stiffness();
        let by_roll = axle.roll_stiffness_n_m_rad / whole
            * (whole * self.roll + car.roll_damping * self.roll_rate);
        let over = (direct + by_roll) / axle.track_m;
        let load = self.still_n[i / 2] + if i < 2 { -ahead } else { ahead };
        (load + if i.is_multiple_of(2) { -over } else { over }).max(1.0)
    }

    /// Slips and forces of one tyre, in its own axes.
    fn tyre(&mut self, i: usize, demand_n: f64, grip: f64) {
        let axle = &self.car.axles[i / 2];
        let (x, y) = self.place_of(i);
        let (left, right) = (self.force_n[i / 2 * 2][1], self.force_n[i / 2 * 2 + 1][1]);
        let angle = if i < 2 { self.steer } else { 0.0 } + axle.roll_steer * self.roll
            - axle.compliance_rad_n * (left + right);
        let (sin, cos) = math::sin_cos(angle);
        let (ux, uy) = (
            self.speed - self.yaw_rate * y,
            self.lateral + self.yaw_rate * x,
        );
        let rolling = (ux * cos + uy * sin).max(1.0);
        let aim = -(uy * cos - ux * sin) / rolling;
        self.slip[i][1] += (aim - self.slip[i][1]) * (DT_S * rolling / axle.relaxation_m).min(1.0);
        let front = if demand_n >= 0.0 {
            self.car.drive_front
        } else {
            self.car.brake_front
        };
        let wanted_n = 0.5 * demand_n * if i < 2 { front } else { 1.0 - front };
        let still_n = self.still_n[i / 2];
        self.force_n[i] = tyre_n(axle, self.slip[i], self.load_n(i), still_n, grip);
        let stiffness_n = SLIP_RATIO * axle.stiffness * still_n;
        let spin = self.slip[i][0] + DT_S / 0.02 * (wanted_n - self.force_n[i][0]) / stiffness_n;
        self.slip[i][0] = spin.clamp(-0.12, 0.12);
    }

    fn sensed(&mut self, time_s: f64, e: &Errors) -> Row {
        let leaning = self.side_m_s2 + GRAVITY_M_S2 * math::sin(self.roll);
        let lateral_m_s2 = leaning - self.roll_acceleration * e.imu_height_m + e.accel_m_s2;
        let [speed, steer, yaw_rate, lateral] = e.noise.map(|size| size * self.random.normal());
        Row {
            time_s,
            speed_m_s: self.speed * e.speed_gain + speed,
            steer_rad: self.steer * e.steer_gain + e.steer_rad + steer,
            yaw_rate_rad_s: self.yaw_rate + e.gyro_rad_s + yaw_rate,
            lateral_m_s2: lateral_m_s2 + lateral,
            sideslip_rad: math::atan2(self.lateral, self.speed),
        }
    }
}

/// Longitudinal and lateral force of one tyre at these slips (Pacejka, Tyre and Vehicle Dynamics,
/// 3rd edition, section 4.3.1, without camber and trail).
fn tyre_n(axle: &AxleOfCar, slip: [f64; 2], load_n: f64, still_n: f64, grip: f64) -> [f64; 2] {
    let ratio = load_n / still_n;
    let top = axle.load_of_greatest;
    let rising = |ratio: f64| math::sin(2.0 * math::atan(ratio / top));
    let stiffness = grip * axle.stiffness * still_n * rising(ratio) / rising(1.0);
    let peak = grip * axle.friction * (1.0 - axle.friction_fall * (ratio - 1.0)) * load_n;
    let along = SLIP_RATIO * slip[0];
    let size = math::hypot(along, slip[1]).max(1e-9);
    let bx = stiffness / (axle.shape * peak) * size;
    let bent = bx - axle.curvature * (bx - math::atan(bx));
    let force = peak * math::sin(axle.shape * math::atan(bent));
    [force * along / size, force * slip[1] / size]
}
