//! Who may see the page.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

use axum::{
    body::HttpBody,
    extract::{Request, State},
    http::{HeaderMap, StatusCode, Uri, header},
    middleware::Next,
    response::{IntoResponse, Redirect, Response},
};
use roscausal_core::{Error, Result};

const COOKIE: &str = "roscausal_token";
const NEEDS_TOKEN: &str =
    "This page needs a token: open the address that the program printed, with ?token=... at its end.\n";
const OTHER_HOST: &str =
    "This page is served for 127.0.0.1 and localhost only; open it under one of these names.\n";
const OTHER_PAGE: &str = "This page answers no other page; open it by its own address.\n";
const BODY: &str = "This page takes no request with a body.\n";

/// On this machine, everybody who asks for it by its own name. Elsewhere, everybody who knows the token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Guard {
    /// The request must name this machine. So no web page elsewhere can reach it through a domain name that points
    /// here.
    ThisMachine,
    /// The request must have this token.
    Token(String),
}

impl Guard {
    /// The guard for an address. For an empty token on an address other than this machine's, a random one is drawn.
    pub(crate) fn new(address: IpAddr, token: &str) -> Result<Self> {
        let legal = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | '~');
        let reason = "use letters, digits, '-', '_', '.' and '~' only";
        Error::ensure(token.chars().all(legal), "token", || reason)?;
        match token {
            "" if address.is_loopback() => Ok(Self::ThisMachine),
            "" => random().map(Self::Token),
            token => Ok(Self::Token(token.to_owned())),
        }
    }

    /// What to append to the address of the page.
    pub(crate) fn suffix(&self) -> String {
        match self {
            Self::ThisMachine => String::new(),
            Self::Token(token) => format!("?token={token}"),
        }
    }

    fn admits(&self, headers: &HeaderMap, uri: &Uri) -> bool {
        match self {
            Self::ThisMachine => {
                // An address in the first line counts before the header.
                let mut hosts =
                    headers.get_all(header::HOST).iter().map(|host| host.to_str().unwrap_or_default());
                let whole = uri.authority().is_none_or(|whole| is_this_machine(whole.as_str()));
                whole && hosts.next().is_some_and(is_this_machine) && hosts.next().is_none()
            }
            Self::Token(token) => {
                let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
                let mut values = cookies.flat_map(|text| text.split(';')).filter_map(|pair| {
                    let (name, value) = pair.trim().split_once('=')?;
                    (name == COOKIE).then_some(value)
                });
                values.any(|value| is_same(value, token))
            }
        }
    }
}

/// Lets a request through, turns `?token=` into a cookie, or refuses the request and closes its connection.
pub(crate) async fn check(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let refuse = |code: StatusCode, why| (code, [(header::CONNECTION, "close")], why).into_response();
    // So nobody can hold a connection by a body that never comes.
    if !request.body().is_end_stream() {
        return refuse(StatusCode::PAYLOAD_TOO_LARGE, BODY);
    }
    if is_of_another_page(request.headers()) {
        return refuse(StatusCode::FORBIDDEN, OTHER_PAGE);
    }
    if guard.admits(request.headers(), request.uri()) {
        return next.run(request).await;
    }
    let Guard::Token(token) = &guard else {
        return refuse(StatusCode::FORBIDDEN, OTHER_HOST);
    };
    let query = request.uri().query().unwrap_or_default();
    let given = query.split('&').find_map(|pair| pair.strip_prefix("token="));
    if given.is_some_and(|given| is_same(given, token)) {
        let cookie = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/");
        return ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response();
    }
    refuse(StatusCode::UNAUTHORIZED, NEEDS_TOKEN)
}

/// Whether a browser says that a page of another host asks.
fn is_of_another_page(headers: &HeaderMap) -> bool {
    let (origin, host) = (headers.get(header::ORIGIN), headers.get(header::HOST));
    let text = |value: &axum::http::HeaderValue| value.to_str().unwrap_or_default().to_ascii_lowercase();
    origin
        .map(text)
        .is_some_and(|origin| origin.split_once("://").map(|(_, from)| from) != host.map(text).as_deref())
}

/// Compares in a time that does not reveal how much is equal.
fn is_same(given: &str, token: &str) -> bool {
    let differing = given.bytes().zip(token.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    given.len() == token.len() && differing == 0
}

/// Whether a host, with or without a port, is `localhost` or an address of this machine's loopback, and nothing else.
fn is_this_machine(host: &str) -> bool {
    let (name, port) = match host.rsplit_once(':') {
        Some((name, port)) if !host.ends_with(']') => (name, port),
        _ => (host, "80"),
    };
    let address: Option<IpAddr> = match name.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        Some(inside) => inside.parse::<Ipv6Addr>().ok().map(|address| address.to_canonical()),
        None => name.parse::<Ipv4Addr>().ok().map(IpAddr::V4),
    };
    let named =
        name.eq_ignore_ascii_case("localhost") || address.is_some_and(|address| address.is_loopback());
    named && port.bytes().all(|digit| digit.is_ascii_digit()) && port.parse::<u16>().is_ok()
}

