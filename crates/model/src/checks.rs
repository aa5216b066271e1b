//! Checks of what a step is given.

use crate::Error;
use crate::error::require;

/// Where a number must lie; what is not finite lies nowhere.
pub(crate) struct Range {
    least: f64,
    expected: &'static str,
}

pub(crate) const FINITE: Range = Range {
    least: f64::MIN,
    expected: "finite",
};
pub(crate) const NOT_NEGATIVE: Range = Range {
    least: 0.0,
    expected: "0 or greater",
};

impl Range {
    #[inline]
    fn contains(&self, value: f64) -> bool {
        (value >= self.least) & (value <= f64::MAX)
    }

    /// Whether all of a field's numbers lie in it: without a branch for each, since they mostly do.
    #[inline]
    pub(crate) fn holds(&self, field: &impl Numbers) -> bool {
        let mut holds = true;
        for value in field.numbers() {
            holds &= self.contains(*value);
        }
        holds
    }

    /// Refuses a field by the first of its numbers that does not lie in it.
    pub(crate) fn require(
        &self,
        argument: &'static str,
        field: &impl Numbers,
        unit: &'static str,
    ) -> Result<(), Error> {
        field.numbers().iter().try_for_each(|value| {
            let holds = self.contains(*value);
            require(holds, argument, *value, unit, self.expected)
        })
    }
}

/// A number, or a list.
pub(crate) trait Numbers {
    fn numbers(&self) -> &[f64];
}

impl Numbers for f64 {
    #[inline]
    fn numbers(&self) -> &[f64] {
        std::slice::from_ref(self)
    }
}

impl<const N: usize> Numbers for [f64; N] {
    #[inline]
    fn numbers(&self) -> &[f64] {
        self
    }
}

/// `check` of a chassis' states or inputs, from each field's unit and range.
macro_rules! checked {
    ($type:ident, $prefix:literal, $($field:ident: $unit:literal $range:ident),*) => {
        impl $type<f64> {
            /// Refuses numbers that are not finite or out of range, by name.
            ///
            /// # Errors
            /// [`Error::Argument`](crate::Error::Argument) with the first of them.
            #[inline]
            pub fn check(&self) -> Result<(), crate::Error> {
                if $(crate::checks::$range.holds(&self.$field))&* {
                    return Ok(());
                }
                self.name_unsound()
            }

            #[cold]
            fn name_unsound(&self) -> Result<(), crate::Error> {
                $(crate::checks::$range.require(
                    concat!($prefix, ".", stringify!($field)),
                    &self.$field,
                    $unit,
                )?;)*
                Ok(())
            }
        }
    };
}

/// [`checked`] of a chassis' inputs: what both have, and what it has more.
macro_rules! checked_inputs {
    ($($field:ident: $unit:literal $range:ident),*) => {
        crate::checks::checked!(
            Inputs, "inputs",
            steer_rad: "rad" FINITE,
            drive_n_m: "N m" FINITE,
            brake_n_m: "N m" NOT_NEGATIVE,
            bank_rad: "rad" FINITE,
            grade_rad: "rad" FINITE,
            friction_scale: "" NOT_NEGATIVE,
            stiffness_scale: "" NOT_NEGATIVE
            $(, $field: $unit $range)*
        );
    };
}

pub(crate) use {checked, checked_inputs};

#[cfg(test)]
mod tests {
    use crate::Error;
    use crate::chassis::{four_wheel, fourteen_dof};

    /// Each number in turn is made bad, and the check must name its field and value.
    fn each_bad_number_is_named<const N: usize>(
        what: &str,
        good: [f64; N],
        check: impl Fn(&[f64; N]) -> Result<(), Error>,
    ) -> Vec<&'static str> {
        check(&good).unwrap();
        let mut never_negative = Vec::new();
        for index in 0..N {
            let refusal = |value: f64| {
                let mut numbers = good;
                numbers[index] = value;
                let refused = check(&numbers).err();
                refused.map(|error| match error {
                    Error::Argument {
                        argument,
                        value: told,
                        ..
                    } => {
                        assert!(argument.starts_with(what), "{argument}");
                        assert_eq!(told.to_bits(), value.to_bits(), "{argument}");
                        argument
                    }
                    other => panic!("{other}"),
                })
            };
            let name = refusal(f64::NAN).expect("no number is not a number");
            assert_eq!(refusal(f64::INFINITY), Some(name));
            assert_eq!(refusal(f64::NEG_INFINITY), Some(name));
            for fine in [0.0, -0.0, f64::MAX, f64::MIN_POSITIVE] {
                assert_eq!(refusal(fine), None, "{name} = {fine}");
            }
            if let Some(named) = refusal(-1e-9) {
                assert_eq!(named, name);
                assert_eq!(refusal(f64::MIN), Some(name));
                if never_negative.last() != Some(&name) {
                    never_negative.push(name);
                }
            } else {
                assert_eq!(refusal(f64::MIN), None, "{name}");
            }
        }
        never_negative
    }

    #[test]
    fn every_bad_number_of_every_field_is_refused_and_named() {
        let never = [
            "inputs.brake_n_m",
            "inputs.friction_scale",
            "inputs.stiffness_scale",
        ];
        let planar = four_wheel::Inputs::coasting().to_array();
        let found = each_bad_number_is_named("inputs.", planar, |numbers| {
            four_wheel::Inputs::from_array(numbers).check()
        });
        assert_eq!(found, never);
        let spatial = fourteen_dof::Inputs::coasting().to_array();
        let found = each_bad_number_is_named("inputs.", spatial, |numbers| {
            fourteen_dof::Inputs::from_array(numbers).check()
        });
        assert_eq!(found, never);
        let found = each_bad_number_is_named("state.", [0.5; four_wheel::STATES], |numbers| {
            four_wheel::State::from_array(*numbers).check()
        });
        assert!(found.is_empty(), "{found:?}");
        let found = each_bad_number_is_named("state.", [0.5; fourteen_dof::STATES], |numbers| {
            fourteen_dof::State::from_array(*numbers).check()
        });
        assert!(found.is_empty(), "{found:?}");
    }
}
