//! What makes a command give up.

use std::fmt;
use std::path::{Path, PathBuf};

use truepose::params::BlobError;

use crate::link::LinkError;

/// Why a command could not do its work. Nothing has been written then.
#[derive(Debug)]
pub enum Error {
    /// A file could not be read at all.
    Read {
        /// As named on the command line.
        file: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A file could not be written.
    Write {
        /// As named on the command line.
        file: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A file was read and what stands in it is wrong.
    Input(Box<BadInput>),
    /// A file of parameters is refused.
    Blob {
        /// As named on the command line.
        file: PathBuf,
        /// Why.
        cause: BlobError,
    },
    /// A controller could not be reached.
    Link {
        /// As named on the command line.
        port: String,
        /// Why.
        cause: LinkError,
    },
    /// A result could not be put into JSON.
    Json(serde_json::Error),
    /// The options contradict each other or the files.
    Usage(String),
    /// A report could not be put into its form.
    Drawing(Box<dyn std::error::Error>),
}

/// Where in a file something is wrong. Every number counts from 1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// As named on the command line.
    pub file: PathBuf,
    /// Line of the file.
    pub line: Option<usize>,
    /// Character in that line.
    pub character: Option<usize>,
    /// Row of a table, its header and comments not counted.
    pub row: Option<usize>,
    /// Name of a column or key, as it stands in the file.
    pub column: Option<String>,
}

/// One thing that is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadInput {
    /// Where.
    pub place: Place,
    /// What stands there.
    pub found: String,
    /// What should stand there.
    pub expected: String,
    /// What to do about it.
    pub advice: String,
}

impl Place {
    /// The file as a whole.
    pub fn file(file: &Path) -> Self {
        Self {
            file: file.to_path_buf(),
            ..Self::default()
        }
    }

    /// A line of the file, counted from 1.
    pub fn line(file: &Path, line: usize) -> Self {
        Self {
            line: Some(line),
            ..Self::file(file)
        }
    }

    /// The same place, narrowed to a column or key.
    pub fn column(mut self, name: &str) -> Self {
        self.column = Some(name.to_owned());
        self
    }

    /// The place of byte `offset` in `text`.
    pub fn offset(file: &Path, text: &str, offset: usize) -> Self {
        let before = text.get(..offset).unwrap_or(text);
        let start = before.rfind('\n').map_or(0, |i| i + 1);
        Self {
            line: Some(before.matches('\n').count() + 1),
            character: Some(before.get(start..).unwrap_or("").chars().count() + 1),
            ..Self::file(file)
        }
    }

    /// An error at this place.
    pub fn bad(
        self,
        found: impl Into<String>,
        expected: impl Into<String>,
        advice: impl Into<String>,
    ) -> Error {
        Error::Input(Box::new(BadInput {
            place: self,
            found: found.into(),
            expected: expected.into(),
            advice: advice.into(),
        }))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
            if let Some(character) = self.character {
                write!(f, ":{character}")?;
            }
        }
        if let Some(row) = self.row {
            write!(f, ": row {row}")?;
        }
        match &self.column {
            Some(column) if self.row.is_some() => write!(f, ", column {column}"),
            Some(column) => write!(f, ": {column}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for BadInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Files may hold anything: a message stays on one line.
        let text = format!(
            "{}: found {}, expected {}; {}",
            self.place, self.found, self.expected, self.advice
        );
        for c in text.chars() {
            if c.is_control() {
                write!(f, "{}", c.escape_default())?;
            } else {
                write!(f, "{c}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read { file, cause } => {
                write!(f, "{}: cannot be read: {cause}", file.display())
            }
            Self::Write { file, cause } => {
                write!(f, "{}: cannot be written: {cause}", file.display())
            }
            Self::Input(bad) => write!(f, "{bad}"),
            Self::Blob { file, cause } => write!(f, "{}: {cause}", file.display()),
            Self::Link { port, cause } => write!(f, "{port}: {cause}"),
            Self::Json(cause) => write!(f, "the result cannot be written as JSON: {cause}"),
            Self::Usage(what) => write!(f, "{what}"),
            Self::Drawing(cause) => write!(f, "the report cannot be drawn: {cause}"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Read { cause, .. } | Self::Write { cause, .. } => Some(cause),
            Self::Blob { cause, .. } => Some(cause),
            Self::Link { cause, .. } => Some(cause),
            Self::Json(cause) => Some(cause),
            Self::Drawing(cause) => Some(cause.as_ref()),
            Self::Input(_) | Self::Usage(_) => None,
        }
    }
}

/// The text of a file, without a byte order mark.
pub(crate) fn read_text(file: &Path) -> Result<String, Error> {
    let read = |cause| Error::Read {
        file: file.to_path_buf(),
        cause,
    };
    if std::fs::metadata(file).map_err(read)?.is_dir() {
        return Err(Place::file(file).bad("a directory", "a file", "name the file in it"));
    }
    let bytes = std::fs::read(file).map_err(read)?;
    let mut text = String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let before = e.as_bytes().get(..good).unwrap_or_default();
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        Place::line(file, line).bad(
            "bytes that are not UTF-8",
            "text in UTF-8",
            "save the file as UTF-8 (a spreadsheet may have written UTF-16 or Latin-1)",
        )
    })?;
    if text.starts_with('\u{feff}') {
        text.remove(0);
    }
    Ok(text)
}
