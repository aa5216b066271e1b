//! Whether the values of a vehicle file make physical sense together.

mod corners;

use std::fmt;
use std::path::Path;

use sample::Wheel;

use super::rules::SECTIONS;
use super::{Axle, Strut, Vehicle, VehicleErrors, plain, tyre_file};
use crate::file::rules::{self, Checked};
use crate::tyre::Tir;

/// Something in a vehicle file that is possible, but so rare that it is worth a second look.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// Dotted name of the field.
    pub field: String,
    /// The value that is looked at, a ratio without unit unless the text says otherwise.
    pub value: f64,
    /// What is odd about it and what to do.
    pub text: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.text)
    }
}

impl Vehicle {
    /// Reads a vehicle file. `path` is only named in messages. A file that speaks of no axle needs
    /// mass and axle distances only. [`Vehicle::with_tyre_files`] reads the tyre property files that a text
    /// names.
    ///
    /// # Errors
    /// All mistakes at once, each with its line, field, value and remedy.
    pub fn from_toml(text: &str, path: impl AsRef<Path>) -> Result<Self, VehicleErrors> {
        let mut checked: Checked<Self> = if plain::is_plain(text) {
            rules::read::<plain::Plain>(text, path.as_ref(), plain::SECTIONS)?.map(Self::from)
        } else {
            rules::read(text, path.as_ref(), SECTIONS)?
        };
        tyre_file::fill(&mut checked);
        for (field, value, message, remedy) in contradictions(&checked.value) {
            checked.note(&field, value, message, remedy);
        }
        checked.finish()
    }

    /// The vehicle as the text of a vehicle file.
    ///
    /// # Errors
    /// Where a value cannot be written, which no vehicle that was read has.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string_pretty(self)
    }

    /// What is odd about this vehicle without being impossible.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let body = &self.body;
        let mut warnings = Vec::new();
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let [_, _, yaw] = body.inertia_kg_m2;
        let ratio = yaw / (body.mass_kg * a * b);
        if !(0.7..=1.5).contains(&ratio) {
            warnings.push(Warning {
                field: "body.inertia_kg_m2".into(),
                value: ratio,
                text: format!(
                    "the yaw inertia {yaw} kg m^2 is {ratio:.2} times m a b; 0.7 to 1.5 is usual \
                     (thesis, equation 2.29), check its unit and axis"
                ),
            });
        }
        let front = b / (a + b);
        if !(0.3..=0.7).contains(&front) {
            warnings.push(Warning {
                field: "body.front_axle_to_cg_m".into(),
                value: front,
                text: format!(
                    "{:.0} % of the weight on the front axle; check with four scales",
                    100.0 * front
                ),
            });
        }
        if body.cg_height_m > 0.8 * self.front.track_m.min(self.rear.track_m) {
            warnings.push(Warning {
                field: "body.cg_height_m".into(),
                value: body.cg_height_m,
                text: format!(
                    "the centre of gravity at {} m stands high over a track of {} m; check",
                    body.cg_height_m, self.front.track_m
                ),
            });
        }
        warnings.extend(self.wheelbase_warning());
        warnings.extend(self.implausible());
        warnings.extend(self.tyre_file_warnings());
        warnings
    }

    fn tyre_file_warnings(&self) -> Vec<Warning> {
        let axles = [("front", Wheel::FrontLeft), ("rear", Wheel::RearLeft)];
        let mut warnings = Vec::new();
        for (name, wheel) in axles {
            let load_n = self.static_load_n(wheel);
            let tir = self.axle(wheel).tyre.tir.as_ref();
            let found = tir.map(|tir| tir.warnings(load_n)).unwrap_or_default();
            warnings.extend(found.into_iter().map(|text| Warning {
                field: format!("{name}.tyre.tir"),
                value: load_n,
                text,
            }));
        }
        warnings
    }

    fn wheelbase_warning(&self) -> Option<Warning> {
        let length = self.body.front_axle_to_cg_m + self.body.cg_to_rear_axle_m;
        let ratio = length / self.front.track_m;
        (!(0.9..=3.0).contains(&ratio)).then(|| Warning {
            field: "front.track_m".into(),
            value: ratio,
            text: format!("the wheelbase {length:.3} m is {ratio:.2} times the track; check both"),
        })
    }
}

