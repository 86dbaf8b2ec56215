//! Random blobs: a random arm, its calibrated twin a little off, a few effects.

use nalgebra::Vector3;
use truepose::effects::{Effect, GearEccentricity, JointCompliance, JointGain};
use truepose::params::{Blob, Description, Provenance};
use truepose::taught::Taught;
use truepose::{JointKind, Pose, Settings, StoredPose, Twist};

use crate::random::Random;

/// A blob of an arm with `joints` joints whose parameters are off by a few mrad and tenths of
/// a mm, as those of a real arm are.
pub(crate) fn blob(random: &mut Random, joints: usize) -> Blob<'static> {
    let mut nominal = Description {
        base: StoredPose::from(&random.pose(1.0)),
        joints: heapless::Vec::new(),
        masses: heapless::Vec::new(),
        tool: StoredPose::from(&random.pose(0.3)),
    };
    let mut limits = heapless::Vec::new();
    let mut resolution = heapless::Vec::new();
    let mut effects = heapless::Vec::new();
    for j in 0..joints {
        let joint = random.joint();
        let half = match joint.kind {
            JointKind::Revolute => 2.5,
            JointKind::Prismatic => 0.6,
        };
        nominal.joints.push(joint).unwrap();
        nominal.masses.push(random.mass()).unwrap();
        limits
            .push([-half - random.unit().abs(), half + random.unit().abs()])
            .unwrap();
        resolution.push(random.unit().abs() * 1e-5).unwrap();
        let (gain, order) = (random.within(1e-3), 1.0 + random.below(3) as f64);
        let j = u8::try_from(j).unwrap();
        let effect = match random.below(4) {
            0 => Some(Effect::JointGain(JointGain {
                joint: j,
                gain: [gain],
            })),
            1 => Some(Effect::GearEccentricity(GearEccentricity {
                joint: j,
                order,
                amplitude: [random.within(5e-4), random.within(5e-4)],
            })),
            2 => Some(Effect::JointCompliance(JointCompliance {
                joint: j,
                compliance: [random.unit().abs() * 2e-5],
            })),
            _ => None,
        };
        if let Some(effect) = effect {
            effects.push(effect).unwrap();
        }
    }
    let mut calibrated = nominal.clone();
    for joint in &mut calibrated.joints {
        for &parameter in joint.parameters() {
            *joint.parameter_mut(parameter) += random.within(1e-3);
        }
    }
    for pose in [&mut calibrated.base, &mut calibrated.tool] {
        let off = Twist::new(random.vector(1e-3), random.vector(1e-3));
        *pose = StoredPose::from(&Pose::from(&*pose).displaced(&off));
    }
    Blob {
        robot: "random".try_into().unwrap(),
        nominal,
        calibrated,
        limits,
        resolution,
        gravity: Vector3::new(0.0, 0.0, -9.81).into(),
        effects,
        settings: Settings::default(),
        provenance: Provenance {
            tool: "tests".try_into().unwrap(),
            data: "none".try_into().unwrap(),
            date: heapless::String::new(),
            rows_identify: 70,
            rows_verify: 30,
            rms_before: 1.2e-3,
            rms_after: 5e-5,
        },
        taught: Taught::default(),
    }
}
