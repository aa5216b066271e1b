//! Latencies of messages that are not known: priors of the configuration, and what the drive says of them.

use super::Estimator;

/// Most messages whose latencies are learnt.
pub const LATENCIES_MAX: usize = 64;

/// Latency of a message, or of a source that has no messages, as the configuration states it.
#[derive(Clone, Debug, PartialEq)]
pub struct LatencyPrior {
    /// Source and message, such as `can0.Strain_FL`.
    pub name: String,
    /// Latency that the times of the samples contain already, s.
    pub latency_s: f64,
    /// Its standard deviation, s; above zero.
    pub sigma_s: f64,
}

/// Latency of a message by the drive so far.
#[derive(Clone, Debug, PartialEq)]
pub struct LatencyEstimate {
    /// What was configured.
    pub prior: LatencyPrior,
    /// Time from the sampling to the stamp, s.
    pub latency_s: f64,
    /// Its standard deviation, s.
    pub sigma_s: f64,
    /// Whether the drive has told more than the configuration.
    pub is_found: bool,
}

impl LatencyEstimate {
    /// Interval that contains the latency with a probability of 95 %, s.
    #[must_use]
    pub fn interval_s(&self) -> [f64; 2] {
        let half_s = 1.96 * self.sigma_s;
        [self.latency_s - half_s, self.latency_s + half_s]
    }
}

impl Estimator {
    /// Sets the messages whose latencies are not known, before the first sample. [`push_of`](Self::push_of) names the message of a sample
    /// by its place among them. Without the force filter, the latencies are not learnt, and only the standard
    /// deviations of GNSS contain theirs. Of more than [`LATENCIES_MAX`] messages, the first count.
    pub fn set_latencies(&mut self, mut priors: Vec<LatencyPrior>) {
        priors.truncate(LATENCIES_MAX);
        let sigmas_s: Vec<f64> = priors.iter().map(|prior| prior.sigma_s).collect();
        if let Some(fusion) = &mut self.fusion {
            fusion.learn_latencies(&sigmas_s, self.settings.tuning.latency);
        }
        self.latencies = priors;
    }

    /// What is known of the latencies, in the order of [`set_latencies`](Self::set_latencies).
    #[must_use]
    pub fn latencies(&self) -> Vec<LatencyEstimate> {
        let part = self.settings.tuning.latency.found_part;
        let priors = self.latencies.iter().enumerate();
        priors
            .map(|(stream, prior)| {
                let (learnt_s, sigma_s) = self.learnt(stream);
                LatencyEstimate {
                    prior: prior.clone(),
                    latency_s: prior.latency_s + learnt_s,
                    sigma_s,
                    is_found: sigma_s < part * prior.sigma_s,
                }
            })
            .collect()
    }

    /// Standard deviation of the latency of a message, s; zero if it is known.
    pub(super) fn latency_sigma_s(&self, stream: Option<u8>) -> f64 {
        stream.map_or(0.0, |stream| self.learnt(stream.into()).1)
    }

    /// What was learnt of a message's latency, and its standard deviation, s.
    pub(super) fn learnt(&self, stream: usize) -> (f64, f64) {
        let fusion = self.fusion.as_ref();
        let learnt = fusion.and_then(|fusion| fusion.latency(stream));
        let prior = self.latencies.get(stream);
        learnt.unwrap_or((0.0, prior.map_or(0.0, |prior| prior.sigma_s)))
    }
}
