//! Mooring, Roth and Driels against their own tables: conversion (6.7 to 6.10), gain in
//! accuracy (6.13), the 5R1P study (4.2 to 4.7), and the two-link example (4.5.5).

#![expect(clippy::unwrap_used, reason = "helpers of tests stop the test")]

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Vector3, Vector4};
use truepose::effects::Ambient;
use truepose::{Joint, JointKind, Parameter, Pose};
use truepose_host::convert::link::Link;
use truepose_host::convert::{Form, convert};
use truepose_host::description::{Robot, RobotJoint};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::identify;
use truepose_host::identify::linearize::{Evaluator, linearize};
use truepose_host::identify::method::Method;
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::identify::problem::Problem;
use truepose_host::identify::unknown::{Unknown, apply};
use truepose_host::observability::{Observability, Unobservable};
use truepose_host::random::Random;

/// Direction and point of the six axes in the workspace, inches, as printed.
type Axes = [[f64; 6]; 6];

/// Table 6.7.
const FILE_1: Axes = [
    [-0.001, 1.000, -0.002, -15.044, 14.70, 33.601],
    [-0.003, -0.002, -1.000, -15.063, 14.014, 27.73],
    [-0.010, -0.001, -1.000, 1.926, 14.690, 27.73],
    [0.006, 1.000, 0.006, 1.229, 31.75, 27.716],
    [0.407, 0.002, -0.913, 1.228, 31.752, 27.73],
    [0.000, 1.000, 0.002, 1.224, 31.75, 27.729],
];

/// Table 6.8.
const FILE_2: Axes = [
    [-0.002, 1.000, -0.002, -15.048, 14.70, 33.601],
    [-0.004, -0.002, -1.000, -15.067, 14.010, 27.73],
    [-0.010, -0.001, -1.000, 1.919, 14.691, 27.73],
    [0.006, 1.000, 0.004, 1.224, 31.75, 27.707],
    [0.158, 0.004, -0.987, 1.224, 31.751, 27.73],
    [0.000, 1.000, 0.004, 1.220, 31.75, 27.721],
];

/// Tables 6.9 and 6.10, converted: d, l and alpha, in the third row l, alpha and beta; inches
/// and deg. Slips: the print loses the sign of alpha in row 6 of 6.9 (it has a minus that 6.5
/// and 6.1 do not have) and of rows 2 of 6.10 (6.6 has the minus).
const CONVERTED_1: [[f64; 3]; 6] = [
    [33.632, -15.022, -90.120],
    [14.048, 0.000, -89.983],
    [17.038, 0.066, -0.353],
    [5.939, -0.807, 90.393],
    [17.060, 0.005, -90.025],
    [-0.015, -0.004, 89.987],
];
const CONVERTED_2: [[f64; 3]; 6] = [
    [33.635, -15.021, -90.132],
    [14.048, 0.001, -89.977],
    [17.034, 0.071, -0.336],
    [5.916, -0.796, 90.313],
    [17.054, 0.003, -89.977],
    [-0.014, -0.005, 89.979],
];

/// MRD 6.3.4: from the workspace frame along the axes.
fn converted(axes: &Axes) -> [[f64; 3]; 6] {
    let mut at = Pose::identity();
    let mut rows = [[0.0; 3]; 6];
    for (k, (axis, row)) in axes.iter().zip(&mut rows).enumerate() {
        let [ux, uy, uz, px, py, pz] = *axis;
        let back = at.inverse();
        let u = back.rotation * Vector3::new(ux, uy, uz).normalize();
        let p = back.point(&Vector3::new(px, py, pz));
        let link = if k == 2 {
            let link = Link::in_plane(&u, &p, 0.0);
            *row = [link.a, link.alpha.to_degrees(), link.beta.to_degrees()];
            link
        } else {
            let link = Link::by_common_normal(&u, &p, 0.0);
            *row = [link.d, link.a, link.alpha.to_degrees()];
            link
        };
        at = at.then(&link.pose());
    }
    rows
}

