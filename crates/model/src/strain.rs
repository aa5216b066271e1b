//! The chain from a member's force to converter counts, and back.
//!
//! force -> strain of the section (equations 3.1-3.4 of the thesis) -> bridge -> instrumentation
//! amplifier (3.5) -> RC filter (3.6) -> converter. The thesis prints 10 microstrain for
//! 180-200 MPa where it is 947 to 1053 (4130 steel), and 5-20 mV where a bridge at 5 V and gauge
//! factor 2.1 gives 2.6 (quarter) to 10.5 mV (full) per 1000 microstrain.

mod circuits;
mod lag;
mod section;

use crate::Error;
use crate::error::require;
use crate::sensors::{Amplifier, BendingBridge, Bridge, StrainChain};

pub use circuits::{Circuit, CircuitBridge, CircuitMember, TABLE_3_2};
pub use lag::{Lag, rc_corner_hz};
pub use section::{MATERIALS, Material, Section};

/// Value of a 16-bit field of the bus that holds no count. A converter of 16 bits ends below it.
pub const ABSENT_COUNT: u16 = u16::MAX;

impl Amplifier {
    /// Gain G = G_0 + R_0/R_G with a gain resistor R_G, ohm. A socket's resistance adds to R_G:
    /// 1 ohm lowers the gain of the thesis's amplifier by 0.98 % at 100 ohm.
    #[must_use]
    pub fn gain(self, gain_resistor_ohm: f64) -> f64 {
        self.base_gain + self.gain_ohm / gain_resistor_ohm
    }
}

impl Bridge {
    /// Strains of the four arms, in cyclic order, for an axial strain `axial` and a bending strain
    /// `bending` (at the gauge on the tube's tension side); 0 for a fixed resistor.
    ///
    /// | wiring | arms 1 to 4 |
    /// |---|---|
    /// | quarter | top |
    /// | half axial | top, -, bottom |
    /// | half bending | top, bottom: the wiring mistake of section 5.2.1 |
    /// | half Poisson | top, top across |
    /// | full Poisson | top, top across, bottom, bottom across |
    /// | full bending | top, bottom, top, bottom |
    #[must_use]
    pub fn arm_strains(self, axial: f64, bending: f64, poisson_ratio: f64) -> [f64; 4] {
        let (top, bottom) = (axial + bending, axial - bending);
        match self {
            Self::Quarter => [top, 0.0, 0.0, 0.0],
            Self::HalfAxial => [top, 0.0, bottom, 0.0],
            Self::HalfBending => [top, bottom, 0.0, 0.0],
            Self::HalfPoisson => [top, -poisson_ratio * top, 0.0, 0.0],
            Self::FullPoisson => [top, -poisson_ratio * top, bottom, -poisson_ratio * bottom],
            Self::FullBending => [top, bottom, top, bottom],
        }
    }

    /// Output over excitation for a unit axial strain, linear: 1/4 (e1 - e2 + e3 - e4) times the
    /// gauge factor.
    #[must_use]
    pub fn axial_gain(self, gauge_factor: f64, poisson_ratio: f64) -> f64 {
        linear_output(gauge_factor, self.arm_strains(1.0, 0.0, poisson_ratio))
    }

    /// Output over excitation for a unit bending strain, linear.
    #[must_use]
    pub fn bending_gain(self, gauge_factor: f64, poisson_ratio: f64) -> f64 {
        linear_output(gauge_factor, self.arm_strains(0.0, 1.0, poisson_ratio))
    }
}

/// V/V_ex = (GF/4)(e1 - e2 + e3 - e4): the bridge for small strains.
#[must_use]
pub fn linear_output(gauge_factor: f64, arms: [f64; 4]) -> f64 {
    let [e1, e2, e3, e4] = arms;
    gauge_factor / 4.0 * (e1 - e2 + e3 - e4)
}

/// V/V_ex = (R1 R3 - R2 R4)/((R1 + R2)(R3 + R4)) with R = 1 + GF e: the bridge without
/// approximation. A quarter bridge falls 0.105 % short of [`linear_output`] at 1000 microstrain.
#[must_use]
pub fn exact_output(gauge_factor: f64, arms: [f64; 4]) -> f64 {
    let [r1, r2, r3, r4] = arms.map(|e| 1.0 + gauge_factor * e);
    (r1 * r3 - r2 * r4) / ((r1 + r2) * (r3 + r4))
}

