//! The kind of ground.

use sample::{LogTime, Terrain, TerrainClass};

use super::{nan, some};
use crate::proto::atvrec as pb;

pub(super) fn terrain_to_proto(terrain: &Terrain) -> pb::Terrain {
    let class = match terrain.class {
        TerrainClass::Asphalt => pb::TerrainClass::Asphalt,
        TerrainClass::Gravel => pb::TerrainClass::Gravel,
        TerrainClass::Loam => pb::TerrainClass::Loam,
        TerrainClass::Sand => pb::TerrainClass::Sand,
        TerrainClass::Unknown => pb::TerrainClass::Unknown,
    };
    let [asphalt, gravel, loam, sand, unknown] = terrain.probability;
    pb::Terrain {
        class: class.into(),
        asphalt,
        gravel,
        loam,
        sand,
        unknown,
        rolling_resistance: some(terrain.rolling_resistance),
        rolling_resistance_sigma: some(terrain.rolling_resistance_sigma),
    }
}

pub(super) fn terrain_from_proto(time: LogTime, terrain: &pb::Terrain) -> Terrain {
    Terrain {
        time,
        class: match terrain.class() {
            pb::TerrainClass::Asphalt => TerrainClass::Asphalt,
            pb::TerrainClass::Gravel => TerrainClass::Gravel,
            pb::TerrainClass::Loam => TerrainClass::Loam,
            pb::TerrainClass::Sand => TerrainClass::Sand,
            pb::TerrainClass::Unknown => TerrainClass::Unknown,
        },
        probability: [
            terrain.asphalt,
            terrain.gravel,
            terrain.loam,
            terrain.sand,
            terrain.unknown,
        ],
        rolling_resistance: nan(terrain.rolling_resistance),
        rolling_resistance_sigma: nan(terrain.rolling_resistance_sigma),
    }
}
