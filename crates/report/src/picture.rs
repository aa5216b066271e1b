//! A picture of the ground below the track, with its place by a world file.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::drive::local_m;

/// Largest picture, bytes: it becomes a part of the page.
const BYTES_MAX: usize = 20_000_000;
/// Radius of the sphere of the Web Mercator projection, m.
const MERCATOR_RADIUS_M: f64 = 6_378_137.0;
/// Media type of tiles alone.
const WEBP: &str = "image/webp";
/// A picture that begins farther from the track is in other coordinates, m.
const FAR_M: f64 = 100_000.0;

/// A picture and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    media_type: &'static str,
    image: Vec<u8>,
    /// Longitude and latitude of the first pixel, deg.
    corner_deg: [f64; 2],
    /// Steps to the next column and to the next row, m east and north on the local map at the corner's
    /// latitude, for a unit of [`Picture::scale`].
    steps: [[f64; 2]; 2],
    is_mercator: bool,
}

/// Why a picture cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PictureError {
    /// No picture.
    #[error(
        "it is neither a PNG nor a JPEG picture; export the map as PNG or JPEG with a world file"
    )]
    Format,
    /// Too large.
    #[error("it has {bytes} bytes, and the page takes at most {BYTES_MAX}; export a smaller area")]
    Size {
        /// Its size.
        bytes: usize,
    },
    /// A world file that cannot be read.
    #[error(
        "its world file is wrong: {0}; it must have six lines with one number each: column step in x \
         and y, row step in x and y, x and y of the first pixel"
    )]
    World(String),
    /// Coordinates that are neither degrees nor Web Mercator.
    #[error(
        "it is {far_km:.0} km away from the track; export it in degrees (EPSG:4326) or Web Mercator \
         (EPSG:3857)"
    )]
    Far {
        /// Distance, km.
        far_km: f64,
    },
}

impl Picture {
    /// A picture with the text of its world file, in degrees (EPSG:4326) or in metres of Web Mercator
    /// (EPSG:3857).
    ///
    /// # Errors
    /// If the picture is no PNG or JPEG, is too large, or the world file has no six numbers.
    pub fn new(image: Vec<u8>, world: &str) -> Result<Self, PictureError> {
        let media_type = media_type(&image).filter(|found| *found != WEBP);
        let media_type = media_type.ok_or(PictureError::Format)?;
        if image.len() > BYTES_MAX {
            let bytes = image.len();
            return Err(PictureError::Size { bytes });
        }
        let [a, d, b, e, x, y] = numbers(world)?;
        let is_mercator = x.abs() > 180.0 || y.abs() > 90.0;
        let corner_deg = match is_mercator {
            false => [x, y],
            true => [
                (x / MERCATOR_RADIUS_M).to_degrees(),
                math::atan(math::sinh(y / MERCATOR_RADIUS_M)).to_degrees(),
            ],
        };
        Ok(Self {
            media_type,
            image,
            corner_deg,
            steps: [[a, d], [b, e]],
            is_mercator,
        })
    }

    /// For the page: the picture, and the numbers that turn its column and row into the units of the
    /// local map around `origin` (longitude and latitude, rad).
    pub(crate) fn to_json(&self, origin: [f64; 2], unit: f64) -> Result<Value, PictureError> {
        let corner = local_m(self.corner_deg.map(f64::to_radians), origin);
        let far_m = math::hypot(corner[0], corner[1]);
        if far_m.is_nan() || far_m > FAR_M {
            let far_km = far_m / 1e3;
            return Err(PictureError::Far { far_km });
        }
        let metres = |[x, y]: [f64; 2]| match self.is_mercator {
            // The scale of the projection at the latitude of the track.
            true => [x, y].map(|step| step * math::cos(origin[1])),
            false => local_m(
                [origin[0] + x.to_radians(), origin[1] + y.to_radians()],
                origin,
            ),
        };
        let [column, row] = self.steps.map(metres);
        // The world file gives the middle of the first pixel.
        let first = [0, 1].map(|axis| corner[axis] - 0.5 * (column[axis] + row[axis]));
        let place = [column[0], row[0], first[0], column[1], row[1], first[1]];
        Ok(json!({
            "src": format!("data:{};base64,{}", self.media_type, STANDARD.encode(&self.image)),
            "at": place.map(|metres| metres * unit),
        }))
    }
}

/// Media type of a picture by its first bytes; `None` if a browser may not show it.
pub(crate) fn media_type(image: &[u8]) -> Option<&'static str> {
    match image {
        [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [
            b'R',
            b'I',
            b'F',
            b'F',
            _,
            _,
            _,
            _,
            b'W',
            b'E',
            b'B',
            b'P',
            ..,
        ] => Some(WEBP),
        _ => None,
    }
}

fn numbers(world: &str) -> Result<[f64; 6], PictureError> {
    let number = |word: &str| {
        let found = word.parse().ok().filter(|number: &f64| number.is_finite());
        found.ok_or_else(|| PictureError::World(format!("{word:?} is no number")))
    };
    let all: Vec<f64> = world
        .split_whitespace()
        .map(number)
        .collect::<Result<_, _>>()?;
    let count = all.len();
    all.try_into()
        .map_err(|_| PictureError::World(format!("it has {count} numbers")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

    fn place(world: &str, origin_deg: [f64; 2]) -> Result<Vec<f64>, PictureError> {
        let picture = Picture::new(PNG.to_vec(), world)?;
        let json = picture.to_json(origin_deg.map(f64::to_radians), 1.0)?;
        let numbers = json["at"].as_array().expect("six numbers");
        Ok(numbers.iter().filter_map(Value::as_f64).collect())
    }

    #[test]
    fn degrees_and_web_mercator_give_the_same_place() {
        // A thousandth of a degree is 111.2 m to the north, and half of it to the east at 60 degrees.
        let degrees = place("0.00001\n0\n0\n-0.00001\n10.0\n60.001\n", [10.0, 60.0]).expect("good");
        let mercator_y = 6_378_137.0 * math::ln(math::tan(75.0005_f64.to_radians()));
        let mercator_x = 6_378_137.0 * 10.0_f64.to_radians();
        let step = 6_378_137.0 * 0.00001_f64.to_radians();
        let world = format!(
            "{step}\n0\n0\n{}\n{mercator_x}\n{mercator_y}\n",
            -2.0 * step
        );
        let mercator = place(&world, [10.0, 60.0]).expect("good");
        assert!((degrees[5] - 111.2).abs() < 1.0, "{degrees:?}");
        assert!(
            (degrees[0] - 0.556).abs() < 0.01 && degrees[4] < 0.0,
            "{degrees:?}"
        );
        for (a, b) in degrees.iter().zip(&mercator) {
            assert!((a - b).abs() < 0.7, "{degrees:?} {mercator:?}");
        }
    }

    #[test]
    fn what_cannot_be_used_is_told() {
        assert_eq!(
            Picture::new(b"GIF89a".to_vec(), ""),
            Err(PictureError::Format)
        );
        let far = place("1\n0\n0\n-1\n500000\n5000000\n", [10.0, 60.0]);
        assert!(matches!(far, Err(PictureError::Far { .. })), "{far:?}");
        let short = place("1\n0\n", [10.0, 60.0]);
        assert_eq!(
            short,
            Err(PictureError::World("it has 2 numbers".to_owned()))
        );
        let word = place("1 0 0 -1 x 0", [10.0, 60.0]);
        assert_eq!(
            word,
            Err(PictureError::World("\"x\" is no number".to_owned()))
        );
    }
}
