//! Raster tiles of an MBTiles file (version 1.3) below the track.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rusqlite::{Connection, OpenFlags, OptionalExtension, params};
use serde_json::{Value, json};

use crate::drive::{local_m, place_of};
use crate::frame::Frame;
use crate::picture::media_type;

/// Most tiles of a page.
const TILES_MAX: u32 = 25;
/// Most bytes of all tiles of a page: with them, the page of a short drive stays below 1.5 MB.
const BYTES_MAX: usize = 400_000;
/// Deepest zoom level that is looked for.
const ZOOM_MAX: u32 = 22;
/// Part of the area for which a zoom level must have tiles. A level with fewer is used if no level has
/// as many.
const COVERED: f64 = 0.5;
/// Margin around the track, as a part of the larger side of its area, and the least one, m.
const MARGIN: f64 = 0.1;
const MARGIN_MIN_M: f64 = 20.0;
/// First bytes of a vector tile, which is compressed.
const GZIP: &[u8] = &[0x1f, 0x8b];

/// An MBTiles file with pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileFile(PathBuf);

/// Why the tiles of a file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TilesError {
    /// The file cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// No MBTiles file.
    #[error(
        "{} is no MBTiles file: {cause}; use a file with raster tiles, as QGIS or MOBAC export it",
        path.display()
    )]
    NotMbTiles {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: rusqlite::Error,
    },
    /// Vector tiles.
    #[error(
        "{} holds tiles of the format {format:?}; the report draws PNG, JPEG and WebP: export raster tiles",
        path.display()
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: String,
    },
    /// Tiles of another area.
    #[error(
        "{} has no tile at the track ({:.4} to {:.4} degrees north, {:.4} to {:.4} degrees east){}; use a \
         file of this area",
        path.display(), area.south, area.north, area.west, area.east,
        bounds.as_ref().map_or_else(String::new, |bounds| format!("; its area is {bounds} (west, south, east, north)"))
    )]
    Elsewhere {
        /// The file.
        path: PathBuf,
        /// Area of the track.
        area: Area,
        /// Area of the file, as it states it.
        bounds: Option<String>,
    },
}

/// Area, deg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    west: f64,
    south: f64,
    east: f64,
    north: f64,
}

impl Area {
    /// A square around positions in metres around `origin` (longitude and latitude, rad); `None` without a
    /// position.
    pub(crate) fn around(positions: &Frame, origin: [f64; 2]) -> Option<Self> {
        let [east, north] = [positions.range("east_m")?, positions.range("north_m")?];
        let [east, north] = [east, north].map(|range| range.map(f64::from));
        let side_m = f64::max(east[1] - east[0], north[1] - north[0]);
        let half_m = 0.5 * side_m + f64::max(MARGIN * side_m, MARGIN_MIN_M);
        let middle = [east, north].map(|[low, high]| 0.5 * (low + high));
        let corner = |sign: f64| place_of(middle.map(|m| m + sign * half_m), origin);
        let [[west, south], [east, north]] =
            [-1.0, 1.0].map(|sign| corner(sign).map(f64::to_degrees));
        Some(Self {
            west,
            south,
            east,
            north,
        })
    }

    /// First and last column, and first and last row from the north, of the tiles of a zoom level.
    fn tiles(&self, zoom: u32) -> [[u32; 2]; 2] {
        let count = f64::from(1_u32 << zoom);
        let last = count - 1.0;
        let column = |degrees: f64| ((degrees + 180.0) / 360.0 * count).clamp(0.0, last) as u32;
        let row = |degrees: f64| {
            let angle = degrees.clamp(-85.0, 85.0).to_radians();
            let mercator = math::ln(math::tan(PI / 4.0 + angle / 2.0));
            ((1.0 - mercator / PI) / 2.0 * count).clamp(0.0, last) as u32
        };
        [
            [column(self.west), column(self.east)],
            [row(self.north), row(self.south)],
        ]
    }
}

/// A tile and its place.
struct Tile {
    zoom: u32,
    column: u32,
    row: u32,
    media_type: &'static str,
    image: Vec<u8>,
}

impl TileFile {
    /// A file with tables of an MBTiles file and with pictures.
    ///
    /// # Errors
    /// If the file cannot be read, or is no such file.
    pub fn open(path: &Path) -> Result<Self, TilesError> {
        let file = Self(path.to_owned());
        let connection = file.connect()?;
        let format = file.stated(&connection, "format")?;
        if let Some(format) = format.filter(|format| !is_raster(format)) {
            let path = file.0;
            return Err(TilesError::Format { path, format });
        }
        // A file without this table is an error before the log is read.
        file.query(connection.query_row("SELECT count(*) FROM (SELECT zoom_level, tile_column, tile_row, tile_data FROM tiles LIMIT 1)", [], |row| row.get::<_, u32>(0)))?;
        Ok(file)
    }

