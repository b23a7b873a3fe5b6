//! Connecting to a controller that another process serves.

use std::io;

use crate::client::Client;
use crate::connection::Connection;
use crate::error::ConnectError;
use crate::memory::Memory;
use crate::shown::{Shown, Unreadable};
use crate::socket::{CONNECTED_WITHIN, Names, Packets};

/// Connects to a controller that another process serves by a name: `takt run CONFIG --serve NAME`, or [`serve`](crate::serve()). A name with a
/// slash is the beginning of the paths of its sockets.
///
/// The connection stays with that process. When it ends, every call of the client says so, and a new one is found by connecting again.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use std::time::Duration;
///
/// let arm = takt_remote::connect("arm")?;
/// let motion = arm.move_to(&[0.3, -0.2, 0.1, -0.5, 0.0, 0.4])?;
/// arm.wait(motion, Duration::from_secs(10))?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`ConnectError`].
pub fn connect(name: &str) -> Result<Client, ConnectError> {
    let names = Names::new(name)?;
    let failed = |error| ConnectError::Failed { path: names.observe().to_owned(), error };
    let observer = Packets::connect(names.observe()).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
            ConnectError::NotServed { name: name.to_owned() }
        }
        io::ErrorKind::PermissionDenied => ConnectError::NotAllowed { path: names.observe().to_owned() },
        io::ErrorKind::WouldBlock => ConnectError::NoReply { after: CONNECTED_WITHIN },
        _ => failed(error),
    })?;
    let user = observer.peer().user;
    if !names.is_believed(user) {
        return Err(ConnectError::NotBelieved { name: name.to_owned(), user });
    }
    let foreign = || ConnectError::Foreign { name: name.to_owned() };
    let (_, file) = observer
        .receive_memory()
        .map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => foreign(),
            io::ErrorKind::WouldBlock => ConnectError::NoReply { after: CONNECTED_WITHIN },
            _ => failed(error),
        })?
        .ok_or(ConnectError::TooManyObservers)?;
    let memory = Memory::of_other(file).map_err(|_| foreign())?;
    let (shown, description) = Shown::of(memory).map_err(|unreadable| match unreadable {
        Unreadable::Foreign => foreign(),
        Unreadable::Version(theirs) => ConnectError::Version { theirs },
    })?;
    Ok(Client::new(Connection::new(names, shown, description, observer)))
}
