//! The tyres as the loop between loads and forces asks them: at the slips of one instant, for their
//! forces at one load after another.

use super::constants::Constants;
use super::dynamics::Wheels;
use super::{Inputs, Parameters};
use crate::scalar::each;
use crate::tyre::{Brush, Contact, OnSurface, Slipping};
use crate::values::PerWheelValues;

/// The four tyres' forces.
#[derive(Clone, Copy)]
pub(super) struct Forces<V> {
    /// Longitudinal and lateral force and aligning moment in the wheel's frame, N and N m.
    pub wheel: [V; 3],
    pub effects: Effects<V>,
}

/// What each tyre's force does to the vehicle.
#[derive(Clone, Copy)]
pub(super) struct Effects<V> {
    /// The force ahead and to the left, body axes, N.
    pub ahead: V,
    pub left: V,
    /// What it adds to v' + u r + g sin(bank) and to r'.
    pub felt: V,
    pub yaw: V,
}

impl<V: PerWheelValues> Effects<V> {
    /// Of forces along and across the wheels.
    #[inline(always)]
    fn of(constants: &Constants, wheels: &Wheels<V>, along: V, across: V) -> Self {
        let (sin, cos) = (wheels.sin, wheels.cos);
        let ahead = along * cos - across * sin;
        let left = along * sin + across * cos;
        let ([felt_left, felt_ahead], [yaw_left, yaw_ahead]) = (constants.felt, constants.yaw);
        Self {
            ahead,
            left,
            felt: left.times(felt_left) - ahead.times(felt_ahead),
            yaw: left.times(yaw_left) - ahead.times(yaw_ahead),
        }
    }

    /// Of forces that many times as large.
    #[inline(always)]
    fn times(&self, pull: V) -> Self {
        Self {
            ahead: self.ahead * pull,
            left: self.left * pull,
            felt: self.felt * pull,
            yaw: self.yaw * pull,
        }
    }
}

/// Tyres at given slips.
pub(super) trait Contacts<V> {
    /// Forces of the tyres; none where the load is not above zero.
    fn forces(&self, load_n: V) -> Forces<V>;
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
            let contact = Contact {
                load_n: load_n[i],
                slip_tangent: tangent[i],
                slip_ratio: ratio[i],
                camber_rad: V::Number::from(0.0),
                friction_scale: self.inputs.friction_scale[i],
                stiffness_scale: self.inputs.stiffness_scale[i],
            };
            let tyre = &self.parameters.axle(i).tyre;
            tyre.forces_on(i.is_multiple_of(2), &contact)
        });
        let along = V::of(each(|i| forces[i].longitudinal_n));
        let across = V::of(each(|i| forces[i].lateral_n));
        let aligning = V::of(each(|i| forces[i].aligning_n_m));
        let mut effects = Effects::of(self.constants, &self.wheels, along, across);
        let [to_felt, to_yaw] = self.constants.aligning;
        effects.felt = effects.felt + aligning.scaled(to_felt);
        effects.yaw = effects.yaw + aligning.scaled(to_yaw);
        Forces {
            wheel: [along, across, aligning],
            effects,
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
            effects: Effects::of(constants, wheels, slipping.along, slipping.across),
            slipping,
        }
    }
}

/// Brush tyres at the slips of one instant: their forces keep their directions at every load.
pub(super) struct BrushContacts<V, const GROWS: bool> {
    slipping: Slipping<V>,
    /// Of the forces that [`Slipping::pull`] multiplies.
    effects: Effects<V>,
}

impl<V: PerWheelValues, const GROWS: bool> Contacts<V> for BrushContacts<V, GROWS> {
    #[inline(always)]
    fn forces(&self, load_n: V) -> Forces<V> {
        let slip = &self.slipping;
        let pull = slip.pull::<GROWS>(load_n);
        Forces {
            wheel: [slip.along * pull, slip.across * pull, V::constant(0.0)],
            effects: self.effects.times(pull),
        }
    }
}
