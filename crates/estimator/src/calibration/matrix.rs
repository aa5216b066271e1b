//! A corner without geometry: what each channel reads of the forces on the wheel, as a matrix.
//!
//! counts = zero + sum over j (s_j + s'_j x) F_j + sum over j (t_j + t'_j x) M_j
//!
//! | symbol | what | unit |
//! |---|---|---|
//! | F_x | force forward, at the wheel centre: a wheel that turns freely on its spindle passes no moment about it | N |
//! | F_y, F_z | forces to the left and up, at the contact point: below the wheel centre | N |
//! | M_x, M_z | moments about the contact point | N m |
//! | M_y | moment about the spindle, such as that of a brake on the upright | N m |
//! | x | compression of the strut beyond that at which the matrix was measured | m |
//! | s_j | sensitivity to a force | counts/N |
//! | s'_j | change of it with the compression | counts/(N m) |
//! | t_j | sensitivity to a moment | counts/(N m) |
//! | t'_j | change of it with the compression | counts/(N m^2) |
//!
//! Forces and moments are those that pass the gauges: those of the ground, less the weight and the inertia of
//! the mass between gauges and road. The channels are the five axial ones. Their names have no meaning here.

use std::collections::BTreeMap;
use std::fmt;

use model::sensors::Transducer;
use model::vehicle::Vehicle;
use nalgebra::{Matrix3, Vector3};
use sample::{STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};
use serde::{Deserialize, Serialize};

use super::load_rig::RigLoad;
use super::resolved::wheel_key;
use crate::EstimatorError;
use crate::statics::AXIAL;

/// Largest condition number of the channels' sensitivities to F_x, F_y, F_z. Above it, an error of the
/// sensitivities of 1 % is an error of a force of half of the largest one.
pub const CONDITION_MAX: f64 = 50.0;
/// Fewest channels that tell three forces.
const CHANNELS_NEEDED: usize = 3;

/// A corner that is described by a matrix.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatrixCalibration {
    /// Axes of forces and moments.
    #[serde(default)]
    pub axes: MatrixAxes,
    /// Compression of the strut from its design length at which the matrix holds, m.
    #[serde(default)]
    pub compression_m: f64,
    /// Height of the wheel centre above the contact point of the matrix, m; absent: under the static load of the
    /// vehicle file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_height_m: Option<f64>,
    /// Mass between gauges and road, kg; absent: all unsprung masses of the corner in the vehicle file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outboard_mass_kg: Option<f64>,
    /// Sensitivities of the channels.
    pub channel: BTreeMap<StrainChannel, Sensitivity>,
    /// Force of the strut by the same loads; absent: by the motion ratio and the roll centre of the vehicle
    /// file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strut: Option<StrutSensitivity>,
}

/// Force of spring and stops for the forces on the wheel. By virtual work, it also tells how the wheel moves and
/// turns with the strut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrutSensitivity {
    /// Strut force for F_x, F_y, F_z, as parts of them.
    pub part: [f64; 3],
    /// Standard deviations of these.
    #[serde(default)]
    pub part_sigma: [f64; 3],
    /// Change of `part` for 1 m of compression.
    #[serde(default)]
    pub change_per_m: [f64; 3],
    /// Standard deviations of these.
    #[serde(default)]
    pub change_per_m_sigma: [f64; 3],
    /// Strut force for M_x, M_y, M_z, 1/m.
    #[serde(default)]
    pub per_m: [f64; 3],
    /// Standard deviations of these.
    #[serde(default)]
    pub per_m_sigma: [f64; 3],
    /// Change of `per_m` for 1 m of compression.
    #[serde(default)]
    pub moment_change_per_m: [f64; 3],
    /// What the strut of the vehicle file pushes too much, N.
    #[serde(default)]
    pub offset_n: f64,
}

/// Axes in which a matrix is constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MatrixAxes {
    /// Those of the vehicle: gauges on a linkage, which does not turn as the wheel is steered.
    #[default]
    Vehicle,
    /// Those of the wheel carrier: gauges or a transducer in the wheel or on the upright.
    Wheel,
}

