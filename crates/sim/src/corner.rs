//! One corner's strain bridges and spring potentiometer.

use model::sensors::{BendingBridge, Bridge, Potentiometers, Sensors, StrainChain, Transducer};
use model::strain::{ChannelScale, Lag};
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{STANDARD_GRAVITY_M_S2, StrainChannel, Wheel, WheelAxes};

use crate::faults::{ChannelFaultKind, Faults};
use crate::hidden::Hidden;
use crate::imu::specific_force_at;
use crate::motion::spindle;
use crate::random::Noise;
use crate::{Motion, Options, SimError, TruthState};

/// Where the axial gauges of a lower tube stand, inboard of the ball joint, m; it matters only
/// where they are wired for bending by mistake.
const BENDING_WIRED_DISTANCE_M: f64 = 0.10;

/// Most bits of a converter: the frames of the bus have fields of 16 bits.
const SENT_BITS: u8 = 16;

/// The sensors of one corner.
pub(crate) struct Corner {
    wheel: Wheel,
    /// From the lower ball joint to the gauges that feel bending, m.
    gauge_distance_m: f64,
    strut_design_length_m: Option<f64>,
    /// Wheel-force transducers in the place of gauges on the suspension.
    transducer: Option<Transducer>,
    /// Wheel centre in the design position, from the centre of gravity, m.
    centre_m: Vector3<f64>,
    strain: [Option<Channel>; StrainChannel::COUNT],
    strain_noise_counts: f64,
    /// Absent if no potentiometer is fitted.
    pot: Option<ChannelScale>,
    pot_offset_counts: f64,
    pot_noise_counts: f64,
    noise: Noise,
    faults: Faults,
    frozen: [Option<u16>; StrainChannel::COUNT + 1],
    time_s: f64,
    next_row: usize,
}

/// One strain channel: bridge, amplifier, filter, converter.
struct Channel {
    scale: ChannelScale,
    /// The same channel wired as a bending bridge by mistake.
    bending_wired: ChannelScale,
    offset_counts: f64,
    /// Filter on the level in counts.
    lag: Lag,
}

impl Corner {
    pub(crate) fn new(
        wheel: Wheel,
        motion: &Motion,
        vehicle: &Vehicle,
        sensors: &Sensors,
        options: &Options,
        hidden: &Hidden,
        seed: u64,
    ) -> Result<Self, SimError> {
        let axle = vehicle.axle(wheel);
        check_strain(sensors)?;
        let [ahead_m, left_m] = vehicle.wheel_place_m(wheel);
        let height_m = axle.tyre.unloaded_radius_m - vehicle.body.cg_height_m;
        let mut noise = Noise::new(seed, &format!("corner {wheel}"));
        let pot_offset_counts = noise.within(sensors.deflection.zero_error_counts)
            + hidden.potentiometer_offset_counts[wheel];
        let mut corner = Self {
            wheel,
            gauge_distance_m: sensors
                .strain
                .bending
                .as_ref()
                .map_or(BENDING_WIRED_DISTANCE_M, |b| b.distance_from_ball_joint_m),
            strut_design_length_m: axle.strut.as_ref().map(|strut| strut.design_length_m),
            transducer: sensors.strain.transducer,
            centre_m: Vector3::new(ahead_m, left_m, height_m),
            strain: [const { None }; StrainChannel::COUNT],
            strain_noise_counts: sensors.strain.noise_counts,
            pot: (!sensors.deflection.is_not_fitted())
                .then(|| potentiometer_scale("deflection", &sensors.deflection))
                .transpose()?,
            pot_offset_counts,
            pot_noise_counts: sensors.deflection.noise_counts,
            noise,
            faults: options.faults.clone(),
            frozen: [None; StrainChannel::COUNT + 1],
            time_s: 0.0,
            next_row: 1,
        };
        let first = corner.loads(&motion.states()[0]);
        for channel in StrainChannel::ALL {
            let scale = channel_scale(&sensors.strain, channel)?;
            let Some(scale) = scale else {
                continue;
            };
            let factor = hidden.bridge_gain_factor[wheel][channel.index()];
            let scale = scale.calibrated(scale.zero_counts, factor);
            let offset_counts = corner.noise.within(sensors.strain.zero_error_counts)
                + corner.noise.within(options.hidden.bridge_offset_counts);
            let load = first[channel.index()];
            if load.is_nan() {
                continue;
            }
            corner.strain[channel.index()] = Some(Channel {
                scale,
                bending_wired: bending_wired_scale(&sensors.strain)?,
                offset_counts,
                lag: Lag::settled(sensors.strain.lag_hz, scale.level(load) + offset_counts),
            });
        }
        Ok(corner)
    }

