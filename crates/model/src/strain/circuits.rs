use sample::{StrainChannel, Wheel};

use crate::sensors::{Amplifier, Bridge};

/// Where a strain circuit's gauges sit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CircuitMember {
    /// Upper arm of the front axle: one gauge, on the upper side near the wheel.
    UpperArm,
    /// Upper arm, front tube.
    UpperFront,
    /// Upper arm, rear tube.
    UpperRear,
    /// Lower arm, front tube.
    LowerFront,
    /// Lower arm, rear tube.
    LowerRear,
    /// Steering tie rod.
    TieRod,
}

impl CircuitMember {
    /// The project's channel for this place; none for the single gauge of a front upper arm, which
    /// reads no leg by itself.
    #[must_use]
    pub const fn channel(self) -> Option<StrainChannel> {
        match self {
            Self::UpperArm => None,
            Self::UpperFront => Some(StrainChannel::UpperFront),
            Self::UpperRear => Some(StrainChannel::UpperRear),
            Self::LowerFront => Some(StrainChannel::LowerFront),
            Self::LowerRear => Some(StrainChannel::LowerRear),
            Self::TieRod => Some(StrainChannel::TieRod),
        }
    }
}

/// Bridge as Table 3.2 names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CircuitBridge {
    /// One active gauge.
    Quarter,
    /// Two active gauges.
    Half,
}

impl CircuitBridge {
    /// The wiring that was meant: a half bridge has its gauges in opposite arms and reads axial
    /// force. (Wired into adjacent arms, as section 5.2.1 found of some, it reads bending.)
    #[must_use]
    pub const fn intended(self) -> Bridge {
        match self {
            Self::Quarter => Bridge::Quarter,
            Self::Half => Bridge::HalfAxial,
        }
    }
}

/// One row of Table 3.2: a strain circuit of the thesis's vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circuit {
    /// Number of the CAN box.
    pub can_box: u8,
    /// Channel within the box; the table prints the first row's 0 only.
    pub box_channel: u8,
    /// Corner.
    pub wheel: Wheel,
    /// Place of the gauges.
    pub member: CircuitMember,
    /// Gain resistor R_G, ohm.
    pub gain_resistor_ohm: f64,
    /// Filter capacitor of the power line, F.
    pub power_filter_f: f64,
    /// Filter capacitor of the signal line, F.
    pub signal_filter_f: f64,
    /// Half of the dual amplifier, A or B.
    pub amplifier_channel: char,
    /// Colour of the output wire.
    pub output_wire: &'static str,
    /// Bridge.
    pub bridge: CircuitBridge,
    /// Tolerance of the bridge's resistors, as a part; `None` where they are mixed.
    pub resistor_tolerance: Option<f64>,
    /// Whether a potentiometer adjusts the bridge.
    pub adjuster: bool,
}

impl Circuit {
    /// Gain of the amplifier, equation 3.5.
    #[must_use]
    pub fn gain(&self) -> f64 {
        Amplifier::default().gain(self.gain_resistor_ohm)
    }
}

