//! The numbers behind a report.

use sample::{LossPlace, TerrainClass};
use serde_json::{Map, Value, json};

use super::{Axis, Summary, WheelRow};
use crate::drive::Drive;
use crate::options::{Options, Quantity};

impl Summary {
    /// As JSON, by the keys of `docs/report.md`.
    pub fn to_json(&self, drive: &Drive, options: &Options) -> Value {
        let unit = |quantity| options.units.of(quantity).1;
        let events: Vec<Value> = drive
            .events
            .iter()
            .enumerate()
            .map(|(index, event)| {
                json!({
                    "number": index + 1,
                    "at_s": drive.seconds(event.time),
                    "kind": event.kind.name(),
                    "text": event.text,
                })
            })
            .collect();
        let lost: Map<String, Value> = LossPlace::ALL
            .into_iter()
            .zip(self.lost)
            .map(|(place, lost)| (place.name().to_owned(), json!(lost)))
            .collect();
        let named: usize = drive.terrain_named.iter().sum();
        let terrain: Map<String, Value> = TerrainClass::ALL
            .into_iter()
            .filter(|_| named > 0)
            .map(|class| {
                let part = drive.terrain_named[class.index()] as f64 / named as f64;
                (class.name().to_owned(), json!(part))
            })
            .collect();
        let rows = self.vehicle_rows.iter();
        let vehicle: Map<String, Value> = rows
            .map(|row| {
                (
                    row.key.to_owned(),
                    json!({"value": row.value, "unit": row.unit}),
                )
            })
            .collect();
        json!({
            "files": drive.files.iter().map(|(name, _)| name).collect::<Vec<_>>(),
            "from_s": drive.span_s[0],
            "to_s": drive.span_s[1],
            "duration_s": drive.duration_s(),
            "vehicle": self.vehicle,
            "distance_m": self.distance_m,
            "stage": drive.stage,
            "estimates": drive.motion.samples(),
            "force_frame": drive.force_frame,
            "force_unit": unit(Quantity::Force),
            "verdict": self.verdict,
            "missing": drive.missing,
            "limits": drive.limits,
            "terrain": terrain,
            "lost": lost,
            "wheels": self.wheels.iter().map(wheel).collect::<Vec<_>>(),
            "vehicle_values": vehicle,
            "windows_inside": self.consistent.map(|(inside, _)| inside),
            "gaps_s": self.gaps_s,
            "events": events,
            "marks": drive.marks.len(),
        })
    }
}

fn wheel(row: &WheelRow) -> Value {
    let axis = |axis: &Option<Axis>| {
        axis.map(|axis| {
            json!({
                "min": axis.least,
                "max": axis.greatest,
                "rms": axis.rms,
                "percentile_95": axis.percentile_95,
                "sigma": axis.sigma,
            })
        })
    };
    json!({
        "wheel": row.name,
        "x": axis(&row.axes[0]),
        "y": axis(&row.axes[1]),
        "z": axis(&row.axes[2]),
        "utilisation": row.utilisation,
        "lifts": row.lifts,
    })
}
