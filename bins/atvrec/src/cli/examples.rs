//! Examples of all commands, for the manual pages.

/// A command line, and what it does. A page has the examples that begin with its command.
pub const EXAMPLES: [(&str, &str); 90] = [
    (
        "atvrec init",
        "find the devices, ask for the rest, write the files into this directory",
    ),
    (
        "atvrec init --yes --dbc car.dbc --vehicle prowler -d setup",
        "the same from a script, with the roles of a DBC file",
    ),
    ("atvrec record", "record with atvrec.toml until Ctrl-C"),
    (
        "atvrec record --config car.toml --for 600",
        "record for ten minutes",
    ),
    (
        "atvrec replay drive.mcap --verify",
        "repeat the estimate, compare bit by bit",
    ),
    (
        "atvrec replay drive.mcap -o again.mcap --smooth",
        "write a log with smoothed estimates",
    ),
    (
        "atvrec report drive.mcap -o drive.html",
        "write a page with figures and tables",
    ),
    ("atvrec events drive.mcap", "list the events"),
    (
        "atvrec events drive.mcap --snapshot events",
        "write the seconds around each event",
    ),
    (
        "atvrec cut drive.mcap --from 60 --to 90 -o turn.mcap",
        "write half a minute of a log as a log",
    ),
    (
        "atvrec cut drive.mcap --around lift -o lift.mcap",
        "write 5 s before and after the first lift",
    ),
    (
        "atvrec merge drive_0000.mcap drive_0001.mcap -o drive.mcap",
        "write the parts of a run as one log",
    ),
    (
        "atvrec merge car.mcap trailer.mcap --rename -o both.mcap",
        "merge the runs of two recorders by their log times",
    ),
    (
        "atvrec split drive.mcap --every 600 -o pieces",
        "write a log for each ten minutes",
    ),
    (
        "atvrec split drive.mcap --at-marks -o pieces",
        "write a log from each mark to the next one",
    ),
    (
        "atvrec score run.mcap --methods",
        "compare the estimates with the truth in the log",
    ),
    (
        "atvrec score a.mcap --against b.mcap",
        "compare the estimates of two logs",
    ),
    ("atvrec demo", "record, replay and report a virtual drive"),
    (
        "atvrec virtual --manoeuvre slow-sine --repeat",
        "a virtual vehicle on pseudo-terminals in virtual-ports",
    ),
    (
        "atvrec simulate --manoeuvre slow-sine -o sine.mcap",
        "write the data of a virtual drive to a log",
    ),
    (
        "atvrec export drive.mcap --raw candump -o drive.log",
        "write the CAN frames as candump does",
    ),
    (
        "atvrec export drive.mcap --raw bytes --source gnss -o gnss.bin",
        "write what the receiver sent",
    ),
    (
        "atvrec export drive.mcap --topic /estimate/tyre_forces -o forces.csv",
        "write the forces as a table",
    ),
    (
        "atvrec export drive.mcap --wide --rate 100 --method linear -o drive.parquet",
        "write all topics as one table at 100 Hz",
    ),
    (
        "atvrec export drive.mcap -o drive.mf4",
        "write all topics as channel groups of an MF4 file",
    ),
    (
        "atvrec export drive.mcap -o track.gpx",
        "write the positions of the receivers as tracks",
    ),
    (
        "atvrec export drive.mcap --ros2 -o bag",
        "write a folder with a ROS 2 bag",
    ),
    (
        "atvrec export monday.mcap tuesday.mcap --all -o dataset",
        "write all topics of two drives as a dataset of Parquet files",
    ),
    ("atvrec info drive.mcap", "show times, channels and losses"),
    ("atvrec check", "check atvrec.toml and the devices in it"),
    ("atvrec check car.toml --no-devices", "check the files only"),
    (
        "atvrec check car.toml --with minute.mcap",
        "compare the files with a recorded minute: signs, units, order of the wheels",
    ),
    (
        "atvrec calibrate cg-height scales.csv --vehicle vehicle.toml -o cg-height.toml",
        "height of the centre of gravity, from scales",
    ),
    (
        "atvrec calibrate member bench.csv --vehicle vehicle.toml --sensors sensors.toml --wheel FL \
         --member lower_front",
        "gains of the bridges of one member, from known loads on a bench",
    ),
    (
        "atvrec calibrate temperature morning.mcap noon.mcap",
        "drift of the strain bridges with temperature",
    ),
    (
        "atvrec calibrate zero hanging.mcap",
        "zero offsets, from a log with the wheels hanging free",
    ),
    (
        "atvrec calibrate weight a.mcap b.mcap c.mcap --scales 1600,1600,1700,1700 --scales \
         1700,1700,1800,1800 --scales 1800,1800,1900,1900",
        "springs, from three loads on four scales",
    ),
    (
        "atvrec calibrate steer plates.mcap",
        "steering maps, from a log on turn plates",
    ),
    (
        "atvrec calibrate load-rig pull.mcap",
        "gains of the strain bridges, from known forces",
    ),
    (
        "atvrec calibrate imu rest.mcap drive.mcap",
        "bias and misalignment of the inertial unit",
    ),
    (
        "atvrec calibrate gnss drive.mcap",
        "antenna positions and latencies",
    ),
    (
        "atvrec calibrate wheel-radius straight.mcap",
        "rolling radii",
    ),
    (
        "atvrec calibrate hub rest.mcap drive.mcap",
        "bias and axes of the hub accelerometers",
    ),
    (
        "atvrec recover logs",
        "recover the unfinished logs of a directory",
    ),
    (
        "atvrec identify understeer circle.mcap",
        "understeer gradient, from a slow sine or a circle",
    ),
    (
        "atvrec identify cornering sine.mcap -o cornering.toml",
        "cornering stiffness, as overrides for the vehicle file",
    ),
    (
        "atvrec identify friction brake.mcap",
        "friction, from braking or cornering at the limit",
    ),
    ("atvrec identify tyre sine.mcap", "curve of the tyre"),
    (
        "atvrec identify tyre soft.mcap --against hard.mcap --model fiala",
        "compare the tyres of two drives, at two pressures",
    ),
    (
        "atvrec identify slip brake.mcap",
        "longitudinal stiffness of the tyres, from a start and braking",
    ),
    (
        "atvrec identify camber turns.mcap",
        "camber stiffness of the tyres, from turns on even ground",
    ),
    (
        "atvrec identify aligning sine.mcap",
        "pneumatic trail of the tyres, from turns to both sides",
    ),
    (
        "atvrec identify toe turns.mcap -o toe.toml",
        "toe compliance and play of the front wheels, from sensors of their angles",
    ),
    (
        "atvrec identify roll-centre prowler",
        "roll centres, from the hard-points of a vehicle",
    ),
    (
        "atvrec identify roll-pitch rough.mcap",
        "roll and pitch stiffness",
    ),
    ("atvrec identify response step.mcap", "response to steering"),
    (
        "atvrec identify handling drive.mcap",
        "parameters of a passenger car",
    ),
    (
        "atvrec identify mistakes drive.mcap -o corrected.toml",
        "mistakes of the configuration",
    ),
    (
        "atvrec identify latency drive.mcap -o learnt.toml",
        "latencies of messages that the configuration does not know",
    ),
    (
        "atvrec identify inertia swing.mcap --pendulum compound --arm-m 1.2",
        "moment of inertia, from a pendulum test",
    ),
    (
        "atvrec mark \"payload driver on\"",
        "mark the running recording",
    ),
    ("atvrec status", "state of the running recorder"),
    ("atvrec live", "show the running recorder in a browser"),
    (
        "atvrec top --once",
        "print the state of the running recorder as a screen",
    ),
    (
        "atvrec start",
        "begin a recording now, also without a trigger",
    ),
    ("atvrec stop", "end the recording"),
    ("atvrec reload", "read the changed configuration again"),
    (
        "atvrec vehicle new -o vehicle.toml",
        "write a template with comments",
    ),
    ("atvrec vehicle show prowler", "print a built-in file"),
    (
        "atvrec vehicle check vehicle.toml",
        "find errors, and values that are far from usual",
    ),
    (
        "atvrec vehicle draw vehicle.toml -o vehicle.svg",
        "draw the hard-points",
    ),
    (
        "atvrec vehicle mass components.csv --vehicle vehicle.toml -o mass.toml",
        "mass, centre of gravity and inertia from a list",
    ),
    (
        "atvrec vehicle gauges vehicle.toml --sensors sensors.toml --load FL,0,1200,2400 -o stress.svg",
        "stress and strain at the gauges under a load",
    ),
    (
        "atvrec sensors new thesis-10bit-hub -o sensors.toml",
        "write a template with comments",
    ),
    ("atvrec sensors show", "list the built-in files"),
    ("atvrec sensors check sensors.toml", "find errors"),
    (
        "atvrec link can0 --config car.toml",
        "bring up one CAN interface with its bit rate",
    ),
    (
        "atvrec clock-state /run/clock",
        "write the state of the system clock",
    ),
    (
        "atvrec import csv drive.csv --columns map.toml -o drive.mcap",
        "make a log of a table",
    ),
    (
        "atvrec import alog drive.alog -o drive.mcap",
        "make a log of a MOOS log",
    ),
    (
        "atvrec import candump drive.log --dbc car.dbc -o drive.mcap",
        "make a log of a log of candump, decoded by a DBC file",
    ),
    (
        "atvrec import asc drive.asc -c atvrec.toml -o drive.mcap",
        "make a log of an ASC log, and estimate with the roles of a configuration",
    ),
    (
        "atvrec import trc bus1.trc bus2.trc -o drive.mcap",
        "make a log of the TRC logs of two buses",
    ),
    (
        "atvrec import blf drive.blf -o drive.mcap",
        "make a log of a BLF log, with raw frames only",
    ),
    (
        "atvrec import mf4 drive.mf4 --dbc can1=car.dbc -o drive.mcap",
        "make a log of an MF4 file, one of whose buses is decoded",
    ),
    (
        "atvrec import mf4 drive.mf4 --columns map.toml -o drive.mcap",
        "make a log of the measured signals of an MF4 file",
    ),
    (
        "atvrec import gnss rover.ubx -o drive.mcap",
        "make a log of what a GNSS receiver sent",
    ),
    (
        "atvrec import vehicle params.json -o vehicle.toml",
        "make a vehicle file of a simulator's parameters",
    ),
    (
        "atvrec completions bash",
        "print the completions of a shell",
    ),
    (
        "atvrec man pages",
        "write the manual pages into a directory",
    ),
];

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::cli::Cli;

    fn words(line: &str) -> Vec<String> {
        let mut quoted = false;
        let parts = line.split(|c| {
            quoted ^= c == '"';
            c == ' ' && !quoted
        });
        parts.map(|part| part.replace('"', "")).collect()
    }

    /// Only commands of this build are examined: some are not in every build.
    #[test]
    fn every_command_has_an_example_and_every_example_is_valid() {
        fn calls(command: &clap::Command, called: &str, all: &mut Vec<String>) {
            all.push(called.to_owned());
            for below in command.get_subcommands().filter(|c| c.get_name() != "help") {
                calls(below, &format!("{called} {}", below.get_name()), all);
            }
        }
        let mut all = Vec::new();
        calls(&Cli::command(), "atvrec", &mut all);
        for called in &all {
            let own = |(line, _): &&(&str, &str)| {
                (line.to_string() + " ").starts_with(&format!("{called} "))
            };
            assert!(EXAMPLES.iter().any(|e| own(&e)), "{called} has no example");
        }
        for (line, meaning) in EXAMPLES {
            assert!(!meaning.is_empty(), "{line}");
            let called = words(line)[1].clone();
            if all.contains(&format!("atvrec {called}")) {
                let parsed = Cli::try_parse_from(words(line));
                assert!(
                    parsed.is_ok(),
                    "{line}: {}",
                    parsed.err().map_or_else(String::new, |e| e.to_string())
                );
            }
        }
    }
}
