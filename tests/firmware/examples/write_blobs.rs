//! Writes the blobs that the programs hold.

use std::error::Error;
use std::fs;
use std::path::Path;

use truepose_firmware::parameters::{ROOM, effects, encode};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut buffer = [0; ROOM];
    fs::write(folder.join("rigid.tpb"), encode(&[], &mut buffer)?)?;
    fs::write(
        folder.join("with_effects.tpb"),
        encode(&effects(), &mut buffer)?,
    )?;
    Ok(())
}
