//! Writes the blobs that the programs hold.

use std::error::Error;
use std::fs;
use std::path::Path;

use truepose_firmware::arm::{built, offset};
use truepose_firmware::parameters::{ROOM, effects, encode};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut buffer = [0; ROOM];
    for (name, arm, effects) in [
        ("rigid.tpb", built(), &[][..]),
        ("spherical.tpb", offset(0.0), &[]),
        ("with_effects.tpb", built(), &effects()),
    ] {
        fs::write(folder.join(name), encode(&arm, effects, &mut buffer)?)?;
    }
    Ok(())
}
