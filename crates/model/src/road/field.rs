//! Isotropic random roughness of an ISO 8608 class.

use std::f64::consts::{PI, TAU};

use math::Random;

use super::RoadClass;
use super::lattice::Lattice;

/// Lattice points along a side of a tile, a power of two.
const SIDE: usize = 256;
/// Lattice points in the shortest wave of a tile.
const POINTS_A_WAVE: usize = 8;
/// Waves of the shortest length along a side of a tile.
const WAVES: usize = SIDE / POINTS_A_WAVE;

/// A height field whose profile along any straight line has the power spectral density of an
/// ISO 8608 class.
///
/// The one-sided spectrum of a straight profile, G(n) = G_0 (n/n_0)^-2, follows from a
/// two-dimensional spectrum S(rho) that depends on the length rho of the wave vector alone, as
/// G(n) = 2 int S(sqrt(n^2 + m^2)) dm. Hence S = G_0 n_0^2/(4 rho^3), and two tracks at a distance d
/// have the coherence (the cross spectrum over the spectrum) 2 pi n d K_1(2 pi n d), with the modified
/// Bessel function K_1 (Dodds and Robson, The description of road surface roughness, J. Sound and
/// Vibration 31, 1973; Kamash and Robson, The application of isotropy in road surface modelling,
/// J. Sound and Vibration 57, 1978).
///
/// The field is a sum of one tile for each octave of wavelength. A tile is a periodic sum of about
/// 2400 plane waves, on a lattice of 256 by 256 points with 8 points or more in a wave. Phases are
/// random; amplitudes follow from S. Each tile is turned by an angle of its own, so that a straight
/// track does not pass over the same part of a tile twice, and the field does not repeat with the
/// tiles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    class: RoadClass,
    tiles: Vec<Tile>,
}

#[derive(Clone, Debug, PartialEq)]
struct Tile {
    lattice: Lattice,
    /// Lattice steps for a metre, along the tile's x axis: parts of x and y.
    turn_1_m: [f64; 2],
    /// Lattice coordinates of the origin.
    origin: [f64; 2],
}

impl Field {
    /// The field with waves from `longest_m` to `shortest_m`.
    pub(super) fn new(class: RoadClass, longest_m: f64, shortest_m: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut tiles = Vec::new();
        let mut longer_m = longest_m;
        while longer_m > 1.0001 * shortest_m {
            let shorter_m = (0.5 * longer_m).max(shortest_m);
            tiles.push(Tile::new(class, [longer_m, shorter_m], &mut random));
            longer_m = shorter_m;
        }
        Self { class, tiles }
    }

    /// Its class.
    pub(super) const fn class(&self) -> RoadClass {
        self.class
    }

    /// Height, m.
    pub(super) fn height_m(&self, x: f64, y: f64) -> f64 {
        let mut sum_m = 0.0;
        for tile in &self.tiles {
            sum_m += tile.height_m(x, y);
        }
        sum_m
    }
}

impl Tile {
    /// The tile of the wavelengths between two, which are at most an octave apart.
    fn new(class: RoadClass, [longer_m, shorter_m]: [f64; 2], random: &mut Random) -> Self {
        let side_m = WAVES as f64 * shorter_m;
        let slowest = WAVES as f64 * shorter_m / longer_m;
        // S(rho) of a unit area of wave vectors is the power of a wave of one cell, 1/side^2; a
        // wave and its opposite are one real wave of the double power.
        let amplitude_m = |waves: f64| {
            let density = 0.25 * class.density_m3(1.0) * (side_m / waves).powi(3);
            2.0 * density.sqrt() / side_m
        };
        let turn_rad = TAU * random.unit();
        let (sin, cos) = math::sin_cos(turn_rad);
        let step_m = side_m / SIDE as f64;
        let origin = [(); 2].map(|()| SIDE as f64 * random.unit());
        let mut waves = Waves::new();
        let most = WAVES as i64;
        for kx in 0..=most {
            for ky in -most..=most {
                let half_plane = kx > 0 || ky > 0;
                let length = math::hypot(kx as f64, ky as f64);
                if half_plane && (slowest..WAVES as f64).contains(&length) {
                    let phase_rad = TAU * random.unit();
                    waves.add([kx, ky], amplitude_m(length), phase_rad);
                }
            }
        }
        Self {
            lattice: Lattice::periodic(SIDE, waves.heights()),
            turn_1_m: [cos / step_m, sin / step_m],
            origin,
        }
    }

    fn height_m(&self, x: f64, y: f64) -> f64 {
        let [cos, sin] = self.turn_1_m;
        self.lattice.at(
            self.origin[0] + cos * x + sin * y,
            self.origin[1] + cos * y - sin * x,
        )
    }
}

/// Plane waves of a tile.
struct Waves {
    /// Complex amplitudes: for each wave number along x one for each along y, from -`WAVES` on.
    amplitudes: Vec<[f64; 2]>,
    /// cos and sin of the part k of a turn by `SIDE`.
    turns: Vec<[f64; 2]>,
}

impl Waves {
    const ACROSS: usize = 2 * WAVES + 1;

    fn new() -> Self {
        let turn = |k: usize| {
            let (sin, cos) = math::sin_cos(2.0 * PI * k as f64 / SIDE as f64);
            [cos, sin]
        };
        Self {
            amplitudes: vec![[0.0; 2]; (WAVES + 1) * Self::ACROSS],
            turns: (0..SIDE).map(turn).collect(),
        }
    }

    fn add(&mut self, [kx, ky]: [i64; 2], amplitude_m: f64, phase_rad: f64) {
        let (sin, cos) = math::sin_cos(phase_rad);
        let index = kx as usize * Self::ACROSS + (ky + WAVES as i64) as usize;
        self.amplitudes[index] = [amplitude_m * cos, amplitude_m * sin];
    }

    /// e^(2 pi i k j/`SIDE`).
    fn turn(&self, k: i64, j: usize) -> [f64; 2] {
        self.turns[((k * j as i64) as usize) & (SIDE - 1)]
    }

    /// Heights on the lattice: first the sums over the waves along y, then over those along x.
    fn heights(&self) -> Vec<f64> {
        let mut heights = vec![0.0; SIDE * SIDE];
        for row in 0..SIDE {
            let line = &mut heights[row * SIDE..][..SIDE];
            for kx in 0..=WAVES {
                let across = &self.amplitudes[kx * Self::ACROSS..][..Self::ACROSS];
                let mut sum = [0.0; 2];
                for (index, amplitude) in across.iter().enumerate() {
                    let turned = product(*amplitude, self.turn(index as i64 - WAVES as i64, row));
                    sum = [sum[0] + turned[0], sum[1] + turned[1]];
                }
                for (column, height) in line.iter_mut().enumerate() {
                    *height += product(sum, self.turn(kx as i64, column))[0];
                }
            }
        }
        heights
    }
}

fn product(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}
