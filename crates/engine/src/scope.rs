//! What an estimator with a configuration can estimate, and what it cannot, and why.

use model::vehicle::Vehicle;
use sample::Wheel;
use wire::column::Quantity;

use crate::config::{Config, Estimator, Meaning, Role};

/// What is not estimated with the vehicle of a configuration, and why: a line for each reason; empty if
/// everything is estimated, or if there is no vehicle.
#[must_use]
pub fn limits(config: &Config) -> Vec<String> {
    let Some(estimator) = &config.estimator else {
        return Vec::new();
    };
    let described = described(estimator);
    let mut lines: Vec<String> = of_vehicle(&estimator.vehicle, described)
        .into_iter()
        .collect();
    let missing = if estimator.sensors.strain.is_not_fitted() {
        Some("the sensors file has no table [strain]")
    } else if !has_strain(config) {
        Some("no source has a strain channel (roles.strain of a bus, or strain columns of a table)")
    } else {
        None
    };
    let rear = &estimator.vehicle.rear;
    let tells_nothing = (rear.leaf_axle.as_ref()).is_some_and(|leaf| leaf.section_y_m.is_none());
    if missing.is_none() && tells_nothing {
        lines.push(
            "the strain channels of the rear axle are not used, because leaf springs have no links and \
             [rear.leaf_axle] has no section_y_m of bending gauges on the axle tubes: the forces of its wheels follow \
             from deflection, inertial unit and the forces of the other axle"
                .to_owned(),
        );
    }
    if let Some(missing) = missing.filter(|_| lines.is_empty()) {
        lines.push(format!(
            "tyre forces are not measured on the suspension, because {missing}; they follow from the inertial \
             unit and from potentiometers where there are any"
        ));
    }
    lines
}

/// Whether the channels of both wheels of the front and of the rear axle are described without geometry: by
/// matrices of the calibration, or as wheel-force transducers.
fn described(estimator: &Estimator) -> [bool; 2] {
    let has_matrix = |wheel: &Wheel| {
        let corner = estimator.calibration.corner.get(wheel);
        corner.is_some_and(|corner| corner.matrix.is_some())
    };
    let is_transducer = estimator.sensors.strain.transducer.is_some();
    [&Wheel::ALL[..2], &Wheel::ALL[2..]].map(|axle| is_transducer || axle.iter().all(has_matrix))
}

/// What is not estimated with a vehicle. `described`: see [`described`].
fn of_vehicle(vehicle: &Vehicle, described: [bool; 2]) -> Option<String> {
    let axles = [("front", &vehicle.front), ("rear", &vehicle.rear)];
    let without_points: Vec<&str> = axles
        .into_iter()
        .zip(described)
        .filter_map(|((name, axle), described)| {
            let is_known = axle.has_hard_points() || axle.is_solid() || described;
            (!is_known).then_some(name)
        })
        .collect();
    let lacks: Vec<&str> = [
        (
            "hard-points",
            &(|_: &Vehicle| without_points.len() == 2) as &dyn Fn(&Vehicle) -> bool,
        ),
        ("struts", &|v: &Vehicle| any_axle(v, |a| a.strut.is_none())),
        ("unsprung masses", &|v: &Vehicle| {
            any_axle(v, |a| a.unsprung.is_none())
        }),
    ]
    .into_iter()
    .filter_map(|(name, is_missing)| is_missing(vehicle).then_some(name))
    .collect();
    if lacks.is_empty() {
        let axle = without_points.first()?;
        return Some(format!(
            "the strain channels of the {axle} axle are not used, because the vehicle {} has no hard-points of it \
             and no calibration has a matrix of its wheels (`calibrate load-rig`): the forces of its wheels follow from deflection, inertial unit and the forces of the other axle",
            vehicle.name
        ));
    }
    Some(format!(
        "the suspension is not used, because the vehicle {} has no {}: tyre forces, wheel loads and lift follow \
         from the inertial unit and the mass properties alone, and the road is not estimated; velocity, \
         sideslip, attitude and rates are estimated from speed, steer angle, yaw rate and lateral acceleration",
        vehicle.name,
        lacks.join(" and no ")
    ))
}

