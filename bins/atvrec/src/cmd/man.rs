//! `atvrec man`: write the manual pages.

use std::io::Write;

use anyhow::Context;
use clap::{Command, CommandFactory};
use clap_mangen::Man;

use crate::cli::{Cli, ManArgs};
use crate::exit::Outcome;
use engine::output::{Kind, Target};

/// Runs the command.
pub fn run(args: &ManArgs) -> anyhow::Result<Outcome> {
    let directory = &args.directory;
    std::fs::create_dir_all(directory)
        .with_context(|| format!("cannot create the directory {}", directory.display()))?;
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let help = command.get_after_help().map(ToString::to_string);
    let help = help.unwrap_or_default();
    let mut pages = Vec::new();
    add_pages(command, &mut pages);
    // All targets are checked before the first page is written.
    let targets: Vec<Target> = pages
        .iter()
        .map(|(_, page)| {
            let path = directory.join(page.get_filename());
            Target::new(&path, Kind::Manual, args.replace.force, [])
        })
        .collect::<engine::Result<_>>()?;
    for ((called, page), target) in pages.iter().zip(targets) {
        let more = sections(called, &help);
        target.write_by(|mut file| {
            page.render(&mut file)?;
            Ok(file.write_all(more.as_bytes())?)
        })?;
    }
    Ok(Outcome::Good)
}

/// Examples and exit status of the page of a command, from the help of the program. The page of the program
/// contains this help already.
fn sections(called: &str, help: &str) -> String {
    if called == "atvrec" {
        return String::new();
    }
    let (examples, codes) = help.split_once("Exit codes:").unwrap_or_default();
    let entries = |lines: &str, of: &str| -> String {
        let lines = lines.lines().map(str::trim);
        let lines = lines.filter(|line| !line.is_empty() && line.starts_with(of));
        let entry = |line: &str| {
            let (term, meaning) = line.split_once("  ").unwrap_or((line, ""));
            format!(
                ".TP\n\\fB{}\\fR\n{}\n",
                term.replace('-', "\\-"),
                meaning.trim()
            )
        };
        lines.map(entry).collect()
    };
    let (examples, codes) = (entries(examples, called), entries(codes, ""));
    let heading = |name: &str, text: &str| match text {
        "" => String::new(),
        text => format!(".SH \"{name}\"\n{text}"),
    };
    heading("EXAMPLES", &examples) + &heading("EXIT STATUS", &codes)
}

/// Adds the pages of a command and of all its subcommands, each with the words that call it.
fn add_pages(command: Command, pages: &mut Vec<(String, Man)>) {
    let below = command.get_subcommands().filter(|c| !c.is_hide_set());
    for command in below.cloned().collect::<Vec<_>>() {
        add_pages(command, pages);
    }
    let called = command.get_bin_name().unwrap_or("atvrec").to_owned();
    pages.push((called, Man::new(command)));
}
