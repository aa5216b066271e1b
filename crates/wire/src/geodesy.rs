//! WGS 84 (NGA.STND.0036, 2014): geodetic, earth-centred and local coordinates.

use std::f64::consts::{PI, TAU};

/// Semi-major axis of the ellipsoid, m.
pub const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of the ellipsoid.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
const ECCENTRICITY_SQUARED: f64 = FLATTENING * (2.0 - FLATTENING);

/// A place by latitude, longitude and height above the ellipsoid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geodetic {
    /// Geodetic latitude, rad.
    pub latitude_rad: f64,
    /// Longitude, rad.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

impl Geodetic {
    /// Earth-centred, earth-fixed coordinates, m.
    #[must_use]
    pub fn to_ecef(self) -> [f64; 3] {
        let (sin_lat, cos_lat) = math::sin_cos(self.latitude_rad);
        let (sin_lon, cos_lon) = math::sin_cos(self.longitude_rad);
        let normal = SEMI_MAJOR_M / (1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat).sqrt();
        let equatorial = (normal + self.height_m) * cos_lat;
        [
            equatorial * cos_lon,
            equatorial * sin_lon,
            (normal * (1.0 - ECCENTRICITY_SQUARED) + self.height_m) * sin_lat,
        ]
    }

    /// The inverse of [`Geodetic::to_ecef`]: Bowring's reduced latitude (Survey Review 23, 1976,
    /// eq. 4), iterated; exact to below a nanometre from the ground to orbit. `None` within 1 km of
    /// the earth's centre or for numbers that are not finite.
    #[must_use]
    pub fn from_ecef([x, y, z]: [f64; 3]) -> Option<Self> {
        let equatorial = math::hypot(x, y);
        let radius = math::hypot(equatorial, z);
        if !radius.is_finite() || radius < 1000.0 {
            return None;
        }
        let semi_minor = SEMI_MAJOR_M * (1.0 - FLATTENING);
        let second = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED);
        let mut reduced = math::atan2(z * SEMI_MAJOR_M, equatorial * semi_minor);
        let mut latitude = reduced;
        for _ in 0..4 {
            let (s, c) = math::sin_cos(reduced);
            latitude = math::atan2(
                z + second * semi_minor * s.powi(3),
                equatorial - ECCENTRICITY_SQUARED * SEMI_MAJOR_M * c.powi(3),
            );
            reduced = math::atan2(
                (1.0 - FLATTENING) * math::sin(latitude),
                math::cos(latitude),
            );
        }
        let (sin_lat, cos_lat) = math::sin_cos(latitude);
        let normal = SEMI_MAJOR_M / (1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat).sqrt();
        // The distance along the normal, from both components: good at the equator and the poles.
        let height = equatorial * cos_lat + z * sin_lat - SEMI_MAJOR_M * SEMI_MAJOR_M / normal;
        Some(Self {
            latitude_rad: latitude,
            longitude_rad: math::atan2(y, x),
            height_m: height,
        })
    }

    /// Rotation from earth-fixed to east, north, up axes here, rows first.
    #[must_use]
    pub fn enu_from_ecef(self) -> [[f64; 3]; 3] {
        let (sin_lat, cos_lat) = math::sin_cos(self.latitude_rad);
        let (sin_lon, cos_lon) = math::sin_cos(self.longitude_rad);
        [
            [-sin_lon, cos_lon, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
        ]
    }

    /// A vector in earth-fixed axes, turned to east, north, up.
    #[must_use]
    pub fn rotate_to_enu(self, ecef: [f64; 3]) -> [f64; 3] {
        self.enu_from_ecef()
            .map(|row| row[0] * ecef[0] + row[1] * ecef[1] + row[2] * ecef[2])
    }

    /// A vector in east, north, up axes, turned to earth-fixed ones.
    #[must_use]
    pub fn rotate_to_ecef(self, enu: [f64; 3]) -> [f64; 3] {
        let rows = self.enu_from_ecef();
        [0, 1, 2].map(|i| rows[0][i] * enu[0] + rows[1][i] * enu[1] + rows[2][i] * enu[2])
    }

    /// Standard deviations east, north, up of a covariance in earth-fixed axes; its elements are
    /// xx, yy, zz, xy, xz, yz.
    #[must_use]
    pub fn sigma_enu(self, [xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 3] {
        self.enu_from_ecef().map(|[x, y, z]| {
            let variance = x * x * xx + y * y * yy + z * z * zz;
            let cross = 2.0 * (x * y * xy + x * z * xz + y * z * yz);
            (variance + cross).max(0.0).sqrt()
        })
    }
}

/// Yaw from east, left positive, in (-pi, pi], of a heading clockwise from north in degrees.
#[must_use]
pub fn yaw_from_heading_deg(heading_deg: f64) -> f64 {
    let yaw = PI / 2.0 - heading_deg.to_radians();
    let wrapped = yaw - TAU * (yaw / TAU).round();
    if wrapped <= -PI {
        wrapped + TAU
    } else {
        wrapped
    }
}

/// Heading clockwise from north in degrees, in [0, 360), of a yaw from east, left positive.
#[must_use]
pub fn heading_deg_from_yaw(yaw_rad: f64) -> f64 {
    let heading = (90.0 - yaw_rad.to_degrees()).rem_euclid(360.0);
    if heading >= 360.0 { 0.0 } else { heading }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_points() {
        let axis = Geodetic::default().to_ecef();
        assert_eq!(axis, [SEMI_MAJOR_M, 0.0, 0.0]);
        let pole = Geodetic::from_ecef([0.0, 0.0, 6_356_752.314_245_179]).expect("the pole");
        assert!((pole.latitude_rad - PI / 2.0).abs() < 1e-12);
        assert!(pole.height_m.abs() < 1e-6);
        assert_eq!(Geodetic::from_ecef([0.0, 0.0, 0.0]), None);
        assert_eq!(Geodetic::from_ecef([f64::NAN, 0.0, 0.0]), None);
    }

    #[test]
    fn there_and_back() {
        for lat in [-89.9_f64, -47.4, -1e-9, 0.0, 32.6, 60.0, 89.999] {
            for lon in [-179.9_f64, -85.3, 0.0, 8.4, 150.0] {
                for height_m in [-400.0, 0.0, 200.0, 9000.0, 20e6] {
                    let there = Geodetic {
                        latitude_rad: lat.to_radians(),
                        longitude_rad: lon.to_radians(),
                        height_m,
                    };
                    let back = Geodetic::from_ecef(there.to_ecef()).expect("far from the centre");
                    assert!((back.latitude_rad - there.latitude_rad).abs() < 1e-14 * 4.0);
                    assert!((back.longitude_rad - there.longitude_rad).abs() < 1e-14);
                    assert!(
                        (back.height_m - height_m).abs() < 2e-8,
                        "{back:?} {there:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn local_axes_follow_small_steps() {
        let here = Geodetic {
            latitude_rad: 0.57,
            longitude_rad: -1.49,
            height_m: 200.0,
        };
        let origin = here.to_ecef();
        let step = 1e-6;
        let mut moved = here;
        moved.longitude_rad += step;
        let delta = moved.to_ecef();
        let enu = here.rotate_to_enu([0, 1, 2].map(|i| delta[i] - origin[i]));
        assert!(
            enu[0] > 5.0 && enu[1].abs() < 1e-4 && enu[2].abs() < 1e-4,
            "{enu:?}"
        );
        let mut moved = here;
        moved.height_m += 3.0;
        let delta = moved.to_ecef();
        let enu = here.rotate_to_enu([0, 1, 2].map(|i| delta[i] - origin[i]));
        assert!((enu[2] - 3.0).abs() < 1e-8);
        let vector = [1.0, -2.0, 0.5];
        let back = here.rotate_to_enu(here.rotate_to_ecef(vector));
        assert!(back.iter().zip(vector).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn headings_turn_to_yaw() {
        assert_eq!(yaw_from_heading_deg(90.0), 0.0);
        assert!((yaw_from_heading_deg(0.0) - PI / 2.0).abs() < 1e-15);
        assert!((yaw_from_heading_deg(270.0) - PI).abs() < 1e-15);
        for heading in [0.0, 1.0, 89.0, 180.0, 269.9, 359.5] {
            assert!((heading_deg_from_yaw(yaw_from_heading_deg(heading)) - heading).abs() < 1e-9);
        }
    }
}
