//! The report as `--json` writes it.

use std::collections::BTreeMap;

use serde::Serialize;
use truepose::effects::{Kind, Selector};

use crate::identify::predicted::Covariance;
use crate::identify::unknown::effect_name;

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Measured {
    /// Positions of one or more targets.
    Position,
    /// Position and orientation.
    Pose,
    /// Distance to an unknown fixed point.
    Length,
    /// Bearings from stations.
    Bearing,
    /// Distances between pairs of poses.
    Distance,
    /// Touches of fixed points.
    Point,
    /// Touches of fixed planes.
    Plane,
    /// The pose of a fixed board, seen from the tool.
    Board,
    /// Positions of fixed points, seen from the tool.
    Mark,
    /// Bearings of fixed points, seen from the tool.
    Sight,
}

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// With the effects named, what is left is noise.
    Explained,
    /// Geometry alone leaves nothing but noise.
    NothingMissing,
    /// More is there than the model says.
    StructureRemains,
    /// Effects were found that these poses cannot tell apart.
    Ambiguous,
}

/// What became of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Fitted.
    Identified,
    /// Not observable here, or held as asked.
    Fixed,
    /// Only a combination is observable.
    Merged,
}

/// Rows of the measurements.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Rows {
    /// Number that the fit used.
    pub identify: usize,
    /// Number that no fit has seen.
    pub verify: usize,
    /// Rows left out as gross errors, by their number in the file, from 1.
    pub rejected: Vec<usize>,
}

/// Errors of a set of rows, mm or deg.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Root mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// The same with the interval that the rms lies in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounded {
    /// As above.
    #[serde(flatten)]
    pub spread: Spread,
    /// 95 % interval of the rms.
    pub rms_interval95: [f64; 2],
}

/// Errors of the verify rows, mm or deg.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Geometry as drawn, base and tool aligned.
    pub nominal: Spread,
    /// Geometry identified.
    pub geometric: Spread,
    /// Geometry and effects.
    #[serde(rename = "final")]
    pub complete: Bounded,
}

/// Errors cross-validated on blocks contiguous in joint space and in time, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BlockErrors {
    /// Geometry identified.
    pub geometric: Spread,
    /// Geometry and effects.
    #[serde(rename = "final")]
    pub complete: Spread,
}

/// Noise of the instrument, one standard deviation per axis, mm or deg.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Noise {
    /// By the sidecar; `None` where it says nothing.
    pub declared: Option<f64>,
    /// By what the fit leaves; `None` where it leaves nothing over to tell.
    pub estimated: Option<f64>,
}

/// What else an effect could have been.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Kind.
    pub kind: String,
    /// Joint, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<usize>,
    /// Periods per joint turn.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "whole")]
    pub order: Option<f64>,
    /// The other joint, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<usize>,
    /// Cosine between what the two do to the measurements.
    pub similarity: f64,
    /// How much worse it explains them.
    pub delta_bic: f64,
}

impl Effect {
    /// As it stands in the names of its parameters.
    pub fn name(&self) -> String {
        effect_name(&self.kind, &self.selector(&self.kind))
    }

    /// What it would be as an effect of this kind.
    fn selector(&self, kind: &str) -> Selector {
        let component = self.component.as_deref().and_then(|component| {
            let all = Kind::of(kind)?.components;
            let place = all.iter().position(|&c| c == component)?;
            u8::try_from(place).ok()
        });
        Selector {
            component,
            ..selector(self.joint, self.order, self.from)
        }
    }
}

impl Alternative {
    /// As it stands in reports.
    pub fn name(&self) -> String {
        effect_name(&self.kind, &selector(self.joint, self.order, self.from))
    }
}

