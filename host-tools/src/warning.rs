//! Things noticed but survived.

use std::fmt;
use std::path::PathBuf;

/// What was noticed, why it matters, which option or edit helps.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// Columns that no part of the program knows.
    UnknownColumns {
        /// The file.
        file: PathBuf,
        /// Their names.
        columns: Vec<String>,
    },
    /// Rows without joints or without any measured value.
    RowsLeftOut {
        /// The file.
        file: PathBuf,
        /// Row numbers, from 1.
        rows: Vec<usize>,
    },
    /// Rows of which some, but not all, cells of one measured value are blank.
    PartlyMeasured {
        /// The file.
        file: PathBuf,
        /// The columns that belong together, e.g. `x, y, z`.
        columns: String,
        /// Row numbers, from 1.
        rows: Vec<usize>,
    },
    /// Blank cells of a condition.
    ConditionBlank {
        /// The file.
        file: PathBuf,
        /// Name of the column.
        column: String,
        /// Row numbers, from 1.
        rows: Vec<usize>,
    },
    /// No `set` column, or blanks in it: rows were held back.
    HeldBack {
        /// The file.
        file: PathBuf,
        /// How many rows had no set.
        of: usize,
        /// Numbers of the rows held back, from 1.
        rows: Vec<usize>,
    },
    /// The file has no row that is held back from the fit.
    NothingHeldBack {
        /// The file.
        file: PathBuf,
    },
    /// Joint readings beyond the limits of the description.
    OutsideLimits {
        /// The file.
        file: PathBuf,
        /// Joint, from 1.
        joint: usize,
        /// Row numbers, from 1.
        rows: Vec<usize>,
    },
    /// Joint columns in degrees that hold next to nothing.
    LooksLikeRadians {
        /// The file.
        file: PathBuf,
        /// Largest reading of all joints, deg.
        largest_deg: f64,
    },
    /// Both positions and lengths are measured.
    LengthUnused {
        /// The file.
        file: PathBuf,
    },
    /// Pairs, fixed points, planes or bearings beside positions or lengths, without their
    /// noise.
    RelationsUnused {
        /// The file.
        file: PathBuf,
        /// The columns.
        columns: String,
    },
    /// Further targets without a nominal offset.
    NoTargetOffset {
        /// The file that should give it.
        file: PathBuf,
        /// Targets, 2 for `x2`.
        targets: Vec<usize>,
    },
    /// The model depends on a condition that the table does not have.
    ConditionMissing {
        /// The table.
        file: PathBuf,
        /// The column that would give it.
        column: String,
        /// Kind of the effect that depends on it.
        effect: &'static str,
    },
    /// A robot description stands where the sidecar is looked for.
    NotASidecar {
        /// The file.
        file: PathBuf,
    },
}

/// `3, 4, 9` or, of many, the first ones and how many there are.
fn list(rows: &[usize]) -> String {
    const SHOWN: usize = 12;
    let shown: Vec<String> = rows.iter().take(SHOWN).map(usize::to_string).collect();
    let noun = if rows.len() == 1 { "row" } else { "rows" };
    if rows.len() > SHOWN {
        format!("{} {noun} ({}, ...)", rows.len(), shown.join(", "))
    } else {
        format!("{noun} {}", shown.join(", "))
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownColumns { file, columns } => write!(
                f,
                "{}: columns {} are not known and kept out; rename them if they were meant",
                file.display(),
                columns.join(", ")
            ),
            Self::RowsLeftOut { file, rows } => write!(
                f,
                "{}: {} without joints or without any measured value left out",
                file.display(),
                list(rows)
            ),
            Self::PartlyMeasured {
                file,
                columns,
                rows,
            } => write!(
                f,
                "{}: {} with only some of {columns}: taken as not measured; complete or blank \
                 all of them",
                file.display(),
                list(rows)
            ),
            Self::ConditionBlank { file, column, rows } => write!(
                f,
                "{}: {} blank in {column}: effects that depend on it stay out of these rows; fill \
                 them in if it was known",
                file.display(),
                list(rows)
            ),
            Self::HeldBack { file, of, rows } => write!(
                f,
                "{}: {of} rows say no set: {} held back from the fit to report errors on; a \
                 column `set` (identify, verify) decides it otherwise",
                file.display(),
                list(rows)
            ),
            Self::NothingHeldBack { file } => write!(
                f,
                "{}: every row is set to identify: nothing is left to check the result on; set \
                 some rows to verify",
                file.display()
            ),
            Self::OutsideLimits { file, joint, rows } => write!(
                f,
                "{}: {} have q{joint} beyond its limits; check limits and readings",
                file.display(),
                list(rows)
            ),
            Self::LooksLikeRadians { file, largest_deg } => write!(
                f,
                "{}: no joint turns further than {largest_deg:.1} deg: if the readings are in \
                 radians, take _deg off the columns' names",
                file.display()
            ),
            Self::LengthUnused { file } => write!(
                f,
                "{}: positions are measured: `length` is kept out; put it into a file of its \
                 own to use it",
                file.display()
            ),
            Self::RelationsUnused { file, columns } => write!(
                f,
                "{}: {columns} beside positions or lengths kept out; distance_sigma_mm, \
                 contact_sigma_mm or bearing_sigma_deg in the sidecar says that they count",
                file.display()
            ),
            Self::NoTargetOffset { file, targets } => {
                let names: Vec<String> = targets.iter().map(|k| format!("x{k}")).collect();
                write!(
                    f,
                    "{}: no nominal offset of the targets {}: the search starts at the tool \
                     point; targets_mm gives them",
                    file.display(),
                    names.join(", ")
                )
            }
            Self::ConditionMissing {
                file,
                column,
                effect,
            } => write!(
                f,
                "{}: no column {column}, which the model's {effect} depends on: it stays \
                 out; add the column",
                file.display()
            ),
            Self::NotASidecar { file } => write!(
                f,
                "{}: describes a robot, so it is not read for the instrument's noise; rename \
                 the data or the robot file to have both",
                file.display()
            ),
        }
    }
}
