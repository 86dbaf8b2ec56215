//! A serial device or a socket.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use serial2::SerialPort;

use super::LinkError;

/// A call to read waits at most this long.
const READ: Duration = Duration::from_millis(20);
/// A call to write, and the attempt to connect, wait at most this long.
const WRITE: Duration = Duration::from_secs(5);

/// A stream of bytes to and from a controller.
#[derive(Debug)]
pub enum Port {
    /// A UART, or USB that looks like one.
    Serial(SerialPort),
    /// TCP.
    Socket(TcpStream),
}

impl Port {
    /// Opens `name`: `tcp:HOST:PORT`, or a serial device at `baud`, 8 data bits, no parity, one
    /// stop bit, no flow control.
    pub fn open(name: &str, baud: u32) -> Result<Self, LinkError> {
        match name.strip_prefix("tcp:") {
            Some(address) => Self::connect(address),
            None => Self::serial(name, baud),
        }
        .map_err(LinkError::Open)
    }

    fn connect(address: &str) -> io::Result<Self> {
        let mut last = io::Error::new(ErrorKind::NotFound, "no such host");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, WRITE) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    stream.set_read_timeout(Some(READ))?;
                    stream.set_write_timeout(Some(WRITE))?;
                    return Ok(Self::Socket(stream));
                }
                Err(cause) => last = cause,
            }
        }
        Err(last)
    }

    fn serial(name: &str, baud: u32) -> io::Result<Self> {
        let mut port = SerialPort::open(name, baud)?;
        port.set_read_timeout(READ)?;
        port.set_write_timeout(WRITE)?;
        port.discard_input_buffer()?;
        Ok(Self::Serial(port))
    }

    /// The bytes that have come, none after a short wait.
    pub(super) fn read(&mut self, bytes: &mut [u8]) -> Result<usize, LinkError> {
        let result = match self {
            Self::Serial(port) => port.read(bytes),
            Self::Socket(stream) => stream.read(bytes).and_then(|count| match count {
                0 => Err(io::Error::new(
                    ErrorKind::UnexpectedEof,
                    "the other end has gone",
                )),
                count => Ok(count),
            }),
        };
        match result {
            Ok(count) => Ok(count),
            Err(cause) => match cause.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => Ok(0),
                _ => Err(LinkError::Stream(cause)),
            },
        }
    }

    pub(super) fn write_all(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        match self {
            Self::Serial(port) => port.write_all(bytes),
            Self::Socket(stream) => stream.write_all(bytes),
        }
        .map_err(LinkError::Stream)
    }
}
