//! Power cuts: the machine is killed while the recorder writes to a disk, and boots again.
#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it cuts the power at known times, as often as the environment says"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use atvrec_tests::rig::{boot, new_output_folder};
use atvrec_tests::{logs_in, project};
use sample::Payload;
use store::Reader;

/// Most that a cut may cost.
const LOSS_MAX_S: f64 = 1.0;

fn wait_for(what: &str, patience: Duration, mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < patience, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Boots, cuts the power `after` the recording began, and gives what the guest's wall clock last
/// said before, ns, and how often it spoke, s.
fn cut(out: &Path, image: &str, after: Duration) -> (i64, f64) {
    let (alive, signal) = (out.join("alive"), out.join("cut"));
    let _ = std::fs::remove_file(&alive);
    let _ = std::fs::remove_file(&signal);
    let signal_path = signal.display().to_string();
    std::thread::scope(|scope| {
        let options = ["--disk", image, "--cut", &signal_path];
        let machine = scope.spawn(move || boot("powercut", &options));
        wait_for("the recording", Duration::from_secs(250), || {
            assert!(!machine.is_finished(), "the guest ended by itself");
            alive.exists()
        });
        std::thread::sleep(after);
        std::fs::write(&signal, "").expect("written");
        machine.join().expect("the rig ends");
    });
    let text = std::fs::read_to_string(&alive).expect("the guest's clock");
    let whole = text.rsplit_once('\n').expect("a line").0;
    let clock = whole.lines().map(|line| line.parse().expect("nanoseconds"));
    let clock: Vec<i64> = clock.collect();
    let (first, last) = (clock[0], clock[clock.len() - 1]);
    let every_s = (last - first) as f64 * 1e-9 / clock.len() as f64;
    (last, every_s)
}

/// Files of each run, in order.
fn runs(logs: &[PathBuf]) -> Vec<Vec<PathBuf>> {
    let mut runs: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for log in logs {
        let name = log.file_name().expect("a name").to_string_lossy();
        let stem = name.rsplit_once('_').expect("a part number").0;
        runs.entry(stem.to_owned()).or_default().push(log.clone());
    }
    runs.into_values().collect()
}

/// The wall clock of a run's last arrival, ns; its frames count without a gap.
fn end_of(run: &[PathBuf]) -> i64 {
    let reader = Reader::open(run).expect("the run opens");
    let (mut next, mut last) = (None, 0);
    for arrival in reader.arrivals() {
        let arrival = arrival.expect("readable");
        last = arrival.realtime_ns;
        let Payload::Can(frames) = arrival.payload else {
            continue;
        };
        for frame in frames.iter().filter(|frame| !frame.flags.error) {
            let count = u64::from_le_bytes(frame.bytes().try_into().expect("eight bytes"));
            assert!(next.is_none_or(|next| next == count), "{next:?} {count}");
            next = Some(count + 1);
        }
    }
    assert!(next > Some(100), "{next:?} frames in {run:?}");
    last
}

/// The reference reader opens every file and reads through it.
fn reference_reader_takes(logs: &[PathBuf]) {
    let python = project().join("target/venv/bin/python");
    if !python.exists() {
        println!("NOT CHECKED with the reference reader: `make venv` makes its environment");
        return;
    }
    let program = "import sys\n\
        from mcap.reader import make_reader\n\
        for path in sys.argv[1:]:\n    \
            with open(path, 'rb') as file:\n        \
                reader = make_reader(file, validate_crcs=True)\n        \
                assert reader.get_summary() is not None, path\n        \
                sum(1 for _ in reader.iter_messages())\n";
    let status = Command::new(python)
        .args(["-c", program])
        .args(logs)
        .status()
        .expect("Python runs");
    assert!(status.success(), "the reference reader refuses a log");
}

fn power_cuts(count: u64) {
    let out = new_output_folder("powercut");
    let image = out.join("disk.img");
    let file = std::fs::File::create(&image).expect("an image");
    file.set_len(128 << 20).expect("an image");
    let made = Command::new("mkfs.ext4")
        .args(["-q", "-F"])
        .arg(&image)
        .status()
        .expect("mkfs.ext4 runs");
    assert!(made.success());
    let image = image.display().to_string();
    let clocks: Vec<(i64, f64)> = (0..count)
        .map(|n| {
            let after = Duration::from_millis(2_500 + n * 2_617 % 4_000);
            cut(&out, &image, after)
        })
        .collect();
    std::fs::write(out.join("last"), "").expect("written");
    boot("powercut", &["--disk", &image]);

    let left = logs_in(&out.join("logs"));
    assert!(
        left.iter()
            .all(|log| log.extension().is_some_and(|end| end == "mcap")),
        "{left:?}"
    );
    let runs = runs(&left);
    assert_eq!(runs.len() as u64, count + 1, "{runs:?}");
    reference_reader_takes(&left);
    let mut losses: Vec<f64> = clocks
        .iter()
        .zip(&runs)
        .map(|((clock, _), run)| (clock - end_of(run)) as f64 * 1e-9)
        .collect();
    let every: Vec<f64> = clocks.iter().map(|(_, every_s)| *every_s).collect();
    println!("lost at each cut, s: {losses:.3?}; the guest's clock was read every {every:.3?}");
    losses.sort_by(f64::total_cmp);
    println!(
        "median {:.3} s, greatest {:.3} s",
        losses[losses.len() / 2],
        losses[losses.len() - 1]
    );
    assert!(losses.iter().all(|loss| *loss <= LOSS_MAX_S), "{losses:?}");
}

#[test]
fn two_power_cuts_cost_at_most_a_second_each() {
    power_cuts(2);
}

#[test]
#[ignore = "twenty boots: `make rig-full` (ATVREC_CUTS: how many)"]
fn twenty_power_cuts_cost_at_most_a_second_each() {
    let count = std::env::var("ATVREC_CUTS").map_or(20, |count| count.parse().expect("a number"));
    power_cuts(count);
}
