//! Random blobs: a random arm, its calibrated twin a little off, a few effects.

use nalgebra::Vector3;
use truepose::effects::{Effect, GearEccentricity, JointCompliance, JointGain};
use truepose::params::{Blob, Description, Provenance};
use truepose::taught::cmac::Layout;
use truepose::taught::polynomial::{Block, terms};
use truepose::taught::{Cmac, Polynomial, Region, Taught};
use truepose::{JointKind, Pose, Settings, StoredPose, Twist};

use crate::support::Random;

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

/// Tables of nonsense that are sound: whatever they say, nothing may come of it.
pub(crate) fn teach_nonsense(random: &mut Random, blob: &mut Blob<'static>) {
    let joints = blob.joints();
    let part = |random: &mut Random, [low, high]: [f64; 2]| {
        let width = (high - low) * (0.05 + 0.5 * random.unit().abs());
        let start = low + (high - low - width) * random.unit().abs();
        [start, start + width]
    };
    let range = |random: &mut Random| -> Vec<[f64; 2]> {
        let limits = blob.limits.iter();
        limits.map(|&limits| part(random, limits)).collect()
    };
    let degree = u8::try_from(random.below(3)).unwrap();
    let size = 10_f64.powf(-4.0 + 3.0 * random.unit());
    let block = |random: &mut Random, region: &[[f64; 2]], outputs: usize| {
        let count = terms(region.len(), usize::from(degree)) * outputs;
        let bytes: Vec<u8> = (0..count)
            .flat_map(|_| (random.within(size) as f32).to_le_bytes())
            .collect();
        Block {
            region: Region(region.iter().copied().collect()),
            degree,
            coefficients: Vec::leak(bytes),
        }
    };
    let region = range(random);
    let arm = 1 + random.below(joints);
    let (first, rest) = region.split_at(arm);
    blob.taught.polynomial = Some(Polynomial {
        joints: block(random, first, joints),
        tool: (!rest.is_empty()).then(|| block(random, rest, 3)),
    });
    let layout = Layout {
        layers: u8::try_from(joints + 1 + random.below(3)).unwrap(),
        cells: 1,
    };
    let bytes: Vec<u8> = (0..layout.words(joints).unwrap() * joints * 2)
        .map(|_| random.below(256) as u8)
        .collect();
    blob.taught.cmac = Some(Cmac {
        region: Region(range(random).into_iter().collect()),
        layout,
        scale: (0..joints).map(|_| random.within(size) / 32768.0).collect(),
        table: Vec::leak(bytes),
    });
}
