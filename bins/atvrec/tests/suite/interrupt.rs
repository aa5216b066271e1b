//! SIGINT during long work leaves no half file.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use sample::{ForceFrame, LogTime, Motion, PerWheel, TyreForce};
use store::{Options, Reader, Record, Stage, Writer};

use crate::support::{names, simulate};

/// Instants of the estimates and of the truth. The work on them takes much longer than a signal.
const INSTANTS: u32 = 60_000;
/// Longest time until a command listens to signals, and until it has ended.
const PATIENCE: Duration = Duration::from_secs(60);

/// A log of ten minutes of estimates and truth, with the configuration and the raw data of two seconds.
fn log(directory: &Path) {
    let drive = Reader::open([simulate(directory, "drive.mcap", 1)]).expect("a log");
    let session = store::Session {
        attachments: drive.attachments().expect("attachments"),
        ..drive.session().clone()
    };
    let path = directory.join("long.mcap");
    let mut writer = Writer::create(&path, session, Options::default(), 0).expect("a log");
    let start = drive.info().span.expect("messages").0;
    for arrival in drive.arrivals() {
        writer.push(arrival.expect("readable")).expect("written");
    }
    for step in 0..INSTANTS {
        let time = start.offset_seconds(f64::from(step) * 0.01);
        for stage in [Stage::Estimate, Stage::Truth] {
            for record in estimate(time, stage) {
                writer.record(&record);
            }
        }
        writer.flush_due(time).expect("written");
    }
    writer.finish().expect("closed");
    fs::remove_file(directory.join("drive.mcap")).expect("removed");
}

fn estimate(time: LogTime, stage: Stage) -> [Record; 3] {
    let forces = PerWheel(
        [TyreForce {
            force_n: [1.0, 2.0, 1_000.0],
            sigma_n: [1.0; 3],
            ..TyreForce::default()
        }; 4],
    );
    let of_frame = |frame| Record::TyreForces {
        time,
        stage,
        frame,
        forces: Box::new(forces),
    };
    [
        Record::Motion {
            time,
            stage,
            motion: Box::new(Motion {
                velocity_x_m_s: 10.0,
                ..Motion::default()
            }),
        },
        of_frame(ForceFrame::WheelCarrier),
        of_frame(ForceFrame::Contact),
    ]
}

/// Whether the process has a handler of SIGINT.
fn listens(pid: u32) -> bool {
    /// SIGINT is number 2, and the lowest bit is that of number 1.
    const SIGINT_BIT: u64 = 1 << 1;
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask & SIGINT_BIT != 0)
}

fn start(directory: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(arguments)
        .current_dir(directory)
        .env_remove("ATVREC_LOG")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts")
}

/// Sends a signal to a command.
fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([name, &child.id().to_string()])
        .status()
        .expect("kill");
    assert!(sent.success());
}

/// Runs a command, sends SIGINT as soon as it listens, and returns its exit code and what it wrote on
/// standard error.
fn interrupted(directory: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let child = start(directory, arguments);
    let begin = Instant::now();
    while !listens(child.id()) {
        assert!(
            begin.elapsed() < PATIENCE,
            "{arguments:?} does not listen to SIGINT"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    signal(&child, "-INT");
    let done = child.wait_with_output().expect("it ends");
    assert!(
        begin.elapsed() < PATIENCE,
        "{arguments:?} goes on after SIGINT"
    );
    let text = String::from_utf8_lossy(&done.stderr).into_owned();
    (done.status.code(), text)
}

#[test]
fn an_interrupted_command_says_so_and_leaves_no_file() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    log(here);
    let before = names(here);
    let commands: [&[&str]; 12] = [
        &[
            "export",
            "long.mcap",
            "--topic",
            "/estimate/tyre_forces",
            "-o",
            "forces.csv",
        ],
        &[
            "export",
            "long.mcap",
            "--topic",
            "/estimate/tyre_forces",
            "-o",
            "forces.parquet",
        ],
        &["export", "long.mcap", "--all", "-o", "dataset"],
        &["export", "long.mcap", "--wide", "-o", "wide.csv"],
        &["export", "long.mcap", "--ros2", "-o", "bag"],
        &["export", "long.mcap", "-o", "long.mf4"],
        &["replay", "long.mcap", "-o", "again.mcap"],
        &["report", "long.mcap", "-o", "report.html"],
        &["cut", "long.mcap", "--from", "1", "-o", "cut.mcap"],
        &["merge", "long.mcap", "-o", "merged.mcap"],
        &["score", "long.mcap"],
        &["score", "long.mcap", "--methods"],
    ];
    for arguments in commands {
        let (code, text) = interrupted(here, arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {text}");
        assert!(text.contains("interrupted"), "{arguments:?}: {text}");
        assert_eq!(names(here), before, "{arguments:?}");
    }
}

/// The pieces appear when the last one is complete. Before that, an interrupted command leaves nothing, and a
/// killed one leaves a hidden folder.
#[test]
fn a_split_that_does_not_end_leaves_no_piece() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    log(here);
    let before = names(here);
    let hidden = |name: &String| name.starts_with(".atvrec-partial-");
    for (name, rest) in [("-INT", 0), ("-KILL", 1)] {
        let split = ["split", "long.mcap", "--every", "0.5", "-o", "pieces"];
        let mut child = start(here, &split);
        let begin = Instant::now();
        let folder = here.join("pieces");
        // Two pieces are complete, and more than a thousand are not.
        let pieces = || {
            let partial = names(&folder).into_iter().find(hidden).unwrap_or_default();
            names(&folder.join(partial)).len()
        };
        while pieces() < 3 {
            assert!(begin.elapsed() < PATIENCE, "no piece appears");
            std::thread::sleep(Duration::from_millis(1));
        }
        signal(&child, name);
        let status = child.wait().expect("it ends");
        assert!(!status.success(), "it was complete before the signal");
        let left = names(&folder);
        assert!(left.len() == rest && left.iter().all(hidden), "{left:?}");
    }
    // What a killed command left does not prevent the next one.
    let split = ["split", "long.mcap", "--every", "300", "-o", "pieces"];
    assert!(start(here, &split).wait().expect("it ends").success());
    let pieces = names(&here.join("pieces"));
    assert_eq!(pieces.iter().filter(|name| !hidden(name)).count(), 2);
    assert_eq!(names(here).len(), before.len() + 1);
}