#[test]
fn zero_reference_parameters_convert_to_the_printed_ones() {
    for (axes, printed) in [(FILE_1, CONVERTED_1), (FILE_2, CONVERTED_2)] {
        let ours = converted(&axes);
        // Half of the last printed digit, of the result and of every number that went into it.
        let half = 0.0005;
        let mut slack = [[half; 3]; 6];
        for row in 0..6 {
            for column in 0..6 {
                let mut off = axes;
                off[row][column] += half;
                let moved = converted(&off);
                for (slack, (a, b)) in slack.iter_mut().zip(moved.iter().zip(&ours)) {
                    for (slack, (a, b)) in slack.iter_mut().zip(a.iter().zip(b)) {
                        *slack += (a - b).abs();
                    }
                }
            }
        }
        for (k, ((ours, printed), slack)) in ours.iter().zip(&printed).zip(&slack).enumerate() {
            for ((a, b), s) in ours.iter().zip(printed).zip(slack) {
                assert!((a - b).abs() <= *s, "row {}: {a} {b} within {s}", k + 1);
                // Three decimals of a direction are 0.03 deg; nothing is wider than that allows.
                assert!(*s < 0.25, "row {}: {s}", k + 1);
            }
        }
    }
}

const INCH: f64 = 0.0254;

/// d, l, alpha, theta (row 3: l, alpha, beta, theta), inches and deg; then the tool: dx, dy,
/// dz, turns about x, y, z.
struct Puma {
    rows: [[f64; 4]; 6],
    tool: [f64; 6],
}

/// Table 6.1; its own zero-position drawing has 90 for the tool's turn about z.
const NOMINAL: Puma = Puma {
    rows: [
        [32.878, -15.591, -90.0, 0.0],
        [14.681, 0.0, -90.0, 0.0],
        [17.0, 0.0, 0.0, 0.0],
        [5.870, -0.8, 90.0, 0.0],
        [17.05, 0.0, -90.0, 0.0],
        [0.0, 0.0, 90.0, 0.0],
    ],
    tool: [0.0, 0.0, 2.213, 0.0, 0.0, 90.0],
};

/// Tables 6.5 and 6.6.
const BUILT: [Puma; 2] = [
    Puma {
        rows: [
            [33.632, -15.022, -90.121, 0.086],
            [14.047, 0.0, -89.981, 1.962],
            [17.038, 0.062, -0.354, -0.109],
            [5.939, -0.807, 90.397, 0.735],
            [17.055, 0.005, -90.025, -0.512],
            [-0.015, -0.004, 89.986, -1.443],
        ],
        tool: [-0.001, 0.024, 2.211, -0.019, 0.140, 87.901],
    },
    Puma {
        rows: [
            [33.635, -15.021, -90.132, 0.103],
            [14.048, 0.001, -89.974, 1.959],
            [17.034, 0.069, -0.337, -0.098],
            [5.915, -0.796, 90.310, 0.691],
            [17.054, 0.003, -89.978, -0.527],
            [-0.014, -0.005, 89.983, -1.442],
        ],
        tool: [-0.009, 0.020, 2.212, -0.006, 0.208, 87.907],
    },
];

impl Puma {
    /// The first row leads from the workspace to the base, the others are the joints' links,
    /// joint 6 has the tool alone (6.4: turns about z, y, x, then the shift).
    fn robot(&self) -> Robot {
        let link = |k: usize, row: &[f64; 4]| {
            let [a, b, c, theta] = *row;
            let theta = theta.to_radians();
            match k {
                2 => Link {
                    theta,
                    a: a * INCH,
                    alpha: b.to_radians(),
                    beta: c.to_radians(),
                    d: 0.0,
                },
                _ => Link {
                    theta,
                    d: a * INCH,
                    a: b * INCH,
                    alpha: c.to_radians(),
                    beta: 0.0,
                },
            }
        };
        let links: Vec<Link> = self
            .rows
            .iter()
            .enumerate()
            .map(|(k, r)| link(k, r))
            .collect();
        let joint = |k: usize| {
            let link = links.get(k + 1).copied().unwrap_or_default();
            let mut joint = Joint::dh(JointKind::Revolute, link.theta, link.d, link.a, link.alpha);
            if k == 1 {
                joint.convention = truepose::Convention::Hayati;
                joint.beta = link.beta;
            }
            RobotJoint {
                joint,
                limits: None,
                ratio: None,
                resolution: None,
                link: None,
            }
        };
        let [dx, dy, dz, x, y, z] = self.tool;
        let turn = Pose::from_xyz_rpy(Vector3::zeros(), Vector3::new(x, y, z).map(f64::to_radians));
        Robot {
            name: "PUMA 560".to_owned(),
            base: links[0].pose(),
            joints: (0..6).map(joint).collect(),
            tool: turn.then(&Pose::translate(dx * INCH, dy * INCH, dz * INCH)),
            gravity: Vector3::zeros(),
            source: "puma.toml".into(),
        }
    }
}

