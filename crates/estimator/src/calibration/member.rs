//! Gains of the gauges of one member from known loads on a bench (thesis section 5.3.1).
//!
//! Each channel of the member is fitted by least squares over the rows of the bench:
//!
//! counts = zero + s L + x K + (h/2) d + (a + s c L) (T - T_0)
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | L | load that the channel measures: tension (axial), moment at the gauges (bending) | N, N m |
//! | K | load that the channel must not measure: the other one | N m, N |
//! | s | sensitivity, 1/s is the gain | counts/N, counts/(N m) |
//! | x | sensitivity to the other load; x/s is the cross sensitivity | counts/(N m), counts/N |
//! | h | hysteresis: counts while the load rises less those while it falls | counts |
//! | d | direction of the last change of L: 1 rising, -1 falling | - |
//! | T, T_0 | temperature of the member, and its mean over the bench | degrees Celsius |
//! | a | drift of the zero | counts/K |
//! | c | relative drift of the sensitivity | 1/K |
//!
//! x is fitted if the other load changes, h if the load was put on and taken off, a and c if the temperature
//! changes by [`CHANGE_NEEDED_K`]. The intervals are those of Student's t distribution with white residuals. The
//! standard deviation of the gain also contains that of the loads, which is common to all rows.

mod line;

use model::sensors::Sensors;
use model::strain::{full_scale, largest_count};
use model::vehicle::Vehicle;
use sample::{StrainChannel, Wheel};

use self::line::Line;
use super::temperature::CHANGE_NEEDED_K;
use super::{Calibration, ChannelCalibration, Resolved, TemperatureCalibration};
use crate::EstimatorError;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::statistics::interval_95;

const WHAT: &str = "calibrate member";
/// Fewest different loads: two give a line, the third one shows whether it is straight.
const LOADS_NEEDED: usize = 3;
/// Loads are different if they differ by this part of the range of all loads.
const APART: f64 = 0.02;
/// Least change of the counts over the range of the loads.
const COUNTS_NEEDED: f64 = 10.0;
/// A gain this many times the nominal one, or its reciprocal, is not the nominal wiring.
const GAIN_WITHIN: f64 = 1.5;
/// Largest part of the bending strain of the outer fibre that an axial bridge is expected to measure.
const BENDING_PART_MAX: f64 = 0.1;
/// What to do if there are too few loads.
const MORE_LOADS: &str = "put on at least three different loads one after the other, none among them, and take them \
                          off again in the same steps; write a row for each step";

/// One row of the bench.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BenchLoad {
    /// Tension of the member, N; compression is negative.
    pub load_n: f64,
    /// Bending moment at the gauges, N m, with the sign of the vehicle: positive as an upward force of the upright
    /// on the ball joint of the lower arm.
    pub moment_n_m: f64,
    /// Mean counts of the axial channel.
    pub axial_counts: Option<f64>,
    /// Mean counts of the bending channel.
    pub bending_counts: Option<f64>,
    /// Temperature of the member at its gauges, degrees Celsius.
    pub temperature_c: Option<f64>,
}

/// What is known of the bench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bench {
    /// Corner of the member.
    pub wheel: Wheel,
    /// Axial channel of the member.
    pub member: StrainChannel,
    /// Standard deviation of the loads, as a fraction of each load, the same in all rows.
    pub load_sigma: f64,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct MemberBench {
    /// Gain, zero, cross sensitivity, hysteresis and drift of each channel.
    pub findings: Findings,
    /// The calibration with gains, zeros and drifts in it.
    pub calibration: Calibration,
}

