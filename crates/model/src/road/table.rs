//! Heights that stand in files: height maps and profiles.

use super::lattice::Lattice;
use crate::file::Problem;

/// A height map.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    /// Rows from south to north.
    lattice: Lattice,
    /// Place of the south-west value, m.
    origin_m: [f64; 2],
    cell_m: f64,
    scale: f64,
}

impl Grid {
    /// Reads an ESRI ASCII grid: `ncols`, `nrows`, `xllcorner` or `xllcenter`, `yllcorner` or
    /// `yllcenter`, `cellsize`, `NODATA_value`, then the rows from north to south.
    pub(super) fn read(text: &str, file: &str, scale: f64) -> Result<Self, Vec<Problem>> {
        let header = Header::read(text, file)?;
        let mut problems = Vec::new();
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(header.rows);
        let lines = text.lines().enumerate().skip(header.lines);
        for (line, text) in lines.filter(|(_, text)| !text.trim().is_empty()) {
            rows.push(header.row(file, line + 1, text, rows.len(), &mut problems));
        }
        if rows.len() != header.rows {
            problems.push(problem(
                file,
                0,
                "nrows",
                format!("nrows = {}, but there are {} rows", header.rows, rows.len()),
                "correct nrows, or write the missing rows",
            ));
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let values = rows.into_iter().rev().flatten().collect();
        Ok(Self {
            lattice: Lattice::bounded(header.columns, values),
            origin_m: header.origin_m,
            cell_m: header.cell_m,
            scale,
        })
    }

    pub(super) fn height_m(&self, x: f64, y: f64) -> f64 {
        let [west, south] = self.origin_m;
        let at = |place_m: f64| place_m / self.cell_m;
        self.scale * self.lattice.at(at(x - west), at(y - south))
    }

    /// From and to along x and y, m.
    pub(super) fn extent_m(&self) -> [[f64; 2]; 2] {
        let size = self.lattice.size();
        [0, 1].map(|axis| {
            let from_m = self.origin_m[axis];
            [from_m, from_m + (size[axis] - 1) as f64 * self.cell_m]
        })
    }

    pub(super) fn rise_m(&self, within_m: f64) -> f64 {
        let [[west, east], _] = self.extent_m();
        let step_m = within_m / RISE_STEPS as f64;
        let count = ((east - west) / step_m).ceil() as usize;
        let rows = (0..self.lattice.size()[1]).map(|row| row as f64 * self.cell_m);
        rows.map(|north_m| {
            let y = self.origin_m[1] + north_m;
            let heights: Vec<f64> = (0..=count)
                .map(|k| self.height_m(west + k as f64 * step_m, y))
                .collect();
            largest_rise_m(&heights)
        })
        .fold(0.0, f64::max)
    }
}

/// Samples within the distance of a rise.
const RISE_STEPS: usize = 8;

/// The largest rise from one sample to one of the next [`RISE_STEPS`].
fn largest_rise_m(heights_m: &[f64]) -> f64 {
    let windows = (0..heights_m.len()).map(|from| {
        let to = (from + RISE_STEPS + 1).min(heights_m.len());
        let most_m = heights_m[from..to].iter().copied().fold(f64::MIN, f64::max);
        most_m - heights_m[from]
    });
    windows.fold(0.0, f64::max)
}

/// Head of an ESRI ASCII grid.
struct Header {
    columns: usize,
    rows: usize,
    /// Place of the south-west value, m.
    origin_m: [f64; 2],
    cell_m: f64,
    missing: Option<f64>,
    /// Lines of the head.
    lines: usize,
}

/// Most values of a height map, and most rows of a profile.
const VALUES_MAX: f64 = 4e6;

impl Header {
    fn read(text: &str, file: &str) -> Result<Self, Vec<Problem>> {
        let (known, lines) = Self::fields(text);
        let [
            columns,
            rows,
            west,
            south,
            west_centre,
            south_centre,
            cell,
            missing,
        ] = known;
        let mut problems = Vec::new();
        let mut number = |value: Option<f64>, name: &str, expected: &str, least: f64, most: f64| {
            let found = value.filter(|value| (least..=most).contains(value));
            if found.is_none() {
                let what = value.map_or("missing".to_owned(), |v| format!("{v} is out of range"));
                let help = format!("write {name} and {expected} in the head of the grid");
                problems.push(problem(file, 1, name, what, &help));
            }
            found.unwrap_or(least)
        };
        let columns = number(columns, "ncols", "a number from 2 on", 2.0, VALUES_MAX);
        let rows = number(rows, "nrows", "a number from 2 on", 2.0, VALUES_MAX);
        let cell_m = number(cell, "cellsize", "the distance of values, m", 1e-3, 1e3);
        let place = "the south-west corner, m";
        let half_m = |corner: Option<f64>| corner.map(|corner_m| corner_m + 0.5 * cell_m);
        let west = west_centre.or(half_m(west));
        let south = south_centre.or(half_m(south));
        let origin_m = [
            number(west, "xllcorner", place, -1e6, 1e6),
            number(south, "yllcorner", place, -1e6, 1e6),
        ];
        number(
            Some(columns * rows),
            "ncols",
            "fewer values",
            4.0,
            VALUES_MAX,
        );
        if !problems.is_empty() {
            return Err(problems);
        }
        Ok(Self {
            columns: columns as usize,
            rows: rows as usize,
            origin_m,
            cell_m,
            missing,
            lines,
        })
    }

