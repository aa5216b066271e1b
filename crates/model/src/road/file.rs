//! Road files.

use std::ops::{Range, RangeInclusive};
use std::path::Path;

use math::Random;

use super::extent::Extent;
use super::field::Field;
use super::rocks::{Dome, Rocks};
use super::shape::Shape;
use super::soil::{SoftLayer, Soil};
use super::table::{Grid, Profile};
use super::{LONGEST_M, Part, Road, RoadClass, SHORTEST_M, X_M, Y_M};
use crate::file::{ErrorCollector, Field as Found, FileErrors, NumberOrList, Section};

/// Gives the text of a file that a road file names, or says why it cannot.
pub type ReadFile<'a> = &'a dyn Fn(&str) -> Result<String, String>;

/// Reads the rest of a part of one kind.
type ReadPart = fn(&mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)>;

/// Kinds of parts, and what reads them.
pub(super) const KINDS: [(&str, ReadPart); 11] = [
    ("iso8608", roughness),
    ("rocks", rocks),
    ("half-rounds", half_rounds),
    ("washboard", washboard),
    ("twist-ditches", twist_ditches),
    ("ramps", ramps),
    ("slope", slope),
    ("grid", grid),
    ("profile", profile),
    ("friction", friction),
    ("soil", soil),
];

/// Largest coordinate, m.
const FAR_M: f64 = 1e5;
/// Most rocks of a part.
const ROCKS_MAX: f64 = 1e6;

pub(super) fn read(text: &str, file: &str, read: ReadFile<'_>) -> Result<Road, FileErrors> {
    let mut collector = ErrorCollector::new(file, text);
    let road = collector
        .parse()
        .map(|table| road(Section::new("", table), file, read, &mut collector));
    let problems = collector.into_problems();
    match road {
        Some(road) if problems.is_empty() => Ok(road),
        _ => Err(FileErrors::sorted(Path::new(file).to_owned(), problems)),
    }
}

fn road<'t>(
    mut top: Section<'t>,
    file: &str,
    read: ReadFile<'_>,
    collector: &mut ErrorCollector<'t>,
) -> Road {
    let stem = Path::new(file).file_stem().unwrap_or_default();
    let name = top.or("name", stem.to_string_lossy().into_owned(), collector);
    let description = top.or("description", String::new(), collector);
    let bounds_m = [
        range(&mut top, "x_m", X_M, collector),
        range(&mut top, "y_m", Y_M, collector),
    ];
    let mut parts = Vec::new();
    let sections = top.section("part", collector).into_sections(collector);
    for (field, section) in sections {
        let mut reader = Reader {
            name: field.name,
            span: field.span,
            section,
            bounds_m,
            read,
            collector,
        };
        parts.extend(reader.part());
        reader.section.finish(reader.collector);
    }
    top.finish(collector);
    Road {
        name,
        description,
        file: file.to_owned(),
        parts,
    }
}

/// A pair of rising coordinates, m.
fn range<'t>(
    section: &mut Section<'t>,
    key: &'static str,
    default: [f64; 2],
    collector: &mut ErrorCollector<'t>,
) -> [f64; 2] {
    let Some(found) = section.optional::<Vec<f64>>(key, collector) else {
        return default;
    };
    match found.value[..] {
        [from, to] if from < to && from.abs().max(to.abs()) <= FAR_M => [from, to],
        _ => {
            collector.add(
                &found.span,
                &found.name,
                format!("{:?} is not a range", found.value),
                format!("write {key} = [from, to] in m with from below to"),
            );
            default
        }
    }
}

/// Reads one part.
pub(super) struct Reader<'r, 't, 'f> {
    name: String,
    span: Range<usize>,
    section: Section<'t>,
    /// From and to of the road along x and y, m.
    bounds_m: [[f64; 2]; 2],
    read: ReadFile<'f>,
    collector: &'r mut ErrorCollector<'t>,
}

