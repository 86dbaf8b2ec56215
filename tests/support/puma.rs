//! A PUMA 560 whose links are each a little off, and poses of it.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DMatrix, Vector3};
use truepose::effects::Effect;
use truepose::jacobian::joint_column;
use truepose::params::{Blob, Description, Provenance};
use truepose::taught::Taught;
use truepose::{
    Convention, Frame, Joint, JointKind, LinkMass, Model, Parameter, Pose, Settings, StoredPose,
    forward,
};

use crate::random::Random;

/// Nominal PUMA 560 (the elbow of MRD table 6.1 in kind) without effects.
pub(crate) fn nominal() -> Description {
    let h = FRAC_PI_2;
    let rows = [
        [0.0, 0.0, -h],
        [0.149_09, 0.431_8, 0.0],
        [0.0, -0.020_32, h],
        [0.433_07, 0.0, -h],
        [0.0, 0.0, h],
        [0.056_25, 0.0, 0.0],
    ];
    let revolute = JointKind::Revolute;
    Description {
        base: StoredPose::from(&Pose::identity()),
        joints: rows
            .iter()
            .map(|&[d, a, alpha]| Joint::dh(revolute, 0.0, d, a, alpha))
            .collect(),
        masses: (0..6)
            .map(|j| LinkMass {
                mass: 8.0 - f64::from(j),
                com: Vector3::new(-0.1, 0.02, 0.03),
            })
            .collect(),
        tool: StoredPose::from(&Pose::identity()),
    }
}

/// Five errors a link, uniform: +-2 mrad and +-0.5 mm. The second link takes beta in place of
/// d, since the third axis is parallel to it.
pub(crate) fn off(random: &mut Random) -> Description {
    let mut calibrated = nominal();
    for (j, joint) in calibrated.joints.iter_mut().enumerate() {
        if j == 1 {
            joint.convention = Convention::Hayati;
        }
        for parameter in [
            Parameter::Theta,
            Parameter::D,
            Parameter::A,
            Parameter::Alpha,
            Parameter::Beta,
        ] {
            let range = match parameter.unit() {
                "m" => 5e-4,
                _ => 2e-3,
            };
            *joint.parameter_mut(parameter) += random.within(range);
        }
    }
    calibrated
}

/// A blob of the two.
pub(crate) fn blob(calibrated: Description, effects: &[Effect<'static, f64>]) -> Blob<'static> {
    Blob {
        robot: "PUMA 560".try_into().unwrap(),
        nominal: nominal(),
        calibrated,
        limits: (0..6).map(|_| [-4.6, 4.6]).collect(),
        resolution: (0..6).map(|_| 0.0).collect(),
        gravity: [0.0, 0.0, -9.81],
        effects: effects.iter().copied().collect(),
        settings: Settings::default(),
        provenance: Provenance {
            tool: "tests".try_into().unwrap(),
            data: "none".try_into().unwrap(),
            date: heapless::String::new(),
            rows_identify: 0,
            rows_verify: 0,
            rms_before: 0.0,
            rms_after: 0.0,
        },
        taught: Taught::default(),
    }
}

/// Smallest singular value of the nominal joint Jacobian at `q`, m and rad.
pub(crate) fn smallest_singular_value(model: &Model<'_, f64, 6>, q: &[f64; 6]) -> f64 {
    let chain = &model.nominal;
    let mut frames = [Frame::identity(); 6];
    let tool = forward(&chain.base, &chain.joints, q, &mut frames).then(&chain.tool);
    let mut matrix = DMatrix::zeros(6, 6);
    for (j, (joint, frame)) in chain.joints.iter().zip(&frames).enumerate() {
        let column = joint_column(joint.kind, frame, &tool.translation).rows();
        for (i, x) in column.into_iter().enumerate() {
            matrix[(i, j)] = x;
        }
    }
    matrix.singular_values().min()
}

/// Joints uniform over +-range whose smallest singular value is at least 0.05.
pub(crate) fn away_from_singularities(random: &mut Random, model: &Model<'_, f64, 6>) -> [f64; 6] {
    loop {
        let q = std::array::from_fn(|_| random.within(2.8));
        if smallest_singular_value(model, &q) >= 0.05 {
            return q;
        }
    }
}
