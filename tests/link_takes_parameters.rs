//! Parameters come over the link whole, or not at all and with a reason.

use crate::blobs::blob;
use crate::controller::{Controller, SLOT, frame};
use crate::memories;
use crate::random::Random;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request as Wanted};
use truepose::link::{
    Active, Announcement, Ask, CHUNK, Decoder, Fault, FrameError, Identity, PROTOCOL, Refusal,
    Reply, Report, Request, Stage, Tally,
};
use truepose::params::{BlobError, HEADER, LAYOUT, OLDEST_LAYOUT, checksum, decode};

const TRANSFER: u32 = 77;

/// A blob of the robot `name`.
fn named(name: &str, joints: usize, seed: u64) -> Vec<u8> {
    let mut blob = blob(&mut Random(seed), joints);
    blob.robot = name.try_into().unwrap();
    let mut buffer = vec![0; 2 * SLOT];
    blob.encode(&mut buffer).unwrap().to_vec()
}

fn announcement(blob: &[u8]) -> Announcement<'static> {
    Announcement {
        transfer: TRANSFER,
        length: blob.len() as u32,
        crc: checksum(blob),
        layout: LAYOUT,
        joints: 6,
        robot: "arm",
    }
}

fn chunk(blob: &[u8], offset: usize) -> Ask<'_> {
    let rest = &blob[offset..];
    Ask::Chunk {
        transfer: TRANSFER,
        offset: offset as u32,
        bytes: &rest[..rest.len().min(CHUNK)],
    }
}

const COMMIT: Ask<'static> = Ask::Commit { transfer: TRANSFER };

/// Announces and sends all of `blob`, and commits.
fn send(controller: &mut Controller, blob: &[u8]) -> Reply<'static> {
    let begun = controller.ask(Ask::Begin(announcement(blob)));
    assert_eq!(begun, Reply::Accepted { received: 0 });
    for offset in (0..blob.len()).step_by(CHUNK) {
        let received = blob.len().min(offset + CHUNK) as u32;
        let reply = controller.ask(chunk(blob, offset));
        assert_eq!(reply, Reply::Accepted { received });
    }
    controller.ask(COMMIT)
}

fn active(blob: &[u8], sequence: u32) -> Active {
    Active {
        length: blob.len() as u32,
        crc: checksum(blob),
        sequence,
    }
}

#[test]
fn a_blob_comes_is_kept_and_told() {
    let mut controller = Controller::new("arm", 6);
    let who = Identity {
        protocol: PROTOCOL,
        layout: LAYOUT,
        joints: 6,
        room: (SLOT - 128) as u32,
        robot: "arm",
        firmware: "tests",
        active: None,
    };
    assert_eq!(controller.ask(Ask::Identify), Reply::Identity(who));
    for sequence in 1..=3 {
        let blob = named("arm", 6, u64::from(sequence));
        let new = active(&blob, sequence);
        assert_eq!(send(&mut controller, &blob), Reply::Committed(new));
        assert_eq!(controller.saved.last(), Some(&blob));
        assert_eq!(controller.stored(), Some(blob));
        let told = Identity {
            active: Some(new),
            ..who
        };
        assert_eq!(controller.ask(Ask::Identify), Reply::Identity(told));
    }
}