impl Reader<'_, '_, '_> {
    fn part(&mut self) -> Option<Part> {
        let known = KINDS.map(|(kind, _)| kind).join(", ");
        let help = format!("write kind = \"...\" with one of {known}");
        let kind = (self.section).required::<String>("kind", &help, self.collector)?;
        let found = KINDS.iter().find(|(name, _)| *name == kind.value);
        let Some((_, read)) = found else {
            let what = format!("{:?} is not a kind of part", kind.value);
            self.refuse(&kind, what, &format!("use one of {known}"));
            self.section.forget();
            return None;
        };
        let (extent, shape) = read(self)?;
        Some(Part {
            field: self.name.clone(),
            line: self.collector.line_of(&self.span),
            extent,
            shape,
        })
    }

    fn refuse<T>(&mut self, found: &Found<T>, what: String, help: &str) {
        self.collector.add(&found.span, &found.name, what, help);
    }

    /// A number within a range, or the default.
    fn number(&mut self, key: &'static str, range: RangeInclusive<f64>, default: f64) -> f64 {
        self.section.number_in(key, range, default, self.collector)
    }

    /// A number within a range that must be there.
    fn must(&mut self, key: &'static str, range: RangeInclusive<f64>) -> f64 {
        let help = format!("write a number from {} to {}", range.start(), range.end());
        let found = self.section.required::<f64>(key, &help, self.collector);
        match found {
            Some(found) if !range.contains(&found.value) => {
                self.refuse(&found, format!("{} is out of range", found.value), &help);
                *range.end()
            }
            found => found.map_or(*range.end(), |found| found.value),
        }
    }

    /// A number or a range of numbers, from which rocks are drawn.
    fn spread(&mut self, key: &'static str, range: RangeInclusive<f64>) -> [f64; 2] {
        let help = format!(
            "write one number, or [from, to], from {} to {}",
            range.start(),
            range.end()
        );
        let Some(found) = (self.section).required::<NumberOrList>(key, &help, self.collector)
        else {
            return [*range.end(); 2];
        };
        let [from, to] = match found.value.0[..] {
            [one] => [one; 2],
            [from, to] => [from, to],
            _ => [f64::NAN; 2],
        };
        if !(range.contains(&from) && range.contains(&to) && from <= to) {
            let what = format!("{:?} is out of range", found.value.0);
            self.refuse(&found, what, &help);
            return [*range.end(); 2];
        }
        [from, to]
    }

    fn seed(&mut self) -> u64 {
        self.section.or("seed", 1, self.collector)
    }

    /// The part's rectangle, within the road.
    fn extent(&mut self, fade_m: f64) -> Extent {
        let bounds_m = self.bounds_m;
        let [x_m, y_m] = [0, 1].map(|axis| {
            let key = ["x_m", "y_m"][axis];
            let name = self.section.field_name(key);
            let range_m = range(&mut self.section, key, bounds_m[axis], self.collector);
            self.within_road(&name, axis, &range_m);
            range_m
        });
        let fade_m = self.number("fade_m", 0.0..=100.0, fade_m);
        Extent { x_m, y_m, fade_m }
    }

    /// Refuses coordinates outside the road.
    fn within_road(&mut self, name: &str, axis: usize, places_m: &[f64]) -> bool {
        let [from, to] = self.bounds_m[axis];
        let outside = places_m.iter().find(|place| !(from..=to).contains(*place));
        if let Some(place) = outside {
            let key = ["x_m", "y_m"][axis];
            self.collector.add(
                &self.span,
                name,
                format!("{place} m lies outside the road, which has {key} = [{from}, {to}]"),
                format!("move the part, or widen {key} at the top of the file"),
            );
        }
        outside.is_none()
    }

    /// Places along x that must be there.
    fn places_x(&mut self) -> Vec<f64> {
        let help = "write the places along the road, such as at_x_m = [20, 40], m";
        let found = (self.section).required::<NumberOrList>("at_x_m", help, self.collector);
        let Some(found) = found else {
            return Vec::new();
        };
        self.within_road(&found.name, 0, &found.value.0);
        found.value.0
    }

    /// The text of a file that the part names, and its name.
    fn file(&mut self) -> Option<(Found<String>, String)> {
        let help = "write file = \"...\"; the path is relative to the road file";
        let found = (self.section).required::<String>("file", help, self.collector)?;
        match (self.read)(&found.value) {
            Ok(text) => Some((found, text)),
            Err(why) => {
                let what = format!("cannot read {:?}: {why}", found.value);
                self.refuse(&found, what, "correct the path, relative to the road file");
                None
            }
        }
    }
}