impl Effect {
    /// SI unit of a parameter of that name; empty for a number.
    pub fn unit(&self, parameter: &str) -> &'static str {
        let unit = match (self.kind.as_str(), parameter) {
            ("joint-curve", "measured share") => "",
            ("early-reading" | "joint-curve" | "unnamed", _) => "rad",
            // a weight at the tool in place of masses that nobody described
            ("joint-compliance", "load") => self.unit_of("tool-load", parameter),
            ("instrument-moved", _) => self.unit_of("step-change", parameter),
            (kind, _) => self.unit_of(kind, parameter),
        };
        // a base shifts by metres
        let shifts = matches!(self.component.as_deref(), Some("x" | "y" | "z"));
        match unit {
            "rad" if self.joint.is_none() && shifts => "m",
            "rad/s" if self.joint.is_none() && shifts => "m/s",
            "rad/K" if self.joint.is_none() && shifts => "m/K",
            unit => unit,
        }
    }

    fn unit_of(&self, kind: &str, parameter: &str) -> &'static str {
        let selector = self.selector(kind);
        let effect = truepose::effects::Effect::<f64>::named(kind, &selector);
        effect.map_or("", |effect| {
            let model = effect.model();
            let mut all = model.parameters().iter().chain(model.constant_names());
            all.find(|(name, _)| *name == parameter)
                .map_or("", |(_, unit)| unit)
        })
    }
}

fn selector(joint: Option<usize>, order: Option<f64>, from: Option<usize>) -> Selector {
    let from_zero = |j: usize| j.saturating_sub(1);
    Selector {
        joint: joint.map(from_zero),
        order,
        from: from.map(from_zero),
        ..Selector::default()
    }
}

/// An effect in the final model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// Kind.
    pub kind: String,
    /// Joint, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<usize>,
    /// Periods per joint turn.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "whole")]
    pub order: Option<f64>,
    /// The other joint, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<usize>,
    /// Which of several of its kind, where there are such.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub component: Option<String>,
    /// Of a term without a name, what it depends on: columns of the measurements.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub depends_on: Vec<String>,
    /// Values by name, SI units.
    pub parameters: BTreeMap<String, f64>,
    /// Standard errors of the same; nothing stands here for one that was not identified.
    pub sigma: BTreeMap<String, f64>,
    /// Probability that noise alone would show as much.
    pub p_value: f64,
    /// Rms of the verify rows without it, mm.
    pub rms_before_mm: f64,
    /// Rms of the verify rows with it, mm.
    pub rms_after_mm: f64,
    /// What it could have been instead.
    pub alternatives: Vec<Alternative>,
    /// Itself with its covariate dealt to other rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control: Option<Shuffled>,
    /// Why the name is no more than what the effect looks like; nothing where there is no
    /// reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_doubt: Option<String>,
}

/// Shares of the squared residual that an effect takes, as it is and with its covariate
/// shuffled among the rows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shuffled {
    /// `"direction"`, `"torque"`, `"payload"`, `"temperature"`, `"time"`, `"last move"` or
    /// `"readings"`.
    pub covariate: String,
    /// As it is.
    pub own: f64,
    /// Mean of all shuffles.
    pub shuffled: f64,
    /// Largest of all shuffles.
    pub largest: f64,
    /// Of an early reading, with the move before the last in place of the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub move_before: Option<f64>,
}

/// A parameter of the geometry or of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Name, joints counted from 1.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// As drawn; base and tool as aligned to the drawn geometry.
    pub nominal: f64,
    /// In the final model.
    pub value: f64,
    /// Standard error; `None` where it was not identified.
    pub sigma: Option<f64>,
    /// Its scatter when the rows were drawn anew, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<Bootstrap>,
    /// What became of it.
    pub status: Status,
    /// Why it was not identified.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// Scatter of a parameter when the rows were drawn anew, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bootstrap {
    /// Standard error.
    pub sigma: f64,
    /// 2.5 and 97.5 % of the values.
    pub interval95: [f64; 2],
}

/// How the parameters were found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimator {
    /// As `--estimator` names it.
    pub name: String,
    /// As `--loss` names it.
    pub loss: String,
    /// Passes over the rows that the last fit took.
    pub iterations: usize,
    /// Rows that a robust loss trusts less than half.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<Outlier>,
    /// What a Kalman filter did not expect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub innovations: Option<Innovations>,
    /// What the drawing counts for, where it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<Prior>,
}

