//! The rectangle that a part of a road covers.

/// A rectangle along x and y with soft edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// From and to, m.
    pub(super) x_m: [f64; 2],
    /// From and to, m.
    pub(super) y_m: [f64; 2],
    /// Distance inside the edges over which the part sets in, m.
    pub(super) fade_m: f64,
}

impl Extent {
    /// How much of the part is present at a place, from 0 outside to 1 inside.
    pub(super) fn weight(&self, x: f64, y: f64) -> f64 {
        let [west, east] = [x - self.x_m[0], self.x_m[1] - x];
        let [south, north] = [y - self.y_m[0], self.y_m[1] - y];
        let inside = west.min(east).min(south).min(north);
        if inside < 0.0 {
            return 0.0;
        }
        if inside >= self.fade_m {
            return 1.0;
        }
        let edge = |distance_m: f64| smooth(distance_m / self.fade_m);
        edge(west) * edge(east) * edge(south) * edge(north)
    }

    /// Area, m^2.
    pub(super) fn area_m2(&self) -> f64 {
        (self.x_m[1] - self.x_m[0]) * (self.y_m[1] - self.y_m[0])
    }
}

/// The polynomial of fifth order from 0 at 0 to 1 at 1 with vanishing first and second derivatives
/// at both ends.
pub(super) fn smooth(part: f64) -> f64 {
    let t = part.clamp(0.0, 1.0);
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

/// Integral of [`smooth`] from 0.
pub(super) fn smooth_integral(part: f64) -> f64 {
    let t = part.clamp(0.0, 1.0);
    t.powi(4) * (2.5 + t * (t - 3.0)) + (part - 1.0).max(0.0)
}
