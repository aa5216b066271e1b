use super::append_packet;

/// How often the unit sends: 100 Hz divided by the rate field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PacketRate {
    /// No packets unless asked for.
    Quiet,
    /// 100 Hz.
    #[default]
    Hz100,
    /// 50 Hz.
    Hz50,
    /// 25 Hz.
    Hz25,
    /// 20 Hz.
    Hz20,
    /// 10 Hz.
    Hz10,
}

impl PacketRate {
    /// Value of the rate field.
    #[must_use]
    pub const fn divider(self) -> u16 {
        match self {
            Self::Quiet => 0,
            Self::Hz100 => 1,
            Self::Hz50 => 2,
            Self::Hz25 => 4,
            Self::Hz20 => 5,
            Self::Hz10 => 10,
        }
    }

    /// Seconds between two packets; one internal step (10 ms) for a quiet unit.
    #[must_use]
    pub fn interval_s(self) -> f64 {
        0.01 * f64::from(self.divider().max(1))
    }
}

/// A setting of the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Rate of the continuous packets.
    Rate(PacketRate),
    /// Line speed: 9600, 19200, 38400 or 57600 baud. Anything else is sent as 57600.
    Baud(u32),
    /// Type of the continuous packets, two characters.
    PacketType([u8; 2]),
    /// Orientation code of the axes (manual, table of the orientation field).
    Orientation(u16),
}

impl Field {
    /// Identifier of the rate field.
    pub const RATE: u16 = 1;
    /// Identifier of the line-speed field.
    pub const BAUD: u16 = 2;
    /// Identifier of the packet-type field.
    pub const PACKET_TYPE: u16 = 3;
    /// Identifier of the orientation field.
    pub const ORIENTATION: u16 = 7;

    /// Identifier and value as sent.
    #[must_use]
    pub fn to_pair(self) -> (u16, u16) {
        match self {
            Self::Rate(rate) => (Self::RATE, rate.divider()),
            Self::Baud(baud) => {
                let code = match baud {
                    9_600 => 0,
                    19_200 => 1,
                    38_400 => 2,
                    _ => 3,
                };
                (Self::BAUD, code)
            }
            Self::PacketType(kind) => (Self::PACKET_TYPE, u16::from_be_bytes(kind)),
            Self::Orientation(code) => (Self::ORIENTATION, code),
        }
    }
}

/// A command to the unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// `PK`: are you there?
    Ping,
    /// `SR`: restart the software.
    SoftwareReset,
    /// `GP`: send one packet of this type.
    GetPacket([u8; 2]),
    /// `GF`: read settings in use, by identifier.
    GetFields(Vec<u16>),
    /// `RF`: read stored settings, by identifier.
    ReadFields(Vec<u16>),
    /// `SF`: change settings in use; they are lost when the unit is switched off.
    SetFields(Vec<Field>),
    /// `WF`: change stored settings, for the next start.
    WriteFields(Vec<Field>),
}

impl Command {
    /// Stops the output of the unit until the next command or restart.
    #[must_use]
    pub fn quiet() -> Self {
        Self::SetFields(vec![Field::Rate(PacketRate::Quiet)])
    }

    /// Type characters.
    #[must_use]
    pub const fn kind(&self) -> [u8; 2] {
        match self {
            Self::Ping => *b"PK",
            Self::SoftwareReset => *b"SR",
            Self::GetPacket(_) => *b"GP",
            Self::GetFields(_) => *b"GF",
            Self::ReadFields(_) => *b"RF",
            Self::SetFields(_) => *b"SF",
            Self::WriteFields(_) => *b"WF",
        }
    }

    /// The command's bytes. Fields beyond the 60th are left out: the unit has fewer.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(32);
        append_packet(self.kind(), &mut out, |out| match self {
            Self::Ping | Self::SoftwareReset => {}
            Self::GetPacket(kind) => out.extend(kind),
            Self::GetFields(identifiers) | Self::ReadFields(identifiers) => {
                let identifiers = &identifiers[..identifiers.len().min(MAX_FIELDS)];
                out.push(identifiers.len() as u8);
                for identifier in identifiers {
                    out.extend(identifier.to_be_bytes());
                }
            }
            Self::SetFields(fields) | Self::WriteFields(fields) => {
                let fields = &fields[..fields.len().min(MAX_FIELDS)];
                out.push(fields.len() as u8);
                for field in fields {
                    let (identifier, value) = field.to_pair();
                    out.extend(identifier.to_be_bytes());
                    out.extend(value.to_be_bytes());
                }
            }
        });
        out
    }
}

const MAX_FIELDS: usize = 60;

/// The answer to `GF` and `RF`: a count, then identifier and value of each field.
pub(super) fn parse_pairs(payload: &[u8]) -> Option<Vec<(u16, u16)>> {
    let (count, rest) = payload.split_first()?;
    let (pairs, tail) = rest.as_chunks::<4>();
    let whole = tail.is_empty() && pairs.len() == usize::from(*count);
    whole.then(|| {
        pairs
            .iter()
            .map(|[a, b, c, d]| (u16::from_be_bytes([*a, *b]), u16::from_be_bytes([*c, *d])))
            .collect()
    })
}

/// The answer to `SF` and `WF`: a count, then the identifiers that were taken.
pub(super) fn parse_identifiers(payload: &[u8]) -> Option<Vec<u16>> {
    let (count, rest) = payload.split_first()?;
    let (identifiers, tail) = rest.as_chunks::<2>();
    let whole = tail.is_empty() && identifiers.len() == usize::from(*count);
    whole.then(|| identifiers.iter().map(|b| u16::from_be_bytes(*b)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hex(bytes: &[u8]) -> String {
        bytes.iter().map(|b| format!("{b:02x}")).collect()
    }

    #[test]
    fn commands_are_the_manuals_bytes() {
        assert_eq!(hex(&Command::Ping.encode()), "5555504b009ef4");
        assert_eq!(hex(&Command::SoftwareReset.encode()), "55555352007e4f");
        assert_eq!(hex(&Command::quiet().encode()), "555553460501000100004081");
        let rate = Command::SetFields(vec![Field::Rate(PacketRate::Hz100)]);
        assert_eq!(hex(&rate.encode()), "5555534605010001000150a0");
        let kind = Command::SetFields(vec![Field::PacketType(*b"S1")]);
        assert_eq!(hex(&kind.encode()), "55555346050100035331537f");
    }

    #[test]
    fn answers_of_the_wrong_length_are_refused() {
        assert_eq!(parse_identifiers(&[1, 0, 3]), Some(vec![3]));
        assert_eq!(parse_identifiers(&[2, 0, 3]), None);
        assert_eq!(parse_identifiers(&[]), None);
        assert_eq!(parse_pairs(&[1, 0, 1, 0, 5]), Some(vec![(1, 5)]));
        assert_eq!(parse_pairs(&[1, 0, 1, 0]), None);
    }
}
