//! Markdown as roff, for manual pages.

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use roff::{Inline, Roff, bold, italic, roman};

/// Heading of a column whose cells need no label.
const MEANING: &str = "meaning";

/// Appends the text of a page without its title.
pub fn append(page: &mut Roff, markdown: &str) {
    let mut writer = Writer {
        page,
        line: Vec::new(),
        strong: 0,
        place: Place::Text,
        lists: Vec::new(),
        head: Vec::new(),
        row: Vec::new(),
    };
    for event in Parser::new_ext(markdown, Options::ENABLE_TABLES) {
        writer.push(event);
    }
}

/// Where the text of an event belongs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Text,
    Code,
    /// The title of the page, and pictures.
    Nowhere,
}

struct Writer<'p> {
    page: &'p mut Roff,
    /// Text that is not yet a line of the page.
    line: Vec<Inline>,
    strong: usize,
    place: Place,
    /// Number of the next item of each open list; `None` without numbers.
    lists: Vec<Option<u64>>,
    head: Vec<Vec<Inline>>,
    row: Vec<Vec<Inline>>,
}

impl Writer<'_> {
    fn push(&mut self, event: Event<'_>) {
        match event {
            Event::Start(tag) => self.start(&tag),
            Event::End(tag) => self.end(tag),
            Event::Text(text) if self.place == Place::Code => {
                for line in text.lines() {
                    self.page.text([roman(line)]);
                }
            }
            Event::Text(text) => self.add(&text, self.strong > 0),
            Event::Code(text) => self.add(&text, true),
            Event::SoftBreak | Event::HardBreak => self.add(" ", false),
            _ => {}
        }
    }

    fn add(&mut self, text: &str, is_bold: bool) {
        if self.place == Place::Text {
            self.line
                .push(if is_bold { bold(text) } else { roman(text) });
        }
    }

    fn start(&mut self, tag: &Tag<'_>) {
        match tag {
            Tag::Heading { level, .. } if *level as usize == 1 => self.place = Place::Nowhere,
            Tag::Image { .. } => self.place = Place::Nowhere,
            Tag::Strong => self.strong += 1,
            Tag::Paragraph if self.lists.is_empty() => self.control("PP", &[]),
            Tag::CodeBlock(_) => {
                self.place = Place::Code;
                self.control("PP", &[]);
                self.control("RS", &["4"]);
                self.control("nf", &[]);
            }
            Tag::List(first) => {
                self.flush();
                self.lists.push(*first);
            }
            Tag::Item => {
                let mark = match self.lists.last_mut() {
                    Some(Some(number)) => {
                        *number += 1;
                        format!("{}.", *number - 1)
                    }
                    _ => "\\(bu".to_owned(),
                };
                self.control("IP", &[&mark, "4"]);
            }
            _ => {}
        }
    }

    fn end(&mut self, tag: TagEnd) {
        match tag {
            TagEnd::Heading(level) => self.end_heading(level as usize),
            TagEnd::Image => self.place = Place::Text,
            TagEnd::Strong => self.strong -= 1,
            TagEnd::Paragraph | TagEnd::Item => self.flush(),
            TagEnd::CodeBlock => {
                self.place = Place::Text;
                self.control("fi", &[]);
                self.control("RE", &[]);
            }
            TagEnd::List(_) => drop(self.lists.pop()),
            TagEnd::TableCell => self.row.push(std::mem::take(&mut self.line)),
            TagEnd::TableHead => self.head = std::mem::take(&mut self.row),
            TagEnd::TableRow => self.write_row(),
            _ => {}
        }
    }

    fn end_heading(&mut self, level: usize) {
        let line = std::mem::take(&mut self.line);
        let text: String = line.iter().map(text_of).collect();
        // The argument of a heading stands in quotation marks.
        let text = text.replace('"', "\\(dq");
        // Names of tables and fields have their own case.
        let has_names = line.iter().any(|part| matches!(part, Inline::Bold(_)));
        match level {
            1 => self.place = Place::Text,
            2 if !has_names => self.control("SH", &[&text.to_uppercase()]),
            2 => self.control("SH", &[&text]),
            _ => self.control("SS", &[&text]),
        }
    }

    /// A row of a table: the first cell is the term, the others are lines below it.
    fn write_row(&mut self) {
        let row = std::mem::take(&mut self.row);
        let titles: Vec<String> = (self.head.iter())
            .map(|cell| cell.iter().map(text_of).collect())
            .collect();
        let mut cells = row.into_iter().zip(titles);
        let Some((term, _)) = cells.next() else {
            return;
        };
        self.control("TP", &[]);
        self.page.text(term);
        let (meaning, others): (Vec<_>, Vec<_>) = cells
            .filter(|(cell, _)| !cell.is_empty())
            .partition(|(_, title)| title == MEANING);
        let labelled = others.into_iter().map(|(cell, title)| {
            let label = [italic(title), roman(": ")];
            label.into_iter().chain(cell).collect::<Vec<_>>()
        });
        let lines = meaning.into_iter().map(|(cell, _)| cell).chain(labelled);
        for (number, line) in lines.enumerate() {
            if number > 0 {
                self.control("br", &[]);
            }
            self.page.text(line);
        }
    }

    fn control(&mut self, name: &str, arguments: &[&str]) {
        self.flush();
        self.page.control(name, arguments.iter().copied());
    }

    fn flush(&mut self) {
        if !self.line.is_empty() {
            self.page.text(std::mem::take(&mut self.line));
        }
    }
}

fn text_of(part: &Inline) -> &str {
    match part {
        Inline::Roman(text) | Inline::Italic(text) | Inline::Bold(text) => text,
        Inline::LineBreak => " ",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_tables_lists_and_examples_are_kept() {
        let mut page = Roff::new();
        let text = "# Title\n\nSee [the *page*](x.md) and `a_b`.\n\n## `[top]`\n\n### `k = \"v\"` here\n\n| field | default | meaning |\n\
                    |---|---|---|\n| `rate_hz` | 100 | packets \\| s |\n\n- one\n- **two**\n\n```toml\n.x = 1\n```\n";
        append(&mut page, text);
        let roff = page.to_roff();
        for part in [
            ".PP\nSee the page and \\fBa_b\\fR.\n",
            ".SH [top]\n",
            ".SS \"k = \\(dqv\\(dq here\"\n",
            ".TP\n\\fBrate_hz\\fR\npackets | s\n.br\n\\fIdefault\\fR: 100\n",
            "4\none\n",
            "\\fBtwo\\fR\n",
            ".nf\n\\&.x = 1\n.fi\n",
        ] {
            assert!(roff.contains(part), "{part}: {roff}");
        }
        assert!(!roff.contains("Title") && !roff.contains("x.md"), "{roff}");
    }
}
