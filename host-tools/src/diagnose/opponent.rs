//! Does a term without a name still find something beside the names?
//!
//! A name counts only if it explains what a free function of joints and conditions would.
//! The search asks for more than significance before it takes a nameless term; here the best
//! one is only asked whether what it saw in the rows of the fit is there in other rows.

use super::confirmed::Confirmation;
use super::model::Extended;
use super::space::columns;
use super::unnamed::{offered, trials};
use crate::identify::observation::{Observation, Sigmas};

/// Chance below which a name is called insufficient.
const LEVEL: f64 = 0.003;

/// What the best nameless term sees beside the names.
#[derive(Clone, Debug, PartialEq)]
pub struct Opponent {
    /// As a person says it.
    pub label: String,
    /// Logarithm of the chance, all terms considered.
    pub ln_p: f64,
    /// True where chance does not explain it.
    pub stronger: bool,
}

/// The best nameless term beside the complete model; `None` where nothing was named.
pub fn opponent(
    model: &Extended,
    fitted: &[&Observation],
    unseen: &[&Observation],
    sigmas: Sigmas,
) -> Option<Opponent> {
    if model.accepted.is_empty() {
        return None;
    }
    let confirmation = Confirmation::new(model, fitted, unseen, sigmas)?;
    let best = offered(model, &confirmation.space, fitted, sigmas)
        .into_iter()
        .next()?;
    let all: Vec<&Observation> = fitted.iter().chain(unseen).copied().collect();
    let column = columns(&model.arm, &[&best], &all, sigmas)
        .matrix
        .column(0)
        .into_owned();
    let own = confirmation.ln_p(&column)? - best.ln_weight + trials();
    let ln_p = confirmation.together(&column, own);
    Some(Opponent {
        label: best.label(),
        ln_p,
        stronger: ln_p < LEVEL.ln(),
    })
}
