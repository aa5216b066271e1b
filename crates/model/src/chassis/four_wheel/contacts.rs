//! The tyres as the loop between loads and forces asks them: at the slips of one instant, for their
//! forces at one load after another.

use super::dynamics::{Constants, Wheels};
use super::{Inputs, Parameters};
use crate::Scalar;
use crate::scalar::each;
use crate::tyre::{Brush, Contact, OnSurface, Slipping};

/// One tyre's force.
#[derive(Clone, Copy)]
pub(super) struct Force<T> {
    /// Longitudinal and lateral force and aligning moment in the wheel's frame, N and N m.
    pub wheel: [T; 3],
    /// Force ahead and to the left, and moment about the centre of gravity, body axes, N and N m.
    pub body: [T; 3],
}

/// Tyres at given slips.
pub(super) trait Contacts<T> {
    /// Force of a wheel's tyre.
    fn force(&self, wheel: usize, load_n: T) -> Force<T>;
}

/// A force in the wheel's frame turned into body axes, with its moment about the centre of gravity.
#[inline(always)]
fn body<T: Scalar>(
    constants: &Constants,
    wheels: &Wheels<T>,
    i: usize,
    along: T,
    across: T,
) -> [T; 3] {
    let (ahead_m, left_m) = (constants.ahead[i], constants.left[i]);
    let (sin, cos) = (wheels.sin[i], wheels.cos[i]);
    let ahead = along * cos - across * sin;
    let left = along * sin + across * cos;
    [ahead, left, left * ahead_m - ahead * left_m]
}

/// Tyres of any kind, through [`Tyre::forces`](crate::tyre::Tyre::forces).
pub(super) struct AnyContacts<'a, T> {
    parameters: &'a Parameters,
    constants: &'a Constants,
    inputs: &'a Inputs<T>,
    wheels: Wheels<T>,
}

impl<'a, T: Scalar> AnyContacts<'a, T> {
    pub(super) fn new(
        parameters: &'a Parameters,
        constants: &'a Constants,
        inputs: &'a Inputs<T>,
        wheels: &Wheels<T>,
    ) -> Self {
        Self {
            parameters,
            constants,
            inputs,
            wheels: *wheels,
        }
    }
}

impl<T: Scalar> Contacts<T> for AnyContacts<'_, T> {
    #[inline]
    fn force(&self, wheel: usize, load_n: T) -> Force<T> {
        let forces = self.parameters.axle(wheel).tyre.forces(&Contact {
            load_n,
            slip_tangent: self.wheels.tangent[wheel],
            slip_ratio: self.wheels.ratio[wheel],
            camber_rad: T::from(0.0),
            friction_scale: self.inputs.friction_scale[wheel],
            stiffness_scale: self.inputs.stiffness_scale[wheel],
        });
        let (along, across) = (forces.longitudinal_n, forces.lateral_n);
        let aligning = forces.aligning_n_m;
        let [ahead, left, turning] = body(self.constants, &self.wheels, wheel, along, across);
        Force {
            wheel: [along, across, aligning],
            body: [ahead, left, turning + aligning],
        }
    }
}

/// Brush tyres under the inputs of one step.
#[derive(Clone, Copy)]
pub(super) struct BrushTyres<T> {
    axles: [Brush; 2],
    surfaces: [OnSurface<T>; 4],
}

impl<T: Scalar> BrushTyres<T> {
    #[inline(always)]
    pub(super) fn new(axles: [Brush; 2], inputs: &Inputs<T>) -> Self {
        let surfaces =
            each(|i| axles[i / 2].on_surface(inputs.friction_scale[i], inputs.stiffness_scale[i]));
        Self { axles, surfaces }
    }

    /// The same tyres on surfaces that are known.
    #[inline(always)]
    pub(super) fn on(axles: [Brush; 2], surfaces: [OnSurface<T>; 4]) -> Self {
        Self { axles, surfaces }
    }

    /// Surfaces under the wheels.
    #[inline(always)]
    pub(super) fn surfaces(&self) -> &[OnSurface<T>; 4] {
        &self.surfaces
    }

    /// At the slips of one instant.
    #[inline(always)]
    pub(super) fn at<const GROWS: bool>(
        &self,
        constants: &Constants,
        wheels: &Wheels<T>,
    ) -> BrushContacts<T, GROWS> {
        let slipping = each(|i| {
            let (tangent, ratio) = (wheels.tangent[i], wheels.ratio[i]);
            self.axles[i / 2].slipping(&self.surfaces[i], tangent, ratio)
        });
        let directions = each(|i| {
            let slip = &slipping[i];
            body(constants, wheels, i, slip.along, slip.across)
        });
        BrushContacts {
            tyres: *self,
            slipping,
            directions,
        }
    }
}

/// Brush tyres at the slips of one instant: their forces keep their directions at every load.
pub(super) struct BrushContacts<T, const GROWS: bool> {
    tyres: BrushTyres<T>,
    slipping: [Slipping<T>; 4],
    /// Body-axes force and moment for each unit of C f.
    directions: [[T; 3]; 4],
}

impl<T: Scalar, const GROWS: bool> Contacts<T> for BrushContacts<T, GROWS> {
    #[inline(always)]
    fn force(&self, wheel: usize, load_n: T) -> Force<T> {
        let slip = &self.slipping[wheel];
        let brush = &self.tyres.axles[wheel / 2];
        let [stiffness, factor] = brush.pull::<T, GROWS>(&self.tyres.surfaces[wheel], slip, load_n);
        let [ahead, left, turning] = self.directions[wheel];
        // The factor comes last: it is what the loop waits for.
        Force {
            wheel: [
                stiffness * slip.along * factor,
                stiffness * slip.across * factor,
                T::from(0.0),
            ],
            body: [
                stiffness * ahead * factor,
                stiffness * left * factor,
                stiffness * turning * factor,
            ],
        }
    }
}
