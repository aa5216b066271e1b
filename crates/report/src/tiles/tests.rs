use super::*;

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
/// Bielefeld, longitude and latitude, deg.
const ORIGIN_DEG: [f64; 2] = [8.53, 52.02];

/// A file with these tiles: zoom, column, row from the north, and bytes.
fn file(directory: &Path, format: &str, tiles: &[(u32, u32, u32, &[u8])]) -> PathBuf {
    let path = directory.join("map.mbtiles");
    let _ = std::fs::remove_file(&path);
    let connection = Connection::open(&path).expect("a database");
    let tables = "CREATE TABLE metadata (name text, value text);
        CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob);
        INSERT INTO metadata VALUES ('bounds', '5.0,50.0,6.0,51.0');";
    connection.execute_batch(tables).expect("tables");
    let insert = "INSERT INTO metadata VALUES ('format', ?1)";
    connection.execute(insert, [format]).expect("a row");
    for (zoom, column, row, bytes) in tiles {
        let values = params![zoom, column, (1_u32 << zoom) - 1 - row, bytes];
        let insert = "INSERT INTO tiles VALUES (?1, ?2, ?3, ?4)";
        connection.execute(insert, values).expect("a row");
    }
    path
}

/// A drive of 1 km by 0.5 km.
fn area() -> Area {
    let mut frame = Frame::at(vec![0.0, 1.0]);
    frame.set("east_m", vec![0.0, 1000.0]);
    frame.set("north_m", vec![-500.0, 0.0]);
    Area::around(&frame, ORIGIN_DEG.map(f64::to_radians)).expect("positions")
}

fn tiles(path: &Path) -> Result<Vec<Value>, TilesError> {
    TileFile::open(path)?.to_json(&area(), ORIGIN_DEG.map(f64::to_radians), 1.0)
}

/// All tiles of the area at a zoom level.
fn covering(zoom: u32, bytes: &[u8]) -> Vec<(u32, u32, u32, &[u8])> {
    let [columns, rows] = area().tiles(zoom);
    let columns = columns[0]..=columns[1];
    let each = columns.flat_map(|column| (rows[0]..=rows[1]).map(move |row| (column, row)));
    each.map(|(column, row)| (zoom, column, row, bytes))
        .collect()
}

#[test]
fn a_tile_is_where_the_scheme_of_web_maps_has_it() {
    // By the rule of OpenStreetMap: tile 17/68641/43239 has its north-west corner at 8.52722 E, 52.02038 N.
    let [columns, rows] = area().tiles(17);
    let [west, north] = Tile {
        zoom: 17,
        column: columns[0],
        row: rows[0],
        media_type: "image/png",
        image: Vec::new(),
    }
    .corner([0, 0])
    .map(f64::to_degrees);
    let area = area();
    let tile_deg = 360.0 / f64::from(1 << 17);
    assert!(
        (0.0..tile_deg).contains(&(area.west - west)),
        "{west} {area:?}"
    );
    assert!(
        (0.0..tile_deg).contains(&(north - area.north)),
        "{north} {area:?}"
    );
    assert_eq!(columns[0], ((area.west + 180.0) / tile_deg) as u32);
}

#[test]
fn the_deepest_level_that_covers_the_track_is_drawn() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut all = covering(13, PNG);
    all.extend(covering(15, PNG));
    let path = file(directory.path(), "png", &all);
    let found = tiles(&path).expect("tiles");
    assert_eq!(found.len(), covering(15, PNG).len());
    assert!(found.len() <= TILES_MAX as usize);
    // The tiles cover the area: its corners are between those of the first and of the last tile.
    let numbers = |tile: &Value| -> Vec<f64> {
        let at = tile["at"].as_array().expect("six numbers");
        at.iter().filter_map(Value::as_f64).collect()
    };
    let [first, last] = [&found[0], &found[found.len() - 1]].map(numbers);
    assert!(
        first[2] < -100.0 && last[2] + last[0] > 1100.0,
        "{first:?} {last:?}"
    );
    assert!(
        first[5] > 350.0 && last[5] + last[4] < -850.0,
        "{first:?} {last:?}"
    );
    // A tile of zoom level 15 has a side of 753 m at this latitude.
    assert!(
        (first[0] - 753.0).abs() < 5.0 && (first[4] + 753.0).abs() < 5.0,
        "{first:?}"
    );
    // Neighbours touch.
    let below = numbers(&found[1]);
    assert!(
        (first[5] + first[4] - below[5]).abs() < 0.1,
        "{first:?} {below:?}"
    );
}

#[test]
fn the_page_stays_small() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut large = PNG.to_vec();
    large.resize(150_000, 0);
    // Four tiles of 150 kB are too many bytes, one is not.
    let mut all = covering(15, &large);
    assert!(all.len() >= 4, "{}", all.len());
    let shallow = covering(10, &large);
    all.extend(shallow.iter().copied());
    let found = tiles(&file(directory.path(), "jpg", &all)).expect("tiles");
    assert_eq!(found.len(), shallow.len());
}

#[test]
fn what_cannot_be_used_is_told_with_the_next_step() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let told = |path: &Path| tiles(path).expect_err("an error").to_string();
    let absent = told(&here.join("absent.mbtiles"));
    assert!(
        absent.contains("cannot read") && absent.contains("No such file"),
        "{absent}"
    );
    let text = here.join("text.mbtiles");
    std::fs::write(&text, "no database, whatever its name says").expect("written");
    let no_database = told(&text);
    assert!(
        no_database.contains("no MBTiles file") && no_database.contains("raster"),
        "{no_database}"
    );
    let other = here.join("other.mbtiles");
    let connection = Connection::open(&other).expect("a database");
    connection
        .execute_batch("CREATE TABLE t (x)")
        .expect("a table");
    let no_tables = told(&other);
    assert!(
        no_tables.contains("no MBTiles file") && no_tables.contains("metadata"),
        "{no_tables}"
    );
    let vector = told(&file(here, "pbf", &covering(14, GZIP)));
    assert!(
        vector.contains("\"pbf\"") && vector.contains("raster tiles"),
        "{vector}"
    );
    let unstated = told(&file(here, "png", &covering(14, GZIP)));
    assert!(unstated.contains("\"pbf\""), "{unstated}");
    let elsewhere = told(&file(here, "png", &[(14, 0, 0, PNG)]));
    assert!(
        elsewhere.contains("5.0,50.0,6.0,51.0") && elsewhere.contains("52.0"),
        "{elsewhere}"
    );
    assert!(elsewhere.contains("use a file of this area"), "{elsewhere}");
}
