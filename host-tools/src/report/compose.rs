//! From an identification to its report.

use truepose::JointKind;

use super::found::{completeness, effects, estimator, parameters};
use super::rows::rows;
use super::verdict::judge;
use super::{Distances, Report, schema};
use crate::diagnose::UNDECIDED;
use crate::diagnose::freed::{Freed, freed};
use crate::identify::arm::ArmModel;
use crate::identify::assess::{Errors, Statistics, errors};
use crate::identify::bootstrap::Bootstrap;
use crate::identify::evaluator::Evaluator;
use crate::identify::noise::{Component, fitted, of_fitted, unseen};
use crate::identify::observation::{self, Observation};
use crate::identify::predicted::{Covariance, Uncertainty};
use crate::identify::problem::{ASSUMED, Joints};
use crate::identify::readings::Identified;
use crate::identify::relation::Relation;
use crate::identify::unknown::Unknown;
use crate::identify::{Calibration, Failure, Stage};
use crate::measurement::{Dataset, Measured};

pub(super) const MM: f64 = 1e3;

impl Report {
    /// Of an identification. `robot`: its name.
    pub fn new(robot: &str, data: &Dataset, identified: &Identified) -> Result<Self, Failure> {
        let Identified {
            problem,
            calibration,
            ..
        } = identified;
        let verify = unseen(problem, calibration);
        let by = |arm| errors(arm, &verify);
        let [nominal, geometric, complete] = [
            by(&calibration.nominal.arm),
            by(&calibration.geometric.arm),
            by(&calibration.complete.arm),
        ];
        let of = |pick: fn(&Errors) -> &Vec<f64>, factor| {
            let each = [&nominal, &geometric, &complete].map(|e| Statistics::of(pick(e)));
            three(each, factor)
        };
        let error_mm = of(|e| &e.distances, MM).ok_or(Failure::NothingToVerify)?;
        let error_deg = of(|e| &e.angles, 1.0_f64.to_degrees());
        let judgement = judge(problem, calibration, data);
        let mut report = Self {
            summary: schema::Summary {
                robot: robot.to_owned(),
                measured: measured(data, error_deg.is_some()),
                rows: schema::Rows {
                    identify: fitted(problem, calibration).len(),
                    verify: verify.len(),
                    rejected: calibration.rejected.clone(),
                },
                error_mm,
                error_deg,
                error_mm_blocks: None,
                noise_mm: schema::Noise {
                    declared: None,
                    estimated: None,
                },
                noise_deg: None,
                model_sigma_mm: model_sigma(&calibration.complete, &verify),
                estimator: estimator(problem, calibration),
                covariance: Covariance::of(&calibration.complete),
                verdict: judgement.verdict,
                effects: effects(calibration, &error_mm),
                completeness: completeness(problem, calibration),
                parameters: parameters(calibration),
                joints: joints_used(identified),
                notes: Vec::new(),
            },
            distances_mm: Distances {
                nominal: scaled(&nominal.distances, MM),
                geometric: scaled(&geometric.distances, MM),
                complete: scaled(&complete.distances, MM),
            },
            rows: rows(calibration, &verify),
            joint_units: calibration
                .complete
                .arm
                .joints
                .iter()
                .map(|joint| joint_unit(joint.kind).0)
                .collect(),
            evidence: Vec::new(),
            reasons: judgement.reasons,
            assumed: Vec::new(),
            held_back: Vec::new(),
            noticed: judgement.noticed,
            held_explains: false,
        };
        report.estimate_noise(data, identified);
        report.say(data, identified);
        Ok(report)
    }

    /// Puts in how the parameters scatter when the rows are drawn anew.
    pub fn add_bootstrap(&mut self, calibration: &Calibration, bootstrap: &Bootstrap) {
        let arm = &calibration.complete.arm;
        for (unknown, scatter) in &bootstrap.each {
            let name = unknown.name(arm);
            let of = self.summary.parameters.iter_mut().find(|p| p.name == name);
            if let Some(parameter) = of {
                parameter.bootstrap = Some(schema::Bootstrap {
                    sigma: scatter.sigma,
                    interval95: scatter.interval95,
                });
            }
        }
        let (draws, failed) = (bootstrap.draws, bootstrap.failed);
        let mut sentence = format!("bootstrap: {draws} fits of rows drawn anew");
        if failed > 0 {
            sentence.push_str(&format!(
                "; {failed} more draws had too few different rows for all parameters"
            ));
        }
        self.noticed.push(sentence.clone());
        self.summary.notes.push(sentence);
    }

