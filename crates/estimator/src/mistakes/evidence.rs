//! Evidence for mistakes: the information of a drive on what may be wrong.
//!
//! Each window gives rows z = G u + H p + noise with unknown forces u and parameters p. The covariance G P G' + R
//! of what is unknown whitens the rows. What remains is information on p.

use nalgebra::{Matrix3, Vector3};
use sample::STANDARD_GRAVITY_M_S2;

use super::considered::{Considered, FORCES};
use super::layout::{
    BIAS, CORNERS, EXCHANGED, FIRST_MOMENT, GAIN, HEIGHT, HITCH, LEVER, LOST, MASS, OFFSET, PAIRS,
    PRELOAD, RATE, ROTATIONS, SCALE, SHAPE, SIZE, TILT, TOLERATED, TURNED, WHEELS,
};
use super::linear;
use super::rows::{covariance_of_rows, exact, tilted_moments, tolerance, unknown_sigma};
use super::tolerances::Stated;
use crate::fusion::relations::{
    ACCEL_ROW, CHANNELS, Loads, ROWS, RelationWindow, STRUT_ROW, TURN_ROW,
};
use crate::statics::AXIAL;
use crate::tuning::MistakeTuning;

/// What the evidence needs of the vehicle and of the sensors.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Mean static load of the wheels, N.
    pub load_n: f64,
    /// Static load of each wheel, N.
    pub static_n: [f64; 4],
    /// What is added to it by a mass at the centre of gravity, N/kg, and by its first moments forward and
    /// left of there, N/(kg m).
    pub weight_n: [[f64; 3]; 4],
    /// Inverse of the inertia, 1/(kg m^2).
    pub inverse: Matrix3<f64>,
    /// Inertial unit from the centre of gravity, m.
    pub imu_m: Vector3<f64>,
    /// Hitch from the centre of gravity, m.
    pub hitch_m: Vector3<f64>,
    /// Radius of each tyre, m.
    pub radius_m: [f64; 4],
    /// Standard deviation of the offset of each axial channel, N.
    pub offset_sigma_n: [f64; CHANNELS],
    /// Value of one count of each axial channel, N.
    pub count_n: [f64; CHANNELS],
    /// Standard deviation of the bias of the accelerometers, m/s^2.
    pub bias_sigma_m_s2: f64,
    /// Tolerances that the files state.
    pub stated: Stated,
}

/// Sum of the information of whitened rows z = h p + noise.
#[derive(Clone, Debug)]
struct Information {
    size: usize,
    /// Upper triangle, in rows.
    matrix: Vec<f64>,
    vector: Vec<f64>,
}

impl Information {
    fn new(size: usize) -> Self {
        Self {
            size,
            matrix: vec![0.0; size * size],
            vector: vec![0.0; size],
        }
    }

    /// Adds a row with a weight.
    fn add(&mut self, gains: &[f64], value: f64, weight: f64) {
        let n = self.size;
        for (i, gain) in gains.iter().enumerate().filter(|(_, gain)| **gain != 0.0) {
            let to = &mut self.matrix[i * n + i..(i + 1) * n];
            linear::add(to, weight * gain, &gains[i..]);
        }
        linear::add(&mut self.vector, weight * value, gains);
    }

    /// Element of the matrix.
    fn at(&self, i: usize, j: usize) -> f64 {
        self.matrix[i.min(j) * self.size + i.max(j)]
    }
}

/// Information on the parameters. Matrices are in rows.
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    tuning: MistakeTuning,
    pub(super) setup: Setup,
    /// Standard deviations of the tolerated parameters.
    pub(super) sigma: [f64; TOLERATED],
    information: Information,
    /// The same on the tolerated parameters, from rows as exact as the sensors resolve them.
    fine: Information,
    /// Gains of the parameters on the rows of a window.
    gains: Vec<f64>,
    /// Covariance and means of the tolerated parameters.
    covariance: Vec<f64>,
    mean: Vec<f64>,
    scratch: Vec<f64>,
    considered: Considered,
    /// Bias of the accelerometers that the motion filter has learnt, and its standard deviation, m/s^2.
    learnt_bias: [Vector3<f64>; 2],
    pub(super) windows: u32,
    /// Sums over the rows: weights, and weighted squares of the values.
    weights: f64,
    squares: f64,
    /// Windows in which each axial channel was read.
    read: [u32; CHANNELS],
}

