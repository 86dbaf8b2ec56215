//! What stands for the time where the file has none.

use truepose::effects::{Effect, Kind, Needs, Variable};

use crate::identify::problem::Problem;
use crate::identify::relation::Relation;

/// Rows in their order, one a second, where no row has a time; returns whether that was so.
///
/// Rows are written down in the order in which they were measured. What drifts with their
/// number drifts with a time of which only the order is known: it belongs to the series and
/// not to the arm's clock.
pub(super) fn count_rows(problem: &mut Problem) -> bool {
    let observations = || problem.identify.iter().chain(&problem.verify);
    if observations().any(|o| o.ambient.time.is_finite()) {
        return false;
    }
    for o in problem.identify.iter_mut().chain(&mut problem.verify) {
        o.ambient.time = o.row as f64;
        for relation in &mut o.relations {
            if let Relation::Distance { to, .. } = relation {
                to.ambient.time = to.row as f64;
            }
        }
    }
    true
}

/// Whether an effect changes with the time.
pub(crate) fn needs_time(effect: &Effect<'_, f64>) -> bool {
    match effect {
        Effect::Unnamed(term) => {
            let mut factors = term.factors.iter();
            factors
                .any(|f| f.shape != truepose::effects::Shape::One && f.variable == Variable::Time)
        }
        effect => Kind::of(effect.model().kind()).is_some_and(|k| k.needs == Needs::Time),
    }
}
