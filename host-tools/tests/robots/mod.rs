//! The measured robots that the project is developed on; no part of it.

use std::path::{Path, PathBuf};

/// Their folder; `None`, with a message, where there is none, which is an error where CI runs.
pub(crate) fn measured() -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TRUEPOSE_DATA").map_or(here, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "no {}", folder.display());
    eprintln!("skipped: no {} (TRUEPOSE_DATA)", folder.display());
    None
}
