//! A blob comes back as it was written, and any other bytes are refused by name.

use crate::blobs::blob;
use crate::random::Random;
use crate::samples::one_of_each;
use crate::tables;
use nalgebra::Vector3;
use truepose::effects::{
    CrossAxisCompliance, Effect, GearEccentricity, JointCompliance, JointGain,
};
use truepose::params::{
    Blob, BlobError, Description, HEADER, Provenance, checksum, checksum_onwards, decode,
};
use truepose::taught::cmac::Layout;
use truepose::taught::polynomial::Block;
use truepose::taught::{Cmac, Polynomial, Region, Taught};
use truepose::{Convention, Joint, JointKind, LinkMass, Method, Settings, StoredPose};

const ROOM: usize = 16_384;

fn encoded(blob: &Blob) -> Vec<u8> {
    let mut buffer = vec![0; ROOM];
    blob.encode(&mut buffer).unwrap().to_vec()
}

/// Every field with a value of its own.
fn sample() -> Blob<'static> {
    let mut first = Joint::dh(JointKind::Revolute, 0.1, 0.2, 0.3, 0.4);
    first.convention = Convention::Hayati;
    first.beta = 0.5;
    let mut second = Joint::new(JointKind::Prismatic, Convention::ZeroReference);
    second.d = 0.25;
    second.axis = Vector3::new(0.0, 1.0, 0.0);
    second.point = Vector3::new(1.5, 2.5, 3.5);
    second.turn = [0.01, 0.02];
    second.shift = [0.03, 0.04];
    let mass = |mass| LinkMass {
        mass,
        com: Vector3::new(0.125, 0.25, 0.5),
    };
    let pose = |x| StoredPose {
        translation: [x, 2.0 * x, 3.0 * x],
        rotation_vector: [0.5, -0.25, 0.125],
    };
    let nominal = Description {
        base: pose(1.0),
        joints: [first, second].into_iter().collect(),
        masses: [mass(4.0), mass(8.0)].into_iter().collect(),
        tool: pose(0.0625),
    };
    let mut calibrated = nominal.clone();
    calibrated.joints[0].alpha = 0.375;
    Blob {
        robot: "golden".try_into().unwrap(),
        nominal,
        calibrated,
        limits: [[-3.0, 2.0], [0.0, 0.75]].into_iter().collect(),
        resolution: [1e-5, 0.0].into_iter().collect(),
        gravity: [0.0, 0.0, -9.75],
        effects: [
            Effect::JointGain(JointGain {
                joint: 0,
                gain: [0.001],
            }),
            Effect::GearEccentricity(GearEccentricity {
                joint: 0,
                order: 2.0,
                amplitude: [0.002, 0.003],
            }),
            Effect::JointCompliance(JointCompliance {
                joint: 1,
                compliance: [1e-6],
            }),
            Effect::CrossAxisCompliance(CrossAxisCompliance {
                compliance: [2e-6],
                ..CrossAxisCompliance::new(0)
            }),
        ]
        .into_iter()
        .collect(),
        settings: Settings {
            iteration_cycles: Some(300),
            ..Settings::default()
        },
        provenance: Provenance {
            tool: "truepose".try_into().unwrap(),
            data: "golden.csv".try_into().unwrap(),
            date: "2026-01-01".try_into().unwrap(),
            rows_identify: 70,
            rows_verify: 300,
            rms_before: 0.001,
            rms_after: 0.0001,
        },
        taught: Taught::default(),
    }
}

/// Puts a body's length and checksum right again after a change.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let body = &bytes[HEADER..];
    let length = u32::try_from(body.len()).unwrap().to_le_bytes();
    let sum = crc32(body).to_le_bytes();
    bytes[8..12].copy_from_slice(&length);
    bytes[12..16].copy_from_slice(&sum);
    bytes
}

/// CRC-32 by its definition, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

#[test]
fn a_blob_comes_back_as_it_was_written() {
    let mut random = Random(11);
    for joints in 1..=12 {
        for _ in 0..20 {
            let blob = blob(&mut random, joints);
            assert_eq!(Blob::decode(&encoded(&blob)), Ok(blob));
        }
    }
}

