//! Asks, and asks again where the answer was lost.

use std::process;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use truepose::link::{
    Active, Answer, Ask, Decoder, Frame, Identity, PROTOCOL, Refusal, Reply, Report, Request,
};

use super::{LinkError, Port};

/// How often a request is sent.
const TRIES: u32 = 5;

/// Who is at the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Controller {
    /// The robot whose parameters it takes.
    pub robot: String,
    /// What runs on it.
    pub firmware: String,
    /// Joints that it is built for.
    pub joints: u8,
    /// The blob layout that it reads.
    pub layout: u16,
    /// The largest blob that it can take, bytes.
    pub room: u32,
    /// The parameters in use.
    pub active: Option<Active>,
}

impl From<Identity<'_>> for Controller {
    fn from(identity: Identity<'_>) -> Self {
        // It goes to a terminal.
        let plain = |text: &str| text.chars().filter(|c| !c.is_control()).collect();
        Self {
            robot: plain(identity.robot),
            firmware: plain(identity.firmware),
            joints: identity.joints,
            layout: identity.layout,
            room: identity.room,
            active: identity.active,
        }
    }
}

/// An answer, and how often it was asked for.
pub(super) struct Heard {
    pub(super) said: Said,
    pub(super) tries: u32,
}

/// An answer, on its own.
#[derive(Debug)]
pub(super) enum Said {
    Identity {
        protocol: u8,
        controller: Controller,
    },
    Accepted(u32),
    Committed(Active),
    Status(Report),
    Refused(Refusal),
}

impl From<Reply<'_>> for Said {
    fn from(reply: Reply<'_>) -> Self {
        match reply {
            Reply::Identity(identity) => Self::Identity {
                protocol: identity.protocol,
                controller: identity.into(),
            },
            Reply::Accepted { received } => Self::Accepted(received),
            Reply::Committed(active) => Self::Committed(active),
            Reply::Status(report) => Self::Status(report),
            Reply::Refused(refusal) => Self::Refused(refusal),
        }
    }
}

/// A link to a controller.
#[derive(Debug)]
pub struct Client {
    port: Port,
    patience: Duration,
    decoder: Decoder,
    number: u16,
}

impl Client {
    /// A link over `port`; a request is sent again where no answer comes within `patience`.
    pub fn new(port: Port, patience: Duration) -> Self {
        Self {
            port,
            patience,
            decoder: Decoder::new(),
            // Answers to whoever was here before are not for us.
            number: (made_up() >> 16) as u16,
        }
    }

    /// The number of the next request, not 0.
    pub(super) fn next(&mut self) -> u16 {
        self.number = self.number % u16::MAX + 1;
        self.number
    }

    /// Who is there?
    pub fn identify(&mut self) -> Result<Controller, LinkError> {
        match self.ask(Ask::Identify)?.said {
            Said::Identity { protocol, .. } if protocol != PROTOCOL => {
                Err(LinkError::Protocol { found: protocol })
            }
            Said::Identity { controller, .. } => Ok(controller),
            Said::Refused(refusal) => Err(LinkError::Refused(refusal)),
            _ => Err(LinkError::Unexpected {
                request: "identify",
            }),
        }
    }

    /// How is the loop?
    pub fn status(&mut self) -> Result<Report, LinkError> {
        match self.ask(Ask::Status)?.said {
            Said::Status(report) => Ok(report),
            Said::Refused(refusal) => Err(LinkError::Refused(refusal)),
            _ => Err(LinkError::Unexpected { request: "status" }),
        }
    }

    /// The answer to `ask`, which may be sent several times.
    pub(super) fn ask(&mut self, ask: Ask<'_>) -> Result<Heard, LinkError> {
        let mut garbled = None;
        // The same at every try: the answer to an earlier one may be late, not lost.
        let number = self.next();
        for tries in 1..=TRIES {
            match self.once(number, ask, self.patience)? {
                // The other end could not read it.
                Some((0, said)) => garbled = Some(said),
                Some((_, said)) => return Ok(Heard { said, tries }),
                None => {}
            }
        }
        match garbled {
            Some(Said::Refused(refusal)) => Err(LinkError::Refused(refusal)),
            _ => Err(LinkError::Silent {
                tries: TRIES,
                patience: self.patience,
            }),
        }
    }

    /// Sends `ask` once and waits for its answer, or for the news, under number 0, that it
    /// came damaged.
    pub(super) fn once(
        &mut self,
        number: u16,
        ask: Ask<'_>,
        patience: Duration,
    ) -> Result<Option<(u16, Said)>, LinkError> {
        let frame = Frame::of(&Request { number, ask }).ok_or(LinkError::Unexpected {
            request: "a request longer than a frame",
        })?;
        // Whatever stood on the line before ends here.
        self.port.write_all(&[0])?;
        self.port.write_all(frame.bytes())?;
        let began = Instant::now();
        let mut bytes = [0; 256];
        while began.elapsed() < patience {
            let count = self.port.read(&mut bytes)?;
            let mut answer = None;
            for &byte in bytes.iter().take(count) {
                let Some(Ok(payload)) = self.decoder.feed(byte) else {
                    continue;
                };
                // Late answers to earlier requests are no news.
                if let Ok(Answer { number: n, reply }) = postcard::from_bytes(payload)
                    && (n == number || n == 0)
                {
                    answer = Some((n, Said::from(reply)));
                }
            }
            if answer.is_some() {
                return Ok(answer);
            }
        }
        Ok(None)
    }
}

/// A number that the last session, or the last transfer, did not have.
pub(super) fn made_up() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let nanos = now.map_or(0, |now| now.as_nanos());
    (nanos as u32).wrapping_mul(0x9E37_79B9) ^ (nanos >> 32) as u32 ^ process::id()
}
