use super::*;
use crate::convert::estimate::ground_from_proto;
use crate::convert::road::{friction_from_proto, road_from_proto};

fn entry(axle: u32, side: &str, base: f64) -> pb::TyreForce {
    let side = side.to_owned();
    pb::TyreForce {
        axle,
        side,
        x_n: base,
        z_n: base + 2.0,
        x_sigma_n: f64::NAN,
        z_sigma_n: -0.5,
        moment_x_n_m: Some(0.0),
        moment_z_sigma_n_m: Some(base),
        source: pb::ForceSource::Fusion.into(),
        ..pb::TyreForce::default()
    }
}

/// The forces of a message, whose memory had others before.
fn forces(data: &[u8]) -> Option<(ForceFrame, PerWheel<TyreForce>)> {
    let mut found = PerWheel(
        [TyreForce {
            force_n: [7.0; 3],
            ..TyreForce::default()
        }; 4],
    );
    let frame = direct_forces(data, &mut found)?;
    Some((frame, found))
}

fn motion(data: &[u8]) -> Option<Motion> {
    let mut found = Motion::UNKNOWN;
    direct_motion(data, &mut found).map(|()| found)
}

fn same_forces(data: &[u8]) -> bool {
    let decoded = pb::TyreForces::decode(data).map(|message| forces_from_proto(&message));
    match (forces(data), decoded) {
        (None, _) => false,
        (found, decoded) => format!("{found:?}") == format!("{:?}", decoded.ok()),
    }
}

#[test]
fn forces_are_those_of_the_generated_type() {
    let mut message = pb::TyreForces {
        frame: pb::ForceFrame::WheelCarrier.into(),
        wheels: [(1, "left"), (1, "right"), (2, "left"), (2, "right")]
            .into_iter()
            .zip([1.0, 1e300, -3.0, 4.5])
            .map(|((axle, side), base)| entry(axle, side, base))
            .collect(),
    };
    let whole = message.encode_to_vec();
    assert!(same_forces(&whole) && same_forces(&[]));
    for end in 0..whole.len() {
        // A cut message has fewer entries, or is none.
        let cut = &whole[..end];
        let is_whole = pb::TyreForces::decode(cut).is_ok();
        assert_eq!(forces(cut).is_some(), is_whole, "{end}");
        assert!(!is_whole || same_forces(cut), "{end}");
    }
    message.wheels.push(entry(3, "left", 1.0));
    assert!(forces(&message.encode_to_vec()).is_none());
    // Another order, and a wheel that is there twice.
    message.wheels = [(2, "right"), (1, "left"), (1, "left")]
        .map(|(axle, side)| entry(axle, side, 5.0))
        .into();
    let other = message.encode_to_vec();
    assert!(forces(&other).is_none());
    let mut found = PerWheel::default();
    let frame = super::forces(&other, &mut found).unwrap();
    let decoded = forces_from_proto(&message);
    assert_eq!(format!("{:?}", (frame, found)), format!("{decoded:?}"));
}

#[test]
fn a_motion_is_that_of_the_generated_type() {
    let wheel = |axle, side: &str, slip| pb::WheelMotion {
        axle,
        side: side.to_owned(),
        steer_rad: 0.25,
        longitudinal_slip: slip,
        ..pb::WheelMotion::default()
    };
    let message = pb::Motion {
        velocity_x_m_s: 12.5,
        yaw_rate_rad_s: f64::NAN,
        acceleration_m_s2: Some(pb::Vector3 {
            y: 4.0,
            ..pb::Vector3::default()
        }),
        wheels: vec![wheel(1, "right", Some(0.0)), wheel(2, "left", None)],
        grade_rad: -0.125,
        ..pb::Motion::default()
    };
    let whole = message.encode_to_vec();
    for end in 0..=whole.len() {
        let cut = &whole[..end];
        let decoded = pb::Motion::decode(cut).map(|message| motion_from_proto(&message));
        assert_eq!(format!("{:?}", motion(cut)), format!("{:?}", decoded.ok()));
    }
}

#[test]
fn friction_is_that_of_the_generated_type() {
    let wheel = |axle, side: &str, coefficient| pb::WheelFriction {
        axle,
        side: side.to_owned(),
        coefficient,
    };
    let mut message = pb::Friction {
        wheels: vec![wheel(2, "right", 0.85), wheel(1, "left", 0.0)],
    };
    let whole = message.encode_to_vec();
    assert!(friction(&whole).is_some() && friction(&[]).is_some());
    for end in 0..=whole.len() {
        let cut = &whole[..end];
        let decoded = pb::Friction::decode(cut);
        let decoded = decoded.map(|message| friction_from_proto(&message));
        if let Some(found) = friction(cut) {
            assert_eq!(format!("{:?}", Ok::<_, ()>(found)), format!("{decoded:?}"));
        }
    }
    message.wheels.push(wheel(3, "left", 1.0));
    assert!(friction(&message.encode_to_vec()).is_none());
}

#[test]
fn a_road_and_a_ground_are_those_of_the_generated_types() {
    let side = |left| if left { "left" } else { "right" }.to_owned();
    let road = pb::Road {
        unknown: pb::RoadUnknown::Slow.into(),
        wheels: [(1, true), (2, false)]
            .map(|(axle, left)| pb::WheelRoad {
                axle,
                side: side(left),
                height_m: f64::from(axle) - 1.0,
                height_sigma_m: 0.25,
            })
            .into(),
        grade_rad: Some(0.0),
        warp_sigma_m: Some(2.0),
        roughness: Some(pb::RoadRoughness {
            class: "B".to_owned(),
            gd_n0_low_m3: 1e-6,
            distance_m: 80.0,
            ..pb::RoadRoughness::default()
        }),
        iri_right_m_km: Some(3.5),
        ..pb::Road::default()
    };
    let vector = |x| Some(pb::Vector3 { x, y: 0.0, z: 1.0 });
    let ground = pb::Ground {
        wheels: vec![pb::WheelGround {
            axle: 2,
            side: side(true),
            normal: vector(0.5),
            unsprung_inertia_n: vector(f64::NAN),
            ground_height_m: Some(0.0),
            strut_length_m: Some(0.35),
            ..pb::WheelGround::default()
        }],
        road_class: Some("C".to_owned()),
    };
    let time = LogTime(7);
    let [road, ground] = [road.encode_to_vec(), ground.encode_to_vec()];
    for end in 0..=road.len() {
        let decoded = pb::Road::decode(&road[..end]).map(|road| road_from_proto(time, &road));
        let found = super::road(time, &road[..end]);
        assert_eq!(format!("{found:?}"), format!("{:?}", decoded.ok()));
    }
    for end in 0..=ground.len() {
        let decoded = pb::Ground::decode(&ground[..end]).map(ground_from_proto);
        let found = super::ground(&ground[..end]);
        assert_eq!(format!("{found:?}"), format!("{:?}", decoded.ok()));
    }
}
