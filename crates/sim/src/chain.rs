//! From a force in a tube to a converter's counts, and the same for the spring potentiometers.

use model::sensors::{BendingBridge, Bridge, Deflection, StrainChain};

use crate::SimError;

/// Counts of an ideal chain: `mid + counts_per_unit * x`, before lag, noise and rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    /// Half of the converter's range: no load, no compression.
    pub(crate) mid: f64,
    /// Counts a newton, newton metre or metre.
    pub(crate) counts_per_unit: f64,
    /// Largest count.
    pub(crate) max: f64,
}

impl Scale {
    /// An axial bridge: counts a newton of tension.
    pub(crate) fn axial(chain: &StrainChain) -> Result<Self, SimError> {
        let area = std::f64::consts::PI / 4.0
            * (chain.tube_outer_diameter_m.powi(2) - inner_diameter_m(chain).powi(2));
        let strain_per_newton = 1.0 / (chain.youngs_modulus_pa * area);
        let ratio = axial_ratio(chain, chain.bridge) * strain_per_newton;
        Self::bridge(chain, chain.gain_resistor_ohm, ratio)
    }

    /// The same gauges in adjacent arms of the bridge, the mistake of the thesis's section 5.2.1:
    /// counts a newton metre of bending.
    pub(crate) fn bending_wired(chain: &StrainChain) -> Result<Self, SimError> {
        let ratio = bending_ratio(chain, Bridge::HalfBending) * strain_per_newton_metre(chain);
        Self::bridge(chain, chain.gain_resistor_ohm, ratio)
    }

    /// A bending bridge: counts a newton metre.
    pub(crate) fn bending(chain: &StrainChain, bending: &BendingBridge) -> Result<Self, SimError> {
        let ratio = bending_ratio(chain, bending.bridge) * strain_per_newton_metre(chain);
        Self::bridge(chain, bending.gain_resistor_ohm, ratio)
    }

    /// A spring potentiometer: counts a metre of compression from the design length.
    pub(crate) fn deflection(pot: &Deflection) -> Result<Self, SimError> {
        let counts = converter_counts("deflection.adc_bits", pot.adc_bits)?;
        if pot.span_m > 0.0 {
            Ok(Self {
                mid: counts / 2.0,
                counts_per_unit: counts / pot.span_m,
                max: largest_count(counts),
            })
        } else {
            Err(SimError::BadParameter {
                name: "deflection.span_m".to_owned(),
                value: pot.span_m,
                expected: "above 0",
            })
        }
    }

    /// Thesis equation 3.5: the INA2126's gain is G = 5 + 80 kOhm/R_G.
    fn bridge(chain: &StrainChain, gain_resistor_ohm: f64, ratio: f64) -> Result<Self, SimError> {
        let counts = converter_counts("strain.adc_bits", chain.adc_bits)?;
        let gain = 5.0 + 80_000.0 / gain_resistor_ohm;
        // Excitation and converter span are one voltage, so that it cancels.
        let counts_per_unit = ratio * gain * counts;
        if counts_per_unit.is_finite() {
            Ok(Self {
                mid: counts / 2.0,
                counts_per_unit,
                max: largest_count(counts),
            })
        } else {
            Err(SimError::BadParameter {
                name: "strain: counts a newton".to_owned(),
                value: counts_per_unit,
                expected: "finite; check tube, modulus and gain resistor",
            })
        }
    }

    /// The exact output for `x`, not rounded.
    pub(crate) fn counts(&self, x: f64) -> f64 {
        self.mid + self.counts_per_unit * x
    }

    /// What the converter gives for a level in counts: rounded, held within its range.
    pub(crate) fn convert(&self, level: f64) -> u16 {
        // A NaN level saturates to 0 in the cast.
        level.round().clamp(0.0, self.max) as u16
    }
}

fn converter_counts(name: &str, bits: u8) -> Result<f64, SimError> {
    if (1..=16).contains(&bits) {
        Ok(f64::from(1_u32 << bits))
    } else {
        Err(SimError::BadParameter {
            name: name.to_owned(),
            value: f64::from(bits),
            expected: "1 to 16",
        })
    }
}

/// The bus keeps 0xFFFF for "absent", so that a 16-bit converter stops one count short of it.
fn largest_count(counts: f64) -> f64 {
    (counts - 1.0).min(f64::from(u16::MAX) - 1.0)
}

fn inner_diameter_m(chain: &StrainChain) -> f64 {
    chain.tube_outer_diameter_m - 2.0 * chain.tube_wall_m
}

fn strain_per_newton_metre(chain: &StrainChain) -> f64 {
    let second_moment_m4 = std::f64::consts::PI / 64.0
        * (chain.tube_outer_diameter_m.powi(4) - inner_diameter_m(chain).powi(4));
    chain.tube_outer_diameter_m / 2.0 / (chain.youngs_modulus_pa * second_moment_m4)
}

/// Bridge output over excitation for a unit axial strain: V/V_ex = GF/4 (e1 - e2 + e3 - e4).
fn axial_ratio(chain: &StrainChain, bridge: Bridge) -> f64 {
    let poisson = 1.0 + chain.poisson_ratio;
    chain.gauge_factor
        * match bridge {
            Bridge::Quarter => 0.25,
            Bridge::HalfAxial => 0.5,
            Bridge::HalfPoisson => poisson / 4.0,
            Bridge::FullPoisson => poisson / 2.0,
            Bridge::HalfBending | Bridge::FullBending => 0.0,
        }
}

