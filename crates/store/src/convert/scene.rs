//! Scenes as `foxglove.SceneUpdate`.

use super::timestamp;
use crate::proto::foxglove;
use crate::{Form, Scene, SceneEntity, Shape};
use sample::LogTime;

/// Part of an arrow's length that is its head, and the head's diameter over the shaft's.
const HEAD_PART: f64 = 0.2;
const HEAD_WIDTH: f64 = 2.2;

pub(super) fn to_proto(scene: &Scene) -> foxglove::SceneUpdate {
    foxglove::SceneUpdate {
        deletions: Vec::new(),
        entities: scene
            .entities
            .iter()
            .map(|entity| entity_to_proto(scene.time, entity))
            .collect(),
    }
}

fn entity_to_proto(time: LogTime, entity: &SceneEntity) -> foxglove::SceneEntity {
    let mut message = foxglove::SceneEntity {
        timestamp: Some(timestamp(time)),
        frame_id: entity.frame.clone(),
        id: entity.id.clone(),
        frame_locked: true,
        ..foxglove::SceneEntity::default()
    };
    for shape in &entity.shapes {
        add(&mut message, shape);
    }
    message
}

fn add(message: &mut foxglove::SceneEntity, shape: &Shape) {
    let [x, y, z, w] = shape.rotation_xyzw;
    let pose = Some(foxglove::Pose {
        position: Some(vector(shape.position_m)),
        orientation: Some(foxglove::Quaternion { x, y, z, w }),
    });
    let [r, g, b, a] = shape.colour_rgba;
    let color = Some(foxglove::Color { r, g, b, a });
    match &shape.form {
        Form::Arrow {
            length_m,
            diameter_m,
        } => message.arrows.push(foxglove::ArrowPrimitive {
            pose,
            shaft_length: (1.0 - HEAD_PART) * length_m,
            shaft_diameter: *diameter_m,
            head_length: HEAD_PART * length_m,
            head_diameter: HEAD_WIDTH * diameter_m,
            color,
        }),
        Form::Box { size_m } => message.cubes.push(foxglove::CubePrimitive {
            pose,
            size: Some(vector(*size_m)),
            color,
        }),
        Form::Cylinder { size_m } => message.cylinders.push(foxglove::CylinderPrimitive {
            pose,
            size: Some(vector(*size_m)),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color,
        }),
        Form::Ellipsoid { size_m } => message.spheres.push(foxglove::SpherePrimitive {
            pose,
            size: Some(vector(*size_m)),
            color,
        }),
        Form::Line {
            points_m,
            thickness_px,
        } => message.lines.push(foxglove::LinePrimitive {
            r#type: foxglove::line_primitive::Type::LineStrip.into(),
            pose,
            thickness: *thickness_px,
            scale_invariant: true,
            points: points_m
                .iter()
                .map(|[x, y, z]| foxglove::Point3 {
                    x: *x,
                    y: *y,
                    z: *z,
                })
                .collect(),
            color,
            ..foxglove::LinePrimitive::default()
        }),
    }
}

fn vector([x, y, z]: [f64; 3]) -> foxglove::Vector3 {
    foxglove::Vector3 { x, y, z }
}
