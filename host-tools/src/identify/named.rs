//! Effects as the command line names them: `KIND[:JOINT[:ORDER]]`, for `joint-coupling` and
//! free gravity levers `KIND:JOINT:FROM`.

use truepose::effects::{Effect, KINDS, Kind, Needs, Selector, Wish};
use truepose::model::MAX_EFFECTS;

use crate::description::Robot;
use crate::error::Error;
use crate::measurement::Dataset;

/// The effects that `options` name, each once. Without a joint: of every joint and, for
/// kinds that act on the base, of the base in all its axes; the joint `base` means the base
/// alone.
pub fn effects(
    options: &[String],
    robot: &Robot,
    data: &Dataset,
) -> Result<Vec<Effect<'static, f64>>, Error> {
    let mut found: Vec<Effect<'static, f64>> = Vec::new();
    for option in options {
        let (kind, selectors) = selectors(option, robot)?;
        check_needs(option, kind, robot, data)?;
        for selector in selectors {
            let effect = Effect::named(kind.name, &selector)
                .ok_or_else(|| usage(option, "is not one effect"))?;
            if effect.model().values().is_empty() {
                return Err(usage(
                    option,
                    "has no values before diagnose has laid them out; use diagnose",
                ));
            }
            if !found.contains(&effect) {
                found.push(effect);
            }
        }
    }
    if found.len() > MAX_EFFECTS {
        return Err(Error::Usage(format!(
            "--effect names {} effects, the controller holds {MAX_EFFECTS}; name joints",
            found.len()
        )));
    }
    Ok(found)
}

fn usage(option: &str, what: &str) -> Error {
    Error::Usage(format!("--effect {option}: {what}"))
}

fn selectors(option: &str, robot: &Robot) -> Result<(&'static Kind, Vec<Selector>), Error> {
    let mut parts = option.split(':');
    let name = parts.next().unwrap_or("");
    let kind = Kind::of(name).ok_or_else(|| {
        let known: Vec<&str> = KINDS.iter().map(|k| k.name).collect();
        usage(
            option,
            &format!("no such kind; the kinds are {}", known.join(", ")),
        )
    })?;
    let joint = parts.next();
    let third = parts.next();
    if parts.next().is_some() {
        return Err(usage(option, "expected KIND[:JOINT[:ORDER]]"));
    }
    let asked = Asked {
        order: order(option, kind, third)?,
        from: from(option, kind, third, robot.joints.len())?,
    };
    let every = || (0..robot.joints.len()).filter(|&j| suits(kind, robot, j));
    let on_joint = |j: usize| of_joint(kind, j, asked);
    let on_base = || of_base(kind).filter(|_| kind.base);
    let selectors: Vec<Selector> = match joint {
        None | Some("") if kind.joint => every().flat_map(on_joint).chain(on_base()).collect(),
        None | Some("") => on_base().collect(),
        Some("base") if kind.base => on_base().collect(),
        Some(_) if !kind.joint => return Err(usage(option, "this kind acts on no joint")),
        Some(text) => match text.parse::<usize>() {
            Ok(j) if (1..=robot.joints.len()).contains(&j) && suits(kind, robot, j - 1) => {
                on_joint(j - 1).collect()
            }
            Ok(j) if (1..=robot.joints.len()).contains(&j) => {
                return Err(usage(option, "this kind is not for such a joint"));
            }
            _ => {
                let last = robot.joints.len();
                return Err(usage(
                    option,
                    &format!("the joint is a number from 1 to {last}"),
                ));
            }
        },
    };
    Ok((kind, selectors))
}

/// What the third part of an option says.
#[derive(Clone, Copy)]
struct Asked {
    order: Option<f64>,
    from: Option<usize>,
}

fn suits(kind: &Kind, robot: &Robot, j: usize) -> bool {
    kind.only
        .is_none_or(|only| robot.joints.get(j).is_some_and(|x| x.joint.kind == only))
}

fn order(option: &str, kind: &Kind, third: Option<&str>) -> Result<Option<f64>, Error> {
    if kind.order == Wish::No {
        return Ok(None);
    }
    match third {
        Some(text) => match text.parse::<f64>() {
            Ok(order) if order.is_finite() && order > 0.0 => Ok(Some(order)),
            _ => Err(usage(option, "the order is a number above zero")),
        },
        None if kind.name == "gear-ripple" => {
            Err(usage(option, "needs its order, in periods per joint turn"))
        }
        None => Ok(Some(1.0)),
    }
}

/// For kinds without an order the third part is the other joint.
fn from(
    option: &str,
    kind: &Kind,
    third: Option<&str>,
    joints: usize,
) -> Result<Option<usize>, Error> {
    match third {
        Some(text) if kind.order == Wish::No => match text.parse::<usize>() {
            _ if kind.from == Wish::No => Err(usage(option, "this kind has no order")),
            Ok(j) if (1..=joints).contains(&j) => Ok(Some(j - 1)),
            _ => Err(usage(
                option,
                &format!("the other joint is a number from 1 to {joints}"),
            )),
        },
        _ => Ok(None),
    }
}

/// All components of a kind on one joint. Components of a kind that may act on the base are
/// the base's.
fn of_joint(kind: &'static Kind, joint: usize, asked: Asked) -> impl Iterator<Item = Selector> {
    let components = if kind.base { 0 } else { kind.components.len() };
    // The neighbour before it leaks into a joint, where nothing else is said.
    let from = match kind.from {
        Wish::Must => asked.from.or(joint.checked_sub(1)),
        _ => asked.from,
    };
    let nothing = kind.from == Wish::Must && from.is_none_or(|from| from == joint);
    (0..components.max(1))
        .filter(move |_| !nothing)
        .map(move |component| Selector {
            joint: Some(joint),
            order: asked.order,
            from,
            component: (components > 0)
                .then(|| u8::try_from(component).ok())
                .flatten(),
            sensor: None,
        })
}

fn of_base(kind: &'static Kind) -> impl Iterator<Item = Selector> {
    let components = kind.components.len();
    (0..components.max(1)).map(move |component| Selector {
        component: (components > 0)
            .then(|| u8::try_from(component).ok())
            .flatten(),
        ..Selector::default()
    })
}

/// What the effect depends on must be in the description or the file.
fn check_needs(option: &str, kind: &Kind, robot: &Robot, data: &Dataset) -> Result<(), Error> {
    let masses = robot.joints.iter().any(|j| j.link.is_some()) || data.available.payload;
    let missing = match kind.needs {
        Needs::Masses if !masses => "masses of the links ([joint.link]) or a payload",
        Needs::Direction if !data.available.direction => "the columns dir1, ...",
        Needs::Temperature if data.available.temperature == 0 => "a column temp",
        Needs::Time if !data.available.time => "a column t",
        _ => return Ok(()),
    };
    Err(usage(option, &format!("needs {missing}")))
}