/// Bridge output over excitation for a unit bending strain at the tube's surface.
fn bending_ratio(chain: &StrainChain, bridge: Bridge) -> f64 {
    chain.gauge_factor
        * match bridge {
            Bridge::Quarter => 0.25,
            Bridge::HalfBending => 0.5,
            Bridge::FullBending => 1.0,
            Bridge::HalfPoisson => (1.0 + chain.poisson_ratio) / 4.0,
            Bridge::HalfAxial | Bridge::FullPoisson => 0.0,
        }
}

/// A first-order lag, exact for an input that is linear between the instants it is given at:
/// tau y' = x - y.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lag {
    tau_s: f64,
    input: f64,
    output: f64,
}

impl Lag {
    /// A lag of corner frequency `corner_hz` (infinite: none), settled at `input`.
    pub(crate) fn settled(corner_hz: f64, input: f64) -> Self {
        Self {
            tau_s: 1.0 / (std::f64::consts::TAU * corner_hz),
            input,
            output: input,
        }
    }

    /// The output now.
    pub(crate) fn output(&self) -> f64 {
        self.output
    }

    /// Output `dt_s` later, when the input has become `input`.
    pub(crate) fn advance(&mut self, dt_s: f64, input: f64) -> f64 {
        if dt_s > 0.0 {
            let slope = (input - self.input) / dt_s;
            // The particular solution of a ramp is the ramp, tau * slope behind.
            let gap = self.output - (self.input - slope * self.tau_s);
            let decay = (-dt_s / self.tau_s).exp();
            self.output = input - slope * self.tau_s + gap * decay;
        }
        self.input = input;
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(bridge: Bridge, gain_resistor_ohm: f64) -> StrainChain {
        StrainChain {
            rate_hz: 100.0,
            tube_outer_diameter_m: 0.0254,
            tube_wall_m: 0.00165,
            youngs_modulus_pa: 190e9,
            poisson_ratio: 0.29,
            gauge_factor: 2.1,
            excitation_v: 5.0,
            bridge,
            gain_resistor_ohm,
            bending: None,
            lag_hz: 19.9,
            adc_bits: 10,
            noise_counts: 1.0,
            zero_error_counts: 0.5,
        }
    }

    /// The published table of newtons a count for a tube of EA = 23.4 MN.
    #[test]
    fn newtons_a_count() {
        for (bridge, resistor, newtons) in [
            (Bridge::Quarter, 350.0, 186.0),
            (Bridge::HalfAxial, 350.0, 93.0),
            (Bridge::Quarter, 100.0, 54.0),
            (Bridge::HalfAxial, 100.0, 27.0),
            (Bridge::FullPoisson, 100.0, 21.0),
        ] {
            let scale = Scale::axial(&chain(bridge, resistor)).expect("sound chain");
            let found = 1.0 / scale.counts_per_unit;
            assert!(
                (found - newtons).abs() < 0.6,
                "{bridge:?} {resistor}: {found}"
            );
        }
    }

    #[test]
    fn axial_bridges_reject_bending_and_the_reverse() {
        let half = chain(Bridge::HalfAxial, 100.0);
        assert_eq!(bending_ratio(&half, Bridge::HalfAxial), 0.0);
        assert_eq!(axial_ratio(&half, Bridge::HalfBending), 0.0);
    }

    #[test]
    fn converter_rounds_and_saturates() {
        let scale = Scale::axial(&chain(Bridge::HalfAxial, 100.0)).expect("sound chain");
        assert_eq!(scale.convert(scale.counts(0.0)), 512);
        assert_eq!(scale.convert(1e9), 1023);
        assert_eq!(scale.convert(-1e9), 0);
        assert_eq!(scale.convert(f64::NAN), 0);
    }

    #[test]
    fn lag_has_the_corner_it_says() {
        // At the corner frequency the gain is 1/sqrt(2) and the phase is -45 degrees.
        let (corner_hz, step_s) = (19.9, 1e-4);
        let mut lag = Lag::settled(corner_hz, 0.0);
        let (mut in_phase, mut quadrature, mut time_s) = (0.0, 0.0, 0.0);
        let periods = 200.0;
        while time_s < periods / corner_hz {
            time_s += step_s;
            let phase: f64 = std::f64::consts::TAU * corner_hz * time_s;
            let y = lag.advance(step_s, phase.sin());
            if time_s > periods / 2.0 / corner_hz {
                in_phase += y * phase.sin();
                quadrature += y * phase.cos();
            }
        }
        let n = periods / 2.0 / corner_hz / step_s / 2.0;
        let (gain, angle) = (
            (in_phase / n).hypot(quadrature / n),
            quadrature.atan2(in_phase),
        );
        assert!((gain - 0.5_f64.sqrt()).abs() < 2e-3, "{gain}");
        assert!((angle.to_degrees() + 45.0).abs() < 0.3, "{angle}");
    }

    #[test]
    fn lag_does_not_depend_on_the_step() {
        let mut one = Lag::settled(19.9, 1.0);
        let mut many = one;
        let y = one.advance(0.02, 3.0);
        let mut z = 0.0;
        for k in 1..=10 {
            z = many.advance(0.002, 1.0 + 0.2 * f64::from(k));
        }
        assert!((y - z).abs() < 1e-12);
    }
}
