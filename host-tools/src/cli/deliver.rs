//! What `identify` and `diagnose` leave behind: the parameters, the report, its page.

use std::path::Path;

use truepose_host::deploy::{Origin, blob};
use truepose_host::description::Robot;
use truepose_host::error::Error;
use truepose_host::identify::Calibration;
use truepose_host::output::Output;
use truepose_host::report::Report;
use truepose_host::report::html::html;
use truepose_host::report::text::text;

use super::Outcome;
use super::options::{Out, Page};

/// The outcome of a calibration from `data`.
pub(super) fn deliver(
    robot: &Robot,
    data: &Path,
    calibration: &Calibration,
    report: &Report,
    out: &Out,
    page: &Page,
) -> Result<Outcome, Error> {
    let bytes = blob(
        robot,
        calibration,
        data,
        &Origin {
            rows_identify: report.summary.rows.identify,
            rows_verify: report.summary.rows.verify,
            rms: report.before_and_after_mm().map(|mm| mm * 1e-3),
        },
    )?;
    let mut outputs = vec![Output {
        file: out.out.clone(),
        bytes,
    }];
    if let Some(file) = &page.report {
        outputs.push(Output {
            file: file.clone(),
            bytes: html(report).map_err(Error::Drawing)?.into_bytes(),
        });
    }
    Ok(Outcome {
        text: text(report),
        json: serde_json::to_value(&report.summary).map_err(Error::Json)?,
        outputs,
        answer: true,
    })
}
