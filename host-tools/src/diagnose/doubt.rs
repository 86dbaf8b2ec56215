//! Which names stand beside something that has none.
//!
//! Where a term without a name acts on the same joint, or by the same condition, as an effect
//! that has one, the two may be parts of one thing that the catalogue does not have: the name
//! is then no more than what it looks like.

use truepose::effects::{Effect, Kind, Needs, ONE, Place, Variable};

use super::friction::Friction;
use super::hypothesis::{Hypothesis, Members};
use super::proportion::Disproportion;
use super::unnamed::terms;

/// Why the name of accepted hypothesis `index` is in doubt; `None` where it is not.
pub(super) fn doubt(
    accepted: &[Hypothesis],
    index: usize,
    disproportion: Option<&Disproportion>,
    friction: Option<Friction>,
) -> Option<String> {
    let own = accepted.get(index)?;
    if own.kind == "unnamed" {
        return None;
    }
    if let Some(bent) = disproportion.filter(|d| d.bent && d.index == index) {
        return Some(format!(
            "it does not stay in proportion to its cause: it changes with {}",
            bent.with
        ));
    }
    if let Some(sticks) = friction.filter(|f| f.likelier && f.index == index) {
        return Some(sticks.in_words());
    }
    let (joints, drivers) = (joints(own), drivers(own));
    terms(accepted).into_iter().find_map(|term| {
        let same = match term.place {
            Place::Joint(j) => joints.contains(&Some(usize::from(j))),
            Place::Base { .. } => joints.contains(&None),
        };
        let mut factors = term.factors.iter().filter(|f| **f != ONE);
        if same {
            Some("a term without a name acts on the same place".to_owned())
        } else if factors.any(|f| drivers.contains(&f.variable)) {
            Some("a term without a name depends on the same thing".to_owned())
        } else {
            None
        }
    })
}

/// Joints that a hypothesis acts on; `None` for the base.
fn joints(hypothesis: &Hypothesis) -> Vec<Option<usize>> {
    match &hypothesis.members {
        Members::Effects(effects) => effects.iter().map(|e| e.model().joint()).collect(),
        Members::Curve(_) => vec![hypothesis.joint],
        Members::EarlyReading => Vec::new(),
    }
}

/// What its size depends on.
fn drivers(hypothesis: &Hypothesis) -> Vec<Variable> {
    let narrow = |j: usize| u8::try_from(j).ok();
    let own = hypothesis.joint.and_then(narrow);
    let Some(kind) = Kind::of(hypothesis.kind) else {
        return Vec::new();
    };
    match kind.needs {
        Needs::Joints => {
            let from = hypothesis.from.and_then(narrow);
            from.or(own).map(Variable::Joint).into_iter().collect()
        }
        Needs::Masses | Needs::Gravity => vec![Variable::Payload],
        Needs::Direction => own.map(Variable::Direction).into_iter().collect(),
        Needs::Time => vec![Variable::Time],
        Needs::Temperature => match &hypothesis.members {
            Members::Effects(effects) => effects.iter().filter_map(sensor).collect(),
            _ => Vec::new(),
        },
    }
}

fn sensor(effect: &Effect<'static, f64>) -> Option<Variable> {
    effect.model().selector().sensor.map(Variable::Temperature)
}
