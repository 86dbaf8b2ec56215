//! The linear quadratic regulator of MRD 5.3: its recursion, redundant and reduced, gives what
//! one damped least-squares solution gives; and the statements made about tables 5.5 to 5.7.

use std::cell::Cell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::puma;
use crate::random::Random;
use nalgebra::{SMatrix, Vector3};
use truepose::budget::Budget;
use truepose::compensate::lqr::corrections;
use truepose::compensate::{Compensator, Request};
use truepose::effects::Conditions;
use truepose::jacobian::joint_column;
use truepose::{Frame, Joint, JointKind, Method, Settings, StoredPose, forward};

/// Multiplications, additions and divisions of the three parts of the recursion: gains, the
/// next P, controls.
type Counts = [[usize; 3]; 3];

const GAINS: usize = 0;
const NEXT: usize = 1;
const CONTROLS: usize = 2;

thread_local! {
    static COUNT: Cell<Counts> = const { Cell::new([[0; 3]; 3]) };
    static PART: Cell<usize> = const { Cell::new(GAINS) };
}

/// A number that counts its multiplications, additions and divisions.
#[derive(Clone, Copy)]
struct Counted(f64);

fn count(kind: usize) {
    let mut counts = COUNT.get();
    counts[PART.get()][kind] += 1;
    COUNT.set(counts);
}

impl Add for Counted {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        count(1);
        Self(self.0 + other.0)
    }
}

impl Sub for Counted {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        count(1);
        Self(self.0 - other.0)
    }
}

impl Mul for Counted {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        count(0);
        Self(self.0 * other.0)
    }
}

impl Div for Counted {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        count(2);
        Self(self.0 / other.0)
    }
}

