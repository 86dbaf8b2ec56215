//! Random, altered and truncated frames and blobs: nothing panics, nothing is taken that was
//! not sent.
//!
//! The same, a million times:
//! `cargo test --release --test all damaged_input_is_refused -- --ignored --nocapture`

use crate::blobs::blob;
use crate::controller::{Controller, SLOT, frame};
use crate::random::Random;
use truepose::link::{Announcement, Ask, CHUNK, Decoder, Request};
use truepose::params::{Blob, HEADER, LAYOUT, checksum};

/// Good blobs of one robot.
fn good_blobs(random: &mut Random) -> Vec<Vec<u8>> {
    let mut one = |joints| {
        let mut buffer = vec![0; SLOT];
        let blob = blob(random, joints);
        blob.encode(&mut buffer).unwrap().to_vec()
    };
    vec![one(2), one(2), one(2)]
}

/// `bytes` with something wrong; seldom with nothing wrong.
fn damaged(random: &mut Random, bytes: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let place = |random: &mut Random, bytes: &[u8]| random.below(bytes.len().max(1));
    for _ in 0..=random.below(2) {
        let at = place(random, &bytes);
        match random.below(8) {
            0 => bytes.truncate(at),
            1 => bytes.insert(at, random.below(256) as u8),
            2 => {
                bytes.drain(at..(at + 1 + random.below(20)).min(bytes.len()));
            }
            3 => {
                bytes.truncate(at);
                bytes.extend(&other[at.min(other.len())..]);
            }
            4 => bytes.extend((0..random.below(20)).map(|k| (k * 37) as u8)),
            5 => {
                let end = (at + random.below(12)).min(bytes.len());
                for byte in &mut bytes[at..end] {
                    *byte = random.below(256) as u8;
                }
            }
            _ => {
                for _ in 0..=random.below(4) {
                    let at = place(random, &bytes);
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte ^= 1 << random.below(8);
                    }
                }
            }
        }
    }
    bytes
}

/// `count` blobs that are not what was written. Those with their length and checksum put right
/// again may be sound by chance; then they are, and come back the same.
fn blobs_with_damage(random: &mut Random, count: usize) {
    let good = good_blobs(random);
    let (mut as_written, mut sound) = (0, 0);
    for turn in 0..count {
        let one = &good[random.below(3)];
        let other = &good[random.below(3)];
        let mut bytes = damaged(random, one, other);
        let sealed = turn % 2 == 1 && bytes.len() >= HEADER;
        if sealed {
            let length = (bytes.len() - HEADER) as u32;
            let sum = checksum(&bytes[HEADER..]);
            bytes[8..12].copy_from_slice(&length.to_le_bytes());
            bytes[12..16].copy_from_slice(&sum.to_le_bytes());
        }
        let Ok(blob) = Blob::decode(&bytes) else {
            continue;
        };
        if good.contains(&bytes) {
            as_written += 1;
            continue;
        }
        assert!(sealed, "an altered blob was taken");
        let mut buffer = vec![0; SLOT];
        let again = blob.encode(&mut buffer).unwrap();
        assert_eq!(Blob::decode(again).as_ref(), Ok(&blob));
        let model = blob.model::<f32, 2>().unwrap();
        let pose = model.nominal_pose(&[0.1; 2]);
        assert!(pose.translation.iter().all(|x| !x.is_nan()));
        sound += 1;
    }
    println!("{count} damaged blobs: {as_written} undamaged, {sound} sealed again and sound");
    assert!(as_written < count / 10 && sound > 0);
}

/// The frames that send `blob`.
fn frames(blob: &[u8], transfer: u32) -> Vec<Vec<u8>> {
    let begin = Ask::Begin(Announcement {
        transfer,
        length: blob.len() as u32,
        crc: checksum(blob),
        layout: LAYOUT,
        joints: 2,
        robot: "random",
    });
    let chunks = blob.chunks(CHUNK).zip((0..).step_by(CHUNK));
    let chunks = chunks.map(|(bytes, offset)| Ask::Chunk {
        transfer,
        offset,
        bytes,
    });
    let asks = [Ask::Identify, begin].into_iter().chain(chunks);
    asks.chain([Ask::Status, Ask::Commit { transfer }])
        .zip(1..)
        .map(|(ask, number)| frame(&Request { number, ask }))
        .collect()
}