fn model(robot: &Robot) -> ArmModel {
    let joints = robot.geometry();
    ArmModel::new(
        robot.base,
        joints,
        robot.masses(),
        robot.tool,
        robot.gravity,
    )
}

fn observation(q: Vec<f64>, position: Vector3<f64>, rotation: Option<Pose<f64>>) -> Observation {
    Observation {
        row: 0,
        direction: vec![0.0; q.len()],
        travel: vec![0.0; q.len()],
        q,
        ambient: Ambient::default(),
        session: 0,
        position: Some(position),
        rotation: rotation.map(|pose| pose.rotation),
        targets: Vec::new(),
        length: None,
        relations: Vec::new(),
        weight: 1.0,
    }
}

#[test]
fn both_models_of_the_case_study_gain_more_than_an_order_of_magnitude() {
    // Noise of table 6.4 (its mean over the axes), 50 poses to identify, 10 to assess by 6.41
    // and 6.42. The joints go all round, so that both models see all of their parameters.
    let sigmas = Sigmas {
        position: 5e-5,
        orientation: 5.7e-4,
        length: 1.0,
    };
    for (seed, built) in BUILT.iter().enumerate() {
        let (built, nominal) = (built.robot(), NOMINAL.robot());
        let mut random = Random::new(seed as u64, 61);
        let mut measure = |count: usize| -> Vec<Observation> {
            (0..count)
                .map(|_| {
                    let q: Vec<f64> = (0..6).map(|_| random.between(-PI, PI)).collect();
                    let pose = built.forward(&q);
                    let mut v = |s: f64| {
                        Vector3::new(random.normal(), random.normal(), random.normal()) * s
                    };
                    let position = pose.translation + v(sigmas.position);
                    let turn = Pose::from_rotation_vector(&v(sigmas.orientation));
                    observation(q, position, Some(turn.then(&pose)))
                })
                .collect()
        };
        let (fit, assessed) = (measure(50), measure(10));
        // Mean of 6.41 (rad) and 6.42 (m), of the measured inverse times the predicted pose.
        let error = |predict: &dyn Fn(&[f64]) -> Pose<f64>| {
            let errors: Vec<[f64; 2]> = assessed
                .iter()
                .map(|o| {
                    let measured = Pose::new(o.rotation.unwrap(), o.position.unwrap());
                    let off = measured.inverse().then(&predict(&o.q));
                    [off.rotation_vector().norm(), off.translation.norm()]
                })
                .collect();
            [0, 1].map(|k| errors.iter().map(|e| e[k]).sum::<f64>() / errors.len() as f64)
        };
        let before = error(&|q| nominal.forward(q));
        // Table 6.13, nominal: 1 to 6 deg and 0.7 to 1.7 in.
        assert!((0.02..0.1).contains(&before[0]) && (0.017..0.045).contains(&before[1]));
        let mut found: Vec<ArmModel> = Vec::new();
        for form in [Form::Hayati, Form::ZeroReference] {
            let drawing = model(&convert(&nominal, form).unwrap().robot);
            let problem = Problem {
                drawing,
                identify: fit.clone(),
                verify: Vec::new(),
                sigmas,
                sessions: vec![0],
                points: Vec::new(),
                planes: Vec::new(),
                stations: 0,
                targets_known: false,
                method: Method::default(),
                target_offsets: Vec::new(),
                effects: Vec::new(),
            };
            let arm = identify(&problem).unwrap().complete.arm;
            let after = error(&|q| {
                let mut evaluator = Evaluator::new(&arm, sigmas);
                evaluator.go(0, q, &[0.0; 6], &Ambient::default())
            });
            for k in 0..2 {
                assert!(
                    before[k] > 10.0 * after[k],
                    "{form:?}: {before:?} {after:?}"
                );
            }
            found.push(arm);
        }
        // Each model converges to the same physical geometry (6.3.4), well within the noise.
        for o in &assessed {
            let [a, b] = [&found[0], &found[1]].map(|arm| {
                let mut evaluator = Evaluator::new(arm, sigmas);
                evaluator.go(0, &o.q, &[0.0; 6], &Ambient::default())
            });
            let off = a.twist_to(&b);
            assert!(off.linear.norm() < 1e-6 && off.angular.norm() < 1e-6);
        }
    }
}

