//! Sensitivity matrix of a corner without geometry, from known loads alone: see [`crate::calibration::matrix`].
//!
//! Each channel is a weighted least squares over the zero, the sensitivities to F_x, F_y, F_z, M_x, M_y and
//! M_z, and the changes of these with the compression of the strut. Directions in which the rig did
//! not load are left to wide priors around zero, which are set by the size of the channel's own response.
//! Nothing of a linkage enters.

use model::vehicle::Vehicle;
use nalgebra::{SMatrix, SVector, Vector3};
use sample::{StrainChannel, Wheel};

use super::table::spread;
use super::{LOADS_NEEDED, LoadRig, RigLoad, SPREAD_NEEDED_N, WHAT, WiringFault, WiringKind};
use crate::EstimatorError;
use crate::calibration::matrix::{Conditioning, Direction, contact_height_m, passing};
use crate::calibration::{
    ChannelCalibration, MatrixAxes, MatrixCalibration, Resolved, Sensitivity, SensitivityMatrix,
    StrutSensitivity,
};
use crate::finding::{Figure, Finding, Refusal, Series};
use crate::regression::whiteness;
use crate::statics::AXIAL;

/// Sensitivities: to three forces and three moments, and the changes of these with compression.
const COLUMNS: usize = 12;
/// With the zero.
const UNKNOWNS: usize = COLUMNS + 1;
/// Priors of the sensitivities, in the size of the channel's response to a force: a force that nothing tells;
/// a moment, on an arm of 0.1 m; the changes with compression of members that turn by 4 rad/m.
const PRIOR: [f64; COLUMNS] = [
    100.0, 100.0, 100.0, 10.0, 10.0, 10.0, 4.0, 4.0, 4.0, 40.0, 40.0, 40.0,
];
/// Prior of a zero, counts.
const ZERO_PRIOR_COUNTS: f64 = 1e6;
/// Error of the linear equation, as a part of the greatest change of a channel.
const LINEAR_SIGMA: f64 = 0.003;
/// Largest standard deviation of a sensitivity to a force, in the size of the response.
const TOLD_WITHIN: f64 = 0.1;
/// Error of a load for the design of the loads, N.
const LOAD_SIGMA_N: f64 = 10.0;
/// Least spread of the strut's force that tells its row, and standard deviation of a force by its compression, N.
const STRUT_SPREAD_N: f64 = 100.0;
const STRUT_SIGMA_N: f64 = 5.0;
/// Degrees of freedom from which the residuals tell their size.
const FREE_NEEDED: f64 = 3.0;
/// Least greatest change of a channel, counts, and least part of it that the loads explain.
const CHANGE_NEEDED: f64 = 4.0;
const EXPLAINED: f64 = 0.9;

/// Rows of the regression of one corner.
struct Design {
    rows: Vec<SVector<f64, COLUMNS>>,
    /// Mean compression, m.
    compression_m: f64,
    /// Contact point below the wheel centre, m.
    height_m: f64,
    /// Largest over smallest standard deviation of the response to a force.
    condition: f64,
}

/// A channel's regression.
struct Fit {
    zero: [f64; 2],
    /// Counts/N and counts/(N m), and their changes for 1 m, with standard deviations.
    value: [f64; COLUMNS],
    sigma: [f64; COLUMNS],
    residuals: Vec<f64>,
    explained: f64,
}

impl Design {
    fn new(vehicle: &Vehicle, wheel: Wheel, loads: &[&RigLoad]) -> Self {
        let sum: f64 = loads.iter().map(|load| load.compression_m).sum();
        let compression_m = sum / loads.len() as f64;
        let rows = loads.iter().map(|load| {
            let passing = passing(vehicle, load, None);
            let more_m = load.compression_m - compression_m;
            SVector::from_fn(|i, _| match i {
                0..6 => passing[i],
                _ => passing[i - 6] * more_m,
            })
        });
        Self {
            rows: rows.collect(),
            compression_m,
            height_m: contact_height_m(vehicle, wheel),
            condition: f64::INFINITY,
        }
    }

