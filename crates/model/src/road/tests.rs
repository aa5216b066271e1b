use super::*;

/// The page that describes road files.
const PAGE: &str = include_str!("../../../../docs/roads.md");

fn no_file(name: &str) -> Result<String, String> {
    Err(format!("no file {name}"))
}

fn road(text: &str) -> Road {
    Road::from_toml(text, "trail.toml", &no_file).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The only problem of a road file, with the text of the file that it names.
fn problem_with(text: &str, other: &str) -> Problem {
    let read = |_: &str| Ok(other.to_owned());
    let errors = Road::from_toml(text, "trail.toml", &read).expect_err("a problem");
    assert_eq!(errors.problems.len(), 1, "{errors}");
    let problem = errors.problems[0].clone();
    assert!(errors.to_string().starts_with(&problem.file), "{errors}");
    problem
}

fn problem(text: &str) -> Problem {
    problem_with(text, "")
}

/// Whether a message names all of these.
fn names(problem: &Problem, words: &[&str]) {
    let message = problem.to_string();
    for word in words {
        assert!(message.contains(word), "{word} is not in: {message}");
    }
}

#[test]
fn the_example_of_the_page_is_a_road() {
    let example = PAGE
        .split("```toml\n")
        .nth(1)
        .and_then(|s| s.split("```").next());
    let read = |name: &str| match name {
        "survey.asc" => Ok(GRID.to_owned()),
        "tracks.csv" => Ok("s,z_left,z_right\n0,0,0\n5,0.1,-0.1\n".to_owned()),
        other => no_file(other),
    };
    let example = example.expect("the page has an example");
    let road = Road::from_toml(example, "trail.toml", &read);
    let road = road.unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(road.name(), "quarry");
    road.check_climb(0.31)
        .unwrap_or_else(|errors| panic!("{errors}"));
    // Every kind of part stands in the example.
    for (kind, _) in file::KINDS {
        assert!(example.contains(&format!("kind = \"{kind}\"")), "{kind}");
    }
}

#[test]
fn parts_add_up_within_their_extents() {
    let road = road(
        "[part.waves]\nkind = \"washboard\"\nwavelength_m = 0.8\nheight_m = 0.04\n\
         x_m = [10, 20]\nfade_m = 0\n\
         [part.log]\nkind = \"half-rounds\"\nat_x_m = [30]\nheight_m = 0.08\n\
         [part.rock]\nkind = \"rocks\"\nat_m = [[40, 1]]\nheight_m = 0.1\ndiameter_m = 0.5\n\
         [part.jump]\nkind = \"ramps\"\nat_x_m = [50]\nheight_m = 0.4\nlength_m = 2\n\
         [part.gravel]\nkind = \"friction\"\nfactor = 0.5\nx_m = [15, 3000]\n\
         [part.pit]\nkind = \"soil\"\nsoil = \"sand\"\ny_m = [2, 4]\n",
    );
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
    close(road.height_m(10.2, 0.0), 0.02);
    close(road.height_m(9.9, 0.0), 0.0);
    close(road.height_m(30.0, 7.0), 0.08);
    close(road.height_m(30.081, 7.0), 0.0);
    close(road.height_m(40.0, 1.0), 0.1);
    close(road.height_m(40.0, 1.25), 0.0);
    close(road.height_m(51.0, 0.0), 0.2);
    close(road.height_m(52.025, 0.0), 0.2);
    close(road.height_m(53.0, 0.0), 0.0);
    assert_eq!(road.friction(10.0, 0.0), 1.0);
    assert_eq!(road.friction(16.0, 0.0), 0.5);
    assert_eq!(
        road.soil(0.0, 3.0).map(|layer| layer.soil.name),
        Some("sand")
    );
    assert_eq!(road.soil(0.0, 1.0), None);
}

#[test]
fn a_soil_differs_from_that_of_its_name_by_factors() {
    let road = road(
        "[part.pit]\nkind = \"soil\"\nsoil = \"loam\"\nstiffness = 0.5\ncohesion = 2\nfriction_added_deg = 3\n",
    );
    let found = road.soil(0.0, 0.0).expect("loam").soil;
    let close =
        |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12, "{found}");
    close(found.cohesive_modulus, 0.5 * 5.27e3);
    close(found.frictional_modulus, 0.5 * 1515.04e3);
    close(found.cohesion_pa, 2.0 * 1.72e3);
    close(found.friction_rad, 32.0_f64.to_radians());
    let found = problem("[part.pit]\nkind = \"soil\"\nsoil = \"loam\"\nstiffness = 0\n");
    names(&found, &["part.pit.stiffness", "0.1"]);
}

