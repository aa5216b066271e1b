//! `atvrec init`: find the devices and write a configuration for them.

mod answers;
mod devices;
mod sources;

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use acq::FoundInterface;
use anyhow::Context;
use engine::Config;
use engine::output::{Kind, Target};
use sample::text::printable;

use crate::cli::InitArgs;
use crate::cmd::control::SERVICE_CONFIG;
use crate::cmd::files::{Files, SENSORS, VEHICLES};
use crate::exit::{Outcome, UsageError};
use answers::Answers;
use sources::Planned;

const CONFIG: &str = "atvrec.toml";

const HEADER: &str = "\
# Configuration of the recorder, written by `atvrec init`. `atvrec check` finds errors and listens to each
# device. The manual page atvrec.toml(5) describes every field.
";

/// Runs the command.
pub fn run(args: &InitArgs) -> anyhow::Result<Outcome> {
    let directory = &args.directory;
    // Everything that can be wrong without a device is found before a device is opened.
    let interactive = !args.yes && std::io::stdin().is_terminal();
    if !args.yes && !interactive && (args.vehicle.is_none() || args.sensors.is_none()) {
        return Err(UsageError(
            "standard input is not a terminal, so nobody can answer; use --yes for the defaults, or give \
             --vehicle and --sensors"
                .to_owned(),
        )
        .into());
    }
    for (files, file) in [(&VEHICLES, &args.vehicle), (&SENSORS, &args.sensors)] {
        file.as_ref().map_or(Ok(()), |file| files.check(file))?;
    }
    let dbc = sources::read_dbc(&args.dbc, directory)?;
    std::fs::create_dir_all(directory)
        .with_context(|| format!("cannot create the directory {}", directory.display()))?;
    let inputs = inputs(args);
    let target = |name: &str| {
        let inputs = inputs.iter().map(PathBuf::as_path);
        Target::new(
            &directory.join(name),
            Kind::Toml,
            args.replace.force,
            inputs,
        )
    };
    let config = target(CONFIG)?;
    for (files, file) in [(&VEHICLES, &args.vehicle), (&SENSORS, &args.sensors)] {
        if file.as_ref().is_none_or(|file| files.is_builtin(file)) {
            target(&files.file_name())?;
        }
    }

    let planned = find(args, &dbc)?;
    if planned.iter().all(|one| !one.is_source()) && !interactive && !args.yes {
        println!("nothing is written; with --yes, a template is written all the same");
        return Ok(Outcome::Failed);
    }
    let answers = match interactive {
        true => answers::ask(
            args,
            Some(&mut std::io::stdin().lock()),
            &mut std::io::stdout(),
        )?,
        false => answers::ask(args, None, &mut std::io::sink())?,
    };
    let mut written = Vec::new();
    let mut own = |files: &Files, file: &str| -> anyhow::Result<String> {
        if !files.is_builtin(file) {
            return sources::named_from(directory, Path::new(file));
        }
        let target = target(&files.file_name())?;
        target.write(&files.template(file)?)?;
        written.push(target.path().to_owned());
        Ok(files.file_name())
    };
    let vehicle = own(&VEHICLES, &answers.vehicle)?;
    let sensors = own(&SENSORS, &answers.sensors)?;
    let text = text(&planned, &vehicle, &sensors, &answers, directory);
    Config::from_text(&text, directory)?;
    config.write(&text)?;
    written.insert(0, config.path().to_owned());
    tell(&written, directory);
    Ok(Outcome::Good)
}

/// Files that the command reads.
fn inputs(args: &InitArgs) -> Vec<PathBuf> {
    let named = [&args.vehicle, &args.sensors].into_iter().flatten();
    named
        .map(PathBuf::from)
        .chain(args.dbc.iter().cloned())
        .collect()
}

/// Finds the devices, listens to them, and prints what they send.
fn find(args: &InitArgs, dbc: &[sources::DbcFile]) -> anyhow::Result<Vec<Planned>> {
    let is_named = !args.ports.is_empty() || !args.can.is_empty();
    let interfaces = match is_named {
        true => args.can.iter().map(|name| named_interface(name)).collect(),
        false => acq::can_interfaces().context("cannot list the network interfaces")?,
    };
    let ports = match is_named {
        true => {
            let absolute = |path: &PathBuf| Ok((std::path::absolute(path)?, String::new()));
            args.ports
                .iter()
                .map(absolute)
                .collect::<anyhow::Result<_>>()?
        }
        false => {
            let found = acq::serial_ports().context("cannot list the serial ports")?;
            let named = found.into_iter().map(|port| (port.path, port.driver));
            named.collect::<Vec<_>>()
        }
    };
    println!(
        "{} CAN interfaces and {} serial ports; listening ...",
        interfaces.len(),
        ports.len()
    );
    let interfaces = devices::interfaces(interfaces, args.listen_s)?;
    let ports = devices::ports(ports, args.bitrate, args.listen_s)?;
    let planned = sources::plan(interfaces, ports, dbc, args)?;
    for one in &planned {
        for (number, line) in one.told.iter().enumerate() {
            println!(
                "{}{}",
                if number == 0 { "  " } else { "      " },
                printable(line)
            );
        }
        let [clear, doubtful, silent] = one.roles();
        if clear + doubtful + silent > 0 {
            let more = match silent {
                0 => String::new(),
                silent => format!(", {silent} of messages that did not arrive"),
            };
            println!("      roles of signals: {clear} clear, {doubtful} to be decided{more}");
        }
    }
    if planned.iter().all(|one| !one.is_source()) {
        println!(
            "no device sends data that this program decodes. Connect a device and run `atvrec init` again, \
             or try the program without hardware: atvrec demo"
        );
    }
    Ok(planned)
}

