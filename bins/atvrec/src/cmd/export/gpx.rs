//! Positions of GNSS receivers as a GPX track.

use std::io::{BufWriter, Write};

use engine::output::{Target, WriteError};
use sample::LogTime;
use store::{Table, UtcOffset};

use super::cells::{Numbers, integer, time};
use super::topic::Topic;
use super::{Input, Written};

/// Schema of positions.
const POSITION: &str = "atvrec.GnssPosition";

/// Writes the positions of the topics, of all receivers if none is chosen, and prints what was written.
pub fn write(
    input: &Input<'_>,
    chosen: &[String],
    utc: Option<UtcOffset>,
    target: &Target,
) -> anyhow::Result<Written> {
    let mut topics = Topic::all(input.reader, input.left_out);
    topics.retain(|topic| chosen.is_empty() || chosen.contains(&topic.name));
    let is_position = |topic: &Topic| topic.schema == POSITION;
    if let Some(wrong) = (topics.iter()).find(|topic| !chosen.is_empty() && !is_position(topic)) {
        anyhow::bail!(
            "{} has no positions of a receiver; export /gnss/<source>/position to a .gpx file",
            wrong.name
        );
    }
    topics.retain(is_position);
    if topics.is_empty() {
        anyhow::bail!(
            "the log has no positions of a receiver, so that there is no track to export"
        );
    }
    let mut written = Written::default();
    target.write_by(|file| {
        let write = || -> anyhow::Result<()> {
            let mut writer = Writer::new(BufWriter::new(file), input.span.begin, utc)?;
            let count = topics.len() as f64;
            for (place, topic) in topics.iter().enumerate() {
                let part = [place, place + 1].map(|end| end as f64 / count);
                writer.begin_track(&topic.source)?;
                let one = std::slice::from_ref(topic);
                input.each(one, part, &mut written.missing, |_, table| {
                    Ok(writer.write(&table)?)
                })?;
                writer.end_track()?;
            }
            written.rows = writer.points;
            Ok(writer.finish()?)
        };
        write().map_err(WriteError::from)
    })?;
    let path = target.path().display();
    println!("{path}: {} points, {} tracks", written.rows, topics.len());
    Ok(written)
}

/// Writes a GPX 1.1 file: a track for each receiver, and in it a segment for each stretch without a message
/// that has no solution. The elevation is the height above the ellipsoid, because no receiver's geoid is in
/// a log.
struct Writer<W: Write> {
    sink: W,
    utc: Option<UtcOffset>,
    is_in_segment: bool,
    /// Points so far.
    points: usize,
}

