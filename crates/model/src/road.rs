//! Roads: ground that is not a plane, and how tyres and soil meet on it.
//!
//! Places are in earth axes: x east, y north, z up. A vehicle of a [manoeuvre](crate::simulation)
//! starts at the origin and drives along +x, so that +y is its left side.
//!
//! ```
//! use atvrec_model::road::{Road, RoadClass};
//!
//! let road = Road::iso8608(RoadClass::C, 7);
//! assert!(road.height_m(12.0, 0.4).abs() < 0.2);
//! assert_eq!(road.friction(12.0, 0.4), 1.0);
//! ```

mod class;
mod contact;
mod envelope;
mod extent;
mod field;
mod file;
mod lattice;
mod rocks;
mod shape;
mod soft;
pub mod soil;
mod table;
#[cfg(test)]
mod tests;
mod track;

use crate::FileErrors;
use crate::file::Problem;
use extent::Extent;
use field::Field;
use shape::Shape;

pub use class::RoadClass;
pub use contact::{Ground, GroundContact, Plane};
pub use file::ReadFile;
pub use soft::SoftGround;
pub use soil::{SoftLayer, Soil};
pub use track::RoadProfile;

/// A road: heights, friction and soil over x and y.
#[derive(Clone, Debug, PartialEq)]
pub struct Road {
    name: String,
    description: String,
    /// File that describes it, for messages.
    file: String,
    parts: Vec<Part>,
}

/// A part of a road; heights of parts add up.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    /// Dotted name in the road file.
    field: String,
    /// Line in the road file.
    line: usize,
    extent: Extent,
    shape: Shape,
}

/// Wavelengths of roughness where the road file has none, m. ISO 8608 measures from 91 m to 0.35 m;
/// the shorter waves are what the profile of 0.2 m needs.
const LONGEST_M: f64 = 91.0;
const SHORTEST_M: f64 = 0.1;

/// How far a road reaches where the file does not say it, m.
const X_M: [f64; 2] = [-50.0, 3000.0];
const Y_M: [f64; 2] = [-100.0, 100.0];

impl Road {
    /// Isotropic roughness of an ISO 8608 class without end.
    #[must_use]
    pub fn iso8608(class: RoadClass, seed: u64) -> Self {
        let name = format!("iso8608:{}", class.letter());
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let part = Part {
            field: String::new(),
            line: 0,
            extent: Extent {
                x_m: everywhere,
                y_m: everywhere,
                fade_m: 0.0,
            },
            shape: Shape::Roughness(Field::new(class, LONGEST_M, SHORTEST_M, seed)),
        };
        Self {
            description: format!("roughness of ISO 8608 class {}", class.letter()),
            file: name.clone(),
            name,
            parts: vec![part],
        }
    }

    /// Reads a road file; `read` gives the text of a height map or profile that the file names.
    ///
    /// # Errors
    /// All mistakes of the file, and of the files that it names.
    pub fn from_toml(text: &str, file: &str, read: ReadFile<'_>) -> Result<Self, FileErrors> {
        file::read(text, file, read)
    }

    /// Name, for people.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Description, for people.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Class of the road in a rectangle (from and to, m), if the road is a plane with the roughness of
    /// one ISO 8608 class there: slope, friction and soil do not change the class, any other shape
    /// in the road file does.
    #[must_use]
    pub fn class_in(&self, x_m: [f64; 2], y_m: [f64; 2]) -> Option<RoadClass> {
        let mut found = None;
        for part in &self.parts {
            match &part.shape {
                Shape::Roughness(field) if found.is_none() => found = Some((field, part.extent)),
                Shape::Slope { .. } | Shape::Friction(_) | Shape::Soil(_) => {}
                _ => return None,
            }
        }
        let (field, extent) = found?;
        let whole = x_m
            .iter()
            .all(|&x| y_m.iter().all(|&y| extent.weight(x, y) == 1.0));
        whole.then(|| field.class())
    }

    /// Height at a place, m.
    #[must_use]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let mut sum_m = 0.0;
        for part in &self.parts {
            sum_m += part.shape.height_m(&part.extent, x_m, y_m);
        }
        sum_m
    }

    /// Factor on the tyres' friction at a place: 1 is the surface for which the friction of the
    /// vehicle file holds.
    #[must_use]
    pub fn friction(&self, x_m: f64, y_m: f64) -> f64 {
        let factors = self.parts.iter().filter_map(|part| match part.shape {
            Shape::Friction(factor) => Some(1.0 + (factor - 1.0) * part.extent.weight(x_m, y_m)),
            _ => None,
        });
        factors.product()
    }

    /// Soil at a place; none on firm ground.
    #[must_use]
    pub fn soil(&self, x_m: f64, y_m: f64) -> Option<&SoftLayer> {
        self.parts.iter().find_map(|part| match &part.shape {
            Shape::Soil(layer) => (part.extent.weight(x_m, y_m) > 0.0).then_some(layer),
            _ => None,
        })
    }

    /// Refuses ground that a tyre of this unloaded radius R cannot climb: a part that rises by more
    /// than R within R.
    ///
    /// # Errors
    /// All parts that do, with their field and their rise.
    pub fn check_climb(&self, radius_m: f64) -> Result<(), FileErrors> {
        let too_steep = self.parts.iter().filter_map(|part| {
            let rise_m = part.shape.rise_m(radius_m);
            (rise_m > radius_m).then(|| Problem {
                file: self.file.clone(),
                line: part.line,
                column: 0,
                field: part.field.clone(),
                value: String::new(),
                message: format!(
                    "the ground rises by {rise_m:.3} m within {radius_m:.3} m, which is steeper \
                     than a tyre of {radius_m:.3} m radius can climb"
                ),
                help: "make it lower or longer, or drive a vehicle with larger tyres".to_owned(),
            })
        });
        FileErrors::check(&self.file, too_steep.collect())
    }
}

/// Width of a tread; 0.6 radii where the vehicle file has none.
fn tread_width_m(radius_m: f64, width_m: f64) -> f64 {
    if width_m > 0.0 {
        width_m
    } else {
        0.6 * radius_m
    }
}
