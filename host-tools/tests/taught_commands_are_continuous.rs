//! Commands from polynomials and tables along straight paths: through the wrist singularity,
//! along and into a joint limit, into and out of the region that was taught.

use crate::path::{in_plane, path};
use crate::puma::{blob, off};
use crate::random::Random;
use truepose::Method;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request, Status};
use truepose::params::Blob;
use truepose_host::teach::{Form, region, teach, test};

/// The largest step of a corrected joint beyond the nominal step, rad. What is taught moves a
/// joint by at most 27 times the pose error that it takes away; the share of it that is sent
/// changes by at most 3/2 of the change of the error over what is taken away; and the error,
/// where a joint stands at its limit, by as much as the wrist turns, 0.3 mrad between neighbours.
const BOUND: f64 = 27.0 * 1.5 * 3e-4;

/// Teaches the joints of `rows`, answers every command of `path`; returns the largest step
/// beyond the nominal one, and how many commands were outside the region.
fn roughness(
    blob: &Blob<'_>,
    method: Method,
    rows: &[[f64; 6]],
    path: &[[f64; 6]],
) -> (f64, usize) {
    let rows: Vec<Vec<f64>> = rows.iter().map(|q| q.to_vec()).collect();
    let region = region(blob, &rows).unwrap();
    // Degree four, and a table of 12 kB.
    let room = match method {
        Method::Polynomial => 8_000,
        _ => 16_000,
    };
    let form = Form::largest(method, 6, room).unwrap().unwrap();
    let taught = teach(blob, form, &region).unwrap();
    let mut blob = blob.clone();
    taught.put(&mut blob);
    let model = blob.model::<f64, 6>().unwrap();
    let mut compensator = Compensator::new(&model);
    let mut last: Option<[f64; 6]> = None;
    let (mut largest, mut outside) = (0.0_f64, 0);
    for q in path {
        let outcome = compensator.correct(&Request::joints(*q), &mut Budget::unlimited());
        let (before, after) = (outcome.initial.unwrap(), outcome.remaining.unwrap());
        assert!(
            after.position.hypot(after.orientation) <= before.position.hypot(before.orientation)
        );
        outside += usize::from(outcome.status == Status::OutsideRegion);
        let correction = std::array::from_fn(|j| outcome.q[j] - q[j]);
        if let Some(last) = last {
            for j in 0..6 {
                let step: f64 = correction[j] - last[j];
                largest = largest.max(step.abs());
            }
        }
        last = Some(correction);
    }
    (largest, outside)
}

#[test]
fn through_the_wrist_singularity_and_out_of_the_region() {
    let mut random = Random(91);
    let mut worst = 0.0_f64;
    for _ in 0..2 {
        let blob = blob(off(&mut random), &[]);
        let model = blob.model::<f64, 6>().unwrap();
        let path = path(&model, random.within(2.0), &in_plane(0.3));
        let third = path.len() / 3;
        for method in [Method::Polynomial, Method::Cmac] {
            let middle = &path[third..2 * third];
            let (step, outside) = roughness(&blob, method, middle, &path);
            worst = worst.max(step);
            assert!(outside > third, "{outside}");
        }
    }
    println!("largest step beyond nominal {worst} rad");
    assert!(worst < BOUND, "{worst} against {BOUND}");
}

#[test]
fn along_and_into_a_joint_limit() {
    let mut random = Random(92);
    let mut worst = 0.0_f64;
    for j in [2, 4] {
        let mut blob = blob(off(&mut random), &[]);
        let free = blob.model::<f64, 6>().unwrap();
        let path = path(&free, 0.5, &in_plane(0.3));
        let highest = path.iter().map(|q| q[j]).fold(f64::MIN, f64::max);
        let lowest = path.iter().map(|q| q[j]).fold(f64::MAX, f64::min);
        blob.limits[j][1] = lowest + (highest - lowest) * 0.7;
        for method in [Method::Polynomial, Method::Cmac] {
            worst = worst.max(roughness(&blob, method, &path, &path).0);
        }
    }
    println!("largest step beyond nominal {worst} rad");
    assert!(worst < BOUND, "{worst} against {BOUND}");
}

/// Half a radian each way of a posture clear of singularities: polynomials of degree five and
/// a table of 12 kB, on commands that were not taught.
#[test]
fn what_was_not_taught_is_nearly_as_good() {
    let mut random = Random(93);
    let blob = blob(off(&mut random), &[]);
    let middle = [0.2, -0.3, 0.7, 0.3, 0.9, 0.0];
    let region = middle.map(|q: f64| [q - 0.35, q + 0.35]);
    for (method, position, orientation) in
        [(Method::Polynomial, 1e-5, 2e-5), (Method::Cmac, 3e-4, 6e-4)]
    {
        let form = Form::largest(method, 6, 16_000).unwrap().unwrap();
        let taught = teach(&blob, form, &region).unwrap();
        let mut blob = blob.clone();
        taught.put(&mut blob);
        let [before, after] = test(&blob, &region).unwrap();
        println!("{form:?}: {before:?} {after:?}");
        assert!(
            after.position < position && after.orientation < orientation,
            "{after:?}"
        );
        assert!(
            before.position > 3.0 * after.position,
            "{before:?} {after:?}"
        );
        // Where nothing was taught, nothing is corrected.
        let model = blob.model::<f64, 6>().unwrap();
        let far = middle.map(|q| q + 1.0);
        let mut compensator = Compensator::new(&model);
        let outcome = compensator.correct(&Request::joints(far), &mut Budget::unlimited());
        assert_eq!((outcome.status, outcome.q), (Status::OutsideRegion, far));
    }
}

/// MRD 5.196 to 5.198: positions only, the wrist as a translation of the tool, in a tenth of the
/// memory. Best where the arm stands as it was taught.
#[test]
fn the_wrist_is_compensated_as_a_translation_of_the_tool() {
    let mut random = Random(94);
    let blob = blob(off(&mut random), &[]);
    let middle = [0.2, -0.3, 0.7, 0.3, 0.9, 0.0];
    for (arm, least) in [(0.02, 500.0), (0.2, 100.0)] {
        let region: Vec<[f64; 2]> = (0..6)
            .map(|j| if j < 3 { arm } else { 0.35 })
            .zip(middle)
            .map(|(half, q)| [q - half, q + half])
            .collect();
        let form = Form::largest_wrist(6, 1_000).unwrap();
        assert_eq!(form, Form::Wrist { degree: 3 });
        let taught = teach(&blob, form, &region).unwrap();
        assert_eq!(Some(taught.table.len()), form.bytes(6));
        let mut blob = blob.clone();
        taught.put(&mut blob);
        let [before, after] = test(&blob, &region).unwrap();
        println!("{arm}: {before:?} {after:?}");
        assert!(
            after.position * least < before.position,
            "{before:?} {after:?}"
        );
    }
}
