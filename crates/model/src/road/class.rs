//! Roughness classes of ISO 8608.

/// Reference spatial frequency n_0 of ISO 8608, cycles/m.
const REFERENCE_CYCLES_M: f64 = 0.1;
/// G_d(n_0) of class A, geometric mean, m^3 (ISO 8608, table C.1); each class has four times the
/// one before.
const CLASS_A_M3: f64 = 16e-6;

/// Roughness class of ISO 8608, from very good to unpaved and torn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "the standard's letters")]
pub enum RoadClass {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
    H,
}

impl RoadClass {
    /// All classes.
    pub const ALL: [Self; 8] = [
        Self::A,
        Self::B,
        Self::C,
        Self::D,
        Self::E,
        Self::F,
        Self::G,
        Self::H,
    ];

    /// The class with this letter.
    #[must_use]
    pub fn by_letter(letter: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|class| class.letter().encode_utf8(&mut [0; 4]) == letter)
    }

    /// The standard's letter.
    #[must_use]
    pub const fn letter(self) -> char {
        (b'A' + self as u8) as char
    }

    /// Displacement power spectral density at n_0, one-sided, m^3.
    #[must_use]
    pub fn reference_m3(self) -> f64 {
        CLASS_A_M3 * 4_f64.powi(self as i32)
    }

    /// G_d(n) = G_d(n_0) (n/n_0)^-2 at a spatial frequency, m^3.
    #[must_use]
    pub fn density_m3(self, cycles_m: f64) -> f64 {
        self.reference_m3() * (cycles_m / REFERENCE_CYCLES_M).powi(-2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_rise_by_four() {
        assert!((RoadClass::A.reference_m3() - 16e-6).abs() < 1e-18);
        assert!((RoadClass::E.reference_m3() / RoadClass::D.reference_m3() - 4.0).abs() < 1e-12);
        assert!((RoadClass::C.density_m3(1.0) - 2.56e-6).abs() < 1e-15);
        assert_eq!(RoadClass::by_letter("F"), Some(RoadClass::F));
        assert_eq!(RoadClass::by_letter("I"), None);
        assert_eq!(RoadClass::by_letter("AB"), None);
    }
}
