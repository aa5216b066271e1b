use super::*;

fn column(name: &str, values: Values) -> Column {
    Column {
        name: name.to_owned(),
        unit: String::new(),
        names: Vec::new(),
        values,
        present: None,
    }
}

fn floats(times_ns: &[i64], values: &[f64], targets_ns: &[i64], method: Method) -> Vec<f64> {
    let column = column("speed_m_s", Values::F64(values.to_vec()));
    let aligned = align(times_ns, &column, targets_ns, method, 20);
    assert_eq!(aligned.present, None);
    let Values::F64(list) = aligned.values else {
        panic!("{aligned:?}");
    };
    list
}

/// NaN as -999, so that lists can be compared.
fn shown(list: &[f64]) -> Vec<f64> {
    let show = |value: &f64| if value.is_nan() { -999.0 } else { *value };
    list.iter().map(show).collect()
}

const TIMES_NS: [i64; 5] = [100, 110, 120, 150, 160];
const VALUES: [f64; 5] = [1.0, 2.0, f64::NAN, 5.0, 7.0];

/// The values 2 at 110 and 5 at 150 are 40 apart, which is a gap: 20 are allowed.
#[test]
fn each_method_gives_the_values_of_its_rule_and_none_in_a_gap() {
    let targets_ns = [
        89, 90, 99, 100, 104, 105, 106, 110, 120, 121, 130, 131, 139, 140, 150, 155, 161, 171, 181,
    ];
    let given = |method| shown(&floats(&TIMES_NS, &VALUES, &targets_ns, method));
    let none = -999.0;
    assert_eq!(
        given(Method::Previous),
        [
            none, none, none, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, none, none, none, 5.0, 5.0,
            7.0, 7.0, none
        ]
    );
    assert_eq!(
        given(Method::Linear),
        [
            none, none, none, 1.0, 1.4, 1.5, 1.6, 2.0, none, none, none, none, none, none, 5.0,
            6.0, none, none, none
        ]
    );
    assert_eq!(
        given(Method::Nearest),
        [
            none, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, none, none, none, none, 5.0, 5.0, 5.0,
            7.0, none, none
        ]
    );
}

#[test]
fn rows_in_any_order_give_the_same_and_the_last_of_equal_times_counts() {
    let (times_ns, values) = ([110, 100, 120, 110], [9.0, 0.0, 4.0, 2.0]);
    let list = floats(&times_ns, &values, &[105, 110, 115], Method::Linear);
    assert_eq!(list, [1.0, 2.0, 3.0]);
}

#[test]
fn values_at_their_own_time_keep_their_bits() {
    let values = [0.1 + 0.2, -0.0, f64::INFINITY];
    for method in Method::ALL {
        let list = floats(&[0, 10, 20], &values, &[0, 10, 20], method);
        let bits = |list: &[f64]| list.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&list), bits(&values), "{method}");
    }
}

#[test]
fn an_angle_takes_the_shorter_way() {
    let cases = [
        ("yaw_rad", "", [3.1, -3.1], -std::f64::consts::PI),
        ("yaw_rad", "", [1.0, 2.0], 1.5),
        // Both ends are below a full turn, so that the value is, too.
        ("heading", "deg", [358.0, 4.0], 1.0),
        ("course_deg", "", [-170.0, 150.0], 170.0),
        ("speed_m_s", "", [358.0, 4.0], 181.0),
    ];
    for (name, unit, ends, expected) in cases {
        let angle = Column {
            unit: unit.to_owned(),
            ..column(name, Values::F64(ends.to_vec()))
        };
        let aligned = align(&[0, 10], &angle, &[5], Method::Linear, 20);
        let Values::F64(list) = aligned.values else {
            panic!("{name}");
        };
        assert!((list[0] - expected).abs() < 1e-12, "{name}: {list:?}");
    }
}

