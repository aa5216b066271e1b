//! `atvrec vehicle` and `atvrec sensors` as a user types them.

use std::fs;

use crate::support::{atvrec, stderr, stdout};

/// A built-in file is a template: it is printed, changed, checked and drawn.
#[test]
fn a_template_is_printed_changed_checked_and_drawn() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let list = stdout(&atvrec(here).args(["vehicle", "show"]).assert().success());
    assert!(list.contains("prowler-chang"), "{list}");
    let text = stdout(
        &atvrec(here)
            .args(["vehicle", "show", "prowler"])
            .assert()
            .success(),
    );
    let odd = text.replacen("stiffness_n_m = 65000.0", "stiffness_n_m = 65.0", 1);
    assert_ne!(odd, text);
    fs::write(here.join("own.toml"), odd).expect("written");
    let checked = atvrec(here)
        .args(["vehicle", "check", "own.toml", "prowler"])
        .assert()
        .success();
    let checked = stdout(&checked);
    assert!(
        checked.contains("front.strut.stiffness_n_m: 65 N/m")
            && checked.contains("probably in N/mm"),
        "{checked}"
    );
    let config = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"/dev/null\"\n[vehicle]\nfile = \"own.toml\"\nsensors = \"thesis-10bit\"\n";
    fs::write(here.join("atvrec.toml"), config).expect("written");
    let of_config = atvrec(here)
        .args(["check", "--no-devices"])
        .assert()
        .success();
    let of_config = stdout(&of_config);
    assert!(
        of_config.contains("warning: vehicle file: front.strut.stiffness_n_m: 65 N/m"),
        "{of_config}"
    );
    let draw = ["vehicle", "draw", "own.toml", "-o", "own.svg"];
    atvrec(here).args(draw).assert().success();
    let drawing = fs::read_to_string(here.join("own.svg")).expect("a drawing");
    assert!(drawing.starts_with("<svg") && drawing.contains("lower_ball_m"));
    let again = atvrec(here).args(draw).assert().code(2);
    assert!(
        stderr(&again).contains("exists already"),
        "{}",
        stderr(&again)
    );
}

/// A vehicle file with a tyre property file is checked, and printed with the coefficients in it.
#[test]
fn a_tyre_property_file_is_checked_and_printed_with_the_vehicle() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let own = model::vehicle::Vehicle::builtin_text("prowler").expect("built in");
    let start = own.find("[front.tyre]").expect("a tyre");
    let end = start + own[start..].find("\n[").expect("another table");
    let text = format!(
        "{}[front.tyre]\ntir = \"my.tir\"{}",
        &own[..start],
        &own[end..]
    );
    fs::write(here.join("own.toml"), text).expect("written");
    let check = ["vehicle", "check", "own.toml"];
    let lost = stderr(&atvrec(here).args(check).assert().code(1));
    assert!(lost.contains("front.tyre.tir"), "{lost}");
    let tir = include_str!("../../../../crates/model/src/tyre/property/mf61.tir");
    fs::write(here.join("my.tir"), tir.replace("PKY4 ", "PKI4 ")).expect("written");
    let wrong = stderr(&atvrec(here).args(check).assert().code(1));
    assert!(
        wrong.contains("my.tir:") && wrong.contains("did you mean PKY4?"),
        "{wrong}"
    );
    let heavy = tir
        .replace("= 200.0\n", "= 2000.0\n")
        .replace("= 4\n", "= 15\n");
    fs::write(here.join("my.tir"), heavy).expect("written");
    let said = stdout(&atvrec(here).args(check).assert().success());
    assert!(
        said.contains("turn slip") && said.contains("2000 to 9000 N (FZMIN, FZMAX)"),
        "{said}"
    );
    let shown = atvrec(here).args(["vehicle", "show", "own.toml"]).assert();
    let shown = stdout(&shown.success());
    assert!(shown.contains("tir = { FITTYP = 61,"), "{shown}");
}