/// How far the sprung part's centre of gravity may lie from where the whole vehicle's has it, m: what
/// a workshop may be wrong by, many times over.
const SPRUNG_CG_M: f64 = 0.05;

type Contradiction = (String, String, String, String);

/// Names that two payloads have.
fn payloads(vehicle: &Vehicle, found: &mut Vec<Contradiction>) {
    for (number, payload) in vehicle.payload.iter().enumerate() {
        let earlier = &vehicle.payload[..number];
        if earlier.iter().any(|other| other.name == payload.name) {
            found.push((
                format!("payload[{number}].name"),
                payload.name.clone(),
                "is the name of an earlier payload".into(),
                "give each payload a name of its own".into(),
            ));
        }
    }
}

fn contradictions(vehicle: &Vehicle) -> Vec<Contradiction> {
    let mut found = Vec::new();
    let body = &vehicle.body;
    payloads(vehicle, &mut found);
    triangle("body", body.inertia_kg_m2, &mut found);
    product(
        "body",
        body.inertia_kg_m2,
        body.inertia_xz_kg_m2,
        &mut found,
    );
    let unsprung: f64 = [&vehicle.front, &vehicle.rear]
        .iter()
        .filter_map(|axle| axle.unsprung.as_ref())
        .map(|corner| 2.0 * corner.total_mass_kg())
        .sum();
    if unsprung >= body.mass_kg {
        found.push((
            "body.mass_kg".into(),
            body.mass_kg.to_string(),
            format!("the four corners alone weigh {unsprung} kg"),
            "give the whole vehicle's mass, wheels and arms included".into(),
        ));
    }
    if let Some(sprung) = &body.sprung {
        triangle("body.sprung", sprung.inertia_kg_m2, &mut found);
        product(
            "body.sprung",
            sprung.inertia_kg_m2,
            sprung.inertia_xz_kg_m2,
            &mut found,
        );
        let rest = body.mass_kg - sprung.mass_kg - unsprung;
        if rest < -1e-6 * body.mass_kg {
            found.push((
                "body.sprung.mass_kg".into(),
                sprung.mass_kg.to_string(),
                format!(
                    "sprung and unsprung masses exceed the total by {:.3} kg",
                    -rest
                ),
                "make body.mass_kg = sprung + unsprung".into(),
            ));
        }
        let [x, _, z] = vehicle.whole_less_unsprung().cg_m;
        let [own_x, _, own_z] = sprung.cg_m;
        if (own_x - x).abs().max((own_z - z).abs()) > SPRUNG_CG_M {
            found.push((
                "body.sprung.cg_m".into(),
                format!("{:?}", sprung.cg_m),
                format!(
                    "does not fit the whole vehicle's centre of gravity, which less the unsprung \
                     masses puts it at [{x:.3}, 0, {z:.3}]"
                ),
                "give it from the ground below the whole vehicle's centre of gravity".into(),
            ));
        }
    }
    topple(vehicle, &mut found);
    for (name, of) in [("front", &vehicle.front), ("rear", &vehicle.rear)] {
        let before = found.len();
        axle(name, of, &mut found);
        if found.len() == before {
            corners::travel(vehicle, name, &mut found);
        }
    }
    for (name, map) in [
        ("steering.left_map_rad", &vehicle.steering.left_map_rad),
        ("steering.right_map_rad", &vehicle.steering.right_map_rad),
    ] {
        if map.windows(2).any(|pair| pair[1][1] < pair[0][1]) {
            found.push((
                name.into(),
                String::new(),
                "the road-wheel angle falls where the steering wheel turns left".into(),
                "left is positive for both columns".into(),
            ));
        }
    }
    found
}

fn triangle(table: &str, inertia: [f64; 3], found: &mut Vec<Contradiction>) {
    let sum: f64 = inertia.iter().sum();
    let largest = inertia.iter().copied().fold(0.0, f64::max);
    if largest > sum - largest {
        found.push((
            format!("{table}.inertia_kg_m2"),
            format!("{inertia:?}"),
            "no rigid body has one moment of inertia above the sum of the other two".into(),
            "check order (roll, pitch, yaw) and units".into(),
        ));
    }
}

