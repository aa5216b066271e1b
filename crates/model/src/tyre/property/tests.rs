use super::*;

/// Property file of the Magic Formula 5.2.
pub(in crate::tyre) const MF52: &str = include_str!("mf52.tir");
/// Property file of the Magic Formula 6.1.
pub(in crate::tyre) const MF61: &str = include_str!("mf61.tir");

/// Rounding of the reference values, N and N m.
const ROUNDING: f64 = 2e-6;

/// Load (N), slip angle (rad), longitudinal slip, camber angle (rad) and speed (m/s).
const CASES: [[f64; 5]; 5] = [
    [4000.0, 0.06, 0.0, 0.0, 15.0],
    [2500.0, -0.1, 0.05, 0.03, 5.0],
    [5500.0, 0.12, -0.15, -0.05, 25.0],
    [3000.0, -0.03, 0.3, 0.08, 10.0],
    [6200.0, 0.4, -0.8, 0.02, 20.0],
];

fn tir(text: &str) -> Tir {
    Tir::parse(text, "tyre.tir").unwrap()
}

/// The property file with all scaling factors 1.
fn unscaled(text: &str) -> String {
    let start = text.find("[SCALING_COEFFICIENTS]").unwrap();
    let end = text.find("[LONGITUDINAL_COEFFICIENTS]").unwrap();
    format!("{}{}", &text[..start], &text[end..])
}

/// F_x, F_y, M_x, M_y, M_z on a wheel of the left or the right side.
fn wrench(tyre: &PropertyTyre, left: bool, case: [f64; 5]) -> [f64; 5] {
    let [load_n, slip_angle, slip_ratio, camber_rad, speed] = case;
    let contact = Contact {
        camber_rad,
        ..Contact::combined(load_n, slip_angle, slip_ratio)
    };
    let forces = tyre.forces(left, &contact);
    [
        forces.longitudinal_n,
        forces.lateral_n,
        tyre.overturning_n_m(left, &contact, forces.lateral_n),
        -tyre.resistance_n_m(&contact, forces.longitudinal_n, speed),
        forces.aligning_n_m,
    ]
}

fn check(text: &str, expected: [[f64; 5]; 5]) {
    let tyre = PropertyTyre::measured(&tir(text));
    for (case, expected) in CASES.into_iter().zip(expected) {
        let found = wrench(&tyre, true, case);
        for (value, expected) in found.into_iter().zip(expected) {
            assert!(
                (value - expected).abs() < ROUNDING,
                "{case:?}: {found:?} {expected}"
            );
        }
    }
}

/// Reference values: a Python program written after the equations of the 3rd edition of the book. Its
/// F_x, F_y, M_x and M_y agree with the package `TyreDyn` (MIT licence, version of January 2026) to
/// 1e-3 N where both have the same equation.
#[test]
fn mf61_meets_an_independent_calculation() {
    check(
        &unscaled(MF61),
        [
            [75.541657, -2766.015379, -117.958227, -12.084477, 64.149775],
            [1341.904795, 2118.656226, 36.229285, -8.582887, 6.056707],
            [
                -3954.881193,
                -3023.768108,
                -130.301308,
                -11.183188,
                23.622605,
            ],
            [3035.770276, 228.865811, -36.6773, -12.070427, 87.028305],
            [
                -3613.203538,
                -2218.186946,
                -165.411063,
                -11.887995,
                -50.760427,
            ],
        ],
    );
}

#[test]
fn mf61_with_scaling_factors_meets_an_independent_calculation() {
    check(
        MF61,
        [
            [77.258449, -2548.965609, -100.666056, -13.899546, 51.712956],
            [1182.400148, 1872.329422, 26.256629, -9.722296, 11.105188],
            [
                -2861.526799,
                -2774.510861,
                -108.825573,
                -14.875457,
                13.808904,
            ],
            [2227.763386, 217.638236, -34.533328, -13.002243, 72.527552],
            [-2509.449, -2060.528846, -143.241529, -15.928586, -44.212269],
        ],
    );
}

