//! Mooring, Roth and Driels' simulation of an arm of five turns and a slide: the trends of tables
//! 4.2 to 4.8.

use nalgebra::{DMatrix, DVector, Vector3};
use truepose::effects::Ambient;
use truepose::{Joint, JointKind, Parameter, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::linearize::{Linear, linearize, residuals};
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::identify::unknown::{Unknown, apply};
use truepose_host::observability::Observability;
use truepose_host::random::Random;

/// The tool point `position` at the readings `q`.
fn seen(q: &[f64], position: Vector3<f64>) -> Observation {
    Observation {
        direction: vec![0.0; q.len()],
        travel: vec![0.0; q.len()],
        q: q.to_vec(),
        position: Some(position),
        ..Observation::default()
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

/// How the columns of the Jacobian are found.
#[derive(Clone, Copy, PartialEq)]
enum Solver {
    /// As LSQRR: written out.
    Linear,
    /// As ZXSSQ: by differences of the forward solution.
    Nonlinear,
}

struct Outcome {
    iterations: usize,
    /// Passes of the forward solution over all observations.
    passes: usize,
    /// Rms error of angles, deg, and of lengths, inches; none where the fit diverges.
    error: Option<[f64; 2]>,
    /// Condition number of the identification Jacobian at the truth.
    condition: f64,
    arm: ArmModel,
}

const UNIT: Sigmas = Sigmas::UNIT;

/// Iterated linear least squares, as LSQRR.
fn simulate(case: Case, seed: u64) -> Outcome {
    simulate_by(Solver::Linear, case, seed)
}

/// d residual / d unknowns by differences, with its passes.
fn by_differences(arm: &ArmModel, unknowns: &[Unknown], rows: &[&Observation]) -> (Linear, usize) {
    let residual = residuals(arm, rows, UNIT);
    let step = 1e-7;
    let column = |u: &Unknown| {
        let mut there = arm.clone();
        apply(&mut there, &[*u], &[step]);
        // measured minus predicted: the columns are those of the prediction
        (&residual - residuals(&there, rows, UNIT)) / step
    };
    let columns: Vec<DVector<f64>> = unknowns.iter().map(column).collect();
    let jacobian = DMatrix::from_columns(&columns);
    (Linear { jacobian, residual }, 1 + unknowns.len())
}

fn simulate_by(solver: Solver, case: Case, seed: u64) -> Outcome {
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
            seen(q, pose.translation)
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
    let mut passes = 0;
    let mut converged = false;
    while iterations < 30 && !converged {
        iterations += 1;
        let (linear, more) = match solver {
            Solver::Linear => (linearize(&arm, &unknowns, &one, &rows, UNIT), 1),
            Solver::Nonlinear => by_differences(&arm, &unknowns, &rows),
        };
        passes += more;
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
        passes,
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

/// Four cases of more and more observations: either method gives the same arm, the nonlinear
/// one for many times the work. In print it takes four to eight times as long; here what is
/// counted is the forward solution, of which it needs one a column.
#[test]
fn table_4_8_both_methods_identify_the_same_at_different_cost() {
    for poses in [36, 90, 180, 360] {
        let case = Case { poses, ..USUAL };
        let linear = simulate_by(Solver::Linear, case, 1);
        let nonlinear = simulate_by(Solver::Nonlinear, case, 1);
        assert!(
            linear.error.is_some() && nonlinear.error.is_some(),
            "{poses}"
        );
        for u in studied() {
            let apart = (u.value(&linear.arm) - u.value(&nonlinear.arm)).abs();
            // Far below the last printed digit, 1e-5 deg.
            assert!(apart < 1e-8, "{poses} {}: {apart}", u.name(&linear.arm));
        }
        assert_eq!(linear.passes, linear.iterations);
        assert!(nonlinear.passes >= 8 * linear.passes, "{poses}");
    }
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
