//! Who may ask the panel: the address that a request names, the page that it comes from, and its token.
//!
//! A page of another site can make a browser send requests here. Three things keep it out: the `Host` header must name this server, so that
//! a foreign name that was pointed at this address (DNS rebinding) is refused; the `Origin` header must be that of a page from here; and
//! a command needs a header that a browser lets no foreign page set without asking first, which is refused.

use std::net::{IpAddr, SocketAddr};

use axum::http::HeaderMap;
use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use takt::words;
use takt::words::Words;

/// The shortest token, in characters.
pub const TOKEN_AT_LEAST: usize = 16;

/// Who may ask.
#[derive(Clone, Debug)]
pub struct Access {
    token: Option<String>,
    origins: Vec<String>,
}

/// Why a request is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Denied {
    /// The `Host` header names another server.
    Host {
        /// What it names.
        host: String,
    },
    /// The request comes from a page of another site.
    Origin {
        /// The site.
        origin: String,
    },
    /// The token is missing.
    NoToken,
    /// It is another token.
    WrongToken,
}

impl Denied {
    /// The sentence.
    pub fn words(&self) -> Words {
        match self {
            Self::Host { host } => words!(
                "{host} is not an address of this panel; open it by its address or by localhost, or start takt with --panel-origin",
                host = format!("{host:?}")
            ),
            Self::Origin { origin } => {
                words!(
                    "the request comes from a page of another site, {origin}",
                    origin = format!("{origin:?}")
                )
            }
            Self::NoToken => "the panel needs its token".into(),
            Self::WrongToken => "this is not the token of the panel".into(),
        }
    }
}

/// Why a token, or an origin, cannot be one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccessError {
    /// Too short to be a secret.
    #[error(
        "the token has {given} characters, and needs at least {TOKEN_AT_LEAST}; `openssl rand -hex 16` makes one"
    )]
    ShortToken {
        /// Its length.
        given: usize,
    },
    /// A header cannot carry it.
    #[error("the token has a character that is not printable ASCII; `openssl rand -hex 16` makes one")]
    Unprintable,
    /// It is not a scheme and a host.
    #[error("{origin:?} is not an origin such as https://robot.example")]
    Origin {
        /// What was given.
        origin: String,
    },
}

impl Access {
    /// For these origins beside the own address, and with this token.
    ///
    /// # Errors
    /// See [`AccessError`].
    pub fn new(token: Option<String>, origins: &[String]) -> Result<Self, AccessError> {
        if let Some(token) = &token {
            if token.len() < TOKEN_AT_LEAST {
                return Err(AccessError::ShortToken { given: token.len() });
            }
            if !token.bytes().all(|byte| byte.is_ascii_graphic()) {
                return Err(AccessError::Unprintable);
            }
        }
        let origin = |origin: &String| {
            let plain = origin.trim_end_matches('/').to_ascii_lowercase();
            let is_one = authority(&plain).is_some_and(|host| !host.is_empty() && !host.contains('/'));
            if is_one { Ok(plain) } else { Err(AccessError::Origin { origin: origin.clone() }) }
        };
        let origins = origins.iter().map(origin).collect::<Result<_, _>>()?;
        Ok(Self { token, origins })
    }

    /// Whether a request that arrived at `local` may be answered at all.
    ///
    /// # Errors
    /// [`Denied::Host`], [`Denied::Origin`].
    pub fn check_site(&self, headers: &HeaderMap, local: SocketAddr) -> Result<(), Denied> {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
        let host = text(HOST).to_ascii_lowercase();
        let is_proxied = self.origins.iter().any(|origin| authority(origin) == Some(&*host));
        if !is_proxied && !names_address(&host, local.ip()) {
            return Err(Denied::Host { host });
        }
        let Some(origin) = headers.get(ORIGIN) else { return Ok(()) };
        let origin = origin.to_str().unwrap_or_default().to_ascii_lowercase();
        if authority(&origin) == Some(&*host) || self.origins.contains(&origin) {
            Ok(())
        } else {
            Err(Denied::Origin { origin })
        }
    }

    /// Whether a request has the token, where there is one.
    ///
    /// # Errors
    /// [`Denied::NoToken`], [`Denied::WrongToken`].
    pub fn check_token(&self, headers: &HeaderMap) -> Result<(), Denied> {
        let Some(token) = &self.token else { return Ok(()) };
        let given = headers.get(AUTHORIZATION).ok_or(Denied::NoToken)?;
        let given = given.as_bytes().strip_prefix(b"Bearer ").unwrap_or_default();
        if is_same(given, token.as_bytes()) { Ok(()) } else { Err(Denied::WrongToken) }
    }
}

