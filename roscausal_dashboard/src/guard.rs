//! Who may see the page.

use std::net::IpAddr;

use axum::{
    extract::{Request, State},
    http::{HeaderMap, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Redirect, Response},
};
use roscausal_core::{Error, Result};

const COOKIE: &str = "roscausal_token";
const NEEDS_TOKEN: &str =
    "This page needs a token: open the address that the program printed, with ?token=... at its end.\n";
const OTHER_HOST: &str =
    "This page is served for 127.0.0.1 and localhost only; open it under one of these names.\n";

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
        if !token.chars().all(legal) {
            return Err(Error::param("token", "use letters, digits, '-', '_', '.' and '~' only"));
        }
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

    fn admits(&self, headers: &HeaderMap) -> bool {
        match self {
            Self::ThisMachine => {
                headers.get(header::HOST).is_some_and(|host| is_this_machine(host.as_bytes()))
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

/// Lets a request through, turns `?token=` into a cookie, or refuses the request.
pub(crate) async fn check(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    if guard.admits(request.headers()) {
        return next.run(request).await;
    }
    let Guard::Token(token) = &guard else {
        return (StatusCode::FORBIDDEN, OTHER_HOST).into_response();
    };
    let query = request.uri().query().unwrap_or_default();
    let given = query.split('&').find_map(|pair| pair.strip_prefix("token="));
    if given.is_some_and(|given| is_same(given, token)) {
        let cookie = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/");
        return ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response();
    }
    (StatusCode::UNAUTHORIZED, NEEDS_TOKEN).into_response()
}

/// Compares in a time that does not reveal how much is equal.
fn is_same(given: &str, token: &str) -> bool {
    let differing = given.bytes().zip(token.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    given.len() == token.len() && differing == 0
}

fn is_this_machine(host: &[u8]) -> bool {
    let Ok(host) = std::str::from_utf8(host) else { return false };
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name == "localhost" || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
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
        for host in ["localhost:8321", "127.0.0.1", "[::1]:80"] {
            assert!(is_this_machine(host.as_bytes()), "{host}");
        }
        for host in ["evil.example", "127.0.0.1.evil.example:80", "192.168.0.7:8321", ""] {
            assert!(!is_this_machine(host.as_bytes()), "{host}");
        }
    }

    #[test]
    fn a_token_is_the_whole_token() {
        assert!(is_same("abc", "abc"));
        assert!(!is_same("ab", "abc") && !is_same("abd", "abc") && !is_same("", "abc"));
    }
}