fn any_axle(vehicle: &Vehicle, is: impl Fn(&model::vehicle::Axle) -> bool) -> bool {
    [Wheel::FrontLeft, Wheel::RearLeft]
        .into_iter()
        .any(|wheel| is(vehicle.axle(wheel)))
}

fn has_strain(config: &Config) -> bool {
    config.sources.iter().any(|source| match &source.meaning {
        Meaning::Can(can) => {
            let mut roles = can.roles.iter();
            roles.any(|role| matches!(role.role, Role::Strain(..)))
        }
        Meaning::Csv(map) => {
            let mut columns = map.format.columns.iter();
            columns.any(|(_, column)| matches!(column.quantity, Quantity::Strain(..)))
        }
        Meaning::Alog(format) => {
            let mut variables = format.variables.iter();
            variables.any(|variable| matches!(variable.column.quantity, Quantity::Strain(..)))
        }
        Meaning::Crossbow440(_) | Meaning::Gnss(_) | Meaning::Line(_) => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAR: &str = "name = \"car\"\n[body]\nmass_kg = 1600.0\nfront_axle_to_cg_m = 1.25\n\
                       cg_to_rear_axle_m = 1.3\n[steering]\nratio = 15.0\n";

    fn limits_of(text: &str) -> Vec<String> {
        let directory = tempfile::tempdir().expect("a directory");
        std::fs::write(directory.path().join("car.toml"), CAR).expect("written");
        limits(&Config::from_text(text, directory.path()).expect("a configuration"))
    }

    #[test]
    fn what_is_not_estimated_is_told_with_its_reason() {
        let bus = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n";
        let gnss = "[source.gnss]\nkind = \"gnss\"\ndevice = \"/dev/x\"\n";
        let prowler = "[vehicle]\nfile = \"prowler\"\n";
        assert_eq!(limits_of(&format!("{bus}{prowler}")), [""; 0]);
        let without_strain = limits_of(&format!("{gnss}{prowler}"));
        assert!(without_strain[0].contains("no source has a strain channel"));
        let half = Vehicle::builtin_text("prowler").expect("built in");
        let points = half.find("[rear.wishbone]").expect("a table");
        let rest = half[points + 1..].find("\n[").expect("a table") + points + 1;
        let half = half[..points].to_owned() + &half[rest..];
        let half = Vehicle::from_toml(&half, "half.toml").expect("a vehicle");
        let told = of_vehicle(&half, [false; 2]).expect("a limit");
        assert!(
            told.starts_with("the strain channels of the rear axle"),
            "{told}"
        );
        let car = limits_of(&format!(
            "{gnss}[vehicle]\nfile = \"car.toml\"\nsensors = \"thesis-10bit\"\n"
        ));
        assert_eq!(car.len(), 1, "{car:?}");
        assert!(
            car[0].contains("the vehicle car has no hard-points"),
            "{car:?}"
        );
        assert_eq!(limits_of(bus), [""; 0]);
    }

    #[test]
    fn leaf_springs_without_gauges_on_the_tubes_are_told() {
        let second = Vehicle::builtin_text("second-vehicle").expect("built in");
        let (before, rest) = second.split_once("[rear.live_axle]").expect("a table");
        let (_, after) = rest.split_once("[rear.tyre]").expect("a table");
        let leaf = include_str!("../../../testdata/leaf-axle.toml");
        let after = after.replace("rear.live_axle", "rear.leaf_axle");
        let directory = tempfile::tempdir().expect("a directory");
        let told = |leaf: &str| {
            let text = format!("{before}{leaf}\n[rear.tyre]{after}");
            std::fs::write(directory.path().join("leaf.toml"), text).expect("written");
            let text = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n[vehicle]\nfile = \"leaf.toml\"\n";
            limits(&Config::from_text(text, directory.path()).expect("a configuration"))
        };
        assert_eq!(told(leaf), [""; 0]);
        let is_of_tubes = |line: &&str| {
            let names = ["section_y_m", "end_mass_kg", "end_cg_m"];
            names.iter().any(|name| line.starts_with(name))
        };
        let without: Vec<&str> = leaf.lines().filter(|line| !is_of_tubes(line)).collect();
        let lines = told(&without.join("\n"));
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert!(lines[0].contains("section_y_m"), "{lines:?}");
    }
}