/// Table 4.1, the tool `tool` inches from the wrist; inches stand for metres here.
fn study(tool: f64) -> ArmModel {
    let row = |kind, alpha: f64, a: f64, d: f64| Joint::dh(kind, 0.0, d, a, alpha.to_radians());
    let (r, p) = (JointKind::Revolute, JointKind::Prismatic);
    let joints = vec![
        row(r, -90.0, 0.0, 6.0),
        row(r, 90.0, 0.0, 12.0),
        row(p, 30.0, 0.0, 0.0),
        row(r, 90.0, 0.0, 0.0),
        row(r, 90.0, 0.0, 0.0),
        row(r, 0.0, tool, tool),
    ];
    let masses = vec![truepose::LinkMass::none(); 6];
    let (base, tool) = (Pose::identity(), Pose::identity());
    ArmModel::new(base, joints, masses, tool, Vector3::zeros())
}

/// The 21 parameters: l of the slide, r of the joint after it and the last alpha are fixed.
fn studied() -> Vec<Unknown> {
    use Parameter::{A, Alpha, D, Theta};
    let fixed = [(2, A), (3, D), (5, Alpha)];
    (0..6)
        .flat_map(|j| [Theta, D, A, Alpha].map(|p| (j, p)))
        .filter(|at| !fixed.contains(at))
        .map(|(j, p)| Unknown::Joint(j, p))
        .collect()
}

/// Joint ranges of table 4.7, deg and inches.
fn range(letter: char) -> [[f64; 2]; 6] {
    let first = match letter {
        'N' => [[0.0, 300.0], [-120.0, 120.0], [12.0, 48.0]],
        'F' => [[0.0, 360.0], [-180.0, 180.0], [12.0, 48.0]],
        'H' => [[0.0, 180.0], [-90.0, 90.0], [30.0, 48.0]],
        'Q' => [[0.0, 90.0], [-45.0, 45.0], [39.0, 48.0]],
        _ => [[0.0, 45.0], [-22.0, 22.0], [44.0, 48.0]],
    };
    [
        first[0],
        first[1],
        first[2],
        [0.0, 360.0],
        [-120.0, 120.0],
        [0.0, 360.0],
    ]
}

/// The four strategies of table 4.6: all joints together, one joint alone, all but one, by
/// chance.
fn strategy(number: usize, m: usize, letter: char, random: &mut Random) -> Vec<Vec<f64>> {
    let limits = range(letter);
    let at = |j: usize, share: f64| {
        let [low, high] = limits[j];
        let x = low + (high - low) * share;
        if j == 2 { x } else { x.to_radians() }
    };
    match number {
        1 => (0..m)
            .map(|k| (0..6).map(|j| at(j, k as f64 / (m - 1) as f64)).collect())
            .collect(),
        2 | 3 => (0..6)
            .flat_map(|still| (0..m / 6).map(move |k| (still, k as f64 / (m / 6 - 1) as f64)))
            .map(|(one, share)| {
                let moves = |j: usize| (j == one) == (number == 2);
                (0..6)
                    .map(|j| at(j, if moves(j) { share } else { 0.5 }))
                    .collect()
            })
            .collect(),
        _ => (0..m)
            .map(|_| (0..6).map(|j| at(j, random.unit())).collect())
            .collect(),
    }
}

/// Conditions of a simulation, and its outcome.
#[derive(Clone, Copy)]
struct Case {
    tool: f64,
    strategy: usize,
    poses: usize,
    range: char,
    /// Half widths of the noise: inches; deg and inches.
    measured: f64,
    encoder: f64,
    digits: i32,
    /// Of the start: deg; a tenth of it in inches.
    guess: f64,
}

