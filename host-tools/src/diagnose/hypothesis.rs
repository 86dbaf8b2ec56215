//! What may be missing: every effect, joint and order that the data's columns allow.

use std::mem::{Discriminant, discriminant};

use nalgebra::Vector3;
use truepose::JointKind;
use truepose::effects::{Effect, KINDS, Kind, Needs, Selector, Shape, Wish, Wobble};

use super::curve::{self, Smoothness};
use super::unnamed::{label, terms};
use crate::identify::arm::ArmModel;
use crate::identify::observation::Observation;

/// One explanation that is tested as a whole.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Kind as in reports.
    pub kind: &'static str,
    /// Joint from 0; `None` for the base or for all joints at once.
    pub joint: Option<usize>,
    /// Periods a turn.
    pub order: Option<f64>,
    /// The other joint, from 0.
    pub from: Option<usize>,
    /// What it adds to the model.
    pub members: Members,
    /// Logarithm of its share of the error probability: kinds share alike, then the members
    /// of a kind, so that hundreds of harmonics do not make compliance expensive.
    pub ln_weight: f64,
}

/// What a hypothesis adds to the model.
#[derive(Clone, Debug)]
pub enum Members {
    /// Effects of the arm.
    Effects(Vec<Effect<'static, f64>>),
    /// Joints that were read before the arm had settled.
    EarlyReading,
    /// The irregular curve of the joint, this smooth.
    Curve(Smoothness),
}

/// Form, component and sensor, link or other joint of an effect.
type Component = (
    Discriminant<Effect<'static, f64>>,
    [Option<u8>; 2],
    Option<usize>,
);

impl Hypothesis {
    /// Same kind, joint, order, other joint and components.
    pub fn is_same(&self, other: &Self) -> bool {
        let near = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 0.3,
            (a, b) => a.is_none() && b.is_none(),
        };
        self.kind == other.kind
            && self.joint == other.joint
            && self.from == other.from
            && near(self.order, other.order)
            && self.components() == other.components()
            && self.is_same_form(other)
    }

    /// True where weight pulls at free levers.
    pub(super) fn has_levers(&self) -> bool {
        let lever = |e: &Effect<'static, f64>| matches!(e, Effect::GravityLever(_));
        matches!(&self.members, Members::Effects(effects) if effects.iter().any(lever))
    }

    /// True where this is an axis that wobbles in the joint's own frame, and `other` the same
    /// axis wobbling in directions of the link before.
    pub(super) fn is_in_joint_frame_of(&self, other: &Self) -> bool {
        let motion = |h: &Self| match &h.members {
            Members::Effects(effects) => match effects.as_slice() {
                [Effect::AxisWobble(wobble)] => Some(wobble.motion),
                _ => None,
            },
            _ => None,
        };
        self.joint == other.joint
            && matches!(
                (motion(self), motion(other)),
                (Some(Wobble::TurningTilt), Some(Wobble::Tilt))
                    | (Some(Wobble::TurningShift), Some(Wobble::Shift))
            )
    }

    /// Without a name, what it depends on and how is all there is to tell terms apart. A
    /// threshold is a constant that is refined.
    fn is_same_form(&self, other: &Self) -> bool {
        let (own, others) = (
            terms(std::slice::from_ref(self)),
            terms(std::slice::from_ref(other)),
        );
        own.len() == others.len()
            && own.iter().zip(others).all(|(a, b)| {
                let same = |k: usize| {
                    a.factors[k].shape == Shape::Sign
                        || (a.limits[3 * k] - b.limits[3 * k]).abs() < 0.3
                };
                a.factors == b.factors && same(0) && same(1)
            })
    }

    /// Number of values that it adds.
    pub fn len(&self) -> usize {
        match &self.members {
            Members::Effects(effects) => effects.iter().map(|e| e.model().values().len()).sum(),
            Members::EarlyReading => 1,
            Members::Curve(_) => curve::COARSE,
        }
    }

