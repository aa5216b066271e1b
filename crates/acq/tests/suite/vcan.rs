//! SocketCAN sources on the kernel's virtual CAN, and on a pair of real controllers on one bus
//! where there is one (`can0` and `can1`). Run as root, or in `unshare -rn`, on a kernel with
//! `vcan`; elsewhere the tests say that they are skipped.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use atvrec_acq::{
    CanFilter, CanSpec, LinkSpec, LogClock, QueueSizes, Sequencer, SourceKind, SourceSpec, Streams,
    Supervisor,
};
use sample::{Arrival, CanFlags, CanFrame, LossPlace, Notice, Payload, SourceId};
use socketcan::{
    CanDataFrame, CanFdFrame, CanFdSocket, CanInterface, CanSocket, EmbeddedFrame, ExtendedId,
    Socket, StandardId,
};

const BUS: SourceId = SourceId(0);
/// Only ever waited for in full when something is broken.
const PATIENCE: Duration = Duration::from_secs(60);
/// An interface without a bit rate.
const VIRTUAL: LinkSpec = LinkSpec {
    bit_rate: None,
    data_bit_rate: None,
    restart_ms: 0,
    listen_only: false,
};

/// A new interface, up, that takes FD frames; `None`, loudly, where there is no vcan.
fn interface(name: &str) -> Option<CanInterface> {
    let link = match CanInterface::create_vcan(name, None) {
        Ok(link) => link,
        Err(error) => {
            testkit::report(&format!("left out, cannot make {name}: {error}"));
            return None;
        }
    };
    link.set_mtu(socketcan::nl::Mtu::Fd).expect("an MTU for FD");
    link.bring_up().expect("the interface goes up");
    Some(link)
}

fn start(spec: CanSpec) -> (Supervisor, Sequencer, Streams) {
    let (sequencer, streams) = Sequencer::new(LogClock::start(), QueueSizes::default());
    let mut supervisor = Supervisor::new(sequencer.clone());
    supervisor.spawn(SourceSpec {
        id: BUS,
        name: "bus".to_owned(),
        kind: SourceKind::Can(spec),
    });
    (supervisor, sequencer, streams)
}

async fn next(streams: &mut Streams) -> Arc<Arrival> {
    tokio::time::timeout(PATIENCE, streams.recorder.recv())
        .await
        .expect("an arrival in time")
        .expect("an open stream")
}

async fn until(streams: &mut Streams, wanted: impl Fn(&Notice) -> bool) {
    loop {
        if let Payload::Notice(notice) = &next(streams).await.payload
            && wanted(notice)
        {
            return;
        }
    }
}

fn is_opened(notice: &Notice) -> bool {
    matches!(notice, Notice::Opened(_))
}

fn is_closed(notice: &Notice) -> bool {
    matches!(notice, Notice::Closed(_))
}

/// Frame number `index`: every kind in turn.
fn frame(index: u32) -> CanFdFrame {
    let data = index.to_be_bytes();
    let standard = StandardId::new((index % 0x800) as u16).expect("11 bits");
    let extended = ExtendedId::new(0x1000_0000 + index).expect("29 bits");
    if index.is_multiple_of(2) {
        CanFdFrame::new(standard, &data).expect("data fits")
    } else {
        CanFdFrame::new(extended, &data.repeat(16)).expect("data fits")
    }
}

