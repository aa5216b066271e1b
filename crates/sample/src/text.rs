//! Text from outside (marks, names, units, device messages, contents of a log) on its way to a
//! person: terminal, journal, HTML page, spreadsheet. The log itself keeps the original bytes.

use std::borrow::Cow;
use std::fmt::Write;

/// Longest text that [`printable`] gives, characters.
pub const PRINTABLE_MAX: usize = 1_000;

/// One line that can neither control a terminal nor begin another line.
///
/// Control characters (C0, DEL, C1), line and paragraph separators, bidirectional controls and
/// invisible format characters become `\uXXXX`; line feed, carriage return and tab become `\n`,
/// `\r` and `\t`. A text of more than [`PRINTABLE_MAX`] characters is cut and ends with `…`.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    clean(text, PRINTABLE_MAX, |_| false)
}

/// [`printable`] for bytes; what is not UTF-8 becomes U+FFFD.
#[must_use]
pub fn printable_bytes(bytes: &[u8]) -> String {
    // A character has at most 4 bytes; one more shows that something follows.
    let head = &bytes[..bytes.len().min(4 * PRINTABLE_MAX + 4)];
    printable(&String::from_utf8_lossy(head)).into_owned()
}

/// [`printable`] that keeps line feeds and tabs and has no limit of length: for text that stands in
/// an element of its own, and for output that the program composed itself.
#[must_use]
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    clean(text, usize::MAX, |c| matches!(c, '\n' | '\t'))
}

/// [`printable`], and HTML markup escaped for elements and quoted attributes.
#[must_use]
pub fn html(text: &str) -> String {
    escape_markup(&printable(text))
}

/// [`printable_lines`], and HTML markup escaped.
#[must_use]
pub fn html_lines(text: &str) -> String {
    escape_markup(&printable_lines(text))
}

/// Serialised JSON for a `<script>` element: it can neither end the element nor open a comment in
/// it. `json` must be valid JSON; its value stays the same.
#[must_use]
pub fn json_in_html(json: &str) -> String {
    let mut safe = String::with_capacity(json.len());
    for c in json.chars() {
        // Outside of strings JSON has none of these characters.
        if matches!(c, '<' | '>' | '&') || must_escape(c) && !c.is_ascii_whitespace() {
            push_escape(&mut safe, c);
        } else {
            safe.push(c);
        }
    }
    safe
}

/// A text cell of a CSV file: [`printable`] without the limit of length, and an apostrophe in front
/// of what a spreadsheet would take for a formula. Numbers stay numbers.
#[must_use]
pub fn csv_cell(text: &str) -> Cow<'_, str> {
    let cell = clean(text, usize::MAX, |_| false);
    // Spreadsheets skip blanks in front of a formula, and know the full-width forms of the signs.
    let formula = cell.trim_start().starts_with([
        '=', '+', '-', '@', '\u{FF1D}', '\u{FF0B}', '\u{FF0D}', '\u{FF20}',
    ]) || text.starts_with(['\t', '\r', '\n']);
    if formula && text.trim().parse::<f64>().is_err() {
        Cow::Owned(format!("'{cell}"))
    } else {
        cell
    }
}

fn clean(text: &str, limit: usize, keep: impl Fn(char) -> bool) -> Cow<'_, str> {
    let bad = |c: char| must_escape(c) && !keep(c);
    let end = text.char_indices().nth(limit).map(|(index, _)| index);
    if end.is_none() && !text.contains(bad) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len().min(limit.saturating_mul(4)));
    for c in text[..end.unwrap_or(text.len())].chars() {
        match c {
            c if !bad(c) => safe.push(c),
            '\n' => safe.push_str("\\n"),
            '\r' => safe.push_str("\\r"),
            '\t' => safe.push_str("\\t"),
            c => push_escape(&mut safe, c),
        }
    }
    if end.is_some() {
        safe.push('…');
    }
    Cow::Owned(safe)
}

