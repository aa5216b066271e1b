//! The wheels of a truth file on their ground.

use nalgebra::Vector3;
use sample::{ForceFrame, Wheel, WheelAxes};

use crate::motion::{spindle, spindle_on_ground, unit};
use crate::{TruthState, WheelGround};

/// Tells a state where its wheels stand, as far as the columns of its row go (`NaN`: no such column).
///
/// Without a normal of the ground, the ground is level. A force in vehicle axes that is missing is
/// that of the contact frame or of the wheel-carrier frame, and a contact force that is missing follows
/// from it. A wheel whose spindle is not told stays untold.
pub(super) fn tell(state: &mut TruthState, get: impl Fn(&str) -> f64) {
    let up = state.up_body().into();
    let earth_from_body = state.earth_from_body();
    for wheel in Wheel::ALL {
        let one = |name: &str| {
            let value = get(&format!("{}_{name}", wheel.abbreviation()));
            value.is_finite().then_some(value)
        };
        let three = |stem: &str, unit: &str| -> Option<[f64; 3]> {
            let axis = |axis: &str| one(&format!("{stem}_{axis}[{unit}]"));
            Some([axis("x")?, axis("y")?, axis("z")?])
        };
        // A wheel in the air may have no normal.
        let is_normal = |n: &[f64; 3]| n.iter().map(|part| part * part).sum::<f64>() > 0.25;
        let normal_body = three("n_chassis", "-").filter(is_normal).map_or(up, unit);
        let spindle_body = || {
            let steer_rad = one("steer[rad]")?;
            match one("incl_body[rad]") {
                Some(elevation_rad) => Some(spindle(steer_rad, elevation_rad)),
                None => {
                    let camber_rad = one("camber[rad]")?;
                    Some(spindle_on_ground(steer_rad, camber_rad, normal_body))
                }
            }
        };
        let Some(spindle_body) = spindle_body() else {
            continue;
        };
        let truth = &mut state.wheels[wheel];
        let axes = |frame| WheelAxes::of(frame, spindle_body, normal_body);
        let (contact, carrier) = (axes(ForceFrame::Contact), axes(ForceFrame::WheelCarrier));
        let force_body_n = three("Fchassis", "N")
            .or_else(|| Some(carrier.to_body(three("Fcar", "N")?)))
            .unwrap_or_else(|| contact.to_body(truth.force_n));
        let contact_n = contact.resolve(force_body_n);
        for (force_n, derived_n) in truth.force_n.iter_mut().zip(contact_n) {
            if force_n.is_nan() {
                *force_n = derived_n;
            }
        }
        let about_contact = || {
            let arm_m = Vector3::from(three("cp", "m")?) - Vector3::from(three("wc", "m")?);
            let known = truth.moment_n_m.iter().all(|m| m.is_finite());
            let own = Vector3::from(contact.to_body(truth.moment_n_m));
            known.then(|| (own + arm_m.cross(&Vector3::from(force_body_n))).into())
        };
        truth.ground = Some(WheelGround {
            normal_body,
            force_body_n,
            moment_body_n_m: three("Mchassis", "Nm")
                .or_else(|| Some(carrier.to_body(three("Mcar", "Nm")?)))
                .or_else(about_contact),
            spindle_body,
            centre_acceleration_m_s2: three("wcw_a", "m/s2")
                .map(|earth| (earth_from_body.inverse() * Vector3::from(earth)).into())
                .or_else(|| three("wc_acc", "m/s2")),
            unsprung_inertia_n: three("ma_hub", "N"),
            ground_height_m: one("ground_z[m]"),
        });
    }
}