#[test]
fn twist_ditches_alternate_between_the_sides() {
    let road = road(
        "[part.ditches]\nkind = \"twist-ditches\"\nlength_m = 2\nspacing_m = 3\ndepth_m = 0.2\n\
         x_m = [10, 100]\n",
    );
    for (x, left, right) in [(11.0, -0.2, 0.0), (14.0, 0.0, -0.2), (17.0, -0.2, 0.0)] {
        assert!((road.height_m(x, 0.5) - left).abs() < 1e-12);
        assert!((road.height_m(x, -0.5) - right).abs() < 1e-12);
    }
    assert!(road.height_m(12.5, 0.5).abs() < 1e-12);
}

/// Bank is right side down positive and grade nose down positive for a vehicle along +x.
#[test]
fn a_slope_sets_in_softly_and_ends_level() {
    let road = road(
        "[part.side]\nkind = \"slope\"\nbank_rad = 0.1\ngrade_rad = -0.05\nx_m = [10, 60]\n\
         fade_m = 10\n",
    );
    let slope = |x: f64, y: f64| {
        let step = 1e-4;
        let rise = |dx: f64, dy: f64| road.height_m(x + dx, y + dy) - road.height_m(x, y);
        [rise(step, 0.0) / step, rise(0.0, step) / step]
    };
    let [along, across] = slope(30.0, 0.0);
    assert!((along - math::tan(0.05)).abs() < 1e-6, "{along}");
    assert!((across - math::tan(0.1)).abs() < 1e-6, "{across}");
    for x in [5.0, 65.0] {
        let [along, across] = slope(x, 0.5);
        assert!(
            along.abs() < 1e-9 && across.abs() < 1e-9,
            "{along} {across}"
        );
    }
    // The presence of 50 m with soft ends of 10 m.
    let rise_m = math::tan(0.05) * 40.0;
    assert!((road.height_m(70.0, 3.0) - rise_m).abs() < 1e-9);
}

/// Rows from north to south; the value of the south-west cell is 1.
const GRID: &str = "ncols 3\nnrows 2\nxllcorner -0.5\nyllcorner -0.5\ncellsize 1\n\
                    NODATA_value -9999\n0.4 0.5 0.6\n0.1 0.2 0.3\n";

#[test]
fn a_height_map_lies_with_north_on_top() {
    let text = "[part.survey]\nkind = \"grid\"\nfile = \"survey.asc\"\n";
    let read = |_: &str| Ok(GRID.to_owned());
    let road = Road::from_toml(text, "trail.toml", &read).expect("a road");
    for (x, y, z) in [
        (0.0, 0.0, 0.1),
        (2.0, 0.0, 0.3),
        (1.0, 1.0, 0.5),
        (9.0, 9.0, 0.6),
    ] {
        assert!((road.height_m(x, y) - z).abs() < 1e-12);
    }
}

#[test]
fn a_profile_has_one_or_two_tracks() {
    let text = "[part.bump]\nkind = \"profile\"\nfile = \"a.csv\"\nstart_x_m = 10\ntrack_m = 1\n";
    let make = |csv: &str| {
        let read = |_: &str| Ok(csv.to_owned());
        Road::from_toml(text, "trail.toml", &read).expect("a road")
    };
    let one = make("s,z\n0,0\n2,0.1\n");
    assert!((one.height_m(11.0, 3.0) - 0.05).abs() < 1e-12);
    let two = make("s, z_left, z_right\n0,0,0.2\n2,0.1,0.2\n");
    assert!((two.height_m(12.0, 0.5) - 0.1).abs() < 1e-12);
    assert!((two.height_m(12.0, 0.0) - 0.15).abs() < 1e-12);
    assert!((two.height_m(12.0, -4.0) - 0.2).abs() < 1e-12);
}

#[test]
fn a_height_map_with_holes_is_refused() {
    let text = "[part.survey]\nkind = \"grid\"\nfile = \"survey.asc\"\n";
    let found = problem_with(text, &GRID.replace("0.4 0.5", "0.4 -9999"));
    names(
        &found,
        &["survey.asc:7", "row 1, column 2", "-9999", "hole", "fill"],
    );
    let found = problem_with(text, &GRID.replace("0.3", "nan"));
    names(&found, &["survey.asc:8", "row 2, column 3", "nan", "hole"]);
    let found = problem_with(text, &GRID.replace(" 0.3", ""));
    names(&found, &["survey.asc:8", "row 2", "2 values", "ncols = 3"]);
    let found = problem_with(text, &GRID.replace("nrows 2", "nrows 3"));
    names(&found, &["survey.asc", "nrows = 3", "2 rows"]);
    let found = problem_with(text, &GRID.replace("cellsize 1", "cellsize -1"));
    names(&found, &["survey.asc", "cellsize", "-1"]);
}

