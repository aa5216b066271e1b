//! `atvrec virtual`: run a virtual vehicle on ports in real time.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use engine::{Ports, VirtualDrive};

use sample::CanFrame;

use crate::cli::VirtualArgs;
use crate::devices::Devices;
use crate::exit::Outcome;
use engine::output::{Kind, Target};

/// Runs the command: drives until the manoeuvre ends or a signal is received.
pub fn run(args: &VirtualArgs) -> anyhow::Result<Outcome> {
    let mut simulated = VirtualDrive::new(&args.drive.as_drive()?)?;
    std::fs::create_dir_all(&args.directory)
        .with_context(|| format!("cannot create the directory {}", args.directory.display()))?;
    let directory = args
        .directory
        .canonicalize()
        .with_context(|| format!("cannot resolve the path {}", args.directory.display()))?;
    let ports = Ports {
        directory: &directory,
        can: args.can.as_deref(),
    };
    let config = directory.join("atvrec.toml");
    let text = simulated.configuration(&ports);
    // A file of an earlier run with the same content is kept.
    let is_same = std::fs::read_to_string(&config).is_ok_and(|found| found == text);
    let target = (!is_same)
        .then(|| Target::new(&config, Kind::Toml, args.replace.force, inputs(args)))
        .transpose()?;
    let mut devices = Devices::new(&args.directory, args.can.is_none())?;
    // The configuration is written after the ports exist, for programs that wait for it.
    if let Some(target) = target {
        target.write(&text)?;
    }
    print_ports(&simulated, &devices, &config);

    let mut bus = args.can.as_deref().map(open_bus).transpose()?;
    let stop = Arc::new(AtomicBool::new(false));
    crate::interrupt::stop_on_signals(Arc::clone(&stop))?;
    loop {
        let mut send = |frame: &CanFrame| match &mut bus {
            Some(bus) => Ok(bus.send(frame)?),
            None => Ok(()),
        };
        devices.drive(&mut simulated, &stop, &mut send, None)?;
        if !args.repeat || stop.load(Ordering::Relaxed) {
            break;
        }
        simulated = VirtualDrive::new(&args.drive.as_drive()?)?;
    }
    for sent in devices.sent() {
        println!("  {sent}");
    }
    Ok(Outcome::Good)
}

fn inputs(args: &VirtualArgs) -> impl Iterator<Item = &Path> {
    let drive = &args.drive;
    let files = [&drive.truth, &drive.options].into_iter().flatten();
    let named = [&drive.vehicle, &drive.sensors].map(Path::new);
    let road = drive.road.iter().map(Path::new);
    files.map(|path| &**path).chain(named).chain(road)
}

fn open_bus(interface: &str) -> anyhow::Result<acq::CanSender> {
    acq::CanSender::open(interface).with_context(|| {
        format!(
            "cannot send on {interface}; create it with `ip link add {interface} type vcan` and \
             bring it up with `ip link set {interface} up`"
        )
    })
}

fn print_ports(simulated: &VirtualDrive, devices: &Devices, config: &Path) {
    println!(
        "{}, {:.0} s; ports:",
        simulated.drive,
        simulated.duration_s()
    );
    for link in devices.links() {
        println!("  {}", link.display());
    }
    println!("record with: atvrec record --config {}", config.display());
}
