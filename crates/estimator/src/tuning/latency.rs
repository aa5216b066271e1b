//! Latencies of messages that are not known.

use super::tuning;

tuning! {
    /// Latencies of messages that are not known (`fusion/latency.rs`). They have no effect without a
    /// `latency_sigma_s`.
    LatencyTuning {
        /// Part of the readings that counts as independent: errors of the model last for several readings.
        independent: f64 = 0.05, "1";
        /// Power of the part of an innovation's variance that is the reading's own, by which the innovation counts:
        /// what the model does not predict on rough ground can look like a delay.
        own_power: f64 = 1.0, "1";
        /// Random part of a latency, from reading to reading: a frame waits for others on the bus.
        jitter_s: f64 = 2e-5, "s";
        /// Random walk of a latency: clocks drift, and the load of the bus changes.
        walk_s_sqrt_s: f64 = 5e-6, "s/√s";
        /// Distance of a learnt latency from the configured one at most, in standard deviations of the prior.
        bound_sigma: f64 = 3.0, "σ";
        /// Part of the standard deviation of the prior from which a latency counts as found.
        found_part: f64 = 0.25, "1";
    }
}