/// Sensitivities of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensitivity {
    /// Counts for 1 kN of F_x, F_y, F_z.
    pub counts_per_kn: [f64; 3],
    /// Standard deviations of these, counts/kN.
    #[serde(default)]
    pub counts_per_kn_sigma: [f64; 3],
    /// Counts for 1 kN m of M_x, M_y, M_z.
    #[serde(default)]
    pub counts_per_kn_m: [f64; 3],
    /// Standard deviations of these, counts/(kN m).
    #[serde(default)]
    pub counts_per_kn_m_sigma: [f64; 3],
    /// Change of `counts_per_kn` for 1 m of compression.
    #[serde(default)]
    pub change_per_m: [f64; 3],
    /// Standard deviations of these.
    #[serde(default)]
    pub change_per_m_sigma: [f64; 3],
    /// Change of `counts_per_kn_m` for 1 m of compression.
    #[serde(default)]
    pub moment_change_per_m: [f64; 3],
    /// Standard deviations of these.
    #[serde(default)]
    pub moment_change_per_m_sigma: [f64; 3],
}

impl Sensitivity {
    fn values(&self) -> [(&'static str, [f64; 3]); 8] {
        [
            ("counts_per_kn", self.counts_per_kn),
            ("counts_per_kn_sigma", self.counts_per_kn_sigma),
            ("counts_per_kn_m", self.counts_per_kn_m),
            ("counts_per_kn_m_sigma", self.counts_per_kn_m_sigma),
            ("change_per_m", self.change_per_m),
            ("change_per_m_sigma", self.change_per_m_sigma),
            ("moment_change_per_m", self.moment_change_per_m),
            ("moment_change_per_m_sigma", self.moment_change_per_m_sigma),
        ]
    }

    /// The same channel wired the other way round.
    pub(super) fn invert(&mut self) {
        for values in [
            &mut self.counts_per_kn,
            &mut self.counts_per_kn_m,
            &mut self.change_per_m,
            &mut self.moment_change_per_m,
        ] {
            *values = values.map(|value| 0.0 - value);
        }
    }

    /// Counts for 1 N of force in the direction of the largest response.
    fn size(&self) -> f64 {
        1e-3 * Vector3::from(self.counts_per_kn).norm()
    }
}

/// The matrix of a corner with the channels in newtons: of each channel, the gains on the three forces have
/// the length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensitivityMatrix {
    /// Axes of forces and moments.
    pub axes: MatrixAxes,
    /// Compression of the strut from its design length at which the matrix holds, m.
    pub compression_m: f64,
    /// Height of the wheel centre above the contact point of the matrix, m; `None`: under the static load.
    pub contact_height_m: Option<f64>,
    /// Mass between gauges and road, kg; `None`: all unsprung masses.
    pub outboard_mass_kg: Option<f64>,
    /// Force of the strut, where the loads have told it.
    pub strut: Option<StrutSensitivity>,
    /// Rows of the five axial channels.
    pub rows: [Option<MatrixRow>; 5],
}

/// A row of the matrix, in N of the channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MatrixRow {
    /// Gains on F_x, F_y, F_z, 1, and on M_x, M_y, M_z, 1/m.
    pub gains: [f64; 6],
    /// Their standard deviations.
    pub sigma: [f64; 6],
    /// Change of the gains with the compression, 1/m and 1/m^2.
    pub change: [f64; 6],
    /// Its standard deviations.
    pub change_sigma: [f64; 6],
}

/// How well channels tell the three forces apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditioning {
    /// Largest over smallest singular value.
    pub number: f64,
    /// Unit vector of the force to which the channels react least: parts along x, y, z.
    pub weakest: [f64; 3],
}

impl Conditioning {
    /// That of these gains on F_x, F_y, F_z.
    #[must_use]
    pub fn of(rows: impl Iterator<Item = [f64; 3]>) -> Self {
        let square: Matrix3<f64> = rows
            .map(Vector3::from)
            .map(|row| row * row.transpose())
            .sum();
        let eigen = square.symmetric_eigen();
        let (least, most) = (eigen.eigenvalues.imin(), eigen.eigenvalues.imax());
        // Below rounding, there is no response at all.
        let [low, high] = [least, most].map(|i| eigen.eigenvalues[i].max(0.0));
        let number = if low > 1e-14 * high {
            (high / low).sqrt()
        } else {
            f64::INFINITY
        };
        let weakest = eigen.eigenvectors.column(least);
        let sign = weakest[weakest.iamax()].signum();
        Self {
            number,
            weakest: std::array::from_fn(|axis| sign * weakest[axis]),
        }
    }

    /// Whether all three forces can be told.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.number <= CONDITION_MAX
    }
}

/// Parts of a unit vector, and the force that it is nearest to.
pub(super) struct Direction(pub(super) [f64; 3]);

