//! The fields of a sentence. A field that is absent or makes no sense is absent; it never costs the
//! sentence.

use sample::FixQuality;

use super::{M_S_PER_KNOT, Sentence};
use crate::text::number;

/// m/s in one km/h.
const M_S_PER_KM_H: f64 = 1.0 / 3.6;

/// Fields of a sentence after its name.
struct Fields<'t>(Vec<&'t str>);

impl<'t> Fields<'t> {
    fn text(&self, index: usize) -> &'t str {
        self.0.get(index).map_or("", |field| field.trim())
    }

    fn number(&self, index: usize) -> Option<f64> {
        number(self.text(index))
    }

    /// UTC time of day `hhmmss.ss`, s. The second 60 of a leap second is a time.
    fn time_s(&self, index: usize) -> Option<f64> {
        let text = self.text(index);
        let two = |from: usize| digits(text.get(from..from + 2)?).map(f64::from);
        let (hours, minutes) = (two(0)?, two(2)?);
        let seconds = number(text.get(4..)?)?;
        let is_time = hours < 24.0 && minutes < 60.0 && (0.0..61.0).contains(&seconds);
        is_time.then_some(3600.0 * hours + 60.0 * minutes + seconds)
    }

    /// Latitude `ddmm.mm` and longitude `dddmm.mm`, each with its hemisphere, degrees.
    fn position_deg(&self, index: usize) -> Option<[f64; 2]> {
        let latitude = self.angle_deg(index, 2, ["N", "S"])?;
        let longitude = self.angle_deg(index + 2, 3, ["E", "W"])?;
        let is_place = latitude.abs() <= 90.0 && longitude.abs() <= 180.0;
        is_place.then_some([latitude, longitude])
    }

    fn angle_deg(&self, index: usize, width: usize, signs: [&str; 2]) -> Option<f64> {
        let (degrees, minutes) = self.text(index).split_at_checked(width)?;
        let minutes = number(minutes).filter(|m| (0.0..60.0).contains(m))?;
        let angle = f64::from(digits(degrees)?) + minutes / 60.0;
        match self.text(index + 1) {
            sign if sign == signs[0] => Some(angle),
            sign if sign == signs[1] => Some(-angle),
            _ => None,
        }
    }

    /// Date `ddmmyy`; the two digits are of the years 1980 to 2079.
    fn date(&self, index: usize) -> Option<(u16, u8, u8)> {
        let text = self.text(index);
        let two = |from: usize| digits(text.get(from..from + 2)?);
        let (day, month, year) = (two(0)?, two(2)?, two(4)?);
        let century = if year < 80 { 2000 } else { 1900 };
        date(century + year, month, day).filter(|_| text.len() == 6)
    }

    /// The quality of a mode indicator.
    fn mode(&self, index: usize) -> Option<FixQuality> {
        let mut letters = self.text(index).chars();
        let letter = letters.next()?;
        of_mode(letter).filter(|_| letters.next().is_none())
    }
}

fn digits(text: &str) -> Option<u16> {
    let all = text.bytes().all(|byte| byte.is_ascii_digit());
    all.then(|| text.parse().ok()).flatten()
}

fn date(year: u16, month: u16, day: u16) -> Option<(u16, u8, u8)> {
    let is_date = (1..=12).contains(&month) && (1..=31).contains(&day);
    is_date.then_some((year, month as u8, day as u8))
}

/// Positioning mode of NMEA 0183 from version 2.3 on. Manual input and simulation are no fix.
const fn of_mode(letter: char) -> Option<FixQuality> {
    Some(match letter {
        'A' | 'P' => FixQuality::Single,
        'D' => FixQuality::Differential,
        'F' => FixQuality::Float,
        'R' => FixQuality::Fixed,
        'E' => FixQuality::DeadReckoning,
        'N' | 'M' | 'S' | 'V' => FixQuality::None,
        _ => return None,
    })
}

/// Quality indicator of GGA. Receivers with corrections of a satellite send 9.
fn of_indicator(text: &str) -> FixQuality {
    match text {
        "1" | "3" => FixQuality::Single,
        "2" | "9" => FixQuality::Differential,
        "4" => FixQuality::Fixed,
        "5" => FixQuality::Float,
        "6" => FixQuality::DeadReckoning,
        _ => FixQuality::None,
    }
}

