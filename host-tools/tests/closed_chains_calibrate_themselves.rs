//! The two mechanisms of Nahvi and Hollerbach: identified from nothing but their own closure,
//! and which observability index tells good sets of poses.

use crate::{parallel_drive, planar_arm};
use truepose_host::closed_chain::{
    Failure, Loop, ParallelDrive, PlanarArm, identify, observe, study,
};
use truepose_host::observability::Unobservable;
use truepose_host::random::Random;

/// Poses without noise that still weigh their residuals.
fn exact(chain: &ParallelDrive, count: usize) -> Vec<Vec<f64>> {
    let silent = ParallelDrive {
        sigma: 0.0,
        ..chain.clone()
    };
    silent.measure(&ParallelDrive::built(), count, &mut Random::new(3, 0))
}

#[test]
fn derivatives_are_those_of_the_closure() {
    let drive = ParallelDrive::new(4e-3);
    let arm = PlanarArm { sigma: 3e-3 };
    let mut random = Random::new(1, 0);
    let (a, b) = (ParallelDrive::built(), PlanarArm::nominal());
    type Case<'a> = (&'a dyn Loop, &'a [f64], Vec<Vec<f64>>);
    let cases: [Case<'_>; 2] = [
        (&drive, &a, exact(&drive, 20)),
        (&arm, &b, arm.measure(&b, &mut random).split_off(320)),
    ];
    for (chain, x, poses) in cases {
        assert_eq!(chain.parameters().len(), x.len());
        for v in &poses {
            let at = chain.closure(x, v).unwrap();
            for k in 0..x.len() {
                let h = 1e-6 * x[k].abs();
                let moved = |step: f64| {
                    let mut x = x.to_vec();
                    x[k] += step;
                    chain.closure(&x, v).unwrap().residual
                };
                for (row, (up, down)) in moved(h).iter().zip(moved(-h)).enumerate() {
                    let numeric = (up - down) / (2.0 * h);
                    let analytic = at.gradient[row * x.len() + k];
                    let close = (numeric - analytic).abs() < 1e-5 * (1.0 + analytic.abs());
                    assert!(close, "{k} {row}: {numeric} {analytic}");
                }
            }
        }
    }
}

#[test]
fn drive_finds_its_gains_and_offsets_exactly_without_noise() {
    let drive = ParallelDrive::new(4e-3);
    let truth = ParallelDrive::built();
    let poses = exact(&drive, 40);
    for v in &poses {
        assert!(drive.closure(&truth, v).unwrap().residual[0].abs() < 1e-15);
    }
    let found = identify(&drive, &ParallelDrive::nominal(), &poses).unwrap();
    for (x, truth) in found.x.iter().zip(&truth) {
        assert!((x - truth).abs() < 1e-10, "{x} {truth}");
    }
    assert!(found.misfit < 1e-6);
}

#[test]
fn scatter_is_what_the_standard_errors_say() {
    let drive = ParallelDrive::new(4e-3);
    let truth = ParallelDrive::built();
    let (mut squares, mut misfits) = (0.0, 0.0);
    let runs = 100;
    for seed in 0..runs {
        let poses = drive.measure(&truth, 280, &mut Random::new(seed, 1));
        let found = identify(&drive, &ParallelDrive::nominal(), &poses).unwrap();
        let each = found.x.iter().zip(&truth).zip(&found.errors);
        squares += each.map(|((x, t), e)| ((x - t) / e).powi(2)).sum::<f64>() / 8.0;
        misfits += found.misfit;
    }
    let (ratio, misfit) = (squares / runs as f64, misfits / runs as f64);
    // 100 draws of 8 strongly correlated numbers: a chi-square of 100 at least, within 4 of its
    // standard deviations. The readings' noise bends the residual a little: NH 4.
    assert!((0.5..1.6).contains(&ratio), "{ratio}");
    assert!((0.97..1.03).contains(&misfit), "{misfit}");
}

