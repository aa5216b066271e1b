//! Reads the lines of a table.

use super::{BadCell, Format, Place};
use crate::column::Column;

/// What a line of a table is.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// Neither a header nor a row: it was to be skipped, is blank or a comment.
    Nothing,
    /// The header, or the units below it.
    Header,
    /// A row: the value of each column in SI; `None` where the file has no value.
    Row(Vec<Option<f64>>),
}

/// Why a line does not read as configured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineError {
    /// The header does not have this column.
    Absent(Place),
    /// The header has this column at two positions, from one.
    Twice(Place, [usize; 2]),
    /// The columns are given by number, and what should be the header has numbers in all of them.
    Numbers,
    /// The units row has another unit than the column map: position in [`Format::columns`], and unit.
    Unit(usize, String),
    /// A cell of a row.
    Cell(BadCell),
}

/// Reads the lines of one file in their order.
#[derive(Clone, Debug)]
pub struct Reader {
    format: Format,
    /// Further columns whose positions are wanted, such as that of the time.
    also: Vec<Place>,
    /// A header that is not clear is an error.
    strict: bool,
    to_skip: usize,
    /// Positions of the columns, then of the further ones; `None` before the header.
    positions: Option<Vec<usize>>,
    /// The units row is the next line.
    units_next: bool,
    /// The last comment, which may be the header.
    comment: Option<String>,
}

impl Reader {
    /// A reader before the first line. `also` are columns whose positions [`Reader::also`] gives.
    #[must_use]
    pub fn new(format: Format, also: Vec<Place>) -> Self {
        let mut reader = Self {
            to_skip: format.skip_lines,
            positions: None,
            units_next: false,
            comment: None,
            format,
            also,
            strict: false,
        };
        if !reader.format.header {
            reader.positions = reader.find(&[]).ok();
            reader.units_next = reader.format.units_row;
        }
        reader
    }

    /// The reader for an importer: a header that is not clear is an error. Without it, the first of
    /// two columns of one name counts, and a first line of numbers is the header.
    #[must_use]
    pub fn strict(mut self) -> Self {
        self.strict = true;
        self
    }

    /// The reader after the lines that are to be skipped.
    #[must_use]
    pub fn after_skipped(mut self) -> Self {
        self.to_skip = 0;
        self
    }

    /// The format.
    #[must_use]
    pub fn format(&self) -> &Format {
        &self.format
    }

    /// Positions of the further columns, from zero; `None` before the header.
    #[must_use]
    pub fn also(&self) -> Option<&[usize]> {
        let positions = self.positions.as_ref()?;
        positions.get(self.format.columns.len()..)
    }

    /// Takes the next line, without its end or with it.
    ///
    /// # Errors
    /// The line does not read as configured.
    pub fn take(&mut self, line: &str) -> Result<Line, LineError> {
        if self.to_skip > 0 {
            self.to_skip -= 1;
            return Ok(Line::Nothing);
        }
        if self.format.is_blank(line) {
            if self.positions.is_none() && !line.trim().is_empty() {
                self.comment = Some(line.to_owned());
            }
            return Ok(Line::Nothing);
        }
        if self.positions.is_none() && self.take_header(line)? {
            return Ok(Line::Header);
        }
        let cells = self.format.cells(line);
        if std::mem::take(&mut self.units_next) {
            self.check_units(&cells)?;
            return Ok(Line::Header);
        }
        let positions = self.positions.as_deref().unwrap_or_default();
        let values = row(&self.format, positions, &cells).map_err(LineError::Cell)?;
        Ok(Line::Row(values))
    }

    /// Takes the line that should be the header; whether it is.
    fn take_header(&mut self, line: &str) -> Result<bool, LineError> {
        let cells = self.format.cells(line);
        let found = self.find(&cells);
        let error = match found {
            Ok(positions) => {
                let named = |(place, _): &(Place, Column)| matches!(place, Place::Name(_));
                let is_number = |position: &usize| {
                    let cell = cells.get(*position);
                    cell.is_some_and(|cell| matches!(self.format.number(cell), Ok(Some(_))))
                };
                let by_number = !self.format.columns.iter().any(named);
                if self.strict && by_number && positions.iter().all(is_number) {
                    return Err(LineError::Numbers);
                }
                self.positions = Some(positions);
                self.units_next = self.format.units_row;
                return Ok(true);
            }
            Err(error) => error,
        };
        let comment = self.comment.take().unwrap_or_default();
        let header = comment.trim().trim_start_matches(&self.format.comment);
        self.positions = Some(self.find(&self.format.cells(header)).map_err(|_| error)?);
        Ok(false)
    }

    fn find(&self, header: &[&str]) -> Result<Vec<usize>, LineError> {
        let places = self.format.columns.iter().map(|(place, _)| place);
        places
            .chain(&self.also)
            .map(|place| match self.format.position(place, header) {
                Err(LineError::Twice(_, [first, _])) if !self.strict => Ok(first - 1),
                found => found,
            })
            .collect()
    }

    fn check_units(&self, cells: &[&str]) -> Result<(), LineError> {
        let positions = self.positions.as_deref().unwrap_or_default();
        for (index, ((_, column), position)) in
            self.format.columns.iter().zip(positions).enumerate()
        {
            let dimension = column.quantity.dimension();
            let stated = cells
                .get(*position)
                .and_then(|cell| dimension.unit_of_text(cell));
            if let Some((unit, factor)) = stated
                && (factor / column.factor - 1.0).abs() > 1e-6
            {
                return Err(LineError::Unit(index, unit.to_owned()));
            }
        }
        Ok(())
    }
}

/// The values of a row, SI, in the order of the columns.
fn row(format: &Format, positions: &[usize], cells: &[&str]) -> Result<Vec<Option<f64>>, BadCell> {
    let mut values = Vec::with_capacity(format.columns.len());
    for (index, (position, (_, column))) in positions.iter().zip(&format.columns).enumerate() {
        let bad = |text: Option<&str>| BadCell {
            column: index,
            text: text.map(str::to_owned),
        };
        let cell = cells.get(*position).ok_or_else(|| bad(None))?;
        let number = format.number(cell).map_err(|cell| bad(Some(cell)))?;
        values.push(number.map(|number| column.value(number)));
    }
    Ok(values)
}
