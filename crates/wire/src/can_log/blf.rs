//! Binary logging format (BLF) of Vector's tools: CAN frames of the object types 1, 2, 73, 86, 100,
//! 101 and 104.
//!
//! Source: the structures in the headers of the library `vector_blf` (Technica Engineering). The file
//! has a header and containers (objects of type 10), whose data is one stream of objects; an object
//! may cross the border of two containers. The containers are read part by part, so that the memory
//! does not depend on the size of the file, of a container or of an object.
//!
//! The crate `blf_asc` 0.2.0 is not used. It gives no frames of the error objects 2 and 104, no frame
//! of a file that ends inside a container and none of a file with one wrong object size, and it
//! allocates what the size of an object claims.

mod object;
mod stream;

use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::ops::ControlFlow;

use super::bytes::{u16_at, u32_at};
use super::defects::Defects;
use super::inflate::{Inflate, PART, Progress};
use super::{Error, Sink, Stamps, Summary};
use stream::{OBJECT_HEADER, Objects, SIGNATURE};

/// First bytes of a file.
const FILE_SIGNATURE: &[u8; 4] = b"LOGG";
/// Length of the file's header up to the end of the two times, bytes.
const FILE_HEADER: usize = 72;
/// Place of the start time in the file's header.
const START: usize = 40;
/// Object type of a container.
const CONTAINER: u32 = 10;
/// Length of a container's own header, behind the object's header, bytes.
const CONTAINER_HEADER: u64 = 16;
/// Largest number of bytes between two objects that is padding, bytes. The writers fill up to
/// multiples of four; some add a byte.
const PADDING: u64 = 8;

/// Reads a file. The stamps are ns since the start of the measurement. The summary has the start as
/// the local time that the file states: the file has no time zone.
///
/// # Errors
/// The file cannot be read, or it does not begin with the header of a BLF file. Every other defect is
/// counted in the summary.
pub fn read(input: &mut (impl Read + Seek), sink: &mut Sink<'_>) -> Result<Summary, Error> {
    let length = input.seek(SeekFrom::End(0))?;
    input.seek(SeekFrom::Start(0))?;
    let mut header = Vec::new();
    input.take(FILE_HEADER as u64).read_to_end(&mut header)?;
    if !header.starts_with(FILE_SIGNATURE) {
        return Err(Error::other_format("a BLF file", &header));
    }
    let mut defects = Defects::default();
    if header.len() < FILE_HEADER {
        defects.note("the file's header is cut", 0);
    }
    let start_ns = start(&header, &mut defects);
    let header_len = u64::from(u32_at(&header, 4)).clamp(FILE_HEADER as u64, 4096);
    let mut file = File {
        input: BufReader::new(input),
        position: 0,
        length,
        part: Vec::new(),
    };
    file.seek(header_len.min(length))?;
    let mut objects = Objects::new(defects);
    // `Break`: the sink wants no more frames.
    let _ = file.read_objects(&mut objects, sink)?;
    Ok(objects.summary(start_ns))
}

/// The start time (`SYSTEMTIME` of Windows), UNIX time in ns as if the clock showed UTC. All zero: not
/// in the file.
fn start(header: &[u8], defects: &mut Defects) -> Option<i64> {
    let field = |index: usize| i64::from(u16_at(header, START + 2 * index));
    let [year, month, day, hour, minute, second, milli] = [0, 1, 3, 4, 5, 6, 7].map(field);
    if [year, month, day, hour, minute, second, milli] == [0; 7] {
        return None;
    }
    let days = days_from_civil(year, month, day);
    if days.is_none() || hour > 23 || minute > 59 || second > 60 || milli > 999 {
        defects.note("the start time is not a date and time", START as u64);
        return None;
    }
    let seconds = (days? * 24 + hour) * 3600 + minute * 60 + second;
    seconds
        .checked_mul(1_000_000_000)?
        .checked_add(milli * 1_000_000)
}

/// Days since 1970-01-01 of a date of the Gregorian calendar; `None` if there is no such date. Source:
/// H. Hinnant, `chrono`-compatible low-level date algorithms, `days_from_civil`.
fn days_from_civil(year: i64, month: i64, day: i64) -> Option<i64> {
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let last = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=last).contains(&day) {
        return None;
    }
    // The year begins in March, so that the leap day is its last day.
    let y = if month <= 2 { year - 1 } else { year };
    let era = y.div_euclid(400);
    let year_of_era = y.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    Some(era * 146_097 + day_of_era - 719_468)
}

/// The objects of the file itself.
struct File<'r, R> {
    input: BufReader<&'r mut R>,
    /// Bytes from the start of the file.
    position: u64,
    length: u64,
    /// Part of a container's data.
    part: Vec<u8>,
}