    /// Counts at no load of each strain channel that there is, and of the potentiometer at the
    /// design length.
    pub(crate) fn zeros(&self) -> ([Option<f64>; StrainChannel::COUNT], f64) {
        let zero = |channel: &Channel| channel.scale.zero_counts + channel.offset_counts;
        (
            std::array::from_fn(|i| self.strain[i].as_ref().map(zero)),
            self.pot.map_or(0.0, |pot| pot.zero_counts) + self.pot_offset_counts,
        )
    }

    /// What the strain converters give at `time_s`, which must not fall from call to call.
    pub(crate) fn strain(
        &mut self,
        motion: &Motion,
        time_s: f64,
    ) -> [Option<u16>; StrainChannel::COUNT] {
        while let Some(row) = motion.row(self.next_row) {
            if row.time_s > time_s {
                break;
            }
            self.filter(&row);
            self.next_row += 1;
        }
        self.filter(&motion.at(time_s));
        StrainChannel::ALL.map(|channel| {
            // Drawn for absent channels too, so that a channel's noise does not depend on others.
            let error = self.noise.normal(self.strain_noise_counts);
            let Channel { scale, lag, .. } = self.strain[channel.index()].as_ref()?;
            let (scale, level) = (*scale, lag.output() + error);
            Some(self.convert(Some(channel), scale, level, time_s))
        })
    }

    /// What the potentiometer's converter gives in this state.
    pub(crate) fn deflection(&mut self, state: &TruthState) -> Option<u16> {
        let error = self.noise.normal(self.pot_noise_counts);
        let length_m = state.wheels[self.wheel].strut_length_m;
        let compression_m = self.strut_design_length_m? - length_m;
        if compression_m.is_nan() {
            return None;
        }
        let pot = self.pot?;
        let level = pot.level(compression_m) + self.pot_offset_counts + error;
        Some(self.convert(None, pot, level, state.time_s))
    }

    /// Converts a level, with the faults that the channel (`None`: potentiometer) has now.
    fn convert(
        &mut self,
        channel: Option<StrainChannel>,
        scale: ChannelScale,
        mut level: f64,
        time_s: f64,
    ) -> u16 {
        let slot = channel.map_or(StrainChannel::COUNT, StrainChannel::index);
        let mut frozen = false;
        for fault in self.faults.of_channel(self.wheel, channel, time_s) {
            match fault.kind {
                ChannelFaultKind::Dead => level = 0.0,
                ChannelFaultKind::Frozen => frozen = true,
                ChannelFaultKind::Inverted => level = 2.0 * scale.zero_counts - level,
                ChannelFaultKind::Drifting { counts_per_s } => {
                    level += counts_per_s * (time_s - fault.from_s);
                }
                ChannelFaultKind::Step { counts } => level += counts,
                ChannelFaultKind::BendingWired | ChannelFaultKind::SwappedWith { .. } => {}
            }
        }
        let count = scale.convert(level);
        let held = self.frozen[slot].filter(|_| frozen).unwrap_or(count);
        self.frozen[slot] = Some(held);
        held
    }

    /// Moves all filters on to this state.
    fn filter(&mut self, state: &TruthState) {
        let loads = self.loads(state);
        let dt_s = state.time_s - self.time_s;
        self.time_s = state.time_s;
        for kind in StrainChannel::ALL {
            let Some(channel) = &mut self.strain[kind.index()] else {
                continue;
            };
            let (mut read, mut bending_wired) = (kind, false);
            for fault in self.faults.of_channel(self.wheel, Some(kind), state.time_s) {
                match fault.kind {
                    ChannelFaultKind::SwappedWith { channel } => read = channel,
                    ChannelFaultKind::BendingWired => bending_wired = true,
                    _ => {}
                }
            }
            let level = if bending_wired {
                let moment = match read {
                    StrainChannel::LowerFront | StrainChannel::LowerRear => {
                        loads[StrainChannel::LowerFrontBending.index()]
                    }
                    _ => 0.0,
                };
                let moment = if moment.is_nan() { 0.0 } else { moment };
                channel.bending_wired.level(moment)
            } else {
                channel.scale.level(loads[read.index()])
            };
            channel.lag.advance(dt_s, level + channel.offset_counts);
        }
    }