fn product(table: &str, [roll, _, yaw]: [f64; 3], xz: f64, found: &mut Vec<Contradiction>) {
    if xz * xz >= roll * yaw {
        found.push((
            format!("{table}.inertia_xz_kg_m2"),
            xz.to_string(),
            "is larger than the moments of inertia allow (I_xz^2 < I_x I_z)".into(),
            "check sign and unit".into(),
        ));
    }
}

fn topple(vehicle: &Vehicle, found: &mut Vec<Contradiction>) {
    if let Some((wheel, load_n)) = vehicle.hanging_wheel() {
        found.push((
            "body.cg_y_m".into(),
            vehicle.body.cg_y_m.to_string(),
            format!("puts the centre of gravity past the wheels: the static load of {wheel} is {load_n:.0} N"),
            "give the distance from the vehicle's middle, left is positive; check its unit".into(),
        ));
    }
    let stiffness = vehicle.front.roll_stiffness_n_m_rad + vehicle.rear.roll_stiffness_n_m_rad;
    let overturning =
        vehicle.sprung().mass_kg * sample::STANDARD_GRAVITY_M_S2 * vehicle.roll_arm_m();
    if stiffness <= overturning {
        found.push((
            "front.roll_stiffness_n_m_rad".into(),
            vehicle.front.roll_stiffness_n_m_rad.to_string(),
            format!(
                "front and rear together, {stiffness:.0} N m/rad, do not carry the sprung mass, \
                 which needs more than m g h_1 = {overturning:.0} N m/rad"
            ),
            if stiffness * 180.0 / std::f64::consts::PI > overturning {
                "the values are probably in N m/deg; write 57.2958 times as much".into()
            } else {
                "give the stiffness about the roll axis, without gravity's part".into()
            },
        ));
    }
}

fn axle(name: &str, axle: &Axle, found: &mut Vec<Contradiction>) {
    if axle.anti_roll_bar_n_m_rad > axle.roll_stiffness_n_m_rad {
        found.push((
            format!("{name}.anti_roll_bar_n_m_rad"),
            axle.anti_roll_bar_n_m_rad.to_string(),
            "is above the roll stiffness of the whole axle, which includes it".into(),
            "add the springs' part to roll_stiffness_n_m_rad".into(),
        ));
    }
    if let Some(strut) = &axle.strut {
        stops(name, strut, found);
        if !axle.has_hard_points() && strut.motion_ratio.is_none() {
            found.push((
                format!("{name}.strut.motion_ratio"),
                String::new(),
                "is missing and there are no hard-points to take it from".into(),
                format!("add it or the table of a linkage, such as [{name}.wishbone]"),
            ));
        }
    }
    corners::points(name, axle, found);
    let own_terms = axle.tyre.tir.as_ref().and_then(Tir::nominal_pressure_pa);
    if let (Some(pressure), Some(nominal_pa)) = (&axle.tyre.pressure, own_terms) {
        found.push((
            format!("{name}.tyre.pressure"),
            pressure.nominal_pa.to_string(),
            format!("the .tir file has terms of the pressure itself (NOMPRES {nominal_pa} Pa)"),
            "remove the table".into(),
        ));
    }
}

