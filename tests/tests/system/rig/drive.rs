//! A whole virtual vehicle in a real kernel: CAN frames on SocketCAN, the rest on pseudo-terminals.

use std::path::PathBuf;
use std::process::Command;

use atvrec_tests::{atvrec, logs_in, project};
use sample::CanFrame;
use store::Reader;
use testkit::controllers::assert_frames;
use wire::output::FRAMES;

use super::{boot, recorded, seen_by_candump, without_errors};

#[test]
fn a_drive_on_socketcan_is_recorded_frame_by_frame_and_replays_here() {
    let out = boot("virtual", &[]);
    // The same drive with the same seed, straight into a log: what must have been sent.
    let made = out.join("made.mcap");
    let status = Command::new(atvrec())
        .args(["-q", "simulate", "--manoeuvre", "step-steer", "--seed", "5"])
        .args(["--for", "6", "--force", "-o"])
        .arg(&made)
        .status();
    assert!(status.expect("the simulation starts").success());
    let sent = recorded(&[made]);
    let logs = logs_in(&out.join("logs"));
    let (ours, peer) = (recorded(&logs), seen_by_candump(&out.join("candump.log")));
    let (sent, ours) = (&sent["can0"], without_errors(&ours["can0"]));
    assert_eq!(peer["vcan0"].len(), sent.len(), "candump saw all frames");
    assert_eq!(ours.len(), sent.len(), "the log has all frames");
    for (index, (sent, recorded)) in sent.iter().zip(&ours).enumerate() {
        assert_eq!(recorded.id, sent.id, "frame {index}");
        assert_eq!(recorded.bytes(), sent.bytes(), "frame {index}");
        assert!(recorded.kernel_ns.is_some(), "frame {index}");
    }
    let frames = peer["vcan1"].iter();
    let frames = frames.map(|frame| (*frame, frame.kernel_ns.expect("candump's stamp")));
    assert_output(&logs, &frames.collect::<Vec<_>>());
    let verified = Command::new(atvrec())
        .args(["replay", "--verify"])
        .args(&logs)
        .current_dir(project())
        .status();
    assert!(
        verified.expect("the replay starts").success(),
        "the guest's log replays bit by bit on this machine"
    );
}

/// The frames of `output.can` on SocketCAN are the estimates of the log. The emulated processor is slow,
/// so that few or no estimates are young enough to be sent, and most sets are stale.
fn assert_output(logs: &[PathBuf], frames: &[(CanFrame, i64)]) {
    let reader = Reader::open(logs).expect("a log");
    let estimates = reader.estimates().collect::<Result<Vec<_>, _>>();
    let first = reader.arrivals().next().expect("an arrival").expect("read");
    let realtime_less_log_ns = first.realtime_ns - first.log_time.0 as i64;
    // Candump begins in the midst of a set, and may end in one.
    let begin = frames.iter().position(|(frame, _)| frame.id == 0x500);
    let whole = &frames[begin.expect("a first frame")..];
    let whole = &whole[..whole.len() - whole.len() % FRAMES];
    let sets = assert_frames(whole, &estimates.expect("estimates"), realtime_less_log_ns);
    println!("{sets:?}");
    assert!(sets.valid + sets.stale > 100, "{sets:?}");
}
