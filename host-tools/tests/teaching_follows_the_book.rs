//! Polynomials and tables of MRD 5.4: built as the book builds them, and as good as its
//! examples say.

use crate::puma;
use crate::random::Random;
use nalgebra::{DMatrix, DVector, Vector3};
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request, Status};
use truepose::effects::Conditions;
use truepose::params::Blob;
use truepose::taught::cmac::Layout;
use truepose::taught::polynomial::{exponents, terms};
use truepose::{Model, Pose, Settings, StoredPose};
use truepose_host::teach::cmac::Teacher;
use truepose_host::teach::points::spacing;
use truepose_host::teach::polynomial::{Orthonormal, scaled};
use truepose_host::teach::{Form, Lessons, from_lessons};

fn monomials(points: &[Vec<f64>], inputs: usize, degree: u8) -> DMatrix<f64> {
    let powers: Vec<_> = exponents(inputs, usize::from(degree)).collect();
    DMatrix::from_fn(points.len(), powers.len(), |i, k| {
        (0..inputs)
            .map(|v| points[i][v].powi(i32::from(powers[k][v])))
            .product()
    })
}

#[test]
fn the_recursion_spans_what_an_orthogonal_factorisation_spans() {
    let mut random = Random(81);
    for (inputs, degree) in [(1, 5), (2, 4), (3, 3), (6, 2)] {
        let count = terms(inputs, usize::from(degree));
        assert_eq!(exponents(inputs, usize::from(degree)).count(), count);
        let points: Vec<Vec<f64>> = (0..3 * count)
            .map(|_| (0..inputs).map(|_| random.unit()).collect())
            .collect();
        let family = Orthonormal::on(&points, inputs, degree).unwrap();
        let gram = family.values.tr_mul(&family.values);
        assert!((gram - DMatrix::identity(count, count)).norm() < 1e-12);
        // Its coefficients are those of its values.
        let powers = monomials(&points, inputs, degree);
        assert!((&powers * &family.coefficients - &family.values).norm() < 1e-10);
        // The same projection, and the same least-squares fit.
        let q = powers.clone().qr().q();
        let (a, b) = (
            &q * q.transpose(),
            &family.values * family.values.transpose(),
        );
        assert!((a - b).norm() < 1e-11);
        let wanted = DVector::from_fn(points.len(), |_, _| random.unit());
        let by_svd = powers
            .clone()
            .svd(true, true)
            .solve(&wanted, 1e-14)
            .unwrap();
        assert!((family.fit(&wanted) - by_svd).norm() < 1e-9);
    }
    // 20 polynomials of three variables and order three; 84 of six: the book's counts.
    assert_eq!((terms(3, 3), terms(6, 3)), (20, 84));
}

#[test]
fn points_that_do_not_determine_the_polynomials_are_refused() {
    let points: Vec<Vec<f64>> = (0..40).map(|k| vec![f64::from(k) / 40.0, 0.5]).collect();
    assert_eq!(Orthonormal::on(&points, 2, 2), None);
    assert_eq!(Orthonormal::on(&points[..2], 1, 2), None);
}

/// MRD 5.195, and the largest deviation that is said below it.
#[test]
fn chebyshev_points_keep_their_product_smallest() {
    let range = [0.5, 3.0];
    let product = |points: &[f64]| {
        (0..=2000)
            .map(|k| range[0] + (range[1] - range[0]) * f64::from(k) / 2000.0)
            .map(|x| points.iter().map(|p| x - p).product::<f64>().abs())
            .fold(0.0, f64::max)
    };
    for count in 2..7_u8 {
        let points: Vec<f64> = spacing(range, usize::from(count)).collect();
        let n = i32::from(count) - 1;
        let least = 0.5_f64.powi(n) * (0.5 * (range[1] - range[0])).powi(n + 1);
        assert!((product(&points) / least - 1.0).abs() < 1e-3);
        let even = |k: u8| range[0] + (range[1] - range[0]) * f64::from(k) / f64::from(count - 1);
        assert!(product(&(0..count).map(even).collect::<Vec<_>>()) > 1.05 * least);
    }
}