/// Finds gains and zeros of the channels of one member from rows in the order in which the loads were applied.
///
/// # Errors
/// A value that is not usable, too few different loads, a channel that does not change, loads that cannot be
/// told apart, or a bending channel of a member without one.
pub fn member(
    vehicle: &Vehicle,
    sensors: &Sensors,
    known: &Calibration,
    rows: &[BenchLoad],
    bench: &Bench,
) -> Result<MemberBench, EstimatorError> {
    if matches!(
        bench.member,
        StrainChannel::LowerFrontBending | StrainChannel::LowerRearBending
    ) {
        return Err(missing(
            &format!("member {}", bench.member.name()),
            "name the member by its axial channel; bending_counts are those of its bending bridge",
        )
        .into());
    }
    let resolved = Resolved::new(sensors, known)?;
    for (number, row) in rows.iter().enumerate() {
        check(number + 1, row, sensors)?;
    }
    let mut found = MemberBench {
        findings: Findings {
            what: format!(
                "gauges of {} {} on a bench",
                bench.wheel,
                vehicle.channel_name(bench.wheel, bench.member)
            ),
            ..Findings::default()
        },
        calibration: known.clone(),
    };
    let temperature_c = temperatures(rows)?;
    let mut channels = 0;
    for bends in [false, true] {
        let counts = |row: &BenchLoad| match bends {
            false => row.axial_counts,
            true => row.bending_counts,
        };
        let Some(counts) = column(rows, counts, counts_name(bends))? else {
            continue;
        };
        channels += 1;
        let channel = channel(vehicle, sensors, bench, bends)?;
        let line = Line::fit(rows, &counts, temperature_c.as_deref(), bends)
            .map_err(|refusal| of_channel(refusal, channel))?;
        let nominal = resolved.corners[bench.wheel].strain[channel.index()].gain;
        found.take(bench, channel, &line);
        found.judge(vehicle, sensors, bench, channel, &line, nominal);
    }
    if channels == 0 {
        return Err(missing(
            "column of counts",
            "give axial_counts, bending_counts or both",
        )
        .into());
    }
    Ok(found)
}

fn missing(channel: &str, help: &str) -> Refusal {
    Refusal::Missing {
        what: WHAT.to_owned(),
        channel: channel.to_owned(),
        help: help.to_owned(),
    }
}

fn of_channel(refusal: Refusal, channel: StrainChannel) -> Refusal {
    refusal.of(&format!("{WHAT}: {}", channel.name()))
}

const fn counts_name(bends: bool) -> &'static str {
    if bends {
        "bending_counts"
    } else {
        "axial_counts"
    }
}

/// A column that all rows have, or none.
fn column(
    rows: &[BenchLoad],
    value: impl Fn(&BenchLoad) -> Option<f64>,
    name: &str,
) -> Result<Option<Vec<f64>>, Refusal> {
    let values: Vec<f64> = rows.iter().filter_map(&value).collect();
    if values.is_empty() {
        return Ok(None);
    }
    match rows.iter().position(|row| value(row).is_none()) {
        None => Ok(Some(values)),
        Some(row) => Err(missing(
            &format!("{name} in row {}", row + 1),
            "write the column in all rows, or in none",
        )),
    }
}

fn temperatures(rows: &[BenchLoad]) -> Result<Option<Vec<f64>>, Refusal> {
    column(rows, |row| row.temperature_c, "temperature_c")
}

/// The channel of the member with this kind of bridge.
fn channel(
    vehicle: &Vehicle,
    sensors: &Sensors,
    bench: &Bench,
    bends: bool,
) -> Result<StrainChannel, EstimatorError> {
    if !bends {
        return Ok(bench.member);
    }
    let of_member = match bench.member {
        StrainChannel::LowerFront => Some(StrainChannel::LowerFrontBending),
        StrainChannel::LowerRear => Some(StrainChannel::LowerRearBending),
        _ => None,
    };
    if vehicle.axle(bench.wheel).is_solid() {
        return Err(missing(
            "bending bridge on a link of a solid axle",
            "the bending bridges of a solid axle are on its tube; remove the column bending_counts",
        )
        .into());
    }
    match (of_member, &sensors.strain.bending) {
        (Some(channel), Some(_)) => Ok(channel),
        (None, _) => Err(missing(
            &format!("bending bridge on {}", bench.member.name()),
            "only lower_front and lower_rear have one; remove the column bending_counts",
        )
        .into()),
        (_, None) => Err(missing(
            "bending bridge in the sensors file",
            "add the table strain.bending, or remove the column bending_counts",
        )
        .into()),
    }
}