fn stops(name: &str, strut: &Strut, found: &mut Vec<Contradiction>) {
    let (bump, design, droop) = (
        strut.bump_stop_length_m,
        strut.design_length_m,
        strut.droop_stop_length_m,
    );
    if !(bump < design && design < droop) {
        found.push((
            format!("{name}.strut.design_length_m"),
            design.to_string(),
            format!("does not lie between bump stop {bump} and droop stop {droop}"),
            "the strut is shortest on the bump stop".into(),
        ));
    }
    if let Some(rebound) = strut
        .rebound_damping_n_s_m
        .filter(|c| *c > 2.0 * strut.damping_n_s_m)
    {
        found.push((
            format!("{name}.strut.rebound_damping_n_s_m"),
            rebound.to_string(),
            format!(
                "is above twice the mean of both directions, damping_n_s_m = {}",
                strut.damping_n_s_m
            ),
            "write the mean of compression and extension as damping_n_s_m".into(),
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(change: impl Fn(&str) -> String) -> VehicleErrors {
        let text = change(Vehicle::builtin_text("prowler").unwrap());
        errors_of(&text).unwrap_err()
    }

    fn errors_of(text: &str) -> Result<Vehicle, VehicleErrors> {
        Vehicle::from_toml(text, "bad.toml")
    }

    fn fields(errors: &VehicleErrors) -> Vec<&str> {
        errors.problems.iter().map(|p| p.field.as_str()).collect()
    }

    #[test]
    fn structural_mistakes_are_told_together_with_line_value_and_remedy() {
        let errors = errors(|text| {
            text.replace("mass_kg = 644.0", "mass_kg = -644.0")
                .replace("cg_height_m = 0.579", "cg_hight_m = 0.579")
                .replacen("friction = 0.87", "friction = \"high\"", 1)
                .replacen("track_m = 1.143", "track_m = 1143.0", 1)
                .replace("ratio = 9.16\n", "")
        });
        let mut named = fields(&errors);
        named.sort_unstable();
        assert_eq!(
            named,
            [
                "body.cg_height_m",
                "body.cg_hight_m",
                "body.mass_kg",
                "front.track_m",
                "front.tyre.friction",
                "steering.ratio",
            ]
        );
        let text = errors.to_string();
        assert!(text.contains("bad.toml:5: body.mass_kg = -644.0"), "{text}");
        assert!(text.contains("did you mean cg_height_m?"), "{text}");
    }
    #[test]
    fn contradictions_between_fields_are_told_together() {
        let errors = errors(|text| {
            text.replace("[213.4, 445.7, 453.9]", "[213.4, 445.7, 753.9]")
                .replacen(
                    "bump_stop_length_m = 0.308792",
                    "bump_stop_length_m = 0.4",
                    1,
                )
                .replacen(
                    "roll_stiffness_n_m_rad = 6425.0",
                    "roll_stiffness_n_m_rad = 5.0",
                    1,
                )
                .replace(
                    "roll_stiffness_n_m_rad = 6051.0",
                    "roll_stiffness_n_m_rad = 5.0",
                )
        });
        let mut named = fields(&errors);
        named.sort_unstable();
        assert_eq!(
            named,
            [
                "body.inertia_kg_m2",
                "front.roll_stiffness_n_m_rad",
                "front.strut.design_length_m",
            ]
        );
        assert!(errors.problems.iter().all(|problem| problem.line > 0));
    }

    #[test]
    fn points_of_a_strut_must_fit_the_axle() {
        let text = include_str!("../../../../testdata/vehicle-with-struts.toml");
        let of_front = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            let errors = errors_of(&text.replacen(from, to, 1)).unwrap_err();
            (fields(&errors).join(" "), errors.problems[0].to_string())
        };
        let (field, message) = of_front("upper_arm_mass_kg = 0.0", "upper_arm_mass_kg = 3.0");
        assert_eq!(field, "front.unsprung.upper_arm_mass_kg");
        assert!(message.contains("write 0.0"), "{message}");
        let (field, _) = of_front("[-0.045, 0.56, 0.945]", "[-0.045, 0.56, 0.345]");
        assert_eq!(field, "front.macpherson.strut_top_m");
        let (field, message) = of_front("[0.012, 0.69, 0.235]", "[0.012, -0.69, 0.235]");
        assert_eq!(field, "front.macpherson.lower_ball_m");
        assert!(message.contains("right-hand side"), "{message}");
        let prowler = Vehicle::builtin_text("prowler").unwrap();
        let wishbone = &prowler[prowler.find("[front.wishbone]").unwrap()..];
        let wishbone = &wishbone[..wishbone[1..].find("\n[").unwrap() + 1];
        let (field, message) = of_front(
            "[front.macpherson]",
            &format!("{wishbone}\n[front.macpherson]"),
        );
        assert!(field.contains("front.macpherson"), "{field}");
        assert!(message.contains("describe the same corner"), "{message}");
    }

    /// A test file of `testdata` with one text replaced at the rear axle: fields, and the first problem.
    fn at_rear(text: &str, from: &str, to: &str) -> (String, String) {
        let (front, rear) = text.split_at(text.find("[rear]").unwrap());
        assert!(rear.contains(from), "{from}");
        let errors = errors_of(&format!("{front}{}", rear.replacen(from, to, 1))).unwrap_err();
        (fields(&errors).join(" "), errors.problems[0].to_string())
    }

    #[test]
    fn points_of_five_links_must_hold_the_wheel_and_reach_its_travel() {
        let text = include_str!("../../../../testdata/vehicle-with-links.toml");
        for (from, to, field, part) in [
            (
                "[0.07, 0.69, 0.235]",
                "[0.07, -0.69, 0.235]",
                "rear.five_link.lower_front_outer_m",
                "right-hand side",
            ),
            (
                "[-0.0005, 0.5535, 0.234]",
                "[-0.0005, 0.5535, 0.254]",
                "rear.five_link.strut_mount_m",
                "off the line between the joints",
            ),
            (
                "strut_chassis_m = [-0.015, 0.49, 0.66]",
                "strut_chassis_m = [-0.015, 0.49, 0.16]",
                "rear.five_link.strut_chassis_m",
                "not above strut_mount_m",
            ),
            // The toe link in the place of the upper rear link.
            (
                "tie_rod_inner_m = [-0.19, 0.36, 0.33]\ntie_rod_outer_m = [-0.15, 0.7, 0.31]",
                "tie_rod_inner_m = [-0.1, 0.4, 0.53]\ntie_rod_outer_m = [-0.05, 0.67, 0.57]",
                "rear.five_link",
                "parallel",
            ),
            (
                "bump_stop_length_m = 0.",
                "bump_stop_length_m = 0.1 # 0.",
                "rear.strut.bump_stop_length_m",
                "does not reach: strut length = ",
            ),
            (
                "upright_cg_m = [-0.004, 0.655, 0.395]",
                "lower_arm_cg_m = [-0.004, 0.655, 0.395]",
                "rear.unsprung.lower_arm_cg_m",
                "middle",
            ),
        ] {
            let (found, message) = at_rear(text, from, to);
            assert_eq!(found, field, "{message}");
            assert!(message.contains(part), "{message}");
        }
        let struts = include_str!("../../../../testdata/vehicle-with-struts.toml");
        let table =
            &text[text.find("[rear.five_link]").unwrap()..text.find("[rear.tyre]").unwrap()];
        let errors = errors_of(&format!("{struts}\n{table}")).unwrap_err();
        assert!(fields(&errors).contains(&"rear.five_link"), "{errors}");
        assert!(
            errors.to_string().contains("[rear.macpherson] describe"),
            "{errors}"
        );
    }

    #[test]
    fn points_of_a_trailing_arm_must_fit_the_axle() {
        let text = include_str!("../../../../testdata/vehicle-with-trailing-arms.toml");
        for (from, to, field, part) in [
            (
                "[0.4, 0.62, 0.38]",
                "[0.4, 0.12, 0.38]",
                "rear.trailing_arm.outer_bushing_m",
                "swap both points",
            ),
            (
                "upper_arm_mass_kg = 0.0",
                "upper_arm_mass_kg = 1.0",
                "rear.unsprung.upper_arm_mass_kg",
                "no upper arm",
            ),
            (
                "droop_stop_length_m = 0.",
                "droop_stop_length_m = 1.9 # 0.",
                "rear.strut.droop_stop_length_m",
                "does not reach: strut length = ",
            ),
        ] {
            let (found, message) = at_rear(text, from, to);
            assert_eq!(found, field, "{message}");
            assert!(message.contains(part), "{message}");
        }
        let arm =
            &text[text.find("[rear.trailing_arm]").unwrap()..text.find("[rear.tyre]").unwrap()];
        let steered = format!("{text}\n{}", arm.replace("[rear.", "[front."));
        let errors = errors_of(&steered).unwrap_err();
        assert!(fields(&errors).contains(&"front.trailing_arm"), "{errors}");
    }

    #[test]
    fn points_of_a_live_axle_must_fit_the_axle() {
        let text = Vehicle::builtin_text("second-vehicle").unwrap();
        let of_rear = |from: &str, to: &str| at_rear(text, from, to);
        let (field, message) = of_rear("[0.05, 0.5, 0.272]", "[0.05, -0.5, 0.272]");
        assert_eq!(field, "rear.live_axle.lower_link_axle_m");
        assert!(message.contains("right-hand side"), "{message}");
        let (field, message) = of_rear("section_y_m = 0.585", "section_y_m = 0.785");
        assert_eq!(field, "rear.live_axle.section_y_m");
        assert!(message.contains("0.73"), "{message}");
        let (field, message) = of_rear("damping_n_s_m = 2400.0", "damping_n_s_m = 1400.0");
        assert_eq!(field, "rear.strut.rebound_damping_n_s_m");
        assert!(message.contains("mean"), "{message}");
        let (field, _) = of_rear("section_y_m = 0.585\n", "");
        assert_eq!(field, "rear.live_axle.end_mass_kg rear.live_axle.end_cg_m");
        let (field, message) = of_rear("lower_arm_mass_kg = 0.0", "lower_arm_mass_kg = 4.0");
        assert_eq!(field, "rear.unsprung.lower_arm_mass_kg");
        assert!(message.contains("upright_mass_kg"), "{message}");
        let live = &text[text.find("[rear.live_axle]").unwrap()..text.find("[rear.tyre]").unwrap()];
        let steered = format!("{text}\n{}", live.replace("[rear.", "[front."));
        let errors = errors_of(&steered).unwrap_err();
        assert!(fields(&errors).contains(&"front.live_axle"), "{errors}");
        assert!(errors.to_string().contains("no model"), "{errors}");
    }

    #[test]
    fn points_of_leaf_springs_must_fit_the_axle() {
        let second = Vehicle::builtin_text("second-vehicle").unwrap();
        let (start, end) = (
            second.find("[rear.live_axle]").unwrap(),
            second.find("[rear.tyre]").unwrap(),
        );
        let leaf = include_str!("../../../../testdata/leaf-axle.toml");
        let sources = second[end..].replace("rear.live_axle", "rear.leaf_axle");
        let text = format!("{}{leaf}\n{sources}", &second[..start]);
        assert!(errors_of(&text).is_ok());
        for (from, to, field) in [
            ("seat_m = [0.0, 0.46", "seat_m = [0.0, -0.46", "seat_m"),
            ("0.455, 0.705]", "0.455, 0.405]", "spring_body_m"),
            ("section_y_m = 0.585", "section_y_m = 0.785", "section_y_m"),
            ("eye_body_m", "radius_part = 2.0\neye_body_m", "radius_part"),
        ] {
            let errors = errors_of(&text.replace(from, to)).unwrap_err();
            assert_eq!(fields(&errors), [format!("rear.leaf_axle.{field}")]);
        }
        let both = format!("{text}\n{}", &second[start..end]);
        assert_eq!(fields(&errors_of(&both).unwrap_err()), ["rear.leaf_axle"]);
    }

    #[test]
    fn a_sprung_part_must_fit_the_whole() {
        let sprung = |x: f64| {
            errors_of(&Vehicle::builtin_text("prowler").unwrap().replace(
                "[front]",
                &format!(
                    "[body.sprung]\nmass_kg = 540.0\ncg_m = [{x}, 0.0, 0.63]\n\
                     inertia_kg_m2 = [174.0, 377.0, 369.0]\n\n[front]"
                ),
            ))
        };
        assert!(sprung(-0.02).is_ok());
        let errors = sprung(-0.9).unwrap_err();
        assert_eq!(fields(&errors), ["body.sprung.cg_m"]);
    }

    #[test]
    fn non_finite_numbers_and_broken_toml_are_refused() {
        let infinite = errors(|text| text.replace("644.0", "inf"));
        assert_eq!(fields(&infinite), ["body.mass_kg"]);
        let broken = errors(|text| text.replace("[body]", "[body"));
        assert_eq!(broken.problems[0].line, 4);
        assert_eq!(broken.problems[0].field, "syntax");
    }
}