    /// Refuses loads that do not tell the three forces apart. The least squares of a channel with a response
    /// of 1 to a force has no standard deviation above [`TOLD_WITHIN`].
    fn check(&mut self, wheel: Wheel) -> Result<(), EstimatorError> {
        let unit = vec![LOAD_SIGMA_N; self.rows.len()];
        let all: Vec<&SVector<f64, COLUMNS>> = self.rows.iter().collect();
        let covariance = normal(&all, &unit, 1.0).try_inverse();
        let covariance = covariance.expect("the priors make the normal matrix regular");
        let forces = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let eigen = forces.symmetric_eigen();
        let [worst, best] = [eigen.eigenvalues.imax(), eigen.eigenvalues.imin()];
        let sigma = eigen.eigenvalues[worst].sqrt();
        self.condition = (eigen.eigenvalues[worst] / eigen.eigenvalues[best]).sqrt();
        if sigma < TOLD_WITHIN {
            return Ok(());
        }
        let column = eigen.eigenvectors.column(worst);
        let sign = column[column.iamax()].signum();
        let direction = Vector3::from_fn(|i, _| sign * column[i]);
        let push = direction.map(|part| (part * 20.0).round() * 50.0 + 0.0);
        let back = push.map(|part| 0.0 - part);
        let at = format!("{:.2}", -self.height_m);
        Err(EstimatorError::Unloaded {
            wheel: wheel.to_string(),
            direction: Direction(direction.into()).to_string(),
            condition: self.condition,
            mark: format!("rig {wheel} {} {} {} at 0 0 {at}", push.x, push.y, push.z),
            back: format!("rig {wheel} {} {} {} at 0 0 {at}", back.x, back.y, back.z),
        })
    }

    /// The least squares of a channel; `read` are the loads with a reading, and their counts.
    fn fit(&self, read: &[(usize, [f64; 2])]) -> Fit {
        let rows: Vec<_> = read.iter().map(|(k, _)| &self.rows[*k]).collect();
        let counts: Vec<f64> = read.iter().map(|(_, counts)| counts[0]).collect();
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        let most = (counts.iter()).fold(0.0_f64, |most, count| most.max((count - mean).abs()));
        let change = spread(&counts);
        let force = spread_of_forces(&rows);
        let size = (change / force).max(1e-9);
        let sigma: Vec<f64> = read
            .iter()
            .map(|(_, counts)| math::hypot(counts[1], LINEAR_SIGMA * most).max(1e-6))
            .collect();
        let covariance = normal(&rows, &sigma, size).try_inverse();
        let covariance = covariance.expect("the priors make the normal matrix regular");
        let mut right = SVector::<f64, UNKNOWNS>::zeros();
        for ((row, count), sigma) in rows.iter().zip(&counts).zip(&sigma) {
            right += extended(row) * ((count - mean) / (sigma * sigma));
        }
        let found = covariance * right;
        let residuals: Vec<f64> = (rows.iter().zip(&counts))
            .map(|(row, count)| count - mean - extended(row).dot(&found))
            .collect();
        // Each load uses up its leverage.
        let (mut square, mut free) = (0.0, 0.0);
        for ((row, residual), sigma) in rows.iter().zip(&residuals).zip(&sigma) {
            let row = extended(row);
            square += (residual / sigma).powi(2);
            free += 1.0 - (row.transpose() * covariance * row)[0] / (sigma * sigma);
        }
        let scale = if free >= FREE_NEEDED {
            (square / free).max(1.0)
        } else {
            1.0
        };
        let deviation = |i: usize| (scale * covariance[(i, i)]).sqrt();
        Fit {
            zero: [mean + found[COLUMNS], deviation(COLUMNS)],
            value: std::array::from_fn(|i| found[i]),
            sigma: std::array::from_fn(deviation),
            explained: 1.0 - (spread(&residuals) / change.max(f64::MIN_POSITIVE)).powi(2),
            residuals,
        }
    }
}

/// A row with the one of the zero.
fn extended(row: &SVector<f64, COLUMNS>) -> SVector<f64, UNKNOWNS> {
    SVector::from_fn(|i, _| if i < COLUMNS { row[i] } else { 1.0 })
}

/// Normal matrix of the least squares with the priors of a channel of this size, counts/N.
fn normal(
    rows: &[&SVector<f64, COLUMNS>],
    sigma: &[f64],
    size: f64,
) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
    let mut normal = SMatrix::zeros();
    for (i, prior) in PRIOR.into_iter().enumerate() {
        normal[(i, i)] = (prior * size).powi(-2);
    }
    normal[(COLUMNS, COLUMNS)] = ZERO_PRIOR_COUNTS.powi(-2);
    for (row, sigma) in rows.iter().zip(sigma) {
        let row = extended(row) / *sigma;
        normal += row * row.transpose();
    }
    normal
}

fn spread_of_forces(rows: &[&SVector<f64, COLUMNS>]) -> f64 {
    let axes = [0, 1, 2].map(|axis| {
        let values: Vec<f64> = rows.iter().map(|row| row[axis]).collect();
        spread(&values)
    });
    Vector3::from(axes).norm().max(1.0)
}

