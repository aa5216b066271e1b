//! The recorder as a service of a real Linux: installed, hardened, watched, reloaded, killed.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use atvrec_tests::rig::{boot, install_folder, new_output_folder};
use atvrec_tests::{atvrec, logs_in};
use sample::Payload;
use store::Reader;

/// Highest exposure by `systemd-analyze security`: of the recorder and of the units that end at once, and of
/// the live process.
const EXPOSURE_MAX: f64 = 1.5;
/// See [`EXPOSURE_MAX`].
const LIVE_EXPOSURE_MAX: f64 = 2.0;

pub struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The inertial unit of a virtual vehicle, which drives until this is dropped.
pub fn inertial_unit(folder: &Path) -> (Running, PathBuf) {
    let ports = folder.join("ports");
    let vehicle = Command::new(atvrec())
        .args(["virtual", "--manoeuvre", "slow-sine", "--repeat", "-q"])
        .arg("--directory")
        .arg(&ports)
        .stdout(Stdio::null())
        .spawn()
        .expect("the virtual vehicle starts");
    let vehicle = Running(vehicle);
    let port = ports.join("imu");
    for _ in 0..200 {
        if port.exists() {
            return (vehicle, port);
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    panic!("{} did not appear", port.display());
}

fn verify(log: &Path) {
    let verified = Command::new(atvrec())
        .args(["replay", "--verify"])
        .arg(log)
        .status()
        .expect("replay starts");
    assert!(verified.success(), "{}", log.display());
}

/// First bytes of the data frames of a source, over several logs: `cangen -D i` counts in them.
fn counts(logs: &[PathBuf], name: &str) -> Vec<u64> {
    let mut counts = Vec::new();
    for log in logs {
        let reader = Reader::open([log]).expect("the log opens");
        assert_eq!(reader.info().missing, [], "{}", log.display());
        for arrival in reader.arrivals() {
            let arrival = arrival.expect("readable");
            if reader.session().source_name(arrival.source) != name {
                continue;
            }
            if let Payload::Can(frames) = arrival.payload {
                let data = frames.iter().filter(|frame| !frame.flags.error);
                counts.extend(data.map(|frame| {
                    let bytes: [u8; 8] = frame.bytes().try_into().expect("eight bytes");
                    u64::from_le_bytes(bytes)
                }));
            }
        }
    }
    counts
}

#[test]
fn the_service_records_reloads_survives_and_stops() {
    let out = new_output_folder("service");
    install_folder(&out);
    let (_vehicle, imu) = inertial_unit(&out);
    let imu = imu.display().to_string();
    let options = ["--init", "systemd", "--timeout", "900", "--uart", &imu];
    boot("service", &options);

    for (unit, most) in [
        ("atvrec.service", EXPOSURE_MAX),
        ("atvrec-clock.service", EXPOSURE_MAX),
        ("atvrec-can@can1.service", EXPOSURE_MAX),
        ("atvrec-live.service", LIVE_EXPOSURE_MAX),
    ] {
        let text = std::fs::read_to_string(out.join(format!("security.{unit}"))).expect("told");
        let score = text
            .lines()
            .find_map(|line| {
                line.split_once("Overall exposure level for")?
                    .1
                    .split_once(": ")
            })
            .and_then(|(_, score)| score.split_whitespace().next()?.parse::<f64>().ok())
            .unwrap_or_else(|| panic!("no score in {text}"));
        println!("{unit}: exposure {score}");
        assert!(score <= most, "{unit}: {text}");
    }
    let page = std::fs::read_to_string(out.join("page")).expect("an answer");
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    // Each log is of one configuration; together they hold every frame once.
    let logs = logs_in(&out.join("orderly"));
    assert_eq!(logs.len(), 2, "{logs:?}");
    for log in &logs {
        let summary = store::Summary::read(log)
            .expect("a log")
            .expect("a summary");
        assert_ne!(summary.session.clock, store::ClockState::Unknown, "{log:?}");
    }
    assert_eq!(counts(&logs, "middle"), (0..3000).collect::<Vec<_>>());
    assert_eq!(counts(&logs, "wire"), (0..100).collect::<Vec<_>>());
    let imu_bytes: usize = logs
        .iter()
        .flat_map(|log| {
            let reader = Reader::open([log]).expect("the log opens");
            let id = |a: &sample::Arrival| reader.session().source_name(a.source);
            let arrivals = reader.arrivals().map(|a| a.expect("readable"));
            arrivals
                .filter(|a| id(a) == "imu")
                .map(|a| match a.payload {
                    Payload::Bytes(bytes) => bytes.len(),
                    _ => 0,
                })
                .collect::<Vec<_>>()
        })
        .sum();
    assert!(imu_bytes > 1000, "{imu_bytes} bytes through the UART");
    logs.iter().for_each(|log| verify(log));
    logs_in(&out.join("recovered"))
        .iter()
        .for_each(|log| verify(log));

    let journal = std::fs::read_to_string(out.join("journal")).expect("the journal");
    assert!(journal.contains("recovered an unfinished log"));
    let line = journal
        .lines()
        .find(|line| line.contains("recovered an unfinished log"))
        .expect("a line");
    assert!(line.contains("\"PRIORITY\":\"4\""), "{line}");
    assert!(
        line.contains("\"MESSAGE\":\"recovered an unfinished"),
        "neither time nor level stand in the text: {line}"
    );
}