/// Reference values: a Python program written after the equations of the 2nd edition of the book.
#[test]
fn mf52_meets_an_independent_calculation() {
    check(
        &unscaled(MF52),
        [
            [-95.779549, -2413.994723, -35.275017, -13.636104, 48.607534],
            [1286.755817, 2204.451183, 1.999788, -8.815075, 3.900122],
            [
                -4701.156882,
                -3282.640918,
                10.272171,
                -14.586887,
                -27.220086,
            ],
            [3344.159675, 490.576764, -59.971855, -12.319472, 109.027032],
            [
                -4187.993612,
                -1734.999108,
                -73.136341,
                -16.033856,
                -90.710866,
            ],
        ],
    );
}

#[test]
fn mf52_with_scaling_factors_meets_an_independent_calculation() {
    check(
        MF52,
        [
            [-100.892858, -2283.710737, -29.461746, -15.675998, 42.181116],
            [1176.06303, 1981.024721, 0.114658, -10.062629, 11.059312],
            [-3434.265187, -3125.029546, 12.917133, -18.655993, -26.52868],
            [2413.485251, 515.997321, -53.368093, -13.413652, 88.206925],
            [
                -2839.923394,
                -1687.240002,
                -64.081426,
                -20.695291,
                -72.532687,
            ],
        ],
    );
}

#[test]
fn a_tyre_of_the_other_side_is_the_mirror_image() {
    for text in [MF52, MF61] {
        let left = PropertyTyre::measured(&tir(text));
        let right = PropertyTyre::measured(&tir(&text.replace("'LEFT'", "'RIGHT'")));
        let both = PropertyTyre::measured(&tir(&text.replace("'LEFT'", "'SYMMETRIC'")));
        for case in CASES {
            let [load, angle, slip, camber, speed] = case;
            let [fx, fy, mx, my, mz] = wrench(&left, true, case);
            let mirrored = wrench(&left, false, [load, -angle, slip, -camber, speed]);
            assert_eq!(mirrored, [fx, -fy, -mx, my, -mz]);
            assert_eq!(wrench(&right, false, case), [fx, fy, mx, my, mz]);
            assert_eq!(wrench(&both, true, case), wrench(&both, false, case));
        }
    }
}

#[test]
fn beyond_its_range_of_loads_the_tyre_has_the_friction_at_the_limit() {
    let tyre = PropertyTyre::measured(&tir(MF61));
    for (limit, outside) in [(200.0_f64, 20.0_f64), (9000.0, 12_000.0)] {
        let at = |load| tyre.forces(true, &Contact::combined(load, 0.1, 0.05));
        let (inside, beyond) = (at(limit), at(outside));
        let share = outside / limit;
        assert!((beyond.lateral_n - share * inside.lateral_n).abs() < 1e-9);
        assert!((beyond.longitudinal_n - share * inside.longitudinal_n).abs() < 1e-9);
        assert!((beyond.aligning_n_m - share * inside.aligning_n_m).abs() < 1e-9);
    }
}

#[test]
fn what_a_vehicle_takes_from_the_file_is_the_slope_of_the_forces() {
    for text in [MF52, MF61] {
        let tir = tir(text);
        let tyre = PropertyTyre::measured(&tir);
        let own = tyre.derived(&tir);
        let at = |angle: f64, slip: f64, camber_rad: f64| {
            tyre.forces(
                true,
                &Contact {
                    camber_rad,
                    ..Contact::combined(4000.0, angle, slip)
                },
            )
        };
        // The steepest slope is that at the corrected slip of zero.
        let slopes = (-400..400).map(|k| {
            let angle = 1e-4 * f64::from(k);
            (at(angle, 0.0, 0.0).lateral_n - at(angle + 1e-6, 0.0, 0.0).lateral_n) / 1e-6
        });
        let steepest = slopes.fold(0.0, f64::max);
        assert!((steepest / own.cornering_stiffness_n_rad - 1.0).abs() < 5e-3);
        let slopes = (-400..400).map(|k| {
            let slip = 1e-4 * f64::from(k);
            (at(0.0, slip + 1e-6, 0.0).longitudinal_n - at(0.0, slip, 0.0).longitudinal_n) / 1e-6
        });
        let steepest = slopes.fold(0.0, f64::max);
        assert!(
            (steepest / own.slip_stiffness_n - 1.0).abs() < 5e-3,
            "{steepest}"
        );
        let camber = (at(0.0, 0.0, -1e-6).lateral_n - at(0.0, 0.0, 1e-6).lateral_n) / 2e-6;
        assert!(
            (camber / own.camber_stiffness_n_rad - 1.0).abs() < 0.15,
            "{camber} {own:?}"
        );
        let peak = (0..4000).map(|k| -at(1e-4 * f64::from(k), 0.0, 0.0).lateral_n);
        let peak = peak.fold(0.0, f64::max);
        assert!(
            (peak / 4000.0 / own.friction - 1.0).abs() < 0.05,
            "{peak} {own:?}"
        );
    }
}

