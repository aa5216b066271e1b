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
    let frames = frames.map(|frame| (frame.clone(), frame.kernel_ns.expect("candump's stamp")));
    assert_output(&logs, &frames.collect::<Vec<_>>());
    assert_verified(&logs);
}

fn assert_verified(logs: &[PathBuf]) {
    let verified = Command::new(atvrec())
        .args(["replay", "--verify"])
        .args(logs)
        .current_dir(project())
        .status();
    assert!(
        verified.expect("the replay starts").success(),
        "the guest's log replays bit by bit on this machine"
    );
}

/// With `share = true`, the log has each frame of the interface once, in the order of the bus, the recorder's
/// own among them. Own frames are no data of the bus: without the vehicle, estimates end after 1 s, as on an
/// interface that is not shared.
#[test]
fn output_on_a_shared_interface_is_recorded_once_and_is_no_data() {
    let out = boot("share", &[]);
    let logs = logs_in(&out.join("logs"));
    let ours = recorded(&logs);
    let ours = without_errors(&ours["can0"]);
    let all = &seen_by_candump(&out.join("candump.log"))["vcan0"];
    // Two sockets can get frames that two programs send at the same time in different orders.
    let [own, of_vehicle] = [true, false].map(|is_own| {
        let of = |frame: &&CanFrame| is_output(frame) == is_own;
        let ours: Vec<CanFrame> = ours.iter().copied().filter(of).cloned().collect();
        let peer: Vec<CanFrame> = all.iter().filter(of).cloned().collect();
        assert_same(&peer, &ours);
        ours
    });
    assert!(own.iter().all(|frame| frame.flags.local_echo));
    let own = own
        .iter()
        .map(|frame| (frame.clone(), frame.kernel_ns.expect("a stamp")));
    assert_output(&logs, &own.collect::<Vec<_>>());

    let reports = atvrec_tests::health_reports(&logs);
    let last = reports.last().expect("a report");
    let bus = last.sources.iter().find(|source| source.name == "can0");
    let bus = bus.expect("the bus");
    assert_eq!(
        bus.messages,
        of_vehicle.len() as u64,
        "own frames do not count"
    );
    assert!(bus.silent, "the bus is silent after the drive");
    let reader = Reader::open(&logs).expect("a log");
    let last_estimate = reader.estimates().last().expect("estimates").expect("read");
    let silence_s = last.time.seconds_since(last_estimate.time);
    assert!(
        silence_s > 1.0,
        "estimates end after the drive: {silence_s}"
    );
    assert_verified(&logs);
}

/// Candump was there before the recorder and ended after it.
fn assert_same(peer: &[CanFrame], ours: &[CanFrame]) {
    let key = |frame: &CanFrame| (frame.id, frame.kernel_ns.map(|ns| ns / 1000));
    let begin = peer.iter().position(|frame| key(frame) == key(&ours[0]));
    let peer = &peer[begin.expect("the first frame of the log")..];
    assert!(peer.len() >= ours.len(), "{} {}", peer.len(), ours.len());
    for (index, (seen, recorded)) in peer.iter().zip(ours).enumerate() {
        assert_eq!(key(recorded), key(seen), "frame {index}");
        assert_eq!(recorded.bytes(), seen.bytes(), "frame {index}");
    }
}

/// Whether a frame is one of the recorder.
fn is_output(frame: &CanFrame) -> bool {
    (0x500..0x500 + FRAMES as u32).contains(&frame.id)
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
