//! Mooring, Roth and Driels' arm of two links: which pairs of poses observe it, and how often they
//! have to be measured (4.5.5).

use nalgebra::{DMatrix, Matrix2, Matrix4, Vector4};
use truepose_host::observability::{Observability, Unobservable};
use truepose_host::random::Random;

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
