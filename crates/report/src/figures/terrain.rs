//! Figure of the kind of ground.

use sample::{Terrain, TerrainClass};

use super::curves::Curves;
use super::{Candidate, panel, timed};
use crate::plot::{Data, Panel, Pen, Trace};

/// Probabilities of the classes, the class that is named, and the rolling resistance.
pub fn all(curves: &Curves<'_>, all: &mut Vec<Candidate>) {
    let drawn = &curves.drive.terrain;
    let x: Vec<f64> = drawn.iter().map(|(time_s, _)| *time_s).collect();
    let trace = |name: &str, pen: Pen, value: &dyn Fn(&Terrain) -> f64| Trace {
        name: name.to_owned(),
        pen,
        data: Data::Own {
            x: x.clone(),
            y: drawn.iter().map(|(_, terrain)| value(terrain)).collect(),
        },
    };
    let (mut probability, mut named) = (panel("probability", None), panel("class", None));
    if !drawn.is_empty() {
        for class in TerrainClass::ALL {
            let (index, height) = (class.index(), (TerrainClass::COUNT - class.index()) as f64);
            let line = match class {
                TerrainClass::Unknown => Pen::Measured,
                _ => Pen::Other(index),
            };
            let of_class = |terrain: &Terrain| terrain.probability[index];
            probability
                .traces
                .push(trace(class.name(), line, &of_class));
            let level = |terrain: &Terrain| match terrain.class == class {
                true => height,
                false => f64::NAN,
            };
            if drawn.iter().any(|(_, terrain)| terrain.class == class) {
                let pen = Pen::Points(index);
                named.traces.push(trace(class.name(), pen, &level));
            }
        }
    }
    let mut resistance: Panel = panel("rolling resistance over load", None);
    if (drawn.iter()).any(|(_, terrain)| terrain.rolling_resistance.is_finite()) {
        let of_load = |terrain: &Terrain| terrain.rolling_resistance;
        let axle = "axle that is not driven";
        resistance.traces.push(trace(axle, Pen::Measured, &of_load));
    }
    let caption = "Kind of ground by the forces alone. A class is named from a probability of 0.5; otherwise \
                   the ground is unknown.";
    all.push((
        timed(
            "terrain",
            "Ground",
            caption,
            vec![probability, named, resistance],
        ),
        "the log has no kind of ground (/estimate/terrain)",
    ));
}
