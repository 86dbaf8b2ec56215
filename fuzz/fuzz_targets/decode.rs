//! Any bytes as a blob, with its header put right: refused, or sound and the same again.

#![no_main]

use libfuzzer_sys::fuzz_target;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::params::{Blob, HEADER, LAYOUT, MAGIC, checksum, decode};

fuzz_target!(|body: &[u8]| {
    let joints = body.first().copied().unwrap_or(6);
    let mut bytes = MAGIC.to_vec();
    bytes.extend(LAYOUT.to_le_bytes());
    bytes.extend([joints, 0]);
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(checksum(body).to_le_bytes());
    bytes.extend(body);
    let Ok(blob) = Blob::decode(&bytes) else {
        return;
    };
    let mut buffer = vec![0; 2 * bytes.len() + HEADER];
    let again = blob.encode(&mut buffer).expect("what was read can be written");
    assert_eq!(Blob::decode(again).as_ref(), Ok(&blob));
    if let Ok(model) = decode::<f32, 6>(&bytes) {
        let request = Request::joints([0.1; 6]);
        let outcome = Compensator::new(&model).correct(&request, &mut Budget::unlimited());
        assert!(outcome.q.iter().all(|q| q.is_finite()));
    }
});
