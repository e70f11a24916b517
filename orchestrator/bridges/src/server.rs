//! Listens, lets one client in at a time and says a word to the others.

use std::io::{self, Read, Write};
use std::net::{IpAddr, Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use thiserror::Error;

use crate::element::Element;
use crate::link::{Link, LinkError, SHORTEST};
use crate::protocol::Sizes;
use crate::scale::Scale;
use crate::session::{Served, Session, SessionError, Step, set_up};

/// How often the door is looked at.
const LOOK: Duration = Duration::from_millis(10);

/// Who may come and how long they may be silent.
#[derive(Debug, Clone)]
pub struct Admission {
    /// Addresses that are let in; none for whoever reaches the port.
    pub peers: Vec<IpAddr>,
    /// How long a client may be silent.
    pub silence: Duration,
    /// How long a client may take for its sizes.
    pub set_up: Duration,
}

impl Default for Admission {
    fn default() -> Self {
        Self {
            peers: Vec::new(),
            silence: Duration::from_secs(60),
            set_up: Duration::from_secs(10),
        }
    }
}

/// Why a server cannot begin.
#[derive(Debug, Error)]
pub enum BindError {
    /// The port is taken, or the address is not this machine's.
    #[error("{address} cannot be listened at ({protocol}): {source}")]
    Address {
        /// Where it should listen.
        address: SocketAddr,
        /// TCP or UDP.
        protocol: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// Others can reach the address, but nobody says who may.
    #[error(
        "{0} can be reached from other machines, and the protocol has no passwords; name the \
         allowed clients, such as --allow 192.0.2.7, or listen at 127.0.0.1"
    )]
    Open(SocketAddr),
}

/// What happens at the door.
#[derive(Debug)]
pub enum Event<'a> {
    /// A client is served.
    Connected {
        /// Who.
        peer: SocketAddr,
        /// `TCP` or `UDP`.
        protocol: &'static str,
        /// What it said.
        sizes: Sizes,
    },
    /// A connection came to nothing.
    TurnedAway {
        /// Who.
        peer: SocketAddr,
        /// Why.
        reason: &'a str,
    },
    /// A step was committed.
    Step(Step<'a>),
}

/// How serving ended, with what came of the client.
#[derive(Debug)]
pub struct Ending {
    /// The client, where one came.
    pub peer: Option<SocketAddr>,
    /// What came of it.
    pub served: Served,
    /// Why it ended; none where the client said its end.
    pub error: Option<SessionError>,
}

/// A port that is listened at, over TCP and UDP.
pub struct Server {
    tcp: TcpListener,
    udp: UdpSocket,
    address: SocketAddr,
    admission: Admission,
}

/// Somebody at the door.
enum Guest {
    Tcp(TcpStream, SocketAddr),
    Udp(SocketAddr, Vec<u8>),
}

