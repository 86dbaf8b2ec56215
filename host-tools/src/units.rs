//! Millimetres, micrometres and degrees: the only place where they become metres and radians.

use std::f64::consts::PI;

/// What a number measures, as far as its unit may be written in a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// m, or `_mm`, `_um`.
    Length,
    /// rad, or `_deg`.
    Angle,
    /// Anything else; no suffix.
    Other,
}

/// Unit written at the end of a column or key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Suffix {
    /// `"_mm"`.
    pub(crate) text: &'static str,
    /// What it measures.
    pub(crate) quantity: Quantity,
    /// Times this gives m or rad.
    pub(crate) factor: f64,
}

const SUFFIXES: [Suffix; 3] = [
    Suffix {
        text: "_mm",
        quantity: Quantity::Length,
        factor: 1e-3,
    },
    Suffix {
        text: "_um",
        quantity: Quantity::Length,
        factor: 1e-6,
    },
    Suffix {
        text: "_deg",
        quantity: Quantity::Angle,
        factor: PI / 180.0,
    },
];

/// `"x_mm"` is `"x"` in millimetres; `"x"` has no suffix.
pub(crate) fn split_suffix(name: &str) -> (&str, Option<Suffix>) {
    for suffix in SUFFIXES {
        if let Some(base) = name.strip_suffix(suffix.text)
            && !base.is_empty()
        {
            return (base, Some(suffix));
        }
    }
    (name, None)
}

impl Quantity {
    /// The suffixes that a name of this quantity may carry.
    pub(crate) fn suffixes(self) -> impl Iterator<Item = Suffix> {
        SUFFIXES.into_iter().filter(move |s| s.quantity == self)
    }

    /// SI unit, empty for a plain number.
    pub(crate) fn unit(self) -> &'static str {
        match self {
            Self::Length => "m",
            Self::Angle => "rad",
            Self::Other => "",
        }
    }
}
