//! Which parameters a person wants identified, and which stay as drawn.
//!
//! Parameters are named as reports name them: `joint 3 alpha`, `base yaw`, `tool x`. A pattern
//! is the first words of such names, `*` for any one word: `joint * alpha`, `joint 2`, `tool`.
//! `offsets` is theta of every turn and d of every slide: what a controller corrects that takes
//! nothing but new zero positions.

use truepose::{JointKind, Parameter, Pose};

use super::arm::ArmModel;
use super::unknown::Unknown;

/// What to identify, as patterns; nothing asked: everything.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// All other parameters of joints are held, and the tool where one of these names the base.
    /// The base is not: an instrument stands anywhere.
    pub only: Vec<String>,
    /// Held.
    pub hold: Vec<String>,
    /// Not held, whatever the other two say.
    pub free: Vec<String>,
}

/// Parameters that stay at the drawing's values because a person wants it so.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Held {
    kept: Vec<Kept>,
    /// Named in full as what to identify.
    asked: Vec<Unknown>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Kept {
    unknown: Unknown,
    /// For reports.
    why: String,
    /// `hold` names it, not `only` all others.
    named: bool,
}

/// The word for every joint's zero position.
const OFFSETS: &str = "offsets";

impl Wish {
    /// Nothing asked.
    pub fn is_empty(&self) -> bool {
        self.only.is_empty() && self.hold.is_empty() && self.free.is_empty()
    }

    /// What stays as drawn of `arm`, which `around` more unknowns stand with: what the
    /// measurements place. The sentence says which pattern is wrong, and why.
    pub fn among(&self, arm: &ArmModel, around: &[Unknown]) -> Result<Held, String> {
        let all = Names::of(arm, around);
        let only = all.matched(arm, "only", &self.only)?;
        let hold = all.matched(arm, "hold", &self.hold)?;
        let free = all.matched(arm, "free", &self.free)?;
        // an instrument stands anywhere, and a tool that is not what is asked of stands with it
        let base = |u: &Unknown| matches!(u, Unknown::Base { .. });
        let placed = only.iter().flatten().any(base);
        let by = |of: &[Vec<Unknown>], unknown: &Unknown| {
            of.iter().position(|matched| matched.contains(unknown))
        };
        let asked = self.only.iter().chain(&self.free);
        let asked = asked.filter_map(|pattern| all.0.iter().find(|(_, name)| name == pattern));
        let mut held = Held {
            asked: asked.map(|(unknown, _)| *unknown).collect(),
            ..Held::default()
        };
        for (unknown, _) in all.0.iter().filter(|(u, _)| drawn(u, arm)) {
            let chosen = match unknown {
                Unknown::Joint(..) => true,
                Unknown::Tool { .. } => placed,
                _ => false,
            };
            let left = !only.is_empty() && chosen && by(&only, unknown).is_none();
            let asked = by(&hold, unknown).and_then(|k| self.hold.get(k));
            let why = match asked {
                Some(pattern) => format!("held at the drawing's value: --hold \"{pattern}\""),
                None if left => {
                    let only = self.only.join(", ");
                    format!("held at the drawing's value: --only \"{only}\"")
                }
                None => continue,
            };
            held.kept.push(Kept {
                unknown: *unknown,
                why,
                named: asked.is_some(),
            });
        }
        for (pattern, matched) in self.hold.iter().zip(&hold) {
            if !matched.iter().any(|u| held.contains(u)) {
                return Err(format!(
                    "--hold \"{pattern}\": the drawing has no value to hold it at; it is found \
                     from the measurements"
                ));
            }
        }
        for (pattern, matched) in self.free.iter().zip(&free) {
            if !matched.iter().any(|u| held.contains(u)) {
                return Err(format!(
                    "--free \"{pattern}\": nothing of it is held; expected what --hold or --only \
                     holds"
                ));
            }
        }
        held.kept.retain(|kept| by(&free, &kept.unknown).is_none());
        held.whole_turns()?;
        Ok(held)
    }
}

/// The description gives it a value.
fn drawn(unknown: &Unknown, arm: &ArmModel) -> bool {
    match *unknown {
        Unknown::Base { session, .. } => session == 0,
        Unknown::Joint(..) | Unknown::Tool { .. } => true,
        Unknown::Target { target, .. } => target < arm.targets.len(),
        _ => false,
    }
}

