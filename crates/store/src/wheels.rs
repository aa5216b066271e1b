//! Entries of wheels and axles: `axle` counts from the front from 1, `side` is `left` or `right`.

use sample::{Axle, PerWheel, Side, Wheel};

use crate::error::MessageError;
use crate::proto::atvrec as pb;

/// Axle number and side of a wheel.
pub(crate) fn position(wheel: Wheel) -> (u32, String) {
    let axle = if wheel.is_front() { 1 } else { 2 };
    let side = if wheel.is_left() {
        Side::Left
    } else {
        Side::Right
    };
    (axle, side.name().to_owned())
}

/// Axle number.
pub(crate) const fn axle_number(axle: Axle) -> u32 {
    match axle {
        Axle::Front => 1,
        Axle::Rear => 2,
    }
}

/// The axle with this number; the estimator has two.
pub(crate) fn axle(number: u32) -> Option<Axle> {
    Axle::ALL
        .into_iter()
        .find(|axle| axle_number(*axle) == number)
}

/// The side with this name.
pub(crate) fn side(name: &str) -> Result<Side, MessageError> {
    side_of(name.as_bytes()).ok_or(MessageError::Absent("side, which is left or right,"))
}

fn side_of(name: &[u8]) -> Option<Side> {
    Side::ALL
        .into_iter()
        .find(|side| side.name().as_bytes() == name)
}

/// The wheel of an event.
pub(crate) fn wheel(axle: u32, side: &str) -> Result<Wheel, MessageError> {
    wheel_of(axle, side.as_bytes()).ok_or(MessageError::Range {
        field: "axle",
        value: axle.into(),
    })
}

/// The wheel of an axle's number and the name of a side; `None` for one that the estimator does not have.
pub(crate) fn wheel_of(number: u32, name: &[u8]) -> Option<Wheel> {
    let [left, right] = axle(number)?.wheels();
    side_of(name).map(|side| match side {
        Side::Left => left,
        Side::Right => right,
    })
}

/// An entry of a list of wheels.
pub(crate) trait WheelEntry {
    /// The wheel that it is for; `None` for one that the estimator does not have.
    fn wheel(&self) -> Option<Wheel>;
}

macro_rules! wheel_entries {
    ($($entry:ident)*) => {
        $(impl WheelEntry for pb::$entry {
            fn wheel(&self) -> Option<Wheel> {
                wheel_of(self.axle, self.side.as_bytes())
            }
        })*
    };
}

wheel_entries!(
    TyreForce WheelMotion WheelLiftTime WheelRoad WheelFriction WheelGround WheelStrain WheelDeflection WheelAngularSpeed
    WheelHubAcceleration
);

/// A value of each wheel, `absent` where the list has no entry. Entries of further axles are ignored.
pub(crate) fn per_wheel<E: WheelEntry, T: Copy>(
    entries: &[E],
    absent: T,
    value: impl Fn(&E) -> T,
) -> PerWheel<T> {
    let mut each = PerWheel([absent; 4]);
    for entry in entries {
        if let Some(wheel) = entry.wheel() {
            each[wheel] = value(entry);
        }
    }
    each
}

/// The entries of all wheels, in order.
pub(crate) fn entries<E>(entry: impl Fn(Wheel, u32, String) -> E) -> Vec<E> {
    let each = Wheel::ALL.into_iter().map(|wheel| {
        let (axle, side) = position(wheel);
        entry(wheel, axle, side)
    });
    each.collect()
}