    fn estimate_noise(&mut self, data: &Dataset, identified: &Identified) {
        let (problem, calibration) = (&identified.problem, &identified.calibration);
        let stage = &calibration.complete;
        let kept = fitted(problem, calibration);
        let found = of_fitted(stage, &kept, problem.sigmas);
        let noise =
            |declared: Option<f64>, weight: f64, of: &Component, factor: f64| schema::Noise {
                declared: declared.map(|s| s * factor),
                estimated: of.ratio().map(|ratio| ratio * weight * factor),
            };
        let (s, by) = (problem.sigmas, data.noise);
        let range = range(&stage.arm, &kept);
        let degrees = 1.0_f64.to_degrees();
        use schema::Measured as M;
        self.summary.noise_mm = match self.summary.measured {
            M::Length => noise(by.length, s.length, &found.length, MM),
            M::Distance => noise(by.distance, s.distance, &found.distance, MM),
            M::Point | M::Plane => noise(by.contact, s.contact, &found.contact, MM),
            M::Bearing | M::Sight => noise(by.bearing, s.bearing, &found.bearing, MM * range),
            M::Position | M::Pose | M::Board | M::Mark => {
                noise(by.position, s.position, &found.position, MM)
            }
        };
        self.summary.noise_deg = match self.summary.measured {
            M::Pose | M::Board => Some(noise(
                by.orientation,
                s.orientation,
                &found.orientation,
                degrees,
            )),
            M::Bearing | M::Sight => Some(noise(by.bearing, s.bearing, &found.bearing, degrees)),
            _ => None,
        };
    }