#[test]
fn the_loop_tells_how_it_is() {
    let bytes = named("arm", 6, 9);
    let model = decode::<f32, 6>(&bytes).unwrap();
    let mut compensator = Compensator::new(&model);
    let mut controller = Controller::new("arm", 6);
    let mut largest = [0.0_f32; 2];
    for k in 0..20 {
        let mut q = [0.1 * k as f32 - 0.9; 6];
        if k == 19 {
            q[2] = f32::NAN;
        }
        let outcome = compensator.correct(&Wanted::joints(q), &mut Budget::unlimited());
        controller.tally.count(&outcome);
        if let Some(error) = outcome.remaining {
            largest = [
                largest[0].max(error.position),
                largest[1].max(error.orientation),
            ];
        }
    }
    controller.tally.miss();
    controller.link.put_to_use(active(&bytes, 4));
    let Reply::Status(report) = controller.ask(Ask::Status) else {
        panic!("no status")
    };
    let Report {
        active: told,
        stage,
        tally,
    } = report;
    assert_eq!((told, stage), (Some(active(&bytes, 4)), Stage::Idle));
    assert_eq!(tally, controller.tally);
    assert_eq!((tally.answered, tally.missed), (20, 1));
    assert_eq!(tally.statuses.iter().sum::<u32>(), 20);
    assert_eq!(tally.statuses[7], 1);
    assert_eq!((tally.last.status, tally.last.error), (7, None));
    assert_eq!(
        tally.largest_error.map(f32::to_bits),
        largest.map(f32::to_bits)
    );
    assert!(largest[0] > 0.0 && tally.statuses[0] > 0);
}

/// A controller that has parameters in use, and what must not change.
fn in_use() -> (Controller, Vec<u8>) {
    let mut controller = Controller::new("arm", 6);
    let old = named("arm", 6, 1);
    assert!(matches!(
        send(&mut controller, &old),
        Reply::Committed(Active { sequence: 1, .. })
    ));
    (controller, old)
}

fn unchanged(controller: &mut Controller, old: &[u8]) {
    assert_eq!(controller.saved.len(), 1);
    assert_eq!(controller.stored().as_deref(), Some(old));
    let Reply::Identity(identity) = controller.ask(Ask::Identify) else {
        panic!("no identity")
    };
    assert_eq!(identity.active, Some(active(old, 1)));
}

#[test]
fn what_does_not_fit_is_refused_at_once() {
    let (mut controller, old) = in_use();
    let good = announcement(&named("arm", 6, 2));
    let room = (SLOT - 128) as u32;
    for (announced, refusal) in [
        (
            Announcement {
                robot: "other",
                ..good
            },
            Refusal::Robot,
        ),
        (Announcement { robot: "", ..good }, Refusal::Robot),
        (
            Announcement { joints: 7, ..good },
            Refusal::Joints { expected: 6 },
        ),
        (
            Announcement {
                layout: LAYOUT + 1,
                ..good
            },
            Refusal::Layout { expected: LAYOUT },
        ),
        (
            Announcement { layout: 0, ..good },
            Refusal::Layout { expected: LAYOUT },
        ),
        (Announcement { length: 0, ..good }, Refusal::Size { room }),
        (
            Announcement {
                length: room + 1,
                ..good
            },
            Refusal::Size { room },
        ),
    ] {
        let reply = controller.ask(Ask::Begin(announced));
        assert_eq!(reply, Reply::Refused(refusal));
        assert_eq!(
            controller.ask(COMMIT),
            Reply::Refused(Refusal::NotBegun),
            "{announced:?}"
        );
    }
    unchanged(&mut controller, &old);
}

#[test]
fn every_layout_that_is_read_is_taken() {
    let (mut controller, _) = in_use();
    let new = named("arm", 6, 12);
    for layout in OLDEST_LAYOUT..=LAYOUT {
        let begun = controller.ask(Ask::Begin(Announcement {
            layout,
            ..announcement(&new)
        }));
        assert_eq!(begun, Reply::Accepted { received: 0 }, "{layout}");
    }
}

