use super::Layout;
use super::names::{
    CLOCK_STATUS, DATUM, INERTIAL_STATUS, SOLUTION_STATUS, SOLUTION_TYPE, UTC_STATUS,
};
use crate::codec::{Codec, Names};

/// Name of a solution status or type in the ASCII form.
fn name_of(value: u32, names: Names) -> &'static str {
    names
        .iter()
        .find(|(number, _)| *number == value)
        .map_or("UNKNOWN", |(_, name)| name)
}

/// Status and type of a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Solution {
    /// Solution status; [`SOLUTION_COMPUTED`](super::SOLUTION_COMPUTED) when there is one.
    pub status: u32,
    /// Position or velocity type.
    pub kind: u32,
}

impl Solution {
    /// The status's name in the manual.
    #[must_use]
    pub fn status_name(&self) -> &'static str {
        name_of(self.status, SOLUTION_STATUS)
    }

    /// The type's name in the manual.
    #[must_use]
    pub fn kind_name(&self) -> &'static str {
        name_of(self.kind, SOLUTION_TYPE)
    }

    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.named(&mut self.status, SOLUTION_STATUS)?;
        c.named(&mut self.kind, SOLUTION_TYPE)
    }
}

/// What ends most logs: base station, ages, satellites.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tail {
    /// Base station id, padded with nulls.
    pub station: [u8; 4],
    /// Age of the corrections, s.
    pub differential_age_s: f32,
    /// Age of the solution, s.
    pub solution_age_s: f32,
    /// Satellites tracked, in the solution, and two further counts by model.
    pub satellites: [u8; 4],
    /// Reserved byte, extended solution status and two signal masks.
    pub masks: [u8; 4],
}

impl Tail {
    fn walk_ages(&mut self, c: &mut impl Codec) -> Option<()> {
        c.f32(&mut self.differential_age_s, 3)?;
        c.f32(&mut self.solution_age_s, 3)
    }

    fn walk_counts(&mut self, c: &mut impl Codec) -> Option<()> {
        self.satellites.iter_mut().try_for_each(|v| c.u8(v))?;
        self.masks.iter_mut().try_for_each(|v| c.hex(v))
    }
}

/// BESTPOS, PSRPOS, RTKPOS, BESTGNSSPOS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// Status and type.
    pub solution: Solution,
    /// Latitude, degrees.
    pub latitude_deg: f64,
    /// Longitude, degrees.
    pub longitude_deg: f64,
    /// Height above mean sea level, m.
    pub height_msl_m: f64,
    /// Height of the geoid above the ellipsoid, m.
    pub undulation_m: f32,
    /// Datum; 61 is WGS 84.
    pub datum: u32,
    /// Standard deviations of latitude, longitude and height, m.
    pub sigma_m: [f32; 3],
    /// Station, ages, satellites.
    pub tail: Tail,
}

/// BESTVEL, PSRVEL, BESTGNSSVEL.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Status and type.
    pub solution: Solution,
    /// How long before the time tag the velocity was true, s.
    pub latency_s: f32,
    /// Age of the corrections, s.
    pub age_s: f32,
    /// Speed over ground, m/s.
    pub horizontal_m_s: f64,
    /// Course over ground, clockwise from true north, degrees.
    pub track_deg: f64,
    /// Speed upwards, m/s.
    pub vertical_m_s: f64,
    /// Reserved.
    pub reserved: f32,
}

/// BESTXYZ, PSRXYZ: earth-centred, earth-fixed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cartesian {
    /// Status and type of the position.
    pub position_solution: Solution,
    /// Position, m.
    pub position_m: [f64; 3],
    /// Its standard deviations, m.
    pub position_sigma_m: [f32; 3],
    /// Status and type of the velocity.
    pub velocity_solution: Solution,
    /// Velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Its standard deviations, m/s.
    pub velocity_sigma_m_s: [f32; 3],
    /// How long before the time tag the velocity was true, s.
    pub latency_s: f32,
    /// Station, ages, satellites.
    pub tail: Tail,
}

