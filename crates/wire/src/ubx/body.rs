use super::sensors::Readings;
use crate::codec::Codec;

/// NAV-PVT: position, velocity and time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pvt {
    /// GPS time of week, ms.
    pub time_of_week_ms: u32,
    /// UTC year, month, day, hour, minute, second.
    pub year: u16,
    /// Month to second.
    pub month_to_second: [u8; 5],
    /// Bit 0: the date is valid; bit 1: the time of day is valid; bit 2: there is no doubt about the
    /// second.
    pub valid: u8,
    /// Accuracy of the time, ns.
    pub time_accuracy_ns: u32,
    /// Fraction of the second, ns; negative before the second.
    pub nanoseconds: i32,
    /// 0 none, 1 dead reckoning, 2 two dimensions, 3 three dimensions, 4 satellites and dead
    /// reckoning, 5 time alone.
    pub fix: u8,
    /// Bit 0: within the limits; bit 1: differential; bits 6, 7: carrier solution, 1 float, 2 fixed.
    pub flags: u8,
    /// Confirmation of date and time.
    pub flags2: u8,
    /// Satellites in the solution.
    pub satellites: u8,
    /// Longitude, 1e-7 degrees.
    pub longitude_1e7_deg: i32,
    /// Latitude, 1e-7 degrees.
    pub latitude_1e7_deg: i32,
    /// Height above the ellipsoid, mm.
    pub height_mm: i32,
    /// Height above mean sea level, mm.
    pub height_msl_mm: i32,
    /// Accuracy of horizontal position and of height, mm.
    pub accuracy_mm: [u32; 2],
    /// Velocity north, east, down, mm/s.
    pub velocity_ned_mm_s: [i32; 3],
    /// Speed over ground, mm/s.
    pub ground_speed_mm_s: i32,
    /// Course over ground, 1e-5 degrees.
    pub course_1e5_deg: i32,
    /// Accuracy of the speed, mm/s.
    pub speed_accuracy_mm_s: u32,
    /// Accuracy of the course, 1e-5 degrees.
    pub course_accuracy_1e5_deg: u32,
    /// Dilution of the position, 0.01.
    pub dilution_c: u16,
    /// Bit 0: longitude, latitude and heights are invalid.
    pub flags3: u16,
    /// Heading of the vehicle, 1e-5 degrees.
    pub heading_1e5_deg: i32,
}

/// NAV-RELPOSNED: from the reference station or the other antenna to this one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelativePosition {
    /// 0 (40 bytes, without length and heading) or 1 (64 bytes).
    pub version: u8,
    /// Number of the reference station.
    pub station: u16,
    /// GPS time of week, ms.
    pub time_of_week_ms: u32,
    /// North, east, down, cm.
    pub position_ned_cm: [i32; 3],
    /// Length, cm (version 1).
    pub length_cm: i32,
    /// Direction clockwise from true north, 1e-5 degrees (version 1).
    pub heading_1e5_deg: i32,
    /// What is added north, east, down and to the length, 0.1 mm.
    pub fine_100um: [i8; 4],
    /// Standard deviations north, east, down, 0.1 mm.
    pub sigma_ned_100um: [u32; 3],
    /// Standard deviation of the length, 0.1 mm (version 1).
    pub length_sigma_100um: u32,
    /// Standard deviation of the direction, 1e-5 degrees (version 1).
    pub heading_sigma_1e5_deg: u32,
    /// Bit 0: fix within the limits; 2: position valid; 3, 4: carrier solution, 1 float, 2 fixed;
    /// 5: the other antenna moves with this one; 8: heading valid.
    pub flags: u32,
}

/// NAV-ATT: attitude of the vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attitude {
    /// GPS time of week, ms.
    pub time_of_week_ms: u32,
    /// Version, 0.
    pub version: u8,
    /// Roll (right side down), pitch (nose up), heading (clockwise from true north), 1e-5 degrees.
    pub angles_1e5_deg: [i32; 3],
    /// Their accuracies, 1e-5 degrees.
    pub accuracy_1e5_deg: [u32; 3],
}

/// NAV-DOP: dilutions of precision, 0.01.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dop {
    /// GPS time of week, ms.
    pub time_of_week_ms: u32,
    /// Geometric, position, time, vertical, horizontal, northing, easting.
    pub dilutions_c: [u16; 7],
}

/// TIM-TM2: time of an edge at the input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TimeMark {
    /// Input.
    pub channel: u8,
    /// Bit 2: new falling edge; bits 3, 4: time base, 0 receiver, 1 GNSS, 2 UTC; bit 6: the time is
    /// valid; bit 7: new rising edge.
    pub flags: u8,
    /// Rising edges so far.
    pub count: u16,
    /// Weeks of the last rising and the last falling edge.
    pub weeks: [u16; 2],
    /// Time of week of the rising edge, ms, and its fraction, ns.
    pub rising: [u32; 2],
    /// Time of week of the falling edge, ms, and its fraction, ns.
    pub falling: [u32; 2],
    /// Accuracy, ns.
    pub accuracy_ns: u32,
}

/// The content of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Body {
    /// NAV-PVT.
    Pvt(Pvt),
    /// NAV-RELPOSNED.
    RelativePosition(RelativePosition),
    /// NAV-ATT.
    Attitude(Attitude),
    /// NAV-DOP.
    Dop(Dop),
    /// TIM-TM2.
    TimeMark(TimeMark),
    /// ESF-MEAS.
    Measured(Readings),
    /// ESF-RAW.
    Raw(Readings),
}