impl Evidence {
    pub(super) fn new(setup: Setup, tuning: MistakeTuning) -> Self {
        let considered = Considered {
            // Tolerances that a file states count from the beginning.
            care: if setup.stated.is_any { 1.0 } else { 0.0 },
            ..Considered::default()
        };
        Self {
            sigma: std::array::from_fn(|at| tolerance(at, &setup, &tuning)),
            tuning,
            setup,
            information: Information::new(SIZE),
            fine: Information::new(TOLERATED),
            gains: vec![0.0; ROWS * SIZE],
            covariance: vec![0.0; TOLERATED * TOLERATED],
            mean: vec![0.0; TOLERATED],
            scratch: vec![0.0; TOLERATED * TOLERATED],
            considered,
            learnt_bias: [Vector3::zeros(), Vector3::repeat(f64::INFINITY)],
            windows: 0,
            weights: 0.0,
            squares: 0.0,
            read: [0; CHANNELS],
        }
    }

    /// Takes a window. Returns the mean square of its normalised residuals, as configured.
    pub(super) fn take(&mut self, window: &RelationWindow) -> Option<f64> {
        let t = self.tuning;
        let mut factor = covariance_of_rows(window, &self.setup, &t);
        linear::factor(&mut factor, ROWS)?;
        let expected = expected_members(&factor, window);
        self.fill(window, &expected);
        let mut value = window.value;
        linear::forward(&factor, ROWS, &mut value);
        whiten(&mut self.gains, &factor);
        let rows = self.gains.chunks_exact(SIZE).zip(value);
        let residuals = rows.map(|(row, value)| value - linear::dot(&row[..TOLERATED], &self.mean));
        let square = residuals.map(|r| r * r).sum::<f64>() / ROWS as f64;
        let weight = t.independent * (t.square_max / square).min(1.0);
        if !weight.is_finite() {
            return None;
        }
        for (row, value) in self.gains.chunks_exact(SIZE).zip(value) {
            self.information.add(row, value, weight);
            self.squares += weight * value * value;
        }
        self.weights += weight * ROWS as f64;
        for (at, count) in self.read.iter_mut().enumerate() {
            *count += u32::from(window.has(at));
        }
        self.take_fine(window, weight)?;
        self.learnt_bias = window.learnt_bias;
        self.windows += 1;
        Some(square)
    }

    /// Takes the rows of the window once more, with the errors that they have where all parameters are exact: this
    /// information tells whether the parameters are.
    fn take_fine(&mut self, window: &RelationWindow, weight: f64) -> Option<()> {
        let factor = self.respond(window)?;
        let gains = &mut self.gains;
        gains.fill(0.0);
        tolerated_gains(&window.loads, &self.setup, &mut |row, column, gain| {
            gains[row * SIZE + column] = gain;
        });
        let mut value = window.value;
        linear::forward(&factor, ROWS, &mut value);
        whiten(gains, &factor);
        for (row, value) in gains.chunks_exact(SIZE).zip(value) {
            self.fine.add(&row[..TOLERATED], value, weight);
        }
        Some(())
    }

    /// Finds the gains of the forces on the rows of a window, with the errors that the rows have where all parameters
    /// are exact. Returns the factor of the covariance of the rows.
    fn respond(&mut self, window: &RelationWindow) -> Option<[f64; ROWS * ROWS]> {
        let t = exact(&self.tuning, &self.setup);
        let mut factor = covariance_of_rows(window, &self.setup, &t);
        linear::factor(&mut factor, ROWS)?;
        let tilted_n_m = tilted_moments(window, &self.setup);
        for (force, response) in self.considered.response.iter_mut().enumerate() {
            let sigma = unknown_sigma(window, &self.setup, force, &tilted_n_m, &t);
            *response = std::array::from_fn(|row| window.gains[row][force] * sigma * sigma);
            linear::solve(&factor, ROWS, response);
        }
        Some(factor)
    }

    /// Takes a window that says nothing of the parameters. Tolerances that a file states act on its forces, too.
    pub(super) fn pass_over(&mut self, window: &RelationWindow) {
        if self.setup.stated.is_any {
            // Without gains of this window, those of the window before hold.
            let _ = self.respond(window);
        }
    }

    /// Finds the factor on the tolerances; it stays if the likelihoods cannot be found.
    pub(super) fn consider(&mut self) {
        let care = if self.setup.stated.is_any {
            self.likeliest_stated_care()
        } else {
            self.likeliest_care()
        };
        if let Some(care) = care {
            self.considered.care = care;
        }
    }

