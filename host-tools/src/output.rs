//! Files written whole or not at all.
//!
//! A command first [`check`]s that every output can be written, then works, then
//! [`commit`]s all of them together: each goes to a temporary file beside its target, and
//! only when all are on the disk are they renamed. A reader never sees half a file.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Place};

/// A file to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Where.
    pub file: PathBuf,
    /// What.
    pub bytes: Vec<u8>,
}

/// Refuses outputs that could not be written later, are named twice or would replace one of
/// `inputs`. Leaves nothing behind.
pub fn check(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Error> {
    for (i, file) in outputs.iter().enumerate() {
        if is_stream(file) {
            continue;
        }
        if file.is_dir() {
            return Err(Place::file(file).bad("a directory", "a file to write", "name a file"));
        }
        let twin = outputs.iter().take(i).any(|other| same(other, file));
        if twin {
            return Err(Error::Usage(format!(
                "{}: two outputs are to be written there; give each its own file",
                file.display()
            )));
        }
        if inputs.iter().any(|input| same(input, file)) {
            return Err(Error::Usage(format!(
                "{}: is read, so it is not written; name another output",
                file.display()
            )));
        }
        let temporary = temporary(file);
        create(&temporary)
            .and_then(|_| fs::remove_file(&temporary))
            .map_err(|cause| write_error(file, cause))?;
    }
    Ok(())
}

/// Writes all `outputs`. An error while their bytes are written leaves none of them behind
/// and replaces nothing; one while they are renamed, which a full disk can no longer cause,
/// names the file at which it stopped.
pub fn commit(outputs: &[Output]) -> Result<(), Error> {
    let written = outputs.iter().filter(|o| !is_stream(&o.file));
    let pairs: Vec<(PathBuf, &Output)> = written.map(|o| (temporary(&o.file), o)).collect();
    let result = pairs
        .iter()
        .try_for_each(|(temporary, output)| {
            fill(temporary, &output.bytes).map_err(|cause| write_error(&output.file, cause))
        })
        .and_then(|()| {
            pairs.iter().try_for_each(|(temporary, output)| {
                fs::rename(temporary, &output.file)
                    .map_err(|cause| write_error(&output.file, cause))
            })
        });
    if result.is_err() {
        for (temporary, _) in &pairs {
            // Those already renamed are gone; of the others nothing may stay.
            let _ = fs::remove_file(temporary);
        }
        return result;
    }
    for output in outputs.iter().filter(|o| is_stream(&o.file)) {
        fs::OpenOptions::new()
            .write(true)
            .open(&output.file)
            .and_then(|mut stream| stream.write_all(&output.bytes))
            .map_err(|cause| write_error(&output.file, cause))?;
    }
    Ok(())
}

fn write_error(file: &Path, cause: io::Error) -> Error {
    Error::Write {
        file: file.to_path_buf(),
        cause,
    }
}

/// A pipe or a device: written straight, there is nothing to rename over.
fn is_stream(file: &Path) -> bool {
    fs::metadata(file).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Whether both name the same file, if it exists, or the same place for one.
fn same(a: &Path, b: &Path) -> bool {
    match (fs::canonicalize(a), fs::canonicalize(b)) {
        (Ok(a), Ok(b)) => a == b,
        (Err(_), Err(_)) => {
            a.file_name() == b.file_name()
                && fs::canonicalize(folder(a)).ok() == fs::canonicalize(folder(b)).ok()
        }
        _ => false,
    }
}

fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn temporary(file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    folder(file).join(format!(".{name}.{}.tmp", std::process::id()))
}

fn create(file: &Path) -> io::Result<fs::File> {
    fs::OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .open(file)
}

fn fill(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut out = create(file)?;
    out.write_all(bytes)?;
    out.sync_all()
}
