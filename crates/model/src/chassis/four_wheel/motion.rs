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
    pub(super) fn of(state: &State<V::Raw>) -> Self {
        Self {
            longitudinal: V::number(state.longitudinal_m_s),
            lateral: V::number(state.lateral_m_s),
            yaw_rate: V::number(state.yaw_rate_rad_s),
            roll: V::number(state.roll_rad),
            roll_rate: V::number(state.roll_rate_rad_s),
            pitch: V::number(state.pitch_rad),
            pitch_rate: V::number(state.pitch_rate_rad_s),
            tangent: V::of(state.slip_tangent),
            ratio: V::of(state.slip_ratio),
            spin: V::of(state.wheel_speed_rad_s),
        }
    }

    #[inline(always)]
    pub(super) fn state(&self) -> State<V::Raw> {
        let [u, v, r, roll, roll_rate, pitch, pitch_rate] = V::raws([
            self.longitudinal,
            self.lateral,
            self.yaw_rate,
            self.roll,
            self.roll_rate,
            self.pitch,
            self.pitch_rate,
        ]);
        State {
            longitudinal_m_s: u,
            lateral_m_s: v,
            yaw_rate_rad_s: r,
            roll_rad: roll,
            roll_rate_rad_s: roll_rate,
            pitch_rad: pitch,
            pitch_rate_rad_s: pitch_rate,
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