    fn connect(&self) -> Result<Connection, TilesError> {
        // SQLite's own message of an absent file does not say that it is absent.
        std::fs::File::open(&self.0).map_err(|cause| TilesError::Read {
            path: self.0.clone(),
            cause,
        })?;
        self.query(Connection::open_with_flags(
            &self.0,
            OpenFlags::SQLITE_OPEN_READ_ONLY,
        ))
    }

    fn query<T>(&self, result: rusqlite::Result<T>) -> Result<T, TilesError> {
        result.map_err(|cause| TilesError::NotMbTiles {
            path: self.0.clone(),
            cause,
        })
    }

    /// A value of the table `metadata`.
    fn stated(&self, connection: &Connection, name: &str) -> Result<Option<String>, TilesError> {
        let query = "SELECT value FROM metadata WHERE name = ?1";
        self.query(
            connection
                .query_row(query, [name], |row| row.get(0))
                .optional(),
        )
    }

    /// For the page: tiles of the area, at most [`TILES_MAX`] with at most [`BYTES_MAX`], of the deepest
    /// zoom level that covers it. `origin` and `unit` are those of the local map.
    pub(crate) fn to_json(
        &self,
        area: &Area,
        origin: [f64; 2],
        unit: f64,
    ) -> Result<Vec<Value>, TilesError> {
        let connection = self.connect()?;
        let mut best: (f64, Vec<Tile>) = (0.0, Vec::new());
        for zoom in (0..=ZOOM_MAX).rev() {
            let [columns, rows] = area.tiles(zoom);
            let wanted = (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1);
            if wanted > TILES_MAX {
                continue;
            }
            let tiles = self.read(&connection, zoom, columns, rows)?;
            let bytes: usize = tiles.iter().map(|tile| tile.image.len()).sum();
            let covered = tiles.len() as f64 / f64::from(wanted);
            if bytes <= BYTES_MAX && covered > best.0 {
                best = (covered, tiles);
            }
            if best.0 >= COVERED {
                break;
            }
        }
        if best.1.is_empty() {
            return Err(TilesError::Elsewhere {
                path: self.0.clone(),
                area: *area,
                bounds: self.stated(&connection, "bounds")?,
            });
        }
        Ok(best
            .1
            .iter()
            .map(|tile| tile.to_json(origin, unit))
            .collect())
    }

    fn read(
        &self,
        connection: &Connection,
        zoom: u32,
        columns: [u32; 2],
        rows: [u32; 2],
    ) -> Result<Vec<Tile>, TilesError> {
        let text = "SELECT tile_data FROM tiles WHERE zoom_level = ?1 AND tile_column = ?2 AND tile_row = ?3";
        let mut query = self.query(connection.prepare(text))?;
        let mut tiles = Vec::new();
        for column in columns[0]..=columns[1] {
            for row in rows[0]..=rows[1] {
                // The file counts rows from the south.
                let from_south = (1_u32 << zoom) - 1 - row;
                let found = query.query_row(params![zoom, column, from_south], |row| row.get(0));
                let Some(image): Option<Vec<u8>> = self.query(found.optional())? else {
                    continue;
                };
                let Some(media_type) = media_type(&image) else {
                    let is_vector = image.starts_with(GZIP);
                    let format = if is_vector { "pbf" } else { "unknown" }.to_owned();
                    let path = self.0.clone();
                    return Err(TilesError::Format { path, format });
                };
                tiles.push(Tile {
                    zoom,
                    column,
                    row,
                    media_type,
                    image,
                });
            }
        }
        Ok(tiles)
    }
}

fn is_raster(format: &str) -> bool {
    let format = format.to_ascii_lowercase();
    let format = format.trim_start_matches("image/");
    matches!(format, "png" | "png8" | "png24" | "jpg" | "jpeg" | "webp")
}

impl Tile {
    /// Longitude and latitude of a corner, rad; `[0, 0]` is the one in the north-west.
    fn corner(&self, [column, row]: [u32; 2]) -> [f64; 2] {
        let count = f64::from(1_u32 << self.zoom);
        let part = |own: u32, of: u32| f64::from(own + of) / count;
        [
            (2.0 * part(self.column, column) - 1.0) * PI,
            math::atan(math::sinh((1.0 - 2.0 * part(self.row, row)) * PI)),
        ]
    }

    /// The picture, and the numbers that turn a part of its width and height into the units of the local map.
    fn to_json(&self, origin: [f64; 2], unit: f64) -> Value {
        let corner = |of| local_m(self.corner(of), origin);
        let [first, column, row] = [corner([0, 0]), corner([1, 0]), corner([0, 1])];
        let along = |to: [f64; 2], axis: usize| to[axis] - first[axis];
        let at = [0, 1].map(|axis| [along(column, axis), along(row, axis), first[axis]]);
        json!({
            "src": format!("data:{};base64,{}", self.media_type, STANDARD.encode(&self.image)),
            "at": at.as_flattened().iter().map(|metres| metres * unit).collect::<Vec<_>>(),
            "whole": true,
        })
    }
}

#[cfg(test)]
mod tests;
