//! Roads that a simulation names.

use std::path::Path;

use model::file::TOML_MAX;
use model::road::{Road, RoadClass};

use crate::config::read_text;
use crate::{Error, Result};

/// What stands before the class in the name of a road without a file.
const CLASS: &str = "iso8608:";
/// Largest height map or profile that is read, bytes.
const TABLE_MAX: usize = 1 << 26;

/// The road `name`: `iso8608:` and a class, with this seed, or the path of a road file.
///
/// # Errors
/// If the class is unknown, or the file cannot be read or has errors.
pub(crate) fn read(name: &str, seed: u64) -> Result<Road> {
    if let Some(letter) = name.strip_prefix(CLASS) {
        let class = RoadClass::by_letter(letter).filter(|class| *class <= RoadClass::F);
        let class = class.ok_or_else(|| Error::RoadClass {
            letter: letter.to_owned(),
        })?;
        return Ok(Road::iso8608(class, seed));
    }
    let path = Path::new(name);
    let text = read_text(path, TOML_MAX).map_err(|source| Error::RoadUnreadable {
        path: path.to_owned(),
        source,
    })?;
    let directory = path.parent().unwrap_or(Path::new(""));
    let read =
        |name: &str| read_text(&directory.join(name), TABLE_MAX).map_err(|error| error.to_string());
    Ok(Road::from_toml(&text, name, &read)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_road_has_a_class_or_a_file() {
        assert_eq!(
            read("iso8608:E", 11).expect("a class"),
            Road::iso8608(RoadClass::E, 11)
        );
        for (name, words) in [
            (
                "iso8608:Q",
                "--road iso8608:Q: \"Q\" is not a class of ISO 8608; use A, B, C",
            ),
            ("gone.toml", "cannot read the road gone.toml"),
        ] {
            let error = read(name, 11).expect_err("no road");
            assert!(error.is_usage(), "{error}");
            assert!(error.to_string().contains(words), "{error}");
        }
    }

    #[test]
    fn files_of_a_road_lie_beside_it() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("bump.toml");
        let text = "[part.bump]\nkind = \"profile\"\nfile = \"bump.csv\"\n";
        std::fs::write(&path, text).expect("written");
        let name = path.to_string_lossy();
        let missing = read(&name, 1).expect_err("no profile").to_string();
        assert!(
            missing.contains("part.bump.file") && missing.contains("bump.csv"),
            "{missing}"
        );
        std::fs::write(directory.path().join("bump.csv"), "s,z\n0,0\n2,0.1\n").expect("written");
        let road = read(&name, 1).expect("a road");
        assert!((road.height_m(1.0, 0.0) - 0.05).abs() < 1e-12);
    }
}