/// Waist, shoulder and elbow of a PUMA 560, the wrist locked straight with a tool 0.6 m from the
/// elbow: the printed region begins 0.26 m and ends 0.98 m from the shoulder, beyond what the
/// bare flange (0.92 m) reaches. Errors of every link, as large as it takes for 1.6 mm on
/// average.
fn three_joints(random: &mut Random, size: f64) -> Blob<'static> {
    let mut blob = puma::blob(puma::nominal(), &[]);
    let straight = Pose::translate(0.0, 0.0, 0.6);
    for description in [&mut blob.nominal, &mut blob.calibrated] {
        description.joints.truncate(3);
        description.masses.truncate(3);
        description.tool = StoredPose::from(&straight);
    }
    blob.limits.truncate(3);
    blob.resolution.truncate(3);
    for joint in &mut blob.calibrated.joints {
        joint.theta += random.within(2e-3 * size);
        joint.alpha += random.within(2e-3 * size);
        joint.beta += random.within(2e-3 * size);
        joint.a += random.within(1e-3 * size);
        joint.d += random.within(1e-3 * size);
    }
    // Positions only.
    blob.settings = Settings {
        orientation_weight: 0.0,
        orientation_tolerance: 10.0,
        correction_bound: [0.2; 2],
        ..Settings::default()
    };
    blob
}

/// Nominal joints that put the tool at R, phi, z, by least squares from an elbow-up start.
fn reach(model: &Model<'_, f64, 3>, [r, phi, z]: [f64; 3]) -> [f64; 3] {
    let goal = Vector3::new(r * phi.cos(), r * phi.sin(), z);
    let mut q = [phi, -0.5, 0.6];
    for _ in 0..200 {
        let at = |q: &[f64; 3]| model.nominal_pose(q).translation;
        let error = goal - at(&q);
        let jacobian = nalgebra::Matrix3::from_columns(&[0, 1, 2].map(|j| {
            let mut moved = q;
            moved[j] += 1e-6;
            (at(&moved) - at(&q)) / 1e-6
        }));
        let step = (jacobian.tr_mul(&jacobian) + nalgebra::Matrix3::identity() * 1e-6)
            .try_inverse()
            .unwrap()
            * jacobian.tr_mul(&error);
        let scale = (0.2 / step.norm()).min(1.0);
        for j in 0..3 {
            q[j] += step[j] * scale;
        }
    }
    let left = (goal - model.nominal_pose(&q).translation).norm();
    assert!(left < 1e-7, "{r} {phi} {z}: {left}");
    q
}

const REGION: [[f64; 2]; 3] = [[0.3, 0.86], [0.0, std::f64::consts::FRAC_PI_2], [-0.5, 0.5]];