    /// Assumptions and omissions in sentences.
    fn say(&mut self, data: &Dataset, identified: &Identified) {
        let calibration = &identified.calibration;
        let noise = &data.noise;
        let assumed = &mut self.assumed;
        let length = data.measured == Measured::Length;
        let positions = matches!(
            data.measured,
            Measured::Position | Measured::Pose | Measured::Board | Measured::Mark
        );
        if positions && noise.position.is_none() {
            assumed.push(format!(
                "the instrument's noise is not declared: positions weighted as by {:.3} mm an \
                 axis; position_sigma_mm in the sidecar says better",
                ASSUMED.position * MM
            ));
        }
        if matches!(data.measured, Measured::Pose | Measured::Board) && noise.orientation.is_none()
        {
            assumed.push(format!(
                "orientations weighted as by {:.3} deg an axis; orientation_sigma_deg says \
                 better",
                ASSUMED.orientation.to_degrees()
            ));
        }
        if length && noise.length.is_none() {
            assumed.push(format!(
                "the instrument's noise is not declared: lengths weighted as by {:.3} mm; \
                 length_sigma_mm in the sidecar says better",
                ASSUMED.length * MM
            ));
        }
        let problem = &identified.problem;
        let has = |is: fn(&Relation) -> bool| {
            let mut all = problem.identify.iter().flat_map(|o| &o.relations);
            all.any(is)
        };
        if noise.distance.is_none() && has(|r| matches!(r, Relation::Distance { .. })) {
            assumed.push(format!(
                "distances between poses weighted as by {:.3} mm; distance_sigma_mm in the \
                 sidecar says better",
                ASSUMED.length * MM
            ));
        }
        let touch = |r: &Relation| matches!(r, Relation::Point { .. } | Relation::Plane { .. });
        if noise.contact.is_none() && has(touch) {
            assumed.push(format!(
                "touches weighted as by {:.3} mm; contact_sigma_mm in the sidecar says better",
                ASSUMED.contact * MM
            ));
        }
        if noise.bearing.is_none() && has(|r| r.kind() == observation::Kind::Bearing) {
            assumed.push(format!(
                "bearings weighted as by {:.4} deg; bearing_sigma_deg in the sidecar says better",
                ASSUMED.bearing.to_degrees()
            ));
        }
        for (what, numbers) in [("point", &problem.points), ("plane", &problem.planes)] {
            let named = numbers.iter().zip(1..).filter(|(n, place)| **n != *place);
            for (number, place) in named {
                assumed.push(format!(
                    "{what} {place} here is {what} {number} of the file"
                ));
            }
        }
        let placements = identified.problem.sessions.len();
        let board = data.measured == Measured::Board;
        assumed.push(match placements {
            _ if !board && problem.identify.iter().any(Observation::is_view) => {
                "what is seen from the tool stood still, and where is found".to_owned()
            }
            0 | 1 if board => {
                "the board stood still: one placement, found from the measurements".to_owned()
            }
            n if board => format!("{n} placements of the board, each found from its own rows"),
            0 | 1 => {
                "the instrument stood still: one placement, found from the measurements".to_owned()
            }
            n => format!("{n} placements of the instrument, each found from its own rows"),
        });
        for pair in &calibration.structure.parallel {
            self.noticed.push(format!(
                "axes {} and {} are {:.3} deg from parallel: beta in place of d of joint {} \
                 (Hayati)",
                pair.first + 1,
                pair.first + 2,
                pair.angle.to_degrees(),
                pair.joint + 1
            ));
        }
        if let Some(c) = &identified.comparison {
            let (used, other) = match identified.joints {
                Joints::Readings => ("readings", "commands"),
                Joints::Commands => ("commands", "readings"),
            };
            let mut units = String::new();
            for (difference, joint) in c.difference.iter().zip(&calibration.complete.arm.joints) {
                let (unit, factor) = joint_unit(joint.kind);
                let figure = super::figures::significant(difference * factor);
                units.push_str(&format!(" {figure} {unit}"));
            }
            self.noticed.push(format!(
                "the file has readings and commands: the {used} fit better than the {other} \
                 (identify rows, geometry: {} mm with readings, {} mm with commands) and are \
                 used; they differ by (rms, joint by joint){units}",
                super::figures::significant(c.rms_readings * MM),
                super::figures::significant(c.rms_commands * MM),
            ));
            if c.without_command > 0 {
                self.noticed.push(format!(
                    "{} rows have no command; their readings stand for it",
                    c.without_command
                ));
            }
        }
        let count = &self.summary.completeness;
        let of = match count.rank == count.complete {
            true => "which is the rank of full poses all over the workspace".to_owned(),
            false => format!(
                "of which full poses all over the workspace tell {} apart",
                count.rank
            ),
        };
        self.noticed.push(format!(
            "a complete model of this arm has 4R + 2P + 6 = {} parameters, {of}; {} of base, \
             joints and tool are identified here",
            count.complete, count.identified
        ));
        if count.held > 0 {
            let mut sentence = format!("{} parameters are held as asked", count.held);
            if let Some(freed) = freed(problem, calibration)
                && freed.delta_bic > -UNDECIDED
            {
                sentence.push_str(&wrongly_held(&freed));
                self.held_explains = true;
            }
            self.noticed.push(sentence);
        }
        let used = &self.summary.estimator;
        if !used.outliers.is_empty() {
            let each: Vec<String> = used
                .outliers
                .iter()
                .map(|o| format!("{} ({:.2})", o.row, o.weight))
                .collect();
            self.noticed.push(format!(
                "rows that the {} loss trusts less than half, with their weights: {}",
                used.loss,
                each.join(", ")
            ));
        }
        if let (Some(prior), Some(sizes)) = (&used.prior, &calibration.sizes) {
            let shown = |tolerance: &schema::Tolerance| match (tolerance.mm, tolerance.deg) {
                (Some(mm), Some(deg)) => format!(
                    "{} mm and {} deg",
                    super::figures::significant(mm),
                    super::figures::significant(deg)
                ),
                _ => "no prior".to_owned(),
            };
            let each: Vec<String> = prior
                .tried
                .iter()
                .map(|t| {
                    let rms = super::figures::significant(t.rms_mm);
                    format!("{} {rms}", shown(&t.tolerance))
                })
                .collect();
            self.noticed.push(format!(
                "size of the prior by cross-validation on {} rows of the fit: {}; rms of rows \
                 left out, mm, with {}",
                sizes.rows,
                shown(&prior.tolerance),
                each.join(", ")
            ));
        }
        if let Some(i) = &used.innovations {
            let say = match i.white {
                Some(true) => "pass for white noise: the model holds from row to row",
                Some(false) => "are not white: the model lacks something, or the parameters wander",
                None => "are too few to test",
            };
            self.noticed.push(format!(
                "innovations of the filter ({} equations, {:.2} times what it expected, chance \
                 of their mean {}, of their hanging together {}, of their leaning towards {} {}) \
                 {say}",
                i.count,
                i.rms,
                super::figures::significant(i.p_mean),
                super::figures::significant(i.p_correlation),
                i.drifts.as_deref().unwrap_or("any parameter"),
                super::figures::significant(i.p_drift)
            ));
        }
        let rows = &self.summary.rows;
        self.held_back.push(if data.held_back.is_empty() {
            format!(
                "{} verify rows, as the file says; no fit has seen them",
                rows.verify
            )
        } else {
            format!(
                "{} verify rows, {} of them chosen by the program; no fit has seen them",
                rows.verify,
                data.held_back.len()
            )
        });
        if !data.left_out.is_empty() {
            self.held_back.push(format!(
                "{} without joints or without any measured value",
                super::figures::row_list(&data.left_out)
            ));
        }
        if !rows.rejected.is_empty() {
            let mut sentence = format!(
                "{} as gross errors: they stand apart from the fit and from their neighbours",
                super::figures::row_list(&rows.rejected)
            );
            let gross = problem.verify.len() - rows.verify;
            if gross > 0 {
                let all: Vec<&Observation> = problem.verify.iter().collect();
                let rms = |stage: &Stage| {
                    let all = Statistics::of(&errors(&stage.arm, &all).distances);
                    super::figures::significant(all.map_or(0.0, |s| s.rms) * MM)
                };
                sentence.push_str(&format!(
                    "; {gross} of them were held back: with them the errors would be {} mm with \
                     geometry and {} mm with everything",
                    rms(&calibration.geometric),
                    rms(&calibration.complete)
                ));
            }
            self.held_back.push(sentence);
        }
        self.summary.notes = [&self.reasons, &self.assumed, &self.held_back, &self.noticed]
            .into_iter()
            .flatten()
            .cloned()
            .collect();
    }
}

