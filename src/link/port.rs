//! The port of a real interface, of any kind.

use arrayvec::ArrayVec;
use takt_rt::linux::{Attachment, SlcanPort, SocketCanPort, TransparentPort};
use takt_rt::{BusHealth, BusPort, Frame, MAX_BUSES, Nanoseconds, Outgoing, ReceiveBatch};

use takt_sim::LivePort;

/// The port of a real interface.
#[derive(Debug)]
pub enum LinkPort {
    /// A CAN interface of this machine.
    SocketCan(Box<SocketCanPort>),
    /// An SLCAN adapter on a serial line.
    Slcan(Box<SlcanPort>),
    /// A transparent converter between RS-485 and CAN FD on a serial line.
    Converter(Box<TransparentPort>),
}

impl LinkPort {
    /// Returns what binds it to its interface anew; `None` for an adapter on a serial line.
    pub fn attachment(&self) -> Option<Attachment> {
        match self {
            Self::SocketCan(port) => port.attachment().ok(),
            Self::Slcan(_) | Self::Converter(_) => None,
        }
    }
}

impl LinkPort {
    /// The port of its kind.
    fn kind(&mut self) -> &mut dyn BusPort {
        match self {
            Self::SocketCan(port) => port.as_mut(),
            Self::Slcan(port) => port.as_mut(),
            Self::Converter(port) => port.as_mut(),
        }
    }

    /// This port for simulated drives.
    pub fn into_live(self) -> Box<dyn LivePort> {
        match self {
            Self::SocketCan(port) => port,
            Self::Slcan(port) => port,
            Self::Converter(port) => port,
        }
    }
}

impl BusPort for LinkPort {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.kind().send(now_ns, frames)
    }

    fn send_together(now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, Self>]) {
        let mut sockets = ArrayVec::<_, MAX_BUSES>::new();
        for Outgoing { port, frames, taken } in outgoing.iter_mut().take(MAX_BUSES) {
            match port {
                Self::SocketCan(port) => sockets.push(Outgoing { port: port.as_mut(), frames, taken }),
                port => **taken = port.send(now_ns, frames),
            }
        }
        if !sockets.is_empty() {
            SocketCanPort::send_together(now_ns, &mut sockets);
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.kind().receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        self.kind().unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.kind().health()
    }
}
