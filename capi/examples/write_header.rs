//! Writes `include/truepose.h` from the source.

use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let settings = cbindgen::Config::from_file(folder.join("cbindgen.toml"))?;
    cbindgen::generate_with_config(folder, settings)?
        .write_to_file(folder.join("include/truepose.h"));
    Ok(())
}
