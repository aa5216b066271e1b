use std::collections::BTreeMap;

use proptest::prelude::*;
use prost::Message as _;

use super::*;
use crate::proto::atvrec as proto;
use crate::schema;

fn table(schema: &str, data: &[Vec<u8>]) -> Table {
    let channel = ChannelInfo {
        message_encoding: "protobuf".to_owned(),
        topic: "/test".into(),
        schema: schema.into(),
        schema_data: schema::descriptor_set(schema).into(),
        source: None,
        metadata: BTreeMap::new(),
        is_earlier: false,
    };
    let mut table = Table::default();
    let mut plan = Plan::new(&channel, 0, &mut table.columns).expect("a schema of ours");
    for (time, data) in data.iter().enumerate() {
        if table.push(&mut plan, data).is_ok() {
            table.log_time_ns.push(time as i64);
            table.publish_time_ns.push(time as i64);
        }
    }
    table
}

fn column<'a>(table: &'a Table, name: &str) -> &'a Column {
    let found = table.columns.iter().find(|column| column.name == name);
    found.unwrap_or_else(|| panic!("no column {name}"))
}

fn floats(table: &Table, name: &str) -> Vec<f64> {
    match &column(table, name).values {
        Values::F64(values) => values.clone(),
        other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn nested_fields_are_flattened_and_absence_is_told_from_zero() {
    let there = proto::Imu {
        specific_force_m_s2: Some(proto::Vector3 {
            x: 1.5,
            y: 0.0,
            z: -3.0,
        }),
        status: 7,
        temperature_c: Some(0.0),
        device_time: Some(proto::DeviceTime {
            kind: Some(proto::device_time::Kind::Counter(proto::Counter {
                value: 0,
                modulus: 256,
            })),
        }),
        ..proto::Imu::default()
    };
    let data = [there.encode_to_vec(), proto::Imu::default().encode_to_vec()];
    let table = table("atvrec.Imu", &data);
    let x = floats(&table, "specific_force_m_s2.x");
    let y = floats(&table, "specific_force_m_s2.y");
    assert_eq!((x[0], y[0]), (1.5, 0.0));
    assert!(x[1].is_nan() && y[1].is_nan(), "the vector is absent");
    assert_eq!(floats(&table, "interval_s"), [0.0, 0.0]);
    let temperature = floats(&table, "temperature_c");
    assert_eq!(temperature[0], 0.0);
    assert!(temperature[1].is_nan());
    assert_eq!(column(&table, "status").values, Values::U32(vec![7, 0]));
    assert_eq!(column(&table, "status").present, None);
    let counter = column(&table, "device_time.counter.value");
    assert_eq!(counter.present, Some(vec![true, false]));
    assert_eq!(counter.values, Values::U32(vec![0, 0]));
    let adapter = column(&table, "device_time.adapter_ns");
    assert_eq!(adapter.present, Some(vec![false, false]));
}

#[test]
fn repeated_messages_become_lists() {
    let source = |name: &str, bytes| proto::SourceHealth {
        name: name.into(),
        bytes,
        ..proto::SourceHealth::default()
    };
    let data: Vec<Vec<u8>> = [
        vec![source("imu", 10), source("", 0)],
        vec![],
        vec![source("can", 5)],
    ]
    .into_iter()
    .map(|sources| {
        let health = proto::Health {
            sources,
            ..proto::Health::default()
        };
        health.encode_to_vec()
    })
    .collect();
    let table = table("atvrec.Health", &data);
    let expected = |values| Values::List {
        ends: vec![2, 2, 3],
        values: Box::new(values),
    };
    assert_eq!(
        column(&table, "sources.bytes").values,
        expected(Values::U64(vec![10, 0, 5]))
    );
    let names = ["imu", "", "can"].map(String::from).to_vec();
    assert_eq!(
        column(&table, "sources.name").values,
        expected(Values::Text(names))
    );
}

#[test]
fn events_have_a_column_for_each_kind() {
    let event = |kind| proto::Event {
        kind: Some(kind),
        ..proto::Event::default()
    };
    let data = [
        event(proto::event::Kind::FilterReset(proto::FilterReset {})).encode_to_vec(),
        event(proto::event::Kind::Lift(proto::WheelPosition {
            axle: 2,
            side: "left".to_owned(),
        }))
        .encode_to_vec(),
    ];
    let table = table("atvrec.Event", &data);
    assert_eq!(
        column(&table, "filter_reset").values,
        Values::Bool(vec![true, false])
    );
    let axle = column(&table, "lift.axle");
    assert_eq!(axle.present, Some(vec![false, true]));
    assert_eq!(axle.values, Values::U32(vec![0, 2]));
}

#[test]
fn wheels_have_columns_of_their_own() {
    let force = |axle, side: &str, z_n| proto::TyreForce {
        axle,
        side: side.to_owned(),
        z_n,
        ..proto::TyreForce::default()
    };
    let forces = |wheels| proto::TyreForces {
        frame: proto::ForceFrame::WheelCarrier.into(),
        wheels,
    };
    let all: Vec<_> = (1..=8)
        .flat_map(|axle| {
            [
                force(axle, "left", 0.0),
                force(axle, "right", f64::from(axle)),
            ]
        })
        .collect();
    let data = [
        forces(vec![force(2, "right", 4.0)]).encode_to_vec(),
        forces(vec![force(9, "left", 1.0)]).encode_to_vec(),
        forces(vec![force(1, "middle", 1.0)]).encode_to_vec(),
        forces(all).encode_to_vec(),
    ];
    let forces = table("atvrec.TyreForces", &data);
    assert_eq!(
        forces.log_time_ns,
        [0, 3],
        "an axle 9 and a side middle are malformed"
    );
    let first = |list: Vec<f64>| list[0].is_nan().then_some(list[1]);
    assert_eq!(first(floats(&forces, "fl.z_n")), Some(0.0));
    assert_eq!(first(floats(&forces, "axle3_left.z_n")), Some(0.0));
    assert_eq!(first(floats(&forces, "axle8_right.z_n")), Some(8.0));
    assert_eq!(floats(&forces, "rr.z_n"), [4.0, 2.0]);
    assert_eq!(column(&forces, "rr.source").names.len(), 7);
    assert_eq!(
        column(&forces, "fl.source").present,
        Some(vec![false, true])
    );
    assert_eq!(column(&forces, "frame").values, Values::I32(vec![2, 2]));
}

#[test]
fn members_of_a_wheel_have_columns_of_their_own() {
    let member = |name: &str, raw_counts| proto::StrainMember {
        name: name.to_owned(),
        raw_counts: Some(raw_counts),
        valid: true,
        ..proto::StrainMember::default()
    };
    let strain = |axle, members| proto::Strain {
        wheels: vec![proto::WheelStrain {
            axle,
            side: "left".to_owned(),
            members,
        }],
        device_time: None,
    };
    let data = [
        strain(1, vec![member("tie_rod", -8_388_608)]).encode_to_vec(),
        strain(4, vec![member("panhard_rod", 7)]).encode_to_vec(),
        strain(1, (0..80).map(|n| member(&n.to_string(), n)).collect()).encode_to_vec(),
    ];
    let strain = table("atvrec.Strain", &data);
    assert_eq!(strain.log_time_ns, [0, 1], "80 names are malformed");
    let counts = |name: &str| {
        let column = column(&strain, name);
        (column.values.clone(), column.present.clone())
    };
    let one = |list: Vec<i32>, there: Vec<bool>| (Values::I32(list), Some(there));
    assert_eq!(
        counts("fl.tie_rod.raw_counts"),
        one(vec![-8_388_608, 0], vec![true, false])
    );
    assert_eq!(
        counts("axle4_left.panhard_rod.raw_counts"),
        one(vec![0, 7], vec![false, true])
    );
    assert_eq!(
        counts("rr.lower_rear_bending.raw_counts"),
        one(vec![0, 0], vec![false, false])
    );
}

#[test]
fn a_malformed_message_leaves_no_trace() {
    let good = proto::Health {
        sources: vec![proto::SourceHealth {
            undecoded: vec![proto::MessageCount::default()],
            ..proto::SourceHealth::default()
        }],
        faulty_sensors: vec!["imu".to_owned()],
    }
    .encode_to_vec();
    let mut cut = good.clone();
    cut.extend([0x0a, 0x05, 0x10]);
    let table = table("atvrec.Health", &[good.clone(), cut, good]);
    assert_eq!(table.log_time_ns, [0, 2]);
    for column in &table.columns {
        let Values::List { ends, values } = &column.values else {
            panic!("{} is no list", column.name)
        };
        assert_eq!(ends, &[1, 2]);
        assert_eq!(values.len(), 2);
    }
}

proptest! {
    #[test]
    fn any_bytes_leave_columns_of_equal_length(
        messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..60), 0..8)
    ) {
        for schema in ["atvrec.Event", "atvrec.Health", "atvrec.RawCan", "atvrec.Strain", "foxglove.FrameTransforms"] {
            let table = table(schema, &messages);
            for column in &table.columns {
                prop_assert_eq!(column.values.len(), table.log_time_ns.len());
                if let Some(present) = &column.present {
                    prop_assert_eq!(present.len(), table.log_time_ns.len());
                }
            }
        }
    }

    #[test]
    fn columns_are_what_prost_reads(
        sequence in prop::collection::vec(any::<u64>(), 0..5),
        offset in any::<i64>(),
        bytes in prop::collection::vec(any::<u8>(), 0..20),
    ) {
        let message = proto::RawBytes {
            stamps: Some(proto::ArrivalStamps {
                first_realtime_offset_ns: offset,
                sequence_gap: sequence.clone(),
                ..proto::ArrivalStamps::default()
            }),
            data: bytes.clone(),
            ..proto::RawBytes::default()
        };
        let table = table("atvrec.RawBytes", &[message.encode_to_vec()]);
        let list = |values: Values| Values::List { ends: vec![values.len()], values: Box::new(values) };
        prop_assert_eq!(&column(&table, "stamps.sequence_gap").values, &list(Values::U64(sequence)));
        let first = &column(&table, "stamps.first_realtime_offset_ns").values;
        prop_assert_eq!(first, &Values::I64(vec![offset]));
        prop_assert_eq!(&column(&table, "data").values, &Values::Bytes(vec![bytes]));
    }
}

#[test]
fn rows_that_are_taken_in_batches_are_those_of_the_whole() {
    let message = |count: usize| {
        let source = |n: usize| proto::SourceHealth {
            name: format!("s{n}"),
            messages: n as u64,
            ..proto::SourceHealth::default()
        };
        let health = proto::Health {
            sources: (0..count).map(source).collect(),
            faulty_sensors: vec!["x".to_owned(); count],
        };
        health.encode_to_vec()
    };
    let data: Vec<Vec<u8>> = (0..5).map(message).collect();
    let mut whole = table("atvrec.Health", &data);
    let taken = whole.split_off_rows();
    assert_eq!(taken, table("atvrec.Health", &data));
    assert!(whole.log_time_ns.is_empty());
    assert!(
        whole
            .columns
            .iter()
            .zip(&taken.columns)
            .all(|(empty, full)| empty.name == full.name && empty.values.same_type(&full.values))
    );
}
