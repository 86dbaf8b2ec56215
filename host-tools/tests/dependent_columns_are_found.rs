//! Columns that depend on others: the quick way by the normal equations says the same as
//! orthogonal columns do, or that it cannot say.

use nalgebra::DMatrix;
use truepose_host::identify::factor::{Dropped, Selection, select, select_by_normal};
use truepose_host::random::Random;

const VISIBLE: f64 = 0.5;
const RELATIVE: f64 = 1e-9;

fn both(jacobian: &DMatrix<f64>) -> (Selection, Option<Selection>) {
    let normal = jacobian.tr_mul(jacobian);
    (
        select(jacobian, VISIBLE, RELATIVE),
        select_by_normal(&normal, jacobian.nrows(), VISIBLE, RELATIVE),
    )
}

/// 60 rows of a dozen columns of lengths from 1e-1 to 1e4.
fn columns(random: &mut Random) -> DMatrix<f64> {
    let mut jacobian = DMatrix::from_fn(60, 12, |_, _| random.normal());
    for mut column in jacobian.column_iter_mut() {
        column *= 10f64.powf(random.unit() * 5.0 - 2.0);
    }
    jacobian
}

/// Puts a combination of the first three columns at place `k`, and `apart` of something else.
fn mix(jacobian: &mut DMatrix<f64>, k: usize, apart: f64, random: &mut Random) {
    let mut column = jacobian.column(0) * 0.7 - jacobian.column(1) + jacobian.column(2) * 1.3;
    for x in column.iter_mut() {
        *x += apart * random.normal();
    }
    jacobian.set_column(k, &column);
}

#[test]
fn normal_equations_select_as_columns_do() {
    let (mut decided, mut dependent) = (0, 0);
    for seed in 0..400 {
        let random = &mut Random::new(seed, 0);
        let mut jacobian = columns(random);
        mix(&mut jacobian, 5, 0.0, random);
        mix(&mut jacobian, 9, 1.0, random);
        let (by_columns, by_normal) = both(&jacobian);
        let Some(by_normal) = by_normal else { continue };
        decided += 1;
        assert_eq!(by_columns.kept, by_normal.kept, "seed {seed}");
        for ((k, why), (same, quick)) in by_columns.dropped.iter().zip(&by_normal.dropped) {
            assert_eq!(k, same, "seed {seed}");
            let (Dropped::Dependent(weights), Dropped::Dependent(quick)) = (why, quick) else {
                assert_eq!(why, quick, "seed {seed}");
                continue;
            };
            dependent += 1;
            for (column, weight) in weights.iter().filter(|w| w.1.abs() > 1e-3) {
                let quick = quick.iter().find(|w| w.0 == *column).map_or(0.0, |w| w.1);
                let scale = weights[0].1.abs();
                assert!((weight - quick).abs() < 1e-3 * scale, "seed {seed}");
            }
        }
    }
    assert!(decided > 350, "undecided too often: {decided} of 400");
    assert!(
        dependent > 350,
        "{dependent} dependent columns in {decided} cases"
    );
}

#[test]
fn rounding_never_decides() {
    // what is left over is near the limit, and far below what JᵀJ of such long columns can hold
    for seed in 0..200 {
        let random = &mut Random::new(seed, 1);
        let mut jacobian = DMatrix::from_fn(60, 12, |_, _| 1e8 * random.normal());
        let apart = VISIBLE / 60f64.sqrt() * (0.5 + random.unit());
        mix(&mut jacobian, 5, apart, random);
        let (_, by_normal) = both(&jacobian);
        assert!(by_normal.is_none(), "seed {seed}: {by_normal:?}");
    }
}