/// The sentence with this name and these fields; `None` if the sentence lacks the fields that all
/// versions of the standard have.
pub(super) fn sentence(name: &str, fields: &str) -> Option<Sentence> {
    let fields = Fields(fields.split(',').collect());
    let has = |count: usize| (fields.0.len() >= count).then_some(());
    Some(match name {
        "GGA" => {
            has(6)?;
            Sentence::Gga {
                utc_s: fields.time_s(0),
                quality: of_indicator(fields.text(5)),
                position_deg: fields.position_deg(1),
                height_msl_m: fields.number(8),
                undulation_m: fields.number(10),
                satellites: fields.text(6).parse().ok(),
            }
        }
        "GNS" => {
            has(6)?;
            Sentence::Gns {
                utc_s: fields.time_s(0),
                quality: best_mode(fields.text(5)),
                position_deg: fields.position_deg(1),
                height_msl_m: fields.number(8),
                undulation_m: fields.number(9),
                satellites: fields.text(6).parse().ok(),
            }
        }
        "RMC" => {
            has(9)?;
            rmc(&fields)
        }
        "VTG" => {
            has(4)?;
            vtg(&fields)
        }
        "HDT" => Sentence::Hdt {
            heading_deg: fields.number(0),
        },
        "THS" => {
            has(2)?;
            Sentence::Ths {
                heading_deg: fields.number(0),
                quality: fields.mode(1).unwrap_or_default(),
            }
        }
        "GST" => {
            has(8)?;
            Sentence::Gst {
                utc_s: fields.time_s(0),
                sigma_enu_m: [fields.number(6), fields.number(5), fields.number(7)],
            }
        }
        "ZDA" => {
            has(4)?;
            zda(&fields)
        }
        "HRP" => {
            has(10)?;
            hrp(&fields)
        }
        _ => return None,
    })
}

fn zda(fields: &Fields<'_>) -> Sentence {
    let part = |index: usize| digits(fields.text(index)).filter(|part| *part > 0);
    let parts = part(3).zip(part(2)).zip(part(1));
    Sentence::Zda {
        utc_s: fields.time_s(0),
        date: parts.and_then(|((year, month), day)| date(year, month, day)),
    }
}

fn hrp(fields: &Fields<'_>) -> Sentence {
    Sentence::Hrp {
        utc_s: fields.time_s(0),
        heading_deg: fields.number(2),
        roll_deg: fields.number(3),
        pitch_deg: fields.number(4),
        sigma_deg: [fields.number(5), fields.number(6), fields.number(7)],
        satellites: fields.text(8).parse().ok(),
        mode: fields.text(9).parse().unwrap_or(0),
    }
}

/// One mode for each system: the best of them is that of the solution.
fn best_mode(modes: &str) -> FixQuality {
    let rank = |quality: &FixQuality| match quality {
        FixQuality::None => 0,
        FixQuality::DeadReckoning => 1,
        FixQuality::Single => 2,
        FixQuality::Differential => 3,
        FixQuality::Float => 4,
        FixQuality::Fixed => 5,
    };
    let modes = modes.chars().filter_map(of_mode);
    modes.max_by_key(rank).unwrap_or_default()
}

fn rmc(fields: &Fields<'_>) -> Sentence {
    // Before version 2.3 there is no mode. Some receivers of that time leave the direction of the
    // magnetic variation out, so that a mode stands in its place.
    let shifted = || {
        fields
            .mode(10)
            .filter(|_| fields.0.len() == 11 && fields.text(10) != "E")
    };
    let mode = fields.mode(11).or_else(shifted);
    Sentence::Rmc {
        utc_s: fields.time_s(0),
        quality: match fields.text(1) {
            "A" => mode.unwrap_or(FixQuality::Single),
            _ => FixQuality::None,
        },
        position_deg: fields.position_deg(2),
        speed_m_s: fields.number(6).map(|knots| knots * M_S_PER_KNOT),
        course_deg: fields.number(7),
        date: fields.date(8),
    }
}

fn vtg(fields: &Fields<'_>) -> Sentence {
    // Before version 2.0 the numbers stand without their units.
    let has_units = fields.0.len() > 4;
    let [knots, km_h] = if has_units { [4, 6] } else { [2, 3] };
    let knots = fields.number(knots).map(|speed| speed * M_S_PER_KNOT);
    let km_h = fields.number(km_h).map(|speed| speed * M_S_PER_KM_H);
    Sentence::Vtg {
        quality: if has_units { fields.mode(8) } else { None },
        speed_m_s: knots.or(km_h),
        course_deg: fields.number(0),
    }
}
