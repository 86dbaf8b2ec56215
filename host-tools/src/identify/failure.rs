//! Why an identification could not be done.

use std::path::Path;

use crate::error::{Error, Place};

/// Why an identification could not be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// No row was held back to report errors on.
    NothingToVerify,
    /// Fewer equations than a fit needs: found, needed.
    TooFewEquations(usize, usize),
    /// A wish to hold or free parameters that cannot be fulfilled, in a sentence.
    Wish(String),
    /// No size of a prior could be cross-validated.
    NoSize,
    /// Every parameter is held.
    NothingFree,
    /// Every row to fit has the same joint values.
    OnePose,
    /// A placement of the instrument, by its number in the file, with too few rows to fit.
    ThinSession(i64, usize),
    /// The alignment of base and tool did not converge.
    NotAligned,
    /// The fit did not converge: rms of what it had come to, m or rad over the noise.
    NotConverged(f64),
}

/// Rows that a placement of the instrument needs: three points fix a frame.
pub const ROWS_A_SESSION: usize = 3;

impl Failure {
    /// As an error of the measurements in `file`.
    pub fn explain(&self, file: &Path) -> Error {
        let place = Place::file(file);
        match self {
            Self::NothingToVerify => place.bad(
                "no verify rows",
                "some rows that no fit sees, to report errors on",
                "set some rows to verify, or leave out the column `set` and have them chosen",
            ),
            Self::TooFewEquations(found, needed) => place.bad(
                format!("{found} equations to fit"),
                format!("at least {needed}, one an unknown"),
                "measure more poses",
            ),
            Self::Wish(sentence) => Error::Usage(sentence.clone()),
            Self::NoSize => place.bad(
                "rows of which no part predicts the others with any prior",
                "enough rows to cross-validate the size of a prior",
                "measure more poses, or give it with --prior-mm and --prior-deg",
            ),
            Self::NothingFree => Error::Usage(
                "--only and --hold leave nothing to identify: expected at least one parameter \
                 that is free"
                    .to_owned(),
            ),
            Self::OnePose => place.bad(
                "the same joint values in every row to fit",
                "poses all over the workspace",
                "move the arm between measurements",
            ),
            Self::ThinSession(session, rows) => place.column("session").bad(
                format!("{rows} identify rows in session {session}"),
                format!("at least {ROWS_A_SESSION}: three points fix a placement"),
                "measure more poses from there, or leave the session out",
            ),
            Self::NotAligned => place.bad(
                "measurements that the drawn robot cannot be brought near",
                "base and tool that align it",
                "check joint order, units, signs and the robot description",
            ),
            Self::NotConverged(rms) => place.bad(
                format!("a fit that does not settle (residual {rms:.3} times the noise)"),
                "one that does",
                "check the robot description and [tool], or measure more poses",
            ),
        }
    }
}