#[test]
fn the_model_is_the_same_from_the_bytes_and_from_the_description() {
    let mut random = Random(12);
    for _ in 0..50 {
        let mut blob = blob(&mut random, 6);
        blob.effects = one_of_each().into_iter().collect();
        let bytes = encoded(&blob);
        let model = decode::<f64, 6>(&bytes).unwrap();
        let again = blob.model::<f64, 6>().unwrap();
        assert_eq!(model, again);
        let single = decode::<f32, 6>(&bytes).unwrap();
        assert_eq!(single, blob.model::<f32, 6>().unwrap());
        assert_eq!(single.nominal, model.nominal.cast());
        assert_eq!(single.calibrated, model.calibrated.cast());
    }
}

fn golden(text: &str) -> Vec<u8> {
    let digits: String = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .flat_map(|line| line.split_whitespace())
        .collect();
    let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
    (0..digits.len()).step_by(2).map(byte).collect()
}

#[test]
fn blobs_of_older_layouts_are_refused_by_name() {
    for (found, text) in [
        (1, include_str!("golden/blob_layout_1.hex")),
        (2, include_str!("golden/blob_layout_2.hex")),
    ] {
        let bytes = golden(text);
        let refusal = BlobError::LayoutOlder { found };
        assert_eq!(decode::<f32, 2>(&bytes).err(), Some(refusal));
        assert_eq!(Blob::decode(&bytes).err(), Some(refusal));
    }
}

/// The sample with tables of every kind.
fn sample_with_tables() -> Blob<'static> {
    let region = |ranges: &[[f64; 2]]| Region(ranges.iter().copied().collect());
    let mut blob = sample();
    blob.taught = Taught {
        polynomial: Some(Polynomial {
            joints: Block {
                region: region(&[[-1.0, 0.5]]),
                degree: 1,
                // Of x: 0 and 2; of one: 0.5 and -1.
                coefficients: &[0, 0, 0, 0, 0, 0, 0, 0x40, 0, 0, 0, 0x3F, 0, 0, 0x80, 0xBF],
            },
            tool: Some(Block {
                region: region(&[[0.25, 0.5]]),
                degree: 0,
                coefficients: &[0, 0, 0x80, 0x3E, 0, 0, 0, 0, 0, 0, 0x80, 0x3F],
            }),
        }),
        cmac: Some(Cmac {
            region: region(&[[-1.0, 1.0], [0.0, 0.5]]),
            layout: Layout {
                layers: 3,
                cells: 1,
            },
            scale: [1e-6, 2e-6].into_iter().collect(),
            table: &[7; 48],
        }),
    };
    blob.settings.method = Method::Polynomial;
    blob
}

#[test]
fn the_bytes_of_layout_3_stay_as_they_are() {
    let written = encoded(&sample_with_tables());
    let hex: Vec<String> = written
        .chunks(32)
        .map(|line| line.iter().map(|b| format!("{b:02x}")).collect())
        .collect();
    let found = hex.join("\n");
    let wanted = golden(include_str!("golden/blob_layout_3.hex"));
    assert_eq!(written, wanted, "found:\n{found}");
    assert_eq!(Blob::decode(&written), Ok(sample_with_tables()));
    let model = decode::<f32, 2>(&written).unwrap();
    // The tables are read where they lie.
    let taught = model.taught.polynomial.unwrap();
    let within = written.as_ptr_range();
    assert!(within.contains(&taught.joints.coefficients.as_ptr()));
    assert!(within.contains(&model.taught.cmac.unwrap().table.as_ptr()));
    // Constant and slope of the second joint: 2 x - 1 at x = -0.5 + 0.25.
    let (delta, miss) = taught.evaluate(&[-0.4375, 0.3]).unwrap();
    let found = [delta[0], delta[1], miss[0], miss[1], miss[2]];
    for (found, wanted) in found.into_iter().zip([0.5, -1.5, 0.25, 0.0, 1.0]) {
        assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    }
}

