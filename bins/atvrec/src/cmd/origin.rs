//! Where the CAN frames of an imported log come from: the text of the notice that opens a source.

use std::fmt;
use std::str::FromStr;

use wire::can_log::candump::Style;

/// Beginning of the text.
const IMPORTED: &str = "imported";

/// What an export needs to write the frames as they were in the imported file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Time zero of the stamps of the file, UNIX time in ns.
    pub zero_ns: i64,
    /// Form of the lines of a candump log.
    pub style: Style,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { zero_ns, style } = self;
        write!(
            f,
            "{IMPORTED}; time zero {zero_ns} ns; candump form {style}"
        )
    }
}

impl FromStr for Origin {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.split("; ");
        let is_imported = parts.next() == Some(IMPORTED);
        let zero = parts
            .next()
            .and_then(|part| part.strip_prefix("time zero "));
        let zero = zero.and_then(|text| text.strip_suffix(" ns")?.parse().ok());
        let style = parts
            .next()
            .and_then(|part| part.strip_prefix("candump form "));
        let style = style.and_then(|text| text.parse().ok());
        match (is_imported, zero, style) {
            (true, Some(zero_ns), Some(style)) => Ok(Self { zero_ns, style }),
            _ => Err(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        for text in ["10.6", "3.9RF", "1.0lc"] {
            let style = text.parse().expect("a form");
            let origin = Origin { zero_ns: -5, style };
            assert_eq!(origin.to_string().parse(), Ok(origin));
        }
        assert_eq!("imported".parse::<Origin>(), Err(()));
    }
}
