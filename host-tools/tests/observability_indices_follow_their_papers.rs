//! The observability indices against the examples and statements of the papers that made them.

use nalgebra::{DMatrix, DVector};
use truepose_host::observability::{Observability, Unobservable, g, scale_columns};
use truepose_host::random::Random;

fn with_singular_values(values: &[f64], poses: usize) -> Observability {
    let diagonal = DMatrix::from_diagonal(&DVector::from_row_slice(values));
    Observability::of(&diagonal, poses).unwrap()
}

fn random_jacobian(random: &mut Random, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| random.normal())
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * (1.0 + a.abs())
}

#[test]
fn three_pose_sets_of_nahvi_and_hollerbach_rank_as_printed() {
    // NH 13, 14, 15.
    let a = with_singular_values(&[100.0, 0.1, 0.1], 1);
    let b = with_singular_values(&[10.0, 10.0, 0.01], 1);
    let c = with_singular_values(&[10.0, 1.0, 0.1], 1);
    assert!(close(a.o1(), b.o1()), "A and B have the same O1");
    assert!(close(a.o2(), b.o2()), "O2 treats A and B the same");
    assert!(a.o3() > b.o3(), "O3 prefers A to B");
    assert!(c.o2() > a.o2(), "O2 prefers C to A");
    assert!(close(c.o3(), a.o3()), "O3 treats A and C the same");
    for (set, printed) in [(&a, 1e-4), (&b, 1e-5), (&c, 1e-3)] {
        assert!(close(set.o4(), printed), "{} {printed}", set.o4());
    }
}

#[test]
fn chain_of_inequalities_holds_for_the_harmonic_mean() {
    let mut random = Random::new(1, 0);
    for _ in 0..200 {
        let o = Observability::of(&random_jacobian(&mut random, 9, 6), 1).unwrap();
        let s = &o.singular_values;
        let count = s.len() as f64;
        let mean = s.iter().sum::<f64>() / count;
        // SH 40. Its O5 (SH 38) is the harmonic mean over the number of parameters, which is
        // below O3: the print cannot be right as it stands.
        let harmonic = count * o.o5();
        assert!(mean >= o.geometric_mean() && o.geometric_mean() >= harmonic);
        assert!(harmonic >= o.o3() && o.o3() >= o.o5());
        // SH 41, 42, under their conditions.
        let largest = s[0];
        assert!(largest < 1.0 || o.o3() >= o.o2());
        assert!(o.o3() > 1.0 || o.o2() >= o.o4());
        assert!(close(o.cond_jtj(), o.cond_j() * o.cond_j()) && close(o.cond_j() * o.o2(), 1.0));
        assert!(close(o.d() / (2.0 * count), o.geometric_mean().ln()));
        assert!(o.a() >= 1.0 / o.e() && o.a() <= count / o.e());
    }
}

#[test]
fn perfect_column_scaling_bounds_every_index_and_all_reach_it_together() {
    // SH 50, 53, 56: with columns of unit length the squares of the singular values sum to
    // their number, and every index is largest where all are 1.
    let mut random = Random::new(2, 0);
    let best = with_singular_values(&[1.0; 5], 1);
    for _ in 0..200 {
        let mut jacobian = random_jacobian(&mut random, 12, 5);
        scale_columns(&mut jacobian);
        let o = Observability::of(&jacobian, 1).unwrap();
        let sum: f64 = o.singular_values.iter().map(|s| s * s).sum();
        assert!(close(sum, 5.0));
        assert!(o.e() <= o.o1() && o.o1() <= 1.0);
        for index in [
            Observability::o1,
            Observability::o2,
            Observability::o3,
            Observability::o4,
            Observability::o5,
        ] {
            assert!(index(&o) <= index(&best) + 1e-12);
        }
    }
}

#[test]
fn only_o1_ranks_the_same_whatever_the_column_scaling() {
    // SH 44.
    let mut random = Random::new(3, 0);
    let (mut changed, mut sets) = (0, 0);
    for _ in 0..100 {
        let a = random_jacobian(&mut random, 15, 5);
        let b = random_jacobian(&mut random, 15, 5);
        let scale = DVector::from_fn(5, |_, _| libm::exp(2.0 * random.normal()));
        let scaled = |j: &DMatrix<f64>| j * DMatrix::from_diagonal(&scale);
        let of = |j: &DMatrix<f64>| Observability::of(j, 5).unwrap();
        let ratio = of(&a).o1() / of(&b).o1();
        let after = of(&scaled(&a)).o1() / of(&scaled(&b)).o1();
        assert!((ratio / after - 1.0).abs() < 1e-9, "{ratio} {after}");
        let prefers = |x: f64, y: f64| x > y;
        let before = prefers(of(&a).o3(), of(&b).o3());
        changed += usize::from(before != prefers(of(&scaled(&a)).o3(), of(&scaled(&b)).o3()));
        sets += 1;
    }
    assert!(
        changed > sets / 10,
        "O3 changed its mind {changed} times of {sets}"
    );
}

#[test]
fn one_more_copy_of_a_pose_set_leaves_o1_as_it_is() {
    let mut random = Random::new(4, 0);
    let jacobian = random_jacobian(&mut random, 12, 4);
    let mut twice = DMatrix::zeros(24, 4);
    twice.rows_mut(0, 12).copy_from(&jacobian);
    twice.rows_mut(12, 12).copy_from(&jacobian);
    let (once, twice) = (
        Observability::of(&jacobian, 4).unwrap(),
        Observability::of(&twice, 8).unwrap(),
    );
    assert!(close(once.o1(), twice.o1()));
    assert!(close(twice.o3(), once.o3() * 2.0_f64.sqrt()));
}

#[test]
fn largest_prediction_variance_is_that_of_the_least_visible_direction() {
    // SH 26: over all unit rows the largest variance is 1 / sigma_min squared.
    let mut random = Random::new(5, 0);
    let jacobian = random_jacobian(&mut random, 10, 4);
    let o = Observability::of(&jacobian, 1).unwrap();
    let svd = jacobian.clone().svd(false, true);
    let worst = svd
        .v_t
        .unwrap()
        .row(svd.singular_values.imin())
        .into_owned();
    let row = DMatrix::from_row_slice(1, 4, worst.as_slice());
    let largest = g(&jacobian, &row, 1).unwrap();
    assert!((largest * o.e() - 1.0).abs() < 1e-9);
    for _ in 0..100 {
        let row = random_jacobian(&mut random, 1, 4).normalize();
        assert!(g(&jacobian, &row, 1).unwrap() <= largest * (1.0 + 1e-12));
    }
}

#[test]
fn what_does_not_show_has_no_index() {
    let mut random = Random::new(6, 0);
    let mut jacobian = random_jacobian(&mut random, 12, 4);
    let copied = jacobian.column(1) * 2.0;
    jacobian.set_column(3, &copied);
    let deficient = Err(Unobservable::RankDeficient(3, 4));
    assert_eq!(Observability::of(&jacobian, 4), deficient);
    jacobian[(0, 0)] = f64::NAN;
    assert_eq!(
        Observability::of(&jacobian, 4),
        Err(Unobservable::NotANumber)
    );
    let short = random_jacobian(&mut random, 3, 4);
    assert_eq!(
        Observability::of(&short, 1),
        Err(Unobservable::RankDeficient(3, 4))
    );
}