#[test]
fn tables_come_back_and_unsound_ones_are_refused() {
    let mut random = Random(13);
    for joints in 1..=7 {
        for _ in 0..5 {
            let mut blob = blob(&mut random, joints);
            tables::teach_nonsense(&mut random, &mut blob);
            let mut buffer = vec![0; 1 << 17];
            let bytes = blob.encode(&mut buffer).unwrap().to_vec();
            assert_eq!(Blob::decode(&bytes), Ok(blob));
        }
    }
    let refused = |change: &dyn Fn(&mut Blob)| {
        let mut blob = sample_with_tables();
        change(&mut blob);
        blob.encode(&mut vec![0; ROOM]).err()
    };
    let taught = Some(BlobError::Taught);
    let polynomial = |change: &dyn Fn(&mut Polynomial<f64>)| {
        refused(&|b| change(b.taught.polynomial.as_mut().unwrap()))
    };
    let cmac =
        |change: &dyn Fn(&mut Cmac<f64>)| refused(&|b| change(b.taught.cmac.as_mut().unwrap()));
    assert_eq!(refused(&|_| {}), None);
    assert_eq!(polynomial(&|p| p.joints.degree = 2), taught);
    assert_eq!(polynomial(&|p| p.joints.region.0[0][1] = -1.0), taught);
    assert_eq!(polynomial(&|p| p.joints.region.0.clear()), taught);
    let nan = |p: &mut Polynomial<f64>| p.tool.as_mut().unwrap().coefficients = &[255; 12];
    assert_eq!(polynomial(&nan), taught);
    let number = Some(BlobError::Number);
    assert_eq!(polynomial(&|p| p.joints.region.0[0][0] = f64::NAN), number);
    assert_eq!(cmac(&|c| c.layout.layers = 2), taught);
    assert_eq!(cmac(&|c| c.layout.cells = 0), taught);
    assert_eq!(cmac(&|c| c.table = &[7; 47]), taught);
    assert_eq!(cmac(&|c| c.scale.clear()), taught);
    assert_eq!(cmac(&|c| c.scale[1] = f64::INFINITY), number);
    // A method without its tables.
    assert_eq!(
        refused(&|b| b.taught.polynomial = None),
        Some(BlobError::NotTaught)
    );
}

#[test]
fn every_single_bit_flip_is_refused() {
    let bytes = encoded(&blob(&mut Random(2), 6));
    for position in 0..bytes.len() {
        for bit in 0..8 {
            let mut changed = bytes.clone();
            changed[position] ^= 1 << bit;
            let refusal = decode::<f32, 6>(&changed).err();
            let expected = match position {
                0..4 => Some(BlobError::Magic),
                7 => Some(BlobError::Reserved),
                12.. => Some(BlobError::Checksum),
                _ => refusal,
            };
            assert!(refusal.is_some(), "byte {position} bit {bit}");
            assert_eq!(refusal, expected, "byte {position} bit {bit}");
            assert!(Blob::decode(&changed).is_err(), "byte {position} bit {bit}");
        }
    }
}

#[test]
fn every_truncation_and_extension_is_refused() {
    let bytes = encoded(&blob(&mut Random(3), 6));
    for length in 0..bytes.len() {
        let refusal = decode::<f32, 6>(&bytes[..length]).err();
        if length < HEADER {
            assert_eq!(refusal, Some(BlobError::TooShort { bytes: length }));
        } else {
            assert!(matches!(refusal, Some(BlobError::Length { .. })));
        }
        // With the header put right the body still ends too early.
        if length >= HEADER {
            let refusal = decode::<f32, 6>(&sealed(bytes[..length].to_vec())).err();
            assert_eq!(refusal, Some(BlobError::Body));
        }
    }
    for extra in 1..20 {
        let mut longer = bytes.clone();
        longer.extend(std::iter::repeat_n(0, extra));
        assert!(matches!(
            decode::<f32, 6>(&longer).err(),
            Some(BlobError::Length { .. })
        ));
        assert_eq!(
            decode::<f32, 6>(&sealed(longer)).err(),
            Some(BlobError::Trailing { bytes: extra })
        );
    }
}

/// The `k`-th baked number of the nominal base.
fn baked_base(blob: &Blob, k: usize) -> std::ops::Range<usize> {
    let start = HEADER + 1 + blob.robot.len() + 8 * k;
    start..start + 8
}

/// The `k`-th baked number of joint `j` (from 0) of the nominal chain.
fn baked_joint(blob: &Blob, j: usize, k: usize) -> std::ops::Range<usize> {
    let start = baked_base(blob, 12).start + 1 + (1 + 11 * 8) * j + 1 + 8 * k;
    start..start + 8
}

