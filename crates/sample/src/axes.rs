use crate::ForceFrame;

type Vector = [f64; 3];

/// Axes of a wheel: orthogonal unit vectors x, y, z in vehicle axes.
///
/// This is the one conversion between vehicle axes and the frames of a tyre's force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelAxes([Vector; 3]);

impl WheelAxes {
    /// Wheel-carrier frame (C axes of TYDEX, release 1.3, section 2.2, tilted by the body's roll and
    /// pitch): y = spindle axis s, x = unit(y × z of the chassis), z = x × y.
    ///
    /// `spindle_body` is a unit vector to the left on both sides of the vehicle.
    #[must_use]
    pub fn carrier(spindle_body: Vector) -> Self {
        let x = unit(cross(spindle_body, [0.0, 0.0, 1.0]));
        Self([x, spindle_body, cross(x, spindle_body)])
    }

    /// Contact frame (W axes of TYDEX): z = normal n of the ground, x = unit(s × n), y = n × x.
    ///
    /// Both arguments are unit vectors in vehicle axes; the spindle axis s points to the left.
    #[must_use]
    pub fn contact(spindle_body: Vector, normal_body: Vector) -> Self {
        let x = unit(cross(spindle_body, normal_body));
        Self([x, cross(normal_body, x), normal_body])
    }

    /// Axes of a frame.
    #[must_use]
    pub fn of(frame: ForceFrame, spindle_body: Vector, normal_body: Vector) -> Self {
        match frame {
            ForceFrame::Contact => Self::contact(spindle_body, normal_body),
            ForceFrame::WheelCarrier => Self::carrier(spindle_body),
        }
    }

    /// The rows x, y, z: the matrix that takes vectors from vehicle axes to these.
    #[must_use]
    pub const fn rows(&self) -> &[Vector; 3] {
        &self.0
    }

    /// A vector of vehicle axes in these axes.
    #[must_use]
    pub fn resolve(&self, body: Vector) -> Vector {
        self.0.map(|axis| dot(axis, body))
    }

    /// A vector of these axes in vehicle axes.
    #[must_use]
    pub fn to_body(&self, own: Vector) -> Vector {
        let [x, y, z] = self.0;
        std::array::from_fn(|i| own[0] * x[i] + own[1] * y[i] + own[2] * z[i])
    }
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(v: Vector) -> Vector {
    let length = dot(v, v).sqrt();
    v.map(|part| part / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On level ground an upright, straight wheel has the axes of the vehicle in both frames.
    #[test]
    fn an_upright_wheel_has_the_axes_of_the_vehicle() {
        let (left, up) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        for frame in [ForceFrame::Contact, ForceFrame::WheelCarrier] {
            let axes = WheelAxes::of(frame, left, up);
            assert_eq!(axes.resolve([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0], "{frame:?}");
        }
    }

    /// A wheel that leans (sine 0.6) on level ground: the load has a part along the spindle.
    #[test]
    fn a_leaning_wheel_carries_load_along_its_spindle() {
        let (sin, cos) = (0.6, 0.8);
        let spindle = [0.0, cos, sin];
        let contact = WheelAxes::contact(spindle, [0.0, 0.0, 1.0]);
        let carrier = WheelAxes::carrier(spindle);
        let body = contact.to_body([0.0, 0.0, 100.0]);
        assert_eq!(body, [0.0, 0.0, 100.0]);
        let own = carrier.resolve(body);
        for (found, expected) in own.into_iter().zip([0.0, 60.0, 80.0]) {
            assert!((found - expected).abs() < 1e-12, "{own:?}");
        }
        let back = carrier.to_body(own);
        assert!(
            (back[2] - 100.0).abs() < 1e-12 && back[1].abs() < 1e-12,
            "{back:?}"
        );
    }
}
