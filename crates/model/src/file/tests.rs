#![allow(
    clippy::disallowed_types,
    reason = "the time that hostile input costs is measured"
)]

use super::*;

fn top(text: &str) -> (Section<'_>, ErrorCollector<'_>) {
    let collector = ErrorCollector::new("a.toml", text);
    let table = DeTable::parse(text).expect("the test's TOML parses");
    (Section::new("", table), collector)
}

#[test]
fn every_problem_is_gathered_with_its_place() {
    let (mut section, mut collector) = top("baud = \"fast\"\nspeeed = 1\n");
    assert!(section.optional::<u32>("baud", &mut collector).is_none());
    assert!(section.optional::<f64>("speed", &mut collector).is_none());
    assert!(
        section
            .required::<String>("device", "give a device", &mut collector)
            .is_none()
    );
    section.finish(&mut collector);
    let problems = collector.into_problems();
    assert_eq!(problems.len(), 3);
    let unknown = problems
        .iter()
        .find(|p| p.message == "unknown field")
        .expect("the misspelt field is reported");
    assert_eq!((unknown.line, unknown.column), (2, 1));
    assert_eq!(unknown.help, "did you mean `speed`?");
}

#[test]
fn a_file_of_another_format_is_one_problem() {
    for (text, format) in [
        ("\n{\n  \"mass\": 1,\n}\n", "JSON"),
        ("<?xml?>\n<a/>", "XML"),
    ] {
        let mut collector = ErrorCollector::new("a.json", text);
        assert!(collector.parse().is_none());
        let problems = collector.into_problems();
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert!(problems[0].message.contains(format), "{problems:?}");
    }
}

#[test]
fn hostile_toml_costs_bounded_time() {
    let start = std::time::Instant::now();
    for (unit, wrap) in [
        ("[", "a = {}"),
        ("{a=", "a = {}"),
        ("a.", "{}a = 1"),
        ("a.", "[{}a]"),
        ("=\n", "{}"),
        ("a = 1\n", "{}"),
        ("\u{0}\u{1b}", "{}"),
        ("[[a.b]]\n", "{}"),
        ("\"", "{}"),
    ] {
        let text = wrap.replace("{}", &unit.repeat((TOML_MAX - 16) / unit.len()));
        let mut collector = ErrorCollector::new("a.toml", &text);
        if let Some(table) = collector.parse() {
            Section::new("", table).finish(&mut collector);
        }
        let problems = collector.into_problems();
        assert!((1..=PROBLEMS_MAX + 1).contains(&problems.len()), "{unit}");
        let length: usize = problems.iter().map(|p| p.to_string().len()).sum();
        assert!(length < 1 << 20, "{unit}");
    }
    let keys: String = (0..80_000).map(|n| format!("k{n} = 1\n")).collect();
    let mut collector = ErrorCollector::new("a.toml", &keys);
    let table = collector.parse().expect("parses");
    Section::new("", table).finish(&mut collector);
    assert_eq!(collector.into_problems().len(), PROBLEMS_MAX + 1);
    let long = "#".repeat(TOML_MAX + 1);
    let mut collector = ErrorCollector::new("a.toml", &long);
    assert!(collector.parse().is_none());
    let seconds = start.elapsed().as_secs_f64();
    assert!(seconds < 30.0, "{seconds} s");
}

#[test]
fn problems_are_printable() {
    let problem = Problem {
        file: "a\u{1b}[2J.toml".to_owned(),
        line: 1,
        column: 1,
        field: "x\ny".to_owned(),
        value: String::new(),
        message: "\u{202e}".to_owned(),
        help: "\n<0>".to_owned(),
    };
    let text = problem.to_string();
    assert_eq!(text.lines().count(), 2, "{text}");
    assert!(!text.contains(['\u{1b}', '\u{202e}']), "{text}");
}

#[test]
fn the_name_that_is_meant_is_near() {
    assert_eq!(closest("bitrat", &["baud", "bitrate"]), Some("bitrate"));
    assert_eq!(closest("zzzz", &["baud", "bitrate"]), None);
}
