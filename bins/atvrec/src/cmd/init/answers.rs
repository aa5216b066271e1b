//! What a person decides: vehicle, sensors and storage, from options or from questions.

use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::cli::InitArgs;
use crate::cmd::files::{Files, SENSORS, VEHICLES};
use crate::exit::UsageError;

/// Default directory of the logs of a configuration in `directory`; the service can write to no other one.
pub fn storage(directory: &Path) -> &'static str {
    match super::is_of_service(directory) {
        true => "/var/lib/atvrec",
        false => "logs",
    }
}

/// The decisions.
#[derive(Debug, PartialEq, Eq)]
pub struct Answers {
    /// Name of a built-in file, or a path.
    pub vehicle: String,
    /// Name of a built-in file, or a path.
    pub sensors: String,
    /// Directory of the logs.
    pub storage: PathBuf,
}

/// Asks what the options do not say. `input` is `None` where nobody can answer.
pub fn ask(
    args: &InitArgs,
    mut input: Option<&mut dyn BufRead>,
    output: &mut dyn Write,
) -> anyhow::Result<Answers> {
    let vehicle = file(
        &VEHICLES,
        args.vehicle.as_deref(),
        input.as_deref_mut(),
        output,
    )?;
    let sensors = file(
        &SENSORS,
        args.sensors.as_deref(),
        input.as_deref_mut(),
        output,
    )?;
    let default = storage(&args.directory);
    let storage = match (&args.storage, input) {
        (Some(storage), _) => storage.clone(),
        (None, None) => PathBuf::from(default),
        (None, Some(input)) => {
            let question = format!("Directory of the logs [{default}]: ");
            let answer = answer(&question, input, output)?;
            PathBuf::from(if answer.is_empty() { default } else { &answer })
        }
    };
    Ok(Answers {
        vehicle,
        sensors,
        storage,
    })
}

/// A file of a kind: an option, an answer, or the default.
fn file(
    files: &Files,
    given: Option<&str>,
    input: Option<&mut (dyn BufRead + '_)>,
    output: &mut dyn Write,
) -> anyhow::Result<String> {
    let default = files.default;
    let (Some(input), None) = (input, given) else {
        let file = given.unwrap_or(default);
        files.check(file)?;
        return Ok(file.to_owned());
    };
    let kind = files.kind;
    writeln!(
        output,
        "Built-in {kind} files: {}",
        files.names().join(", ")
    )?;
    loop {
        let question = format!(
            "Name of a built-in {kind} file (a template is written), or path of your own [{default}]: "
        );
        let answer = answer(&question, input, output)?;
        let file = if answer.is_empty() { default } else { &answer };
        match files.check(file) {
            Ok(()) => return Ok(file.to_owned()),
            Err(error) => writeln!(output, "{error:#}")?,
        }
    }
}

fn answer(
    question: &str,
    input: &mut (dyn BufRead + '_),
    output: &mut dyn Write,
) -> anyhow::Result<String> {
    write!(output, "{question}")?;
    output.flush()?;
    let mut line = String::new();
    let read = input
        .read_line(&mut line)
        .context("cannot read the answer")?;
    if read == 0 {
        let text =
            "standard input ended before the last answer; use --yes for the defaults".to_owned();
        return Err(UsageError(text).into());
    }
    Ok(line.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    fn args(words: &[&str]) -> InitArgs {
        let all = ["atvrec", "init"].iter().chain(words);
        match Cli::parse_from(all).command {
            Command::Init(args) => args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn questions_are_asked_until_the_answer_is_a_file() {
        let mut input: &[u8] = b"prowlr\nprowler-chang\n\nrecords\n";
        let mut output = Vec::new();
        let answers = ask(&args(&[]), Some(&mut input), &mut output).expect("answers");
        let told = String::from_utf8(output).expect("text");
        assert_eq!(answers.vehicle, "prowler-chang");
        assert_eq!(answers.sensors, SENSORS.default);
        assert_eq!(answers.storage, PathBuf::from("records"));
        assert!(told.contains("prowlr is neither a file nor"), "{told}");
        assert!(told.contains("thesis-10bit-hub"), "{told}");
    }

    #[test]
    fn options_are_not_asked_for_and_an_end_of_input_is_an_error() {
        let words = [
            "--vehicle",
            "prowler",
            "--sensors",
            "thesis-10bit",
            "--storage",
            "s",
        ];
        let mut input: &[u8] = b"";
        let mut output = Vec::new();
        let answers = ask(&args(&words), Some(&mut input), &mut output).expect("answers");
        assert_eq!(answers.storage, PathBuf::from("s"));
        assert!(output.is_empty());
        let error = ask(&args(&[]), Some(&mut input), &mut output).expect_err("no answer");
        assert!(error.to_string().contains("--yes"), "{error}");
        let error = ask(&args(&["--vehicle", "prowlr"]), None, &mut output).expect_err("no file");
        assert!(error.to_string().contains("prowlr"), "{error}");
    }
}
