//! A rigid arm clear of singularities goes a short way through the compensation. It gets what
//! the general search gives, which an arm with an effect of size zero goes through; and what is
//! said to be left bounds what is.

use crate::puma::{blob, off};
use crate::random::Random;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Outcome, Request, Status};
use truepose::effects::{Conditions, Effect, JointGain};
use truepose::{Method, Settings};

/// Half the travel of each joint, rad.
const TRAVEL: f64 = 2.0;

/// Without a price, with one that is too small to be felt clear of singularities, and with one
/// that is not.
const REGULATED: [(Method, f64); 3] = [
    (Method::InverseJacobian, 0.0),
    (Method::Lqr, 1e-7),
    (Method::Lqr, 1e-6),
];

/// Outcomes by the short and by the general way, and errors that they leave: weighted sum, and
/// position (m) and orientation (rad) of the first.
struct Both {
    plain: Outcome<f64, 6>,
    general: Outcome<f64, 6>,
    left: [f64; 2],
    /// Of the error before and after each.
    norms: [f64; 3],
    /// Length of the plain way, rad.
    moved: f64,
    in_margin: bool,
}

/// Requests all over the travel, the last of its ends included.
fn both(method: Method, iterations: u8, effort: f64) -> Vec<Both> {
    let mut random = Random(77);
    let mut found = Vec::new();
    for _ in 0..20 {
        let calibrated = off(&mut random);
        let gain = [Effect::JointGain(JointGain::new(0))];
        let [mut plain, mut general] = [blob(calibrated.clone(), &[]), blob(calibrated, &gain)];
        for blob in [&mut plain, &mut general] {
            blob.limits = (0..6).map(|_| [-TRAVEL, TRAVEL]).collect();
        }
        let [plain, general] = [&plain, &general].map(|blob| blob.model::<f64, 6>().unwrap());
        let settings = Settings {
            method,
            max_iterations: iterations,
            effort,
            ..Settings::default()
        };
        for _ in 0..100 {
            let q = std::array::from_fn(|_| random.within(TRAVEL));
            let desired = plain.nominal_pose(&q);
            let request = Request::pose(desired, q);
            let [first, second] = [&plain, &general].map(|model| {
                let mut compensator = Compensator::new(model).with_settings(settings);
                compensator.correct(&request, &mut Budget::unlimited())
            });
            let error = |q: &[f64; 6]| {
                let twist = plain.predict(q, &Conditions::default()).twist_to(&desired);
                [twist.linear.norm(), twist.angular.norm()]
            };
            let norm = |q: &[f64; 6]| error(q)[0].hypot(error(q)[1]);
            found.push(Both {
                left: error(&first.q),
                norms: [norm(&q), norm(&first.q), norm(&second.q)],
                moved: first
                    .q
                    .iter()
                    .zip(q)
                    .map(|(p, q)| (p - q) * (p - q))
                    .sum::<f64>()
                    .sqrt(),
                in_margin: q.iter().any(|q| q.abs() > TRAVEL * 0.96),
                plain: first,
                general: second,
            });
        }
    }
    found
}

/// The largest difference of a joint, rad.
fn apart(both: &Both) -> f64 {
    let joints = both.plain.q.iter().zip(&both.general.q);
    joints.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn what_is_left_is_not_more_than_what_is_said() {
    for (method, effort) in REGULATED {
        for iterations in [1, 2, 8] {
            for both in both(method, iterations, effort) {
                let said = both.plain.remaining.unwrap();
                let [position, orientation] = both.left;
                // Rounding; the orientation is told by the sine of its angle.
                let floor = 1e-12 + 1e-5 * orientation;
                assert!(position <= said.position + floor, "{position:e} {said:?}");
                assert!(
                    orientation <= said.orientation + floor,
                    "{orientation:e} {said:?}"
                );
                assert!(both.norms[1] <= both.norms[0]);
            }
        }
    }
}

#[test]
fn both_end_at_the_same_joints() {
    for (method, effort) in REGULATED {
        let (mut converged, mut all) = (0, 0);
        for both in both(method, 8, effort) {
            all += 1;
            if [both.plain, both.general]
                .iter()
                .all(|o| o.status == Status::Converged)
            {
                converged += 1;
                // Both errors are below 1e-6, and no singular value below 0.03 or the same way.
                assert!(apart(&both) < 2e-6 / 0.03, "{}", apart(&both));
            }
        }
        // Elsewhere a singularity keeps some of the error.
        assert!(converged * 10 > all * 4, "{converged} of {all}");
    }
}

/// Where a price begins to be felt no step jumps by more than a share of it: a 4096th for the
/// price, `λ² / singular_value²` for the damping that comes with it.
#[test]
fn a_price_that_is_not_felt_is_not_missed() {
    let begins = 0.03 * 0.03 / 4096.0;
    let [unfelt, felt] = [0.999, 1.001].map(|share| both(Method::Lqr, 1, begins * share));
    let mut differ = 0;
    for (unfelt, felt) in unfelt.iter().zip(&felt) {
        let joints = unfelt.plain.q.iter().zip(&felt.plain.q);
        let apart = joints.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let bound = 1.0 / 4096.0 + 1e-7 / (0.03 * 0.03);
        assert!(apart <= felt.moved * bound, "{apart:e} of {:e}", felt.moved);
        differ += usize::from(apart > felt.moved * 1e-5);
    }
    // The others are in margins or near singularities, where the price is asked either way.
    assert!(differ > 400, "{differ}");
}

/// One step of either way differs by the second order of the error alone, in limits' margins and
/// elsewhere, whatever the price.
#[test]
fn one_step_is_the_same_to_first_order() {
    for effort in [1e-7, 1e-4] {
        let (mut in_margin, mut fell) = (0, [0, 0]);
        for both in both(Method::Lqr, 1, effort) {
            let [before, plain, general] = both.norms;
            assert!((plain - general).abs() <= before * 0.1, "{:?}", both.norms);
            in_margin += usize::from(both.in_margin);
            for (fell, after) in fell.iter_mut().zip([plain, general]) {
                *fell += usize::from(after < before / 10.0);
            }
        }
        assert!(in_margin > 300, "{in_margin}");
        assert!(fell[0].abs_diff(fell[1]) < 20 && fell[0] > 1000, "{fell:?}");
    }
}