impl Neg for Counted {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// MRD 5.84 to 5.87 as they stand, for a diagonal Q: the first step knows that `P0 = Q` is
/// diagonal, the last does not need the next P.
fn regulator<const M: usize, const N: usize>(
    b: &[[Counted; M]; N],
    x: &[Counted; M],
    q: &[Counted; M],
    gamma: &[Counted; N],
) -> [f64; N] {
    let sum = |terms: &mut dyn Iterator<Item = Counted>| {
        let first = terms.next().unwrap();
        terms.fold(first, |s, t| s + t)
    };
    let zero = Counted(0.0);
    let mut p = [[zero; M]; M];
    for i in 0..M {
        p[i][i] = q[i];
    }
    let mut gains = [[zero; M]; N];
    for k in (0..N).rev() {
        PART.set(GAINS);
        let first = k == N - 1;
        let mut bp = [zero; M];
        for j in 0..M {
            bp[j] = if first {
                b[k][j] * p[j][j]
            } else {
                sum(&mut (0..M).map(|i| b[k][i] * p[i][j]))
            };
        }
        let scale = sum(&mut (0..M).map(|i| bp[i] * b[k][i])) + gamma[k];
        for j in 0..M {
            gains[k][j] = -(bp[j] / scale);
        }
        if k > 0 {
            PART.set(NEXT);
            // P is symmetric, so that P b is the transpose of bᵀ P.
            for i in 0..M {
                for j in 0..M {
                    p[i][j] = p[i][j] + bp[i] * gains[k][j];
                }
            }
        }
    }
    PART.set(CONTROLS);
    let mut x = *x;
    let mut u = [0.0; N];
    for k in 0..N {
        let control = sum(&mut (0..M).map(|i| gains[k][i] * x[i]));
        for i in 0..M {
            x[i] = x[i] + b[k][i] * control;
        }
        u[k] = control.0;
    }
    u
}

#[test]
fn the_recursion_is_a_damped_least_squares_step() {
    fn check<const N: usize>(random: &mut Random) {
        for _ in 0..300 {
            let b: [[f64; 6]; N] = std::array::from_fn(|_| std::array::from_fn(|_| random.unit()));
            let x: [f64; 6] = std::array::from_fn(|_| random.unit() * 1e-2);
            let q: [f64; 6] = std::array::from_fn(|_| random.unit().abs() + 0.1);
            let gamma: [f64; N] = std::array::from_fn(|_| 10_f64.powf(-2.0 + 2.0 * random.unit()));
            let slow = regulator(
                &b.map(|c| c.map(Counted)),
                &x.map(Counted),
                &q.map(Counted),
                &gamma.map(Counted),
            );
            // Desired minus predicted is the negative of the book's state.
            let weighted = |v: &[f64; 6]| std::array::from_fn(|i| v[i] * q[i].sqrt());
            let fast = corrections(&b.map(|c| weighted(&c)), &weighted(&x.map(|x| -x)), &gamma);
            for (slow, fast) in slow.iter().zip(fast) {
                // Conditions up to 1e4 times rounding.
                assert!((slow - fast).abs() < 1e-11, "{slow} {fast}");
            }
        }
    }
    let mut random = Random(51);
    check::<1>(&mut random);
    check::<3>(&mut random);
    check::<5>(&mut random);
    check::<6>(&mut random);
    check::<7>(&mut random);
}

/// The redundant model of twelve entries is the map of MRD 5.171 (`dT = T δT`) applied to the
/// reduced one, so `Q_y` of 5.170 follows from `Q_x` of 5.135.
#[test]
fn the_redundant_model_of_twelve_gives_the_same_as_the_reduced_one_of_six() {
    let mut random = Random(52);
    for _ in 0..300 {
        let r = random_rotation(&mut random);
        let (n, o, a) = (r.column(0), r.column(1), r.column(2));
        // Columns of the map: dx, dy, dz, then turns about n, o, a.
        let mut map = SMatrix::<f64, 12, 6>::zeros();
        for i in 0..3 {
            map[(i, 4)] = -a[i];
            map[(i, 5)] = o[i];
            map[(3 + i, 3)] = a[i];
            map[(3 + i, 5)] = -n[i];
            map[(6 + i, 3)] = -o[i];
            map[(6 + i, 4)] = n[i];
            map[(9 + i, 0)] = n[i];
            map[(9 + i, 1)] = o[i];
            map[(9 + i, 2)] = a[i];
        }
        let (k1, k2) = (random.unit().abs() + 0.1, random.unit().abs() + 0.1);
        let b: [[f64; 6]; 6] = std::array::from_fn(|_| std::array::from_fn(|_| random.unit()));
        let y: [f64; 6] = std::array::from_fn(|_| random.unit() * 1e-2);
        let gamma = [Counted(0.01); 6];
        let wide = |v: &[f64; 6]| {
            let w = map * nalgebra::Vector6::from(*v);
            std::array::from_fn::<_, 12, _>(|i| Counted(w[i]))
        };
        let qx = std::array::from_fn(|i| Counted(if i < 9 { k1 } else { k2 }));
        let qy = std::array::from_fn(|i| Counted(if i < 3 { k2 } else { 2.0 * k1 }));
        COUNT.set(Counts::default());
        let redundant = regulator(&b.map(|c| wide(&c)), &wide(&y), &qx, &gamma);
        let cost_redundant = COUNT.get();
        COUNT.set(Counts::default());
        let reduced = regulator(&b.map(|c| c.map(Counted)), &y.map(Counted), &qy, &gamma);
        let cost_reduced = COUNT.get();
        for (x, y) in redundant.iter().zip(reduced) {
            assert!((x - y).abs() < 1e-10, "{x} {y}");
        }
        operations_are_those_of_the_book(&cost_redundant, 12, [1596, 2316]);
        operations_are_those_of_the_book(&cost_reduced, 6, [474, 654]);
        let all = |counts: &Counts| counts.iter().flatten().sum::<usize>() as f64;
        let ratio = all(&cost_redundant) / all(&cost_reduced);
        assert!(ratio > 3.5 && ratio < 4.5, "about one quarter, {ratio}");
    }
}

/// MRD 5.173 against what was counted, part by part, for N = 6 joints and a diagonal Q.
///
/// Definite in the book, and the same here: the multiplications of the gains,
/// `(N-1) n(n+1) + 2n`, and of the controls, `2Nn`. Of the next P it leaves out the first of
/// the `N-1` and counts `n(n+1)` for each where bᵀP, known from the gain, leaves n². The sum
/// in print has 2n more than its own parts (`n(n+5)` for `n(n+3)`). A sum of n products it
/// counts as n additions, where it has n - 1, and for the next P it counts `n(n+1) + n²` where
/// n² are needed. It counts no divisions.
fn operations_are_those_of_the_book(counts: &Counts, n: usize, print: [usize; 2]) {
    const N: usize = 6;
    let [gains, next, controls] = *counts;
    assert_eq!(gains[0], (N - 1) * n * (n + 1) + 2 * n);
    assert_eq!(controls[0], 2 * N * n);
    assert_eq!(next[0], (N - 1) * n * n);
    // Of the print: its own formula, and what it has more or less of than was counted.
    let formula = (N - 2) * 2 * n * (n + 1) + n * (n + 5) + 2 * N * n;
    assert_eq!(formula, print[0]);
    let counted = gains[0] + next[0] + controls[0];
    assert_eq!(
        formula + (N - 1) * n * n,
        counted + 2 * n + (N - 2) * n * (n + 1)
    );
    let additions = formula + (N - 2) * n * n + n * n;
    assert_eq!(additions, print[1]);
    assert_eq!(gains[1], (N - 1) * n * n + n);
    assert_eq!(next[1], (N - 1) * n * n);
    assert_eq!(controls[1], N * (2 * n - 1));
    let divisions = [gains[2], next[2], controls[2]];
    assert_eq!(divisions, [N * n, 0, 0]);
}

fn random_rotation(random: &mut Random) -> nalgebra::Matrix3<f64> {
    truepose::Pose::from_rotation_vector(&Vector3::new(
        random.within(3.0),
        random.within(3.0),
        random.within(3.0),
    ))
    .rotation
}

/// PUMA 560 of MRD tables 5.3 and 5.4. The signs of the wrist's twists, lost in print, are
/// those of the arm.
/// `scale`: times the printed deviations.
fn table(scale: f64) -> [truepose::params::Description; 2] {
    let rows: [[f64; 3]; 6] = [
        [-90.0, 0.0, 0.0],
        [0.0, 431.8, 149.09],
        [90.0, -20.32, 0.0],
        [-90.0, 0.0, 433.07],
        [90.0, 0.0, 0.0],
        [0.0, 0.0, 56.25],
    ];
    let deviations: [[f64; 4]; 6] = [
        [0.1, 0.05, 0.1, -0.05],
        [-0.05, 0.1, -0.075, -0.1],
        [0.05, -0.1, 0.05, -0.1],
        [-0.15, 0.0, 0.0, -0.1],
        [0.15, 0.0, 0.0, 0.1],
        [-0.13, 0.0, 0.0, 0.1],
    ];
    [0.0_f64, scale].map(|on| {
        let mut description = puma::nominal();
        description.joints = rows
            .iter()
            .zip(deviations)
            .map(|(row, off)| {
                let [alpha, a, d]: [f64; 3] = [0, 1, 2].map(|k| row[k] + on * off[k]);
                let (alpha, theta) = (alpha.to_radians(), (on * off[3]).to_radians());
                Joint::dh(JointKind::Revolute, theta, d * 1e-3, a * 1e-3, alpha)
            })
            .collect();
        description.tool = StoredPose::from(&truepose::Pose::identity());
        description
    })
}

/// Norms of MRD table 5.5 before and after, of the three columns of the rotation and of the
/// position relative to its length, and the corrections in degrees. `steps`: how often the
/// regulator is applied, each time from where it led.
fn norms(
    degrees: [f64; 6],
    gamma: f64,
    [k1, k2]: [f64; 2],
    steps: usize,
) -> ([f64; 4], [f64; 4], [f64; 6]) {
    norms_of(table(1.0), degrees, gamma, [k1, k2], steps)
}

fn norms_of(
    [nominal, calibrated]: [truepose::params::Description; 2],
    degrees: [f64; 6],
    gamma: f64,
    [k1, k2]: [f64; 2],
    steps: usize,
) -> ([f64; 4], [f64; 4], [f64; 6]) {
    let mut blob = puma::blob(calibrated, &[]);
    blob.nominal = nominal;
    let model = blob.model::<f64, 6>().unwrap();
    let start = degrees.map(f64::to_radians);
    let desired = model.nominal_pose(&start);
    let length = desired.translation.norm();
    let settings = Settings {
        method: Method::Lqr,
        effort: gamma,
        // MRD 5.170.
        position_weight: k2.sqrt() / length,
        orientation_weight: (2.0 * k1).sqrt(),
        // The book's regulator has no price of its own near singularities, and one step.
        singular_value: 0.0,
        correction_bound: [1.0; 2],
        max_iterations: 1,
        position_tolerance: 0.0,
        orientation_tolerance: 0.0,
        ..Settings::default()
    };
    let mut q = start;
    for _ in 0..steps {
        let mut compensator = Compensator::new(&model).with_settings(settings);
        let request = Request::pose(desired, q);
        q = compensator.correct(&request, &mut Budget::unlimited()).q;
    }
    let norms = |q: &[f64; 6]| {
        let pose = model.predict(q, &Conditions::default());
        let turned = pose.rotation - desired.rotation;
        [
            turned.column(0).norm(),
            turned.column(1).norm(),
            turned.column(2).norm(),
            (pose.translation - desired.translation).norm() / length,
        ]
    };
    let corrections = std::array::from_fn(|j| (q[j] - start[j]).to_degrees());
    (norms(&start), norms(&q), corrections)
}

const REGULAR: [f64; 6] = [90.0, -90.0, 45.0, 45.0, 45.0, 0.0];
const SINGULAR: [f64; 6] = [90.0, -90.0, 45.0, 45.0, -1.0, 0.0];

fn largest(corrections: &[f64; 6]) -> f64 {
    corrections.iter().fold(0.0, |m, x| x.abs().max(m))
}

/// The book prints it after one step of norms that its printed inputs do not give. From these
/// inputs position falls 12 times in the first step at the higher price, the rest in two more.
#[test]
fn every_norm_falls_a_hundredfold_away_from_singularities() {
    for (gamma, steps) in [(0.01, 3), (0.0001, 1)] {
        let (before, after, _) = norms(REGULAR, gamma, [1.0, 1.0], steps);
        for (before, after) in before.iter().zip(after) {
            assert!(after < before / 100.0, "{gamma}: {before} {after}");
        }
    }
}

#[test]
fn the_price_does_not_matter_away_from_singularities() {
    let (_, _, dear) = norms(REGULAR, 0.01, [1.0, 1.0], 2);
    let (_, _, cheap) = norms(REGULAR, 0.0001, [1.0, 1.0], 2);
    for (dear, cheap) in dear.iter().zip(cheap) {
        // Table 5.5 shows 0.002 degrees between the two.
        assert!((dear - cheap).abs() < 0.004, "{dear} {cheap}");
    }
}

#[test]
fn a_weight_of_zero_leaves_its_half_of_the_error() {
    let (before, after, _) = norms(REGULAR, 0.01, [0.0, 1.0], 2);
    assert!(after[3] < before[3] / 100.0, "{before:?} {after:?}");
    assert!(after[0] > before[0] / 2.0, "{before:?} {after:?}");
    let (before, after, _) = norms(REGULAR, 0.01, [1.0, 0.0], 2);
    for k in 0..3 {
        assert!(after[k] < before[k] / 100.0, "{before:?} {after:?}");
    }
    assert!(after[3] > before[3] / 2.0, "{before:?} {after:?}");
}

#[test]
fn near_a_singularity_a_price_keeps_corrections_small() {
    let (_, _, dear) = norms(SINGULAR, 0.01, [1.0, 1.0], 1);
    let (_, _, cheap) = norms(SINGULAR, 1e-8, [1.0, 1.0], 1);
    assert!(largest(&dear) < 2.0, "{dear:?} degrees");
    // Table 5.7 prints 15 to 17 degrees; its inputs give less, whatever the signs, as they do
    // not give its errors before correction either.
    assert!(largest(&cheap) > 3.0 * largest(&dear), "{cheap:?} degrees");
    // With twice the deviations, up to 0.3 degrees, what one step of the regulator asks for is
    // beyond ten degrees without a price, and below two with it.
    let [linear, _] = starting_errors(SINGULAR, 2.0);
    let asked = |gamma| corrected_from(&linear, SINGULAR, gamma).0;
    let (dear, cheap) = (asked(0.01), asked(1e-8));
    assert!(largest(&dear) < 2.0, "{dear:?} degrees");
    assert!(largest(&cheap) > 10.0, "{cheap:?} degrees");
}

/// The starting error of the regulator for `size` times the deviations, desired minus
/// predicted, in the world's axes at the tool: to first order in the deviations (5.144), and the exact difference (5.145).
fn starting_errors(degrees: [f64; 6], size: f64) -> [[f64; 6]; 2] {
    let pose = |of_size: f64| {
        let scale = of_size * size;
        let [nominal, calibrated] = table(scale);
        let mut blob = puma::blob(calibrated, &[]);
        blob.nominal = nominal;
        let model = blob.model::<f64, 6>().unwrap();
        model.predict(&degrees.map(f64::to_radians), &Conditions::default())
    };
    let (nominal, actual) = (pose(0.0), pose(1.0));
    let exact = actual.twist_to(&nominal);
    // The derivative in the direction of the deviations, its error a millionth of the second
    // order.
    let h = 1e-3;
    let slope = pose(h).twist_to(&pose(-h));
    let rows = |t: truepose::Twist<f64>, by: f64| t.rows().map(|x: f64| x * by);
    [rows(slope, 0.5 / h), rows(exact, 1.0)]
}

/// Corrections by one step of the regulator from a starting error, deg, and how far the four
/// norms of table 5.5 fall by them.
fn corrected_from(error: &[f64; 6], degrees: [f64; 6], gamma: f64) -> ([f64; 6], [f64; 4]) {
    let [nominal, calibrated] = table(1.0);
    let mut blob = puma::blob(calibrated, &[]);
    blob.nominal = nominal;
    let model = blob.model::<f64, 6>().unwrap();
    let start = degrees.map(f64::to_radians);
    let desired = model.nominal_pose(&start);
    let length = desired.translation.norm();
    let mut frames = [Frame::identity(); 6];
    let chain = &model.nominal;
    let tool = forward(&chain.base, &chain.joints, &start, &mut frames).then(&chain.tool);
    // MRD 5.170 with k1 = k2 = 1
    let weighted = |v: [f64; 6]| {
        let weight = |i: usize| if i < 3 { 1.0 / length } else { 2.0_f64.sqrt() };
        std::array::from_fn::<f64, 6, _>(|i| v[i] * weight(i))
    };
    let columns: [[f64; 6]; 6] = std::array::from_fn(|j| {
        let column = joint_column(JointKind::Revolute, &frames[j], &tool.translation);
        weighted(column.rows())
    });
    let found = corrections(&columns, &weighted(*error), &[gamma; 6]);
    let norms = |q: &[f64; 6]| {
        let pose = model.predict(q, &Conditions::default());
        let turned = pose.rotation - desired.rotation;
        let off = (pose.translation - desired.translation).norm() / length;
        [0, 1, 2, 3].map(|k| if k < 3 { turned.column(k).norm() } else { off })
    };
    let after = norms(&std::array::from_fn(|j| start[j] + found[j]));
    let before = norms(&start);
    (
        found.map(f64::to_degrees),
        std::array::from_fn(|k| before[k] / after[k]),
    )
}

#[test]
fn the_linearised_starting_error_is_the_exact_one_to_first_order() {
    let [linear, exact] = starting_errors(REGULAR, 1.0);
    // Angles up to 0.15 degrees, twelve of them: the second order is below the square of their
    // sum, at an arm of 0.87 m.
    let turns: f64 = [
        0.1, 0.05, 0.05, 0.15, 0.15, 0.13, 0.05, 0.1, 0.1, 0.1, 0.1, 0.1,
    ]
    .iter()
    .map(|x: &f64| x.to_radians())
    .sum();
    let apart = linear.iter().zip(exact).map(|(l, e)| (l - e).abs());
    let largest = apart.fold(0.0, f64::max);
    assert!(
        largest > 0.0 && largest < turns * turns,
        "{largest} {turns}"
    );
}

#[test]
fn from_the_linearised_starting_error_every_norm_falls_a_hundredfold() {
    let [linear, _] = starting_errors(REGULAR, 1.0);
    let (_, fell) = corrected_from(&linear, REGULAR, 1e-4);
    assert!(fell.iter().all(|x| *x > 100.0), "{fell:?}");
}

#[test]
fn from_the_exact_starting_error_the_norms_fall_a_hundredfold() {
    let [_, exact] = starting_errors(REGULAR, 1.0);
    let (_, fell) = corrected_from(&exact, REGULAR, 1e-4);
    // Of one linear step the second order is left: about the starting error times the
    // corrections, 0.005 rad times half a degree, of which any one column may get more than its
    // share of the error was. Together they fall.
    let mean = fell.iter().map(|x| x.powi(-2)).sum::<f64>() / 4.0;
    assert!(mean.sqrt() < 1.0 / 100.0, "{fell:?}");
}

/// Table 5.5, lines * and **: no correction differs by more than 0.001 degrees in print.
#[test]
fn either_starting_error_gives_the_same_corrections() {
    let both = starting_errors(REGULAR, 1.0);
    let [linear, exact] = both.map(|error| corrected_from(&error, REGULAR, 1e-4).0);
    for (linear, exact) in linear.iter().zip(exact) {
        // half of the last printed digit on either side
        assert!((linear - exact).abs() < 0.002, "{linear} {exact} deg");
    }
}
