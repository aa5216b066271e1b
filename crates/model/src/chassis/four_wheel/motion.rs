use super::State;
use crate::integrate::Running;
use crate::values::{PerWheelValues, Values};

/// A state, or its rate, as the equations calculate with it.
#[derive(Clone, Copy)]
pub(super) struct Motion<V: PerWheelValues> {
    pub longitudinal: V::Number,
    pub lateral: V::Number,
    pub yaw_rate: V::Number,
    pub roll: V::Number,
    pub roll_rate: V::Number,
    pub pitch: V::Number,
    pub pitch_rate: V::Number,
    pub tangent: V,
    pub ratio: V,
    pub spin: V,
}

impl<V: PerWheelValues> Motion<V> {
    #[inline(always)]
    pub(super) fn of(state: &State<V::Number>) -> Self {
        Self {
            longitudinal: state.longitudinal_m_s,
            lateral: state.lateral_m_s,
            yaw_rate: state.yaw_rate_rad_s,
            roll: state.roll_rad,
            roll_rate: state.roll_rate_rad_s,
            pitch: state.pitch_rad,
            pitch_rate: state.pitch_rate_rad_s,
            tangent: V::of(state.slip_tangent),
            ratio: V::of(state.slip_ratio),
            spin: V::of(state.wheel_speed_rad_s),
        }
    }

    #[inline(always)]
    pub(super) fn state(&self) -> State<V::Number> {
        State {
            longitudinal_m_s: self.longitudinal,
            lateral_m_s: self.lateral,
            yaw_rate_rad_s: self.yaw_rate,
            roll_rad: self.roll,
            roll_rate_rad_s: self.roll_rate,
            pitch_rad: self.pitch,
            pitch_rate_rad_s: self.pitch_rate,
            slip_tangent: self.tangent.list(),
            slip_ratio: self.ratio.list(),
            wheel_speed_rad_s: self.spin.list(),
        }
    }
}

impl<V: PerWheelValues> Running for Motion<V> {
    #[inline(always)]
    fn plus(&self, rate: &Self, by: f64) -> Self {
        Self {
            longitudinal: self.longitudinal + rate.longitudinal.scaled(by),
            lateral: self.lateral + rate.lateral.scaled(by),
            yaw_rate: self.yaw_rate + rate.yaw_rate.scaled(by),
            roll: self.roll + rate.roll.scaled(by),
            roll_rate: self.roll_rate + rate.roll_rate.scaled(by),
            pitch: self.pitch + rate.pitch.scaled(by),
            pitch_rate: self.pitch_rate + rate.pitch_rate.scaled(by),
            tangent: self.tangent + rate.tangent.scaled(by),
            ratio: self.ratio + rate.ratio.scaled(by),
            spin: self.spin + rate.spin.scaled(by),
        }
    }
}