fn random() -> Result<String> {
    let mut bytes = [0; 16];
    let fault =
        |error: getrandom::Error| Error::param("token", format!("none can be drawn ({error}); give one"));
    getrandom::fill(&mut bytes).map_err(fault)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_addresses_always_have_a_token() {
        let (here, all): (IpAddr, IpAddr) = ("127.0.0.1".parse().unwrap(), "0.0.0.0".parse().unwrap());
        assert_eq!(Guard::new(here, "").unwrap(), Guard::ThisMachine);
        assert_eq!(Guard::new(here, "abc").unwrap(), Guard::Token("abc".into()));
        let (Guard::Token(one), Guard::Token(two)) =
            (Guard::new(all, "").unwrap(), Guard::new(all, "").unwrap())
        else {
            panic!("no token");
        };
        assert!(one.len() == 32 && one != two);
        assert!(Guard::new(all, "a;b").is_err());
    }

    #[test]
    fn only_names_of_this_machine_are_this_machine() {
        for host in [
            "localhost", "localhost:8321", "LocalHost:8321", "127.0.0.1", "127.0.0.1:8321", "127.8.9.1",
            "[::1]", "[::1]:80", "[0:0:0:0:0:0:0:1]:80", "[::ffff:127.0.0.1]:80",
        ] {
            assert!(is_this_machine(host), "{host}");
        }
        for host in [
            "",
            ":80",
            "evil.example",
            "192.168.0.7:8321",
            "0.0.0.0",
            "[::]",
            "[::2]:80",
            "[::ffff:192.168.0.7]",
            // What begins like one of its names.
            "127.0.0.1.evil.example:80",
            "127.0.0.1evil",
            "localhost.evil.example",
            "localhost.evil.example:8321",
            "[::1].evil.example",
            "[::1].evil.example:80",
            "[::1]evil",
            "[::1]evil:80",
            "[::1]@evil.example",
            "127.0.0.1@evil.example",
            "127.0.0.1:80@evil.example",
            "127.0.0.1:80.evil.example",
            "127.0.0.1:evil.example",
            "localhost:80:90",
            // What ends like one.
            "evil.example:[::1]",
            "evil[::1]",
            "evil.localhost",
            "user@localhost",
            // Other spellings: no browser sends them for a page that it was given.
            "localhost.",
            "127.0.0.1.",
            "localhost:",
            "localhost:+80",
            "localhost:99999",
            "localhost:80/",
            " localhost",
            "localhost ",
            "::1",
            "::1:80",
            "[::1",
            "::1]",
            "[[::1]]",
            "[::1%lo]",
            "[localhost]",
            "[127.0.0.1]",
            "127.1",
            "2130706433",
            "0x7f.0.0.1",
            "0177.0.0.1",
        ] {
            assert!(!is_this_machine(host), "{host}");
        }
    }

    #[test]
    fn one_host_is_named_and_no_other_page_asks() {
        let headers = |pairs: &[(header::HeaderName, &'static str)]| {
            let mut headers = HeaderMap::new();
            for (name, value) in pairs {
                headers.append(name, header::HeaderValue::from_static(value));
            }
            headers
        };
        let here = (header::HOST, "localhost:80");
        let alone = std::slice::from_ref(&here);
        let admits = |pairs: &[_], uri: &'static str| {
            Guard::ThisMachine.admits(&headers(pairs), &Uri::from_static(uri))
        };
        assert!(admits(alone, "/") && admits(alone, "http://127.0.0.1/"));
        assert!(!admits(&[], "/") && !admits(alone, "http://evil.example/"));
        assert!(!admits(&[here.clone(), (header::HOST, "evil.example")], "/"));
        let asks = |origin| is_of_another_page(&headers(&[here.clone(), (header::ORIGIN, origin)]));
        assert!(!is_of_another_page(&headers(alone)));
        assert!(!asks("http://localhost:80") && !asks("https://LOCALHOST:80"));
        for origin in [
            "null",
            "",
            "http://evil.example",
            "http://localhost",
            "http://localhost:80.evil",
            "localhost:80",
        ] {
            assert!(asks(origin), "{origin}");
        }
    }

    #[test]
    fn a_token_is_the_whole_token() {
        assert!(is_same("abc", "abc"));
        assert!(!is_same("ab", "abc") && !is_same("abd", "abc") && !is_same("", "abc"));
    }
}
