//! `atvrec man`: write the manual pages of the commands and of the files.

mod markdown;

use std::io::Write;

use anyhow::Context;
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use roff::{Roff, bold, roman};

use crate::cli::{Cli, EXAMPLES, ManArgs};
use crate::exit::Outcome;
use engine::output::{Kind, Target};

/// A file that users write, as a page of section 5.
struct FilePage {
    /// Name of the page.
    name: &'static str,
    about: &'static str,
    /// The page of the documentation, in Markdown.
    text: &'static str,
    see_also: &'static [&'static str],
}

const FILES: [FilePage; 3] = [
    FilePage {
        name: "atvrec.toml",
        about: "configuration of the recorder",
        text: include_str!("../../../../docs/configuration.md"),
        see_also: &[
            "atvrec-init(1)",
            "atvrec-check(1)",
            "atvrec-record(1)",
            "atvrec-vehicle(5)",
            "atvrec-sensors(5)",
        ],
    },
    FilePage {
        name: "atvrec-vehicle",
        about: "vehicle file of the estimator",
        text: include_str!("../../../../docs/vehicle-file.md"),
        see_also: &[
            "atvrec-vehicle(1)",
            "atvrec-identify(1)",
            "atvrec.toml(5)",
            "atvrec-sensors(5)",
        ],
    },
    FilePage {
        name: "atvrec-sensors",
        about: "sensors file of the estimator",
        text: include_str!("../../../../docs/sensors-file.md"),
        see_also: &[
            "atvrec-sensors(1)",
            "atvrec-calibrate(1)",
            "atvrec.toml(5)",
            "atvrec-vehicle(5)",
        ],
    },
];

/// Runs the command.
pub fn run(args: &ManArgs) -> anyhow::Result<Outcome> {
    let directory = &args.directory;
    std::fs::create_dir_all(directory)
        .with_context(|| format!("cannot create the directory {}", directory.display()))?;
    let command = Cli::command().disable_help_subcommand(true);
    let help = command.get_after_help().map(ToString::to_string);
    let help = help.unwrap_or_default();
    // The sections below have its contents.
    let mut command = command.after_help(None);
    command.build();
    let mut pages = Vec::new();
    add_pages(command, &help, &mut pages)?;
    for file in &FILES {
        pages.push((format!("{}.5", file.name), file.page()));
    }
    // All targets are checked before the first page is written.
    let targets: Vec<Target> = pages
        .iter()
        .map(|(name, _)| {
            let path = directory.join(name);
            Target::new(&path, Kind::Manual, args.replace.force, [])
        })
        .collect::<engine::Result<_>>()?;
    for ((_, page), target) in pages.iter().zip(targets) {
        target.write_by(|mut file| Ok(file.write_all(page.as_bytes())?))?;
    }
    Ok(Outcome::Good)
}

impl FilePage {
    fn page(&self) -> String {
        let mut page = Roff::new();
        let version = format!("atvrec {}", env!("CARGO_PKG_VERSION"));
        page.control("TH", [self.name, "5", "", &version, ""]);
        page.control("SH", ["NAME"]);
        page.text([roman(format!("{} - {}", self.name, self.about))]);
        page.control("SH", ["DESCRIPTION"]);
        markdown::append(&mut page, self.text);
        page.control("SH", ["SEE ALSO"]);
        page.text([roman(self.see_also.join(", "))]);
        page.to_roff()
    }
}

/// Examples and exit status of the page of a command.
fn sections(called: &str, help: &str) -> String {
    let (examples, codes) = help.split_once("Exit codes:").unwrap_or_default();
    let of_help = |lines: &str| -> Vec<(String, String)> {
        let lines = lines
            .lines()
            .filter_map(|line| line.trim().split_once("  "));
        let entries = lines.map(|(term, meaning)| (term.to_owned(), meaning.trim().to_owned()));
        entries.collect()
    };
    let begins = |line: &str| {
        let rest = line.strip_prefix(called);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
    };
    let examples = match called {
        "atvrec" => of_help(examples),
        _ => EXAMPLES
            .iter()
            .filter(|(line, _)| begins(line))
            .map(|(line, meaning)| ((*line).to_owned(), (*meaning).to_owned()))
            .collect(),
    };
    let mut page = Roff::new();
    for (heading, entries) in [("EXAMPLES", examples), ("EXIT STATUS", of_help(codes))] {
        page.control("SH", [heading]);
        for (term, meaning) in entries {
            page.control("TP", []);
            page.text([bold(term)]);
            page.text([roman(meaning)]);
        }
    }
    page.to_roff()
}

/// Adds the pages of a command and of all its subcommands, each with its name.
fn add_pages(
    command: Command,
    help: &str,
    pages: &mut Vec<(String, String)>,
) -> anyhow::Result<()> {
    let below = command.get_subcommands().filter(|c| !c.is_hide_set());
    for command in below.cloned().collect::<Vec<_>>() {
        add_pages(command, help, pages)?;
    }
    let called = command.get_bin_name().unwrap_or("atvrec").to_owned();
    let man = Man::new(command);
    let mut page = Vec::new();
    man.render(&mut page)?;
    let text = String::from_utf8(page)? + &sections(&called, help);
    pages.push((man.get_filename(), text));
    Ok(())
}
