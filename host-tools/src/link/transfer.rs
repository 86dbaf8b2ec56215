//! A blob on its way to a controller.

use std::thread::sleep;
use std::time::{Duration, Instant};

use truepose::link::{Active, Announcement, Ask, CHUNK, Refusal};
use truepose::params::{Blob, MAGIC, checksum};

use super::LinkError;
use super::client::{Client, Controller, Said, made_up};

/// How long a controller may take to keep a blob: a large flash block may take seconds to
/// erase.
const KEEPING: Duration = Duration::from_secs(30);
/// How long it may take to put it to use before the answer is "not yet".
const USING: Duration = Duration::from_secs(3);

/// How a transfer ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// These parameters were in use already: nothing was sent.
    AlreadyInUse(Active),
    /// Kept, and in use.
    InUse(Active),
    /// Kept, and to be put to use by the controller when it sees fit, at the next start at the
    /// latest.
    Kept(Active),
    /// Refused: those in use before still are.
    Refused(Refusal),
}

/// Brings `blob`, which is `bytes`, to the controller. `progress`: hears the share that is
/// done.
pub fn send(
    client: &mut Client,
    controller: &Controller,
    blob: &Blob<'_>,
    bytes: &[u8],
    progress: &mut dyn FnMut(f64),
) -> Result<Sent, LinkError> {
    let too_large = Sent::Refused(Refusal::Size {
        room: controller.room,
    });
    let (Ok(length), Ok(joints)) = (u32::try_from(bytes.len()), u8::try_from(blob.joints())) else {
        return Ok(too_large);
    };
    let crc = checksum(bytes);
    let same = |active: &Active| active.length == length && active.crc == crc;
    if let Some(active) = controller.active.filter(same) {
        return Ok(Sent::AlreadyInUse(active));
    }
    let transfer = made_up();
    let begin = Ask::Begin(Announcement {
        transfer,
        length,
        crc,
        layout: layout(bytes),
        joints,
        robot: &blob.robot,
    });
    match client.ask(begin)?.said {
        Said::Accepted(0) => {}
        Said::Refused(refusal) => return Ok(Sent::Refused(refusal)),
        _ => return Err(LinkError::Unexpected { request: "begin" }),
    }
    let mut offset = 0;
    for piece in bytes.chunks(CHUNK) {
        let chunk = Ask::Chunk {
            transfer,
            offset,
            bytes: piece,
        };
        offset += u32::try_from(piece.len()).unwrap_or(u32::MAX);
        let heard = client.ask(chunk)?;
        match heard.said {
            Said::Accepted(received) if received == offset => {}
            // Asked again after a lost answer: the piece had come.
            Said::Refused(Refusal::OutOfOrder { expected })
                if heard.tries > 1 && expected == offset => {}
            Said::Refused(refusal) => return Ok(Sent::Refused(refusal)),
            _ => return Err(LinkError::Unexpected { request: "chunk" }),
        }
        progress(f64::from(offset) / f64::from(length));
    }
    match commit(client, transfer)? {
        Commit::Kept(active) if in_use(client, same)?.is_some() => Ok(Sent::InUse(active)),
        Commit::Kept(active) => Ok(Sent::Kept(active)),
        Commit::Refused(refusal) => Ok(Sent::Refused(refusal)),
        // What is in use says whether it was done.
        Commit::Lost => in_use(client, same)?
            .map(Sent::InUse)
            .ok_or(LinkError::Unsure),
    }
}

/// What became of a commit.
enum Commit {
    Kept(Active),
    Refused(Refusal),
    /// It was done or not: the answer is lost.
    Lost,
}

/// Asks for what came to be kept.
fn commit(client: &mut Client, transfer: u32) -> Result<Commit, LinkError> {
    let began = Instant::now();
    let mut patience = KEEPING;
    let number = client.next();
    loop {
        match client.once(number, Ask::Commit { transfer }, patience)? {
            Some((_, Said::Committed(active))) => return Ok(Commit::Kept(active)),
            // It came damaged: it has not begun.
            Some((0, Said::Refused(_))) if began.elapsed() < KEEPING => {}
            // An earlier one had come: it is at work, or done.
            Some((_, Said::Refused(Refusal::Busy))) if began.elapsed() < KEEPING => {
                sleep(Duration::from_millis(100));
            }
            Some((_, Said::Refused(Refusal::NotBegun))) | None => return Ok(Commit::Lost),
            Some((_, Said::Refused(refusal))) => return Ok(Commit::Refused(refusal)),
            Some(_) => return Err(LinkError::Unexpected { request: "commit" }),
        }
        patience = KEEPING.saturating_sub(began.elapsed());
    }
}

/// The parameters that `same` knows, if they come into use soon.
fn in_use(
    client: &mut Client,
    same: impl Fn(&Active) -> bool,
) -> Result<Option<Active>, LinkError> {
    let began = Instant::now();
    loop {
        let active = client.identify()?.active.filter(&same);
        if active.is_some() || began.elapsed() > USING {
            return Ok(active);
        }
        sleep(Duration::from_millis(50));
    }
}

/// The layout that a blob is written in, from its header.
fn layout(blob: &[u8]) -> u16 {
    let field = blob.get(MAGIC.len()..).and_then(<[u8]>::first_chunk);
    field.map_or(0, |&field| u16::from_le_bytes(field))
}
