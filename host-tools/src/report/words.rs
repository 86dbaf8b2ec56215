//! An effect as a robot engineer would say it.

use truepose::JointKind;

use super::figures::significant;
use crate::diagnose::Named;
use crate::diagnose::hypothesis::Members;
use crate::identify::Stage;

/// What is wrong with the arm, in words, with its size where it is an angle or a way.
pub(super) fn words(named: &Named, stage: &Stage) -> String {
    let hypothesis = &named.step.hypothesis;
    let joint = hypothesis.joint.map(|j| format!("joint {}", j + 1));
    let one = joint.clone().unwrap_or_else(|| "the base".to_owned());
    let gear = joint.as_ref().map_or_else(
        || "the joints' gears".to_owned(),
        |joint| format!("{joint}'s gear"),
    );
    let bearing = joint.as_ref().map_or_else(
        || "the arm".to_owned(),
        |joint| format!("{joint}'s bearing"),
    );
    let link = hypothesis
        .joint
        .map_or_else(|| "the links".to_owned(), |j| format!("link {}", j + 1));
    let order = hypothesis.order.map_or_else(String::new, times);
    let values: Vec<f64> = named
        .effects
        .iter()
        .flat_map(|e| e.model().values().to_vec())
        .collect();
    let size = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let revolute = hypothesis
        .joint
        .is_none_or(|j| stage.arm.joints[j].kind == JointKind::Revolute);
    let angle = |x: f64| {
        if revolute {
            format!("{} deg", significant(x.to_degrees()))
        } else {
            format!("{} mm", significant(x * 1e3))
        }
    };
    let when = || {
        let constants = named
            .effects
            .first()
            .map(|e| e.model().constants().to_vec());
        let first = constants.and_then(|c| c.first().copied()).unwrap_or(0.0);
        if stage.arm.counts_rows {
            format!("row {}", significant(first))
        } else {
            format!("{} min", significant(first / 60.0))
        }
    };
    match hypothesis.kind {
        "joint-gain" => format!(
            "{one} moves {} % more or less than it says",
            significant(100.0 * size)
        ),
        "gear-eccentricity" => format!("{gear} runs out of true {order}, {}", angle(size)),
        "gear-ripple" => format!("{gear} ripples {order}, {}", angle(size)),
        "joint-curve" => {
            let peak = match &hypothesis.members {
                Members::Curve(_) => curve_peak(named, stage),
                _ => 0.0,
            };
            format!("{one}'s own angle is irregular, up to {}", angle(peak))
        }
        "joint-compliance" => match &joint {
            Some(joint) => format!("{joint} yields under load"),
            None => "the joints yield under load".to_owned(),
        },
        "cross-axis-compliance" => format!("{bearing} tilts across its axis under load"),
        "tool-load" => "the tool's weight bends the joints more than was declared".to_owned(),
        "link-bending" => format!("{link} bends under gravity"),
        "base-flex" => "the base tilts under the arm's weight".to_owned(),
        "backlash" => format!("{one} has play, {}", angle(2.0 * size)),
        "thermal-growth" => format!("{link} grows with temperature"),
        "thermal-drift" => format!("{one} drifts with temperature"),
        "time-drift" if stage.arm.counts_rows => format!("{one} drifts from row to row"),
        "time-drift" => format!("{one} drifts with time"),
        "warm-up" => format!(
            "{one} settles as the arm warms up, most of it by {}",
            when()
        ),
        "step-change" => format!("{one} jumped at {}", when()),
        "early-reading" => "the joints were probably read before the arm had settled (use the \
             commanded joints, or wait; a fault of the recording, not compensated)"
            .to_owned(),
        "joint-coupling" => match hypothesis.from {
            Some(from) => format!("joint {} leaks into {one}", from + 1),
            None => format!("another joint leaks into {one}"),
        },
        "axis-wobble" => format!("{one}'s axis wobbles {order}"),
        "prismatic-straightness" => format!("{one}'s rail is not straight"),
        "instrument-moved" => format!("the instrument moved against the arm's base at {}", when()),
        "unnamed" => format!("something without a name: {}", hypothesis.label()),
        _ => hypothesis.label(),
    }
}

fn times(order: f64) -> String {
    let whole = order.round();
    if (order - whole).abs() > 1e-9 {
        return format!("{} times a turn", significant(order));
    }
    match whole {
        1.0 => "once a turn".to_owned(),
        2.0 => "twice a turn".to_owned(),
        n => format!("{n} times a turn"),
    }
}

fn curve_peak(named: &Named, stage: &Stage) -> f64 {
    let joint = named.step.hypothesis.joint;
    stage
        .arm
        .effects
        .iter()
        .filter_map(|e| match e {
            truepose::effects::Effect::JointCurve(c) if Some(usize::from(c.joint)) == joint => {
                Some(c)
            }
            _ => None,
        })
        .flat_map(|c| (0..c.cells()).filter_map(|i| c.cell(i).map(|x: f64| (x * c.scale[0]).abs())))
        .fold(0.0, f64::max)
}
