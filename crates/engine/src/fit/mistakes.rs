//! Mistakes that the forces of a drive prove.

use estimator::MistakeReport;

use super::{Judgement, Misfit};

/// Driving time from which a drive without a mistake counts as a fit, s.
const ENOUGH_S: f64 = 20.0;

/// Adds the result of the hypotheses of the estimator.
pub(super) fn judge(report: &MistakeReport, judgement: &mut Judgement) {
    for (_, words) in &report.found {
        judgement.misfits.push(Misfit {
            subject: words.subject.clone(),
            found: "the forces of the drive contradict the configuration".to_owned(),
            cause: words.cause.clone(),
            remedy: words.remedy.clone(),
        });
    }
    if !report.found.is_empty() {
        return;
    }
    if report.used_s < ENOUGH_S {
        judgement.undecided(
            "strain channels, load and inertial unit by the balance of forces",
            report.manoeuvre(),
        );
    } else {
        judgement.fits.push(format!(
            "strain channels, load and inertial unit: the forces of {:.0} s of driving agree",
            report.used_s
        ));
    }
}