fn mean(errors: &[f64]) -> f64 {
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// Example 4: 64 points, Chebyshev in R, phi, z over the printed region; average error from
/// 1.6 mm to about 0.12 mm (printed: 0.12, at most 0.3), and as good at 50 points in between.
#[test]
fn three_joints_of_a_puma_are_as_good_after_as_in_example_4() {
    let mut random = Random(84);
    let mut averages = Vec::new();
    for _ in 0..6 {
        let seed = random.0;
        let nominal_error = |blob: &Blob<'_>, points: &[[f64; 3]]| {
            let model = blob.model::<f64, 3>().unwrap();
            let error = |q: &[f64; 3]| {
                let there = model.predict(q, &Conditions::default()).translation;
                (there - model.nominal_pose(q).translation).norm()
            };
            mean(&points.iter().map(error).collect::<Vec<_>>())
        };
        let flat = three_joints(&mut Random(seed), 1.0);
        let model = flat.model::<f64, 3>().unwrap();
        let [r, phi, z] = REGION.map(|range| spacing(range, 4).collect::<Vec<_>>());
        let grid: Vec<[f64; 3]> = (0..64)
            .map(|k| reach(&model, [r[k % 4], phi[k / 4 % 4], z[k / 16]]))
            .collect();
        let size = 1.6e-3 / nominal_error(&flat, &grid);
        let blob = three_joints(&mut random, size);
        let before = nominal_error(&blob, &grid);
        assert!((before - 1.6e-3).abs() < 0.1e-3, "{before}");

        // Step 3: the corrections that bring the arm onto each point.
        let model = blob.model::<f64, 3>().unwrap();
        let correction = |q: &[f64; 3]| -> Vec<f64> {
            let outcome =
                Compensator::new(&model).correct(&Request::joints(*q), &mut Budget::unlimited());
            assert_eq!(outcome.status, Status::Converged);
            outcome
                .q
                .iter()
                .zip(q)
                .map(|(to, from)| to - from)
                .collect()
        };
        let mut region = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for _ in 0..2000 {
            let point = REGION.map(|[low, high]| low + (high - low) * random.unit().abs());
            for (range, q) in region.iter_mut().zip(reach(&model, point)) {
                *range = [range[0].min(q), range[1].max(q)];
            }
        }
        let lessons = Lessons {
            region: region.to_vec(),
            q: grid.iter().map(|q| q.to_vec()).collect(),
            corrections: grid.iter().map(correction).collect(),
        };
        let taught = from_lessons(Form::Polynomial { degree: 3 }, &lessons).unwrap();
        assert_eq!(taught.table.len(), 20 * 3 * 4);
        let mut blob = blob.clone();
        taught.put(&mut blob);

        let model = blob.model::<f64, 3>().unwrap();
        let after = |points: &[[f64; 3]]| -> Vec<f64> {
            let error = |q: &[f64; 3]| {
                let request = Request::joints(*q);
                let outcome = Compensator::new(&model).correct(&request, &mut Budget::unlimited());
                assert!(outcome.status.compensated(), "{outcome:?}");
                outcome.remaining.unwrap().position
            };
            points.iter().map(error).collect()
        };
        let others: Vec<[f64; 3]> = (0..50)
            .map(|_| {
                let point = REGION.map(|[low, high]| low + (high - low) * random.unit().abs());
                reach(&model, point)
            })
            .collect();
        let (at_points, between) = (after(&grid), after(&others));
        println!(
            "mean {:.3} mm before, {:.3} after at the points (max {:.3}), {:.3} at others (max {:.3})",
            before * 1e3,
            mean(&at_points) * 1e3,
            at_points.iter().copied().fold(0.0, f64::max) * 1e3,
            mean(&between) * 1e3,
            between.iter().copied().fold(0.0, f64::max) * 1e3,
        );
        averages.push((mean(&at_points), mean(&between)));
    }
    let all = |pick: fn(&(f64, f64)) -> f64| mean(&averages.iter().map(pick).collect::<Vec<_>>());
    let (at_points, between) = (all(|a| a.0), all(|a| a.1));
    assert!(at_points < 0.12e-3, "{at_points}");
    // Roughly similar.
    assert!(
        between < 0.15e-3 && between < 3.0 * at_points,
        "{between} {at_points}"
    );
}

/// The two-link arm of figure 5.7, lengths chosen so that it reaches the printed workspace: 10
/// each. MRD 5.205, 5.206 (which lacks a factor of two). Degrees.
fn two_links(x: f64, y: f64) -> [f64; 2] {
    let (l, square) = (10.0, x * x + y * y);
    let r = square.sqrt();
    [
        (y.atan2(x) - (square / (2.0 * r * l)).acos()).to_degrees(),
        ((square - 2.0 * l * l) / (2.0 * l * l)).acos().to_degrees(),
    ]
}

/// 120 resolution units of 0.1 in along x and y, ten quantising functions of 12 cells.
const TWELVE: Layout = Layout {
    layers: 10,
    cells: 12,
};