impl Server {
    /// Listens at `address`; port 0 takes any that is free.
    ///
    /// # Errors
    /// A port that is taken, or an address that others reach with nobody named who may.
    pub fn bind(address: SocketAddr, admission: Admission) -> Result<Self, BindError> {
        if !address.ip().is_loopback() && admission.peers.is_empty() {
            return Err(BindError::Open(address));
        }
        let fault = |protocol| {
            move |source| BindError::Address {
                address,
                protocol,
                source,
            }
        };
        let tcp = TcpListener::bind(address).map_err(fault("TCP"))?;
        let own = tcp.local_addr().map_err(fault("TCP"))?;
        let udp = UdpSocket::bind(own).map_err(fault("UDP"))?;
        tcp.set_nonblocking(true).map_err(fault("TCP"))?;
        Ok(Self {
            tcp,
            udp,
            address: own,
            admission,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves `element` to the first client that says its sizes, until that ends; `tell` hears of
    /// everything. Ends soon after `interrupt` becomes true.
    pub fn serve(
        &self,
        element: &mut dyn Element,
        scale: &Scale,
        interrupt: Option<&'static AtomicBool>,
        tell: &mut dyn FnMut(Event<'_>),
    ) -> Ending {
        let door = Door::default();
        let (sender, guests) = channel();
        std::thread::scope(|scope| {
            let at = &door;
            scope.spawn(move || self.watch_door(at, &sender));
            let room = Room {
                server: self,
                guests,
                door: at,
                interrupt,
            };
            let ending = room.host(element, scale, tell);
            door.is_over.store(true, Ordering::Release);
            ending
        })
    }

    /// Lets guests wait in a row until one is served, and turns them away from then on.
    fn watch_door(&self, door: &Door, guests: &Sender<Arrival>) {
        let mut datagram = [0; 1 << 16];
        while !door.is_over.load(Ordering::Acquire) {
            while let Ok((stream, peer)) = self.tcp.accept() {
                let reason = match self.is_allowed(peer) {
                    false => Some(NOT_ALLOWED),
                    true if door.is_serving.load(Ordering::Acquire) => Some(BUSY),
                    true => None,
                };
                let arrival = match reason {
                    Some(reason) => {
                        refuse(stream, reason);
                        Arrival::TurnedAway(peer, reason)
                    }
                    None => Arrival::Guest(Guest::Tcp(stream, peer)),
                };
                if guests.send(arrival).is_err() {
                    return;
                }
            }
            // While someone is heard over UDP, that conversation reads the socket.
            let is_free = !door.is_serving.load(Ordering::Acquire);
            if is_free && !door.hears_datagrams.load(Ordering::Acquire) {
                let _ = self.udp.set_nonblocking(true);
                if let Ok((count, peer)) = self.udp.recv_from(&mut datagram) {
                    let arrival = if !self.is_allowed(peer) {
                        let _ = self.udp.send_to(NOT_ALLOWED.as_bytes(), peer);
                        Arrival::TurnedAway(peer, NOT_ALLOWED)
                    } else {
                        door.hears_datagrams.store(true, Ordering::Release);
                        Arrival::Guest(Guest::Udp(peer, datagram[..count].to_vec()))
                    };
                    if guests.send(arrival).is_err() {
                        return;
                    }
                }
            }
            std::thread::sleep(LOOK);
        }
    }

    fn is_allowed(&self, peer: SocketAddr) -> bool {
        let peers = &self.admission.peers;
        let ip = peer.ip().to_canonical();
        peers.is_empty() || ip.is_loopback() || peers.iter().any(|own| own.to_canonical() == ip)
    }

    /// A connection to a guest that was let in.
    fn link(&self, guest: Guest) -> Result<(Link, SocketAddr, &'static str), LinkError> {
        let limit = self.admission.set_up;
        match guest {
            Guest::Tcp(stream, peer) => Ok((Link::tcp(stream, limit)?, peer, "TCP")),
            Guest::Udp(peer, first) => {
                let socket = self.udp.try_clone()?;
                let first = if first.len() < SHORTEST {
                    // OpenSees says a word first and waits for one.
                    socket.send_to(&first, peer)?;
                    &[][..]
                } else {
                    &first[..]
                };
                Ok((Link::udp(socket, peer, first, BUSY, limit)?, peer, "UDP"))
            }
        }
    }
}

/// The word to a second client.
const BUSY: &str =
    "shakebench serves another client at this port, one at a time; try again when it is done\n";
/// The word to a stranger.
const NOT_ALLOWED: &str =
    "shakebench does not let this address in; its owner names those that may come with --allow\n";

/// What the door's thread and the room's tell each other.
#[derive(Default)]
struct Door {
    is_over: AtomicBool,
    is_serving: AtomicBool,
    hears_datagrams: AtomicBool,
}

enum Arrival {
    Guest(Guest),
    TurnedAway(SocketAddr, &'static str),
}

/// Says a word and closes, without waiting for anybody.
fn refuse(mut stream: TcpStream, word: &str) {
    let _ = stream.set_nonblocking(true);
    let _ = stream.write_all(word.as_bytes());
    let _ = stream.shutdown(Shutdown::Write);
    // What is unread when a connection is closed resets it, and the word is lost.
    let mut rest = [0; 4096];
    while matches!(stream.read(&mut rest), Ok(count) if count > 0) {}
}

/// Where one guest is served.
struct Room<'a> {
    server: &'a Server,
    guests: Receiver<Arrival>,
    door: &'a Door,
    interrupt: Option<&'static AtomicBool>,
}

impl Room<'_> {
    fn host(
        &self,
        element: &mut dyn Element,
        scale: &Scale,
        tell: &mut dyn FnMut(Event<'_>),
    ) -> Ending {
        loop {
            if self.interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) {
                return Ending {
                    peer: None,
                    served: Served::default(),
                    error: Some(LinkError::Interrupted.into()),
                };
            }
            let guest = match self.guests.recv_timeout(10 * LOOK) {
                Ok(Arrival::Guest(guest)) => guest,
                Ok(Arrival::TurnedAway(peer, reason)) => {
                    let reason = reason.trim_end();
                    tell(Event::TurnedAway { peer, reason });
                    continue;
                }
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => {
                    let gone = io::Error::other("the door's thread ended");
                    return Ending {
                        peer: None,
                        served: Served::default(),
                        error: Some(LinkError::Failed(gone).into()),
                    };
                }
            };
            let peer = match &guest {
                Guest::Tcp(_, peer) | Guest::Udp(peer, _) => *peer,
            };
            match self.let_in(guest, element.degrees_of_freedom()) {
                Ok((link, protocol, sizes)) => {
                    tell(Event::Connected {
                        peer,
                        protocol,
                        sizes,
                    });
                    return self.serve(link, (peer, sizes), element, scale, tell);
                }
                Err(error) => {
                    let reason = error.to_string();
                    tell(Event::TurnedAway {
                        peer,
                        reason: &reason,
                    });
                    self.door.hears_datagrams.store(false, Ordering::Release);
                }
            }
        }
    }

    /// Turns away who waited in the row, and tells of those that the door has turned away.
    fn turn_away(&self, tell: &mut dyn FnMut(Event<'_>)) {
        while let Ok(arrival) = self.guests.try_recv() {
            let (peer, reason) = match arrival {
                Arrival::TurnedAway(peer, reason) => (peer, reason),
                Arrival::Guest(Guest::Tcp(stream, peer)) => {
                    refuse(stream, BUSY);
                    (peer, BUSY)
                }
                Arrival::Guest(Guest::Udp(peer, _)) => {
                    let _ = self.server.udp.send_to(BUSY.as_bytes(), peer);
                    (peer, BUSY)
                }
            };
            let reason = reason.trim_end();
            tell(Event::TurnedAway { peer, reason });
        }
    }

    fn let_in(
        &self,
        guest: Guest,
        degrees_of_freedom: usize,
    ) -> Result<(Link, &'static str, Sizes), SessionError> {
        let (mut link, _, protocol) = self.server.link(guest)?;
        link.heed(self.interrupt);
        match set_up(&mut link, degrees_of_freedom) {
            Ok(sizes) => {
                self.door.is_serving.store(true, Ordering::Release);
                link.limit(self.server.admission.silence)?;
                Ok((link, protocol, sizes))
            }
            Err(error) => {
                // Whoever reads text learns why; nobody has to.
                let _ = link.send(format!("shakebench: {error}\n").as_bytes());
                Err(error)
            }
        }
    }

    fn serve(
        &self,
        link: Link,
        (peer, sizes): (SocketAddr, Sizes),
        element: &mut dyn Element,
        scale: &Scale,
        tell: &mut dyn FnMut(Event<'_>),
    ) -> Ending {
        let mut served = Served::default();
        self.turn_away(tell);
        let outcome = {
            let mut note = |step: Step<'_>| {
                self.turn_away(tell);
                tell(Event::Step(step));
            };
            Session {
                link,
                sizes,
                scale,
                element,
                tell: &mut note,
                is_asked: false,
            }
            .run(&mut served)
        };
        self.turn_away(tell);
        Ending {
            peer: Some(peer),
            served,
            error: outcome.err(),
        }
    }
}