impl Direction {
    /// Name of the nearest force.
    pub(super) fn nearest(&self) -> &'static str {
        let names = ["F_x", "F_y", "F_z"];
        names[Vector3::from(self.0).iamax()]
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Rounded, so that no zero has a sign.
        let [x, y, z] = self.0.map(|part| (part * 100.0).round() / 100.0 + 0.0);
        write!(f, "{x:.2} F_x {y:+.2} F_y {z:+.2} F_z")
    }
}

impl SensitivityMatrix {
    /// The matrix of a corner: that of the calibration, or that of its transducer.
    ///
    /// # Errors
    /// As [`SensitivityMatrix::new`].
    pub(super) fn of(
        wheel: Wheel,
        given: Option<&MatrixCalibration>,
        transducer: Option<&Transducer>,
    ) -> Result<Option<Self>, EstimatorError> {
        match given {
            Some(given) => Self::new(wheel, given).map(Some),
            None => Ok(transducer.map(Self::of_transducer)),
        }
    }

    /// The matrix of a corner of a calibration file.
    ///
    /// # Errors
    /// If a value cannot be used, or if the channels do not tell the three forces apart.
    pub(super) fn new(wheel: Wheel, given: &MatrixCalibration) -> Result<Self, EstimatorError> {
        let name = format!("corner.{}.matrix", wheel_key(wheel));
        check(&name, given)?;
        let mut rows = [None; 5];
        for (slot, channel) in rows.iter_mut().zip(AXIAL) {
            *slot = given.channel.get(&channel).map(MatrixRow::new);
        }
        let matrix = Self {
            axes: given.axes,
            compression_m: given.compression_m,
            contact_height_m: given.contact_height_m,
            outboard_mass_kg: given.outboard_mass_kg,
            strut: given.strut,
            rows,
        };
        matrix.conditioned(wheel, [true; 5])?;
        Ok(matrix)
    }

    /// That of a wheel-force transducer, whose channels are the forces.
    fn of_transducer(transducer: &Transducer) -> Self {
        let row = |axis: usize| {
            let mut row = MatrixRow::default();
            row.gains[axis] = 1.0;
            row.sigma[..3].fill(transducer.sigma_part);
            Some(row)
        };
        Self {
            axes: MatrixAxes::Wheel,
            compression_m: 0.0,
            contact_height_m: None,
            outboard_mass_kg: Some(transducer.outboard_mass_kg),
            strut: None,
            rows: [row(0), row(1), row(2), None, None],
        }
    }

    /// Checks that the channels that are used tell the three forces apart.
    pub(super) fn conditioned(
        &self,
        wheel: Wheel,
        used: [bool; 5],
    ) -> Result<Conditioning, EstimatorError> {
        let rows = || self.rows.iter().zip(used);
        let of_used = || rows().filter_map(|(row, used)| row.filter(|_| used));
        let found = Conditioning::of(of_used().map(|row| [0, 1, 2].map(|axis| row.gains[axis])));
        if found.is_sound() && of_used().count() >= CHANNELS_NEEDED {
            return Ok(found);
        }
        let channels = AXIAL.into_iter().zip(rows());
        let channels: Vec<&str> = channels
            .filter(|(_, (row, used))| row.is_some() && *used)
            .map(|(channel, _)| channel.name())
            .collect();
        let direction = Direction(found.weakest);
        Err(EstimatorError::Matrix {
            name: format!("corner.{}.matrix", wheel_key(wheel)),
            channels: channels.join(", "),
            condition: found.number,
            direction: direction.to_string(),
            force: direction.nearest(),
        })
    }

    /// What a load makes of channel `i`, N; none of a channel without a row.
    pub(super) fn response_n(&self, i: usize, vehicle: &Vehicle, load: &RigLoad) -> f64 {
        let Some(Some(row)) = self.rows.get(i) else {
            return 0.0;
        };
        let compression_m = load.compression_m - self.compression_m;
        let passing = passing(vehicle, load, self.outboard_mass_kg);
        (0..6)
            .map(|j| (row.gains[j] + row.change[j] * compression_m) * passing[j])
            .sum()
    }

    /// Fewest channels with a reading that tell the three forces.
    #[must_use]
    pub fn channels_needed(&self) -> usize {
        let there = self.rows.iter().flatten().count();
        there.min(CHANNELS_NEEDED + 1)
    }
}

