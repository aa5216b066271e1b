//! Shapes of the parts of a road.

use std::f64::consts::{PI, TAU};

use super::extent::{Extent, smooth, smooth_integral};
use super::field::Field;
use super::rocks::Rocks;
use super::soil::SoftLayer;
use super::table::{Grid, Profile};

/// What a part of a road adds.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// Random roughness.
    Roughness(Field),
    /// Half-sine domes.
    Rocks(Rocks),
    /// Logs across the road: segments of a circle.
    HalfRounds {
        at_x_m: Vec<f64>,
        height_m: f64,
        radius_m: f64,
    },
    /// A sine along x.
    Washboard { wavelength_m: f64, height_m: f64 },
    /// Ditches on the left and on the right side in turn.
    TwistDitches {
        spacing_m: f64,
        length_m: f64,
        depth_m: f64,
        centre_y_m: f64,
        blend_m: f64,
    },
    /// Ramps up that end with a fall.
    Ramps {
        at_x_m: Vec<f64>,
        height_m: f64,
        length_m: f64,
        fall_m: f64,
    },
    /// A plane that is not level.
    Slope { bank: f64, grade: f64 },
    /// A height map.
    Grid(Grid),
    /// Heights along one or two tracks.
    Profile(Profile),
    /// Factor on the tyres' friction.
    Friction(f64),
    /// Soft ground.
    Soil(SoftLayer),
}

impl Shape {
    /// What the shape adds to the height at a place of its extent, m.
    pub(super) fn height_m(&self, extent: &Extent, x: f64, y: f64) -> f64 {
        let start_m = extent.x_m[0];
        let weighted = |height_m: f64| extent.weight(x, y) * height_m;
        match self {
            Self::Roughness(field) => weighted(field.height_m(x, y)),
            Self::Rocks(rocks) => rocks.height_m(x, y),
            Self::HalfRounds {
                at_x_m,
                height_m,
                radius_m,
            } => {
                let from_m = nearest(at_x_m, x);
                let above_m = (radius_m * radius_m - from_m * from_m).max(0.0).sqrt();
                weighted((above_m - radius_m + height_m).max(0.0))
            }
            Self::Washboard {
                wavelength_m,
                height_m,
            } => weighted(0.5 * height_m * math::sin(TAU * (x - start_m) / wavelength_m)),
            Self::TwistDitches {
                spacing_m,
                length_m,
                depth_m,
                centre_y_m,
                blend_m,
            } => {
                let count = ((x - start_m) / spacing_m).floor();
                let along_m = x - start_m - count * spacing_m;
                let side = if count.rem_euclid(2.0) < 1.0 {
                    1.0
                } else {
                    -1.0
                };
                let across = smooth(0.5 + side * (y - centre_y_m) / blend_m);
                let sine = math::sin(PI * (along_m / length_m).min(1.0));
                weighted(-depth_m * across * sine * sine)
            }
            Self::Ramps {
                at_x_m,
                height_m,
                length_m,
                fall_m,
            } => {
                let ramp = |foot_m: &f64| {
                    let up = (x - foot_m) / length_m;
                    let down = 1.0 - (x - foot_m - length_m) / fall_m;
                    up.min(down).clamp(0.0, 1.0)
                };
                weighted(height_m * at_x_m.iter().map(ramp).fold(0.0, f64::max))
            }
            Self::Slope { bank, grade } => slope_m(extent, [*bank, *grade], x, y),
            Self::Grid(grid) => weighted(grid.height_m(x, y)),
            Self::Profile(profile) => weighted(profile.height_m(x, y)),
            Self::Friction(_) | Self::Soil(_) => 0.0,
        }
    }

    /// The largest rise that a wheel meets towards +x within a distance, m; zero for what a wheel
    /// always climbs.
    pub(super) fn rise_m(&self, within_m: f64) -> f64 {
        // The steepest part of a half-sine of this height and wavelength lies at its foot or about
        // its middle.
        let sine = |height_m: f64, half_wave_m: f64| {
            height_m * math::sin(0.5 * PI * (within_m / half_wave_m).min(1.0))
        };
        match self {
            Self::Rocks(rocks) => rocks
                .domes()
                .map(|dome| sine(dome.height_m, dome.radius_m))
                .fold(0.0, f64::max),
            Self::HalfRounds {
                height_m, radius_m, ..
            } => {
                let half_chord_m = (height_m * (2.0 * radius_m - height_m)).sqrt();
                let from_m = (half_chord_m - within_m).max(0.0);
                (radius_m * radius_m - from_m * from_m).sqrt() - radius_m + height_m
            }
            Self::Washboard {
                wavelength_m,
                height_m,
            } => sine(*height_m, 0.5 * wavelength_m),
            Self::TwistDitches {
                length_m, depth_m, ..
            } => sine(*depth_m, 0.5 * length_m),
            Self::Ramps {
                height_m, length_m, ..
            } => height_m * (within_m / length_m).min(1.0),
            Self::Slope { grade, .. } => within_m * grade.abs(),
            Self::Grid(grid) => grid.rise_m(within_m),
            Self::Profile(profile) => profile.rise_m(within_m),
            Self::Roughness(_) | Self::Friction(_) | Self::Soil(_) => 0.0,
        }
    }
}

/// Distance to the nearest of some places.
fn nearest(places_m: &[f64], x: f64) -> f64 {
    let distances = places_m.iter().map(|place_m| (x - place_m).abs());
    distances.fold(f64::INFINITY, f64::min)
}

/// Height of a slope that sets in over the fade of its extent along x and ends so: bank and grade
/// as tangents, right side down and nose down positive for a vehicle that drives along +x.
fn slope_m(extent: &Extent, [bank, grade]: [f64; 2], x: f64, y: f64) -> f64 {
    let [from_m, to_m] = extent.x_m;
    let fade_m = extent.fade_m.max(1e-6);
    let into_m = |d: f64| fade_m * smooth_integral(d / fade_m);
    let presence = smooth((x - from_m) / fade_m) * smooth((to_m - x) / fade_m);
    // The presence, integrated along x.
    let along_m = into_m(x - from_m) - into_m(x - to_m + fade_m);
    bank * y * presence - grade * along_m
}