/// `count` frames of which most are damaged, repeated, left out or swapped, to a controller.
fn frames_with_damage(random: &mut Random, count: usize) {
    let good = good_blobs(random);
    let (mut controller, mut saved) = (Controller::new("random", 2), 0);
    let (mut sent, mut taken) = (0, 0);
    let mut session = 0_usize;
    while sent < count {
        session += 1;
        let blob = &good[random.below(3)];
        let mut frames = frames(blob, session as u32);
        // Every fourth session is left alone: parameters do come through.
        let harm = if session.is_multiple_of(4) {
            0
        } else {
            1 + random.below(4)
        };
        for _ in 0..harm {
            let at = random.below(frames.len());
            match random.below(4) {
                0 => frames.insert(at, frames[at].clone()),
                1 => {
                    frames.remove(at);
                }
                2 => {
                    let other = random.below(frames.len());
                    frames.swap(at, other);
                }
                _ => {
                    let other = frames[random.below(frames.len())].clone();
                    frames[at] = damaged(random, &frames[at], &other);
                }
            }
        }
        let whole: Vec<Vec<u8>> = self::frames(blob, session as u32)
            .iter()
            .map(|frame| payload(frame).unwrap())
            .collect();
        for frame in &frames {
            sent += 1;
            if let Some(payload) = payload(frame) {
                assert!(whole.contains(&payload), "an altered frame was taken");
                taken += 1;
            }
            controller.wire.coming.extend(frame);
        }
        // Noise between sessions.
        for _ in 0..random.below(40) {
            controller.wire.coming.push_back(random.below(256) as u8);
        }
        controller.wire.coming.push_back(0);
        controller.settle();
        for kept in controller.saved.drain(..) {
            assert!(kept == *blob, "kept something else");
            saved += 1;
        }
        if harm == 0 {
            assert_eq!(controller.stored().as_ref(), Some(blob));
        }
        controller.wire.going.clear();
    }
    println!("{sent} frames: {taken} came through whole; {saved} blobs kept in {session} sessions");
    assert!(saved >= session / 4 && saved < session);
    assert!(taken < sent);
}

/// `count` frames, every one of them damaged or noise, to a controller that has seen the
/// beginning of a transfer.
fn damaged_frames_alone(random: &mut Random, count: usize) {
    let good = good_blobs(random);
    let mut controller = Controller::new("random", 2);
    let frames = frames(&good[0], 1);
    let whole: Vec<Vec<u8>> = frames.iter().map(|f| payload(f).unwrap()).collect();
    let mut damage = 0;
    while damage < count {
        let bytes = if random.below(8) == 0 {
            let length = random.below(300);
            (0..length).map(|_| random.below(256) as u8).collect()
        } else {
            let other = &frames[random.below(frames.len())];
            let one = &frames[random.below(frames.len())];
            damaged(random, one, other)
        };
        if frames.contains(&bytes) {
            continue;
        }
        damage += 1;
        // A frame may have kept its beginning or its end whole, and no other can be.
        if let Some(payload) = payload(&bytes) {
            assert!(whole.contains(&payload), "an altered frame was taken");
        }
        controller.wire.coming.extend(&bytes);
        while !controller.wire.coming.is_empty() {
            controller.poll();
        }
        controller.wire.going.clear();
        // Those that kept their beginning whole may add up to a transfer.
        assert!(controller.saved.drain(..).all(|kept| kept == good[0]));
    }
    println!("{damage} damaged frames");
}

/// What the first frame in `bytes` holds.
fn payload(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut decoder = Decoder::new();
    for byte in bytes {
        if let Some(frame) = decoder.feed(*byte) {
            return frame.ok().map(<[u8]>::to_vec);
        }
    }
    None
}

#[test]
fn damaged_blobs() {
    blobs_with_damage(&mut Random(71), 10_000);
}

#[test]
fn damaged_frames() {
    frames_with_damage(&mut Random(72), 10_000);
}

#[test]
fn damaged_frames_and_noise() {
    damaged_frames_alone(&mut Random(75), 10_000);
}

#[test]
#[ignore = "a million takes half a minute in release mode"]
fn a_million() {
    blobs_with_damage(&mut Random(73), 550_000);
    damaged_frames_alone(&mut Random(76), 500_000);
    frames_with_damage(&mut Random(74), 500_000);
}
