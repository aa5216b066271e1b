//! Lists of values of one type.

/// The values of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// `double`, `float`; NaN where absent.
    F64(Vec<f64>),
    /// `int32`, `sint32`, `sfixed32`, enumerations.
    I32(Vec<i32>),
    /// `int64`, `sint64`, `sfixed64`.
    I64(Vec<i64>),
    /// `uint32`, `fixed32`.
    U32(Vec<u32>),
    /// `uint64`, `fixed64`.
    U64(Vec<u64>),
    /// `bool`.
    Bool(Vec<bool>),
    /// `string`.
    Text(Vec<String>),
    /// `bytes`, and messages that contain themselves.
    Bytes(Vec<Vec<u8>>),
    /// A repeated field, or a field below a repeated message.
    List {
        /// For each row, where its values end.
        ends: Vec<usize>,
        /// The values of all rows.
        values: Box<Values>,
    },
}

/// One value as it is read off the wire.
#[derive(Clone, Copy, Debug)]
pub(super) enum Datum<'a> {
    F64(f64),
    I32(i32),
    I64(i64),
    U32(u32),
    U64(u64),
    Bool(bool),
    Text(&'a str),
    Bytes(&'a [u8]),
}

macro_rules! each {
    ($values:expr, $list:ident => $scalar:expr, $ends:pat, $inner:pat => $nested:expr) => {
        match $values {
            Values::F64($list) => $scalar,
            Values::I32($list) => $scalar,
            Values::I64($list) => $scalar,
            Values::U32($list) => $scalar,
            Values::U64($list) => $scalar,
            Values::Bool($list) => $scalar,
            Values::Text($list) => $scalar,
            Values::Bytes($list) => $scalar,
            Values::List {
                ends: $ends,
                values: $inner,
            } => $nested,
        }
    };
}

impl Values {
    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        each!(self, list => list.len(), ends, _ => ends.len())
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether each row is one number.
    pub(super) fn is_numeric(&self) -> bool {
        !matches!(self, Self::Text(_) | Self::Bytes(_) | Self::List { .. })
    }

    /// The number of the first row.
    pub(super) fn first_number(&self) -> Option<f64> {
        Some(match self {
            Self::F64(list) => *list.first()?,
            Self::I32(list) => (*list.first()?).into(),
            Self::I64(list) => *list.first()? as f64,
            Self::U32(list) => (*list.first()?).into(),
            Self::U64(list) => *list.first()? as f64,
            Self::Bool(list) => u8::from(*list.first()?).into(),
            Self::Text(_) | Self::Bytes(_) | Self::List { .. } => return None,
        })
    }

    /// The values themselves, of a list or not.
    pub(super) fn innermost(&self) -> &Self {
        match self {
            Self::List { values, .. } => values,
            scalar => scalar,
        }
    }

    pub(super) fn same_type(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::List { values: a, .. }, Self::List { values: b, .. }) => a.same_type(b),
            _ => std::mem::discriminant(self) == std::mem::discriminant(other),
        }
    }

    /// Begins a row of a scalar column; a list has none yet.
    pub(super) fn push_absent(&mut self) {
        match self {
            Self::F64(list) => list.push(f64::NAN),
            Self::I32(list) => list.push(0),
            Self::I64(list) => list.push(0),
            Self::U32(list) => list.push(0),
            Self::U64(list) => list.push(0),
            Self::Bool(list) => list.push(false),
            Self::Text(list) => list.push(String::new()),
            Self::Bytes(list) => list.push(Vec::new()),
            Self::List { .. } => {}
        }
    }

    /// Adds an absent entry to a list's open row.
    pub(super) fn push_element(&mut self) {
        if let Self::List { values, .. } = self {
            values.push_absent();
        }
    }

    /// Closes the row of a list.
    pub(super) fn end_row(&mut self) {
        if let Self::List { ends, values } = self {
            ends.push(values.len());
        }
    }

    /// All values; the same type without values stays, with memory for `rows` rows.
    pub(super) fn take(&mut self, rows: usize) -> Self {
        let empty = self.empty(rows);
        std::mem::replace(self, empty)
    }

    /// The same type without values, with memory for `rows` rows.
    pub(crate) fn empty(&self, rows: usize) -> Self {
        match self {
            Self::F64(_) => Self::F64(Vec::with_capacity(rows)),
            Self::I32(_) => Self::I32(Vec::with_capacity(rows)),
            Self::I64(_) => Self::I64(Vec::with_capacity(rows)),
            Self::U32(_) => Self::U32(Vec::with_capacity(rows)),
            Self::U64(_) => Self::U64(Vec::with_capacity(rows)),
            Self::Bool(_) => Self::Bool(Vec::with_capacity(rows)),
            Self::Text(_) => Self::Text(Vec::new()),
            Self::Bytes(_) => Self::Bytes(Vec::new()),
            Self::List { values, .. } => Self::List {
                ends: Vec::new(),
                values: Box::new(values.empty(0)),
            },
        }
    }

    /// Adds the values of a column of the same type.
    pub(super) fn append(&mut self, later: &mut Self) {
        match (self, later) {
            (Self::F64(list), Self::F64(later)) => list.append(later),
            (Self::I32(list), Self::I32(later)) => list.append(later),
            (Self::I64(list), Self::I64(later)) => list.append(later),
            (Self::U32(list), Self::U32(later)) => list.append(later),
            (Self::U64(list), Self::U64(later)) => list.append(later),
            (Self::Bool(list), Self::Bool(later)) => list.append(later),
            (Self::Text(list), Self::Text(later)) => list.append(later),
            (Self::Bytes(list), Self::Bytes(later)) => list.append(later),
            (
                Self::List { ends, values },
                Self::List {
                    ends: later_ends,
                    values: later,
                },
            ) => {
                let before = values.len();
                ends.extend(later_ends.iter().map(|end| before + end));
                values.append(later);
            }
            // Batches of a topic have the same columns.
            (_, _) => debug_assert!(false, "columns of batches differ in type"),
        }
    }

    /// The values of some rows, in this order.
    pub(super) fn rows(&self, rows: &[usize]) -> Self {
        fn of<T: Clone>(list: &[T], rows: &[usize]) -> Vec<T> {
            rows.iter().map(|row| list[*row].clone()).collect()
        }
        match self {
            Self::F64(list) => Self::F64(of(list, rows)),
            Self::I32(list) => Self::I32(of(list, rows)),
            Self::I64(list) => Self::I64(of(list, rows)),
            Self::U32(list) => Self::U32(of(list, rows)),
            Self::U64(list) => Self::U64(of(list, rows)),
            Self::Bool(list) => Self::Bool(of(list, rows)),
            Self::Text(list) => Self::Text(of(list, rows)),
            Self::Bytes(list) => Self::Bytes(of(list, rows)),
            Self::List { ends, values } => {
                let start = |row: usize| row.checked_sub(1).map_or(0, |before| ends[before]);
                let mut inner = Vec::new();
                let mut new_ends = Vec::with_capacity(rows.len());
                for row in rows {
                    inner.extend(start(*row)..ends[*row]);
                    new_ends.push(inner.len());
                }
                Self::List {
                    ends: new_ends,
                    values: Box::new(values.rows(&inner)),
                }
            }
        }
    }

    pub(super) fn truncate(&mut self, rows: usize) {
        each!(self, list => list.truncate(rows), ends, values => {
            ends.truncate(rows);
            values.truncate(ends.last().copied().unwrap_or_default());
        });
    }

    /// Puts a value in the place of the last one.
    pub(super) fn set_last(&mut self, datum: Datum<'_>) {
        match (self, datum) {
            (Self::F64(list), Datum::F64(value)) => put(list, value),
            (Self::I32(list), Datum::I32(value)) => put(list, value),
            (Self::I64(list), Datum::I64(value)) => put(list, value),
            (Self::U32(list), Datum::U32(value)) => put(list, value),
            (Self::U64(list), Datum::U64(value)) => put(list, value),
            (Self::Bool(list), Datum::Bool(value)) => put(list, value),
            (Self::Text(list), Datum::Text(value)) => put(list, value.to_owned()),
            (Self::Bytes(list), Datum::Bytes(value)) => put(list, value.to_owned()),
            (Self::List { values, .. }, datum) => values.set_last(datum),
            // The plan makes each column of its field's type.
            (_, _) => debug_assert!(false, "column and field differ in type"),
        }
    }
}

fn put<T>(list: &mut [T], value: T) {
    if let Some(last) = list.last_mut() {
        *last = value;
    }
}
