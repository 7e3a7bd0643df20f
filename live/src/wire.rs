//! Bytes to and from a vehicle: UDP, serial port, and the clock by which a program waits.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::str::FromStr;
use std::time::{Duration, Instant};

use serial2::SerialPort;

/// A connection that carries bytes, with a clock. Tests have one whose time is simulated.
///
/// It does not fail: bytes are lost while it is down, and come again when it is back.
pub trait Wire {
    /// Sends bytes, or loses them.
    fn send(&mut self, bytes: &[u8]);

    /// Waits for bytes, for at most `wait`, and returns their number: 0 if none came.
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> usize;

    /// Time since the connection was opened. Never decreases.
    fn now(&self) -> Duration;
}

/// Where a vehicle is, as ground stations write it.
///
/// | text | meaning |
/// |---|---|
/// | `udp:14550` | listen on this port, on all interfaces |
/// | `udp:192.168.4.1:14555` | send to this host and port |
/// | `serial:/dev/ttyACM0:57600` | serial port and baud rate |
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Address {
    /// Listen for datagrams on this port.
    UdpListen(u16),
    /// Send datagrams to `host:port`.
    UdpTo(String),
    /// Serial port.
    Serial {
        /// Device.
        path: String,
        /// Baud rate (1/s).
        baud: u32,
    },
}

/// A text that is no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "a connection is udp:PORT (listen), udp:HOST:PORT or serial:DEVICE:BAUD, such as udp:14550"
)]
pub struct AddressError;

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let (kind, rest) = text.split_once(':').ok_or(AddressError)?;
        let port = |text: &str| text.parse().ok().filter(|port: &u16| *port > 0);
        match (kind, rest.rsplit_once(':')) {
            ("udp", None) => port(rest).map(Self::UdpListen),
            ("udp", Some((host, number))) if !host.is_empty() => {
                port(number).map(|_| Self::UdpTo(rest.to_owned()))
            }
            ("serial", Some((path, baud))) if !path.is_empty() => {
                let baud = baud.parse().ok().filter(|baud: &u32| *baud > 0);
                baud.map(|baud| Self::Serial {
                    path: path.to_owned(),
                    baud,
                })
            }
            _ => None,
        }
        .ok_or(AddressError)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UdpListen(port) => write!(f, "udp:{port}"),
            Self::UdpTo(to) => write!(f, "udp:{to}"),
            Self::Serial { path, baud } => write!(f, "serial:{path}:{baud}"),
        }
    }
}

impl Address {
    /// Opens the connection.
    ///
    /// # Errors
    /// The port is in use, the host is not known, or the device cannot be opened.
    pub fn open(&self) -> io::Result<Box<dyn Wire>> {
        Ok(match self {
            Self::UdpListen(port) => Box::new(Udp::listen("0.0.0.0", *port)?),
            Self::UdpTo(to) => Box::new(Udp::to(to)?),
            Self::Serial { path, baud } => Box::new(Serial::open(path, *baud)?),
        })
    }
}

/// After this time without a datagram another sender may take the place of the first one: a vehicle that restarts sends from
/// another port.
const PEER_SILENT: Duration = Duration::from_secs(2);

/// Datagrams to one peer: the host that was named, or the one that is heard.
pub struct Udp {
    socket: UdpSocket,
    peer: Option<SocketAddr>,
    is_named: bool,
    heard: Duration,
    start: Instant,
}

impl Udp {
    /// Waits for a vehicle at an address and port; port 0 lets the system choose.
    ///
    /// # Errors
    /// The port is in use.
    pub fn listen(host: &str, port: u16) -> io::Result<Self> {
        Ok(Self {
            socket: UdpSocket::bind((host, port))?,
            peer: None,
            is_named: false,
            heard: Duration::ZERO,
            start: Instant::now(),
        })
    }

