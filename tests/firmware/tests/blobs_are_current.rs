//! The blobs that the programs hold are those of the arm that the source describes.

use truepose_firmware::parameters::{RIGID, ROOM, WITH_EFFECTS, effects, encode};

const HOW: &str = "cargo run -p truepose-firmware --example write_blobs";

#[test]
fn the_rigid_blob_is_current() {
    let mut buffer = [0; ROOM];
    let now = encode(&[], &mut buffer).unwrap();
    assert!(now == RIGID, "rigid.tpb is not current: {HOW}");
}

#[test]
fn the_blob_with_effects_is_current() {
    let mut buffer = [0; ROOM];
    let now = encode(&effects(), &mut buffer).unwrap();
    assert!(
        now == WITH_EFFECTS,
        "with_effects.tpb is not current: {HOW}"
    );
}