#[test]
fn pieces_out_of_order_are_refused_and_the_transfer_goes_on() {
    let (mut controller, old) = in_use();
    let new = named("arm", 6, 2);
    let refused = |refusal| Reply::Refused(refusal);
    assert_eq!(
        controller.ask(chunk(&new, 0)),
        refused(Refusal::NotBegun),
        "before begin"
    );
    controller.ask(Ask::Begin(announcement(&new)));
    let (first, second) = (chunk(&new, 0), chunk(&new, CHUNK));
    let expected = |expected| refused(Refusal::OutOfOrder { expected });
    assert_eq!(controller.ask(second), expected(0), "reordered");
    assert_eq!(controller.ask(first), Reply::Accepted { received: 192 });
    assert_eq!(controller.ask(first), expected(192), "repeated");
    let (transfer, offset) = (TRANSFER, 192);
    for bytes in [&[] as &[u8], &[0; CHUNK]] {
        let short = Announcement {
            length: 300,
            ..announcement(&new)
        };
        let (mut other, _) = in_use();
        other.ask(Ask::Begin(short));
        other.ask(first);
        let chunk = Ask::Chunk {
            transfer,
            offset,
            bytes,
        };
        assert_eq!(other.ask(chunk), refused(Refusal::ChunkSize));
    }
    let stranger = Ask::Chunk {
        transfer: TRANSFER + 1,
        offset,
        bytes: &new[192..200],
    };
    assert_eq!(controller.ask(stranger), refused(Refusal::NotBegun));
    assert_eq!(
        controller.ask(COMMIT),
        refused(Refusal::Incomplete { received: 192 })
    );
    unchanged(&mut controller, &old);
    for offset in (CHUNK..new.len()).step_by(CHUNK) {
        controller.ask(chunk(&new, offset));
    }
    assert_eq!(controller.ask(COMMIT), Reply::Committed(active(&new, 2)));
    assert_eq!(controller.ask(COMMIT), refused(Refusal::NotBegun));
    assert_eq!(controller.stored(), Some(new));
}

#[test]
fn what_came_is_checked_whatever_was_announced() {
    let (mut controller, old) = in_use();
    let mut altered = named("arm", 6, 2);
    altered[200] ^= 1;
    let mut newer = named("arm", 6, 3);
    newer[4] = 9;
    for (blob, refusal) in [
        (altered, Refusal::Blob(BlobError::Checksum)),
        (newer, Refusal::Blob(BlobError::LayoutNewer { found: 9 })),
        (named("other", 6, 4), Refusal::Robot),
        (named("arm", 5, 5), Refusal::Joints { expected: 6 }),
        (
            named("arm", 6, 6)[..HEADER].to_vec(),
            Refusal::Blob(BlobError::Length {
                found: 0,
                expected: named("arm", 6, 6).len() as u32 - 16,
            }),
        ),
    ] {
        assert_eq!(send(&mut controller, &blob), Reply::Refused(refusal));
        unchanged(&mut controller, &old);
    }
    // What came is not what was announced.
    let new = named("arm", 6, 7);
    controller.ask(Ask::Begin(Announcement {
        crc: 1,
        ..announcement(&new)
    }));
    for offset in (0..new.len()).step_by(CHUNK) {
        controller.ask(chunk(&new, offset));
    }
    let refusal = Reply::Refused(Refusal::Checksum);
    assert_eq!(controller.ask(COMMIT), refusal);
    unchanged(&mut controller, &old);
}

#[test]
fn nothing_new_is_taken_while_a_blob_is_being_kept() {
    let (mut controller, _) = in_use();
    let new = named("arm", 6, 2);
    controller.ask(Ask::Begin(announcement(&new)));
    for offset in (0..new.len()).step_by(CHUNK) {
        controller.ask(chunk(&new, offset));
    }
    let requests = [COMMIT, Ask::Status, chunk(&new, 0), COMMIT];
    for (number, ask) in (100..).zip(requests) {
        let bytes = frame(&Request { number, ask });
        controller.wire.coming.extend(bytes);
        // Into the work, not through it.
        for _ in 0..12 {
            controller.poll();
        }
    }
    let answers = controller.answers();
    let [
        (101, Reply::Status(report)),
        (102, busy),
        (103, also),
        (100, done),
    ] = answers[..]
    else {
        panic!("{answers:?}")
    };
    assert_eq!(report.stage, Stage::Saving);
    assert_eq!(busy, Reply::Refused(Refusal::Busy));
    assert_eq!(also, busy);
    assert_eq!(done, Reply::Committed(active(&new, 2)));
}

