use proptest::prelude::*;
use sample::{CanFlags, CanFrame, StrainChannel, Wheel};

use super::*;

const PROWLER: &[u8] = include_bytes!("../../../../crates/engine/assets/prowler.dbc");

/// Two multiplexors inside each other, a Motorola signal, labels.
const NESTED: &str = r#"VERSION ""
BS_:
BU_: Node
BO_ 2566834688 Nested: 8 Node
 SG_ page M : 0|8@1+ (1,0) [0|0] "" Node
 SG_ sub m3M : 8|8@1+ (1,0) [0|0] "" Node
 SG_ deep m7 : 23|16@0- (0.5,1) [-100|100] "N" Node
 SG_ wide m0 : 16|16@1+ (1,0) [0|0] "" Node
SG_MUL_VAL_ 2566834688 sub page 3-3;
SG_MUL_VAL_ 2566834688 deep sub 7-9, 200-200;
SG_MUL_VAL_ 2566834688 wide page 0-1;
VAL_ 2566834688 deep -2 "low" 4 "high" ;
"#;

fn nested() -> Database {
    Database::parse(NESTED.as_bytes()).expect("a good file")
}

fn names(message: &MessageDef, data: &[u8]) -> Vec<String> {
    let values = message.decode(data);
    values.map(|value| value.signal.name.clone()).collect()
}

fn errors(text: &str) -> Vec<String> {
    let error = Database::parse(text.as_bytes()).expect_err("a bad file");
    error.issues.iter().map(ToString::to_string).collect()
}

fn one_message(signals: &str) -> String {
    format!("VERSION \"\"\nBS_:\nBU_: Node\nBO_ 5 Sample: 2 Node\n{signals}")
}

#[test]
fn multiplexors_select_through_each_other() {
    let database = nested();
    let message = database.by_name("Nested").expect("the message");
    assert_eq!(names(message, &[0, 7, 0, 0]), ["page", "wide"]);
    assert_eq!(names(message, &[1, 7, 0, 0]), ["page", "wide"]);
    assert_eq!(names(message, &[3, 6, 0, 0]), ["page", "sub"]);
    assert_eq!(names(message, &[3, 9, 0, 0]), ["page", "sub", "deep"]);
    assert_eq!(names(message, &[3, 200, 0, 0]), ["page", "sub", "deep"]);
    // Too short for the signal, then for everything.
    assert_eq!(names(message, &[3, 200, 0]), ["page", "sub"]);
    assert_eq!(names(message, &[]), [""; 0]);
}

#[test]
fn values_have_units_signs_and_labels() {
    let database = nested();
    let flags = CanFlags {
        extended: true,
        ..CanFlags::default()
    };
    let frame = CanFrame::new(0x18FE_CA00, flags, &[3, 8, 0xFF, 0xFE]).expect("a frame");
    let message = database.message_of(&frame).expect("the message");
    let deep = message.decode(frame.bytes()).last().expect("the signal");
    assert_eq!(deep.physical, -2.0 * 0.5 + 1.0);
    assert_eq!(deep.signal.unit, "N");
    assert_eq!(deep.label(), Some("low"));
    assert_eq!(deep.signal.range, Some((-100.0, 100.0)));
    assert_eq!(database.by_id(0x18FE_CA00, false), None);
    let remote = CanFrame {
        flags: CanFlags {
            remote: true,
            ..flags
        },
        ..frame.clone()
    };
    assert_eq!(database.decode(&remote), None);
}

