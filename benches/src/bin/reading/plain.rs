//! A plain loop over a log: the `mcap` crate, prost, and one vector for each number.

use std::collections::BTreeMap;
use std::path::Path;

use prost::Message as _;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use store::proto::atvrec as pb;

/// Columns of a topic: numbers by name.
#[derive(Default)]
struct Columns {
    times: Vec<u64>,
    valid: Vec<u64>,
    numbers: BTreeMap<u32, Vec<f64>>,
    lists: Vec<Vec<f64>>,
}

/// Reads topics into columns, and returns the number of messages.
pub fn read(log: &Path, topics: &[&str]) -> anyhow::Result<usize> {
    let data = std::fs::read(log)?;
    let mut all: BTreeMap<u16, Columns> = BTreeMap::new();
    for message in mcap::MessageStream::new(&data)? {
        let message = message?;
        let channel = &message.channel;
        if !topics.is_empty() && !topics.contains(&channel.topic.as_str()) {
            continue;
        }
        let columns = all.entry(channel.id).or_default();
        columns.times.push(message.log_time);
        columns.valid.push(message.publish_time);
        match channel.schema.as_ref().map(|schema| schema.name.as_str()) {
            Some("atvrec.TyreForces") => forces(columns, &message.data)?,
            Some("atvrec.Motion") => motion(columns, &message.data)?,
            _ => numbers(columns, &message.data)?,
        }
    }
    Ok(all.values().map(|columns| columns.times.len()).sum())
}

fn push(columns: &mut Columns, values: impl IntoIterator<Item = f64>) {
    for (index, value) in values.into_iter().enumerate() {
        if columns.lists.len() <= index {
            columns.lists.push(Vec::new());
        }
        columns.lists[index].push(value);
    }
}

fn forces(columns: &mut Columns, data: &[u8]) -> anyhow::Result<()> {
    let message = pb::TyreForces::decode(data)?;
    let nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let values = message.wheels.iter().flat_map(|wheel| {
        [
            wheel.x_n,
            wheel.y_n,
            wheel.z_n,
            wheel.x_sigma_n,
            wheel.y_sigma_n,
            wheel.z_sigma_n,
            nan(wheel.moment_x_n_m),
            nan(wheel.moment_y_n_m),
            nan(wheel.moment_z_n_m),
            nan(wheel.moment_x_sigma_n_m),
            nan(wheel.moment_y_sigma_n_m),
            nan(wheel.moment_z_sigma_n_m),
            f64::from(wheel.source),
        ]
    });
    push(columns, values.collect::<Vec<_>>());
    Ok(())
}

fn motion(columns: &mut Columns, data: &[u8]) -> anyhow::Result<()> {
    let message = pb::Motion::decode(data)?;
    let acceleration = message.acceleration_m_s2.unwrap_or_default();
    let mut values = vec![
        message.velocity_x_m_s,
        message.velocity_y_m_s,
        message.sideslip_rad,
        message.sideslip_sigma_rad,
        message.roll_rad,
        message.pitch_rad,
        message.roll_rate_rad_s,
        message.pitch_rate_rad_s,
        message.yaw_rate_rad_s,
        acceleration.x,
        acceleration.y,
        acceleration.z,
        message.bank_rad,
        message.grade_rad,
    ];
    for wheel in &message.wheels {
        values.extend([wheel.steer_rad, wheel.slip_angle_rad]);
    }
    push(columns, values);
    Ok(())
}

/// A flat message: its doubles and integers by number.
fn numbers(columns: &mut Columns, mut data: &[u8]) -> anyhow::Result<()> {
    while !data.is_empty() {
        let (number, wire) = decode_key(&mut data)?;
        let value = match wire {
            WireType::SixtyFourBit => {
                let (bytes, rest) = data
                    .split_first_chunk::<8>()
                    .ok_or_else(|| anyhow::anyhow!("a message ends early"))?;
                data = rest;
                f64::from_le_bytes(*bytes)
            }
            WireType::Varint => decode_varint(&mut data)? as f64,
            other => {
                skip_field(other, number, &mut data, DecodeContext::default())?;
                continue;
            }
        };
        columns.numbers.entry(number).or_default().push(value);
    }
    Ok(())
}

/// A schema with two numbers.
pub fn schema(name: &str) -> Vec<u8> {
    let field = |name: &str, number| FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(Type::Double.into()),
        ..FieldDescriptorProto::default()
    };
    let message = DescriptorProto {
        name: Some(name.to_owned()),
        field: vec![field("first", 1), field("second", 2)],
        ..DescriptorProto::default()
    };
    let file = FileDescriptorProto {
        name: Some(format!("{name}.proto")),
        package: Some("test".to_owned()),
        message_type: vec![message],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

/// A message of [`schema`].
pub fn message(turn: u64) -> Vec<u8> {
    let mut bytes = vec![0x09];
    bytes.extend((turn as f64 + 0.5).to_le_bytes());
    bytes.push(0x11);
    bytes.extend((turn as f64).to_le_bytes());
    bytes
}
