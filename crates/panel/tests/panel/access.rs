//! Who may open the panel, and how much anybody may ask of it.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use serde_json::json;
use takt::SessionOptions;
use takt_panel::{Listening, PAGES_AT_MOST, PanelError, PanelOptions, PanelToken};

use crate::open_page::*;

#[test]
fn every_file_of_the_page_is_there_and_may_load_nothing_from_elsewhere() {
    let shown = Shown::start("first.toml");
    let files = [
        "/",
        "/panel.css",
        "/page.js",
        "/connection.js",
        "/texts.js",
        "/chinese.js",
        "/frame.js",
        "/units.js",
        "/axes.js",
        "/motion.js",
        "/plots.js",
        "/monitor.js",
    ];
    for path in files {
        let (status, head, text) = get(shown.address(), path, "");
        assert_eq!(status, 200, "{path}");
        assert!(head.contains("content-security-policy: default-src 'none'; script-src 'self'"), "{head}");
        assert!(head.contains("frame-ancestors 'none'") && head.contains("nosniff"), "{head}");
        let text = text.as_str().unwrap();
        assert!(!text.contains("http://") && !text.contains("https://"), "{path} names another server");
    }
    let (_, _, page) = get(shown.address(), "/", "");
    let page = page.as_str().unwrap();
    assert!(!page.contains("style=") && !page.contains("onclick") && !page.contains("<script>"), "{page}");
    assert_eq!(get(shown.address(), "/other", "").0, 404);
}