fn check(number: usize, row: &BenchLoad, sensors: &Sensors) -> Result<(), Refusal> {
    let refuse = |name: &str, value: f64, expected: String| {
        Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: format!("{name} in row {number}"),
            value,
            expected,
        })
    };
    let optional = [
        ("axial_counts", row.axial_counts),
        ("bending_counts", row.bending_counts),
        ("temperature_c", row.temperature_c),
    ];
    let given = [
        ("load_n", Some(row.load_n)),
        ("moment_n_m", Some(row.moment_n_m)),
    ];
    for (name, value) in given.into_iter().chain(optional) {
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            return refuse(name, value, "a finite number".to_owned());
        }
    }
    let last = largest_count(full_scale(sensors.strain.adc_bits));
    for (name, counts) in &optional[..2] {
        if let Some(counts) = counts.filter(|counts| !(0.0 < *counts && *counts < last)) {
            return refuse(
                name,
                counts,
                format!(
                    "a count above 0 and below {last} (strain.adc_bits = {}); use smaller loads, or a smaller gain \
                     of the amplifier",
                    sensors.strain.adc_bits
                ),
            );
        }
    }
    Ok(())
}

impl MemberBench {
    /// Writes a channel into the calibration, and its values into the findings.
    fn take(&mut self, bench: &Bench, channel: StrainChannel, line: &Line) {
        let corner = self.calibration.corner.entry(bench.wheel).or_default();
        let slot = corner.strain.entry(channel).or_default();
        let mut drift = slot.temperature;
        if let Some([zero, gain]) = line.drift {
            drift = Some(TemperatureCalibration {
                reference_c: line.reference_c.unwrap_or_default(),
                offset_counts_per_k: zero[0],
                offset_sigma_counts_per_k: zero[1],
                offset_counts_per_k2: 0.0,
                gain_per_k: gain[0],
                gain_sigma_per_k: gain[1],
            });
        } else if let Some(reference_c) = line.reference_c {
            drift.get_or_insert_default().reference_c = reference_c;
        }
        *slot = ChannelCalibration {
            offset_counts: Some(line.zero[0]),
            offset_sigma_counts: Some(line.zero[1]),
            gain_per_count: Some(1.0 / line.slope[0]),
            dead: false,
            temperature: drift,
        };
        let (load, other) = if line.bends {
            ("N m", "N")
        } else {
            ("N", "N m")
        };
        let gain = 1.0 / line.slope[0];
        let relative = math::hypot(line.slope[1] / line.slope[0], bench.load_sigma);
        self.tell(
            channel,
            line,
            "gain",
            [gain, gain.abs() * relative],
            &format!("{load}/count"),
        );
        self.tell(channel, line, "zero", line.zero, "counts");
        let more = [
            (
                "cross_sensitivity",
                line.cross,
                format!("({load})/({other})"),
            ),
            ("hysteresis", line.hysteresis, "counts".to_owned()),
            (
                "zero_drift",
                line.drift.map(|drift| drift[0]),
                "counts/K".to_owned(),
            ),
            (
                "gain_drift",
                line.drift.map(|drift| drift[1]),
                "1/K".to_owned(),
            ),
        ];
        for (name, value, unit) in more {
            if let Some(value) = value {
                self.tell(channel, line, name, value, &unit);
            }
        }
        self.findings.beside.push((
            format!("{}: largest residual, part of the range", channel.name()),
            line.largest_residual / line.range_counts,
            "-".to_owned(),
        ));
        self.findings.figures.push(figure(channel, line));
    }

