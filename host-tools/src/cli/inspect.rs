//! `truepose inspect`: what a blob says, in words.

use std::path::PathBuf;

use clap::Args;
use truepose_host::error::Error;
use truepose_host::inspect::inspect;
use truepose_host::parameters;

use super::{Files, Outcome};

/// Say in words what a file of parameters holds
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Parameters, as identify or diagnose wrote them
    #[arg(value_name = "P.tpb")]
    params: PathBuf,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    Files {
        inputs: vec![&options.params],
        outputs: Vec::new(),
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let bytes = parameters::read(&options.params)?;
    let blob = parameters::decode(&options.params, &bytes)?;
    let inspection = inspect(&blob, bytes.len());
    Ok(Outcome {
        text: inspection.to_string(),
        json: serde_json::to_value(&inspection).map_err(Error::Json)?,
        outputs: Vec::new(),
        answer: true,
    })
}
