//! `atvrec man`: write the manual pages.

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
    let mut pages = Vec::new();
    add_pages(command, &mut pages);
    // All targets are checked before the first page is written.
    let targets: Vec<Target> = pages
        .iter()
        .map(|page| {
            let path = directory.join(page.get_filename());
            Target::new(&path, Kind::Manual, args.replace.force, [])
        })
        .collect::<engine::Result<_>>()?;
    for (page, target) in pages.iter().zip(targets) {
        target.write_by(|mut file| Ok(page.render(&mut file)?))?;
    }
    Ok(Outcome::Good)
}

/// Adds the pages of a command and of all its subcommands.
fn add_pages(command: Command, pages: &mut Vec<Man>) {
    let below = command.get_subcommands().filter(|c| !c.is_hide_set());
    for command in below.cloned().collect::<Vec<_>>() {
        add_pages(command, pages);
    }
    pages.push(Man::new(command));
}
