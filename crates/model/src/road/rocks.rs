//! Rocks as half-sine domes.

use std::collections::HashMap;
use std::f64::consts::PI;

/// A rock: z = h cos(pi r/d) within the radius d/2 of its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dome {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) height_m: f64,
    pub(super) radius_m: f64,
}

impl Dome {
    fn height_at_m(&self, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - self.x_m, y - self.y_m);
        let part2 = (dx * dx + dy * dy) / (self.radius_m * self.radius_m);
        if part2 >= 1.0 {
            return 0.0;
        }
        self.height_m * math::cos(0.5 * PI * part2.sqrt())
    }
}

/// Rocks, found by the cell of a lattice in which they lie.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rocks {
    domes: Vec<Dome>,
    /// Rocks that touch a cell.
    cells: HashMap<[i64; 2], Vec<u32>>,
    cell_m: f64,
}

impl Rocks {
    pub(super) fn new(domes: Vec<Dome>) -> Self {
        let largest_m = domes.iter().map(|dome| dome.radius_m).fold(0.0, f64::max);
        let cell_m = 2.0 * largest_m.max(1e-3);
        let mut rocks = Self {
            cells: HashMap::new(),
            domes,
            cell_m,
        };
        for (index, dome) in rocks.domes.iter().enumerate() {
            let [x, y] = [dome.x_m, dome.y_m];
            let r = dome.radius_m;
            let [west, south] = cell(cell_m, x - r, y - r);
            let [east, north] = cell(cell_m, x + r, y + r);
            for column in west..=east {
                for row in south..=north {
                    let touching = rocks.cells.entry([column, row]).or_default();
                    touching.push(index as u32);
                }
            }
        }
        rocks
    }

    /// Height of the highest rock at a place, m.
    pub(super) fn height_m(&self, x: f64, y: f64) -> f64 {
        let touching = self.cells.get(&cell(self.cell_m, x, y));
        let heights = touching.into_iter().flatten();
        heights
            .map(|index| self.domes[*index as usize].height_at_m(x, y))
            .fold(0.0, f64::max)
    }

    pub(super) fn domes(&self) -> impl Iterator<Item = &Dome> {
        self.domes.iter()
    }
}

fn cell(cell_m: f64, x: f64, y: f64) -> [i64; 2] {
    [x, y].map(|place_m| (place_m / cell_m).floor() as i64)
}