#[test]
fn a_profile_with_holes_is_refused() {
    let text = "[part.bump]\nkind = \"profile\"\nfile = \"a.csv\"\n";
    let found = problem_with(text, "s,z\n0,0\n1,\n2,0.1\n");
    names(&found, &["a.csv:3", "z", "\"\"", "hole", "remove the row"]);
    let found = problem_with(text, "s,z\n0,0\n1,NaN\n2,0.1\n");
    names(&found, &["a.csv:3", "z", "NaN"]);
    let found = problem_with(text, "s,z\n0,0\n2,0.1\n1,0.2\n");
    names(&found, &["a.csv:4", "s", "1 does not rise", "2", "sort"]);
    let found = problem_with(text, "x,z\n0,0\n");
    names(&found, &["a.csv:1", "columns", "x,z", "s,z_left,z_right"]);
    let found = problem_with(text, "s,z_left,z_right\n0,0,0\n1,0,0\n");
    names(&found, &["a.csv", "track_m", "add track_m"]);
}

#[test]
fn ground_steeper_than_a_tyre_can_climb_is_refused() {
    let text = "[part.wall]\nkind = \"profile\"\nfile = \"a.csv\"\n";
    let read = |_: &str| Ok("s,z\n0,0\n5,0\n5.1,0.5\n9,0.5\n".to_owned());
    let road = Road::from_toml(text, "trail.toml", &read).expect("a road");
    let errors = road.check_climb(0.31).expect_err("a wall");
    let found = &errors.problems[0];
    names(
        found,
        &["trail.toml:1", "part.wall", "0.500 m", "0.310 m", "lower"],
    );
    road.check_climb(0.6).expect("a wheel of a truck climbs it");
    // A fall is no climb.
    let read = |_: &str| Ok("s,z\n0,0.5\n5,0.5\n5.1,0\n9,0\n".to_owned());
    let road = Road::from_toml(text, "trail.toml", &read).expect("a road");
    road.check_climb(0.31).expect("a fall");
    let rock = "[part.rock]\nkind = \"rocks\"\nat_m = [[9, 0]]\nheight_m = 0.5\ndiameter_m = 0.6\n";
    let road = Road::from_toml(rock, "trail.toml", &no_file).expect("a road");
    names(
        &road.check_climb(0.31).expect_err("a rock").problems[0],
        &["part.rock"],
    );
}

#[test]
fn an_unknown_class_is_refused() {
    let found = problem("[part.rough]\nkind = \"iso8608\"\nclass = \"K\"\n");
    names(
        &found,
        &[
            "trail.toml:3",
            "part.rough.class",
            "\"K\"",
            "A, B, C, D, E or F",
        ],
    );
    let found = problem("[part.rough]\nkind = \"iso8806\"\nclass = \"C\"\n");
    names(
        &found,
        &["part.rough.kind", "\"iso8806\"", "iso8608, rocks"],
    );
    let found = problem("[part.pit]\nkind = \"soil\"\nsoil = \"mud\"\n");
    names(
        &found,
        &["part.pit.soil", "\"mud\"", "sand, loam, clay, snow"],
    );
}

#[test]
fn a_part_outside_the_road_is_refused() {
    let found = problem(
        "x_m = [0, 100]\n[part.log]\nkind = \"half-rounds\"\nat_x_m = [50, 120]\nheight_m = 0.1\n",
    );
    names(
        &found,
        &["part.log.at_x_m", "120 m", "x_m = [0, 100]", "widen x_m"],
    );
    let found = problem(
        "y_m = [-5, 5]\n[part.rock]\nkind = \"rocks\"\nat_m = [[5, 6]]\nheight_m = 0.1\n\
         diameter_m = 0.3\n",
    );
    names(&found, &["part.rock.at_m", "6 m", "y_m = [-5, 5]"]);
    let text = "x_m = [0, 100]\n[part.a]\nkind = \"profile\"\nfile = \"a.csv\"\nstart_x_m = 99\n";
    let found = problem_with(text, "s,z\n0,0\n2,0.1\n");
    names(&found, &["part.a.file", "101 m", "x_m = [0, 100]"]);
}

#[test]
fn a_negative_wavelength_is_refused() {
    let found =
        problem("[part.waves]\nkind = \"washboard\"\nwavelength_m = -0.8\nheight_m = 0.04\n");
    names(
        &found,
        &[
            "trail.toml:3",
            "part.waves.wavelength_m",
            "-0.8",
            "from 0.1 to 100",
        ],
    );
}

#[test]
fn all_mistakes_are_reported_at_once() {
    let text = "nmae = \"x\"\nx_m = [5, 1]\n[part.a]\nkind = \"rocks\"\nheight_m = 0.1\n\
                diameter = 0.3\n[part.b]\nkind = \"grid\"\nfile = \"gone.asc\"\n";
    let errors = Road::from_toml(text, "trail.toml", &no_file).expect_err("mistakes");
    let text = errors.to_string();
    for word in [
        "nmae",
        "`name`",
        "x_m",
        "part.a.diameter",
        "part.a.diameter_m",
        "part.a.per_100_m2",
        "gone.asc",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
}