    /// True if it adds nothing.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Which forms, components, sensors and links, in order. Constants that are refined do not
    /// count.
    fn components(&self) -> Vec<Component> {
        match &self.members {
            Members::Effects(effects) => effects
                .iter()
                .map(|e| (discriminant(e), e.model().selector()))
                .map(|(form, s)| (form, [s.component, s.sensor], s.from))
                .collect(),
            Members::EarlyReading | Members::Curve(_) => Vec::new(),
        }
    }

    /// As a person says it, joints counted from 1.
    pub fn label(&self) -> String {
        if let [term] = terms(std::slice::from_ref(self)).as_slice() {
            return label(term);
        }
        let mut label = match self.joint {
            Some(j) => format!("joint {} {}", j + 1, self.kind),
            None => self.kind.to_owned(),
        };
        if let Some(order) = self.order {
            label += &format!(" of order {order}");
        }
        if let Some(from) = self.from {
            label += &format!(" from joint {}", from + 1);
        }
        label
    }
}

/// Highest order that is a candidate everywhere; the periodogram finds higher ones.
const ORDERS: u32 = 12;

/// Highest order of an axis that wobbles.
const WOBBLES: u32 = 6;

/// Places of a step in time that are tried; the best is refined afterwards.
const STEPS: usize = 19;

/// Joints that give way, to described masses or to weight that nobody has described.
pub(super) const YIELDS: &str = "joint-compliance";

/// Time constants of a warm-up that are tried, in durations of the series.
const FRACTIONS: [f64; 5] = [0.03, 0.06, 0.12, 0.25, 0.5];

/// What the data can show.
struct Conditions {
    /// Links whose masses are described.
    links: bool,
    /// Masses of links or a payload.
    masses: bool,
    direction: bool,
    /// Temperature sensors that change.
    sensors: Vec<u8>,
    time: Option<[f64; 2]>,
    /// Times between rows, as many rows between each two, and how much time each stands for.
    between: Vec<(f64, f64)>,
    order: bool,
}

fn conditions(arm: &ArmModel, observations: &[&Observation]) -> Conditions {
    let times = observations.iter().map(|o| o.ambient.time);
    let low = times.clone().fold(f64::INFINITY, f64::min);
    let high = times.fold(f64::NEG_INFINITY, f64::max);
    let varies = |sensor: usize| {
        let first = observations
            .first()
            .map_or(0.0, |o| o.ambient.temperature[sensor]);
        observations
            .iter()
            .any(|o| (o.ambient.temperature[sensor] - first).abs() > 0.1)
    };
    let links = arm.masses.iter().any(|m| m.mass > 0.0);
    Conditions {
        links,
        masses: links || observations.iter().any(|o| o.ambient.payload > 0.0),
        direction: observations
            .iter()
            .any(|o| o.direction.iter().any(|d| d.abs() > 0.5)),
        sensors: (0..truepose::effects::MAX_SENSORS)
            .filter(|&s| varies(s))
            .filter_map(|s| u8::try_from(s).ok())
            .collect(),
        time: (high > low).then_some([low, high]),
        between: between(observations),
        order: observations
            .iter()
            .any(|o| o.travel.iter().any(|d| d.abs() > 0.0)),
    }
}

/// A pause is this much longer than half of the gaps between rows.
const PAUSE: f64 = 5.0;

