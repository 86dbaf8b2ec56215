//! The blobs that the programs hold, as files beside this source.
//!
//! `cargo run -p truepose-firmware --example write_blobs` writes them anew; a test holds them
//! against [`encode`].

use nalgebra::Vector3;
use truepose::effects::{Effect, GearEccentricity, JointCompliance, JointGain};
use truepose::params::{Blob, BlobError, Description, Provenance};
use truepose::taught::Taught;
use truepose::{LinkMass, Settings, StoredPose};

use crate::arm::{self, Arm, JOINTS, TRAVEL};

/// The arm as built, geometry alone.
pub const RIGID: &[u8] = include_bytes!("../rigid.tpb");

/// The arm whose wrist's axes still meet, geometry alone.
pub const SPHERICAL: &[u8] = include_bytes!("../spherical.tpb");

/// The arm as built with [`effects`].
pub const WITH_EFFECTS: &[u8] = include_bytes!("../with_effects.tpb");

/// Room for either blob, in bytes.
pub const ROOM: usize = 8192;

/// Mass of each link, kg, and how far its centre lies from the axis, m.
const MASSES: [(f64, f64); JOINTS] = [
    (0.0, 0.0),
    (17.4, -0.068),
    (4.8, 0.014),
    (0.82, -0.019),
    (0.34, 0.0),
    (0.09, 0.032),
];

/// What the built arm lacks besides: gain, eccentric gears, joints that give under load.
pub fn effects() -> [Effect<'static, f64>; 6] {
    let gain = |joint, gain| {
        Effect::JointGain(JointGain {
            joint,
            gain: [gain],
        })
    };
    let gear = |joint, order, amplitude| {
        Effect::GearEccentricity(GearEccentricity {
            joint,
            order,
            amplitude,
        })
    };
    let compliance = |joint, compliance| {
        Effect::JointCompliance(JointCompliance {
            joint,
            compliance: [compliance],
        })
    };
    [
        gain(0, 4e-4),
        gear(1, 1.0, [3e-4, -1e-4]),
        gear(4, 2.0, [-2e-4, 1.5e-4]),
        compliance(1, 6e-6),
        compliance(2, 1.1e-5),
        compliance(4, 4e-5),
    ]
}

fn description(arm: &Arm) -> Description {
    Description {
        base: StoredPose::from(&arm.base),
        joints: arm.joints.into_iter().collect(),
        masses: MASSES
            .into_iter()
            .map(|(mass, x)| LinkMass {
                mass,
                com: Vector3::new(x, 0.0, 0.0),
            })
            .collect(),
        tool: StoredPose::from(&arm.tool),
    }
}

/// Writes the blob of an arm that was calibrated as `arm`, with the effects given.
pub fn encode<'b>(
    arm: &Arm,
    effects: &[Effect<'static, f64>],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BlobError> {
    Blob {
        robot: "PUMA 560".try_into().unwrap_or_default(),
        nominal: description(&arm::nominal()),
        calibrated: description(arm),
        limits: TRAVEL
            .into_iter()
            .map(|travel| [-f64::from(travel) - 0.1, f64::from(travel) + 0.1])
            .collect(),
        resolution: [1e-7; JOINTS].into_iter().collect(),
        gravity: [0.0, 0.0, -9.81],
        effects: effects.iter().copied().collect(),
        settings: Settings::default(),
        provenance: Provenance {
            tool: "truepose-firmware".try_into().unwrap_or_default(),
            data: "none: a made-up arm".try_into().unwrap_or_default(),
            date: "".try_into().unwrap_or_default(),
            rows_identify: 0,
            rows_verify: 0,
            rms_before: 0.0,
            rms_after: 0.0,
        },
        taught: Taught::default(),
    }
    .encode(buffer)
}
