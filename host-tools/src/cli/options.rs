//! Options that several subcommands share, each defined once.

use std::path::PathBuf;

use clap::Args;

/// `--params`.
#[derive(Debug, Args)]
pub(super) struct Params {
    /// Parameters, as identify or diagnose wrote them
    #[arg(long, value_name = "P.tpb")]
    pub(super) params: PathBuf,
}

/// `--data`.
#[derive(Debug, Args)]
pub(super) struct Data {
    /// Measurements; the instrument's noise is read from the .toml of the same name
    #[arg(long, value_name = "D.csv")]
    pub(super) data: PathBuf,
}

/// `--out`.
#[derive(Debug, Args)]
pub(super) struct Out {
    /// Where the result goes
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,
}

/// `--robot`.
#[derive(Debug, Args)]
pub(super) struct RobotFile {
    /// Nominal robot, TOML or URDF
    #[arg(long, value_name = "R")]
    pub(super) robot: PathBuf,
}

/// `--report`.
#[derive(Debug, Args)]
pub(super) struct Page {
    /// Write the report as a page to FILE too
    #[arg(long, value_name = "FILE.html")]
    pub(super) report: Option<PathBuf>,
}

/// `--port` and `--baud`.
#[derive(Debug, Args)]
pub(super) struct Wire {
    /// Where the controller is: a serial device, or tcp:HOST:PORT
    #[arg(long, value_name = "PORT")]
    pub(super) port: String,
    /// Speed of a serial device
    #[arg(long, default_value_t = 115_200)]
    pub(super) baud: u32,
}
