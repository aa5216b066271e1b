//! The steepest grade that the driven wheels climb.

use model::vehicle::Vehicle;

/// Geometry of a vehicle that climbs.
///
/// On a grade of the tangent p the axles carry, as parts of the force along the normal, (b - h p)/l in front and
/// (a + h p)/l in the rear. The front wheels drive with the part d of p. They slide at d p = mu_f (b - h p)/l, the rear
/// wheels at (1 - d) p = mu_r (a + h p)/l, and the front wheels lift at p = b/h.
#[derive(Clone, Copy, Debug)]
pub(super) struct Climb {
    arms_m: [f64; 2],
    height_m: f64,
    drive_split_front: f64,
}

impl Climb {
    pub fn new(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        Self {
            arms_m: [body.front_axle_to_cg_m, body.cg_to_rear_axle_m],
            height_m: body.cg_height_m,
            drive_split_front: vehicle.drivetrain.drive_split_front,
        }
    }

    /// The grade with the friction of both axles, and with the height of the centre of gravity as a part of the
    /// vehicle file's, rad; `NaN` where the friction of a driven axle is.
    pub fn steepest_rad(&self, friction: [f64; 2], height_part: f64) -> f64 {
        let [a, b] = self.arms_m;
        let (h, l, d) = (self.height_m * height_part, a + b, self.drive_split_front);
        let mut steepest = b / h;
        if d > 0.0 {
            let slides = friction[0] * b / (d * l + friction[0] * h);
            steepest = if slides > steepest { steepest } else { slides };
        }
        if d < 1.0 {
            let apart = (1.0 - d) * l - friction[1] * h;
            // The steeper, the more load: such an axle does not slide before the front wheels lift.
            if apart > 0.0 || apart.is_nan() {
                let slides = friction[1] * a / apart;
                steepest = if slides > steepest { steepest } else { slides };
            }
        }
        math::atan(steepest)
    }
}