/// Output of a bridge over its excitation for one count of a chain that is given by its calibration per
/// mV/V: 0.001 mV/V.
const BRIDGE_RATIO_PER_COUNT: f64 = 1e-6;

/// Number of counts of a converter.
#[must_use]
pub fn full_scale(adc_bits: u8) -> f64 {
    math::exp2(f64::from(adc_bits.min(32)))
}

/// Largest count of a converter with this number of counts. The largest value of a field of 16 bits means
/// that there is no count.
#[must_use]
pub fn largest_count(full_scale: f64) -> f64 {
    let last = full_scale - 1.0;
    if last == f64::from(ABSENT_COUNT) {
        last - 1.0
    } else {
        last
    }
}

/// What a strain signal that is not in counts stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrainSignal {
    /// Load of the member: force, N, or bending moment, N m.
    Load,
    /// Strain of the member, m/m.
    Strain,
    /// Output of the bridge over its excitation, V/V.
    BridgeRatio,
    /// Output of the amplifier, V.
    Voltage,
}

/// One channel without its filter: counts = zero + gain * load. Loads are newtons of tension on an
/// axial channel, newton metres of bending on a bending one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelScale {
    /// Counts at no load.
    pub zero_counts: f64,
    /// Counts for one unit of load.
    pub counts_per_unit: f64,
    /// Largest count that the converter gives.
    pub largest_count: f64,
}

impl ChannelScale {
    /// The output in counts before noise and rounding.
    #[must_use]
    pub fn level(&self, load: f64) -> f64 {
        self.zero_counts + self.counts_per_unit * load
    }

    /// What the converter makes of a level: rounded, held within its range.
    #[must_use]
    pub fn convert(&self, level_counts: f64) -> u16 {
        // `as` saturates, and takes NaN to 0.
        level_counts.round().clamp(0.0, self.largest_count) as u16
    }

    /// The load that a count stands for by this scale.
    #[must_use]
    pub fn load(&self, counts: f64) -> f64 {
        (counts - self.zero_counts) / self.counts_per_unit
    }

    /// Load of one count.
    #[must_use]
    pub fn load_per_count(&self) -> f64 {
        1.0 / self.counts_per_unit.abs()
    }

    /// Smallest and largest load within the converter's range.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        let ends = [self.load(0.0), self.load(self.largest_count)];
        if ends[0] <= ends[1] {
            ends
        } else {
            [ends[1], ends[0]]
        }
    }

    /// Whether a count is at either end of the range, so that the load may lie beyond.
    #[must_use]
    pub fn saturated(&self, counts: u16) -> bool {
        counts == 0 || f64::from(counts) >= self.largest_count
    }

    /// This scale with what a calibration found: the counts at no load, and the true load over the
    /// nominal one.
    #[must_use]
    pub fn calibrated(&self, zero_counts: f64, gain_factor: f64) -> Self {
        Self {
            zero_counts,
            counts_per_unit: self.counts_per_unit / gain_factor,
            ..*self
        }
    }
}

impl StrainChain {
    /// Section of the tubes.
    ///
    /// # Errors
    /// When the sensors file does not have it.
    pub fn section(&self) -> Result<Section, Error> {
        Ok(Section::Tube {
            outer_diameter_m: needed("strain.tube_outer_diameter_m", self.tube_outer_diameter_m)?,
            wall_m: needed("strain.tube_wall_m", self.tube_wall_m)?,
        })
    }

    /// Young's modulus of the tubes, Pa.
    ///
    /// # Errors
    /// When the sensors file does not have it.
    pub fn modulus_pa(&self) -> Result<f64, Error> {
        needed("strain.youngs_modulus_pa", self.youngs_modulus_pa)
    }

    /// Load of a unit of strain: E A of an axial channel, N, E W of a bending channel, N m.
    fn stiffness(&self, bends: bool) -> Result<f64, Error> {
        let section = self.section()?;
        let modulus_pa = self.modulus_pa()?;
        Ok(if bends {
            modulus_pa * section.section_modulus_m3()
        } else {
            modulus_pa * section.area_m2()
        })
    }