/// As in the constants of the tables.
const USUAL: Case = Case {
    tool: 10.0,
    strategy: 4,
    poses: 36,
    range: 'N',
    measured: 0.001,
    encoder: 0.001,
    digits: 4,
    guess: 5.0,
};

struct Outcome {
    iterations: usize,
    /// Rms error of angles, deg, and of lengths, inches; none where the fit diverges.
    error: Option<[f64; 2]>,
    /// Condition number of the identification Jacobian at the truth.
    condition: f64,
    arm: ArmModel,
}

const UNIT: Sigmas = Sigmas {
    position: 1.0,
    orientation: 1.0,
    length: 1.0,
};

/// Iterated linear least squares, as LSQRR.
fn simulate(case: Case, seed: u64) -> Outcome {
    let mut random = Random::new(seed, 41);
    let truth = study(case.tool);
    let unknowns = studied();
    let one = vec![1.0; unknowns.len()];
    let readings = strategy(case.strategy, case.poses, case.range, &mut random);
    let places = 10_f64.powi(case.digits);
    let mut evaluator = Evaluator::new(&truth, UNIT);
    let exact: Vec<Observation> = (readings.iter())
        .map(|q| {
            let pose = evaluator.go(0, q, &[0.0; 6], &Ambient::default());
            observation(q.clone(), pose.translation, None)
        })
        .collect();
    let measured: Vec<Observation> = (exact.iter())
        .map(|o| {
            let mut o = o.clone();
            let position = o.position.unwrap();
            o.position = Some(position.map(|x| {
                let x = x + case.measured * random.between(-1.0, 1.0);
                (x * places).round() / places
            }));
            for (j, q) in o.q.iter_mut().enumerate() {
                let noise = case.encoder * random.between(-1.0, 1.0);
                *q += if j == 2 { noise } else { noise.to_radians() };
            }
            o
        })
        .collect();
    let mut arm = truth.clone();
    let angle = |u: &Unknown| matches!(u, Unknown::Joint(_, Parameter::Theta | Parameter::Alpha));
    let off: Vec<f64> = (unknowns.iter())
        .map(|u| match angle(u) {
            true => -case.guess.to_radians(),
            false => -case.guess / 10.0,
        })
        .collect();
    apply(&mut arm, &unknowns, &off);
    let rows: Vec<&Observation> = measured.iter().collect();
    let mut iterations = 0;
    let mut converged = false;
    while iterations < 30 && !converged {
        iterations += 1;
        let linear = linearize(&arm, &unknowns, &one, &rows, UNIT);
        let Ok(step): Result<DVector<f64>, _> =
            linear.jacobian.svd(true, true).solve(&linear.residual, 0.0)
        else {
            break;
        };
        apply(&mut arm, &unknowns, step.as_slice());
        converged = step.amax() < 1e-9;
    }
    let rows: Vec<&Observation> = exact.iter().collect();
    let jacobian = linearize(&truth, &unknowns, &one, &rows, UNIT).jacobian;
    let condition = match Observability::of(&jacobian, rows.len()) {
        Ok(o) => o.cond_j(),
        Err(_) => f64::INFINITY,
    };
    let mut sums = [[0.0_f64; 2]; 2];
    for u in &unknowns {
        let error = u.value(&arm) - u.value(&truth);
        let k = usize::from(!angle(u));
        sums[k][0] += if k == 0 { error.to_degrees() } else { error }.powi(2);
        sums[k][1] += 1.0;
    }
    let error = sums.map(|[squares, count]| (squares / count).sqrt());
    Outcome {
        iterations,
        error: (converged && error[0] < 1.0).then_some(error),
        condition,
        arm,
    }
}

/// Medians over five draws.
fn typical(case: Case) -> ([f64; 2], f64) {
    let outcomes: Vec<Outcome> = (0..5).map(|seed| simulate(case, seed)).collect();
    let median = |mut x: Vec<f64>| {
        x.sort_by(f64::total_cmp);
        x[x.len() / 2]
    };
    let error = |k: usize| {
        let each = outcomes
            .iter()
            .map(|o| o.error.map_or(f64::INFINITY, |e| e[k]));
        median(each.collect())
    };
    let condition = median(outcomes.iter().map(|o| o.condition).collect());
    ([error(0), error(1)], condition)
}