#[test]
fn unsound_baked_numbers_are_refused_and_the_host_wants_them_as_described() {
    let blob = sample();
    let bytes = encoded(&blob);
    let changed = |place: std::ops::Range<usize>, by: f64| {
        let mut bytes = bytes.clone();
        let number: [u8; 8] = bytes[place.clone()].try_into().unwrap();
        let number = f64::from_le_bytes(number) + by;
        bytes[place].copy_from_slice(&number.to_le_bytes());
        let bytes = sealed(bytes);
        (decode::<f32, 2>(&bytes).err(), Blob::decode(&bytes).err())
    };
    let baked = |joint| Some(BlobError::Baked { joint });
    // Any entry of a rotation, but not of an origin.
    for k in 0..9 {
        assert_eq!(changed(baked_base(&blob, k), 1e-2), (baked(0), baked(0)));
        assert_eq!(changed(baked_base(&blob, k), 1e-8), (None, baked(0)));
        assert_eq!(changed(baked_base(&blob, k), 1e-12), (None, None));
    }
    for k in 9..12 {
        assert_eq!(changed(baked_base(&blob, k), 1e-2), (None, baked(0)));
    }
    for j in 0..2 {
        let joint = baked(u8::try_from(j + 1).unwrap());
        // Angle, sine and cosine of theta; sine and cosine of alpha.
        for k in [0, 1, 2, 5, 6] {
            // Where a sine or a cosine is 0 it takes a larger change to notice.
            let place = baked_joint(&blob, j, k);
            assert_eq!(changed(place.clone(), 0.1), (joint, joint), "{j} {k}");
            assert_eq!(changed(place, 1e-8), (None, joint), "{j} {k}");
        }
        // The slide has no offset across its axis; a link may have any.
        let offset = if j == 1 { joint } else { None };
        for k in [3, 4] {
            assert_eq!(changed(baked_joint(&blob, j, k), 0.1), (offset, joint));
        }
        for k in 8..11 {
            assert_eq!(changed(baked_joint(&blob, j, k), 0.1), (None, joint));
        }
    }
    let mass = Some(BlobError::Mass { joint: 2 });
    assert_eq!(changed(baked_joint(&blob, 1, 7), -20.0), (mass, mass));
    // What an effect fixes in a link stands behind its value.
    let value = 2e-6_f64.to_le_bytes();
    let place = bytes.windows(8).position(|window| window == value);
    let anchor = place.unwrap() + 8;
    let effect = Some(BlobError::Effect { effect: 4 });
    for k in 0..5 {
        let number = anchor + 8 * k..anchor + 8 * k + 8;
        assert_eq!(changed(number, 0.1), (None, effect));
    }
}

#[test]
fn random_bytes_never_pass_or_panic() {
    let mut random = Random(4);
    let good = encoded(&blob(&mut random, 6));
    for _ in 0..20_000 {
        let length = random.below(400);
        let noise: Vec<u8> = (0..length).map(|_| random.below(256) as u8).collect();
        assert!(decode::<f32, 6>(&noise).is_err());
        // Behind a good header, with length and checksum right.
        let mut bytes = good[..HEADER].to_vec();
        bytes.extend(&noise);
        assert!(decode::<f32, 6>(&sealed(bytes)).is_err());
    }
}

#[test]
fn altered_bodies_with_a_right_checksum_are_sound_or_refused() {
    let mut random = Random(5);
    let good = encoded(&blob(&mut random, 6));
    let mut passed = 0;
    for _ in 0..20_000 {
        let mut bytes = good.clone();
        for _ in 0..=random.below(3) {
            let position = HEADER + random.below(bytes.len() - HEADER);
            bytes[position] = random.below(256) as u8;
        }
        if let Ok(model) = decode::<f32, 6>(&sealed(bytes)) {
            passed += 1;
            let pose = model.nominal_pose(&[0.1; 6]);
            assert!(pose.is_finite());
        }
    }
    // Most single changes of a mantissa are sound numbers.
    assert!(passed > 1000, "{passed}");
}