impl Held {
    /// True for a parameter that stays as drawn.
    pub fn contains(&self, unknown: &Unknown) -> bool {
        self.kept.iter().any(|kept| kept.unknown == *unknown)
    }

    /// True for a parameter that is named in full as one to identify.
    pub(super) fn asks_for(&self, unknown: &Unknown) -> bool {
        self.asked.contains(unknown)
    }

    /// True where everything is free.
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    /// Number of parameters that stay as drawn.
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Those for reports, with the reason: what `offered` says belongs to a complete model, and
    /// what a person named.
    pub(super) fn told(
        &self,
        offered: impl Fn(&Unknown) -> bool,
    ) -> impl Iterator<Item = (Unknown, &str)> {
        let told = move |kept: &&Kept| kept.named || offered(&kept.unknown);
        let held = self.kept.iter().filter(told);
        held.map(|kept| (kept.unknown, kept.why.as_str()))
    }

    /// The arm's size is given by one of these lengths.
    pub(super) fn gives_size(&self, arm: &ArmModel) -> bool {
        self.kept
            .iter()
            .any(|kept| kept.unknown.unit(arm) == "m" && kept.unknown.value(arm).abs() > 1e-2)
    }

    /// Puts `arm` back to the drawing where it is held.
    pub(super) fn restore(&self, arm: &mut ArmModel, drawing: &ArmModel) {
        let first = |of: &ArmModel| of.bases.first().copied().unwrap_or(Pose::identity());
        let base = |axis| Unknown::Base { session: 0, axis };
        let tool = |axis| Unknown::Tool { axis };
        let place = self.replaced(&first(arm), &first(drawing), base);
        if let Some(at) = arm.bases.first_mut() {
            *at = place;
        }
        arm.tool = self.replaced(&arm.tool, &drawing.tool, tool);
        arm.bake();
    }

    /// `pose` with what is held of it as in `drawn`.
    fn replaced(
        &self,
        pose: &Pose<f64>,
        drawn: &Pose<f64>,
        unknown: impl Fn(usize) -> Unknown,
    ) -> Pose<f64> {
        let held = |axis: usize| self.contains(&unknown(axis));
        let mut place = *pose;
        for axis in (0..3).filter(|&axis| held(axis)) {
            place.translation[axis] = drawn.translation[axis];
        }
        if (3..6).all(held) {
            place.rotation = drawn.rotation;
        } else if (3..5).all(held) {
            let mut turns = drawn.rpy();
            turns.z = pose.rpy().z;
            place.rotation = Pose::from_xyz_rpy(place.translation, turns).rotation;
        }
        place
    }

    /// Roll, pitch and yaw are one rotation. A step about the world's z changes yaw alone, one
    /// about x or y changes all three.
    fn whole_turns(&self) -> Result<(), String> {
        let base = |axis| Unknown::Base { session: 0, axis };
        let tool = |axis| Unknown::Tool { axis };
        let each: [(&str, &dyn Fn(usize) -> Unknown); 2] = [("base", &base), ("tool", &tool)];
        for (name, unknown) in each {
            let held = [3, 4, 5].map(|axis| self.contains(&unknown(axis)));
            if !matches!(
                held,
                [false, false, false] | [true, true, true] | [true, true, false]
            ) {
                return Err(format!(
                    "roll, pitch and yaw of the {name} are one rotation: hold all three, roll \
                     and pitch, or none"
                ));
            }
        }
        Ok(())
    }
}

/// Everything that can be named, in the order of reports.
struct Names(Vec<(Unknown, String)>);

/// A misspelt name is at most so many letters from one that is meant.
const NEAR: usize = 3;

impl Names {
    fn of(arm: &ArmModel, around: &[Unknown]) -> Self {
        let mut all: Vec<Unknown> = (0..6)
            .map(|axis| Unknown::Base { session: 0, axis })
            .collect();
        for (j, joint) in arm.joints.iter().enumerate() {
            all.extend(joint.parameters().iter().map(|&p| Unknown::Joint(j, p)));
        }
        all.extend((0..6).map(|axis| Unknown::Tool { axis }));
        for unknown in around {
            if !all.contains(unknown) {
                all.push(*unknown);
            }
        }
        Self(all.into_iter().map(|u| (u, u.name(arm))).collect())
    }