/// How far joint parameters may be from the drawing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prior {
    /// The tolerance of the fit.
    #[serde(flatten)]
    pub tolerance: Tolerance,
    /// Every size that was cross-validated, the weakest prior first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tried: Vec<Tried>,
}

/// One standard deviation; `null` where nothing is expected of joint parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tolerance {
    /// Of lengths.
    pub mm: Option<f64>,
    /// Of angles.
    pub deg: Option<f64>,
}

/// A size of the prior, and rows of the fit that were left out of fits with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// The size.
    #[serde(flatten)]
    pub tolerance: Tolerance,
    /// Rms of their distances.
    pub rms_mm: f64,
    /// Rms of all their equations over the noise; the least is chosen.
    pub rms_noise: f64,
}

/// A row that a robust loss trusts less than half.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Number in the file, from 1.
    pub row: usize,
    /// 0 to 1.
    pub weight: f64,
}

/// What a Kalman filter did not expect of each equation, over its own standard deviation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Innovations {
    /// Number.
    pub count: usize,
    /// Root mean square; 1 where the declared noise is right.
    pub rms: f64,
    /// Chance that white innovations have a mean as far from zero.
    pub p_mean: f64,
    /// Chance that white innovations hang together as much from row to row.
    pub p_correlation: f64,
    /// Chance that white innovations lean as much towards what any one parameter does.
    pub p_drift: f64,
    /// Name of that parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drifts: Option<String>,
    /// Whether they pass for white; `None` where there are too few to say.
    pub white: Option<bool>,
}

/// Which joint values the fit used, where the file has both.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointsUsed {
    /// `"readings"` or `"commands"`.
    pub used: String,
    /// Rms of the identify rows with the readings, geometry identified, mm.
    pub rms_readings_mm: f64,
    /// The same with the commands, mm.
    pub rms_commands_mm: f64,
    /// Rms difference of the two, one a joint, rad or m.
    pub difference: Vec<f64>,
}

/// Parameters of base, joints and tool, effects and what stands around the arm aside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Completeness {
    /// Of a complete model, 4R + 2P + 6 (MRD 2.95).
    pub complete: usize,
    /// That full poses all over the workspace tell apart, nothing being held: the numerical rank.
    pub rank: usize,
    /// Held as asked.
    pub held: usize,
    /// Identified from these measurements.
    pub identified: usize,
}

/// The whole report. What is beyond FORMATS.md (`noise_deg`, `joints`, `notes`) is left out
/// where there is nothing to say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the robot.
    pub robot: String,
    /// What was measured.
    pub measured: Measured,
    /// How many rows did what.
    pub rows: Rows,
    /// Distances between prediction and measurement; of lengths, their differences.
    pub error_mm: Errors,
    /// Angles between them, with full poses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_deg: Option<Errors>,
    /// `error_mm` once more, cross-validated on blocks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_mm_blocks: Option<BlockErrors>,
    /// Noise of positions, lengths, distances or touches; of bearings, at the distance over
    /// which they were taken.
    pub noise_mm: Noise,
    /// Noise of orientations, with full poses, or of bearings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_deg: Option<Noise>,
    /// Standard deviation of the predicted tool point by the parameters' covariance, of all
    /// three axes together, over the verify rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_sigma_mm: Option<Spread>,
    /// How the parameters were found.
    pub estimator: Estimator,
    /// The answer.
    pub verdict: Verdict,
    /// Effects in the final model.
    pub effects: Vec<Effect>,
    /// How many parameters count.
    pub completeness: Completeness,
    /// Every parameter.
    pub parameters: Vec<Parameter>,
    /// Covariance of the identified parameters, SI units.
    pub covariance: Covariance,
    /// Readings or commands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joints: Option<JointsUsed>,
    /// What was assumed, held back or noticed, a sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// A whole number without its point, so that order 1 is `1`.
fn whole<S: serde::Serializer>(order: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    match order {
        Some(x) if x.fract().abs() < f64::EPSILON && x.abs() < 1e9 => to.serialize_i64(*x as i64),
        Some(x) => to.serialize_f64(*x),
        None => to.serialize_none(),
    }
}