#[test]
fn another_site_is_refused_by_its_host_its_origin_and_its_missing_header() {
    let shown = Shown::start("first.toml");
    let address = shown.address();
    let rebound =
        format!("GET / HTTP/1.1\r\nHost: evil.example:{}\r\nConnection: close\r\n\r\n", address.port());
    let (status, _, value) = exchange(address, &rebound);
    assert_eq!((status, &value["error"]), (403, &json!("site")));
    for origin in ["http://evil.example", "http://localhost:1", "null"] {
        let stop = r#"{"category":2}"#;
        let (status, _, value) = post(address, "/api/stop", &format!("Origin: {origin}\r\n"), stop);
        assert_eq!((status, &value["error"]), (403, &json!("site")), "{origin}");
    }
    let (status, _, value) = get(address, "/api/states", "");
    assert_eq!((status, &value["error"]), (403, &json!("header")), "a foreign page can ask without a header");
    let plain = format!(
        "POST /api/stop HTTP/1.1\r\nHost: {address}\r\nX-Takt-Panel: 1\r\nContent-Type: text/plain\r\nContent-Length: 14\r\nConnection: close\r\n\r\n{{\"category\":2}}"
    );
    assert_eq!(exchange(address, &plain).0, 415);
    let own = format!("Origin: http://{address}\r\n");
    assert_eq!(post(address, "/api/stop", &own, r#"{"category":2}"#).0, 200);
}

#[test]
fn a_panel_that_others_can_reach_needs_a_token_and_takes_nothing_without_it() {
    let open =
        PanelOptions { address: "0.0.0.0:0".parse().unwrap(), token: PanelToken::Open, origins: vec![] };
    assert!(matches!(Listening::begin(&open), Err(PanelError::NoToken { .. })));
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let same = PanelOptions { address: taken.local_addr().unwrap(), ..options(None) };
    let error = Listening::begin(&same).err().unwrap().to_string();
    assert!(error.contains("another program does"), "{error}");

    let token = "0123456789abcdef0123";
    let everywhere = PanelOptions { token: PanelToken::Given(token.to_owned()), ..open };
    let shown = Shown::with(config("first.toml"), SessionOptions::default(), &everywhere);
    let address = SocketAddr::from(([127, 0, 0, 1], shown.address().port()));
    assert_eq!(get(address, "/", "").0, 200, "the page itself is no secret");
    for wrong in ["", "Authorization: Bearer 0123456789abcdef\r\n", "Authorization: Basic x\r\n"] {
        let (status, head, value) = post(address, "/api/stop", wrong, r#"{"category":2}"#);
        assert_eq!((status, &value["error"]), (401, &json!("token")), "{wrong}");
        assert!(head.contains("www-authenticate: bearer"), "{head}");
        assert_eq!(get(address, "/api/states", &format!("X-Takt-Panel: 1\r\n{wrong}")).0, 401);
    }
    let right = format!("Authorization: Bearer {token}\r\n");
    assert_eq!(post(address, "/api/stop", &right, r#"{"category":2}"#).0, 200);
}

#[test]
fn a_page_that_asks_too_often_is_told_so_and_may_still_stop() {
    let shown = Shown::start("first.toml");
    let mut page = shown.commander();
    let refused =
        (0..200).map(|_| page.command(&json!({ "do": "clear_faults" }))).find(|(status, _)| *status != 200);
    let (status, value) = refused.expect("200 commands at once were taken");
    assert_eq!((status, &value["error"]), (429, &json!("too_often")));
    assert!(english(&value["words"]).contains("10 a second"), "{value}");
    for _ in 0..100 {
        assert_eq!(post(shown.address(), "/api/stop", "", r#"{"category":2}"#).0, 200);
    }
}

#[test]
fn what_is_too_long_too_much_or_garbage_is_refused_and_the_panel_goes_on() {
    let shown = Shown::start("first.toml");
    let address = shown.address();
    assert_eq!(post(address, "/api/stop", "", &" ".repeat(100_000)).0, 413);
    for garbage in [
        "",
        "{",
        "[]",
        "{\"category\":9}",
        "{\"category\":-1}",
        "{\"category\":1,\"x\":1}",
        "\u{0}\u{1}",
        "null",
    ] {
        assert_eq!(post(address, "/api/stop", "", garbage).0, 400, "{garbage:?}");
    }
    let deep = "[".repeat(8000);
    assert_eq!(post(address, "/api/command", "", &deep).0, 400);
    assert_eq!(post(address, "/api/command", "", r#"{"number":1,"command":{"do":"enable"}}"#).0, 410);
    assert_eq!(
        post(address, "/api/command", "X-Takt-Page: ffff\r\n", r#"{"number":1,"command":{"do":"enable"}}"#).0,
        410
    );
    for raw in [
        "\r\n\r\n",
        "GET\r\n\r\n",
        "\u{16}\u{3}\u{1}",
        "POST /api/stop HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999\r\n\r\n",
    ] {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(raw.as_bytes()).unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        let _ = stream.read_to_end(&mut vec![]);
    }
    let long = format!("GET / HTTP/1.1\r\nHost: {address}\r\nX-Long: {}\r\n\r\n", "x".repeat(100_000));
    assert!(matches!(exchange(address, &long).0, 400..=499));
    assert_eq!(get(address, "/", "").0, 200);
}

#[test]
fn pages_that_read_nothing_hold_up_nobody_and_their_number_is_bounded() {
    let shown = Shown::start("arm6-erob.toml");
    let address = shown.address();
    let request = format!("GET /api/states HTTP/1.1\r\nHost: {address}\r\nX-Takt-Panel: 1\r\n\r\n");
    let mut silent = vec![];
    for _ in 1..PAGES_AT_MOST {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        // The first bytes of the answer: the page is open.
        stream.read_exact(&mut [0; 15]).unwrap();
        silent.push(stream);
    }
    let mut page = shown.commander();
    let Err((status, _)) = Page::open(address) else { panic!("one page too many is open") };
    assert_eq!(status, 503);
    page.does(&json!({ "do": "move", "axis": 0, "to": 0.1, "relative": false, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until("0.1", |state| state.axes[0].position_set == 0.1);
    assert_eq!(page.newest_state()["pages"].as_u64(), Some(PAGES_AT_MOST as u64));
    // They confirm nothing, and are closed.
    shown.until("room", |_| Page::open(address).is_ok());
}

const TOKEN: &str = "0123456789abcdef0123";

fn authorized() -> String {
    format!("Authorization: Bearer {TOKEN}\r\n")
}

#[test]
fn connections_without_the_token_keep_no_stop_out_and_are_closed_after_a_second() {
    let shown = Shown::with(config("first.toml"), SessionOptions::default(), &options(Some(TOKEN)));
    let address = shown.address();
    // Half of them say nothing, and half of them begin a request without an end.
    let mut crowd: Vec<TcpStream> = (0..400)
        .map(|number| {
            let mut stream = TcpStream::connect(address).unwrap();
            if number % 2 == 0 {
                let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: x");
            }
            stream
        })
        .collect();
    let begun = Instant::now();
    assert_eq!(post(address, "/api/stop", &authorized(), r#"{"category":2}"#).0, 200);
    let mut last = crowd.pop().unwrap();
    last.set_read_timeout(Some(LONG)).unwrap();
    // It is closed, by whatever word.
    assert_eq!(last.read(&mut [0]).unwrap_or(0), 0);
    assert!(begun.elapsed() < Duration::from_secs(9), "{:?}", begun.elapsed());
}

#[test]
fn a_wrong_token_is_answered_late_and_the_right_one_at_once_meanwhile() {
    let shown = Shown::with(config("first.toml"), SessionOptions::default(), &options(Some(TOKEN)));
    let address = shown.address();
    let begun = Instant::now();
    let guess = post(address, "/api/stop", "Authorization: Bearer 0123456789abcdef0124\r\n", "{}");
    assert_eq!((guess.0, &guess.2["error"]), (401, &json!("token")));
    assert!(begun.elapsed() > Duration::from_millis(400), "{:?}", begun.elapsed());
    assert_eq!(post(address, "/api/stop", &authorized(), r#"{"category":2}"#).0, 200);
}

#[test]
fn a_new_token_is_part_of_the_address_that_is_shown_and_opens_the_panel() {
    let new = PanelOptions { token: PanelToken::New, ..options(None) };
    let shown = Shown::with(config("first.toml"), SessionOptions::default(), &new);
    let address = shown.address();
    let token = shown.panel.url().strip_prefix(&format!("http://{address}/#token=")).unwrap();
    assert_eq!(token.len(), 32);
    assert_eq!(get(address, "/api/machine", "X-Takt-Panel: 1\r\n").0, 401);
    let headers = format!("X-Takt-Panel: 1\r\nAuthorization: Bearer {token}\r\n");
    assert_eq!(get(address, "/api/machine", &headers).0, 200);
}