#[test]
fn encoding_says_what_does_not_fit() {
    let database = nested();
    let message = database.by_name("Nested").expect("the message");
    let frame = message
        .encode(&[("page", 3.0), ("sub", 200.0), ("deep", -2.4)])
        .expect("values that fit");
    assert_eq!(frame.bytes(), [3, 200, 0xFF, 0xF9, 0, 0, 0, 0]);
    assert!(frame.flags.extended);
    for (values, word) in [
        (&[("page", 256.0)][..], "0 to 255"),
        (&[("page", f64::NAN)], "NaN"),
        (&[("depth", 1.0)], "no signal depth"),
        (&[("page", 0.0), ("deep", 1.0)], "set sub"),
    ] {
        let error = message.encode(values).expect_err(word).to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn syntax_errors_name_line_and_token() {
    let text = one_message(
        " SG_ good : 0|8@1+ (1,0) [0|0] \"\" Node\n SG_ bad : 8|8@3+ (1,0) [0|0] \"\" Node\n",
    );
    let errors = errors(&text);
    assert_eq!(errors.len(), 1);
    assert!(errors[0].starts_with("line 6: `3+`"), "{errors:?}");
}

#[test]
fn every_error_is_told_with_its_line() {
    let text = one_message(concat!(
        " SG_ far : 12|8@1+ (1,0) [0|0] \"\" Node\n",
        " SG_ zero : 0|8@1+ (0,0) [0|0] \"\" Node\n",
        " SG_ none : 0|0@1+ (1,0) [0|0] \"\" Node\n",
        " SG_ far : 0|8@1+ (1,0) [0|0] \"\" Node\n",
        "BO_ 5000 Wide: 1 Node\n",
        "BO_ 5 Again: 1 Node\n",
    ));
    let errors = errors(&text);
    let starts = [
        "line 5: `far` is there twice",
        "line 5: `far` needs 3 bytes, but Sample has 2",
        "line 6: `zero` has factor 0",
        "line 7: `none` has start bit 0 and 0 bits",
        "line 9: `Wide` has identifier 5000",
        "line 10: `Again` has the same identifier as Sample",
    ];
    assert_eq!(errors.len(), starts.len(), "{errors:#?}");
    for (error, start) in errors.iter().zip(starts) {
        assert!(error.starts_with(start), "{error}");
    }
}

#[test]
fn multiplexors_that_cannot_work_are_errors() {
    let lonely = one_message(" SG_ a m1 : 0|8@1+ (1,0) [0|0] \"\" Node\n");
    assert!(errors(&lonely)[0].contains("has 0 multiplexors"));
    let ring = one_message(concat!(
        " SG_ a m1M : 0|8@1+ (1,0) [0|0] \"\" Node\n",
        " SG_ b m1M : 8|8@1+ (1,0) [0|0] \"\" Node\n",
        "SG_MUL_VAL_ 5 a b 1-1;\nSG_MUL_VAL_ 5 b a 1-1;\n",
    ));
    assert!(errors(&ring)[0].contains("selects itself"));
    let unknown = one_message(concat!(
        " SG_ a m1 : 0|8@1+ (1,0) [0|0] \"\" Node\n",
        "SG_MUL_VAL_ 5 a ghost 1-1;\n",
    ));
    assert!(errors(&unknown)[0].contains("selected by ghost"));
    let float = one_message(concat!(
        " SG_ a : 0|16@1+ (1,0) [0|0] \"\" Node\n",
        "SIG_VALTYPE_ 5 a : 1;\n",
    ));
    assert!(errors(&float)[0].contains("has 16 bits"));
}

#[test]
fn overlaps_and_loose_ends_are_warnings() {
    let text = one_message(concat!(
        " SG_ page M : 0|4@1+ (1,0) [0|0] \"\" Node\n",
        " SG_ a m0 : 8|8@1+ (1,0) [0|0] \"\" Node\n",
        " SG_ b m1 : 8|8@1+ (1,0) [0|0] \"\" Node\n",
        " SG_ c : 2|4@1+ (1,0) [0|0] \"\" Node\n",
        "VAL_ 5 ghost 1 \"x\" ;\n",
    ));
    let database = Database::parse(text.as_bytes()).expect("a usable file");
    let warnings: Vec<_> = database
        .warnings()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(warnings.len(), 2, "{warnings:#?}");
    assert!(warnings[0].contains("`ghost` is named in VAL_ 5"));
    assert!(warnings[1].starts_with("line 8: `c` overlaps page in byte 0"));
}

#[test]
fn windows_text_and_byte_order_marks_are_read() {
    let degrees = one_message(" SG_ a : 0|8@1+ (1,0) [0|0] \"\u{b0}C\" Node\n");
    let windows: Vec<u8> = degrees.chars().map(|letter| letter as u8).collect();
    let marked = [b"\xEF\xBB\xBF", degrees.as_bytes()].concat();
    for file in [windows, marked] {
        let database = Database::parse(&file).expect("a good file");
        assert_eq!(database.messages()[0].signals[0].unit, "\u{b0}C");
    }
}

#[test]
fn parameter_groups_leave_addresses_out() {
    assert_eq!(parameter_group(0x18F0_0417), 0xF004);
    assert_eq!(parameter_group(0x0CF0_0400), 0xF004);
    assert_eq!(parameter_group(0x18EA_FF00), 0xEA00);
    assert_eq!(parameter_group(0x19F0_0417), 0x1_F004);
}

#[test]
fn the_projects_own_file_holds_every_channel_of_every_corner() {
    let database = Database::parse(PROWLER).expect("a good file");
    assert_eq!(database.warnings(), []);
    for (wheel, id) in Wheel::ALL.into_iter().zip([0x110, 0x130, 0x140, 0x150]) {
        let arms = database.by_name(&format!("Strain_{wheel}")).expect("arms");
        let rest = database.by_name(&format!("Corner_{wheel}")).expect("rest");
        assert_eq!((arms.id, rest.id), (id, id + 1));
        for channel in StrainChannel::ALL {
            let signal = [arms, rest].into_iter().find_map(|message| {
                message
                    .position(channel.name())
                    .map(|i| &message.signals[i])
            });
            let signal = signal.expect("every channel has a signal");
            assert_eq!((signal.width(), signal.unit.as_str()), (16, "count"));
            assert_eq!(signal.labels, [(0xFFFF, "absent".to_owned())]);
            assert!(!signal.comment.is_empty());
        }
        assert!(rest.position("deflection").is_some());
        let hub = database.by_name(&format!("Hub_{wheel}")).expect("hub");
        assert!(
            ["x", "y", "z"]
                .iter()
                .all(|axis| hub.position(axis).is_some())
        );
        let speeds = database.by_name("WheelSpeed").expect("speeds");
        assert!(speeds.position(wheel.abbreviation()).is_some());
    }
    let steering = database.by_name("Steering").expect("steering");
    let frame = steering
        .encode(&[("hand_wheel_angle", -540.25)])
        .expect("fits");
    let signals = database.decode(&frame).expect("decodes").signals;
    assert!((signals[0].value + 540.25).abs() < 1e-9);
}

fn usable(text: &str) -> Database {
    Database::parse_usable(text.as_bytes()).expect("a usable file")
}

/// Each kind of error costs its own message; the others decode.
#[test]
fn a_bad_message_does_not_cost_the_file() {
    let good = "BO_ 9 Good: 1 Node\n SG_ g : 0|8@1+ (1,0) [0|0] \"\" Node\n";
    let signal = |name: &str, field: &str| format!(" SG_ {name} : {field} [0|0] \"\" Node\n");
    let kinds = [
        signal("far", "8|16@1+ (1,0)"),
        signal("twice", "0|8@1+ (1,0)").repeat(2),
        signal("zero", "0|8@1+ (0,0)"),
        signal("none", "0|0@1+ (1,0)"),
        signal("syntax", "0|8@5+ (1,0)"),
        signal("a-b", "0|8@1+ (1,0)"),
        " SG_ open : 0|8@1+ (1,0) [0|0] \"\n".to_owned(),
        signal("lonely m1", "0|8@1+ (1,0)"),
        format!("{good}BO_ 5000 Wide: 1 Node\n").replace("BO_ 9 Good", "BO_ 10 Other"),
        "BO_ 9 Other: 1 Node\nBO_ 9 Again: 1 Node\n".to_owned(),
        "CM_ SG_ 5 unfinished\n".to_owned(),
        "BA_ 7;\n".to_owned(),
    ];
    for kind in kinds {
        let text = format!("{}{good}", one_message(&kind));
        let database = usable(&text);
        let left_out = database.left_out();
        assert!(!left_out.is_empty(), "{text}");
        let good = database.messages().iter().any(|m| m.id == 9);
        assert!(good, "{text}{left_out:?}");
        assert!(Database::parse(text.as_bytes()).is_err(), "{text}");
    }
    let text = format!("{}{good}", one_message(&signal("far", "8|16@1+ (1,0)")));
    let database = usable(&text);
    assert_eq!(database.by_name("Sample"), None);
    assert_eq!(database.left_out()[0].message.as_deref(), Some("Sample"));
    let text = database.left_out()[0].issue.to_string();
    assert_eq!(text, "line 5: `far` needs 3 bytes, but Sample has 2");
    assert!(Database::parse_usable(b"PK\x03\x04 no DBC at all").is_err());
    // A file whose messages are all bad is still a DBC file.
    let all_bad = usable("VERSION \"\"\nBU_: A\nBO_ 5000 Wide: 1 A\n");
    assert_eq!((all_bad.messages().len(), all_bad.left_out().len()), (0, 1));
}

/// Sections of other tools, comments and names that the parser does not take.
#[test]
fn unknown_sections_comments_and_letters_are_read() {
    let text = "VERSION \"\"\n(* made by\na tool *)\nBS_:\nBU_: Node\n\
        SGTYPE_ Kind : 8@1+ (1,0) [0|0] \"; (*\" 0, Table;\nCAT_DEF_ 1 x 0;\n\
        BO_ 5 Öl_Druck: 2 Node (* a comment *)\n \
        SG_ größe : 0|8@1+ (1,0) [0|0] \"µm (* no comment *)\" Node\n\
        VAL_ 5 größe 1 \"klein\" ;\nFILTER 1;\n";
    let database = Database::parse(text.as_bytes()).expect("a good file");
    let message = database.by_name("Öl_Druck").expect("the message");
    let signal = &message.signals[0];
    assert_eq!(signal.name, "größe");
    assert_eq!(signal.unit, "µm (* no comment *)");
    assert_eq!(signal.labels, [(1, "klein".to_owned())]);
    assert_eq!(database.warnings(), []);
    let bad = text.replace("0|8@1+ (1,0) [0|0] \"µm", "12|8@1+ (1,0) [0|0] \"µm");
    let error = Database::parse(bad.as_bytes()).expect_err("too long");
    assert!(
        error
            .to_string()
            .starts_with("line 9: `größe` needs 3 bytes"),
        "{error}"
    );
}

#[test]
fn long_names_replace_short_ones_unless_they_clash() {
    let text = |second: &str| {
        format!(
            "{}BA_DEF_ SG_ \"SystemSignalLongSymbol\" STRING ;\n\
             BA_DEF_ BO_ \"SystemMessageLongSymbol\" STRING ;\n\
             BA_ \"SystemSignalLongSymbol\" SG_ 5 short_0000 \"A_long_name\";\n\
             BA_ \"SystemSignalLongSymbol\" SG_ 5 short_0001 \"{second}\";\n\
             BA_ \"SystemMessageLongSymbol\" BO_ 5 \"Sample_of_a_long_name\";\n",
            one_message(
                " SG_ short_0000 : 0|8@1+ (1,0) [0|0] \"\" Node\n \
                 SG_ short_0001 : 8|8@1+ (1,0) [0|0] \"\" Node\n"
            )
        )
    };
    let names = |text: &str| -> Vec<String> {
        let database = usable(text);
        let message = database
            .by_name("Sample_of_a_long_name")
            .expect("by long name");
        assert_eq!(database.by_name("Sample"), Some(message));
        assert_eq!(message.position("short_0001"), Some(1));
        message.signals.iter().map(|s| s.name.clone()).collect()
    };
    assert_eq!(names(&text("Another")), ["A_long_name", "Another"]);
    assert_eq!(names(&text("A_long_name")), ["short_0000", "short_0001"]);
    assert_eq!(names(&text("")), ["A_long_name", "short_0001"]);
}

proptest! {
    #[test]
    fn damaged_files_never_panic(
        at in 0_usize..PROWLER.len(),
        with in proptest::collection::vec(any::<u8>(), 0..12),
        cut in 0_usize..40,
    ) {
        for file in [PROWLER, NESTED.as_bytes()] {
            let at = at % file.len();
            let end = (at + cut).min(file.len());
            let damaged = [&file[..at], &with, &file[end..]].concat();
            if let Ok(database) = Database::parse_usable(&damaged) {
                for message in database.messages() {
                    message.decode(&[0xA5; 64]).for_each(drop);
                }
            }
        }
    }
}

/// Files that cost a quadratic loader minutes, and an unbounded one all memory.
#[test]
#[expect(clippy::disallowed_types, reason = "it measures time")]
fn hostile_files_cost_bounded_time() {
    let head = "VERSION \"\"\nBS_:\nBU_: Node\n";
    let lines =
        |count: usize, line: &dyn Fn(usize) -> String| (0..count).map(line).collect::<String>();
    let signal = |n: usize| format!(" SG_ s{n} : 0|8@1+ (1,0) [0|0] \"\" Node\n");
    let muxed = |n: usize| format!(" SG_ s{n} m{n} : 8|8@1+ (1,0) [0|0] \"\" Node\n");
    let message = |n: usize| format!("BO_ {} m{n}: 8 Node\n", 0x8000_0000_u64 + n as u64);
    let one = "BO_ 5 Sample: 8 Node\n";
    let switch = " SG_ M M : 0|8@1+ (1,0) [0|0] \"\" Node\n";
    let full = SIGNALS_MAX - 1;
    let same = " SG_ a : 0|8@1+ (1,0) [0|0] \"\" Node\n";
    let cases: Vec<(&str, String, Option<bool>)> = vec![
        (
            "signals",
            format!("{head}{one}{}", lines(200_000, &signal)),
            Some(false),
        ),
        (
            "as many signals as allowed",
            format!("{head}{one}{}", lines(full, &signal)),
            Some(true),
        ),
        (
            "multiplexed",
            format!("{head}{one}{switch}{}", lines(full, &muxed)),
            Some(true),
        ),
        (
            "messages",
            format!("{head}{}", lines(100_000, &message)),
            Some(true),
        ),
        (
            "too many messages",
            format!("{head}{}", lines(500_000, &message)),
            Some(false),
        ),
        (
            "one name",
            format!("{head}{one}{}", same.repeat(full)),
            Some(false),
        ),
        (
            "one identifier",
            format!("{head}{}", "BO_ 5 Sample: 8 Node\n".repeat(100_000)),
            Some(false),
        ),
        (
            "comments",
            format!(
                "{head}{}{}",
                lines(50_000, &message),
                lines(50_000, &|n| {
                    format!("CM_ BO_ {} \"x\";\n", 0x8000_0000_u64 + n as u64)
                })
            ),
            Some(true),
        ),
        (
            "labels of no signal",
            format!(
                "{head}{one}{}",
                lines(100_000, &|n| { format!("VAL_ 5 s{n} 1 \"x\" ;\n") })
            ),
            Some(true),
        ),
        (
            "labels",
            format!(
                "{head}{one}{switch}VAL_ 5 M {};\n",
                lines(200_000, &|n| { format!("{n} \"x\" ") })
            ),
            Some(true),
        ),
        (
            "ranges",
            format!(
                "{head}{one}{switch} SG_ a m0 : 8|8@1+ (1,0) [0|0] \"\" Node\n\
            SG_MUL_VAL_ 5 a M {};\n",
                lines(300_000, &|n| {
                    format!("{}-{}{}", 2 * n, 2 * n, if n == 299_999 { "" } else { "," })
                })
            ),
            Some(false),
        ),
        (
            "a wide range",
            format!(
                "{head}{one}{switch} SG_ a m0 : 8|8@1+ (1,0) [0|0] \"\" Node\n\
            SG_MUL_VAL_ 5 a M 0-18446744073709551615, 5-4;\n"
            ),
            Some(true),
        ),
        (
            "a message of absurd size",
            format!(
                "{head}BO_ 5 Sample: 9223372036854775807 Node\n\
             SG_ a : 4611686018427387904|8@1+ (1,0) [0|0] \"\" Node\n\
             SG_ b : 4611686018427387904|8@1+ (1,0) [0|0] \"\" Node\n"
            ),
            Some(false),
        ),
        (
            "blank lines",
            format!("{head}{one}{}x", "\n".repeat(300_000)),
            None,
        ),
        (
            "blank lines with blanks",
            format!("{head}{}x", " \n".repeat(300_000)),
            None,
        ),
        (
            "comment lines",
            format!("{head}{one}{}x", "// x\n".repeat(200_000)),
            None,
        ),
        (
            "one long line",
            format!("{head}CM_ \"{}\";\n", "x".repeat(BYTES_MAX / 2)),
            Some(true),
        ),
        (
            "an open text",
            format!("{head}CM_ \"{}", "x".repeat(BYTES_MAX / 2)),
            Some(false),
        ),
        (
            "quotes",
            format!("{head}CM_ {}", "\"\" ".repeat(300_000)),
            None,
        ),
        (
            "nodes",
            format!("VERSION \"\"\nBS_:\nBU_: {}\n", "n ".repeat(3_000_000)),
            None,
        ),
        (
            "a long name",
            format!("{head}BO_ 5 {}: 8 Node\n", "m".repeat(BYTES_MAX / 2)),
            None,
        ),
        (
            "digits",
            format!("{head}BO_ {} m: 8 Node\n", "9".repeat(BYTES_MAX / 2)),
            Some(false),
        ),
        (
            "labels without entries",
            format!("{head}{}", "VAL_ a;".repeat(300_000)),
            None,
        ),
        ("zeros", "\0".repeat(BYTES_MAX), Some(false)),
        ("too long", " ".repeat(BYTES_MAX + 1), Some(false)),
    ];
    for (name, text, usable) in cases {
        let start = std::time::Instant::now();
        let lenient = Database::parse_usable(text.as_bytes());
        drop(lenient);
        let result = Database::parse(text.as_bytes());
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{name}: {} bytes, {seconds:.2} s, usable: {}",
            text.len(),
            result.is_ok()
        );
        if let Some(usable) = usable {
            assert_eq!(result.is_ok(), usable, "{name}: {:?}", result.err());
        }
        let issues = match &result {
            Ok(database) => database.warnings().len(),
            Err(error) => error.issues.len(),
        };
        assert!(issues <= 101, "{name}: {issues} issues");
        // 20 times what the slowest took when this was written, on a busy machine.
        assert!(seconds < 30.0, "{name}: {seconds} s");
    }
}

#[test]
fn names_of_a_hostile_file_are_printable_in_its_errors() {
    let error = Database::parse(b"BO_ 5 \x1b[2J\x9b\xe2\x80\xae: 8 Node\n").expect_err("not a DBC");
    let text = error.to_string();
    assert!(!text.contains(['\u{1b}', '\u{9b}', '\u{202e}']), "{text}");
}