    /// Sets the factor on the tolerances, unless it is larger.
    pub(super) fn doubt(&mut self, factor: f64) {
        self.considered.care = self.considered.care.max(factor);
    }

    /// Factor on the tolerances; 0 where all parameters are taken for exact.
    pub(super) fn care(&self) -> f64 {
        self.considered.care
    }

    /// Likeliest factor on tolerances that a file states, 1 at least: the statement counts in full. Before the drive,
    /// the logarithm of the factor has a normal distribution about that of 1.
    fn likeliest_stated_care(&mut self) -> Option<f64> {
        let t = self.tuning;
        let mut best = (f64::NEG_INFINITY, 1.0);
        let mut care = 1.0;
        while care < t.care_stated_max {
            let from_one = math::ln(care) / t.care_spread;
            let likelihood = self.likelihood(care)? - 0.5 * from_one * from_one;
            if likelihood > best.0 {
                best = (likelihood, care);
            }
            care *= std::f64::consts::SQRT_2;
        }
        Some(best.1)
    }

    fn likeliest_care(&mut self) -> Option<f64> {
        let t = self.tuning;
        let [largest, smallest] = t.care_limits;
        let mut best = (self.likelihood(t.care_exact)? + t.care_ratio, 0.0);
        let mut care = largest;
        while care > smallest {
            let likelihood = self.likelihood(care)?;
            if likelihood > best.0 {
                best = (likelihood, care);
            }
            care *= 0.5;
        }
        Some(best.1)
    }

    /// Logarithm of the drive's likelihood with a factor on the tolerances, without a constant. Offsets and the bias
    /// of the accelerometers have standard deviations of their own.
    fn likelihood(&mut self, care: f64) -> Option<f64> {
        let n = TOLERATED;
        let mut spread = 0.0;
        for i in 0..n {
            for j in 0..=i {
                self.scratch[i * n + j] = self.fine.at(i, j);
            }
            let is_stated = (OFFSET..GAIN).contains(&i) || (BIAS..TILT).contains(&i);
            let factor = if is_stated { 1.0 } else { care };
            let sigma = factor * self.sigma[i];
            self.scratch[i * n + i] += sigma.powi(-2);
            spread += math::ln(sigma);
        }
        let mut vector: [f64; TOLERATED] = std::array::from_fn(|at| self.fine.vector[at]);
        for (at, value) in self.learnt_vector() {
            vector[at] += value;
        }
        linear::factor(&mut self.scratch, n)?;
        linear::forward(&self.scratch, n, &mut vector);
        let roots = (0..n).map(|i| math::ln(self.scratch[i * n + i]));
        Some(0.5 * linear::dot(&vector, &vector) - spread - roots.sum::<f64>())
    }

    /// Variances of the forces of the tyres by the tolerated parameters, N^2; `None` while they are taken for exact.
    pub(super) fn force_variances(&self, loads: &Loads) -> Option<[f64; FORCES]> {
        let considered = &self.considered;
        let mut tolerance = self.sigma;
        // That of the height contains slopes of single wheels, which do not act on the forces.
        tolerance[HEIGHT] = self.tuning.cg_tolerance_m * self.setup.mass_kg;
        if self.setup.stated.shape.is_some() {
            // The hard-points have variances of their own.
            tolerance[SHAPE..PRELOAD].fill(0.0);
        }
        if self.setup.stated.is_any {
            // The filters have states for these.
            tolerance[OFFSET..GAIN].fill(0.0);
            tolerance[BIAS..TILT].fill(0.0);
        }
        (considered.care > 0.0).then(|| considered.variances(loads, &self.setup, &tolerance))
    }