impl<W: Write> Writer<W> {
    /// Writes the head. `begin` is the begin of the export.
    fn new(mut sink: W, begin: LogTime, utc: Option<UtcOffset>) -> std::io::Result<Self> {
        let utc_ns = |ns: i64| utc.map_or(ns, |utc| ns.saturating_add(utc.offset_ns));
        let begin = time(utc_ns(begin.0.cast_signed()));
        let clock = match utc {
            Some(_) => "times are UTC by the receiver",
            None => "times are those of the recorder's clock",
        };
        writeln!(sink, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
        writeln!(
            sink,
            "<gpx version=\"1.1\" creator=\"atvrec {}\" xmlns=\"http://www.topografix.com/GPX/1/1\">",
            env!("CARGO_PKG_VERSION")
        )?;
        writeln!(
            sink,
            "<metadata><desc>WGS 84; ele is the height above the ellipsoid; {clock}</desc>\
             <time>{begin}</time></metadata>"
        )?;
        Ok(Self {
            sink,
            utc,
            is_in_segment: false,
            points: 0,
        })
    }

    /// Begins the track of a receiver.
    fn begin_track(&mut self, source: &str) -> std::io::Result<()> {
        writeln!(self.sink, "<trk><name>{}</name>", escaped(source))
    }

    /// Ends the track of a receiver.
    fn end_track(&mut self) -> std::io::Result<()> {
        self.end_segment()?;
        writeln!(self.sink, "</trk>")
    }

    /// Writes positions.
    fn write(&mut self, table: &Table) -> std::io::Result<()> {
        let number = |name| Numbers::new(table, name);
        let (latitude, longitude) = (number("latitude_rad"), number("longitude_rad"));
        let height = number("height_m");
        for (row, ns) in table.publish_time_ns.iter().enumerate() {
            let position_rad = [latitude.at(row), longitude.at(row)];
            let fix = integer(table, "quality", row).and_then(fix_of);
            let (Some(fix), true) = (fix, position_rad.iter().all(|rad| rad.is_finite())) else {
                self.end_segment()?;
                continue;
            };
            if !self.is_in_segment {
                writeln!(self.sink, "<trkseg>")?;
                self.is_in_segment = true;
            }
            let [latitude_deg, longitude_deg] = position_rad.map(f64::to_degrees);
            // The format has no longitude of 180 degrees.
            let longitude_deg = if longitude_deg >= 180.0 {
                longitude_deg - 360.0
            } else {
                longitude_deg
            };
            write!(
                self.sink,
                "<trkpt lat=\"{latitude_deg:.9}\" lon=\"{longitude_deg:.9}\">"
            )?;
            if height.at(row).is_finite() {
                write!(self.sink, "<ele>{:.4}</ele>", height.at(row))?;
            }
            let utc_ns = self.utc.map_or(*ns, |utc| ns.saturating_add(utc.offset_ns));
            write!(self.sink, "<time>{}</time>{fix}", time(utc_ns))?;
            if let Some(satellites) = integer(table, "satellites", row) {
                write!(self.sink, "<sat>{satellites}</sat>")?;
            }
            writeln!(self.sink, "</trkpt>")?;
            self.points += 1;
        }
        Ok(())
    }

    /// Writes the end of the file.
    fn finish(mut self) -> std::io::Result<()> {
        writeln!(self.sink, "</gpx>")?;
        self.sink.flush()
    }

    fn end_segment(&mut self) -> std::io::Result<()> {
        if std::mem::take(&mut self.is_in_segment) {
            writeln!(self.sink, "</trkseg>")?;
        }
        Ok(())
    }
}

/// The element of a quality (`FixQuality` of the log); `None` without a solution.
fn fix_of(quality: u32) -> Option<&'static str> {
    Some(match quality {
        0 => return None,
        1 => "<fix>3d</fix>",
        2..=4 => "<fix>dgps</fix>",
        // The format has no word for dead reckoning.
        _ => "",
    })
}

/// A text in XML.
fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use store::{Column, Values};

    use super::*;

    #[test]
    fn a_message_without_a_solution_ends_the_segment() {
        let column = |name: &str, values| Column {
            name: name.to_owned(),
            unit: String::new(),
            names: Vec::new(),
            values,
            present: None,
        };
        let absent = f64::NAN;
        let table = Table {
            publish_time_ns: vec![0, 1_500_000_000, 2_000_000_000, 3_000_000_000],
            columns: vec![
                column("quality", Values::I32(vec![1, 0, 4, 5])),
                column("latitude_rad", Values::F64(vec![0.5, absent, -0.5, 0.0])),
                column(
                    "longitude_rad",
                    Values::F64(vec![3.0, absent, std::f64::consts::PI, 0.0]),
                ),
                column("height_m", Values::F64(vec![absent, absent, -3.0, 10.25])),
                column("satellites", Values::U32(vec![7, 0, 8, 9])),
            ],
            ..Table::default()
        };
        let mut bytes = Vec::new();
        let mut writer = Writer::new(&mut bytes, LogTime(0), None).expect("written");
        writer.begin_track("a<b").expect("written");
        writer.write(&table).expect("written");
        writer.end_track().expect("written");
        assert_eq!(writer.points, 3);
        writer.finish().expect("written");
        let text = String::from_utf8(bytes).expect("text");
        let (_, track) = text.split_once("<trk>").expect("a track");
        let expected = [
            "<name>a&lt;b</name>",
            "<trkseg>",
            "<trkpt lat=\"28.647889757\" lon=\"171.887338539\">\
             <time>1970-01-01T00:00:00Z</time><fix>3d</fix><sat>7</sat></trkpt>",
            "</trkseg>",
            "<trkseg>",
            "<trkpt lat=\"-28.647889757\" lon=\"-180.000000000\"><ele>-3.0000</ele>\
             <time>1970-01-01T00:00:02Z</time><fix>dgps</fix><sat>8</sat></trkpt>",
            "<trkpt lat=\"0.000000000\" lon=\"0.000000000\"><ele>10.2500</ele>\
             <time>1970-01-01T00:00:03Z</time><sat>9</sat></trkpt>",
            "</trkseg>",
            "</trk>",
            "</gpx>",
        ];
        assert_eq!(track.lines().collect::<Vec<_>>(), expected);
    }
}
