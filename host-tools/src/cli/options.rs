//! Options that several subcommands share, each defined once.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use truepose_host::error::Error;
use truepose_host::identify::held::Wish;
use truepose_host::link::{Client, Controller, LinkError, Port};

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

/// `--only`, `--hold` and `--free`.
#[derive(Debug, Args)]
pub(super) struct Chosen {
    /// Identify these alone: names of the report's table or their first words, * for any word,
    /// e.g. "joint 3" or "joint * a", or offsets: every joint's zero position. The base
    /// is found with them, and the tool unless base is one of the names
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    only: Vec<String>,
    /// Keep these as drawn, named likewise, e.g. tool or "joint * alpha"
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    hold: Vec<String>,
    /// Identify these whatever --only and --hold say, named likewise
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    free: Vec<String>,
}

impl Chosen {
    /// The same for the library.
    pub(super) fn wish(&self) -> Wish {
        let trimmed = |names: &[String]| names.iter().map(|n| n.trim().to_owned()).collect();
        Wish {
            only: trimmed(&self.only),
            hold: trimmed(&self.hold),
            free: trimmed(&self.free),
        }
    }
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
    /// Seconds until a request without an answer is sent again
    #[arg(long, default_value_t = 1.0, value_name = "S", value_parser = seconds)]
    pub(super) patience: f64,
}

impl Wire {
    /// The link to whoever is there, and who it is.
    pub(super) fn connect(&self) -> Result<(Client, Controller), Error> {
        let patience = Duration::from_secs_f64(self.patience);
        let connected = Port::open(&self.port, self.baud).and_then(|port| {
            let mut client = Client::new(port, patience);
            let controller = client.identify()?;
            Ok((client, controller))
        });
        connected.map_err(|cause| self.error(cause))
    }

    /// What went wrong, with the port's name.
    pub(super) fn error(&self, cause: LinkError) -> Error {
        Error::Link {
            port: self.port.clone(),
            cause,
        }
    }
}

/// A time that a person waits.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if (0.01..=86_400.0).contains(&s) => Ok(s),
        _ => Err("expected seconds, 0.01 to 86400".to_owned()),
    }
}