    /// What each channel's gauges feel, in the channels' order: newtons of tension, newton metres
    /// of bending; `NaN` where the motion does not tell.
    fn loads(&self, state: &TruthState) -> [f64; StrainChannel::COUNT] {
        let wheel = &state.wheels[self.wheel];
        if let Some(transducer) = &self.transducer {
            let [x, y, z] = self.transducer_n(state, transducer.outboard_mass_kg);
            let none = f64::NAN;
            return [x, y, z, none, none, none, none];
        }
        let [uf, ur, lf, lr, tie] = wheel.link_force_n;
        // The ball-joint force normal to the arm bends both lower tubes, each by one half.
        let moment = wheel.ball_normal_n * self.gauge_distance_m / 2.0;
        let [vertical, horizontal] = wheel.tube_bending_n_m;
        if vertical.is_finite() && horizontal.is_finite() {
            return [uf, ur, lf, lr, tie, vertical, horizontal];
        }
        [uf, ur, lf, lr, tie, moment, moment]
    }

    /// What a wheel-force transducer measures along the axes of the wheel carrier, N: the force of the ground, less
    /// weight and inertia of the outboard mass. Where the motion does not tell the wheel's own acceleration and
    /// inclination, the wheel moves with the body and is upright.
    fn transducer_n(&self, state: &TruthState, outboard_kg: f64) -> [f64; 3] {
        let wheel = &state.wheels[self.wheel];
        let with_body = specific_force_at(state, &self.centre_m);
        let (axes, force_n, specific_force_m_s2) = match &wheel.ground {
            Some(ground) => {
                let axes = WheelAxes::carrier(ground.spindle_body);
                let own = ground.centre_acceleration_m_s2.map(|acceleration| {
                    Vector3::from(acceleration) + state.up_body() * STANDARD_GRAVITY_M_S2
                });
                let force_n = axes.resolve(ground.force_body_n);
                (axes, force_n, own.unwrap_or(with_body))
            }
            None => {
                let spindle = spindle(wheel.steer_rad, 0.0);
                (WheelAxes::carrier(spindle), wheel.force_n, with_body)
            }
        };
        let of_mass = axes.resolve(specific_force_m_s2.into());
        std::array::from_fn(|axis| force_n[axis] - outboard_kg * of_mass[axis])
    }
}

/// Scale of potentiometers; `table` of the sensors file is named in errors.
pub(crate) fn potentiometer_scale(
    table: &str,
    pots: &Potentiometers,
) -> Result<ChannelScale, SimError> {
    let bad = |field: &str, value, expected| SimError::BadParameter {
        name: format!("{table}.{field}"),
        value,
        expected,
    };
    if !(1..=SENT_BITS).contains(&pots.adc_bits) {
        return Err(bad("adc_bits", f64::from(pots.adc_bits), "1 to 16"));
    }
    if pots.span_m > 0.0 {
        Ok(pots.scale())
    } else {
        Err(bad("span_m", pots.span_m, "above 0"))
    }
}

/// Scale of a strain channel; `None` if it is not fitted.
fn channel_scale(
    strain: &StrainChain,
    channel: StrainChannel,
) -> Result<Option<ChannelScale>, SimError> {
    if strain.is_not_fitted() {
        return Ok(None);
    }
    Ok(match channel {
        StrainChannel::LowerFrontBending | StrainChannel::LowerRearBending => {
            strain.bending_scale()?
        }
        _ => Some(strain.axial_scale()?),
    })
}

/// The axial channel's gauges in adjacent arms of the bridge, the mistake of the thesis's section
/// 5.2.1: counts a newton metre of bending.
fn bending_wired_scale(chain: &StrainChain) -> Result<ChannelScale, SimError> {
    let bending = Some(BendingBridge {
        bridge: Some(Bridge::HalfBending),
        gain_resistor_ohm: chain.gain_resistor_ohm,
        n_m_per_count: None,
        n_m_per_mv_v: None,
        um_m_per_mv_v: None,
        distance_from_ball_joint_m: BENDING_WIRED_DISTANCE_M,
    });
    let chain = StrainChain {
        bending,
        ..chain.clone()
    };
    // A chain that is given by its calibration has no wiring.
    Ok(match chain.bending_scale() {
        Ok(Some(scale)) => scale,
        _ => chain.axial_scale()?,
    })
}

/// Whether the converter's counts fit into the fields of the bus.
fn check_strain(sensors: &Sensors) -> Result<(), SimError> {
    if sensors.strain.adc_bits <= SENT_BITS {
        return Ok(());
    }
    Err(SimError::BadParameter {
        name: "strain.adc_bits".to_owned(),
        value: f64::from(sensors.strain.adc_bits),
        expected: "at most 16, because the bus of the virtual vehicle has fields of 16 bits",
    })
}