/// Times at which a step is tried: between rows, since no row can tell where in a gap it was, and
/// in every pause, when things are moved. A gap where rows are held back is shared among them, so
/// it is no pause, and rows that stand for the time have none. A step may have been at any time:
/// each place stands for the gaps that are nearest to it, as long as they are.
fn between(observations: &[&Observation]) -> Vec<(f64, f64)> {
    let times = observations.iter().map(|o| (o.ambient.time, o.row));
    let mut times: Vec<(f64, usize)> = times.filter(|(t, _)| t.is_finite()).collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    times.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
    // middle, length, length a row
    let gaps: Vec<[f64; 3]> = times
        .windows(2)
        .map(|w| {
            let (length, rows) = (w[1].0 - w[0].0, w[1].1.abs_diff(w[0].1).max(1));
            [0.5 * (w[0].0 + w[1].0), length, length / rows as f64]
        })
        .collect();
    let mut widths: Vec<f64> = gaps.iter().map(|g| g[2]).collect();
    widths.sort_by(f64::total_cmp);
    let median = widths.get(widths.len() / 2).copied().unwrap_or(0.0);
    let count = STEPS.min(gaps.len());
    let places: Vec<usize> = (0..count)
        .map(|i| (2 * i + 1) * gaps.len() / (2 * count))
        .collect();
    let mut pauses = 0;
    let tried = gaps.iter().enumerate().filter(|(i, [.., width])| {
        let pause = *width > PAUSE * median && pauses < STEPS;
        pauses += usize::from(pause);
        pause || places.contains(i)
    });
    let tried: Vec<usize> = tried.map(|(i, _)| i).collect();
    let mut found: Vec<(f64, f64)> = tried.iter().map(|&i| (gaps[i][0], 0.0)).collect();
    for (i, [_, length, _]) in gaps.iter().enumerate() {
        let nearest = (0..tried.len()).min_by_key(|&k| tried[k].abs_diff(i));
        if let Some(place) = nearest {
            found[place].1 += length;
        }
    }
    found
}

/// Every hypothesis that these rows allow, one entry each.
pub fn hypotheses(arm: &ArmModel, observations: &[&Observation]) -> Vec<Hypothesis> {
    let conditions = conditions(arm, observations);
    let mut families: Vec<Vec<Hypothesis>> = Vec::new();
    for kind in KINDS {
        let allowed = match kind.needs {
            Needs::Joints | Needs::Gravity => true,
            Needs::Masses => conditions.masses,
            Needs::Direction => conditions.direction,
            Needs::Temperature => !conditions.sensors.is_empty(),
            Needs::Time => conditions.time.is_some(),
        };
        match kind.name {
            // where nothing else passes
            "joint-curve" => {}
            // others come from the periodogram
            "gear-ripple" => families.push(ripples(kind, arm)),
            // a weight at the tool stands for all the weight that nobody has described
            "tool-load" if !conditions.links => {
                let mut family = family(kind, arm, &conditions);
                family.iter_mut().for_each(|h| h.kind = YIELDS);
                families.push(family);
            }
            _ if allowed => families.push(family(kind, arm, &conditions)),
            _ => {}
        }
    }
    if stands_on_first_axis(arm) {
        let mut all = families.iter_mut().flatten();
        if let Some(tilts) = all.find(|h| h.kind == "cross-axis-compliance" && h.joint == Some(0)) {
            tilts.ln_weight += ROCKS.ln();
        }
    }
    families.push(levers(arm));
    if conditions.order {
        families.push(vec![Hypothesis {
            kind: "early-reading",
            joint: None,
            order: None,
            from: None,
            members: Members::EarlyReading,
            ln_weight: 0.0,
        }]);
    }
    families.retain(|f| !f.is_empty());
    let kinds = families.len() as f64;
    for family in &mut families {
        let shares: f64 = family.iter().map(|h| h.ln_weight.exp()).sum();
        for hypothesis in family {
            hypothesis.ln_weight -= (kinds * shares).ln();
        }
    }
    families.into_iter().flatten().collect()
}

/// A first joint that tilts on its base is a base that rocks alike about both of its axes: the same
/// function, for which engineers say that the base rocks. The joint's share, before its own.
const ROCKS: f64 = 0.01;

/// Whether the first joint turns about the base's z axis.
fn stands_on_first_axis(arm: &ArmModel) -> bool {
    arm.joints.first().is_some_and(|joint| {
        let turned = |q: f64| joint.transform(q).rotation;
        let turn = turned(1.0) * turned(0.0).transpose();
        joint.kind == JointKind::Revolute && (turn * Vector3::z() - Vector3::z()).norm() < 0.01
    })
}