#[test]
fn a_memory_that_fails_is_told() {
    let (mut controller, old) = in_use();
    let new = named("arm", 6, 2);
    controller.chip.0.borrow_mut().stuck = Some((SLOT + 12, 0xFF));
    let refusal = Refusal::Storage(Fault::NotAsWritten);
    assert_eq!(send(&mut controller, &new), Reply::Refused(refusal));
    unchanged(&mut controller, &old);
    controller.chip.0.borrow_mut().stuck = None;
    controller.chip.power(Some(700), memories::Cut::Clean);
    let refusal = Refusal::Storage(Fault::Memory);
    assert_eq!(send(&mut controller, &new), Reply::Refused(refusal));
    controller.chip.power(None, memories::Cut::Clean);
    unchanged(&mut controller, &old);
    assert_eq!(
        send(&mut controller, &new),
        Reply::Committed(active(&new, 2))
    );
}

#[test]
fn damaged_frames_are_refused_and_the_next_one_is_understood() {
    let (mut controller, old) = in_use();
    let new = named("arm", 6, 2);
    for ask in [Ask::Begin(announcement(&new)), chunk(&new, 0), COMMIT] {
        let good = frame(&Request { number: 5, ask });
        for position in 0..good.len() {
            for bit in 0..8 {
                let mut bytes = good.clone();
                bytes[position] ^= 1 << bit;
                controller.wire.coming.extend(&bytes);
                // If its end was hit.
                controller.wire.coming.push_back(0);
                let answers = controller.answers();
                assert!(!answers.is_empty(), "{position} {bit}");
                for answer in answers {
                    assert_eq!(answer, (0, Reply::Refused(Refusal::Broken)));
                }
            }
        }
    }
    let long = vec![1; 600];
    controller.wire.coming.extend(long.iter().chain(&[0]));
    let answers = controller.answers();
    assert_eq!(answers, [(0, Reply::Refused(Refusal::TooLong))]);
    // A whole frame that says nothing: an unknown request, and one with something behind it.
    for payload in [&[5, 99][..], &[5, 0, 7], &[]] {
        let mut bytes = payload.to_vec();
        bytes.extend(checksum(payload).to_le_bytes());
        let mut encoded = vec![0; 64];
        let length = cobs::encode(&bytes, &mut encoded);
        encoded.truncate(length + 1);
        controller.wire.coming.extend(&encoded);
        let answers = controller.answers();
        assert_eq!(answers, [(0, Reply::Refused(Refusal::NotUnderstood))]);
    }
    unchanged(&mut controller, &old);
}

#[test]
fn frames_of_every_length_come_back() {
    for length in 0..=CHUNK {
        for byte in [0, 1, 0xFF] {
            let bytes = vec![byte; length];
            let ask = Ask::Chunk {
                transfer: u32::MAX,
                offset: u32::MAX,
                bytes: &bytes,
            };
            let request = Request {
                number: u16::MAX,
                ask,
            };
            let frame = frame(&request);
            assert_eq!(frame.iter().position(|&b| b == 0), Some(frame.len() - 1));
            let mut decoder = Decoder::new();
            let (last, first) = frame.split_last().unwrap();
            assert!(first.iter().all(|&b| decoder.feed(b).is_none()));
            let payload = decoder.feed(*last).unwrap().unwrap();
            assert_eq!(postcard::from_bytes::<Request<'_>>(payload), Ok(request));
            assert!(decoder.feed(0).is_none());
        }
    }
    let mut decoder = Decoder::new();
    assert!(decoder.feed(3).is_none());
    assert_eq!(decoder.feed(0), Some(Err(FrameError::Broken)));
}

#[test]
fn a_full_wire_holds_nothing_up() {
    let mut controller = Controller::new("arm", 6);
    controller.wire.full = 50;
    assert!(matches!(controller.ask(Ask::Status), Reply::Status(_)));
    assert_eq!(controller.wire.full, 0);
    assert_eq!(controller.tally, Tally::default());
}