/// The host and port of an origin.
fn authority(origin: &str) -> Option<&str> {
    origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"))
}

/// Returns `true` if the name in a `Host` header is the address that the request has arrived at, or localhost on loopback. The port is
/// free, since a tunnel may have another one; the page that asks must have it too.
fn names_address(host: &str, local: IpAddr) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split_once(']').map_or("", |(address, _)| address),
        None => host.split_once(':').map_or(host, |(name, _)| name),
    };
    let local = local.to_canonical();
    match name.parse::<IpAddr>() {
        Ok(address) => address.to_canonical() == local,
        Err(_) => name == "localhost" && local.is_loopback(),
    }
}

/// Compares in a time that does not depend on where they differ.
fn is_same(given: &[u8], secret: &[u8]) -> bool {
    let differences = given.iter().zip(secret).fold(0, |sum, (given, secret)| sum | (given ^ secret));
    given.len() == secret.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, origin.parse().unwrap());
        }
        headers
    }

    fn site(access: &Access, host: &str, origin: Option<&str>, local: &str) -> Result<(), Denied> {
        access.check_site(&headers(host, origin), local.parse().unwrap())
    }

    #[test]
    fn a_request_names_the_address_it_arrives_at_or_localhost() {
        let access = Access::new(None, &[]).unwrap();
        for (host, local, is_allowed) in [
            ("127.0.0.1:8080", "127.0.0.1:8080", true),
            ("localhost:8080", "127.0.0.1:8080", true),
            ("LOCALHOST:9000", "127.0.0.1:8080", true),
            ("[::1]:8080", "[::1]:8080", true),
            ("192.168.1.7:8080", "[::ffff:192.168.1.7]:8080", true),
            ("192.168.1.7", "192.168.1.7:80", true),
            ("localhost:8080", "192.168.1.7:8080", false),
            ("evil.example:8080", "127.0.0.1:8080", false),
            ("localhost.evil.example", "127.0.0.1:8080", false),
            ("127.0.0.2:8080", "127.0.0.1:8080", false),
            ("", "127.0.0.1:8080", false),
            ("[::1", "[::1]:8080", false),
        ] {
            assert_eq!(site(&access, host, None, local).is_ok(), is_allowed, "{host} at {local}");
        }
    }

    #[test]
    fn a_page_of_another_site_may_not_ask() {
        let access = Access::new(None, &["https://Robot.example/".to_owned()]).unwrap();
        let (host, local) = ("localhost:8080", "127.0.0.1:8080");
        for origin in ["http://localhost:8080", "https://localhost:8080", "https://robot.example"] {
            assert_eq!(site(&access, host, Some(origin), local), Ok(()), "{origin}");
        }
        for origin in ["http://localhost:3000", "http://evil.example", "null", "http://robot.example", ""] {
            let denied = Denied::Origin { origin: origin.to_owned() };
            assert_eq!(site(&access, host, Some(origin), local), Err(denied), "{origin}");
        }
        assert_eq!(site(&access, "robot.example", Some("https://robot.example"), local), Ok(()));
    }

    #[test]
    fn a_token_is_compared_as_a_whole() {
        let access = Access::new(Some("0123456789abcdef".to_owned()), &[]).unwrap();
        let with = |value: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(AUTHORIZATION, value.parse().unwrap());
            access.check_token(&headers)
        };
        assert_eq!(with("Bearer 0123456789abcdef"), Ok(()));
        for wrong in
            ["Bearer 0123456789abcde", "Bearer 0123456789abcdeff", "Bearer ", "0123456789abcdef", "Basic x"]
        {
            assert_eq!(with(wrong), Err(Denied::WrongToken), "{wrong}");
        }
        assert_eq!(access.check_token(&HeaderMap::new()), Err(Denied::NoToken));
        let short = Access::new(Some("0123".to_owned()), &[]).unwrap_err();
        assert_eq!(short, AccessError::ShortToken { given: 4 });
        assert!(Access::new(Some("0123456789 abcdef".to_owned()), &[]).is_err());
        assert!(Access::new(None, &["robot.example".to_owned()]).is_err());
    }
}