#[test]
fn what_a_reader_would_refuse_is_not_written() {
    let mut random = Random(6);
    let good = blob(&mut random, 3);
    let mut buffer = vec![0; ROOM];
    let mut refused = |change: &dyn Fn(&mut Blob)| {
        let mut blob = good.clone();
        change(&mut blob);
        blob.encode(&mut buffer).err()
    };
    assert_eq!(
        refused(&|b| b.calibrated.joints[1].a = f64::NAN),
        Some(BlobError::Number)
    );
    assert_eq!(
        refused(&|b| b.gravity[2] = f64::INFINITY),
        Some(BlobError::Number)
    );
    assert_eq!(
        refused(&|b| b.provenance.rms_after = 1e10),
        Some(BlobError::Number)
    );
    assert_eq!(
        refused(&|b| b.nominal.joints[2].axis.x += 0.1),
        Some(BlobError::Axis { joint: 3 })
    );
    assert_eq!(
        refused(&|b| b.limits[0] = [1.0, -1.0]),
        Some(BlobError::Limits { joint: 1 })
    );
    assert_eq!(
        refused(&|b| b.limits[0] = [0.0, 101.0]),
        Some(BlobError::Limits { joint: 1 })
    );
    assert_eq!(
        refused(&|b| b.resolution[2] = -1e-6),
        Some(BlobError::Resolution { joint: 3 })
    );
    assert_eq!(
        refused(&|b| b.calibrated.masses[0].mass = -1.0),
        Some(BlobError::Mass { joint: 1 })
    );
    assert_eq!(
        refused(&|b| b.settings.damping = 0.0),
        Some(BlobError::Settings)
    );
    assert_eq!(
        refused(&|b| {
            b.limits.pop();
        }),
        Some(BlobError::Joints {
            found: 2,
            expected: 3
        })
    );
    assert_eq!(
        refused(&|b| {
            let kind = &mut b.calibrated.joints[0].kind;
            *kind = match kind {
                truepose::JointKind::Revolute => truepose::JointKind::Prismatic,
                truepose::JointKind::Prismatic => truepose::JointKind::Revolute,
            };
        }),
        Some(BlobError::Kind { joint: 1 })
    );
    assert_eq!(
        refused(&|b| {
            let stray = truepose::effects::JointGain::new(3);
            let full = b.effects.push(truepose::effects::Effect::JointGain(stray));
            assert!(full.is_ok());
        }),
        Some(BlobError::Effect {
            effect: u8::try_from(good.effects.len() + 1).unwrap()
        })
    );
    assert_eq!(refused(&|_| {}), None);
    let mut small = [0; 100];
    assert_eq!(
        good.encode(&mut small).err(),
        Some(BlobError::BufferTooSmall)
    );
}

#[test]
fn other_layouts_and_joint_counts_are_refused_by_name() {
    let bytes = encoded(&blob(&mut Random(7), 6));
    let mut newer = bytes.clone();
    newer[4] = 4;
    assert_eq!(
        decode::<f32, 6>(&newer).err(),
        Some(BlobError::LayoutNewer { found: 4 })
    );
    let mut older = bytes.clone();
    older[4] = 0;
    assert_eq!(
        decode::<f32, 6>(&older).err(),
        Some(BlobError::LayoutOlder { found: 0 })
    );
    assert_eq!(
        decode::<f32, 5>(&bytes).err(),
        Some(BlobError::Joints {
            found: 6,
            expected: 5
        })
    );
    // A header that disagrees with its body.
    let mut lying = bytes;
    lying[6] = 5;
    let wrong = Some(BlobError::Joints {
        found: 6,
        expected: 5,
    });
    assert_eq!(decode::<f32, 5>(&lying).err(), wrong);
    assert_eq!(Blob::decode(&lying).err(), wrong);
}

#[test]
fn a_checksum_may_be_taken_in_pieces() {
    let bytes: Vec<u8> = (0..100).map(|k: u8| k.wrapping_mul(37)).collect();
    for cut in 0..=bytes.len() {
        let (one, two) = bytes.split_at(cut);
        let crc = checksum_onwards(checksum_onwards(0, one), two);
        assert_eq!(crc, crc32(&bytes));
    }
    assert_eq!(checksum(&bytes), crc32(&bytes));
}
