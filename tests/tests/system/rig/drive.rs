//! A whole virtual vehicle in a real kernel: CAN frames on SocketCAN, the rest on pseudo-terminals.

use std::process::Command;

use atvrec_tests::{atvrec, logs_in, project};

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