fn measured(data: &Dataset, turned: bool) -> schema::Measured {
    match data.measured {
        Measured::Length => schema::Measured::Length,
        Measured::Bearing => schema::Measured::Bearing,
        Measured::Distance => schema::Measured::Distance,
        Measured::Point => schema::Measured::Point,
        Measured::Plane => schema::Measured::Plane,
        Measured::Board => schema::Measured::Board,
        Measured::Mark => schema::Measured::Mark,
        Measured::Sight => schema::Measured::Sight,
        Measured::Pose if turned => schema::Measured::Pose,
        _ => schema::Measured::Position,
    }
}

/// Typical distance that bearings were taken from, m.
fn range(arm: &ArmModel, observations: &[&Observation]) -> f64 {
    let mut evaluator = Evaluator::new(arm, ASSUMED);
    let (mut sum, mut count) = (0.0, 0);
    for o in observations {
        let mut seen = o.relations.iter();
        if let Some(seen) = seen.find(|r| r.kind() == observation::Kind::Bearing) {
            sum += seen.range(arm, &evaluator.observe(o));
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

fn spread(s: &Statistics, factor: f64) -> schema::Spread {
    schema::Spread {
        rms: s.rms * factor,
        mean: s.mean * factor,
        max: s.max * factor,
    }
}

fn three(each: [Option<Statistics>; 3], factor: f64) -> Option<schema::Errors> {
    let [nominal, geometric, complete] = each;
    let complete = complete?;
    Some(schema::Errors {
        nominal: spread(&nominal?, factor),
        geometric: spread(&geometric?, factor),
        complete: schema::Bounded {
            spread: spread(&complete, factor),
            rms_interval95: complete.rms_interval95.map(|x| x * factor),
        },
    })
}

pub(super) fn scaled(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|x| x * factor).collect()
}

pub(super) fn joint_unit(kind: JointKind) -> (&'static str, f64) {
    match kind {
        JointKind::Revolute => ("deg", 1.0_f64.to_degrees()),
        JointKind::Prismatic => ("mm", MM),
    }
}

/// What speaks against what is held.
fn wrongly_held(freed: &Freed) -> String {
    let of = |(unknown, sigmas): &(Unknown, f64)| {
        let arm = &freed.stage.arm;
        let name = unknown.name(arm);
        format!("; most of all {name} would leave its drawn value, by {sigmas:.0} standard errors")
    };
    format!(
        ", and may be what is wrong: with everything free, geometry alone leaves {} mm rms of the \
         held-back rows (BIC {} by {}){}",
        super::figures::significant(freed.rms * MM),
        if freed.delta_bic > 0.0 {
            "better"
        } else {
            "worse"
        },
        super::figures::significant(freed.delta_bic.abs()),
        freed.farthest.as_ref().map_or(String::new(), of)
    )
}

/// Standard deviation of the tool point by the parameters alone.
fn model_sigma(stage: &Stage, rows: &[&Observation]) -> Option<schema::Spread> {
    let each: Vec<f64> = Uncertainty::of(stage)
        .at(&stage.arm, rows)
        .iter()
        .map(|c| (c[(0, 0)] + c[(1, 1)] + c[(2, 2)]).max(0.0).sqrt())
        .collect();
    Statistics::of(&each).map(|s| spread(&s, MM))
}

fn joints_used(identified: &Identified) -> Option<schema::JointsUsed> {
    let c = identified.comparison.as_ref()?;
    Some(schema::JointsUsed {
        used: match identified.joints {
            Joints::Readings => "readings",
            Joints::Commands => "commands",
        }
        .to_owned(),
        rms_readings_mm: c.rms_readings * MM,
        rms_commands_mm: c.rms_commands * MM,
        difference: c.difference.clone(),
    })
}
