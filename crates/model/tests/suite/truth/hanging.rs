//! Wheels in the air, against the run on jackstands.

use atvrec_model::suspension::Corner;
use nalgebra::Vector3;
use sample::Wheel;
use testkit::truth::vehicle;

use super::run::Run;

const GRAVITY_M_S2: f64 = 9.81;
/// Strut length at rest.
const LENGTH_TOLERANCE_M: f64 = 5e-6;
/// Forces in the links: a hundredth of a count.
const FORCE_TOLERANCE_N: f64 = 0.5;

#[test]
fn hanging_wheels_rest_where_the_simulator_says() {
    let vehicle = vehicle();
    let Some(run) = Run::open("h_jack", 50) else {
        return;
    };
    // Everything has come to rest, and nothing is lowered yet.
    let row = (0..run.rows)
        .find(|row| run.get("t", *row) > 5.5)
        .expect("18 s of data");
    let (roll, pitch) = (run.get("roll", row), run.get("pitch", row));
    let up = Vector3::new(
        -math::sin(pitch),
        math::sin(roll) * math::cos(pitch),
        math::cos(roll) * math::cos(pitch),
    );
    for wheel in Wheel::ALL {
        let get = |name: &str| run.get(&format!("{wheel}_{name}"), row);
        assert_eq!(get("Fz"), 0.0, "{wheel} hangs");
        let axle = vehicle.axle(wheel);
        let corner = Corner::of(vehicle, wheel).expect("hard-points");
        let rest = corner
            .hanging(axle, 0.0, up * GRAVITY_M_S2)
            .expect("rests on the stop");
        let off = rest.pose.strut_length_m - get("spring_len");
        assert!(
            off.abs() < LENGTH_TOLERANCE_M,
            "{wheel}: strut off by {off} m"
        );
        for (name, found, truth) in [
            (
                "upper front",
                rest.members.upper_front_n,
                get("UCA_tubeF_T"),
            ),
            ("upper rear", rest.members.upper_rear_n, get("UCA_tubeB_T")),
            (
                "lower front",
                rest.members.lower_front_n,
                get("LCA_tubeF_T"),
            ),
            ("lower rear", rest.members.lower_rear_n, get("LCA_tubeB_T")),
            ("tie rod", rest.members.tie_rod_n, get("tierod_T")),
            (
                "strut",
                rest.members.sixth_n,
                get("spring_F") + get("shock_F"),
            ),
        ] {
            println!("{wheel} {name}: {found:.3} {truth:.3} N");
            assert!(
                (found - truth).abs() < FORCE_TOLERANCE_N,
                "{wheel} {name}: {found} {truth}"
            );
        }
    }
}