/// All joints, orders and components of one kind.
fn family(kind: &'static Kind, arm: &ArmModel, conditions: &Conditions) -> Vec<Hypothesis> {
    let mut found = Vec::new();
    let sensors: Vec<Option<u8>> = match kind.needs {
        Needs::Temperature => conditions.sensors.iter().copied().map(Some).collect(),
        _ => vec![None],
    };
    for j in 0..arm.joint_count() {
        if !kind.joint || kind.only.is_some_and(|only| arm.joints[j].kind != only) {
            continue;
        }
        let top = match kind.name {
            _ if kind.order == Wish::No => 0,
            _ if arm.joints[j].kind == JointKind::Prismatic => continue,
            "gear-eccentricity" => ORDERS,
            _ => WOBBLES,
        };
        let orders: Vec<Option<f64>> = match top {
            0 => vec![None],
            top => (1..=top).map(|order| Some(f64::from(order))).collect(),
        };
        let others: Vec<Option<usize>> = match kind.from {
            Wish::Must => (0..arm.joint_count())
                .filter(|&i| i != j)
                .map(Some)
                .collect(),
            _ => vec![None],
        };
        // on a joint, a drift has one component: the joint's own
        let components = if kind.base {
            1
        } else {
            kind.components.len().max(1)
        };
        for &order in &orders {
            for &from in &others {
                for component in 0..components {
                    let selector = Selector {
                        joint: Some(j),
                        order,
                        from,
                        component: u8::try_from(component).ok(),
                        ..Selector::default()
                    };
                    for &sensor in &sensors {
                        let selector = Selector { sensor, ..selector };
                        let constants = constants(kind, conditions).into_iter();
                        found.extend(
                            constants.filter_map(|c| one(kind, arm, selector, &[selector], c)),
                        );
                    }
                }
            }
        }
    }
    let everywhere: Vec<Selector> = (0..arm.joint_count())
        .map(|j| Selector {
            joint: Some(j),
            ..Selector::default()
        })
        .collect();
    if matches!(kind.name, "joint-compliance" | "tool-load") {
        // gravity acts on all joints at once
        found.extend(one(kind, arm, Selector::default(), &everywhere, None));
    }
    if kind.base {
        // the base moves as a whole: all its components together
        for &sensor in &sensors {
            let selectors: Vec<Selector> = (0..kind.components.len().max(1))
                .map(|c| Selector {
                    component: u8::try_from(c).ok(),
                    sensor,
                    ..Selector::default()
                })
                .collect();
            for constant in constants(kind, conditions) {
                let moved = one(kind, arm, Selector::default(), &selectors, constant);
                found.extend(moved.map(|h| Hypothesis {
                    kind: seen_as(h.kind),
                    ..h
                }));
            }
        }
    }
    found
}

/// The irregular curve of every revolute joint, with the weight of a kind among `kinds`.
pub fn curves(arm: &ArmModel, kinds: usize) -> Vec<Hypothesis> {
    let turning = (0..arm.joint_count()).filter(|&j| arm.joints[j].kind == JointKind::Revolute);
    let turning: Vec<usize> = turning.collect();
    let ln_weight = -((kinds * turning.len()) as f64).ln();
    turning
        .into_iter()
        .map(|j| Hypothesis {
            kind: "joint-curve",
            joint: Some(j),
            order: None,
            from: None,
            members: Members::Curve(Smoothness::FIRST),
            ln_weight,
        })
        .collect()
}

/// Ripple of the gears whose ratio is known: once, twice and four times a motor turn.
fn ripples(kind: &'static Kind, arm: &ArmModel) -> Vec<Hypothesis> {
    let mut found = Vec::new();
    for (j, ratio) in arm.ratios.iter().enumerate() {
        let turns = arm.joints[j].kind == JointKind::Revolute;
        let Some(ratio) = ratio.filter(|r| turns && *r > f64::from(ORDERS)) else {
            continue;
        };
        for times in [1.0, 2.0, 4.0] {
            let selector = Selector {
                joint: Some(j),
                order: Some(times * ratio),
                ..Selector::default()
            };
            found.extend(one(kind, arm, selector, &[selector], None));
        }
    }
    found
}