impl MatrixRow {
    fn new(given: &Sensitivity) -> Self {
        let part = 1e-3 / given.size();
        let scaled = |values: [f64; 3]| values.map(|value| part * value);
        let both = |forces: [f64; 3], moments: [f64; 3]| {
            let (forces, moments) = (scaled(forces), scaled(moments));
            std::array::from_fn(|i| if i < 3 { forces[i] } else { moments[i - 3] })
        };
        Self {
            gains: both(given.counts_per_kn, given.counts_per_kn_m),
            sigma: both(given.counts_per_kn_sigma, given.counts_per_kn_m_sigma),
            change: both(given.change_per_m, given.moment_change_per_m),
            change_sigma: both(given.change_per_m_sigma, given.moment_change_per_m_sigma),
        }
    }
}

impl MatrixCalibration {
    /// Newtons of a count of a channel, in the direction of the channel's largest response.
    pub(super) fn gain_per_count(&self, channel: StrainChannel) -> Option<f64> {
        Some(1.0 / self.channel.get(&channel)?.size())
    }
}

/// Height of the wheel centre above the contact point under the static load, m.
pub(crate) fn contact_height_m(vehicle: &Vehicle, wheel: Wheel) -> f64 {
    let tyre = &vehicle.axle(wheel).tyre;
    tyre.unloaded_radius_m - vehicle.static_load_n(wheel) / tyre.vertical_stiffness_n_m.max(1.0)
}

/// Forces, N, and moments, N m, of a load that pass the gauges of a corner at rest, as a matrix has them. The
/// outboard mass hangs on the gauges: all unsprung parts if it is not given.
pub(super) fn passing(
    vehicle: &Vehicle,
    load: &RigLoad,
    outboard_mass_kg: Option<f64>,
) -> [f64; 6] {
    let unsprung = vehicle.axle(load.wheel).unsprung.as_ref();
    let all_kg = unsprung.map_or(0.0, |parts| parts.total_mass_kg());
    let weight_n = outboard_mass_kg.unwrap_or(all_kg) * STANDARD_GRAVITY_M_S2;
    let force = Vector3::from(load.force_n);
    let moment = Vector3::from(load.at_m).cross(&force);
    let height_m = contact_height_m(vehicle, load.wheel);
    [
        force.x,
        force.y,
        force.z - weight_n,
        moment.x - height_m * force.y,
        moment.y,
        moment.z,
    ]
}

fn refused(name: String, value: f64, expected: &'static str) -> Result<(), EstimatorError> {
    Err(EstimatorError::Value {
        name,
        value,
        expected,
    })
}

/// Refuses what is wrong with the strut of a matrix.
fn check_strut(name: &str, strut: &StrutSensitivity) -> Result<(), EstimatorError> {
    let values = [
        ("part", strut.part),
        ("part_sigma", strut.part_sigma),
        ("change_per_m", strut.change_per_m),
        ("change_per_m_sigma", strut.change_per_m_sigma),
        ("per_m", strut.per_m),
        ("per_m_sigma", strut.per_m_sigma),
        ("moment_change_per_m", strut.moment_change_per_m),
        ("offset_n", [strut.offset_n; 3]),
    ];
    let mut numbers =
        (values.iter()).flat_map(|(value, numbers)| numbers.iter().map(|number| (*value, *number)));
    if let Some((value, number)) = numbers.find(|(_, number)| !number.is_finite()) {
        return refused(format!("{name}.strut.{value}"), number, "a finite number");
    }
    // A strut that a load of the wheel does not compress has no motion ratio.
    if strut.part[2] < 0.2 {
        let expected = "the part of F_z that the strut carries, 0.2 or more";
        return refused(format!("{name}.strut.part"), strut.part[2], expected);
    }
    Ok(())
}

