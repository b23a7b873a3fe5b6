//! Connections that say nothing, by the hundred.

use super::*;

/// More than there are places of any kind.
const CROWD: usize = 200;

fn path(served: &Served, end: &str) -> PathBuf {
    PathBuf::from(format!("{}.{end}", served.name()))
}

/// Connects, however long the others before it wait.
fn connected(path: &Path) -> Packets {
    loop {
        if let Ok(connection) = Packets::connect(path) {
            return connection;
        }
    }
}

fn crowd(path: &Path) -> Vec<Packets> {
    (0..CROWD).map(|_| connected(path)).collect()
}

/// Asks for a stop by a connection of its own, and returns its answer.
fn stop(served: &Served) -> Option<u64> {
    let connection = Packets::connect_as(&path(served, "command"), Role::Stops).unwrap();
    connection
        .send(&StopRequest { target: RequestTarget::All, category: StopCategory::Two }.packet())
        .ok()?;
    connection.await_packet(LONG);
    connection.receive_word()
}

#[test]
fn neither_observers_nor_silent_connections_nor_others_for_stops_keep_a_stop_out() {
    let served = Served::start("single-erob.toml");
    let _observers = crowd(&path(&served, "observe"));
    assert_eq!(stop(&served), Some(1), "beside observers");
    let _silent = crowd(&path(&served, "command"));
    assert_eq!(stop(&served), Some(1), "beside silent connections");
    let stops = crowd(&path(&served, "command"));
    for connection in &stops {
        // It may be closed by now: there are more of them than places.
        let _ = connection.send(&Role::Stops.packet());
    }
    assert_eq!(stop(&served), Some(1), "beside connections that may stop and do not");
}

#[test]
fn a_connection_that_says_nothing_is_closed_after_a_second_and_one_for_stops_stays() {
    let served = Served::start("single-erob.toml");
    let command = path(&served, "command");
    let (silent, stops) =
        (Packets::connect(&command).unwrap(), Packets::connect_as(&command, Role::Stops).unwrap());
    silent.wait_at_most(LONG).unwrap();
    let begun = Instant::now();
    assert_eq!(silent.receive(&mut [0; PACKET_BYTES], true), Received::Closed);
    let waited = begun.elapsed();
    assert!(waited > Duration::from_millis(900) && waited < LONG, "{waited:?}");
    assert!(!stops.is_closed());
}

#[test]
fn observers_of_another_user_leave_places_to_others() {
    // Only root can be another user.
    if !geteuid().is_root() {
        return;
    }
    let served = Served::with("single-erob.toml", ServeOptions::default().with_mode(0o644));
    let _nobody = served.other_user("crowds::observe_by_the_hundred");
    let begun = Instant::now();
    while fs::metadata(served.folder.path().join("crowded")).is_err() {
        assert!(begun.elapsed() < LONG);
        thread::sleep(Duration::from_millis(10));
    }
    let client = served.connect();
    assert!(client.next_cycle(LONG).is_ok());
}

#[test]
#[ignore = "it is the other process of another test"]
fn observe_by_the_hundred() {
    let name = env::var(NAME).unwrap();
    let _crowd = crowd(Path::new(&format!("{name}.observe")));
    // The one who waits for it reads no more than that it is there.
    fs::write(Path::new(&name).with_file_name("crowded"), "").unwrap();
    thread::sleep(LONG);
}