    /// Sends to a `host:port`.
    ///
    /// # Errors
    /// The host is not known.
    pub fn to(host_and_port: &str) -> io::Result<Self> {
        let peer = host_and_port.to_socket_addrs()?.next();
        let peer = peer.ok_or_else(|| io::Error::new(ErrorKind::NotFound, "unknown host"))?;
        let own = if peer.is_ipv4() { "0.0.0.0" } else { "::" };
        Ok(Self {
            peer: Some(peer),
            is_named: true,
            ..Self::listen(own, 0)?
        })
    }

    /// The port of this side.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn port(&self) -> io::Result<u16> {
        Ok(self.socket.local_addr()?.port())
    }

    /// Whether a datagram comes from the vehicle.
    fn is_ours(&mut self, from: SocketAddr) -> bool {
        let now = self.now();
        if self.is_named {
            // Behind a router only the port is what was named.
            return self.peer.is_some_and(|peer| peer.port() == from.port());
        }
        if self.peer != Some(from) && self.peer.is_some() && now - self.heard < PEER_SILENT {
            return false;
        }
        (self.peer, self.heard) = (Some(from), now);
        true
    }
}

impl Wire for Udp {
    fn send(&mut self, bytes: &[u8]) {
        if let Some(peer) = self.peer {
            // A peer that cannot be reached may come back: the datagram is lost.
            let _ = self.socket.send_to(bytes, peer);
        }
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let until = self.now() + wait;
        loop {
            let left = until.saturating_sub(self.now());
            if left.is_zero() {
                return 0;
            }
            // Zero would mean without limit.
            let timeout = left.max(Duration::from_micros(100));
            let _ = self.socket.set_read_timeout(Some(timeout));
            match self.socket.recv_from(buffer) {
                Ok((count, from)) if self.is_ours(from) => return count,
                Ok(_) => {}
                Err(error) if is_nothing(&error) => return 0,
                // Such as the answer of a host where nobody listens yet.
                Err(_) => std::thread::sleep(left.min(PAUSE)),
            }
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

/// Time before a connection that is down is tried again.
const PAUSE: Duration = Duration::from_millis(20);

/// A serial port. It is opened again after it was gone, as that of an autopilot on USB that restarts.
struct Serial {
    path: String,
    baud: u32,
    port: Option<SerialPort>,
    start: Instant,
}

impl Serial {
    fn open(path: &str, baud: u32) -> io::Result<Self> {
        Ok(Self {
            port: Some(SerialPort::open(path, baud)?),
            path: path.to_owned(),
            baud,
            start: Instant::now(),
        })
    }

    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let port = match &mut self.port {
            Some(port) => port,
            none => none.insert(SerialPort::open(&self.path, self.baud)?),
        };
        port.set_read_timeout(wait.max(Duration::from_millis(1)))?;
        port.read(buffer)
    }
}

impl Wire for Serial {
    fn send(&mut self, bytes: &[u8]) {
        if let Some(port) = &mut self.port
            && port.write_all(bytes).is_err()
        {
            self.port = None;
        }
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        match self.read(buffer, wait) {
            Ok(count) => count,
            Err(error) if is_nothing(&error) => 0,
            Err(_) => {
                self.port = None;
                std::thread::sleep(wait.min(PAUSE));
                0
            }
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses() {
        let of = |text: &str| text.parse::<Address>();
        assert_eq!(of("udp:14550"), Ok(Address::UdpListen(14550)));
        assert_eq!(of("udp:host:1"), Ok(Address::UdpTo("host:1".to_owned())));
        let (path, baud) = ("/dev/ttyACM0".to_owned(), 57600);
        assert_eq!(
            of("serial:/dev/ttyACM0:57600"),
            Ok(Address::Serial { path, baud })
        );
        for text in ["udp:14550", "udp:host:1", "serial:COM3:57600"] {
            assert_eq!(of(text).unwrap().to_string(), text);
        }
        for text in [
            "",
            "udp",
            "udp:",
            "udp:0",
            "udp:x",
            "udp::1",
            "udp:h:70000",
            "serial:/dev/x",
            "serial::5",
            "tcp:1",
            "serial:x:0",
        ] {
            assert_eq!(of(text), Err(AddressError), "{text:?}");
        }
    }
}
