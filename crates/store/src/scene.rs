//! Shapes of a three-dimensional scene, as viewers of logs draw them.

use sample::LogTime;

/// Change of a three-dimensional scene: each entity replaces the earlier one of its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// When.
    pub time: LogTime,
    /// New or changed entities.
    pub entities: Vec<SceneEntity>,
}

/// Shapes that move with one frame of `/tf`.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneEntity {
    /// Name.
    pub id: String,
    /// Frame of its shapes.
    pub frame: String,
    /// The shapes.
    pub shapes: Vec<Shape>,
}

/// One shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Its form.
    pub form: Form,
    /// Position in the frame of the entity, m.
    pub position_m: [f64; 3],
    /// Quaternion x, y, z, w that takes axes of the shape to axes of the frame.
    pub rotation_xyzw: [f64; 4],
    /// Red, green, blue, opacity, each in [0, 1].
    pub colour_rgba: [f64; 4],
}

/// Form of a shape. Lengths are in m.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// Arrow along x; the position is its tail.
    Arrow {
        /// Length of the whole arrow.
        length_m: f64,
        /// Diameter of its shaft.
        diameter_m: f64,
    },
    /// Box; the position is its middle.
    Box {
        /// Extent along x, y, z.
        size_m: [f64; 3],
    },
    /// Cylinder along z; the position is its middle.
    Cylinder {
        /// Diameters along x and y, and length.
        size_m: [f64; 3],
    },
    /// Ellipsoid; the position is its middle.
    Ellipsoid {
        /// Diameters along x, y, z.
        size_m: [f64; 3],
    },
    /// Connected line segments.
    Line {
        /// The points.
        points_m: Vec<[f64; 3]>,
        /// Thickness on the screen, pixels.
        thickness_px: f64,
    },
}
