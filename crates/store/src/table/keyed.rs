//! Lists whose entries have names: wheels, axles, members of a wheel's suspension. Their entries get
//! columns of their own: `fl.z_n`, `front.friction`, `fl.tie_rod.raw_counts`.

use std::borrow::Cow;
use std::collections::BTreeMap;

use prost::DecodeError;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, FieldDescriptorProto};
use sample::{Axle, StrainChannel, Wheel};

use super::plan::Place;
use super::walk::{delimited, malformed};

/// Axles that a vehicle may have.
const AXLES_MAX: u64 = 8;
/// Names that a list may have, and bytes of a name.
const NAMES_MAX: usize = 64;

/// A list of entries that have names.
pub(super) struct Keyed {
    pub key: Key,
    /// Full name of the entries' type.
    pub type_name: String,
    /// Where the entries are in the tree, but for their names.
    pub place: Place,
    /// Nodes of the entries by name.
    pub nodes: BTreeMap<String, usize>,
}

/// The fields that name an entry, by their numbers.
#[derive(Clone, Copy)]
pub(super) enum Key {
    Wheel { axle: u32, side: u32 },
    Axle { axle: u32 },
    Name { name: u32 },
}

impl Key {
    /// How the entries of a list are named; `None` if they are not.
    pub(super) fn of(entry: &DescriptorProto, is_in_entry: bool) -> Option<Self> {
        let number = |name: &str, kind: Type| {
            let is = |field: &&FieldDescriptorProto| field.name() == name && field.r#type() == kind;
            u32::try_from(entry.field.iter().find(is)?.number()).ok()
        };
        let axle = number("axle", Type::Uint32);
        let side = number("side", Type::String);
        match (axle, side) {
            (Some(axle), Some(side)) => Some(Self::Wheel { axle, side }),
            (Some(axle), None) => Some(Self::Axle { axle }),
            _ if is_in_entry => number("name", Type::String).map(|name| Self::Name { name }),
            _ => None,
        }
    }

    /// Names that get columns whether the log has such entries or not.
    pub(super) fn presets(self) -> Vec<String> {
        let names: Vec<&str> = match self {
            Self::Wheel { .. } => Wheel::ALL.map(Wheel::abbreviation).into(),
            Self::Axle { .. } => Axle::ALL.map(Axle::name).into(),
            Self::Name { .. } => StrainChannel::ALL.map(StrainChannel::name).into(),
        };
        names.into_iter().map(str::to_ascii_lowercase).collect()
    }

    /// Whether a field is a part of the name.
    pub(super) fn has(self, number: u32) -> bool {
        match self {
            Self::Wheel { axle, side } => number == axle || number == side,
            Self::Axle { axle: only } | Self::Name { name: only } => number == only,
        }
    }

    /// The name of an entry.
    pub(super) fn name(self, entry: &[u8]) -> Result<Cow<'_, str>, DecodeError> {
        let text = |number| {
            let bytes = find(entry, number, WireType::LengthDelimited, delimited)?;
            Ok::<_, DecodeError>(std::str::from_utf8(bytes.unwrap_or_default()).unwrap_or_default())
        };
        let axle = |number| -> Result<u64, DecodeError> {
            let found = find(entry, number, WireType::Varint, decode_varint)?;
            found
                .filter(|axle| (1..=AXLES_MAX).contains(axle))
                .ok_or_else(|| malformed("an axle is not from 1 to 8"))
        };
        Ok(match self {
            Self::Wheel { axle: number, side } => match (axle(number)?, text(side)?) {
                (1, "left") => "fl".into(),
                (1, "right") => "fr".into(),
                (2, "left") => "rl".into(),
                (2, "right") => "rr".into(),
                (axle, side @ ("left" | "right")) => format!("axle{axle}_{side}").into(),
                _ => return Err(malformed("a side is neither left nor right")),
            },
            Self::Axle { axle: number } => match axle(number)? {
                1 => "front".into(),
                2 => "rear".into(),
                axle => format!("axle{axle}").into(),
            },
            Self::Name { name } => text(name)?.into(),
        })
    }
}

impl Keyed {
    /// Whether an entry that comes for the first time can have columns.
    pub(super) fn allows(&self, name: &str) -> bool {
        (1..=NAMES_MAX).contains(&name.len()) && self.nodes.len() < NAMES_MAX
    }
}

/// The last value of a field.
fn find<'a, T>(
    mut rest: &'a [u8],
    wanted: u32,
    wanted_type: WireType,
    mut read: impl FnMut(&mut &'a [u8]) -> Result<T, DecodeError>,
) -> Result<Option<T>, DecodeError> {
    let mut found = None;
    while !rest.is_empty() {
        let (number, wire_type) = decode_key(&mut rest)?;
        if number == wanted && wire_type == wanted_type {
            found = Some(read(&mut rest)?);
        } else {
            skip_field(wire_type, number, &mut rest, DecodeContext::default())?;
        }
    }
    Ok(found)
}