#[test]
fn integers_are_rounded_and_keep_all_digits() {
    let times_ns = [0, 10];
    let large = 1_790_000_000_000_000_001;
    let aligned = |values| {
        align(
            &times_ns,
            &column("n", values),
            &[0, 4, 9, 30],
            Method::Linear,
            20,
        )
    };
    let found = aligned(Values::I64(vec![large, large + 10]));
    assert_eq!(
        found.values,
        Values::I64(vec![large, large + 4, large + 9, 0])
    );
    assert_eq!(found.present, Some(vec![true, true, true, false]));
    let found = aligned(Values::U32(vec![7, 0]));
    assert_eq!(found.values, Values::U32(vec![7, 4, 1, 0]));
    let found = aligned(Values::U64(vec![u64::MAX, u64::MAX]));
    assert_eq!(
        found.values,
        Values::U64(vec![u64::MAX, u64::MAX, u64::MAX, 0])
    );
}

#[test]
fn nothing_is_between_texts_names_and_truth_values() {
    let times_ns = [0, 10];
    let names = Column {
        names: vec![(1, "ONE".to_owned()), (9, "NINE".to_owned())],
        ..column("source", Values::I32(vec![1, 9]))
    };
    let absent = Column {
        present: Some(vec![true, false]),
        ..column("text", Values::Text(vec!["a".to_owned(), String::new()]))
    };
    let flags = column("valid", Values::Bool(vec![true, false]));
    for (column, expected) in [
        (names, Values::I32(vec![1, 9])),
        (absent, Values::Text(vec!["a".to_owned(), "a".to_owned()])),
        (flags, Values::Bool(vec![true, false])),
    ] {
        assert_eq!(Method::Linear.for_column(&column), Method::Previous);
        let aligned = align(&times_ns, &column, &[9, 10], Method::Linear, 20);
        assert_eq!(aligned.values, expected);
        assert_eq!(aligned.present, Some(vec![true, true]));
        assert_eq!(aligned.names, column.names);
    }
    let lists = Values::List {
        ends: vec![1, 3],
        values: Box::new(Values::F64(vec![1.0, 2.0, 3.0])),
    };
    let aligned = align(
        &times_ns,
        &column("list", lists),
        &[9, 10],
        Method::Linear,
        20,
    );
    assert_eq!(aligned.present, Some(vec![false, false]));
}

#[test]
fn the_usual_gap_follows_from_the_intervals_of_the_values() {
    let (values, mut list) = (column("v", Values::F64(VALUES.to_vec())), TIMES_NS.to_vec());
    assert_eq!(intervals_ns(&list, &values), [10, 40, 10]);
    assert_eq!(max_gap_ns(&mut intervals_ns(&list, &values)), 30);
    list[4] = 150;
    assert_eq!(intervals_ns(&list, &values), [10, 40]);
    assert_eq!(max_gap_ns(&mut []), LONGEST_GAP_NS);
    assert_eq!(max_gap_ns(&mut [2_000_000_000]), LONGEST_GAP_NS);
}

#[test]
fn names_of_methods_come_back_and_others_are_refused() {
    for method in Method::ALL {
        assert_eq!(method.to_string().parse(), Ok(method));
    }
    let error = "cubic".parse::<Method>().expect_err("no method");
    assert_eq!(
        error.to_string(),
        "method \"cubic\" is unknown; use previous, linear or nearest"
    );
}

#[test]
fn a_grid_is_the_same_in_pieces_and_for_all_logs() {
    let start_ns = 1_790_000_000_123_456_789;
    let end_ns = start_ns + 3_000_000_000;
    let grid = Grid::new(start_ns, 100.0).expect("a rate");
    let all = grid.times_ns(start_ns, end_ns);
    assert_eq!(all.len(), 300);
    assert_eq!(all[0], 1_790_000_000_130_000_000);
    assert!(all.windows(2).all(|pair| pair[1] - pair[0] == 10_000_000));
    for cut in [1_790_000_000_130_000_000, 1_790_000_001_000_000_001] {
        let pieces = [grid.times_ns(start_ns, cut), grid.times_ns(cut, end_ns)];
        assert_eq!(pieces.concat(), all);
    }
    // A period of a third of a second, rounded to ns, without a growing error.
    let thirds = Grid::new(0, 3.0)
        .expect("a rate")
        .times_ns(0, 2_000_000_001);
    assert_eq!(thirds[1..4], [333_333_333, 666_666_667, 1_000_000_000]);
    assert_eq!(thirds[6], 2_000_000_000);
    for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = Grid::new(0, rate_hz).expect_err("no rate");
        assert!(error.to_string().contains("between 0.001 and"), "{error}");
    }
}