/// Teaches random points until a hundred answers in a row are within `tolerance` degrees.
/// Returns the points taught; `None` if that never comes within `most`.
fn experiences(seed: u64, gain: f64, tolerance: f64, most: usize) -> Option<usize> {
    let mut teacher = Teacher::blank(TWELVE, 2, 2, true).unwrap();
    let mut random = Random(seed);
    let mut right = 0;
    for taught in 0..most {
        let [ix, iy] = [0, 0].map(|_| random.below(120) as f64);
        let wanted = two_links(2.0 + 0.1 * ix, 2.0 + 0.1 * iy);
        let at = [ix / 10.0, iy / 10.0];
        let said = teacher.output(&at);
        let off = |k: usize| (said[k] - wanted[k]).abs();
        right = if off(0) < tolerance && off(1) < tolerance {
            right + 1
        } else {
            0
        };
        if right == 100 {
            return Some(taught);
        }
        teacher.teach(&at, &wanted, gain);
    }
    None
}

/// Figure 5.12: mean over four histories, since the last points to be learned are a matter of
/// luck. The book finds the fastest between 1.0 and 1.3; here that range is as fast as any to
/// within the scatter, and slower on both sides.
#[test]
fn tables_learn_fastest_at_gains_about_one_and_not_at_all_above_two() {
    let gains = [0.2, 0.5, 1.0, 1.1, 1.2, 1.3, 1.7, 1.9];
    let counts = gains.map(|gain| {
        let counts = (1..=4).map(|seed| experiences(seed, gain, 1.0, 500_000).unwrap() as f64);
        mean(&counts.collect::<Vec<_>>())
    });
    println!("{counts:?}");
    let middle = counts[2..6].iter().copied().fold(f64::INFINITY, f64::min);
    for (gain, count) in gains.iter().zip(counts) {
        if (1.0..=1.3).contains(gain) {
            assert!(count < 1.2 * middle, "{gain}: {counts:?}");
        } else {
            assert!(count > 1.1 * middle, "{gain}: {counts:?}");
        }
    }
    assert!(
        counts[0] > 1.8 * middle && counts[7] > 2.0 * middle,
        "{counts:?}"
    );
    assert_eq!(experiences(1, 2.1, 1.0, 500_000), None);
}

/// Figure 5.13: the smaller the tolerance, the more experiences, without end.
#[test]
fn the_error_falls_with_the_points_taught_towards_a_floor() {
    let counts = [10.0, 5.0, 3.0, 2.0, 1.5, 1.0, 0.8].map(|t| experiences(1, 1.2, t, 500_000));
    println!("{counts:?}");
    for pair in counts.windows(2) {
        match (pair[0], pair[1]) {
            (Some(wide), Some(narrow)) => assert!(narrow > wide, "{counts:?}"),
            (None, Some(_)) => panic!("{counts:?}"),
            (_, None) => {}
        }
    }
    let first = counts[0].unwrap();
    assert!(counts[5].unwrap() > 4 * first, "{counts:?}");
    assert_eq!(experiences(1, 1.2, 0.01, 500_000), None);
}

/// MRD 5.209 and 5.210 for every input and quantising function, and table sizes.
#[test]
fn cells_are_those_of_the_book() {
    for i in 0..120_u8 {
        for k in 1..=10_u8 {
            // int((i + Q - K) / Q), from 0.
            let expected = usize::from(i + 10 - k) / 10;
            let selected = TWELVE.select(10 - k, &[f64::from(i) / 10.0 + 1e-9]);
            assert_eq!(selected.index % 13, expected, "{i} {k}");
        }
    }
    // The book counts 12 x 12 for each table; all but one of ten need one more.
    assert_eq!(TWELVE.words(2), Some(13 * 13 * 10));
    assert_eq!(
        Layout {
            layers: 200,
            cells: 255
        }
        .words(12),
        None
    );
    let q = scaled(&[0.5, 3.0], &[[0.0, 1.0], [1.0, 3.0]]);
    assert!(q[0].abs() < 1e-15 && (q[1] - 1.0).abs() < 1e-15);
}