impl Fit {
    /// Counts against those of the least squares, from the zero.
    fn series(&self, channel: StrainChannel, counts: &[f64]) -> Series {
        let zero = self.zero[0];
        Series {
            name: channel.name().to_owned(),
            line: false,
            x: (counts.iter().zip(&self.residuals))
                .map(|(count, residual)| count - residual - zero)
                .collect(),
            y: counts.iter().map(|count| count - zero).collect(),
        }
    }

    fn sensitivity(&self) -> Sensitivity {
        let part = |values: &[f64; COLUMNS], first: usize| {
            [0, 1, 2].map(|axis| 1e3 * values[first + axis])
        };
        Sensitivity {
            counts_per_kn: part(&self.value, 0),
            counts_per_kn_sigma: part(&self.sigma, 0),
            counts_per_kn_m: part(&self.value, 3),
            counts_per_kn_m_sigma: part(&self.sigma, 3),
            change_per_m: part(&self.value, 6),
            change_per_m_sigma: part(&self.sigma, 6),
            moment_change_per_m: part(&self.value, 9),
            moment_change_per_m_sigma: part(&self.sigma, 9),
        }
    }
}

/// The loads on a corner that have enough spread along each axis to begin with.
fn enough(wheel: Wheel, loads: &[&RigLoad]) -> Result<(), Refusal> {
    let needed = SPREAD_NEEDED_N.into_iter().enumerate();
    for (axis, needed_n) in needed {
        let values: Vec<f64> = loads.iter().map(|load| load.force_n[axis]).collect();
        let found = spread(&values);
        if loads.len() >= LOADS_NEEDED && found >= needed_n {
            continue;
        }
        return super::enough(wheel, loads);
    }
    Ok(())
}

impl LoadRig {
    /// Finds the matrix of a corner without geometry.
    pub(super) fn matrix_corner(
        &mut self,
        vehicle: &Vehicle,
        resolved: &Resolved,
        wheel: Wheel,
        loads: &[&RigLoad],
    ) -> Result<(), EstimatorError> {
        enough(wheel, loads).map_err(|refusal| refusal.of(WHAT))?;
        let mut design = Design::new(vehicle, wheel, loads);
        design.check(wheel)?;
        let mut matrix = MatrixCalibration {
            axes: MatrixAxes::Vehicle,
            compression_m: design.compression_m,
            contact_height_m: Some(design.height_m),
            ..MatrixCalibration::default()
        };
        let mut figure = Figure {
            title: format!("{wheel}: counts against those of the matrix"),
            x_label: "counts by the matrix, from the zero".to_owned(),
            y_label: "counts from the zero".to_owned(),
            series: Vec::new(),
        };
        for channel in AXIAL {
            let i = channel.index();
            let read: Vec<(usize, [f64; 2])> = (loads.iter().enumerate())
                .filter_map(|(k, load)| Some((k, load.counts[i]?)))
                .collect();
            if read.len() < LOADS_NEEDED {
                if !(resolved.corners[wheel].strain[i].dead && read.is_empty()) {
                    self.unread(vehicle, wheel, channel, !read.is_empty());
                }
                continue;
            }
            let fit = design.fit(&read);
            let counts: Vec<f64> = read.iter().map(|(_, counts)| counts[0]).collect();
            let corner = self.calibration.corner.entry(wheel).or_default();
            let slot = corner.strain.entry(channel).or_default();
            let fault = if spread(&counts) < CHANGE_NEEDED {
                Some(WiringKind::NoReaction)
            } else {
                (fit.explained < EXPLAINED).then_some(WiringKind::Unexplained)
            };
            if let Some(kind) = fault {
                slot.dead = true;
                self.faults.push(WiringFault {
                    wheel,
                    channel,
                    kind,
                    mounting: None,
                });
                continue;
            }
            *slot = ChannelCalibration {
                offset_counts: Some(fit.zero[0]),
                offset_sigma_counts: Some(fit.zero[1]),
                gain_per_count: None,
                dead: false,
                temperature: slot.temperature,
            };
            matrix.channel.insert(channel, fit.sensitivity());
            self.sensitivity
                .push((wheel, channel, [0, 1, 2].map(|axis| fit.value[axis])));
            figure.series.push(fit.series(channel, &counts));
            self.tell_matrix(wheel, channel, &design, &fit);
        }
        self.findings.figures.push(figure);
        matrix.strut = self.strut(vehicle, wheel, &design, loads);
        self.judge_matrix(wheel, matrix)
    }