    fn tell(
        &mut self,
        channel: StrainChannel,
        line: &Line,
        name: &str,
        [value, sigma]: [f64; 2],
        unit: &str,
    ) {
        // The standard deviation of the residuals comes from few rows.
        let sigma = sigma * line.widen;
        self.findings.findings.push(Finding {
            name: format!("{}_{name}", channel.name()),
            value,
            unit: unit.to_owned(),
            sigma,
            interval: Some(interval_95(value, sigma)),
            condition: line.condition,
            excitation: Some(Excitation {
                rms: line.excitation,
                unit: if line.bends { "N m" } else { "N" }.to_owned(),
            }),
            whiteness: Some(line.whiteness),
            span: Span {
                rows: line.load.len(),
                ..Span::default()
            },
        });
    }

    /// Notes what is not as the sensors file states, and what the bench did not tell.
    fn judge(
        &mut self,
        vehicle: &Vehicle,
        sensors: &Sensors,
        bench: &Bench,
        channel: StrainChannel,
        line: &Line,
        nominal: f64,
    ) {
        let name = vehicle.channel_name(bench.wheel, channel);
        let mut note = |text: String| self.findings.notes.push(format!("{name}: {text}"));
        let gain = 1.0 / line.slope[0];
        if gain < 0.0 {
            note("the counts fall as the load rises, so that the gain is negative: the bridge is inverted".to_owned());
        }
        let ratio = (gain / nominal).abs();
        if !(1.0 / GAIN_WITHIN..GAIN_WITHIN).contains(&ratio) {
            note(format!(
                "the gain is {ratio:.2} times that of the sensors file or of the earlier calibration; look at the wiring \
                 of the bridge and at the gain resistor"
            ));
        }
        if let (false, Some([cross, _]), Ok(section)) =
            (line.bends, line.cross, sensors.strain.section())
        {
            let part = cross * section.section_modulus_m3() / section.area_m2();
            if part.abs() > BENDING_PART_MAX {
                note(format!(
                    "the axial bridge measures {:.0} % of the bending strain of the outer fibre; a gauge is in a wrong \
                     arm of the bridge, or only one side of the tube has a gauge",
                    100.0 * part.abs()
                ));
            }
        }
        let other = if line.bends { "load_n" } else { "moment_n_m" };
        if line.cross.is_none() {
            note(format!(
                "{other} does not change, so that the cross sensitivity is unknown"
            ));
        }
        if line.hysteresis.is_none() {
            note(
                "the load was not taken off in steps, so that the hysteresis is unknown".to_owned(),
            );
        }
        if line.drift.is_none() {
            note(match line.temperature_range_k {
                Some(range_k) => format!(
                    "the temperature changes by {range_k:.1} K, so that the drift is unknown; {CHANGE_NEEDED_K} K are \
                     needed"
                ),
                None => "the table has no temperature_c, so that the drift is unknown".to_owned(),
            });
        }
        note(
            "the zero is that on the bench; `calibrate zero` gives that on the vehicle".to_owned(),
        );
    }
}

fn figure(channel: StrainChannel, line: &Line) -> Figure {
    let branch = |name: &str, falls: bool| {
        let points = (0..line.load.len()).filter(|k| (line.direction[*k] < 0.0) == falls);
        let (x, y) = points.map(|k| (line.load[k], line.own_counts[k])).unzip();
        Series {
            name: name.to_owned(),
            line: false,
            x,
            y,
        }
    };
    let ends = line
        .load
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], load| {
            [low.min(*load), high.max(*load)]
        });
    Figure {
        title: format!("{}: counts against the load", channel.name()),
        x_label: if line.bends {
            "moment (N m)"
        } else {
            "tension (N)"
        }
        .to_owned(),
        y_label: "counts from the zero, without other effects".to_owned(),
        series: vec![
            branch("load rising", false),
            branch("load falling", true),
            Series {
                name: "gain".to_owned(),
                line: true,
                x: ends.to_vec(),
                y: ends.map(|load| load * line.slope[0]).to_vec(),
            },
        ],
    }
}

#[cfg(test)]
mod tests;
