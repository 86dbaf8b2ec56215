//! Commands in whole joint steps, chosen together, lead nearer than rounded one by one.

use crate::puma::{away_from_singularities, blob, off, smallest_singular_value};
use crate::random::Random;
use truepose::budget::Budget;
use truepose::compensate::minimum_move::nearest;
use truepose::compensate::{Compensator, Request};
use truepose::effects::Conditions;

#[test]
fn chosen_together_they_lead_nearer_than_one_by_one() {
    let mut random = Random(61);
    let mut blob = blob(off(&mut random), &[]);
    // Steps of about a millidegree, all different, the last joint without.
    let steps = [2e-5, 3e-5, 2.5e-5, 4e-5, 5e-5, 0.0];
    blob.resolution = steps.into_iter().collect();
    let model = blob.model::<f64, 6>().unwrap();
    let conditions = Conditions::default();
    let (mut together, mut alone) = (0.0, 0.0);
    for _ in 0..300 {
        let q = away_from_singularities(&mut random, &model);
        assert!(smallest_singular_value(&model, &q) > 0.0);
        let desired = model.nominal_pose(&q);
        let mut compensator = Compensator::new(&model);
        let request = Request::joints(q);
        let exact = compensator.correct(&request, &mut Budget::unlimited()).q;
        let whole = nearest(&model, &desired, &exact, &conditions);
        for (j, step) in steps.iter().enumerate() {
            let count = whole[j] / step;
            assert!(
                (count - count.round()).abs() < 1e-6 || *step == 0.0,
                "joint {j}"
            );
            assert!(
                (whole[j] - exact[j]).abs() <= *step * 1.000_001,
                "joint {j}"
            );
        }
        let rounded: [f64; 6] = std::array::from_fn(|j| match steps[j] {
            0.0 => exact[j],
            step => (exact[j] / step).round() * step,
        });
        let error = |q: &[f64; 6]| {
            let twist = model.predict(q, &conditions).twist_to(&desired);
            twist.linear.norm().hypot(twist.angular.norm())
        };
        // The linear model that the choice is made with is off by 1e-9 here.
        assert!(error(&whole) <= error(&rounded) + 1e-8);
        together += error(&whole);
        alone += error(&rounded);
    }
    println!("mean error together {together:.3e} one by one {alone:.3e} (sum of 300)");
    assert!(together < 0.85 * alone, "{together} {alone}");
}

#[test]
fn no_joint_leaves_its_limits() {
    let mut random = Random(62);
    let mut blob = blob(off(&mut random), &[]);
    blob.resolution = [0.1; 6].into_iter().collect();
    blob.limits = [
        [-0.12, 0.33],
        [-0.05, 0.05],
        [0.02, 0.08],
        [-1.0, 1.0],
        [-0.1, 0.1],
        [0.0, 0.2],
    ]
    .into_iter()
    .collect();
    let model = blob.model::<f64, 6>().unwrap();
    for _ in 0..300 {
        let q: [f64; 6] = std::array::from_fn(|j| {
            let [low, high] = model.limits[j];
            low + (high - low) * random.unit().abs()
        });
        let whole = nearest(&model, &model.nominal_pose(&q), &q, &Conditions::default());
        for ((w, q), [low, high]) in whole.iter().zip(q).zip(model.limits) {
            assert!(*w >= low && *w <= high, "{w}");
            assert!((w - q).abs() <= 0.1 + 1e-12);
        }
        // No whole step lies inside the third joint's limits: it stays.
        assert!((whole[2] - q[2]).abs() < 1e-15);
    }
}