/// An interface by its name; if the computer has none of this name, it is down.
fn named_interface(name: &str) -> FoundInterface {
    acq::can_interface(name).unwrap_or_else(|| FoundInterface {
        name: name.to_owned(),
        driver: "not found".to_owned(),
        is_up: false,
        bit_rate: None,
    })
}

fn text(
    planned: &[Planned],
    vehicle: &str,
    sensors: &str,
    answers: &Answers,
    directory: &Path,
) -> String {
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let mut text = HEADER.to_owned();
    for one in planned {
        text.push('\n');
        text.push_str(&one.text());
    }
    if planned.iter().all(|one| !one.is_source()) {
        text.push_str(NO_SOURCE);
    }
    let _ = write!(
        text,
        "\n# The vehicle and its sensors. `atvrec vehicle check` and `atvrec sensors check` check these files.\n\
         [vehicle]\nfile = {}\nsensors = {}\n\
         # The steps of `atvrec calibrate` write a calibration file.\n# calibration = \"calibration.toml\"\n\n\
         [storage]\ndirectory = {}\n\
         # Without a limit, no log is removed. With a limit, the oldest drives are removed first (MiB).\n\
         # quota_mb = 50000\n# keep_free_mb = 1024\n",
        quoted(vehicle),
        quoted(sensors),
        quoted(&answers.storage.display().to_string()),
    );
    text.push_str(match is_of_service(directory) {
        true => SERVICE_CONTROL,
        false => CONTROL,
    });
    text
}

/// Whether the configuration in `directory` is that of the service.
fn is_of_service(directory: &Path) -> bool {
    let config = std::path::absolute(directory.join(CONFIG));
    config.is_ok_and(|config| config == Path::new(SERVICE_CONFIG))
}

/// Control socket of the service, in the directory that its unit makes.
const SERVICE_CONTROL: &str = r#"
# Socket of `atvrec mark`, `status`, `start`, `stop` and `reload`, in the directory that atvrec.service makes.
[control]
socket = "/run/atvrec/control"
"#;

const CONTROL: &str = r#"
# Socket of `atvrec mark`, `status`, `start`, `stop` and `reload`. Without this table, the recorder chooses one.
# [control]
# The service makes the directory of this one:
# socket = "/run/atvrec/control"
"#;

const NO_SOURCE: &str = r#"
# No device was found. Remove the # of the sources that you have, and correct their devices.
# [source.can0]
# kind = "can"
# interface = "can0"
# dbc = ["my-vehicle.dbc"]

# [source.gnss]
# kind = "gnss"
# device = "/dev/serial/by-id/..."
# baud = 115200
"#;

fn tell(written: &[PathBuf], directory: &Path) {
    for path in written {
        println!("written: {}", path.display());
    }
    let config = directory.join(CONFIG);
    let config = match directory == Path::new(".") {
        true => String::new(),
        false => format!(" --config {}", config.display()),
    };
    println!(
        "next: replace the values of the templates with those of your vehicle and sensors, then\n  \
         atvrec check{config}\n  atvrec record{config}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The configuration of the service has the control socket of its unit; another one shows it.
    #[test]
    fn the_configuration_of_the_service_has_the_socket_of_its_unit() {
        let of = |directory: &str| {
            let answers = Answers {
                vehicle: String::new(),
                sensors: String::new(),
                storage: answers::storage(Path::new(directory)).into(),
            };
            let directory = Path::new(directory);
            let text = text(&[], "prowler", "thesis-10bit", &answers, directory);
            let config = Config::from_text(&text, directory).expect("a configuration");
            (config.control, config.storage.directory)
        };
        let (socket, storage) = of("/etc/atvrec");
        assert_eq!(socket, Some(PathBuf::from("/run/atvrec/control")));
        assert_eq!(storage, Path::new("/var/lib/atvrec"));
        let (socket, storage) = of("/home/me/buggy");
        assert_eq!(socket, None);
        assert_eq!(storage, Path::new("logs"));
    }
}