    /// The unknowns that each of the `patterns` of an option names.
    fn matched(
        &self,
        arm: &ArmModel,
        option: &str,
        patterns: &[String],
    ) -> Result<Vec<Vec<Unknown>>, String> {
        let matched = |pattern: &String| {
            let wanted = pattern.to_lowercase();
            let words: Vec<&str> = wanted.split_whitespace().collect();
            let named = |(unknown, name): &&(Unknown, String)| match words.as_slice() {
                [] => false,
                [OFFSETS] => is_offset(unknown, arm),
                _ => {
                    let mut name = name.split(' ');
                    words
                        .iter()
                        .all(|word| name.next().is_some_and(|n| *word == "*" || *word == n))
                }
            };
            let found: Vec<Unknown> = self.0.iter().filter(named).map(|(u, _)| *u).collect();
            match found.is_empty() {
                true => Err(format!(
                    "--{option} \"{pattern}\": no such parameter{}; expected {OFFSETS}, or the \
                     first words of one of {}",
                    self.near(&words),
                    self.listed()
                )),
                false => Ok(found),
            }
        };
        patterns.iter().map(matched).collect()
    }

    /// What may have been meant, in words.
    fn near(&self, words: &[&str]) -> String {
        let wanted = words.join(" ");
        let mut meant: Vec<(usize, String)> = vec![(
            strsim::damerau_levenshtein(&wanted, OFFSETS),
            OFFSETS.to_owned(),
        )];
        for (_, name) in &self.0 {
            let first: Vec<&str> = name.split(' ').take(words.len().max(1)).collect();
            let first = first.join(" ");
            if !meant.iter().any(|(_, known)| *known == first) {
                meant.push((strsim::damerau_levenshtein(&wanted, &first), first));
            }
        }
        let least = meant.iter().map(|(far, _)| *far).min().unwrap_or(0);
        let nearest = meant.iter().filter(|(far, _)| *far == least);
        let names: Vec<&str> = nearest.map(|(_, name)| name.as_str()).collect();
        // another joint's number is no slip of the pen
        match least <= NEAR.min(wanted.len() / 2) && names.len() <= 3 {
            true => format!(" (is {} meant?)", names.join(" or ")),
            false => String::new(),
        }
    }

    /// All names, what is alike once: `base x, y, z; joint 1 to 6 theta, d`.
    fn listed(&self) -> String {
        let mut groups: Vec<(&str, Vec<&str>, Vec<&str>)> = Vec::new();
        for (_, name) in &self.0 {
            let (head, rest) = name.split_once(' ').unwrap_or((name, ""));
            let (number, rest) = match rest.split_once(' ') {
                Some((number, rest)) if number.parse::<usize>().is_ok() => (Some(number), rest),
                _ => (None, rest),
            };
            let place = groups.iter().position(|g| g.0 == head).unwrap_or_else(|| {
                groups.push((head, Vec::new(), Vec::new()));
                groups.len() - 1
            });
            let (_, numbers, rests) = &mut groups[place];
            numbers.extend(number.filter(|n| !numbers.contains(n)));
            if !rests.contains(&rest) {
                rests.push(rest);
            }
        }
        let each = groups.iter().map(|(head, numbers, rests)| {
            let numbers = match numbers.as_slice() {
                [] => String::new(),
                [one] => format!(" {one}"),
                [first, .., last] => format!(" {first} to {last}"),
            };
            format!("{head}{numbers} {}", rests.join(", "))
        });
        each.collect::<Vec<_>>().join("; ")
    }
}

/// Zero position of a joint.
fn is_offset(unknown: &Unknown, arm: &ArmModel) -> bool {
    let Unknown::Joint(j, parameter) = *unknown else {
        return false;
    };
    let kind = arm.joints.get(j).map(|joint| joint.kind);
    match kind {
        Some(JointKind::Revolute) => parameter == Parameter::Theta,
        Some(JointKind::Prismatic) => parameter == Parameter::D,
        None => false,
    }
}