    /// The numbers at the top of a grid in the order of the names, and the count of their lines.
    fn fields(text: &str) -> ([Option<f64>; 8], usize) {
        let mut known: [Option<f64>; 8] = [None; 8];
        const NAMES: [&str; 8] = [
            "ncols",
            "nrows",
            "xllcorner",
            "yllcorner",
            "xllcenter",
            "yllcenter",
            "cellsize",
            "nodata_value",
        ];
        let mut lines = 0;
        for line in text.lines() {
            let mut words = line.split_whitespace();
            let name = words.next().unwrap_or_default().to_ascii_lowercase();
            let Some(index) = NAMES.iter().position(|known| *known == name) else {
                break;
            };
            known[index] = words.next().and_then(|word| word.parse().ok());
            lines += 1;
        }
        (known, lines)
    }

    /// One row of values; holes are problems.
    fn row(
        &self,
        file: &str,
        line: usize,
        text: &str,
        row: usize,
        problems: &mut Vec<Problem>,
    ) -> Vec<f64> {
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != self.columns {
            let what = format!("{} values, but ncols = {}", words.len(), self.columns);
            let help = "write one value for each column";
            problems.push(problem(file, line, &format!("row {}", row + 1), what, help));
        }
        let values = words.iter().enumerate().map(|(column, word)| {
            let value = word.parse().unwrap_or(f64::NAN);
            let is_hole = !f64::is_finite(value) || Some(value) == self.missing;
            if is_hole {
                problems.push(problem(
                    file,
                    line,
                    &format!("row {}, column {}", row + 1, column + 1),
                    format!("{word} is not a height: the height map has a hole"),
                    "fill the hole, for example with the mean of the neighbours",
                ));
            }
            value
        });
        values.collect()
    }
}

/// Heights along one or two tracks, straight between its rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Profile {
    /// Distance and heights of the left and of the right track, m.
    rows: Vec<[f64; 3]>,
    start_x_m: f64,
    /// Distance of the two tracks, m.
    track_m: f64,
}