#[test]
fn drive_ranks_sets_of_poses_by_o4_better_than_by_o1() {
    let drive = ParallelDrive::new(4e-3);
    let (truth, start) = (ParallelDrive::built(), ParallelDrive::nominal());
    let poses = drive.measure(&truth, 280, &mut Random::new(1, 0));
    let sets = study(
        &drive,
        [&truth, &start],
        &poses,
        30,
        600,
        &mut Random::new(2, 0),
    )
    .unwrap();
    assert!(sets.failed < 30, "{}", sets.failed);
    // NH 3.2.2: O4 changes about twice as much as O2 over the same sets, and the upper envelope
    // of the error falls with it, by more than it does with O1.
    let [o1, o2, o3, o4] = sets.sensitivity();
    assert!(o4 > 1.3 * o2 && o4 > o3 && o3 > o1, "{o1} {o2} {o3} {o4}");
    let falls = |index: usize| {
        let envelope = sets.envelope(index, 3);
        envelope[0] / envelope[2]
    };
    assert!(
        falls(3) > 1.3 && falls(3) > falls(0),
        "{} {}",
        falls(3),
        falls(0)
    );
}

#[test]
fn planar_arm_shows_o4_as_the_most_sensitive_index() {
    let arm = PlanarArm { sigma: 3e-3 };
    let truth = PlanarArm::nominal();
    let poses = arm.measure(&truth, &mut Random::new(7, 0));
    // The start of every identification is one per cent off.
    let start: Vec<f64> = truth.iter().map(|x| 1.01 * x).collect();
    let draws = 2000;
    let sets = study(
        &arm,
        [&truth, &start],
        &poses,
        50,
        draws,
        &mut Random::new(8, 0),
    )
    .unwrap();
    assert_eq!(sets.failed, 0);
    // Figure 5: over the same sets O4 changes most, O1 least. O4 is O2 times O3 (NH 9, 12, 16)
    // and grows as both together; the print has O3 well above O2, which sets of 50 of the 343
    // poses do not show, whether columns are scaled by their length over all poses, over the
    // set's own or not at all: O2 grows by 1.31, O3 by 1.28 from the lowest tenth to the
    // highest, with 2000 draws to 1 % of either.
    let [o1, o2, o3, o4] = sets.growth(10);
    assert!(o4 > 1.2 * o2.max(o3), "{o4} {o3} {o2} {o1}");
    assert!(o2.min(o3) > 1.15 * o1, "{o4} {o3} {o2} {o1}");
    assert!((o2 / o3 - 1.0).abs() < 0.05, "{o2} {o3}");
    assert!((o4 / (o2 * o3) - 1.0).abs() < 0.05, "{o4} {o2} {o3}");
    // Figure 3: the upper envelope of the error falls as O4 grows, from the first of four
    // classes of sets to the last.
    let envelope = sets.envelope(3, 4);
    assert!(envelope[0] > 1.1 * envelope[3], "{envelope:?}");
}

#[test]
fn what_cannot_be_identified_is_said() {
    let drive = ParallelDrive::new(4e-3);
    let poses = exact(&drive, 40);
    let start = ParallelDrive::nominal();
    // Seven poses for eight parameters, and one pose forty times.
    let few = identify(&drive, &start, &poses[..7]).unwrap_err();
    assert_eq!(
        few,
        Failure::Unobservable(Unobservable::RankDeficient(7, 8))
    );
    let same = vec![poses[0].clone(); 40];
    let same = observe(&drive, &start, &same).unwrap_err();
    assert_eq!(
        same,
        Failure::Unobservable(Unobservable::RankDeficient(1, 8))
    );
    // Actuators that do not reach each other; readings that are none.
    let mut short = start.clone();
    short[4] = 0.02;
    assert_eq!(
        identify(&drive, &short, &poses).unwrap_err(),
        Failure::Unbuilt(0)
    );
    let mut none = poses.clone();
    none[3][1] = f64::NAN;
    assert_eq!(
        identify(&drive, &start, &none).unwrap_err(),
        Failure::Unbuilt(3)
    );
}

#[test]
fn examples_run() {
    let drive = parallel_drive::report(50).unwrap();
    assert!(
        drive.contains("50 sets of 30 poses") && drive.contains("by O4"),
        "{drive}"
    );
    let arm = planar_arm::report(50).unwrap();
    assert!(
        arm.contains("50 sets of 50 poses") && arm.contains("theta03"),
        "{arm}"
    );
}