/// BESTUTM.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Utm {
    /// Status and type.
    pub solution: Solution,
    /// Zone number.
    pub zone: u32,
    /// Zone letter, as its character code.
    pub letter: u32,
    /// Northing, m.
    pub northing_m: f64,
    /// Easting, m.
    pub easting_m: f64,
    /// Height above mean sea level, m.
    pub height_msl_m: f64,
    /// Height of the geoid above the ellipsoid, m.
    pub undulation_m: f32,
    /// Datum; 61 is WGS 84.
    pub datum: u32,
    /// Standard deviations of northing, easting and height, m.
    pub sigma_m: [f32; 3],
    /// Station, ages, satellites.
    pub tail: Tail,
}

/// TIME.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Time {
    /// 0 when the clock model is valid.
    pub clock_status: u32,
    /// Receiver clock minus GPS time, s.
    pub offset_s: f64,
    /// Its standard deviation, s.
    pub offset_sigma_s: f64,
    /// UTC minus GPS time, s: -18 since 2017.
    pub utc_offset_s: f64,
    /// UTC year.
    pub year: u32,
    /// UTC month.
    pub month: u8,
    /// UTC day.
    pub day: u8,
    /// UTC hour.
    pub hour: u8,
    /// UTC minute.
    pub minute: u8,
    /// UTC milliseconds of the minute.
    pub milliseconds: u32,
    /// 0 invalid, 1 valid, 2 warning (leap seconds from the receiver's own table).
    pub utc_status: u32,
}

/// HEADING, DUALANTENNAHEADING: from the master to the rover antenna.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heading {
    /// Status and type.
    pub solution: Solution,
    /// Length of the baseline, m.
    pub length_m: f32,
    /// Clockwise from true north, degrees.
    pub heading_deg: f32,
    /// Upwards positive, degrees.
    pub pitch_deg: f32,
    /// Reserved.
    pub reserved: f32,
    /// Standard deviation of the heading, degrees.
    pub heading_sigma_deg: f32,
    /// Standard deviation of the pitch, degrees.
    pub pitch_sigma_deg: f32,
    /// Station and satellites; no ages.
    pub tail: Tail,
}

/// INSPVA, INSPVAS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertial {
    /// GPS week.
    pub week: u32,
    /// Seconds of the week.
    pub seconds: f64,
    /// Latitude, degrees.
    pub latitude_deg: f64,
    /// Longitude, degrees.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
    /// Velocity north, east, up, m/s.
    pub velocity_neu_m_s: [f64; 3],
    /// Right side down positive, degrees.
    pub roll_deg: f64,
    /// Nose up positive, degrees.
    pub pitch_deg: f64,
    /// Clockwise from true north, degrees.
    pub azimuth_deg: f64,
    /// 3 good, 6 free, 7 alignment complete.
    pub status: u32,
}

/// HEADING2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heading2 {
    /// What HEADING has too.
    pub heading: Heading,
    /// Rover station id.
    pub rover: [u8; 4],
}

/// INSPVAX.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InertialX {
    /// As [`Inertial::status`].
    pub status: u32,
    /// Position type, as [`Solution::kind`].
    pub kind: u32,
    /// Latitude, degrees.
    pub latitude_deg: f64,
    /// Longitude, degrees.
    pub longitude_deg: f64,
    /// Height above mean sea level, m.
    pub height_msl_m: f64,
    /// Height of the geoid above the ellipsoid, m.
    pub undulation_m: f32,
    /// Velocity north, east, up, m/s.
    pub velocity_neu_m_s: [f64; 3],
    /// Roll (right side down positive), pitch (nose up positive), azimuth (clockwise from true
    /// north), degrees.
    pub attitude_deg: [f64; 3],
    /// Standard deviations of latitude, longitude, height, m; of the velocity north, east, up, m/s; of
    /// roll, pitch, azimuth, degrees.
    pub sigma: [[f32; 3]; 3],
    /// Extended solution status.
    pub extended_status: u32,
    /// Time since the last position or zero-velocity update, s.
    pub update_age_s: u16,
}

/// CORRIMUDATA, CORRIMUDATAS: increments of one sample of the inertial unit, whose rate the log does not
/// have. Gravity, the rotation of the earth and the errors of the sensors are removed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CorrectedImu {
    /// GPS week.
    pub week: u32,
    /// Seconds of the week.
    pub seconds: f64,
    /// About the right axis, the forward axis and the upward axis, rad in a sample.
    pub rotation_rad: [f64; 3],
    /// To the right, forwards, upwards, m/s in a sample.
    pub velocity_m_s: [f64; 3],
}