    /// Gains of all parameters on the rows.
    fn fill(&mut self, window: &RelationWindow, expected_n: &[f64; CHANNELS]) {
        let (gains, setup) = (&mut self.gains, &self.setup);
        gains.fill(0.0);
        let mut put = |row: usize, column: usize, gain: f64| gains[row * SIZE + column] = gain;
        let loads = &window.loads;
        tolerated_gains(loads, setup, &mut put);
        for (at, expected_n) in expected_n.iter().enumerate() {
            put(at, LOST + at, -expected_n);
        }
        let read = &loads.member_n;
        for wheel in 0..4 {
            for (k, [first, second]) in PAIRS.into_iter().enumerate() {
                let [first, second] = [first, second].map(|i| AXIAL.len() * wheel + i);
                let column = EXCHANGED + PAIRS.len() * wheel + k;
                put(first, column, read[first] - read[second]);
                put(second, column, read[second] - read[first]);
            }
        }
        for (k, [first, second]) in WHEELS.into_iter().enumerate() {
            let column = CORNERS + k;
            for [own, other] in [[first, second], [second, first]] {
                for i in 0..AXIAL.len() {
                    let [own, other] = [own, other].map(|wheel| AXIAL.len() * wheel + i);
                    put(own, column, read[own] - read[other]);
                }
                let more = loads.spring_n[other] - loads.spring_n[own];
                put(STRUT_ROW + own, column, more / loads.strut_mass_kg[own]);
            }
        }
        let force = loads.specific_force_m_s2;
        let mut put = |column, push, turn| put_body(setup, column, push, turn, &mut put);
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            put(
                HITCH + axis,
                unit,
                setup.inverse * setup.hitch_m.cross(&unit),
            );
        }
        let towed = Vector3::new(-force.x, 0.0, 0.0);
        put(
            HITCH + 3,
            towed,
            setup.inverse * setup.hitch_m.cross(&towed),
        );
        for k in 0..ROTATIONS {
            let turned = force - right_angles(k + 1).transpose() * force;
            put(TURNED + k, setup.mass_kg * turned, Vector3::zeros());
        }
    }

    /// Updates covariance and means of the tolerated parameters.
    pub(super) fn update(&mut self) -> Option<()> {
        let n = TOLERATED;
        for i in 0..n {
            for j in 0..=i {
                self.scratch[i * n + j] = self.information.at(i, j);
            }
            self.scratch[i * n + i] += self.sigma[i].powi(-2);
        }
        let learnt = self.learnt_vector();
        linear::factor(&mut self.scratch, n)?;
        linear::invert(&self.scratch, n, &mut self.covariance);
        for (mean, row) in self.mean.iter_mut().zip(self.covariance.chunks_exact(n)) {
            let tilted = learnt.iter().map(|(at, value)| row[*at] * value);
            *mean = linear::dot(row, &self.information.vector[..n]) + tilted.sum::<f64>();
        }
        Some(())
    }

    /// Adds the information that the motion filter's bias has on bias and direction of the accelerometers: on level
    /// ground, a unit that leans reads a part of gravity. Returns its part of the vector by parameter.
    fn learnt_vector(&mut self) -> [(usize, f64); 4] {
        let g = STANDARD_GRAVITY_M_S2;
        let [bias, sigma] = self.learnt_bias;
        // The bias along x is that of the sensor and g times the turn about y; along y, the turn about x.
        let rows = [(0, TILT + 1, g), (1, TILT, -g)];
        let parts = rows.map(|(axis, tilt, gain)| {
            let least = self.tuning.learnt_bias_sigma_m_s2;
            let weight = 1.0 / (sigma[axis] * sigma[axis] + least * least);
            let (bias_at, n) = (BIAS + axis, TOLERATED);
            self.scratch[bias_at * n + bias_at] += weight;
            self.scratch[tilt * n + bias_at] += weight * gain;
            self.scratch[tilt * n + tilt] += weight * gain * gain;
            let value = weight * bias[axis];
            [(bias_at, value), (tilt, gain * value)]
        });
        let [[a, b], [c, d]] = parts;
        [a, b, c, d]
    }

    /// Whether an axial channel was read in half of the windows.
    pub(super) fn is_read(&self, at: usize) -> bool {
        2 * self.read[at] > self.windows
    }

    /// Mean square of the normalised residuals that a hypothesis leaves, if its likelihood has this ratio.
    pub(super) fn left(&self, ratio: f64) -> f64 {
        let tolerated = linear::dot(&self.mean, &self.information.vector[..TOLERATED]);
        (self.squares - tolerated - 2.0 * ratio) / self.weights
    }

    /// Mean of a tolerated parameter.
    pub(super) fn mean(&self, at: usize) -> f64 {
        self.mean[at]
    }

    /// Covariance of two tolerated parameters.
    pub(super) fn covariance(&self, i: usize, j: usize) -> f64 {
        self.covariance[i * TOLERATED + j]
    }

    /// Information on parameters that are not tolerated, with the tolerated ones integrated out.
    pub(super) fn reduced(&self, at: &[usize], information: &mut [f64], vector: &mut [f64]) {
        let n = at.len();
        let mut through = [0.0; TOLERATED];
        for (i, own) in at.iter().enumerate() {
            let cross = |at: usize, k: usize| self.information.at(k, at);
            let rows = self.covariance.chunks_exact(TOLERATED);
            let of_own: [f64; TOLERATED] = std::array::from_fn(|k| cross(*own, k));
            for (sum, row) in through.iter_mut().zip(rows) {
                *sum = linear::dot(row, &of_own);
            }
            for (j, other) in at.iter().enumerate() {
                let both = self.information.at(*own, *other);
                let of_other: [f64; TOLERATED] = std::array::from_fn(|k| cross(*other, k));
                information[i * n + j] = both - linear::dot(&through, &of_other);
            }
            vector[i] = self.information.vector[*own] - linear::dot(&self.mean, &of_own);
        }
    }
}