#[test]
fn tables_4_2_to_4_5_show_their_trends() {
    // 4.2: the nearer the tool is to the wrist, the worse are the wrist's angles, and they
    // alone; the condition number says so.
    let by_tool: Vec<([f64; 2], f64)> = [10.0, 5.0, 1.0, 0.5, 0.1]
        .into_iter()
        .map(|tool| {
            // The start must leave a tool: half a degree off and half of the shortest.
            typical(Case {
                tool,
                guess: 0.5,
                ..USUAL
            })
        })
        .collect();
    assert!(
        by_tool.windows(2).skip(1).all(|w| w[1].1 > w[0].1),
        "{by_tool:?}"
    );
    assert!(
        by_tool.windows(2).all(|w| w[1].0[0] > w[0].0[0]),
        "{by_tool:?}"
    );
    let ([first, length], condition) = by_tool[0];
    let ([last, short], worst) = by_tool[4];
    // Printed: 0.00078 to 0.049 deg, 0.00017 to 0.00028 in., 260 to 1848.
    assert!(
        (3e-4..2.4e-3).contains(&first) && (0.015..0.15).contains(&last),
        "{first} {last}"
    );
    assert!(
        (8e-5..5e-4).contains(&length) && short < 3.0 * length,
        "{length} {short}"
    );
    assert!(worst > 5.0 * condition, "{condition} {worst}");

    // 4.3: the start does not matter for the result, only for how long it takes.
    let starts = [0.1, 1.0, 5.0, 10.0, 20.0];
    let runs: Vec<Outcome> = starts
        .iter()
        .map(|&guess| simulate(Case { guess, ..USUAL }, 3))
        .collect();
    for run in &runs {
        // The same arm: of 20 deg off it may come out with theta half a turn further and alpha
        // the other way round, which is the same link.
        for q in strategy(4, 20, 'N', &mut Random::new(9, 0)) {
            let end = |arm: &ArmModel| {
                let mut evaluator = Evaluator::new(arm, UNIT);
                evaluator
                    .go(0, &q, &[0.0; 6], &Ambient::default())
                    .translation
            };
            let off = (end(&run.arm) - end(&runs[0].arm)).norm();
            assert!(off < 1e-8, "{off} {}", run.iterations);
        }
    }
    assert!(runs.windows(2).all(|w| w[1].iterations >= w[0].iterations));
    assert!(runs[4].iterations > runs[0].iterations && runs[4].iterations <= 12);

    // 4.4: two decimals cost several times what four do; beyond four it is the encoders.
    let by_digits: Vec<f64> = [8, 6, 4, 2]
        .into_iter()
        .map(|digits| {
            typical(Case {
                digits,
                measured: 0.0,
                ..USUAL
            })
            .0[0]
        })
        .collect();
    assert!(
        (by_digits[2] / by_digits[0] - 1.0).abs() < 0.3,
        "{by_digits:?}"
    );
    assert!(by_digits[3] > 3.0 * by_digits[2], "{by_digits:?}");

    // 4.5: encoder noise, then measurement noise.
    let by_noise: Vec<f64> = [
        (0.0, 0.0),
        (0.0, 1e-3),
        (1e-4, 1e-3),
        (1e-3, 1e-3),
        (1e-2, 1e-3),
    ]
    .into_iter()
    .map(|(measured, encoder)| {
        typical(Case {
            measured,
            encoder,
            ..USUAL
        })
        .0[0]
    })
    .collect();
    assert!(by_noise[1] > 3.0 * by_noise[0], "{by_noise:?}");
    assert!(
        (by_noise[2] / by_noise[1] - 1.0).abs() < 0.5,
        "{by_noise:?}"
    );
    assert!(
        by_noise[3] > by_noise[2] && by_noise[4] > 4.0 * by_noise[3],
        "{by_noise:?}"
    );
}

