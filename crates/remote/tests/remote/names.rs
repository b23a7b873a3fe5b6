//! Whose names are believed, and whose lock is respected.

use std::os::unix::fs::chown;

use super::*;

#[test]
#[ignore = "it is the other process of another test"]
fn serve_beside() {
    let path = format!("{}-of-nobody", env::var(NAME).unwrap());
    let controller = Controller::start(config("single-erob.toml"), SessionOptions::default()).unwrap();
    let _server = serve(controller.handle(), &path, ServeOptions::default().with_mode(0o666)).unwrap();
    thread::sleep(LONG);
}

#[test]
fn a_controller_of_another_user_is_believed_only_where_not_everybody_may_make_files() {
    // Only root can be another user.
    if !geteuid().is_root() {
        return;
    }
    let served = Served::start("single-erob.toml");
    let _nobody = served.other_user("names::serve_beside");
    let name = format!("{}-of-nobody", served.name());
    let begun = Instant::now();
    let connected = loop {
        match connect(&name) {
            Err(ConnectError::NotServed { .. }) if begun.elapsed() < LONG => {
                thread::sleep(Duration::from_millis(10));
            }
            result => break result,
        }
    };
    assert!(matches!(connected, Err(ConnectError::NotBelieved { user: NOBODY, .. })), "{connected:?}");
    fs::set_permissions(served.folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    assert!(connect(&name).is_ok());
}

#[test]
fn a_lock_file_of_another_user_is_named_with_its_user() {
    if !geteuid().is_root() {
        return;
    }
    let served = Served::start("single-erob.toml");
    let name = format!("{}-2", served.name());
    let lock = PathBuf::from(format!("{name}.lock"));
    fs::write(&lock, "").unwrap();
    chown(&lock, Some(NOBODY), None).unwrap();
    let refused = serve(served.controller.handle(), &name, ServeOptions::default()).err().unwrap();
    assert!(refused.to_string().contains("belongs to user 65534"), "{refused}");
}

#[test]
fn nobody_else_can_open_the_lock_of_a_name() {
    let served = Served::start("single-erob.toml");
    let lock = fs::metadata(format!("{}.lock", served.name())).unwrap();
    assert_eq!(lock.permissions().mode() & 0o777, 0o600);
}