impl Profile {
    /// Reads CSV with the columns s and z, or s, z_left and z_right, m.
    pub(super) fn read(
        text: &str,
        file: &str,
        start_x_m: f64,
        track_m: Option<f64>,
    ) -> Result<Self, Vec<Problem>> {
        let mut lines = text.lines().enumerate();
        let head = lines.next().map_or("", |(_, line)| line);
        let names: Vec<&str> = head.split(',').map(str::trim).collect();
        let tracks = match names[..] {
            ["s", "z"] => 1,
            ["s", "z_left", "z_right"] => 2,
            _ => {
                let what = format!("the first line is {head:?}");
                let help = "name the columns s,z or s,z_left,z_right; all in m";
                return Err(vec![problem(file, 1, "columns", what, help)]);
            }
        };
        let mut problems = Vec::new();
        if tracks == 2 && track_m.is_none() {
            let help = "add track_m to the part of the road file: the distance of the two tracks";
            problems.push(problem(file, 1, "track_m", "missing".to_owned(), help));
        }
        let mut rows: Vec<[f64; 3]> = Vec::new();
        for (line, text) in lines.filter(|(_, text)| !text.trim().is_empty()) {
            let row = profile_row(file, line + 1, text, &names, &mut problems);
            if let (Some(row), Some(last)) = (row, rows.last())
                && row[0] <= last[0]
            {
                let what = format!("{} does not rise: the row before has {}", row[0], last[0]);
                let help = "sort the rows by s and remove rows of the same s";
                problems.push(problem(file, line + 1, "s", what, help));
            }
            rows.extend(row);
        }
        if problems.is_empty() && !(2.0..=VALUES_MAX).contains(&(rows.len() as f64)) {
            let what = format!("there are {} rows", rows.len());
            let help = format!("write from 2 to {VALUES_MAX} rows");
            problems.push(problem(file, 0, "rows", what, &help));
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        Ok(Self {
            rows,
            start_x_m,
            track_m: track_m.unwrap_or(1.0),
        })
    }

    pub(super) fn height_m(&self, x: f64, y: f64) -> f64 {
        let s = x - self.start_x_m;
        let after = self.rows.partition_point(|row| row[0] <= s);
        let upper = after.clamp(1, self.rows.len() - 1);
        let (a, b) = (self.rows[upper - 1], self.rows[upper]);
        let part = ((s - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
        let [left, right] = [1, 2].map(|track| a[track] + (b[track] - a[track]) * part);
        let leftward = (0.5 + y / self.track_m).clamp(0.0, 1.0);
        right + (left - right) * leftward
    }

    /// From and to along x, m.
    pub(super) fn extent_m(&self) -> [f64; 2] {
        let last = self.rows.len() - 1;
        [0, last].map(|row| self.start_x_m + self.rows[row][0])
    }

    pub(super) fn rise_m(&self, within_m: f64) -> f64 {
        let [from_m, to_m] = self.extent_m();
        let step_m = within_m / RISE_STEPS as f64;
        let count = ((to_m - from_m) / step_m).ceil() as usize;
        let rise_m = |y: f64| {
            let heights: Vec<f64> = (0..=count)
                .map(|k| self.height_m(from_m + k as f64 * step_m, y))
                .collect();
            largest_rise_m(&heights)
        };
        rise_m(0.5 * self.track_m).max(rise_m(-0.5 * self.track_m))
    }
}

/// Distance and heights of one row; two equal heights where there is one track.
fn profile_row(
    file: &str,
    line: usize,
    text: &str,
    names: &[&str],
    problems: &mut Vec<Problem>,
) -> Option<[f64; 3]> {
    let cells: Vec<&str> = text.split(',').map(str::trim).collect();
    if cells.len() != names.len() {
        let what = format!(
            "{} cells, but there are {} columns",
            cells.len(),
            names.len()
        );
        problems.push(problem(
            file,
            line,
            "row",
            what,
            "write one cell for each column",
        ));
        return None;
    }
    let before = problems.len();
    let mut numbers = Vec::new();
    for (cell, name) in cells.iter().zip(names) {
        match cell.parse::<f64>().ok().filter(|value| value.is_finite()) {
            Some(value) => numbers.push(value),
            None => problems.push(problem(
                file,
                line,
                name,
                format!("{cell:?} is not a number: the profile has a hole"),
                "write a number, or remove the row",
            )),
        }
    }
    let complete = problems.len() == before;
    complete.then(|| [numbers[0], numbers[1], numbers[names.len() - 1]])
}

fn problem(file: &str, line: usize, field: &str, message: String, help: &str) -> Problem {
    Problem {
        file: file.to_owned(),
        line,
        column: 0,
        field: field.to_owned(),
        value: String::new(),
        message,
        help: help.to_owned(),
    }
}
