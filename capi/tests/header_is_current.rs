//! The header in the tree is what cbindgen makes of the source.

use std::error::Error;
use std::fs;
use std::path::Path;

#[test]
fn the_header_is_current() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let settings = cbindgen::Config::from_file(folder.join("cbindgen.toml"))?;
    let mut written = Vec::new();
    cbindgen::generate_with_config(folder, settings)?.write(&mut written);
    let kept = fs::read(folder.join("include/truepose.h"))?;
    assert!(
        kept == written,
        "include/truepose.h is not current: cargo run -p truepose-capi --example write_header"
    );
    Ok(())
}