/// A base that jumps is an instrument that somebody moved, until the opposite is proved.
fn seen_as(kind: &'static str) -> &'static str {
    match kind {
        "step-change" => "instrument-moved",
        kind => kind,
    }
}

/// Free gravity levers: the weight of one link on a joint, of all links beyond it, of all links
/// on all joints. Nobody knows how much it is and where.
fn levers(arm: &ArmModel) -> Vec<Hypothesis> {
    let Some(kind) = Kind::of(YIELDS) else {
        return Vec::new();
    };
    let n = arm.joint_count();
    let lever = |joint, link| Selector {
        joint: Some(joint),
        from: Some(link),
        ..Selector::default()
    };
    let of = |j: usize| (j..n).map(move |link| lever(j, link));
    let mut groups: Vec<(Option<usize>, Vec<Selector>)> = Vec::new();
    for j in 0..n {
        groups.extend(of(j).map(|one| (Some(j), vec![one])));
        groups.push((Some(j), of(j).collect()));
    }
    groups.push((None, (0..n).flat_map(of).collect()));
    // the last joint has one link beyond it
    groups.dedup_by(|a, b| a.1 == b.1);
    let whole = |(joint, selectors): (Option<usize>, Vec<Selector>)| {
        let shown = Selector {
            joint,
            ..Selector::default()
        };
        one(kind, arm, shown, &selectors, None)
    };
    groups.into_iter().filter_map(whole).collect()
}

/// The hypothesis of these effects together, `shown` as its joint, order and other joint.
/// `constant`: its value, and its weight among the members of the kind, which is 1 elsewhere.
fn one(
    kind: &'static Kind,
    arm: &ArmModel,
    shown: Selector,
    selectors: &[Selector],
    constant: Option<(f64, f64)>,
) -> Option<Hypothesis> {
    let mut effects = Vec::new();
    for selector in selectors {
        let mut effect = Effect::named(kind.name, selector)?;
        if let (Some((value, _)), Some(first)) =
            (constant, effect.model_mut().constants_mut().first_mut())
        {
            *first = value;
        }
        arm.attach(&mut effect);
        effects.push(effect);
    }
    Some(Hypothesis {
        kind: kind.name,
        joint: shown.joint,
        order: shown.order,
        from: shown.from,
        members: Members::Effects(effects),
        ln_weight: constant.map_or(0.0, |(_, weight)| weight.ln()),
    })
}

/// Values that a constant which the model is not linear in is tried at, and the share of each.
fn constants(kind: &Kind, conditions: &Conditions) -> Vec<Option<(f64, f64)>> {
    let Some([low, high]) = conditions.time else {
        return vec![None];
    };
    let span = high - low;
    let shares = |values: Vec<(f64, f64)>| {
        let sum: f64 = values.iter().map(|v| v.1).sum();
        values
            .into_iter()
            .map(|(value, weight)| Some((value, weight / sum)))
            .collect()
    };
    match kind.name {
        "step-change" => shares(conditions.between.clone()),
        "warm-up" => shares(FRACTIONS.map(|f| (span * f, 1.0)).to_vec()),
        _ => vec![None],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_for_a_step_stands_for_as_much_time_as_passes_there() {
        // a row every 20 s, rows 31 and 32 held back, a pause of an hour after row 60
        let rows = (0..100).filter(|i| !(31..=32).contains(i));
        let all: Vec<Observation> = rows
            .map(|i: usize| Observation {
                row: i,
                ambient: truepose::effects::Ambient {
                    time: 20.0 * i as f64 + if i > 60 { 3600.0 } else { 0.0 },
                    ..Default::default()
                },
                ..Observation::default()
            })
            .collect();
        let places = between(&all.iter().collect::<Vec<_>>());
        assert!(places.len() >= STEPS, "{places:?}");
        let span: f64 = places.iter().map(|p| p.1).sum();
        assert!((span - (99.0 * 20.0 + 3600.0)).abs() < 1e-6, "{span}");
        let in_pause: Vec<f64> = places
            .iter()
            .filter(|p| p.0 > 1200.0 && p.0 < 4820.0)
            .map(|p| p.1)
            .collect();
        assert_eq!(in_pause.len(), 1, "{places:?}");
        let share = in_pause[0] / span;
        assert!(share > 3620.0 / span && share < 0.7, "{share}");
        assert!(places.iter().all(|p| p.1 > 0.0), "{places:?}");
    }
}
