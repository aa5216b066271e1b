//! Decodes the bytes of one message, field by field.

use prost::DecodeError;
use prost::bytes::Buf as _;
use prost::encoding::{DecodeContext, WireType, check_wire_type, decode_key, decode_varint};
use prost_types::field_descriptor_proto::Type;

use super::plan::{Field, Node, Plan};
use super::values::Datum;
use super::{Column, Values};

/// Fills the row that was begun in `columns`, behind `rows` others.
pub(super) fn message(
    plan: &mut Plan,
    columns: &mut Vec<Column>,
    rows: usize,
    data: &[u8],
) -> Result<(), DecodeError> {
    plan.stamp += 1;
    let stamp = plan.stamp;
    node(plan, columns, rows, 0, data, stamp)
}

fn node(
    plan: &mut Plan,
    columns: &mut Vec<Column>,
    rows: usize,
    index: usize,
    data: &[u8],
    stamp: u64,
) -> Result<(), DecodeError> {
    begin(&mut plan.nodes[index], columns, stamp);
    let mut rest = data;
    while !rest.is_empty() {
        let (number, wire_type) = decode_key(&mut rest)?;
        match plan.nodes[index].fields.get(number) {
            None => {
                prost::encoding::skip_field(wire_type, number, &mut rest, DecodeContext::default())?
            }
            Some(Field::Message {
                node: inner,
                repeated,
            }) => {
                check_wire_type(WireType::LengthDelimited, wire_type)?;
                let body = delimited(&mut rest)?;
                let mut inner_stamp = stamp;
                if repeated {
                    plan.stamp += 1;
                    inner_stamp = plan.stamp;
                    for column in &plan.nodes[inner].columns {
                        columns[*column].values.push_element();
                    }
                }
                node(plan, columns, rows, inner, body, inner_stamp)?;
            }
            Some(Field::Keyed(list)) => {
                check_wire_type(WireType::LengthDelimited, wire_type)?;
                let body = delimited(&mut rest)?;
                let name = plan.keyed[list].key.name(body)?;
                let inner = plan
                    .entry(list, &name, columns, rows)
                    .ok_or_else(|| malformed("a list has too many names, or one of no length"))?;
                node(plan, columns, rows, inner, body, stamp)?;
            }
            Some(Field::Value {
                column,
                kind,
                repeated,
            }) => {
                let column = &mut columns[column];
                if repeated && wire_type == WireType::LengthDelimited && is_packable(kind) {
                    let mut packed = delimited(&mut rest)?;
                    while !packed.is_empty() {
                        let datum = datum(kind, wire_type_of(kind), &mut packed)?;
                        add(column, datum, true);
                    }
                } else {
                    let datum = datum(kind, wire_type, &mut rest)?;
                    add(column, datum, repeated);
                }
            }
        }
    }
    Ok(())
}

/// Sets the fields of a message to what they are if it does not mention them.
fn begin(node: &mut Node, columns: &mut [Column], stamp: u64) {
    if node.last_stamp == stamp {
        return;
    }
    node.last_stamp = stamp;
    for column in &node.implicit {
        let column = &mut columns[*column];
        if matches!(column.values.innermost(), Values::F64(_)) {
            column.values.set_last(Datum::F64(0.0));
        }
        if let Some(last) = column.present.as_mut().and_then(|list| list.last_mut()) {
            *last = true;
        }
    }
    if let Some(presence) = node.presence {
        columns[presence].values.set_last(Datum::Bool(true));
    }
}

fn add(column: &mut Column, datum: Datum<'_>, repeated: bool) {
    if repeated {
        column.values.push_element();
    }
    column.values.set_last(datum);
    if let Some(last) = column.present.as_mut().and_then(|list| list.last_mut()) {
        *last = true;
    }
}

pub(super) fn delimited<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], DecodeError> {
    let length = decode_varint(rest)?;
    let length = usize::try_from(length).unwrap_or(usize::MAX);
    let (body, after) = rest.split_at_checked(length).ok_or_else(underflow)?;
    *rest = after;
    Ok(body)
}

/// The error of prost for a message that ends early.
fn underflow() -> DecodeError {
    let mut nothing: &[u8] = &[];
    let error = decode_varint(&mut nothing).err();
    error.unwrap_or_else(|| malformed("the message ends early"))
}

pub(super) fn malformed(what: &'static str) -> DecodeError {
    #[allow(deprecated)]
    DecodeError::new(what)
}

fn is_packable(kind: Type) -> bool {
    !matches!(kind, Type::String | Type::Bytes | Type::Message)
}

fn wire_type_of(kind: Type) -> WireType {
    match kind {
        Type::Double | Type::Fixed64 | Type::Sfixed64 => WireType::SixtyFourBit,
        Type::Float | Type::Fixed32 | Type::Sfixed32 => WireType::ThirtyTwoBit,
        Type::String | Type::Bytes | Type::Message | Type::Group => WireType::LengthDelimited,
        _ => WireType::Varint,
    }
}

fn datum<'a>(
    kind: Type,
    wire_type: WireType,
    rest: &mut &'a [u8],
) -> Result<Datum<'a>, DecodeError> {
    check_wire_type(wire_type_of(kind), wire_type)?;
    let fixed = match wire_type_of(kind) {
        WireType::SixtyFourBit => 8,
        WireType::ThirtyTwoBit => 4,
        _ => 0,
    };
    if rest.len() < fixed {
        return Err(underflow());
    }
    // Casts truncate, as protobuf defines: a 32-bit field has the low bits of a longer varint.
    Ok(match kind {
        Type::Double => Datum::F64(rest.get_f64_le()),
        Type::Float => Datum::F64(rest.get_f32_le().into()),
        Type::Fixed64 => Datum::U64(rest.get_u64_le()),
        Type::Sfixed64 => Datum::I64(rest.get_i64_le()),
        Type::Fixed32 => Datum::U32(rest.get_u32_le()),
        Type::Sfixed32 => Datum::I32(rest.get_i32_le()),
        Type::Int32 | Type::Enum => Datum::I32(decode_varint(rest)? as i32),
        Type::Int64 => Datum::I64(decode_varint(rest)?.cast_signed()),
        Type::Uint32 => Datum::U32(decode_varint(rest)? as u32),
        Type::Uint64 => Datum::U64(decode_varint(rest)?),
        Type::Sint32 => {
            let value = decode_varint(rest)? as u32;
            Datum::I32((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
        }
        Type::Sint64 => {
            let value = decode_varint(rest)?;
            Datum::I64((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
        }
        Type::Bool => Datum::Bool(decode_varint(rest)? != 0),
        Type::String => {
            let bytes = delimited(rest)?;
            // A text that is not UTF-8 is shown as empty, so that the message is not lost.
            Datum::Text(std::str::from_utf8(bytes).unwrap_or_default())
        }
        Type::Bytes | Type::Message | Type::Group => Datum::Bytes(delimited(rest)?),
    })
}