fn faults(text: &str) -> Vec<(String, usize, String)> {
    let problems = Tir::parse(text, "tyre.tir").unwrap_err();
    let parts = problems.into_iter().map(|p| {
        let text = p.to_string();
        (p.field, p.line, text)
    });
    parts.collect()
}

#[test]
fn mistakes_of_a_property_file_name_the_coefficient_its_line_and_the_remedy() {
    let line = |text: &str, start: &str| {
        1 + text
            .lines()
            .position(|line| line.starts_with(start))
            .unwrap()
    };
    for (from, to, field, words) in [
        ("'newton'", "'pound'", "FORCE", "is not the SI unit newton"),
        (
            "'radians'",
            "'degrees'",
            "ANGLE",
            "is not the SI unit radians",
        ),
        (
            "= 61 ",
            "= 62 ",
            "FITTYP",
            "62 is a tyre model that is not supported",
        ),
        ("PKY4  ", "PKI4  ", "PKI4", "did you mean PKY4?"),
        (
            "PCX1                     = 1.62",
            "PCX1 = 1,62",
            "PCX1",
            "is not a finite number",
        ),
        (
            "PKY1                     = -19.0",
            "PKY1 = 19.0",
            "PKY1",
            "not those of ISO 8855",
        ),
        (
            "= 0.32\n",
            "= 320\n",
            "UNLOADED_RADIUS",
            "must lie between 0.02 and 3 m",
        ),
        (
            "= 200.0\nFZMAX",
            "= 20000.0\nFZMAX",
            "FZMIN",
            "is not below FZMAX = 9000",
        ),
        ("'LEFT'", "'MIDDLE'", "TYRESIDE", "write LEFT or RIGHT"),
    ] {
        let text = MF61.replacen(from, to, 1);
        assert_ne!(text, MF61, "{from}");
        let found = faults(&text);
        let (name, number, message) = &found[0];
        assert_eq!(name, field);
        assert_eq!(*number, line(&text, field), "{message}");
        assert!(message.contains(words), "{message}");
    }
    let missing = faults(&MF61.replace("RBY1 ", "! RBY1 ").replace("PDX1 ", "$ PDX1 "));
    let names: Vec<&str> = missing.iter().map(|(name, _, _)| name.as_str()).collect();
    assert_eq!(names, ["PDX1", "RBY1"]);
    assert!(missing[0].2.contains("is missing"), "{}", missing[0].2);
}

#[test]
fn what_is_not_modelled_is_said() {
    let said = |text: &str, load_n: f64| tir(text).warnings(load_n).join("; ");
    assert_eq!(said(MF61, 4000.0), "");
    assert!(said(MF61, 150.0).contains("outside of the range of loads 200 to 9000 N"));
    assert!(said(&MF61.replace("= 4\n", "= 15\n"), 4000.0).contains("turn slip"));
    let as_52 = MF61.replace("= 61 ", "= 6 ");
    assert!(
        said(&as_52, 4000.0).contains("PPX1"),
        "{}",
        said(&as_52, 4000.0)
    );
    assert_eq!(said(MF52, 4000.0), "");
}

#[test]
fn empty_values_comments_and_exponents_of_fortran_are_read() {
    let text = MF61
        .replace("PCX1                     = 1.62", "  pcx1=1.62D+00 $ shape")
        .replace("QBZ4                     = 0.12", "QBZ4 =   ");
    let tir = tir(&text);
    assert_eq!(tir.number("PCX1"), Some(1.62));
    assert_eq!(tir.number("QBZ4"), None);
    assert_eq!(tir.number("ASPECT_RATIO"), None);
}
