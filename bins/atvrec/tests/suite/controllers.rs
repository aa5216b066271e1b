//! What a controller gets: datagrams of the live process and frames of the recorder.

use std::fs;
use std::io::Read;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use sample::CanFrame;
use serialport::{SerialPort, TTYPort};
use store::Reader;
use testkit::controllers::assert_frames;
use wire::output::{ControllerOutput, Validity, decode_datagram};
use wire::slcan::{Decoder, Event};

use crate::record::{Virtual, logs};
use crate::support::{atvrec, stdout};

/// Ends with this.
struct Process(Child);

impl Process {
    fn start(directory: &Path, arguments: &[&str]) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
            .args(["--quiet"])
            .args(arguments)
            .args(["--config", "ports/controllers.toml"])
            .current_dir(directory)
            .stdout(Stdio::null())
            .spawn();
        Self(child.expect("the program starts"))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn receive(socket: &UdpSocket) -> (ControllerOutput, u32) {
    let mut bytes = [0; 1024];
    let length = socket.recv(&mut bytes).expect("a datagram");
    decode_datagram(&bytes[..length]).expect("a record")
}

/// Receives until `count` datagrams with this validity came one after another.
fn receive_row(socket: &UdpSocket, validity: Validity, count: usize) -> Vec<ControllerOutput> {
    let deadline = Instant::now() + Duration::from_secs(60);
    let mut row = Vec::new();
    while row.len() < count {
        assert!(Instant::now() < deadline, "{validity:?}: {}", row.len());
        let (output, _) = receive(socket);
        match output.validity == validity {
            true => row.push(output),
            false => row.clear(),
        }
    }
    row
}

fn forces(output: &ControllerOutput) -> impl Iterator<Item = f64> {
    output.forces.0.into_iter().flat_map(|force| force.force_n)
}

#[test]
fn controllers_get_each_estimate_once_and_stale_records_without_one() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let vehicle = Virtual::start(here);
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let timeout = Some(Duration::from_secs(30));
    socket.set_read_timeout(timeout).expect("a timeout");
    let mut config = fs::read_to_string(here.join("ports/atvrec.toml")).expect("there");
    config += &format!(
        "\n[output.udp]\naddress = \"{}\"\n\n[output.can]\ndevice = \"{}\"\nshare = true\n",
        socket.local_addr().expect("an address"),
        here.join("ports/can0").display()
    );
    fs::write(here.join("ports/controllers.toml"), config).expect("written");
    let recorder = Process::start(here, &["record"]);
    let _live = Process::start(here, &["live", "--listen", "127.0.0.1:0"]);

    for pair in receive_row(&socket, Validity::Valid, 20).windows(2) {
        assert!(pair[1].time > pair[0].time, "an estimate is sent once");
        assert!(forces(&pair[1]).all(f64::is_finite), "{pair:?}");
        assert!((0.0..0.05).contains(&pair[1].age_s), "{}", pair[1].age_s);
    }
    let (_, first) = receive(&socket);
    assert_eq!(receive(&socket).1, first.wrapping_add(1));
    let status = atvrec(here)
        .args(["status", "--json", "--config", "ports/controllers.toml"])
        .assert()
        .success();
    let status: serde_json::Value = serde_json::from_str(&stdout(&status)).expect("JSON");
    let can = &status["output_can"];
    assert!(can["sets"].as_u64().is_some_and(|sets| sets > 0), "{can}");
    assert_eq!(can["open"], true, "{can}");

    // Without data there is no estimate; without a recorder neither.
    drop(vehicle);
    for output in receive_row(&socket, Validity::Stale, 50) {
        assert!(forces(&output).all(f64::is_nan), "{output:?}");
    }
    drop(recorder);
    receive_row(&socket, Validity::Stale, 50);
}

/// An SLCAN adapter, and the frames that it received for its bus, each with the wall clock, ns.
struct Adapter {
    device: String,
    slave: TTYPort,
    reader: JoinHandle<Vec<(CanFrame, i64)>>,
}

impl Adapter {
    /// Listens until nothing comes for `silence`, after the first frame.
    fn start(silence: Duration) -> Self {
        let (mut master, slave) = TTYPort::pair().expect("a pseudo-terminal");
        let device = slave.name().expect("a name");
        master.set_timeout(silence).expect("a timeout");
        let reader = std::thread::spawn(move || {
            let mut decoder = Decoder::new();
            let mut frames = Vec::new();
            let mut bytes = [0; 4096];
            loop {
                match master.read(&mut bytes) {
                    Ok(count) => {
                        let now = SystemTime::now().duration_since(UNIX_EPOCH);
                        let now_ns = now.expect("after 1970").as_nanos() as i64;
                        decoder.push(&bytes[..count], &mut |event| {
                            if let Event::Frame(frame) = event {
                                frames.push((frame, now_ns));
                            }
                        });
                    }
                    Err(_) if frames.is_empty() => {}
                    Err(_) => return frames,
                }
            }
        });
        Self {
            device,
            slave,
            reader,
        }
    }

    fn finish(self) -> Vec<(CanFrame, i64)> {
        let frames = self.reader.join().expect("no panic");
        drop(self.slave);
        frames
    }
}

/// `[output.can]`, from the bytes of the sensors to values by the DBC file that ships.
#[test]
fn frames_decoded_by_the_dbc_file_are_the_estimates_of_the_log() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let vehicle = Virtual::start(here);
    let adapter = Adapter::start(Duration::from_secs(3));
    let mut config = fs::read_to_string(here.join("ports/atvrec.toml")).expect("there");
    config += &format!("\n[output.can]\ndevice = \"{}\"\n", adapter.device);
    fs::write(here.join("ports/controllers.toml"), config).expect("written");
    let mut recorder = Process::start(here, &["record", "-d", "logs", "--for", "8"]);
    std::thread::sleep(Duration::from_secs(6));
    drop(vehicle);
    recorder.0.wait().expect("the recorder ends");
    let frames = adapter.finish();

    let reader = Reader::open(logs(&here.join("logs"))).expect("a log");
    let estimates = reader.estimates().collect::<Result<Vec<_>, _>>();
    let first = reader.arrivals().next().expect("an arrival").expect("read");
    let realtime_less_log_ns = first.realtime_ns - first.log_time.0 as i64;
    let sets = assert_frames(
        &frames,
        &estimates.expect("estimates"),
        realtime_less_log_ns,
    );
    println!("{sets:?}");
    // Some 600 where nothing else runs. Beside other tests, most estimates are late, and so not valid.
    assert!(sets.valid > 10, "{sets:?}");
    // The vehicle was away for more than a second.
    assert!(sets.stale > 50, "{sets:?}");
}