impl Body {
    /// The body of a message of this class and number; `None` if it is too short.
    pub(super) fn read(kind: [u8; 2], reader: &mut crate::codec::BinaryReader<'_>) -> Option<Self> {
        let mut body = match kind {
            [0x01, 0x07] => Self::Pvt(Pvt::default()),
            [0x01, 0x3C] => Self::RelativePosition(RelativePosition::default()),
            [0x01, 0x05] => Self::Attitude(Attitude::default()),
            [0x01, 0x04] => Self::Dop(Dop::default()),
            [0x0D, 0x03] => Self::TimeMark(TimeMark::default()),
            [0x10, 0x02] => return Some(Self::Measured(Readings::measured(reader)?)),
            [0x10, 0x03] => return Some(Self::Raw(Readings::raw(reader)?)),
            _ => return None,
        };
        body.walk(reader)?;
        Some(body)
    }

    /// Writes the payload; the result is class and number.
    pub(super) fn write(&self, c: &mut crate::codec::BinaryWriter<'_>) -> [u8; 2] {
        let mut body = *self;
        // A writer never ends the walk.
        let _ = body.walk(c);
        match self {
            Self::Pvt(_) => [0x01, 0x07],
            Self::RelativePosition(_) => [0x01, 0x3C],
            Self::Attitude(_) => [0x01, 0x05],
            Self::Dop(_) => [0x01, 0x04],
            Self::TimeMark(_) => [0x0D, 0x03],
            Self::Measured(_) => [0x10, 0x02],
            Self::Raw(_) => [0x10, 0x03],
        }
    }

    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        match self {
            Self::Pvt(b) => b.walk(c),
            Self::RelativePosition(b) => b.walk(c),
            Self::Attitude(b) => b.walk(c),
            Self::Dop(b) => {
                c.u32(&mut b.time_of_week_ms)?;
                b.dilutions_c.iter_mut().try_for_each(|v| c.u16(v))
            }
            Self::TimeMark(b) => b.walk(c),
            Self::Measured(b) => b.write_measured(c),
            Self::Raw(b) => b.write_raw(c),
        }
    }
}

fn signed(c: &mut impl Codec, value: &mut i32) -> Option<()> {
    let mut raw = value.cast_unsigned();
    c.u32(&mut raw)?;
    *value = raw.cast_signed();
    Some(())
}

fn skip(c: &mut impl Codec, count: usize) -> Option<()> {
    (0..count).try_for_each(|_| c.u8(&mut 0))
}

impl Pvt {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u32(&mut self.time_of_week_ms)?;
        c.u16(&mut self.year)?;
        self.month_to_second.iter_mut().try_for_each(|v| c.u8(v))?;
        c.u8(&mut self.valid)?;
        c.u32(&mut self.time_accuracy_ns)?;
        signed(c, &mut self.nanoseconds)?;
        c.u8(&mut self.fix)?;
        c.u8(&mut self.flags)?;
        c.u8(&mut self.flags2)?;
        c.u8(&mut self.satellites)?;
        signed(c, &mut self.longitude_1e7_deg)?;
        signed(c, &mut self.latitude_1e7_deg)?;
        signed(c, &mut self.height_mm)?;
        signed(c, &mut self.height_msl_mm)?;
        self.accuracy_mm.iter_mut().try_for_each(|v| c.u32(v))?;
        self.velocity_ned_mm_s
            .iter_mut()
            .try_for_each(|v| signed(c, v))?;
        signed(c, &mut self.ground_speed_mm_s)?;
        signed(c, &mut self.course_1e5_deg)?;
        c.u32(&mut self.speed_accuracy_mm_s)?;
        c.u32(&mut self.course_accuracy_1e5_deg)?;
        c.u16(&mut self.dilution_c)?;
        c.u16(&mut self.flags3)?;
        skip(c, 4)?;
        // Receivers before the M8 end here, with 84 bytes.
        let _ = signed(c, &mut self.heading_1e5_deg).and_then(|()| skip(c, 4));
        Some(())
    }
}

impl RelativePosition {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u8(&mut self.version)?;
        skip(c, 1)?;
        c.u16(&mut self.station)?;
        c.u32(&mut self.time_of_week_ms)?;
        let long = self.version > 0;
        self.position_ned_cm
            .iter_mut()
            .try_for_each(|v| signed(c, v))?;
        if long {
            signed(c, &mut self.length_cm)?;
            signed(c, &mut self.heading_1e5_deg)?;
            skip(c, 4)?;
        }
        for fine in &mut self.fine_100um {
            let mut raw = fine.cast_unsigned();
            c.u8(&mut raw)?;
            *fine = raw.cast_signed();
        }
        self.sigma_ned_100um.iter_mut().try_for_each(|v| c.u32(v))?;
        if long {
            c.u32(&mut self.length_sigma_100um)?;
            c.u32(&mut self.heading_sigma_1e5_deg)?;
            skip(c, 4)?;
        }
        c.u32(&mut self.flags)
    }
}

impl Attitude {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u32(&mut self.time_of_week_ms)?;
        c.u8(&mut self.version)?;
        skip(c, 3)?;
        self.angles_1e5_deg
            .iter_mut()
            .try_for_each(|v| signed(c, v))?;
        self.accuracy_1e5_deg.iter_mut().try_for_each(|v| c.u32(v))
    }
}

impl TimeMark {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u8(&mut self.channel)?;
        c.u8(&mut self.flags)?;
        c.u16(&mut self.count)?;
        self.weeks.iter_mut().try_for_each(|v| c.u16(v))?;
        self.rising.iter_mut().try_for_each(|v| c.u32(v))?;
        self.falling.iter_mut().try_for_each(|v| c.u32(v))?;
        c.u32(&mut self.accuracy_ns)
    }
}