#[test]
fn tables_4_6_and_4_7_show_their_trends_and_the_order_of_condition_numbers() {
    // 4.6: more poses help every strategy; moving all joints together is far worse than the
    // others at any number of poses.
    let mut conditions = Vec::new();
    let mut errors = Vec::new();
    for strategy in 1..=4 {
        let of = |poses| {
            typical(Case {
                strategy,
                poses,
                ..USUAL
            })
        };
        let (few, condition) = of(36);
        let (many, _) = of(360);
        assert!(
            many[0] < few[0] && many[1] < few[1],
            "{strategy}: {few:?} {many:?}"
        );
        conditions.push(condition);
        errors.push((few[0], many[0]));
    }
    // Printed: 20024, 1203, 364, 260. Their columns had another scale; the order is the same.
    assert!(conditions.windows(2).all(|w| w[0] > w[1]), "{conditions:?}");
    assert!(conditions[0] > 8.0 * conditions[1], "{conditions:?}");
    // The better a strategy, the smaller its error, with few poses and with many. (Printed, of
    // one draw each, 360 poses of the first strategy are even worse than 36 of any other.)
    for w in errors.windows(2) {
        assert!(w[0].0 > w[1].0 && w[0].1 > w[1].1, "{errors:?}");
    }

    // 4.7: less motion of the first three joints, a larger condition number and error. One
    // strategy diverges at an eighth of the range, with the first.
    for strategy in 1..=4 {
        let by_range: Vec<([f64; 2], f64)> = ['F', 'H', 'Q', 'E']
            .into_iter()
            .map(|range| {
                typical(Case {
                    strategy,
                    range,
                    tool: 5.0,
                    ..USUAL
                })
            })
            .collect();
        assert!(
            by_range.windows(2).all(|w| w[1].1 > w[0].1),
            "{strategy}: {by_range:?}"
        );
        assert!(
            by_range[3].1 > 10.0 * by_range[0].1,
            "{strategy}: {by_range:?}"
        );
        assert!(
            by_range[3].0[1] > 2.0 * by_range[0].0[1],
            "{strategy}: {by_range:?}"
        );
        let diverges = by_range[3].0[0].is_infinite();
        assert_eq!(diverges, strategy == 1, "{strategy}: {by_range:?}");
    }
}

/// MRD 4.217 for two configurations (deg): rows x and y, columns d-theta1, d-theta2, dr1, dr2.
/// The second row's derivatives by theta are + r c: the print has - r s and - r c, 4.218 - r c.
fn two_links(r: [f64; 2], at: [f64; 4]) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    for k in 0..2 {
        let (a, b) = (
            at[2 * k].to_radians(),
            (at[2 * k] + at[2 * k + 1]).to_radians(),
        );
        let (x, y) = (r[1] * b.cos(), r[1] * b.sin());
        let rows = [
            [-r[0] * a.sin() - y, -y, a.cos(), b.cos()],
            [r[0] * a.cos() + x, x, a.sin(), b.sin()],
        ];
        for (i, row) in rows.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                matrix[(2 * k + i, j)] = *value;
            }
        }
    }
    matrix
}

fn rank(matrix: &Matrix4<f64>) -> usize {
    let dynamic = DMatrix::from_iterator(4, 4, matrix.iter().copied());
    match Observability::of(&dynamic, 2) {
        Ok(_) => 4,
        Err(Unobservable::RankDeficient(rank, _)) => rank,
        Err(Unobservable::NotANumber) => 0,
    }
}

#[test]
fn two_link_arm_is_observed_by_all_pairs_of_different_shape() {
    for (r, at) in [
        ([2., 1.], [60., 35., 60., 0.]),
        ([2., 1.], [73., 0., 34., 180.]),
        ([2., 1.], [45., 90., 50., -90.]),
        ([1., 1.], [14., 120., 134., -120.]),
    ] {
        assert_eq!(rank(&two_links(r, at)), 4, "{at:?}");
    }
    // 4.219: the same shape twice, wherever it is turned to.
    let mut random = Random::new(1, 0);
    for _ in 0..50 {
        let mut angle = || random.between(-180.0, 180.0);
        let (shape, a, b) = (angle(), angle(), angle());
        assert!(rank(&two_links([2., 1.], [a, shape, b, shape])) < 4);
        // With the sign that is printed in 4.218 this would not hold.
        let mut printed = two_links([2., 1.], [a, shape, b, shape]);
        for (i, j) in [(1, 0), (1, 1), (3, 0), (3, 1)] {
            printed[(i, j)] = -printed[(i, j)];
        }
        assert_eq!(rank(&printed), 4);
    }
}

