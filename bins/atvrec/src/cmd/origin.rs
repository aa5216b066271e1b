//! Where the CAN frames of an imported log come from: the text of the notice that opens a source.

use std::fmt;
use std::str::FromStr;

use wire::can_log::candump::Style;

/// Beginning of the text.
const IMPORTED: &str = "imported";

/// What an export needs to write the frames as they were in the imported file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Time zero of the stamps of the file, UNIX time in ns.
    pub zero_ns: i64,
    /// Form of the lines of a candump log.
    pub style: Style,
    /// Name of the channel in the file: a number or an interface; empty if it has none.
    pub channel: String,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            zero_ns,
            style,
            channel,
        } = self;
        write!(
            f,
            "{IMPORTED}; time zero {zero_ns} ns; candump form {style}; channel {channel}"
        )
    }
}

impl FromStr for Origin {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.splitn(4, "; ");
        let is_imported = parts.next() == Some(IMPORTED);
        let zero = parts
            .next()
            .and_then(|part| part.strip_prefix("time zero "));
        let zero = zero.and_then(|text| text.strip_suffix(" ns")?.parse().ok());
        let style = parts
            .next()
            .and_then(|part| part.strip_prefix("candump form "));
        let style = style.and_then(|text| text.parse().ok());
        let channel = parts.next().and_then(|part| part.strip_prefix("channel "));
        match (is_imported, zero, style, channel) {
            (true, Some(zero_ns), Some(style), Some(channel)) => Ok(Self {
                zero_ns,
                style,
                channel: channel.to_owned(),
            }),
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
            let origin = Origin {
                zero_ns: -5,
                style,
                channel: "can 0; a".to_owned(),
            };
            assert_eq!(origin.to_string().parse(), Ok(origin.clone()));
        }
        assert_eq!("imported".parse::<Origin>(), Err(()));
    }
}
