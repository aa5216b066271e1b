use std::f64::consts::TAU;

/// Corner frequency of an RC filter, equation 3.6: f = 1/(2 pi R C). The thesis's 80 ohm and
/// 100 uF give 19.9 Hz; its "no loss" is a delay of 8 ms, -16.8 degrees at 6 Hz and -8.6 dB at
/// 50 Hz.
#[must_use]
pub fn rc_corner_hz(resistance_ohm: f64, capacitance_f: f64) -> f64 {
    1.0 / (TAU * resistance_ohm * capacitance_f)
}

/// A first-order lag, tau y' = x - y, stepped without discretisation error for an input that is
/// linear between the instants it is given at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    tau_s: f64,
    input: f64,
    output: f64,
}

impl Lag {
    /// A lag of this corner frequency (infinite: none), settled at `input`.
    #[must_use]
    pub fn settled(corner_hz: f64, input: f64) -> Self {
        Self {
            tau_s: 1.0 / (TAU * corner_hz),
            input,
            output: input,
        }
    }

    /// Time constant tau, s.
    #[must_use]
    pub fn time_constant_s(&self) -> f64 {
        self.tau_s
    }

    /// The output now.
    #[must_use]
    pub fn output(&self) -> f64 {
        self.output
    }

    /// The output `dt_s` later, when the input has become `input`:
    /// y = x - s tau + (y_0 - x_0 + s tau) exp(-dt/tau), with the input's slope s.
    pub fn advance(&mut self, dt_s: f64, input: f64) -> f64 {
        if dt_s > 0.0 {
            let behind = (input - self.input) / dt_s * self.tau_s;
            let decay = math::exp(-dt_s / self.tau_s);
            self.output = input - behind + (self.output - self.input + behind) * decay;
        }
        self.input = input;
        self.output
    }

    /// Gain and phase (rad) at a frequency.
    #[must_use]
    pub fn response(&self, frequency_hz: f64) -> [f64; 2] {
        let x = TAU * frequency_hz * self.tau_s;
        [1.0 / math::hypot(x, 1.0), -math::atan(x)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_filter_of_the_thesis_costs() {
        let corner = rc_corner_hz(80.0, 100e-6);
        assert!((corner - 19.894).abs() < 1e-3);
        let lag = Lag::settled(corner, 0.0);
        assert!((lag.time_constant_s() - 0.008).abs() < 1e-12);
        assert!((lag.response(6.0)[1].to_degrees() + 16.8).abs() < 0.05);
        assert!((20.0 * math::log10(lag.response(50.0)[0]) + 8.6).abs() < 0.05);
    }

    #[test]
    fn steps_do_not_matter_for_a_ramp() {
        let mut one = Lag::settled(19.9, 1.0);
        let mut many = one;
        let whole = one.advance(0.02, 3.0);
        let mut parts = 0.0;
        for k in 1..=10 {
            parts = many.advance(0.002, 1.0 + 0.2 * f64::from(k));
        }
        assert!((whole - parts).abs() < 1e-12);
        assert_eq!(Lag::settled(f64::INFINITY, 0.0).advance(0.01, 5.0), 5.0);
    }

    #[test]
    fn a_sine_comes_out_as_the_response_says() {
        let (corner, frequency, step) = (19.9, 6.0, 5e-4);
        let mut lag = Lag::settled(corner, 0.0);
        let [gain, phase] = lag.response(frequency);
        let mut worst = 0.0_f64;
        for k in 1..4000 {
            let time = f64::from(k) * step;
            let angle = TAU * frequency * time;
            let output = lag.advance(step, math::sin(angle));
            if time > 0.5 {
                worst = worst.max((output - gain * math::sin(angle + phase)).abs());
            }
        }
        // What is left is the sine's curvature within a step.
        assert!(worst < 5e-5, "{worst}");
    }
}
