//! Mistakes that the forces of a drive prove.

use estimator::MistakeReport;

use super::{Judgement, Misfit};

/// What the hypotheses are about.
const SUBJECT: &str = "strain channels, load and inertial unit by the balance of forces";

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
    let used_s = report.driven.used_s;
    let likeliest = report.likeliest.as_ref().filter(|_| report.is_suspected);
    if let Some((words, _)) = likeliest {
        judgement.undecided(
            &format!(
                "{SUBJECT}: likely, but not proved: {}: {}",
                words.subject, words.cause
            ),
            &report.manoeuvre,
        );
    } else if report.is_decisive {
        judgement.fits.push(format!(
            "strain channels, load and inertial unit: the forces of {used_s:.0} s of driving agree"
        ));
    } else {
        judgement.undecided(SUBJECT, &report.manoeuvre);
    }
}