    /// What the loads make of the strut, whose force its compression gives; `None` if it was not compressed.
    fn strut(
        &mut self,
        vehicle: &Vehicle,
        wheel: Wheel,
        design: &Design,
        loads: &[&RigLoad],
    ) -> Option<StrutSensitivity> {
        let vehicle = self.calibration.applied(vehicle);
        let strut = vehicle.axle(wheel).strut.as_ref()?;
        let force_n = |load: &&RigLoad| {
            let length_m = strut.design_length_m - load.compression_m;
            strut.force(length_m, 0.0).total_n()
        };
        let forces_n: Vec<f64> = loads.iter().map(force_n).collect();
        if spread(&forces_n) < STRUT_SPREAD_N {
            self.findings.notes.push(format!(
                "{wheel}: the loads do not compress the strut, or its deflection is not measured; the motion ratio of \
                 the vehicle file is used"
            ));
            return None;
        }
        let read: Vec<(usize, [f64; 2])> = (forces_n.iter().enumerate())
            .map(|(k, force)| (k, [*force, STRUT_SIGMA_N]))
            .collect();
        let fit = design.fit(&read);
        let part =
            |values: &[f64; COLUMNS], first: usize| [0, 1, 2].map(|axis| values[first + axis]);
        for (axis, of) in ["F_x", "F_y", "F_z"].into_iter().enumerate() {
            let name = format!("{wheel} strut to {of}");
            let (value, sigma) = (fit.value[axis], fit.sigma[axis]);
            self.findings
                .findings
                .push(finding(name, [value, sigma], "N/N", design, &fit));
        }
        Some(StrutSensitivity {
            part: part(&fit.value, 0),
            part_sigma: part(&fit.sigma, 0),
            change_per_m: part(&fit.value, 6),
            change_per_m_sigma: part(&fit.sigma, 6),
            per_m: part(&fit.value, 3),
            per_m_sigma: part(&fit.sigma, 3),
            moment_change_per_m: part(&fit.value, 9),
            offset_n: fit.zero[0],
        })
    }

    /// Refuses a matrix whose channels do not tell the three forces apart.
    fn judge_matrix(
        &mut self,
        wheel: Wheel,
        matrix: MatrixCalibration,
    ) -> Result<(), EstimatorError> {
        if matrix.channel.is_empty() {
            return Err(Refusal::Missing {
                what: WHAT.to_owned(),
                channel: format!("channel on {wheel} that follows the loads"),
                help: "look at gauges, cables and roles".to_owned(),
            }
            .into());
        }
        SensitivityMatrix::new(wheel, &matrix)?;
        let rows = matrix.channel.values().map(|row| row.counts_per_kn);
        let found = Conditioning::of(rows);
        let name = format!("{wheel} condition number of the matrix");
        self.findings
            .beside
            .push((name, found.number, "-".to_owned()));
        let unknown = [(3, "M_x"), (4, "M_y"), (5, "M_z")].into_iter();
        let unknown = unknown.filter(|(column, _)| {
            (matrix.channel.values())
                .all(|row| row.counts_per_kn_m_sigma[column - 3] > 5.0 * norm(row.counts_per_kn))
        });
        let unknown: Vec<&str> = unknown.map(|(_, name)| name).collect();
        if !unknown.is_empty() {
            self.findings.notes.push(format!(
                "{wheel}: no load tells the response to {}; forces with such a moment have larger standard deviations; \
                 loads with their point of application, such as `rig {wheel} 0 900 2000 at 0.15 0 -0.28`, tell it",
                unknown.join(" and ")
            ));
        }
        self.calibration.corner.entry(wheel).or_default().matrix = Some(matrix);
        Ok(())
    }

    fn tell_matrix(&mut self, wheel: Wheel, channel: StrainChannel, design: &Design, fit: &Fit) {
        let name = channel.name();
        let names = ["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"];
        let mut parts: Vec<(String, f64, f64, &str)> = (names.into_iter().enumerate())
            .map(|(i, of)| {
                let unit = if i < 3 { "counts/kN" } else { "counts/(kN m)" };
                let name = format!("{wheel} {name} to {of}");
                (name, 1e3 * fit.value[i], 1e3 * fit.sigma[i], unit)
            })
            .collect();
        let [zero, zero_sigma] = fit.zero;
        parts.push((format!("{wheel} {name} offset"), zero, zero_sigma, "counts"));
        for (name, value, sigma, unit) in parts {
            let found = finding(name, [value, sigma], unit, design, fit);
            self.findings.findings.push(found);
        }
    }
}

fn finding(name: String, value: [f64; 2], unit: &str, design: &Design, fit: &Fit) -> Finding {
    let forces: Vec<_> = design.rows.iter().collect();
    let excitation = (spread_of_forces(&forces), "N");
    Finding {
        condition: design.condition,
        whiteness: Some(whiteness(&fit.residuals)),
        ..Finding::of_rows(name, value, unit, excitation, fit.residuals.len())
    }
}

fn norm(row: [f64; 3]) -> f64 {
    Vector3::from(row).norm()
}