/// `\uXXXX` as in JSON, so that an escape inside a JSON string keeps the value.
fn push_escape(text: &mut String, c: char) {
    let mut units = [0; 2];
    for unit in c.encode_utf16(&mut units) {
        // Writing to a string does not fail.
        let _ = write!(text, "\\u{unit:04x}");
    }
}

/// Whether a character controls how the rest is shown, or is not seen at all.
fn must_escape(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{00AD}'
                | '\u{061C}'
                | '\u{180E}'
                | '\u{200B}'..='\u{200F}'
                | '\u{2028}'..='\u{202E}'
                | '\u{2060}'..='\u{206F}'
                | '\u{FEFF}'
                | '\u{FFF9}'..='\u{FFFB}'
                | '\u{E0000}'..='\u{E007F}'
        )
}

fn escape_markup(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_line_stays_one_line_and_controls_nothing() {
        assert_eq!(printable("Bremse heiß, 82 °C"), "Bremse heiß, 82 °C");
        assert_eq!(printable("a\n<0>b\r\tc"), "a\\n<0>b\\r\\tc");
        assert_eq!(printable("\u{1b}[2J\0\u{7f}"), "\\u001b[2J\\u0000\\u007f");
        assert_eq!(printable("\u{9b}31m\u{85}x"), "\\u009b31m\\u0085x");
        assert_eq!(
            printable("\u{202e}gpj.exe\u{2066}\u{200f}\u{2028}"),
            "\\u202egpj.exe\\u2066\\u200f\\u2028"
        );
        assert_eq!(printable("\u{E0041}"), "\\udb40\\udc41");
        assert_eq!(printable_bytes(b"a\xff\x1bb"), "a\u{fffd}\\u001bb");
        assert_eq!(printable_lines("a\n\tb\u{1b}"), "a\n\tb\\u001b");
    }

    #[test]
    fn long_text_is_cut() {
        let long = "ä".repeat(PRINTABLE_MAX + 1);
        let cut = printable(&long);
        assert_eq!(cut.chars().count(), PRINTABLE_MAX + 1);
        assert!(cut.ends_with('…'));
        assert_eq!(printable(&long[2..]), &long[2..]);
        let bytes = printable_bytes(&[b'x'; 10_000]);
        assert_eq!(bytes.chars().count(), PRINTABLE_MAX + 1);
    }

    #[test]
    fn markup_is_text_in_html() {
        assert_eq!(
            html("<!--<script>\"&'\n"),
            "&lt;!--&lt;script&gt;&quot;&amp;&#39;\\n"
        );
        assert_eq!(html_lines("a\n<b>"), "a\n&lt;b&gt;");
        for (json, safe) in [
            ("\"</script><!--\"", "\"\\u003c/script\\u003e\\u003c!--\""),
            (
                "{\"a\": 1,\n\"b\": \"&\"}",
                "{\"a\": 1,\n\"b\": \"\\u0026\"}",
            ),
            ("\"\u{2028}\u{9b}\"", "\"\\u2028\\u009b\""),
        ] {
            assert_eq!(json_in_html(json), safe);
        }
    }

    #[test]
    fn a_cell_is_no_formula_and_numbers_stay_numbers() {
        for number in ["-1.5", "+3", "-1e-3", "-inf", " -7"] {
            assert_eq!(csv_cell(number), number);
        }
        for text in ["", "plain", "a=b", "m/s²", "12:30", "wheel -1"] {
            assert_eq!(csv_cell(text), text);
        }
        for text in [
            "=HYPERLINK(\"x\")",
            "+1+cmd|' /C calc'!A0",
            "-2+3",
            "@SUM(A1)",
            "  =1",
            "＝1",
        ] {
            assert_eq!(csv_cell(text), format!("'{text}"));
        }
        assert_eq!(csv_cell("\t=1"), "'\\t=1");
        assert_eq!(csv_cell("a\nb"), "a\\nb");
    }
}
