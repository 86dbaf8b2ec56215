//! Random tables of corrections.

use truepose::params::Blob;
use truepose::taught::cmac::Layout;
use truepose::taught::polynomial::{Block, terms};
use truepose::taught::{Cmac, Polynomial, Region};

use crate::random::Random;

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
