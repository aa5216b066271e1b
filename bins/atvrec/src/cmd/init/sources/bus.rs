//! CAN buses: at interfaces and at SLCAN adapters.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use engine::Reception;
use engine::config::{Proposed, propose};
use sample::Arrival;
use wire::dbc::Database;

use super::super::devices::{Interface, Port, PortState, identifiers};
use super::{DbcFile, Names, Planned, decode, quoted, read_dbc, told_of};
use crate::cli::InitArgs;

/// Name of the DBC file that is part of the program.
const PROJECT_DBC: &str = "prowler.dbc";

/// A CAN bus, at an interface or an SLCAN adapter.
pub struct Bus {
    name: String,
    /// Device, for people.
    device: String,
    comments: Vec<String>,
    /// The table without DBC files.
    table: String,
    arrivals: Vec<Arc<Arrival>>,
    dbc: Vec<usize>,
}

impl Bus {
    pub fn of_interface(interface: Interface, bit_rate: Option<u32>, names: &mut Names) -> Self {
        let found = &interface.found;
        let name = names.next(&found.name);
        let state = match (found.is_up, found.bit_rate) {
            (true, Some(rate)) => format!("up, {rate} bit/s"),
            (true, None) => "up".to_owned(),
            (false, Some(rate)) => format!("down, {rate} bit/s"),
            (false, None) => "down".to_owned(),
        };
        let device = format!("{} ({}, {state})", found.name, found.driver);
        let mut comments: Vec<String> = interface.problem.into_iter().collect();
        let mut table = format!(
            "[source.{name}]\nkind = \"can\"\ninterface = {}\n",
            quoted(&found.name)
        );
        if !found.is_up {
            comments.push(format!(
                "the interface is down: set its bit rate and bring it up with `sudo ip link set {} up type \
                 can bitrate 500000`, or with `sudo atvrec link` after link.bitrate is set below",
                found.name
            ));
            let mark = if bit_rate.is_some() { "" } else { "# " };
            let rate = bit_rate.or(found.bit_rate).unwrap_or(500_000);
            let _ = writeln!(table, "{mark}link.bitrate = {rate}");
        } else if comments.is_empty() && interface.arrivals.is_empty() {
            comments.push(
                "no frame arrived; check the bit rate, the cable, and whether the devices of the bus have \
                 power"
                    .to_owned(),
            );
        }
        Self {
            name,
            device,
            comments,
            table,
            arrivals: interface.arrivals,
            dbc: Vec::new(),
        }
    }

    pub fn of_adapter(port: Port, names: &mut Names) -> Option<Self> {
        let PortState::Adapter {
            baud,
            bit_rate,
            arrivals,
        } = port.state
        else {
            return None;
        };
        let path = port.path.display().to_string();
        let name = names.next("can_usb");
        let rate = bit_rate.map_or_else(
            || "unknown bit rate".to_owned(),
            |rate| format!("{rate} bit/s"),
        );
        let mark = if bit_rate.is_some() { "" } else { "# " };
        let table = format!(
            "[source.{name}]\nkind = \"slcan\"\ndevice = {}\nbaud = {baud}\n{mark}bitrate = {}\n",
            quoted(&path),
            bit_rate.unwrap_or(500_000)
        );
        let silent =
            "no frame arrived at any bit rate; check the cable, and set bitrate to that of the bus";
        Some(Self {
            name,
            device: format!("{path} (SLCAN adapter, {rate})"),
            comments: arrivals
                .is_empty()
                .then(|| silent.to_owned())
                .into_iter()
                .collect(),
            table,
            arrivals,
            dbc: Vec::new(),
        })
    }

    /// The bus of DBC files without a CAN interface.
    pub fn missing(names: &mut Names) -> Self {
        let name = names.next("can0");
        Self {
            device: "can0 (not found)".to_owned(),
            comments: vec![
                "no CAN interface was found; connect the adapter or load its driver, and correct the name \
                 of the interface (`ip link` lists the interfaces)"
                    .to_owned(),
            ],
            table: format!("[source.{name}]\nkind = \"can\"\ninterface = \"can0\"\n"),
            name,
            arrivals: Vec::new(),
            dbc: Vec::new(),
        }
    }