/// Table 3.2 of the thesis, all 16 circuits. It prints "Rear Left" for box 4 and for box 5; box 5
/// is the rear right.
#[rustfmt::skip]
pub const TABLE_3_2: [Circuit; 16] = [
    circuit(1, 0, Wheel::FrontLeft, CircuitMember::UpperArm, [100.0, 100.0, 100.0], 'A', "blue with tape", CircuitBridge::Quarter, Some(0.001), true),
    circuit(1, 1, Wheel::FrontLeft, CircuitMember::TieRod, [350.0, 100.0, 100.0], 'B', "blue", CircuitBridge::Quarter, Some(0.001), false),
    circuit(1, 2, Wheel::FrontLeft, CircuitMember::LowerFront, [350.0, 220.0, 100.0], 'A', "green", CircuitBridge::Half, Some(0.01), false),
    circuit(1, 3, Wheel::FrontLeft, CircuitMember::LowerRear, [350.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Half, Some(0.01), false),
    circuit(3, 0, Wheel::FrontRight, CircuitMember::UpperArm, [100.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Quarter, Some(0.001), false),
    circuit(3, 1, Wheel::FrontRight, CircuitMember::TieRod, [350.0, 220.0, 100.0], 'A', "green", CircuitBridge::Quarter, Some(0.001), false),
    circuit(3, 2, Wheel::FrontRight, CircuitMember::LowerFront, [350.0, 220.0, 100.0], 'A', "green", CircuitBridge::Half, Some(0.01), false),
    circuit(3, 3, Wheel::FrontRight, CircuitMember::LowerRear, [350.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Half, Some(0.01), true),
    circuit(4, 0, Wheel::RearLeft, CircuitMember::UpperFront, [100.0, 220.0, 100.0], 'A', "green", CircuitBridge::Half, Some(0.001), false),
    circuit(4, 1, Wheel::RearLeft, CircuitMember::UpperRear, [100.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Half, Some(0.01), false),
    circuit(4, 2, Wheel::RearLeft, CircuitMember::LowerFront, [100.0, 220.0, 100.0], 'A', "green", CircuitBridge::Half, Some(0.01), false),
    circuit(4, 3, Wheel::RearLeft, CircuitMember::LowerRear, [100.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Half, Some(0.01), false),
    circuit(5, 0, Wheel::RearRight, CircuitMember::UpperFront, [100.0, 220.0, 100.0], 'A', "green", CircuitBridge::Half, Some(0.01), false),
    circuit(5, 1, Wheel::RearRight, CircuitMember::UpperRear, [100.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Half, Some(0.01), false),
    circuit(5, 2, Wheel::RearRight, CircuitMember::LowerFront, [100.0, 220.0, 100.0], 'A', "green", CircuitBridge::Half, Some(0.001), true),
    circuit(5, 3, Wheel::RearRight, CircuitMember::LowerRear, [100.0, 220.0, 100.0], 'B', "blue", CircuitBridge::Half, None, false),
];

#[expect(clippy::too_many_arguments, reason = "the columns of a printed table")]
const fn circuit(
    can_box: u8,
    box_channel: u8,
    wheel: Wheel,
    member: CircuitMember,
    [gain_resistor_ohm, power_filter_uf, signal_filter_uf]: [f64; 3],
    amplifier_channel: char,
    output_wire: &'static str,
    bridge: CircuitBridge,
    resistor_tolerance: Option<f64>,
    adjuster: bool,
) -> Circuit {
    Circuit {
        can_box,
        box_channel,
        wheel,
        member,
        gain_resistor_ohm,
        power_filter_f: power_filter_uf * 1e-6,
        signal_filter_f: signal_filter_uf * 1e-6,
        amplifier_channel,
        output_wire,
        bridge,
        resistor_tolerance,
        adjuster,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strain::rc_corner_hz;

    #[test]
    fn table_is_whole_and_consistent() {
        for wheel in Wheel::ALL {
            let rows: Vec<_> = TABLE_3_2.iter().filter(|row| row.wheel == wheel).collect();
            assert_eq!(rows.len(), 4, "{wheel}");
            let boxes = if wheel.is_front() { [1, 3] } else { [4, 5] };
            for (index, row) in rows.iter().enumerate() {
                assert_eq!(row.can_box, boxes[usize::from(!wheel.is_left())]);
                assert_eq!(usize::from(row.box_channel), index);
                assert!((row.gain() - 805.0).abs() < 1e-9 || (row.gain() - 233.571).abs() < 1e-3);
                assert!((rc_corner_hz(80.0, row.signal_filter_f) - 19.894).abs() < 1e-3);
            }
        }
        let quarter = |row: &&Circuit| row.bridge == CircuitBridge::Quarter;
        assert_eq!(TABLE_3_2.iter().filter(quarter).count(), 4);
        assert_eq!(TABLE_3_2.iter().filter(|row| row.adjuster).count(), 3);
        assert_eq!(
            TABLE_3_2
                .iter()
                .filter(|row| row.resistor_tolerance.is_none())
                .count(),
            1
        );
        assert_eq!(TABLE_3_2[0].power_filter_f, 100.0 * 1e-6);
        assert_eq!(TABLE_3_2[1].member.channel(), Some(StrainChannel::TieRod));
    }
}
