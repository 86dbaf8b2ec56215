//! How the compensator goes about its work, carried in the blob.

use serde::{Deserialize, Serialize};

use crate::Scalar;

/// Which compensator corrects the commands.
///
/// The variant's position is its number in stored blobs: append, never reorder, never remove.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Method {
    /// Damped inverse Jacobian, iterated. MRD 5.2.1.
    InverseJacobian,
    /// Linear quadratic regulator. MRD 5.3.
    Lqr,
    /// Redefinition of the task point. MRD 5.2.2.
    TaskPoint,
    /// Polynomials of the joints, which have to be taught. MRD 5.4.1.
    Polynomial,
    /// Tables of corrections, which have to be taught. MRD 5.4.2.
    Cmac,
}

impl Method {
    /// Every method, in the order of their numbers.
    pub const ALL: [Self; 5] = [
        Self::InverseJacobian,
        Self::Lqr,
        Self::TaskPoint,
        Self::Polynomial,
        Self::Cmac,
    ];

    /// As it stands on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::InverseJacobian => "inverse-jacobian",
            Self::Lqr => "lqr",
            Self::TaskPoint => "task-point",
            Self::Polynomial => "polynomial",
            Self::Cmac => "cmac",
        }
    }

    /// Inverse of [`Method::name`].
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name)
    }
}

/// Settings of the compensators.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings<T: Scalar> {
    /// Which compensator.
    pub method: Method,
    /// Iterations at most; 0 sends the nominal commands.
    pub max_iterations: u8,
    /// Converged when the predicted position error is below this, m,
    pub position_tolerance: T,
    /// and the predicted orientation error below this, rad.
    pub orientation_tolerance: T,
    /// Weight of the position error, 1/m (k1 of MRD 5.130). With a weight of 1 a metre
    /// counts as much as a radian: right for arms that reach about one metre.
    pub position_weight: T,
    /// Weight of the orientation error, 1/rad (k2 of MRD 5.130).
    pub orientation_weight: T,
    /// Damping of every step, square of weighted error per rad or m: what keeps the linear
    /// equations solvable. Does not change where the iterations end.
    pub damping: T,
    /// Smallest singular value of the weighted joint Jacobian (1, per rad or m) below which
    /// corrections are held back, smoothly and completely at zero.
    pub singular_value: T,
    /// Price of a correction in the regulator, square of weighted error per square of rad or
    /// of a prismatic joint's travel (γ of MRD 5.136). Not used by the other methods.
    pub effort: T,
    /// Largest correction of a revolute (rad) and of a prismatic joint (m).
    pub correction_bound: [T; 2],
    /// Worst case of one iteration in cycles of the caller's clock, where the built-in table
    /// does not fit.
    pub iteration_cycles: Option<u32>,
}

impl<T: Scalar> Default for Settings<T> {
    fn default() -> Self {
        Self {
            method: Method::InverseJacobian,
            max_iterations: 8,
            position_tolerance: T::of(1e-6),
            orientation_tolerance: T::of(1e-6),
            position_weight: T::one(),
            orientation_weight: T::one(),
            damping: T::of(1e-7),
            singular_value: T::of(0.03),
            effort: T::of(1e-7),
            correction_bound: [T::of(0.2), T::of(0.2)],
            iteration_cycles: None,
        }
    }
}

impl<T: Scalar> Settings<T> {
    /// The same in another number type, rounded once.
    pub fn cast<U: Scalar>(&self) -> Settings<U> {
        let c = |x: T| U::of(x.widen());
        Settings {
            method: self.method,
            max_iterations: self.max_iterations,
            position_tolerance: c(self.position_tolerance),
            orientation_tolerance: c(self.orientation_tolerance),
            position_weight: c(self.position_weight),
            orientation_weight: c(self.orientation_weight),
            damping: c(self.damping),
            singular_value: c(self.singular_value),
            effort: c(self.effort),
            correction_bound: self.correction_bound.map(c),
            iteration_cycles: self.iteration_cycles,
        }
    }

    /// Whether a compensator can work with them: weights not negative and not both zero,
    /// damping at least 1e-9, nothing negative or NaN.
    #[inline(never)]
    pub fn sound(&self) -> bool {
        let o = T::zero();
        let weights = [self.position_weight, self.orientation_weight];
        // Written so that NaN fails.
        self.position_tolerance >= o
            && self.orientation_tolerance >= o
            && weights.iter().all(|&w| w >= o && w <= T::of(1e3))
            && weights.iter().any(|&w| w >= T::of(1e-3))
            && self.damping >= T::of(1e-9)
            && self.singular_value >= o
            && self.singular_value <= T::one()
            && self.effort >= o
            && self.correction_bound.iter().all(|&b| b >= o)
    }
}