    pub fn planned(self, files: &[DbcFile], args: &InitArgs) -> anyhow::Result<Planned> {
        let mut chosen: Vec<&DbcFile> = self.dbc.iter().map(|number| &files[*number]).collect();
        let built_in = read_dbc(&[PathBuf::from(PROJECT_DBC)], Path::new(""))?;
        let mut comments = self.comments;
        if files.is_empty() && !self.arrivals.is_empty() {
            let (known, _, all) = known_frames(&self.arrivals, &built_in[0].database);
            if 2 * known > all {
                comments.push(format!(
                    "{known} of {all} identifiers are those of {PROJECT_DBC}, which is part of the program"
                ));
                chosen.push(&built_in[0]);
            }
        }
        if chosen.is_empty() {
            comments.push(
                "without a DBC file, the frames are recorded and not decoded; name the files of this bus in \
                 dbc, or run `atvrec init --dbc FILE` again"
                    .to_owned(),
            );
        }
        let dbc: Vec<String> = chosen.iter().map(|file| quoted(&file.name)).collect();
        let table = format!("{}dbc = [{}]\n", self.table, dbc.join(", "));
        let databases: Vec<Database> = chosen.iter().map(|file| file.database.clone()).collect();
        let mut told = vec![format!("{}: source {}", self.device, self.name)];
        told.extend(comments.iter().cloned());
        let reception = match self.arrivals.is_empty() {
            true => None,
            false => decode(&table, &args.directory, &self.arrivals)?,
        };
        let mut roles = propose(&databases);
        if let Some(reception) = &reception {
            told.extend(told_of(reception, &self.arrivals, args.listen_s));
            if let (Some(format), None) = (reception.format, reception.problem()) {
                told.push(format!("{format}, not decoded: {}", format.advice()));
            }
        }
        let silent = match &reception {
            Some(reception) => without_frames(&mut roles, reception),
            None => Vec::new(),
        };
        Ok(Planned {
            told,
            comments,
            table,
            name: self.name,
            roles,
            silent,
        })
    }
}

/// Takes the roles without a doubt whose message did not arrive; of the others it is noted.
fn without_frames(roles: &mut Vec<Proposed>, reception: &Reception) -> Vec<Proposed> {
    let arrived: BTreeSet<&str> = reception.messages.decoded().map(|(name, _)| name).collect();
    let (mut proposed, mut silent) = (Vec::new(), Vec::new());
    for mut role in std::mem::take(roles) {
        let message = role.signal.trim_start_matches('-').split('.').next();
        let is_silent = message.is_none_or(|message| !arrived.contains(message));
        match role.doubt.is_none() {
            true if is_silent => silent.push(role),
            clear => {
                if !clear && is_silent {
                    role.unit += "; no frame arrived";
                }
                proposed.push(role);
            }
        }
    }
    *roles = proposed;
    silent
}

/// Gives each DBC file to the bus that has most of its frames; without any, to the first bus.
pub fn assign(buses: &mut [Bus], dbc: &[DbcFile]) {
    for (number, file) in dbc.iter().enumerate() {
        let frames = |bus: &Bus| known_frames(&bus.arrivals, &file.database).1;
        let best = buses.iter_mut().rev().max_by_key(|bus| frames(bus));
        if let Some(bus) = best {
            bus.dbc.push(number);
        }
    }
}

/// Number of identifiers and of frames that a file has, and number of identifiers.
fn known_frames(arrivals: &[Arc<Arrival>], database: &Database) -> (usize, u64, usize) {
    let heard = identifiers(arrivals);
    let known = heard
        .iter()
        .filter(|((id, extended), _)| database.by_id(*id, *extended).is_some());
    let (mut count, mut frames) = (0, 0);
    for (_, of_id) in known {
        count += 1;
        frames += of_id;
    }
    (count, frames, heard.len())
}