/// Norms of a symmetric matrix: spectral, largest column sum, largest row sum.
fn norms(m: &Matrix4<f64>) -> [f64; 3] {
    let spectral = m.singular_values().max();
    let columns = m
        .column_iter()
        .map(|c| c.iter().map(|x| x.abs()).sum::<f64>());
    let rows = m.row_iter().map(|c| c.iter().map(|x| x.abs()).sum::<f64>());
    [
        spectral,
        columns.fold(0.0, f64::max),
        rows.fold(0.0, f64::max),
    ]
}

/// Fewest repetitions after which the covariance 4.222 is a tenth of what it was, in each norm,
/// and by the bound 4.224 in the spectral norm. `noise`: scale of the covariance
/// [0.2 0.1; 0.1 0.2] of one position.
fn repetitions(r: [f64; 2], at: [f64; 4], noise: f64) -> ([usize; 3], usize) {
    let lambda = two_links(r, at);
    let one = Matrix2::new(0.2, 0.1, 0.1, 0.2) * noise;
    let mut weight = Matrix4::zeros();
    for k in 0..2 {
        let inverse = one.try_inverse().unwrap();
        weight
            .fixed_view_mut::<2, 2>(2 * k, 2 * k)
            .copy_from(&inverse);
    }
    let information = lambda.transpose() * weight * lambda;
    let start = Matrix4::from_diagonal(&Vector4::new(0.05, 0.05, 0.1, 0.1));
    let before = norms(&start);
    let after = |j: usize| {
        let step = Matrix4::identity() + information * start * j as f64;
        let gain = step.try_inverse().unwrap();
        (norms(&(start * gain)), norms(&gain)[0])
    };
    // It falls with every repetition (4.202): halve the interval.
    let fewest = |enough: &dyn Fn(usize) -> bool| {
        let (mut low, mut high) = (0, 1_usize);
        while !enough(high) {
            (low, high) = (high, 2 * high);
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if enough(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    };
    let exact = [0, 1, 2].map(|k| fewest(&|j| after(j).0[k] <= 0.1 * before[k] * (1.0 + 1e-12)));
    (exact, fewest(&|j| after(j).1 <= 0.1))
}

#[test]
fn repetitions_of_the_two_link_arm_follow_4_222() {
    // Printed, last figures first: 3, 37, 62, 2748 repetitions, the more the less the shape
    // changes; half of them where the sign of 4.218 is right. The order holds, and so does all
    // that is said of it.
    let examples = [
        [0., 0., 180., 90.],
        [50., 34., 60., -15.],
        [46., 34., 58., -6.],
        [45., 20., 50., 10.],
    ];
    let long = [10., 9.];
    let mut before = 0;
    for at in examples {
        let (medium, bound) = repetitions(long, at, 0.1);
        let (low, _) = repetitions(long, at, 0.01);
        assert!(medium[0] > before);
        before = medium[0];
        // A tenth of the noise is a tenth of the repetitions, rounded up: 4.222 knows only j
        // over the noise. So 995 and 80 in examples 2 and 3, and 2748 and 279, cannot both be.
        assert_eq!(low[0], medium[0].div_ceil(10));
        assert!(bound >= medium[0]);
        // The spectral norm gives the smallest number. A covariance is symmetric: its 1-norm
        // and its infinity-norm are the same, so 3328 and 2876, or 100 and 86, cannot be.
        assert!(medium[0] <= medium[1]);
        assert_eq!(medium[1], medium[2]);
    }
    // Example 1 to 3: longer links and less noise help; example 4: a change of shape does most,
    // two repetitions in every norm, as printed.
    let first = [45., 33., 57., -5.];
    let (short, bound) = repetitions([1., 1.], first, 1.0);
    let (longer, _) = repetitions(long, first, 1.0);
    let (quiet, _) = repetitions(long, first, 0.1);
    assert!(bound > short[0] && short[0] > longer[0] && longer[0] > quiet[0]);
    for drastic in [[0., 90., 45., -90.], [0., 0., 45., 180.]] {
        assert_eq!(repetitions(long, drastic, 0.1).0, [2, 2, 2]);
    }
}