#[test]
fn wrong_names_files_and_linkages_are_refused_by_name() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let message =
        |arguments: &[&str], code: i32| stderr(&atvrec(here).args(arguments).assert().code(code));
    let unknown = message(&["sensors", "show", "thesis"], 2);
    assert!(unknown.contains("thesis-10bit"), "{unknown}");
    fs::write(
        here.join("bad.toml"),
        "name = \"x\"\n[strain]\nrate_hz = -1\n",
    )
    .expect("written");
    let bad = message(&["sensors", "check", "bad.toml", "thesis-10bit"], 1);
    assert!(bad.contains("strain.rate_hz = -1"), "{bad}");
    fs::write(
        here.join("car.toml"),
        "name = \"car\"\n[body]\nmass_kg = 1500\nfront_axle_to_cg_m = 1.2\ncg_to_rear_axle_m = 1.5\n",
    )
    .expect("written");
    let car = message(&["vehicle", "draw", "car.toml"], 1);
    assert!(car.contains("no hard-points"), "{car}");
}

/// `new` writes what `init` writes, and replaces nothing.
#[test]
fn a_new_file_is_a_template_with_comments() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    for (kind, part) in [
        ("vehicle", "# Total mass m, kg.\nmass_kg = 644"),
        ("sensors", "# Gauge factor GF."),
    ] {
        let own = ["-o", "own.toml"];
        let told = stdout(
            &atvrec(here)
                .args([kind, "new"])
                .args(own)
                .assert()
                .success(),
        );
        assert!(
            told.contains(&format!("template of a {kind} file")),
            "{told}"
        );
        let text = fs::read_to_string(here.join("own.toml")).expect("a template");
        assert!(
            text.starts_with(&format!("# Template of a {kind} file.")) && text.contains(part),
            "{text}"
        );
        atvrec(here)
            .args([kind, "check", "own.toml"])
            .assert()
            .success();
        let again = atvrec(here).args([kind, "new"]).args(own).assert().code(2);
        assert!(stderr(&again).contains("exists already"));
        let init = ["init", "--yes", "--can", "nocan77", "-d", kind];
        atvrec(here).args(init).assert().success();
        let of_init =
            fs::read_to_string(here.join(kind).join(format!("{kind}.toml"))).expect("a template");
        assert_eq!(of_init, text);
        let unknown = atvrec(here)
            .args([kind, "new", "own.toml"])
            .assert()
            .code(2);
        assert!(stderr(&unknown).contains("own.toml is not the name of a built-in"));
        fs::remove_file(here.join("own.toml")).expect("removed");
    }
}

/// Moments of a solid cuboid about its centre of gravity, kg m^2: m (b² + c²)/12.
fn cuboid(mass_kg: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [y * y + z * z, x * x + z * z, x * x + y * y].map(|sum| mass_kg * sum / 12.0)
}

/// A solid cuboid that is cut into eight has the mass, the centre of gravity and the inertia of the whole.
#[test]
fn the_parts_of_a_cuboid_have_the_inertia_of_the_whole() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let (mass_kg, size, centre) = (640.0, [2.4, 1.2, 0.8], [-0.7, 0.05, 0.6]);
    let mut list =
        "# cut\nname, mass_kg, x_m, y_m, z_m, ixx_kg_m2, iyy_kg_m2, izz_kg_m2\n".to_owned();
    for part in 0..8 {
        let at = |axis: usize| {
            let side = if part >> axis & 1 == 0 { -0.25 } else { 0.25 };
            centre[axis] + side * size[axis]
        };
        let [xx, yy, zz] = cuboid(mass_kg / 8.0, size.map(|length| length / 2.0));
        let (x, y, z) = (at(0), at(1), at(2));
        list += &format!("part {part},{},{x},{y},{z},{xx},{yy},{zz}\n", mass_kg / 8.0);
    }
    fs::write(here.join("parts.csv"), list).expect("written");
    let command = ["vehicle", "mass", "parts.csv", "--vehicle", "prowler"];
    let found = atvrec(here)
        .args(command)
        .args(["--json", "-o", "mass.toml"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&found)).expect("JSON");
    let near = |value: &serde_json::Value, expected: f64| {
        let value = value.as_f64().expect("a number");
        assert!((value - expected).abs() < 1e-9, "{value} for {expected}");
    };
    near(&found["mass_kg"], mass_kg);
    for axis in 0..3 {
        near(&found["cg_m"][axis], centre[axis]);
        near(&found["moments_kg_m2"][axis], cuboid(mass_kg, size)[axis]);
        near(&found["products_kg_m2"][axis], 0.0);
    }
    // The file is taken as overrides of the vehicle file.
    let config = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"/dev/null\"\n[vehicle]\nfile = \"prowler\"\nsensors = \"thesis-10bit\"\noverrides = [\"mass.toml\"]\n";
    fs::write(here.join("atvrec.toml"), config).expect("written");
    atvrec(here)
        .args(["check", "--no-devices"])
        .assert()
        .success();
    let again = atvrec(here)
        .args(command)
        .args(["-o", "mass.toml"])
        .assert()
        .code(2);
    assert!(
        stderr(&again).contains("exists already"),
        "{}",
        stderr(&again)
    );
}

