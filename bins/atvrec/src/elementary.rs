//! Sine, exponential and their kin, the same to the last bit on every processor.
//!
//! The C library chooses among variants of these functions by what the processor can do, and the
//! variants differ in the last bit: a log recorded on a small vehicle PC would not replay bit for
//! bit on a newer computer. What Rust's `f64` calls is found by name when the program is linked, so
//! functions of these names here, by the crate `libm`, take the C library's place in the whole
//! program, the crates below it included.

macro_rules! of_one {
    ($($name:ident)*) => {
        $(
            #[unsafe(no_mangle)]
            extern "C" fn $name(x: f64) -> f64 {
                libm::$name(x)
            }
        )*
    };
}

macro_rules! of_two {
    ($($name:ident)*) => {
        $(
            #[unsafe(no_mangle)]
            extern "C" fn $name(x: f64, y: f64) -> f64 {
                libm::$name(x, y)
            }
        )*
    };
}

of_one! { acos acosh asin asinh atan atanh cbrt cos cosh exp exp2 expm1 log log10 log1p log2 sin sinh tan tanh }
of_two! { atan2 hypot pow }

/// What the compiler makes of a sine and a cosine of one angle.
#[unsafe(no_mangle)]
extern "C" fn sincos(x: f64, sine: &mut f64, cosine: &mut f64) {
    (*sine, *cosine) = libm::sincos(x);
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;

    #[test]
    fn the_program_calls_these() {
        for step in 1..2000 {
            let x = black_box(f64::from(step) * 0.0137);
            let part = black_box(f64::from(step) / 2001.0);
            let pairs = [
                (x.sin_cos().0, libm::sin(x)),
                (x.sin_cos().1, libm::cos(x)),
                (x.tan(), libm::tan(x)),
                (x.atan2(1.7), libm::atan2(x, 1.7)),
                (x.tanh(), libm::tanh(x)),
                (x.exp(), libm::exp(x)),
                (x.exp_m1(), libm::expm1(x)),
                (x.ln(), libm::log(x)),
                (x.log10(), libm::log10(x)),
                (x.powf(1.37), libm::pow(x, 1.37)),
                (x.hypot(0.3), libm::hypot(x, 0.3)),
                (part.asin(), libm::asin(part)),
                (part.acos(), libm::acos(part)),
                (part.atan(), libm::atan(part)),
            ];
            for (number, (called, own)) in pairs.into_iter().enumerate() {
                assert_eq!(called.to_bits(), own.to_bits(), "function {number} of {x}");
            }
        }
    }
}
