//! `truepose send`: parameters to a running controller.

use clap::Args;
use serde_json::{Value, json};
use truepose::link::Active;
use truepose_host::error::Error;
use truepose_host::link::{Controller, Sent, send};
use truepose_host::parameters;

use super::options::{Params, Wire};
use super::progress::Progress;
use super::{Files, Outcome};

/// Bring parameters to a running controller
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    params: Params,
    #[command(flatten)]
    wire: Wire,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    Files {
        inputs: vec![&options.params.params],
        outputs: Vec::new(),
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let params = &options.params.params;
    let bytes = parameters::read(params)?;
    let blob = parameters::decode(params, &bytes)?;
    let (mut client, controller) = options.wire.connect()?;
    let mut progress = Progress::new("sending");
    let sent = send(&mut client, &controller, &blob, &bytes, &mut |share| {
        progress.tell(share);
    })
    .map_err(|cause| options.wire.error(cause))?;
    drop(progress);

    let (file, robot) = (params.display(), &controller.robot);
    let size = bytes.len();
    let text = match sent {
        Sent::AlreadyInUse(_) => format!("{robot}: {file} is in use already, nothing was sent\n"),
        Sent::InUse(active) => format!(
            "{robot}: {file} is in use, {size} bytes, update {}\n",
            active.sequence
        ),
        Sent::Kept(active) => format!(
            "{robot}: {file} is kept, {size} bytes, update {}; the controller has not put it to \
             use yet\n",
            active.sequence
        ),
        Sent::Refused(refusal) => format!(
            "{robot}: {file} was refused: {refusal}\n{}",
            whom(&controller, &blob.robot, blob.joints())
        ),
    };
    Ok(Outcome {
        text,
        json: as_json(&sent, &controller, size),
        outputs: Vec::new(),
        answer: !matches!(sent, Sent::Refused(_)),
    })
}

/// Both sides of a refusal.
fn whom(controller: &Controller, robot: &str, joints: usize) -> String {
    format!(
        "  the file is for {robot}, {joints} joints; the controller is of {}, {} joints, \
         at most {} bytes; the parameters in use stay\n",
        controller.robot, controller.joints, controller.room
    )
}

fn as_json(sent: &Sent, controller: &Controller, size: usize) -> Value {
    let (result, active, refusal) = match sent {
        Sent::AlreadyInUse(active) => ("already-in-use", Some(active), None),
        Sent::InUse(active) => ("in-use", Some(active), None),
        Sent::Kept(active) => ("kept", Some(active), None),
        Sent::Refused(refusal) => ("refused", None, Some(refusal.to_string())),
    };
    json!({
        "controller": controller_json(controller),
        "bytes": size,
        "result": result,
        "update": active.map(|active| active.sequence),
        "checksum": active.map(checksum_text),
        "refusal": refusal,
    })
}

/// A checksum as people compare it.
pub(super) fn checksum_text(active: &Active) -> String {
    format!("{:08x}", active.crc)
}

/// Who answered.
pub(super) fn controller_json(controller: &Controller) -> Value {
    json!({
        "robot": controller.robot,
        "firmware": controller.firmware,
        "joints": controller.joints,
        "layout": controller.layout,
        "room": controller.room,
    })
}
