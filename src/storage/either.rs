//! One of two kinds of memory: a controller with both has one copy of what keeps blobs.

use super::Memory;

/// A memory of either kind, or what went wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Either<A, B> {
    /// Of one kind.
    First(A),
    /// Of the other.
    Second(B),
}

/// Asks whichever it is.
macro_rules! ask {
    ($self:ident, $memory:ident => $answer:expr) => {
        match $self {
            Self::First($memory) => $answer,
            Self::Second($memory) => $answer,
        }
    };
    (try $self:ident, $memory:ident => $answer:expr) => {
        match $self {
            Self::First($memory) => $answer.map_err(Either::First),
            Self::Second($memory) => $answer.map_err(Either::Second),
        }
    };
}

impl<A: Memory, B: Memory> Memory for Either<A, B> {
    type Error = Either<A::Error, B::Error>;

    fn write_once(&self) -> bool {
        ask!(self, memory => memory.write_once())
    }

    fn size(&self) -> usize {
        ask!(self, memory => memory.size())
    }

    fn word(&self) -> usize {
        ask!(self, memory => memory.word())
    }

    fn page(&self) -> usize {
        ask!(self, memory => memory.page())
    }

    fn block(&self) -> usize {
        ask!(self, memory => memory.block())
    }

    fn ready(&mut self) -> Result<bool, Self::Error> {
        ask!(try self, memory => memory.ready())
    }

    fn wait(&mut self) -> Result<(), Self::Error> {
        ask!(try self, memory => memory.wait())
    }

    #[inline(never)]
    fn read(&mut self, address: usize, bytes: &mut [u8]) -> Result<(), Self::Error> {
        ask!(try self, memory => memory.read(address, bytes))
    }

    #[inline(never)]
    fn write(&mut self, address: usize, bytes: &[u8]) -> Result<(), Self::Error> {
        ask!(try self, memory => memory.write(address, bytes))
    }

    fn erase(&mut self, address: usize) -> Result<(), Self::Error> {
        ask!(try self, memory => memory.erase(address))
    }
}
