//! The blobs that the programs hold are those of the arm that the source describes.

use truepose::params::Blob;
use truepose_firmware::arm::{built, offset};
use truepose_firmware::methods::TAUGHT;
use truepose_firmware::parameters::{RIGID, ROOM, SPHERICAL, WITH_EFFECTS, effects, encode};

const HOW: &str = "cargo run -p truepose-firmware --example write_blobs";

#[test]
fn the_rigid_blob_is_current() {
    let mut buffer = [0; ROOM];
    let now = encode(&built(), &[], &mut buffer).unwrap();
    assert!(now == RIGID, "rigid.tpb is not current: {HOW}");
}

#[test]
fn the_blob_of_the_spherical_wrist_is_current() {
    let mut buffer = [0; ROOM];
    let now = encode(&offset(0.0), &[], &mut buffer).unwrap();
    assert!(now == SPHERICAL, "spherical.tpb is not current: {HOW}");
}

#[test]
fn the_blob_with_effects_is_current() {
    let mut buffer = [0; ROOM];
    let now = encode(&built(), &effects(), &mut buffer).unwrap();
    assert!(
        now == WITH_EFFECTS,
        "with_effects.tpb is not current: {HOW}"
    );
}

#[test]
fn the_blob_with_tables_is_the_one_with_effects_besides() {
    let mut taught = Blob::decode(TAUGHT).unwrap();
    let plain = Blob::decode(WITH_EFFECTS).unwrap();
    assert!(taught.taught.polynomial.is_some() && taught.taught.cmac.is_some());
    taught.taught = plain.taught.clone();
    taught.settings.method = plain.settings.method;
    assert!(taught == plain, "taught.tpb: see src/methods.rs");
}