impl<R: Read + Seek> File<'_, R> {
    fn seek(&mut self, position: u64) -> Result<(), Error> {
        self.position = self.input.seek(SeekFrom::Start(position))?;
        Ok(())
    }

    /// Reads up to `len` bytes into `part`: fewer at the end of the file.
    fn read_part(&mut self, len: u64) -> Result<(), Error> {
        self.part.clear();
        let read = (&mut self.input).take(len).read_to_end(&mut self.part)?;
        self.position += read as u64;
        Ok(())
    }

    /// Goes to the next object. Returns the number of bytes before it; `None` if there is no other.
    fn find_object(&mut self) -> Result<Option<u64>, Error> {
        let (start, mut matched) = (self.position, 0);
        loop {
            let bytes = self.input.fill_buf()?;
            if bytes.is_empty() {
                return Ok(None);
            }
            let mut used = 0;
            for byte in bytes {
                used += 1;
                matched = match (*byte == SIGNATURE[matched], *byte == SIGNATURE[0]) {
                    (true, _) => matched + 1,
                    (false, true) => 1,
                    (false, false) => 0,
                };
                if matched == SIGNATURE.len() {
                    break;
                }
            }
            self.input.consume(used);
            self.position += used as u64;
            if matched == SIGNATURE.len() {
                let found = self.position - SIGNATURE.len() as u64;
                self.seek(found)?;
                return Ok(Some(found - start));
            }
        }
    }

    fn read_objects(
        &mut self,
        objects: &mut Objects,
        sink: &mut Sink<'_>,
    ) -> Result<ControlFlow<()>, Error> {
        loop {
            let gap_start = self.position;
            let Some(gap) = self.find_object()? else {
                if self.position - gap_start > PADDING {
                    objects.note("bytes at the end of the file are no objects", gap_start);
                }
                break;
            };
            if gap > PADDING {
                objects.note("bytes between objects are no objects", gap_start);
            }
            let start = self.position;
            objects.file_position = start;
            self.read_part(OBJECT_HEADER as u64)?;
            let (size, kind) = (u64::from(u32_at(&self.part, 8)), u32_at(&self.part, 12));
            if self.part.len() < OBJECT_HEADER {
                objects.note("the file ends inside an object's header", start);
                break;
            }
            if size < OBJECT_HEADER as u64 {
                objects.note("the size of an object is impossible", start);
                self.seek(start + SIGNATURE.len() as u64)?;
                continue;
            }
            let flow = if kind == CONTAINER {
                self.read_container(start, size, objects, sink)?
            } else {
                self.seek(start)?;
                self.read_plain(size, objects, sink)?
            };
            if flow.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        objects.end();
        Ok(ControlFlow::Continue(()))
    }

    /// Reads an object that is in no container, or the data of a container without compression.
    fn read_plain(
        &mut self,
        mut size: u64,
        objects: &mut Objects,
        sink: &mut Sink<'_>,
    ) -> Result<ControlFlow<()>, Error> {
        while size > 0 {
            self.read_part(size.min(PART as u64))?;
            if self.part.is_empty() {
                break;
            }
            size -= self.part.len() as u64;
            if objects.push(&self.part, sink).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    fn read_container(
        &mut self,
        start: u64,
        size: u64,
        objects: &mut Objects,
        sink: &mut Sink<'_>,
    ) -> Result<ControlFlow<()>, Error> {
        let header_len = u64::from(u16_at(&self.part, 4)).max(OBJECT_HEADER as u64);
        let own_header = header_len + CONTAINER_HEADER;
        if size < own_header {
            objects.note("the size of a container is impossible", start);
            self.seek(start + SIGNATURE.len() as u64)?;
            return Ok(ControlFlow::Continue(()));
        }
        let end = start + size;
        if end > self.length {
            objects.note("the file ends inside a container", start);
        }
        self.seek(start + header_len)?;
        self.read_part(CONTAINER_HEADER)?;
        let method = u16_at(&self.part, 0);
        match method {
            0 => self.read_plain(size - own_header, objects, sink),
            2 => self.read_compressed(end, objects, sink),
            _ => {
                let kind = format!("containers with the unknown compression method {method}");
                objects.leave_out(kind);
                objects.interrupt();
                self.seek(end.min(self.length))?;
                Ok(ControlFlow::Continue(()))
            }
        }
    }

    fn read_compressed(
        &mut self,
        end: u64,
        objects: &mut Objects,
        sink: &mut Sink<'_>,
    ) -> Result<ControlFlow<()>, Error> {
        let mut inflate = Inflate::new();
        let mut output = Vec::new();
        while self.position < end {
            let place = self.position;
            self.read_part((end - place).min(PART as u64))?;
            if self.part.is_empty() {
                break;
            }
            output.clear();
            let progress = inflate.push(&self.part, &mut output);
            if objects.push(&output, sink).is_break() {
                return Ok(ControlFlow::Break(()));
            }
            match progress {
                Progress::More => {}
                Progress::End(used) => {
                    // A container that claims more than the file has ends where its data ends.
                    let data_end = place + used as u64;
                    self.seek(if end > self.length { data_end } else { end })?;
                    return Ok(ControlFlow::Continue(()));
                }
                Progress::Damaged => {
                    objects.note("the compressed data of a container is damaged", place);
                    objects.interrupt();
                    self.seek(end.min(self.length))?;
                    return Ok(ControlFlow::Continue(()));
                }
            }
        }
        objects.note("the compressed data of a container is not complete", end);
        objects.interrupt();
        Ok(ControlFlow::Continue(()))
    }
}

impl Objects {
    fn summary(self, start_ns: Option<i64>) -> Summary {
        Summary {
            stamps: Stamps::SinceStart,
            start_ns,
            channels: self.channels.iter().map(u16::to_string).collect(),
            frames: self.frames,
            left_out: self.left_out,
            ..Summary::default()
        }
        .with(self.defects)
    }
}
