//! The little of HTTP/1.1 (RFC 9112) that a scraper needs, without I/O.

/// The longest head of a request.
pub const HEAD_BYTES: usize = 8192;

/// What a client wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// The metrics, with their text, or (`HEAD`) without.
    Metrics {
        /// True if the text is wanted.
        has_body: bool,
    },
    /// Something that there is not, or that is not allowed.
    Refused(Refusal),
}

/// Why there is no answer to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It is not HTTP.
    BadRequest,
    /// There is `/metrics` alone.
    NotFound,
    /// Nothing can be changed here.
    MethodNotAllowed,
    /// Its head is longer than [`HEAD_BYTES`].
    TooLong,
}

impl Refusal {
    const fn status(self) -> &'static str {
        match self {
            Self::BadRequest => "400 Bad Request",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::TooLong => "431 Request Header Fields Too Large",
        }
    }
}

/// What the client wants that has sent these bytes; `None` while its head is not complete.
pub fn wish(received: &[u8]) -> Option<Wish> {
    let is_complete = ends(received, b"\r\n\r\n") || ends(received, b"\n\n");
    if !is_complete {
        return (received.len() >= HEAD_BYTES).then_some(Wish::Refused(Refusal::TooLong));
    }
    let line = received.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let line = str::from_utf8(line).unwrap_or_default().trim_end_matches('\r');
    let mut words = line.split(' ');
    let wish = match (words.next(), words.next(), words.next(), words.next()) {
        (Some(method), Some(target), Some(version), None)
            if version.starts_with("HTTP/1.") && target.starts_with('/') =>
        {
            let path = target.split('?').next().unwrap_or_default();
            match (method, path) {
                ("GET", "/metrics") => Wish::Metrics { has_body: true },
                ("HEAD", "/metrics") => Wish::Metrics { has_body: false },
                (_, "/metrics") => Wish::Refused(Refusal::MethodNotAllowed),
                _ => Wish::Refused(Refusal::NotFound),
            }
        }
        _ => Wish::Refused(Refusal::BadRequest),
    };
    Some(wish)
}

fn ends(received: &[u8], end: &[u8]) -> bool {
    received.windows(end.len()).any(|window| window == end)
}

/// The bytes of the answer. The connection is closed behind it.
pub fn answer(wish: Wish, metrics: impl FnOnce() -> String) -> Vec<u8> {
    let (status, kind, body, has_body) = match wish {
        Wish::Metrics { has_body } => {
            ("200 OK", "text/plain; version=0.0.4; charset=utf-8", metrics(), has_body)
        }
        Wish::Refused(refusal) => {
            let body = format!("{}: the metrics are at /metrics\n", refusal.status());
            (refusal.status(), "text/plain; charset=utf-8", body, true)
        }
    };
    let allow = if status.starts_with("405") { "Allow: GET, HEAD\r\n" } else { "" };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n{allow}Connection: close\r\n\r\n",
        body.len()
    );
    let mut bytes = head.into_bytes();
    if has_body {
        bytes.extend(body.into_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GET: &[u8] = b"GET /metrics HTTP/1.1\r\nHost: localhost:9464\r\nAccept: text/plain\r\n\r\n";

    #[test]
    fn a_head_is_answered_when_it_is_complete() {
        for end in 0..GET.len() {
            assert_eq!(wish(&GET[..end]), None, "{end}");
        }
        assert_eq!(wish(GET), Some(Wish::Metrics { has_body: true }));
        assert_eq!(wish(b"HEAD /metrics?x=1 HTTP/1.0\n\n"), Some(Wish::Metrics { has_body: false }));
    }

    #[test]
    fn what_is_not_there_or_not_allowed_is_refused() {
        let refused = |head: &[u8]| match wish(head) {
            Some(Wish::Refused(refusal)) => refusal,
            other => panic!("{other:?}"),
        };
        assert_eq!(refused(b"GET / HTTP/1.1\r\n\r\n"), Refusal::NotFound);
        assert_eq!(refused(b"POST /metrics HTTP/1.1\r\n\r\n"), Refusal::MethodNotAllowed);
        assert_eq!(refused(b"GET /metrics HTTP/2\r\n\r\n"), Refusal::BadRequest);
        assert_eq!(refused(b"\x16\x03\x01\n\n"), Refusal::BadRequest);
        assert_eq!(refused(&[b'a'; HEAD_BYTES]), Refusal::TooLong);
    }

    #[test]
    fn an_answer_says_how_long_it_is_and_a_head_alone_has_no_body() {
        let text = |wish| String::from_utf8(answer(wish, || "takt 1\n".to_owned())).unwrap();
        let whole = text(Wish::Metrics { has_body: true });
        assert!(whole.starts_with("HTTP/1.1 200 OK\r\n") && whole.ends_with("\r\n\r\ntakt 1\n"), "{whole}");
        assert!(whole.contains("Content-Length: 7\r\n") && whole.contains("version=0.0.4"), "{whole}");
        assert!(text(Wish::Metrics { has_body: false }).ends_with("\r\n\r\n"));
        assert!(text(Wish::Refused(Refusal::MethodNotAllowed)).contains("Allow: GET, HEAD\r\n"));
    }

    proptest! {
        #[test]
        fn whatever_is_sent_is_waited_for_or_answered(bytes in prop::collection::vec(any::<u8>(), 0..9000)) {
            match wish(&bytes) {
                None => prop_assert!(bytes.len() < HEAD_BYTES),
                Some(wish) => prop_assert!(answer(wish, String::new).starts_with(b"HTTP/1.1 ")),
            }
        }
    }
}
