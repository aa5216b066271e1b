//! Heights over distance, and what follows from them: roughness and index.

use sample::Road;

use super::golden_car::{GoldenCar, GoldenStep};
use super::spectrum::Spectrum;
use crate::tuning::RoadTuning;

/// Most points between two instants.
const POINTS_MAX: u32 = 16;

/// Roughness of the profiles under the four wheels.
#[derive(Clone, Debug)]
pub struct RoadStatistics {
    tuning: RoadTuning,
    spectrum: Spectrum,
    car_step: GoldenStep,
    cars: [GoldenCar; 4],
    /// Distance since the profile began, m.
    driven_m: f64,
    /// Heights at the last instant, and the distance since the last point, m.
    last: Option<([f64; 4], f64)>,
    /// Weights and weighted sums of the index of the left and of the right track.
    weight: f64,
    index: [f64; 2],
}

impl RoadStatistics {
    /// Nothing driven yet.
    #[must_use]
    pub fn new(tuning: &RoadTuning) -> Self {
        Self {
            tuning: *tuning,
            spectrum: Spectrum::new(tuning.spacing_m),
            car_step: GoldenStep::new(tuning.spacing_m),
            cars: [GoldenCar::default(); 4],
            driven_m: 0.0,
            last: None,
            weight: 0.0,
            index: [0.0; 2],
        }
    }

    /// Takes the heights after `dt` at a speed; `None` where they are unknown: the profile then begins anew.
    pub fn step(&mut self, dt: f64, speed_m_s: f64, height_m: Option<&[f64; 4]>) {
        let known = height_m.filter(|heights| heights.iter().all(|h| h.is_finite()));
        let Some(height_m) = known else {
            self.last = None;
            return;
        };
        let moved_m = speed_m_s * dt;
        let spacing_m = self.tuning.spacing_m;
        let Some((before, since_m)) = self.last else {
            self.begin(height_m);
            return;
        };
        let mut next_m = spacing_m - since_m;
        let mut points = 0;
        while next_m <= moved_m && points < POINTS_MAX {
            let part = next_m / moved_m;
            let point = std::array::from_fn(|i| before[i] + part * (height_m[i] - before[i]));
            self.push(&point, speed_m_s);
            next_m += spacing_m;
            points += 1;
        }
        self.last = Some((*height_m, moved_m - (next_m - spacing_m)));
    }

    fn begin(&mut self, height_m: &[f64; 4]) {
        self.spectrum.begin();
        self.cars = [GoldenCar::default(); 4];
        self.driven_m = 0.0;
        self.last = Some((*height_m, 0.0));
    }

    fn push(&mut self, height_m: &[f64; 4], speed_m_s: f64) {
        let t = self.tuning;
        self.driven_m += t.spacing_m;
        self.spectrum
            .push(height_m, speed_m_s, t.wave_hz_max, t.memory_m);
        let mut moved = [0.0; 2];
        for (i, car) in self.cars.iter_mut().enumerate() {
            moved[i % 2] += 0.5 * car.push(height_m[i], &self.car_step).unwrap_or(0.0);
        }
        if self.driven_m > t.car_settles_m && speed_m_s >= t.iri_speed_min_m_s {
            let keep = 1.0 - t.spacing_m / t.memory_m;
            self.weight = keep * self.weight + 1.0;
            for (index, moved) in self.index.iter_mut().zip(moved) {
                *index = keep * *index + moved;
            }
        }
    }

    /// A road with its roughness and index, if it is known.
    #[must_use]
    pub fn complete(&self, road: Road, speed_m_s: f64) -> Road {
        if road.unknown.is_some() {
            return road;
        }
        let t = &self.tuning;
        let driven_m = t.spacing_m * self.weight;
        let indexed = driven_m >= t.iri_distance_m && speed_m_s >= t.iri_speed_min_m_s;
        Road {
            roughness: self.spectrum.roughness(t.roughness_distance_m),
            iri_m_km: if indexed {
                self.index.map(|sum| 1e3 * sum / self.weight)
            } else {
                road.iri_m_km
            },
            ..road
        }
    }
}