    /// Scale of an axial channel, N.
    ///
    /// # Errors
    /// When the wiring does not react to axial strain, or a value of the chain is absent or out of range.
    pub fn axial_scale(&self) -> Result<ChannelScale, Error> {
        if let Some(load) = self.given().load_per_count(|| self.stiffness(false))? {
            return self.scale_of(1.0 / load, "counts a newton");
        }
        let bridge = needed("strain.bridge", self.bridge)?;
        let (gauge_factor, poisson_ratio) = self.gauge()?;
        let ratio = bridge.axial_gain(gauge_factor, poisson_ratio) / self.stiffness(false)?;
        self.scale(self.gain_resistor_ohm, ratio, "counts a newton")
    }

    /// Scale of a bending channel, N m; `None` without bending bridges.
    ///
    /// # Errors
    /// When the wiring does not react to bending, or a value of the chain is absent or out of range.
    pub fn bending_scale(&self) -> Result<Option<ChannelScale>, Error> {
        let Some(bending) = &self.bending else {
            return Ok(None);
        };
        self.bending_scale_of(bending).map(Some)
    }

    fn bending_scale_of(&self, bending: &BendingBridge) -> Result<ChannelScale, Error> {
        if let Some(load) = bending.given().load_per_count(|| self.stiffness(true))? {
            return self.scale_of(1.0 / load, "counts a newton metre");
        }
        let bridge = needed("strain.bending.bridge", bending.bridge)?;
        let (gauge_factor, poisson_ratio) = self.gauge()?;
        let ratio = bridge.bending_gain(gauge_factor, poisson_ratio) / self.stiffness(true)?;
        self.scale(bending.gain_resistor_ohm, ratio, "counts a newton metre")
    }

    fn gauge(&self) -> Result<(f64, f64), Error> {
        Ok((
            needed("strain.gauge_factor", self.gauge_factor)?,
            needed("strain.poisson_ratio", self.poisson_ratio)?,
        ))
    }

    /// Excitation and converter span are one voltage, which therefore cancels.
    fn scale(
        &self,
        gain_resistor_ohm: Option<f64>,
        output_per_unit: f64,
        name: &'static str,
    ) -> Result<ChannelScale, Error> {
        let gain_resistor_ohm = needed("strain.gain_resistor_ohm", gain_resistor_ohm)?;
        let gain = self.amplifier.gain(gain_resistor_ohm);
        self.scale_of(output_per_unit * gain * full_scale(self.adc_bits), name)
    }

    fn scale_of(&self, counts_per_unit: f64, name: &'static str) -> Result<ChannelScale, Error> {
        let bits = self.adc_bits;
        require(
            (1..=32).contains(&bits),
            "adc_bits",
            f64::from(bits),
            "bit",
            "1 to 32",
        )?;
        require(
            counts_per_unit != 0.0,
            name,
            counts_per_unit,
            "count",
            "finite and not zero; check section, modulus, gain resistor and wiring, or the calibration",
        )?;
        let full_scale = full_scale(bits);
        Ok(ChannelScale {
            zero_counts: full_scale / 2.0,
            counts_per_unit,
            largest_count: largest_count(full_scale),
        })
    }

    /// Counts of one SI unit of a signal that is not in counts, of a bending or an axial channel. The
    /// counts at no load are those of the scale.
    ///
    /// # Errors
    /// When the sensors file has not what the signal needs; the error names the field.
    pub fn counts_per_unit(&self, signal: StrainSignal, bends: bool) -> Result<f64, Error> {
        let scale = match bends {
            true => self.bending_scale()?,
            false => Some(self.axial_scale()?),
        };
        let scale = needed("strain.bending", scale)?;
        let bending = self.bending.as_ref().filter(|_| bends);
        let given_per_mv_v = match bending {
            Some(bending) => bending.n_m_per_mv_v.or(bending.um_m_per_mv_v),
            None => self.n_per_mv_v.or(self.um_m_per_mv_v),
        };
        let gain_resistor_ohm = match bending {
            Some(bending) => bending.gain_resistor_ohm,
            None => self.gain_resistor_ohm,
        };
        Ok(match signal {
            StrainSignal::Load => scale.counts_per_unit,
            StrainSignal::Strain => scale.counts_per_unit * self.stiffness(bends)?,
            StrainSignal::BridgeRatio if given_per_mv_v.is_some() => BRIDGE_RATIO_PER_COUNT.recip(),
            StrainSignal::BridgeRatio => {
                let resistor_ohm = needed("strain.gain_resistor_ohm", gain_resistor_ohm)?;
                self.amplifier.gain(resistor_ohm) * full_scale(self.adc_bits)
            }
            StrainSignal::Voltage => {
                full_scale(self.adc_bits) / needed("strain.excitation_v", self.excitation_v)?
            }
        })
    }