/// Every component with an error is named.
#[test]
fn a_list_of_components_with_errors_names_each_of_them() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let said = |list: &str| {
        fs::write(here.join("parts.csv"), list).expect("written");
        let command = ["vehicle", "mass", "parts.csv", "--vehicle", "prowler"];
        stderr(&atvrec(here).args(command).assert().code(2))
    };
    let text = said(
        "name,mass_kg,x_m,y_m,z_m,ixx_kg_m2,iyy_kg_m2,izz_kg_m2\nseat,12,-0.7,,0.6,,,\nfuel,-3,-1,0,0.4,,,\nbar,9,-1,0,1,1,1,9\n",
    );
    for part in [
        "component 1 (seat): y_m is missing",
        "component 2 (fuel): mass_kg = -3: must be above 0",
        "component 3 (bar): moments of inertia 1, 1, 9 kg m^2",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let text = said("name,mass_kg,x_m,y_m\n");
    assert!(text.contains("the first line lacks z_m"), "{text}");
    let text = said("name,mass_kg,x_m,y_m,z_m\n");
    assert!(text.contains("has no component"), "{text}");
    let text = said("name,mass_kg,x_m,y_m,z_m\nall,600,0.8,0,0.6\n");
    assert!(text.contains("not between the axles"), "{text}");
}

/// Stresses of a load as a table, as JSON and as a drawing; loads and sensors that cannot be used are named.
#[test]
fn gauges_of_a_load_are_printed_and_drawn() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let command = [
        "vehicle",
        "gauges",
        "prowler",
        "--sensors",
        "full-bridge-16bit-bending",
    ];
    let load = ["--load", "FL,0,1200,2400", "--load", "rr,-300,0,1800"];
    let found = atvrec(here)
        .args(command)
        .args(load)
        .args(["--json", "-o", "stress.svg"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&found)).expect("JSON");
    let loads = found["loads"].as_array().expect("loads");
    assert_eq!((loads.len(), &loads[1]["wheel"]), (2, &"RR".into()));
    let gauges = loads[0]["gauges"].as_array().expect("gauges");
    assert_eq!(gauges.len(), 7);
    for gauge in gauges {
        let number = |name: &str| gauge[name].as_f64().expect("a number");
        let stress_pa = number("axial_stress_pa").abs() + number("bending_stress_pa").abs();
        assert!(
            (number("strain") - stress_pa / 190e9).abs() < 1e-9,
            "{gauge}"
        );
        assert!(
            (number("part_of_limit") - number("strain") / 1500e-6).abs() < 1e-9,
            "{gauge}"
        );
    }
    let drawing = fs::read_to_string(here.join("stress.svg")).expect("a drawing");
    assert!(
        drawing.contains("RR: F_x -300 N, F_y 0 N, F_z 1800 N"),
        "{drawing}"
    );
    let table = atvrec(here)
        .args(command)
        .args(load)
        .args(["--limit-um-m", "100"])
        .assert()
        .success();
    let table = stdout(&table);
    assert!(
        table.contains("lower_front_bending")
            && table.contains("the strain is above the limit of 100 um/m"),
        "{table}"
    );
    // Without loads, each wheel has its static load.
    let all = stdout(&atvrec(here).args(command).assert().success());
    assert!(
        all.contains("FL: F_x 0 N, F_y 0 N, F_z 1327 N") && all.contains("RR: "),
        "{all}"
    );
    let wrong = atvrec(here)
        .args(command)
        .args(["--load", "FL,1,2"])
        .assert()
        .code(2);
    assert!(
        stderr(&wrong).contains("as in FL,0,800,1800"),
        "{}",
        stderr(&wrong)
    );
    let solid = [
        "vehicle",
        "gauges",
        "second-vehicle",
        "--sensors",
        "thesis-10bit",
    ];
    let solid = stderr(&atvrec(here).args(solid).assert().code(1));
    assert!(solid.contains("the rear axle is a solid axle"), "{solid}");
}
