//! The commands that the emulated core computes in `f32` (bit for bit those of the host, as
//! `emulator_agrees_with_host.rs` shows) against the model in `f64`.

use std::error::Error;

use nalgebra::Matrix6;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Status};
use truepose::effects::{Ambient, Conditions};
use truepose::jacobian::joint_column;
use truepose::params::Blob;
use truepose::{Frame, Model, forward, params};
use truepose_firmware::arm::JOINTS;
use truepose_firmware::compensation::{BLOBS, SCATTERED, scattered};
use truepose_firmware::draws::Draws;

/// Poses nearer to a singular one than this smallest singular value of the joint Jacobian
/// (m and rad per rad) are left out.
const CLEAR: f64 = 0.05;

/// Smallest singular value of the joint Jacobian, about the tool point.
fn smallest_singular_value(model: &Model<'_, f64, JOINTS>, q: &[f64; JOINTS]) -> f64 {
    let chain = &model.calibrated;
    let mut frames = [Frame::identity(); JOINTS];
    let tool = forward(&chain.base, &chain.joints, q, &mut frames)
        .then(&chain.tool)
        .translation;
    let mut jacobian = Matrix6::zeros();
    for (j, (joint, frame)) in chain.joints.iter().zip(&frames).enumerate() {
        let rows = joint_column(joint.kind, frame, &tool).rows();
        jacobian.set_column(j, &rows.into());
    }
    jacobian.singular_values().min()
}

#[test]
fn a_thousand_poses_a_blob_are_reached_in_three_iterations() -> Result<(), Box<dyn Error>> {
    for bytes in BLOBS {
        let model = params::decode::<f32, JOINTS>(bytes)?;
        let exact = Blob::decode(bytes)?.model::<f64, JOINTS>()?;
        let mut compensator = Compensator::new(&model);
        let mut draws = Draws::seeded(3);
        let (mut poses, mut position, mut orientation) = (0, 0.0_f64, 0.0_f64);
        let (mut before, mut iterations) = (0.0_f64, 0);
        for index in 0..SCATTERED {
            compensator.reset();
            let request = scattered(&model, &mut draws, index);
            let outcome = compensator.correct(&request, &mut Budget::unlimited());
            let nominal = request.q.map(f64::from);
            if smallest_singular_value(&exact, &nominal) < CLEAR {
                continue;
            }
            let desired = match request.pose {
                Some(pose) => pose.cast::<f64>(),
                None => exact.nominal_pose(&nominal),
            };
            let ambient = &request.conditions.ambient;
            let conditions = Conditions {
                direction: request.conditions.direction.map(f64::from),
                ambient: Ambient {
                    payload: ambient.payload.into(),
                    payload_com: ambient.payload_com.cast(),
                    ..Ambient::default()
                },
            };
            let off = |q: &[f64; JOINTS]| exact.predict(q, &conditions).twist_to(&desired);
            let left = off(&outcome.q.map(f64::from));
            assert_eq!(outcome.status, Status::Converged, "request {index}");
            position = position.max(left.linear.norm());
            orientation = orientation.max(left.angular.norm());
            before = before.max(off(&nominal).linear.norm());
            iterations = iterations.max(outcome.iterations);
            poses += 1;
        }
        println!(
            "{poses} poses, {} effects: {:.2} mm before; after, at most {:.2} um, {:.2} urad, \
             {iterations} iterations",
            model.effects.len(),
            before * 1e3,
            position * 1e6,
            orientation * 1e6
        );
        assert!(poses >= 1000, "only {poses} of {SCATTERED} are clear");
        assert!(before > 1e-3, "nothing to take away");
        assert!(position < 2e-6, "{position:e} m");
        assert!(orientation < 5e-6, "{orientation:e} rad");
        assert!(iterations <= 3, "{iterations} iterations");
    }
    Ok(())
}
