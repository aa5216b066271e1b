//! The tyres as the loop between loads and forces asks them: at the slips of one instant, for their
//! forces at one load after another.

use super::dynamics::{Constants, Wheels};
use super::{Inputs, Parameters};
use crate::scalar::each;
use crate::tyre::{Brush, Contact, OnSurface, Slipping};
use crate::values::PerWheelValues;

/// The four tyres' forces.
#[derive(Clone, Copy)]
pub(super) struct Forces<V> {
    /// Longitudinal and lateral force and aligning moment in the wheel's frame, N and N m.
    pub wheel: [V; 3],
    /// Force ahead and to the left, and moment about the centre of gravity, body axes, N and N m.
    pub body: [V; 3],
}

/// Tyres at given slips.
pub(super) trait Contacts<V> {
    /// Forces of the tyres.
    fn forces(&self, load_n: V) -> Forces<V>;
}

/// Forces in the wheels' frames turned into body axes, with their moments about the centre of
/// gravity.
#[inline(always)]
fn body<V: PerWheelValues>(
    constants: &Constants,
    wheels: &Wheels<V>,
    along: V,
    across: V,
) -> [V; 3] {
    let (sin, cos) = (wheels.sin, wheels.cos);
    let ahead = along * cos - across * sin;
    let left = along * sin + across * cos;
    let turning = left.times(constants.ahead) - ahead.times(constants.left);
    [ahead, left, turning]
}

/// Tyres of any kind, through [`Tyre::forces`](crate::tyre::Tyre::forces).
pub(super) struct AnyContacts<'a, V: PerWheelValues> {
    parameters: &'a Parameters,
    constants: &'a Constants,
    inputs: &'a Inputs<V::Number>,
    wheels: Wheels<V>,
}

impl<'a, V: PerWheelValues> AnyContacts<'a, V> {
    pub(super) fn new(
        parameters: &'a Parameters,
        constants: &'a Constants,
        inputs: &'a Inputs<V::Number>,
        wheels: &Wheels<V>,
    ) -> Self {
        Self {
            parameters,
            constants,
            inputs,
            wheels: *wheels,
        }
    }
}

impl<V: PerWheelValues> Contacts<V> for AnyContacts<'_, V> {
    #[inline]
    fn forces(&self, load_n: V) -> Forces<V> {
        let load_n = load_n.list();
        let (tangent, ratio) = (self.wheels.tangent.list(), self.wheels.ratio.list());
        let forces = each(|i| {
            self.parameters.axle(i).tyre.forces(&Contact {
                load_n: load_n[i],
                slip_tangent: tangent[i],
                slip_ratio: ratio[i],
                camber_rad: V::Number::from(0.0),
                friction_scale: self.inputs.friction_scale[i],
                stiffness_scale: self.inputs.stiffness_scale[i],
            })
        });
        let along = V::of(each(|i| forces[i].longitudinal_n));
        let across = V::of(each(|i| forces[i].lateral_n));
        let aligning = V::of(each(|i| forces[i].aligning_n_m));
        let [ahead, left, turning] = body(self.constants, &self.wheels, along, across);
        Forces {
            wheel: [along, across, aligning],
            body: [ahead, left, turning + aligning],
        }
    }
}

/// Brush tyres under the inputs of one step.
#[derive(Clone, Copy)]
pub(super) struct BrushTyres<V: PerWheelValues> {
    brush: Brush<[f64; 4]>,
    surface: OnSurface<V>,
}

impl<V: PerWheelValues> BrushTyres<V> {
    #[inline(always)]
    pub(super) fn new(brush: Brush<[f64; 4]>, inputs: &Inputs<V::Number>) -> Self {
        let friction = V::of(inputs.friction_scale);
        let surface = brush.on_surface(friction, V::of(inputs.stiffness_scale));
        Self { brush, surface }
    }

    /// The same tyres on a surface that is known.
    #[inline(always)]
    pub(super) fn on(brush: Brush<[f64; 4]>, surface: OnSurface<V>) -> Self {
        Self { brush, surface }
    }

    /// Surface under the wheels.
    #[inline(always)]
    pub(super) fn surface(&self) -> &OnSurface<V> {
        &self.surface
    }

    /// At the slips of one instant.
    #[inline(always)]
    pub(super) fn at<const GROWS: bool>(
        &self,
        constants: &Constants,
        wheels: &Wheels<V>,
    ) -> BrushContacts<V, GROWS> {
        let slipping = self
            .brush
            .slipping(&self.surface, wheels.tangent, wheels.ratio);
        BrushContacts {
            brush: self.brush,
            directions: body(constants, wheels, slipping.along, slipping.across),
            slipping,
        }
    }
}

/// Brush tyres at the slips of one instant: their forces keep their directions at every load.
pub(super) struct BrushContacts<V, const GROWS: bool> {
    brush: Brush<[f64; 4]>,
    slipping: Slipping<V>,
    /// C_0 s in body axes with its moment about the centre of gravity, N and N m.
    directions: [V; 3],
}

impl<V: PerWheelValues, const GROWS: bool> Contacts<V> for BrushContacts<V, GROWS> {
    #[inline(always)]
    fn forces(&self, load_n: V) -> Forces<V> {
        let slip = &self.slipping;
        let pull = self.brush.pull::<V, GROWS>(slip, load_n);
        let [ahead, left, turning] = self.directions;
        Forces {
            wheel: [slip.along * pull, slip.across * pull, V::constant(0.0)],
            body: [ahead * pull, left * pull, turning * pull],
        }
    }
}