    /// Bending moment in each of both lower tubes at its bridge for one newton of the lower arm's
    /// ball-normal force, m: both tubes take a half, over the distance from the ball joint.
    #[must_use]
    pub fn bending_moment_per_ball_normal_m(&self) -> Option<f64> {
        self.bending
            .as_ref()
            .map(|bending| bending.distance_from_ball_joint_m / 2.0)
    }
}

/// A channel that is given by its calibration, in the place of gauges and amplifier.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Given {
    /// Load of one count.
    pub per_count: Option<f64>,
    /// Load for 1 mV/V.
    pub per_mv_v: Option<f64>,
    /// Strain for 1 mV/V, um/m.
    pub um_m_per_mv_v: Option<f64>,
}

impl Given {
    /// Load of one count; `None` if the channel is given by gauges and amplifier.
    fn load_per_count(
        self,
        stiffness: impl Fn() -> Result<f64, Error>,
    ) -> Result<Option<f64>, Error> {
        let mv_v_per_count = 1e3 * BRIDGE_RATIO_PER_COUNT;
        Ok(match self {
            Self {
                per_count: Some(load),
                ..
            } => Some(load),
            Self {
                per_mv_v: Some(load),
                ..
            } => Some(load * mv_v_per_count),
            Self {
                um_m_per_mv_v: Some(strain),
                ..
            } => Some(1e-6 * strain * stiffness()? * mv_v_per_count),
            _ => None,
        })
    }
}

impl StrainChain {
    pub(crate) const fn given(&self) -> Given {
        Given {
            per_count: self.n_per_count,
            per_mv_v: self.n_per_mv_v,
            um_m_per_mv_v: self.um_m_per_mv_v,
        }
    }
}

impl BendingBridge {
    pub(crate) const fn given(&self) -> Given {
        Given {
            per_count: self.n_m_per_count,
            per_mv_v: self.n_m_per_mv_v,
            um_m_per_mv_v: self.um_m_per_mv_v,
        }
    }
}