fn roughness(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let help = "write class = \"...\" with a letter from A to F";
    let letter = (reader.section).required::<String>("class", help, reader.collector);
    let class = letter.and_then(|letter| {
        let class = RoadClass::by_letter(&letter.value).filter(|class| *class <= RoadClass::F);
        if class.is_none() {
            let what = format!("{:?} is not a class of ISO 8608", letter.value);
            reader.refuse(&letter, what, "use A, B, C, D, E or F");
        }
        class
    });
    let longest_m = reader.number("longest_m", 1.0..=1000.0, LONGEST_M);
    let shortest_m = reader.number("shortest_m", 0.02..=1.0, SHORTEST_M);
    let seed = reader.seed();
    let extent = reader.extent(1.0);
    let field = Field::new(class?, longest_m, shortest_m, seed);
    Some((extent, Shape::Roughness(field)))
}

fn rocks(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let heights_m = reader.spread("height_m", 0.005..=2.0);
    let diameters_m = reader.spread("diameter_m", 0.02..=10.0);
    let at = (reader.section).optional::<Vec<Vec<f64>>>("at_m", reader.collector);
    let density = reader.number("per_100_m2", 0.0..=1e4, 0.0);
    let mut random = Random::new(reader.seed());
    let extent = reader.extent(0.0);
    let mut places_m = Vec::new();
    if let Some(at) = &at {
        for place in &at.value {
            if let [x, y] = place[..] {
                reader.within_road(&at.name, 0, &[x]);
                reader.within_road(&at.name, 1, &[y]);
                places_m.push([x, y]);
            } else {
                let what = format!("{place:?} is not a place");
                reader.refuse(at, what, "write at_m = [[x, y], [x, y]] in m");
            }
        }
    } else {
        let count = 0.01 * density * extent.area_m2();
        if !(1.0..=ROCKS_MAX).contains(&count) {
            let name = reader.section.field_name("per_100_m2");
            reader.collector.add(
                &reader.span,
                &name,
                format!("{density} makes {count:.0} rocks"),
                format!("write at_m = [[x, y]], or per_100_m2 for 1 to {ROCKS_MAX} rocks"),
            );
            return None;
        }
        places_m = (0..count.round() as u32)
            .map(|_| [extent.x_m, extent.y_m].map(|[from, to]: [f64; 2]| random.between(from, to)))
            .collect();
    }
    let domes = places_m
        .into_iter()
        .map(|[x_m, y_m]| Dome {
            x_m,
            y_m,
            height_m: random.between(heights_m[0], heights_m[1]),
            radius_m: 0.5 * random.between(diameters_m[0], diameters_m[1]),
        })
        .collect();
    Some((extent, Shape::Rocks(Rocks::new(domes))))
}

fn half_rounds(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let at_x_m = reader.places_x();
    let height_m = reader.must("height_m", 0.005..=1.0);
    let radius_m = reader.number("radius_m", height_m..=10.0, height_m);
    let extent = reader.extent(0.0);
    let shape = Shape::HalfRounds {
        at_x_m,
        height_m,
        radius_m,
    };
    Some((extent, shape))
}

fn washboard(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let shape = Shape::Washboard {
        wavelength_m: reader.must("wavelength_m", 0.1..=100.0),
        height_m: reader.must("height_m", 0.001..=2.0),
    };
    Some((reader.extent(2.0), shape))
}