fn send(name: &str, count: u32) {
    let socket = CanFdSocket::open(name).expect("a socket");
    for index in 0..count {
        let frame = frame(index);
        socket
            .write_frame_insist(&frame)
            .expect("the bus takes frames");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_frame_arrives_in_order_with_kernel_stamps() {
    const COUNT: u32 = 20_000;
    let Some(link) = interface("vcanacq0") else {
        return;
    };
    let (supervisor, sequencer, mut streams) = start(CanSpec {
        receive_buffer_bytes: 64 << 20,
        ..CanSpec::new("vcanacq0")
    });
    until(&mut streams, is_opened).await;
    std::thread::spawn(|| send("vcanacq0", COUNT));
    let mut received: Vec<CanFrame> = Vec::new();
    while received.len() < COUNT as usize {
        match &next(&mut streams).await.payload {
            Payload::Can(frames) => received.extend_from_slice(frames),
            Payload::Notice(Notice::Lost { place, count }) => panic!("{count} lost: {place:?}"),
            _ => {}
        }
    }
    let mut last_ns = 0;
    for (index, got) in received.iter().enumerate() {
        let index = index as u32;
        assert_eq!(got.data[..4], index.to_be_bytes());
        let expected = CanFlags {
            extended: index % 2 == 1,
            fd: true,
            local_echo: true,
            bit_rate_switch: got.flags.bit_rate_switch,
            ..CanFlags::default()
        };
        assert_eq!(got.flags, expected);
        let stamp = got.kernel_ns.expect("a kernel stamp");
        assert!(stamp >= last_ns);
        last_ns = stamp;
    }
    assert_eq!(sequencer.counters()[&BUS].items, u64::from(COUNT));
    supervisor.stop(PATIENCE).await.expect("the source stops");
    link.delete().map_err(|(_, error)| error).expect("deleted");
}

#[tokio::test]
async fn frames_sent_are_frames_received_plus_frames_lost() {
    const COUNT: u32 = 20_000;
    let Some(link) = interface("vcanacq1") else {
        return;
    };
    let (supervisor, sequencer, mut streams) = start(CanSpec {
        receive_buffer_bytes: 64 << 10,
        ..CanSpec::new("vcanacq1")
    });
    until(&mut streams, is_opened).await;
    // On the only thread of this runtime: the source cannot read meanwhile.
    send("vcanacq1", COUNT);
    supervisor.stop(PATIENCE).await.expect("the source stops");
    let counters = sequencer.counters()[&BUS].clone();
    let lost = sequencer.ledger().losses().of(BUS)[LossPlace::Kernel as usize];
    assert!(lost > 0);
    assert_eq!(counters.items + lost, u64::from(COUNT));
    link.delete().map_err(|(_, error)| error).expect("deleted");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_interface_that_goes_down_or_away_comes_back() {
    const NAME: &str = "vcanacq2";
    let Some(link) = interface(NAME) else {
        return;
    };
    let (supervisor, _sequencer, mut streams) = start(CanSpec::new(NAME));
    until(&mut streams, is_opened).await;
    link.bring_down().expect("the interface goes down");
    until(&mut streams, is_closed).await;
    link.bring_up().expect("the interface goes up");
    send(NAME, 1);
    until(&mut streams, is_opened).await;
    assert!(matches!(next(&mut streams).await.payload, Payload::Can(_)));

    link.delete().map_err(|(_, error)| error).expect("deleted");
    until(&mut streams, is_closed).await;
    let link = interface(NAME).expect("made again");
    until(&mut streams, is_opened).await;
    send(NAME, 1);
    assert!(matches!(next(&mut streams).await.payload, Payload::Can(_)));
    supervisor.stop(PATIENCE).await.expect("the source stops");
    link.delete().map_err(|(_, error)| error).expect("deleted");
}

/// The next so many frames, all of which have to come in order: in how many arrivals they came.
async fn arrivals_of(streams: &mut Streams, count: u32) -> usize {
    let (mut due, mut arrivals) = (0, 0);
    while due < count {
        match &next(streams).await.payload {
            Payload::Can(frames) => {
                for frame in frames {
                    assert_eq!(frame.data[..4], due.to_be_bytes());
                    due += 1;
                }
                arrivals += 1;
            }
            payload => panic!("{payload:?} between the frames"),
        }
    }
    assert_eq!(due, count);
    arrivals
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_busy_bus_is_read_by_time_and_still_falls_silent_and_fails() {
    const NAME: &str = "vcanacq4";
    const COUNT: u32 = 4_000;
    let Some(link) = interface(NAME) else {
        return;
    };
    let (supervisor, sequencer, mut streams) = start(CanSpec::new(NAME));
    until(&mut streams, is_opened).await;
    for _ in 0..2 {
        std::thread::spawn(|| {
            let socket = CanFdSocket::open(NAME).expect("a socket");
            for index in 0..COUNT {
                let frame = frame(index);
                socket.write_frame_insist(&frame).expect("taken");
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        let arrivals = arrivals_of(&mut streams, COUNT).await;
        println!("{COUNT} frames in {arrivals} arrivals");
        assert!(arrivals < COUNT as usize * 2 / 3);
        // Long enough to be watched again.
        tokio::time::sleep(Duration::from_millis(300)).await;
        send(NAME, 1);
        assert_eq!(arrivals_of(&mut streams, 1).await, 1);
    }
    std::thread::spawn(|| send(NAME, COUNT));
    arrivals_of(&mut streams, COUNT).await;
    link.bring_down().expect("the interface goes down");
    until(&mut streams, is_closed).await;
    assert!(sequencer.ledger().losses().is_empty());
    supervisor.stop(PATIENCE).await.expect("the source stops");
    link.delete().map_err(|(_, error)| error).expect("deleted");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_source_brings_its_interface_up_and_filters() {
    const NAME: &str = "vcanacq3";
    let Some(link) = interface(NAME) else {
        return;
    };
    link.bring_down().expect("the interface goes down");
    let (supervisor, _sequencer, mut streams) = start(CanSpec {
        link: Some(VIRTUAL),
        filters: vec![CanFilter {
            id: 4,
            mask: 0x7FF,
            extended: false,
        }],
        ..CanSpec::new(NAME)
    });
    until(&mut streams, is_opened).await;
    send(NAME, 2100);
    let mut ids = Vec::new();
    while ids.len() < 2 {
        if let Payload::Can(frames) = &next(&mut streams).await.payload {
            ids.extend(frames.iter().map(|frame| frame.id));
        }
    }
    assert_eq!(ids, [4, 4]);
    supervisor.stop(PATIENCE).await.expect("the source stops");
    link.delete().map_err(|(_, error)| error).expect("deleted");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn controllers_are_set_up_and_heard() {
    const COUNT: u32 = 1000;
    if CanInterface::open("can0").is_err() || CanInterface::open("can1").is_err() {
        eprintln!("SKIPPED: no can0 and can1 on one bus");
        return;
    }
    for name in ["can0", "can1"] {
        let link = CanInterface::open(name).expect("the interface");
        link.bring_down().expect("the interface goes down");
    }
    atvrec_acq::link::bring_up("can0", &LinkSpec::new(1_000_000)).expect("can0 goes up");
    let (supervisor, sequencer, mut streams) = start(CanSpec {
        link: Some(LinkSpec::new(1_000_000)),
        ..CanSpec::new("can1")
    });
    until(&mut streams, is_opened).await;
    let details = CanInterface::open("can1")
        .expect("can1")
        .details()
        .expect("its details");
    assert_eq!(
        details.can.bit_timing.expect("a bit rate").bitrate,
        1_000_000
    );
    assert_eq!(details.can.restart_ms, Some(100));
    let heard = Arc::new(AtomicU32::new(0));
    let heard_by_sender = Arc::clone(&heard);
    std::thread::spawn(move || {
        let socket = CanSocket::open("can0").expect("a socket");
        for index in 0..COUNT {
            // An emulated bus has no bit rate: without this the controller's queue overflows.
            while index >= heard_by_sender.load(Ordering::Acquire) + 4 {
                std::thread::yield_now();
            }
            let id = StandardId::new((index % 0x800) as u16).expect("11 bits");
            let frame = CanDataFrame::new(id, &index.to_be_bytes()).expect("data fits");
            while socket.write_frame(&frame).is_err() {
                // The driver's queue is full for as long as the bus needs.
                std::thread::yield_now();
            }
        }
    });
    let mut received = 0;
    while received < COUNT {
        if let Payload::Can(frames) = &next(&mut streams).await.payload {
            for frame in frames {
                assert_eq!(frame.bytes(), received.to_be_bytes());
                assert_eq!(frame.flags, CanFlags::default());
                assert!(frame.kernel_ns.is_some());
                received += 1;
                heard.store(received, Ordering::Release);
            }
        }
    }
    supervisor.stop(PATIENCE).await.expect("the source stops");
    assert!(sequencer.ledger().losses().is_empty());
}