/// A field of the sensors file that something needs.
fn needed<T>(field: &'static str, value: Option<T>) -> Result<T, Error> {
    value.ok_or(Error::MissingField { field })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn chain(bridge: Bridge, gain_resistor_ohm: f64, adc_bits: u8) -> StrainChain {
        StrainChain {
            rate_hz: 100.0,
            tube_outer_diameter_m: Some(0.0254),
            tube_wall_m: Some(0.00165),
            youngs_modulus_pa: Some(MATERIALS[3].youngs_modulus_pa),
            poisson_ratio: Some(MATERIALS[3].poisson_ratio),
            gauge_factor: Some(2.1),
            excitation_v: Some(5.0),
            bridge: Some(bridge),
            gain_resistor_ohm: Some(gain_resistor_ohm),
            n_per_count: None,
            n_per_mv_v: None,
            um_m_per_mv_v: None,
            amplifier: Amplifier::default(),
            bending: Some(BendingBridge {
                bridge: Some(Bridge::FullBending),
                gain_resistor_ohm: Some(680.0),
                n_m_per_count: None,
                n_m_per_mv_v: None,
                um_m_per_mv_v: None,
                distance_from_ball_joint_m: 0.1,
            }),
            transducer: None,
            lag_hz: 19.9,
            adc_bits,
            noise_counts: 0.5,
            zero_error_counts: 0.5,
        }
    }

    #[test]
    fn gains_of_the_amplifier() {
        // 233 and 805 in section 3.4.
        let amplifier = Amplifier::default();
        assert!((amplifier.gain(350.0) - 233.571_428_571).abs() < 1e-6);
        assert!((amplifier.gain(100.0) - 805.0).abs() < 1e-12);
        let socket = 1.0 - amplifier.gain(101.0) / amplifier.gain(100.0);
        assert!((socket - 0.0098).abs() < 5e-5, "{socket}");
    }

    #[test]
    fn millivolts_at_a_thousand_microstrain() {
        let millivolts = |bridge: Bridge| 5e3 * bridge.axial_gain(2.1, 0.28) * 1e-3;
        assert!((millivolts(Bridge::Quarter) - 2.625).abs() < 1e-9);
        assert!((millivolts(Bridge::HalfAxial) - 5.25).abs() < 1e-9);
        let full = 5e3 * Bridge::FullBending.bending_gain(2.1, 0.28) * 1e-3;
        assert!((full - 10.5).abs() < 1e-9);
        let arms = Bridge::Quarter.arm_strains(1e-3, 0.0, 0.28);
        let short = exact_output(2.1, arms) / linear_output(2.1, arms) - 1.0;
        assert!((short + 0.00105).abs() < 5e-6, "{short}");
    }

    #[test]
    fn newtons_a_count() {
        for (bridge, resistor, bits, newtons, tolerance) in [
            (Bridge::Quarter, 350.0, 10, 186.0, 0.5),
            (Bridge::HalfAxial, 350.0, 10, 93.0, 0.5),
            (Bridge::FullPoisson, 350.0, 10, 73.0, 0.5),
            (Bridge::Quarter, 100.0, 10, 54.0, 0.5),
            (Bridge::HalfAxial, 100.0, 10, 27.0, 0.5),
            (Bridge::FullPoisson, 100.0, 10, 21.0, 0.5),
            (Bridge::FullPoisson, 100.0, 12, 5.2, 0.1),
        ] {
            let scale = chain(bridge, resistor, bits).axial_scale().expect("sound");
            let found = scale.load_per_count();
            assert!(
                (found - newtons).abs() < tolerance,
                "{bridge:?} {resistor}: {found}"
            );
        }
        let one = chain(Bridge::Quarter, 350.0, 10);
        let stiffness = one.stiffness(false).expect("sound");
        assert!((stiffness - 23.4e6).abs() < 0.05e6);
        let microstrain = one.axial_scale().expect("sound").load_per_count() / stiffness * 1e6;
        assert!((microstrain - 7.96).abs() < 0.01, "{microstrain}");
    }

    #[test]
    fn bending_bridge_reads_the_ball_normal_force() {
        let chain = chain(Bridge::HalfAxial, 100.0, 10);
        let scale = chain.bending_scale().expect("sound").expect("given");
        let arm = chain.bending_moment_per_ball_normal_m().expect("given");
        let newtons = scale.load_per_count() / arm;
        // About 7.6 N as the mean of both tubes, within +-5.5 kN, for the length along the tube.
        assert!((newtons / 2.0_f64.sqrt() - 7.6).abs() < 0.8, "{newtons}");
        assert!((scale.range()[1] / arm - 5500.0).abs() < 600.0);
    }

    #[test]
    fn wirings_reject_what_they_must() {
        let (gf, nu) = (2.1, 0.28);
        assert_eq!(Bridge::HalfAxial.bending_gain(gf, nu), 0.0);
        assert_eq!(Bridge::FullPoisson.bending_gain(gf, nu), 0.0);
        assert_eq!(Bridge::HalfBending.axial_gain(gf, nu), 0.0);
        assert_eq!(Bridge::FullBending.axial_gain(gf, nu), 0.0);
        assert_eq!(
            Bridge::Quarter.axial_gain(gf, nu),
            Bridge::Quarter.bending_gain(gf, nu)
        );
        assert!((Bridge::HalfBending.bending_gain(gf, nu) - gf / 2.0).abs() < 1e-12);
        assert!((Bridge::HalfPoisson.axial_gain(gf, nu) - 1.28 * gf / 4.0).abs() < 1e-12);
        let error = chain(Bridge::HalfBending, 100.0, 10).axial_scale();
        assert!(error.is_err(), "a bending half bridge reads no axial force");
        assert!(chain(Bridge::Quarter, 100.0, 33).axial_scale().is_err());
        assert!(chain(Bridge::Quarter, 0.0, 10).axial_scale().is_err());
    }

    #[test]
    fn the_absent_count_is_never_sent() {
        let scale = chain(Bridge::HalfAxial, 100.0, 16)
            .axial_scale()
            .expect("sound");
        assert_eq!(scale.convert(1e12), 0xFFFE);
        assert_eq!(scale.convert(-1e12), 0);
        assert_eq!(scale.convert(f64::NAN), 0);
        assert!(scale.saturated(0xFFFE) && scale.saturated(0) && !scale.saturated(512));
    }

    /// A signal in each unit, of gauges that a member's force strains, is the force in counts.
    #[test]
    fn a_force_in_each_unit_has_the_counts_of_the_force() {
        let gauges = chain(Bridge::FullPoisson, 100.0, 16);
        let (force_n, stiffness_n) = (4000.0, gauges.stiffness(false).expect("sound"));
        let strain = force_n / stiffness_n;
        let ratio = Bridge::FullPoisson.axial_gain(2.1, 0.28) * strain;
        let volts = 5.0 * 805.0 * ratio;
        let scale = gauges.axial_scale().expect("sound");
        let expected = scale.level(force_n) - scale.zero_counts;
        for (signal, value) in [
            (StrainSignal::Load, force_n),
            (StrainSignal::Strain, strain),
            (StrainSignal::BridgeRatio, ratio),
            (StrainSignal::Voltage, volts),
        ] {
            let counts = value * gauges.counts_per_unit(signal, false).expect("sound");
            assert!(
                (counts / expected - 1.0).abs() < 1e-12,
                "{signal:?} {counts}"
            );
        }
        let moment = gauges.counts_per_unit(StrainSignal::Load, true);
        let scale = gauges.bending_scale().expect("sound").expect("given");
        assert_eq!(moment.expect("sound"), scale.counts_per_unit);
    }

    #[test]
    fn a_chain_is_given_by_its_calibration() {
        let gauges = chain(Bridge::HalfAxial, 100.0, 16);
        let ratio_per_strain = Bridge::HalfAxial.axial_gain(2.1, 0.28);
        let stiffness_n = gauges.stiffness(false).expect("sound");
        let um_m_per_mv_v = 1e-3 / ratio_per_strain * 1e6;
        let n_per_mv_v = 1e-3 / ratio_per_strain * stiffness_n;
        let none = StrainChain {
            bridge: None,
            gauge_factor: None,
            poisson_ratio: None,
            excitation_v: None,
            gain_resistor_ohm: None,
            bending: None,
            ..gauges
        };
        let missing = none
            .axial_scale()
            .expect_err("nothing is given")
            .to_string();
        assert!(missing.contains("strain.bridge"), "{missing}");
        let given = |n_per_count, n_per_mv_v, um_m_per_mv_v| StrainChain {
            n_per_count,
            n_per_mv_v,
            um_m_per_mv_v,
            ..none.clone()
        };
        let load = |chain: &StrainChain, counts: f64| {
            let scale = chain.axial_scale().expect("sound");
            scale.load(scale.zero_counts + counts)
        };
        assert_eq!(load(&given(Some(-2.5), None, None), 100.0), -250.0);
        for chain in [
            given(None, Some(n_per_mv_v), None),
            given(None, None, Some(um_m_per_mv_v)),
        ] {
            // 0.2 mV/V.
            let counts = 2e-4
                * chain
                    .counts_per_unit(StrainSignal::BridgeRatio, false)
                    .expect("sound");
            assert!((counts - 200.0).abs() < 1e-9, "{counts}");
            assert!((load(&chain, counts) - 0.2 * n_per_mv_v).abs() < 1e-6);
            let volts = chain.counts_per_unit(StrainSignal::Voltage, false);
            let told = volts.expect_err("no excitation").to_string();
            assert!(told.contains("strain.excitation_v"), "{told}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(8), ..ProptestConfig::default() })]

        #[test]
        fn back_within_half_a_count(part in 0.01..0.99, zero in -5.0..5.0, gain in 0.9..1.1) {
            let scale = chain(Bridge::HalfAxial, 100.0, 12).axial_scale().expect("sound");
            let true_scale = scale.calibrated(scale.zero_counts + zero, gain);
            let [low, high] = true_scale.range();
            let load = low + part * (high - low);
            let counts = true_scale.convert(true_scale.level(load));
            let found = true_scale.load(f64::from(counts));
            prop_assert!((found - load).abs() <= 0.5001 * true_scale.load_per_count());
        }

        #[test]
        fn linear_output_is_the_slope(axial in -2e-3..2e-3, bending in -2e-3..2e-3) {
            for bridge in [
                Bridge::Quarter, Bridge::HalfAxial, Bridge::HalfBending, Bridge::HalfPoisson,
                Bridge::FullPoisson, Bridge::FullBending,
            ] {
                let arms = bridge.arm_strains(axial, bending, 0.28);
                let (exact, linear) = (exact_output(2.1, arms), linear_output(2.1, arms));
                // Second order in GF e: (2.1 * 4e-3)^2.
                prop_assert!((exact - linear).abs() < 7.1e-5, "{bridge:?} {exact} {linear}");
            }
        }
    }
}