fn twist_ditches(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let length_m = reader.must("length_m", 0.2..=100.0);
    let shape = Shape::TwistDitches {
        length_m,
        spacing_m: reader.number("spacing_m", length_m..=1000.0, length_m),
        depth_m: reader.must("depth_m", 0.01..=2.0),
        centre_y_m: reader.number("centre_y_m", -FAR_M..=FAR_M, 0.0),
        blend_m: reader.number("blend_m", 0.05..=10.0, 0.4),
    };
    Some((reader.extent(0.0), shape))
}

fn ramps(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let shape = Shape::Ramps {
        at_x_m: reader.places_x(),
        height_m: reader.must("height_m", 0.02..=3.0),
        length_m: reader.must("length_m", 0.1..=100.0),
        fall_m: reader.number("fall_m", 0.01..=100.0, 0.05),
    };
    Some((reader.extent(0.0), shape))
}

fn slope(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let shape = Shape::Slope {
        bank: math::tan(reader.number("bank_rad", -0.7..=0.7, 0.0)),
        grade: math::tan(reader.number("grade_rad", -0.7..=0.7, 0.0)),
    };
    Some((reader.extent(5.0), shape))
}

fn grid(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let scale = reader.number("scale", -1000.0..=1000.0, 1.0);
    let extent = reader.extent(0.0);
    let (found, text) = reader.file()?;
    match Grid::read(&text, &found.value, scale) {
        Ok(grid) => {
            let outside = (0..2).any(|axis| {
                let [[from, to], [road_from, road_to]] =
                    [grid.extent_m()[axis], reader.bounds_m[axis]];
                to <= road_from || from >= road_to
            });
            if outside {
                let what = format!("{:?} lies outside the road", found.value);
                reader.refuse(&found, what, "correct xllcorner and yllcorner of the grid");
            }
            Some((extent, Shape::Grid(grid)))
        }
        Err(problems) => {
            reader.collector.add_foreign(problems);
            None
        }
    }
}

fn profile(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let start_x_m = reader.number("start_x_m", -FAR_M..=FAR_M, 0.0);
    let track = (reader.section).optional::<f64>("track_m", reader.collector);
    if let Some(track) = &track
        && !(0.1..=10.0).contains(&track.value)
    {
        let what = format!("{} is out of range", track.value);
        reader.refuse(track, what, "use a number from 0.1 to 10");
    }
    let extent = reader.extent(0.0);
    let (found, text) = reader.file()?;
    let track_m = track.map(|track| track.value);
    match Profile::read(&text, &found.value, start_x_m, track_m) {
        Ok(profile) => {
            reader.within_road(&found.name, 0, &profile.extent_m());
            Some((extent, Shape::Profile(profile)))
        }
        Err(problems) => {
            reader.collector.add_foreign(problems);
            None
        }
    }
}

fn friction(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let factor = reader.must("factor", 0.01..=5.0);
    Some((reader.extent(0.0), Shape::Friction(factor)))
}

fn soil(reader: &mut Reader<'_, '_, '_>) -> Option<(Extent, Shape)> {
    let known = Soil::ALL.map(|soil| soil.name).join(", ");
    let help = format!("write soil = \"...\" with one of {known}");
    let name = (reader.section).required::<String>("soil", &help, reader.collector);
    let soil = name.and_then(|name| {
        let soil = Soil::by_name(&name.value);
        if soil.is_none() {
            let what = format!("{:?} is not a soil", name.value);
            reader.refuse(&name, what, &format!("use one of {known}"));
        }
        soil
    });
    let depth_m = reader.number("depth_m", 0.001..=1.0, 1.0);
    let [stiffness, cohesion] = ["stiffness", "cohesion"].map(|factor| {
        // A factor on what the soil of this name has: soils of one name differ by moisture and density.
        reader.number(factor, 0.1..=10.0, 1.0)
    });
    let steeper_deg = reader.number("friction_added_deg", -10.0..=10.0, 0.0);
    let extent = reader.extent(0.0);
    let soil = soil?.changed(stiffness, cohesion, steeper_deg.to_radians());
    Some((extent, Shape::Soil(SoftLayer { soil, depth_m })))
}