/// The content of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Body {
    /// BESTPOS, PSRPOS, RTKPOS.
    Position(Position),
    /// BESTVEL, PSRVEL.
    Velocity(Velocity),
    /// BESTXYZ, PSRXYZ.
    Cartesian(Cartesian),
    /// BESTUTM.
    Utm(Utm),
    /// TIME.
    Time(Time),
    /// HEADING.
    Heading(Heading),
    /// HEADING2.
    Heading2(Heading2),
    /// INSPVA, INSPVAS.
    Inertial(Inertial),
    /// INSPVAX.
    InertialX(InertialX),
    /// CORRIMUDATA, CORRIMUDATAS.
    CorrectedImu(CorrectedImu),
}

impl Body {
    pub(super) fn empty(layout: Layout) -> Self {
        match layout {
            Layout::Position => Self::Position(Position::default()),
            Layout::Velocity => Self::Velocity(Velocity::default()),
            Layout::Cartesian => Self::Cartesian(Cartesian::default()),
            Layout::Utm => Self::Utm(Utm::default()),
            Layout::Time => Self::Time(Time::default()),
            Layout::Heading => Self::Heading(Heading::default()),
            Layout::Heading2 => Self::Heading2(Heading2::default()),
            Layout::Inertial => Self::Inertial(Inertial::default()),
            Layout::InertialX => Self::InertialX(InertialX::default()),
            Layout::CorrectedImu => Self::CorrectedImu(CorrectedImu::default()),
        }
    }

    pub(super) fn layout(&self) -> Layout {
        match self {
            Self::Position(_) => Layout::Position,
            Self::Velocity(_) => Layout::Velocity,
            Self::Cartesian(_) => Layout::Cartesian,
            Self::Utm(_) => Layout::Utm,
            Self::Time(_) => Layout::Time,
            Self::Heading(_) => Layout::Heading,
            Self::Heading2(_) => Layout::Heading2,
            Self::Inertial(_) => Layout::Inertial,
            Self::InertialX(_) => Layout::InertialX,
            Self::CorrectedImu(_) => Layout::CorrectedImu,
        }
    }

    pub(super) fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        match self {
            Self::Position(b) => b.walk(c),
            Self::Velocity(b) => b.walk(c),
            Self::Cartesian(b) => b.walk(c),
            Self::Utm(b) => b.walk(c),
            Self::Time(b) => b.walk(c),
            Self::Heading(b) => b.walk(c),
            Self::Heading2(b) => b.walk(c),
            Self::Inertial(b) => b.walk(c),
            Self::InertialX(b) => b.walk(c),
            Self::CorrectedImu(b) => b.walk(c),
        }
    }
}

impl Position {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        self.solution.walk(c)?;
        c.f64(&mut self.latitude_deg, 11)?;
        c.f64(&mut self.longitude_deg, 11)?;
        c.f64(&mut self.height_msl_m, 4)?;
        c.f32(&mut self.undulation_m, 4)?;
        c.named(&mut self.datum, DATUM)?;
        self.sigma_m.iter_mut().try_for_each(|v| c.f32(v, 4))?;
        c.station(&mut self.tail.station)?;
        self.tail.walk_ages(c)?;
        self.tail.walk_counts(c)
    }
}

impl Velocity {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        self.solution.walk(c)?;
        c.f32(&mut self.latency_s, 3)?;
        c.f32(&mut self.age_s, 3)?;
        c.f64(&mut self.horizontal_m_s, 4)?;
        c.f64(&mut self.track_deg, 6)?;
        c.f64(&mut self.vertical_m_s, 4)?;
        c.f32(&mut self.reserved, 1)
    }
}

impl Cartesian {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        self.position_solution.walk(c)?;
        self.position_m.iter_mut().try_for_each(|v| c.f64(v, 4))?;
        self.position_sigma_m
            .iter_mut()
            .try_for_each(|v| c.f32(v, 4))?;
        self.velocity_solution.walk(c)?;
        self.velocity_m_s.iter_mut().try_for_each(|v| c.f64(v, 4))?;
        self.velocity_sigma_m_s
            .iter_mut()
            .try_for_each(|v| c.f32(v, 4))?;
        c.station(&mut self.tail.station)?;
        c.f32(&mut self.latency_s, 3)?;
        self.tail.walk_ages(c)?;
        self.tail.walk_counts(c)
    }
}