/// Refuses values that are not finite, negative standard deviations and channels without a response.
fn check(name: &str, given: &MatrixCalibration) -> Result<(), EstimatorError> {
    let field = |field: &str| format!("{name}.{field}");
    // No strut travels further.
    if !(-1.0..=1.0).contains(&given.compression_m) {
        let expected = "the compression of the strut from its design length in m, within 1 m";
        return refused(field("compression_m"), given.compression_m, expected);
    }
    if let Some(mass) = given.outboard_mass_kg
        && !(0.0..1e4).contains(&mass)
    {
        let expected = "a mass in kg, 0 or more";
        return refused(field("outboard_mass_kg"), mass, expected);
    }
    if let Some(strut) = &given.strut {
        check_strut(name, strut)?;
    }
    if let Some(height) = given.contact_height_m
        && !(0.05..3.0).contains(&height)
    {
        let expected = "the height of the wheel centre above the ground in m, 0.05 to 3";
        return refused(field("contact_height_m"), height, expected);
    }
    for (channel, row) in &given.channel {
        let of = |value: &str| format!("{name}.channel.{}.{value}", channel.name());
        if !AXIAL.contains(channel) {
            let expected =
                "sensitivities of axial channels only; connect the bridge as one of them";
            return refused(of("counts_per_kn"), row.counts_per_kn[0], expected);
        }
        for (value, numbers) in row.values() {
            for number in numbers {
                if !number.is_finite() {
                    return refused(of(value), number, "a finite number");
                }
                if value.ends_with("_sigma") && number < 0.0 {
                    return refused(of(value), number, "a standard deviation, 0 or more");
                }
            }
        }
        if row.size() == 0.0 {
            let expected = "a reaction to a force; remove a channel that does not react";
            return refused(of("counts_per_kn"), 0.0, expected);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Calibration;
    use crate::calibration::Resolved;
    use model::sensors::Sensors;

    fn resolved(text: &str) -> Result<Resolved, EstimatorError> {
        let sensors = Sensors::builtin("full-bridge-16bit").unwrap();
        Resolved::new(&sensors, &Calibration::from_toml(text).unwrap())
    }

    fn file(rows: &[(&str, [f64; 3])]) -> String {
        let rows = rows.iter().map(|(name, row)| {
            format!("[corner.front_left.matrix.channel.{name}]\ncounts_per_kn = {row:?}\n")
        });
        format!("vehicle = \"x\"\n{}", rows.collect::<String>())
    }

    #[test]
    fn a_channel_of_a_matrix_is_in_newtons() {
        let rows = [
            ("upper_front", [3000.0, 4000.0, 0.0]),
            ("upper_rear", [0.0, -2000.0, 0.0]),
            ("tie_rod", [0.0, 0.0, 1000.0]),
        ];
        let resolved = resolved(&file(&rows)).unwrap();
        let corner = &resolved.corners[Wheel::FrontLeft];
        // 5 counts/N.
        let zero = corner.strain[0].offset_counts;
        let value = corner.strain[0].value((zero + 100.0) as i32).unwrap();
        assert!((value - 20.0).abs() < 1e-9, "{value}");
        let matrix = corner.matrix.unwrap();
        assert_eq!(matrix.rows[0].unwrap().gains[..2], [0.6, 0.8]);
        assert_eq!(matrix.rows[1].unwrap().gains[1], -1.0);
        assert!(corner.strain[2].dead && corner.strain[3].dead, "no row");
        assert!(resolved.corners[Wheel::FrontRight].matrix.is_none());
    }

    #[test]
    fn a_singular_matrix_is_refused_with_channels_and_direction() {
        let rows = [
            ("upper_front", [300.0, 400.0, 10.0]),
            ("upper_rear", [0.0, -200.0, -2.0]),
            ("lower_rear", [500.0, 100.0, 9.0]),
        ];
        let error = resolved(&file(&rows)).unwrap_err().to_string();
        for part in [
            "corner.front_left.matrix",
            "upper_front, upper_rear, lower_rear",
            "condition number",
            "1.00 F_z",
        ] {
            assert!(error.contains(part), "{error}");
        }
        let two = resolved(&file(&rows[..2])).unwrap_err().to_string();
        assert!(two.contains("condition number of inf"), "{two}");
    }

    #[test]
    fn a_value_of_a_matrix_that_cannot_be_used_is_named() {
        let none = resolved(&file(&[("lower_rear", [0.0; 3])])).unwrap_err();
        let bends = resolved(&file(&[("lower_rear_bending", [1.0; 3])])).unwrap_err();
        for (error, part) in [
            (none, "matrix.channel.lower_rear.counts_per_kn = 0"),
            (bends, "matrix.channel.lower_rear_bending"),
        ] {
            let text = error.to_string();
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn the_direction_without_reaction_is_found() {
        let rows = [[1.0, 1.0, 0.0], [0.0, 0.0, 1.0], [2.0, 2.0, 0.5]];
        let found = Conditioning::of(rows.into_iter());
        assert_eq!(found.number, f64::INFINITY);
        let half = 0.5_f64.sqrt();
        assert!((found.weakest[0] + found.weakest[1]).abs() < 1e-9);
        assert!((found.weakest[0].abs() - half).abs() < 1e-9);
        let sound =
            Conditioning::of([[3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]].into_iter());
        assert!((sound.number - 3.0).abs() < 1e-12 && sound.is_sound());
    }
}