/// Gains of the tolerated parameters on the rows: `put` takes row, parameter and gain.
pub(super) fn tolerated_gains(
    loads: &Loads,
    setup: &Setup,
    put: &mut impl FnMut(usize, usize, f64),
) {
    for at in 0..CHANNELS {
        let wheel = at / AXIAL.len();
        put(at, OFFSET + at, 1.0);
        put(at, GAIN + at, loads.member_n[at]);
        for axis in 0..3 {
            put(at, SHAPE + 3 * at + axis, loads.force_n[3 * wheel + axis]);
        }
    }
    for wheel in 0..4 {
        let row = STRUT_ROW + wheel;
        let per_force = 1.0 / loads.strut_mass_kg[wheel];
        put(row, PRELOAD + wheel, per_force);
        put(row, RATE + wheel, per_force * loads.spring_n[wheel]);
    }
    let Setup {
        mass_kg, inverse, ..
    } = *setup;
    let force = loads.specific_force_m_s2;
    let none = Vector3::zeros();
    let mut put = |column, push, turn| put_body(setup, column, push, turn, put);
    put(MASS, -force, none);
    put(SCALE, mass_kg * force, none);
    for axis in 0..3 {
        let unit = Vector3::ith(axis, 1.0);
        put(FIRST_MOMENT + axis, none, -inverse * unit.cross(&force));
        put(BIAS + axis, mass_kg * unit, none);
        put(TILT + axis, mass_kg * unit.cross(&force), none);
        put(LEVER + axis, mass_kg * loads.lever * unit, none);
    }
}

/// Gains on the balances: what a parameter adds to the sum of forces, N, and to the angular acceleration, rad/s^2.
fn put_body(
    setup: &Setup,
    column: usize,
    push: Vector3<f64>,
    turn: Vector3<f64>,
    put: &mut impl FnMut(usize, usize, f64),
) {
    let push = push + setup.mass_kg * turn.cross(&setup.imu_m);
    for axis in 0..3 {
        put(ACCEL_ROW + axis, column, push[axis]);
        put(TURN_ROW + axis, column, turn[axis]);
    }
}

/// The member forces that all other rows tell, N.
fn expected_members(factor: &[f64; ROWS * ROWS], window: &RelationWindow) -> [f64; CHANNELS] {
    let mut inverse = [0.0; ROWS * ROWS];
    linear::invert(factor, ROWS, &mut inverse);
    std::array::from_fn(|at| {
        let row = &inverse[at * ROWS..(at + 1) * ROWS];
        window.loads.member_n[at] - linear::dot(row, &window.value) / row[at]
    })
}

/// Solves L X = H in place.
fn whiten(gains: &mut [f64], factor: &[f64; ROWS * ROWS]) {
    for i in 0..ROWS {
        let (before, from) = gains.split_at_mut(i * SIZE);
        let row = &mut from[..SIZE];
        for (k, known) in before.chunks_exact(SIZE).enumerate() {
            linear::add(row, -factor[i * ROWS + k], known);
        }
        let scale = 1.0 / factor[i * ROWS + i];
        row.iter_mut().for_each(|gain| *gain *= scale);
    }
}

/// The rotation by right angles with a number, from 0 (none) to 23.
pub(crate) fn right_angles(number: usize) -> Matrix3<f64> {
    let pairs = (0..6).flat_map(|x| (0..6).map(move |y| (x, y)));
    let axis = |k: usize| Vector3::ith(k / 2, if k.is_multiple_of(2) { 1.0 } else { -1.0 });
    let mut axes = (pairs.filter(|(x, y)| x / 2 != y / 2)).map(|(x, y)| (axis(x), axis(y)));
    let (x, y) = axes.nth(number).unwrap_or((Vector3::x(), Vector3::y()));
    Matrix3::from_columns(&[x, y, x.cross(&y)])
}