impl Utm {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        self.solution.walk(c)?;
        c.u32(&mut self.zone)?;
        c.letter(&mut self.letter)?;
        c.f64(&mut self.northing_m, 4)?;
        c.f64(&mut self.easting_m, 4)?;
        c.f64(&mut self.height_msl_m, 4)?;
        c.f32(&mut self.undulation_m, 4)?;
        c.named(&mut self.datum, DATUM)?;
        self.sigma_m.iter_mut().try_for_each(|v| c.f32(v, 4))?;
        c.station(&mut self.tail.station)?;
        self.tail.walk_ages(c)?;
        self.tail.walk_counts(c)
    }
}

impl Time {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.named(&mut self.clock_status, CLOCK_STATUS)?;
        c.f64(&mut self.offset_s, 12)?;
        c.f64(&mut self.offset_sigma_s, 12)?;
        c.f64(&mut self.utc_offset_s, 8)?;
        c.u32(&mut self.year)?;
        c.u8(&mut self.month)?;
        c.u8(&mut self.day)?;
        c.u8(&mut self.hour)?;
        c.u8(&mut self.minute)?;
        c.u32(&mut self.milliseconds)?;
        c.named(&mut self.utc_status, UTC_STATUS)
    }
}

impl Heading2 {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        self.heading.walk_angles(c)?;
        c.station(&mut self.rover)?;
        self.heading.walk_tail(c)
    }
}

impl InertialX {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.named(&mut self.status, INERTIAL_STATUS)?;
        c.named(&mut self.kind, SOLUTION_TYPE)?;
        c.f64(&mut self.latitude_deg, 11)?;
        c.f64(&mut self.longitude_deg, 11)?;
        c.f64(&mut self.height_msl_m, 4)?;
        c.f32(&mut self.undulation_m, 4)?;
        self.velocity_neu_m_s
            .iter_mut()
            .try_for_each(|v| c.f64(v, 4))?;
        self.attitude_deg.iter_mut().try_for_each(|v| c.f64(v, 9))?;
        let mut sigma = self.sigma.iter_mut().flatten();
        sigma.try_for_each(|v| c.f32(v, 4))?;
        c.hex32(&mut self.extended_status)?;
        c.u16(&mut self.update_age_s)
    }
}

impl CorrectedImu {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u32(&mut self.week)?;
        c.f64(&mut self.seconds, 9)?;
        self.rotation_rad
            .iter_mut()
            .try_for_each(|v| c.f64(v, 12))?;
        self.velocity_m_s.iter_mut().try_for_each(|v| c.f64(v, 12))
    }
}

impl Heading {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        self.walk_angles(c)?;
        self.walk_tail(c)
    }

    fn walk_angles(&mut self, c: &mut impl Codec) -> Option<()> {
        self.solution.walk(c)?;
        c.f32(&mut self.length_m, 4)?;
        c.f32(&mut self.heading_deg, 6)?;
        c.f32(&mut self.pitch_deg, 6)?;
        c.f32(&mut self.reserved, 1)?;
        c.f32(&mut self.heading_sigma_deg, 4)?;
        c.f32(&mut self.pitch_sigma_deg, 4)
    }

    fn walk_tail(&mut self, c: &mut impl Codec) -> Option<()> {
        c.station(&mut self.tail.station)?;
        self.tail.walk_counts(c)
    }
}

impl Inertial {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u32(&mut self.week)?;
        c.f64(&mut self.seconds, 9)?;
        c.f64(&mut self.latitude_deg, 11)?;
        c.f64(&mut self.longitude_deg, 11)?;
        c.f64(&mut self.height_m, 4)?;
        self.velocity_neu_m_s
            .iter_mut()
            .try_for_each(|v| c.f64(v, 4))?;
        c.f64(&mut self.roll_deg, 9)?;
        c.f64(&mut self.pitch_deg, 9)?;
        c.f64(&mut self.azimuth_deg, 9)?;
        c.named(&mut self.status, INERTIAL_STATUS)
    }
}
