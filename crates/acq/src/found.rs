//! CAN interfaces and serial ports of this computer, from what the kernel tells without root.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use socketcan::CanInterface;

/// `ARPHRD_CAN` of `linux/if_arp.h`: type of a CAN interface.
const CAN_TYPE: &str = "280";
/// `PORT_UNKNOWN` of `linux/serial_core.h`: a serial port of the kernel without a UART behind it.
const UNKNOWN_UART: &str = "0";

/// A CAN interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundInterface {
    /// Its name, such as `can0`.
    pub name: String,
    /// Name of its driver; `virtual` without one.
    pub driver: String,
    /// Whether it is up.
    pub is_up: bool,
    /// Bit rate, bit/s, if the kernel knows one.
    pub bit_rate: Option<u32>,
}

/// A serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundPort {
    /// Path that stays the same after replugging, where there is one.
    pub path: PathBuf,
    /// Name of the port in the kernel, such as `ttyUSB0`.
    pub name: String,
    /// Name of its driver.
    pub driver: String,
}

/// CAN interfaces, in the order of their names.
///
/// # Errors
/// If the list of network interfaces cannot be read.
pub fn can_interfaces() -> io::Result<Vec<FoundInterface>> {
    let mut interfaces = interfaces_below(Path::new("/sys/class/net"))?;
    for interface in &mut interfaces {
        let details = CanInterface::open(&interface.name).and_then(|link| link.details());
        if let Ok(details) = details {
            interface.is_up = details.is_up;
            let timing = details.can.bit_timing;
            interface.bit_rate = timing.map(|t| t.bitrate).filter(|rate| *rate > 0);
        }
    }
    Ok(interfaces)
}

/// A CAN interface by its name, whether or not the computer has it.
#[must_use]
pub fn can_interface(name: &str) -> Option<FoundInterface> {
    let all = can_interfaces().ok()?;
    all.into_iter().find(|interface| interface.name == name)
}

fn interfaces_below(directory: &Path) -> io::Result<Vec<FoundInterface>> {
    let mut found = Vec::new();
    for (name, path) in sorted(directory)? {
        if word(&path.join("type")).as_deref() != Some(CAN_TYPE) {
            continue;
        }
        found.push(FoundInterface {
            name,
            driver: driver_of(&path).unwrap_or_else(|| "virtual".to_owned()),
            is_up: word(&path.join("operstate")).as_deref() == Some("up"),
            bit_rate: None,
        });
    }
    Ok(found)
}

/// Serial ports with a device, in the order of their names.
///
/// # Errors
/// If the list of terminals cannot be read.
pub fn serial_ports() -> io::Result<Vec<FoundPort>> {
    ports_below(Path::new("/sys/class/tty"), Path::new("/dev"))
}

fn ports_below(terminals: &Path, devices: &Path) -> io::Result<Vec<FoundPort>> {
    // Directories of links that do not depend on the order of plugging.
    let links: Vec<(PathBuf, PathBuf)> = ["serial/by-id", "serial/by-path"]
        .into_iter()
        .flat_map(|below| sorted(&devices.join(below)).unwrap_or_default())
        .filter_map(|(_, link)| Some((link.canonicalize().ok()?, link)))
        .collect();
    let mut found = Vec::new();
    for (name, path) in sorted(terminals)? {
        let Some(driver) = driver_of(&path) else {
            continue;
        };
        if word(&path.join("type")).as_deref() == Some(UNKNOWN_UART) {
            continue;
        }
        let device = devices.join(&name);
        let real = device.canonicalize().unwrap_or_else(|_| device.clone());
        let link = links.iter().find(|(to, _)| *to == real);
        found.push(FoundPort {
            path: link.map_or(device, |(_, link)| link.clone()),
            name,
            driver,
        });
    }
    Ok(found)
}

/// Names and paths in a directory, sorted; none if it does not exist.
fn sorted(directory: &Path) -> io::Result<Vec<(String, PathBuf)>> {
    let entries = match fs::read_dir(directory) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let named = |entry: fs::DirEntry| Some((entry.file_name().into_string().ok()?, entry.path()));
    let mut all: Vec<_> = entries.filter_map(|e| e.ok().and_then(named)).collect();
    all.sort();
    Ok(all)
}

fn word(path: &Path) -> Option<String> {
    Some(fs::read_to_string(path).ok()?.trim().to_owned())
}

/// Driver of a device of `/sys`. Terminals without hardware have none.
fn driver_of(device: &Path) -> Option<String> {
    let driver = fs::read_link(device.join("device/driver")).ok()?;
    Some(driver.file_name()?.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    /// A device of a tree like `/sys`, with its driver and other files.
    fn device(root: &Path, name: &str, driver: Option<&str>, files: &[(&str, &str)]) {
        let place = root.join(name);
        fs::create_dir_all(place.join("device")).expect("created");
        if let Some(driver) = driver {
            symlink(
                root.join("drivers").join(driver),
                place.join("device/driver"),
            )
            .expect("a link");
        }
        for (file, text) in files {
            fs::write(place.join(file), text).expect("written");
        }
    }

    #[test]
    fn interfaces_of_other_kinds_are_left_out() {
        let directory = tempfile::tempdir().expect("a directory");
        let root = directory.path();
        device(
            root,
            "can1",
            Some("gs_usb"),
            &[("type", "280\n"), ("operstate", "up\n")],
        );
        device(
            root,
            "can0",
            None,
            &[("type", "280\n"), ("operstate", "down\n")],
        );
        device(root, "eth0", Some("e1000"), &[("type", "1\n")]);
        let found = interfaces_below(root).expect("a list");
        let told: Vec<_> = found
            .iter()
            .map(|i| (i.name.as_str(), i.driver.as_str(), i.is_up))
            .collect();
        assert_eq!(told, [("can0", "virtual", false), ("can1", "gs_usb", true)]);
        assert_eq!(interfaces_below(&root.join("none")).expect("a list"), []);
    }

    #[test]
    fn ports_have_the_path_that_stays_and_ports_without_hardware_are_left_out() {
        let directory = tempfile::tempdir().expect("a directory");
        let (terminals, devices) = (directory.path().join("sys"), directory.path().join("dev"));
        device(&terminals, "ttyUSB0", Some("ftdi_sio"), &[]);
        device(&terminals, "ttyS0", Some("serial8250"), &[("type", "4\n")]);
        device(&terminals, "ttyS1", Some("serial8250"), &[("type", "0\n")]);
        device(&terminals, "tty1", None, &[]);
        fs::create_dir_all(devices.join("serial/by-id")).expect("created");
        fs::write(devices.join("ttyUSB0"), "").expect("written");
        let link = devices.join("serial/by-id/usb-FTDI_X-port0");
        symlink("../../ttyUSB0", &link).expect("a link");
        let found = ports_below(&terminals, &devices).expect("a list");
        let told: Vec<_> = found.iter().map(|p| (p.name.as_str(), &p.path)).collect();
        assert_eq!(
            told,
            [("ttyS0", &devices.join("ttyS0")), ("ttyUSB0", &link)]
        );
    }
}
