//! Asking a service.

use std::io::{self, Write};
use std::time::{Duration, Instant};
use std::{net::TcpStream, thread};

use roscausal_core::{Error, Result};
use roscausal_msgs::{Service, ros1};

use super::address_of;
use super::frame::{Timed, framed, header};
use crate::session::Session;

/// Time between two looks for a service that is not there yet.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Asks a service by its resolved name, on a connection of its own.
///
/// # Errors
/// No such service in time, one of another type, or one that gives no answer.
pub(crate) fn call<S: Service>(
    session: &Session,
    service: &str,
    request: &S::Request,
    patience: Duration,
) -> Result<S::Response> {
    let until = Instant::now() + patience;
    let fail = |reason: String| Error::Service { service: service.to_owned(), reason };
    let stream = connect(session, service, until).map_err(fail)?;
    let mut timed = Timed { stream: &stream, until };
    let answer = converse::<S>(&mut timed, session.membership.node(), service, request);
    answer
        .map_err(|error| match error.kind() {
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => {
                fail(format!("no answer within {} s", patience.as_secs_f64()))
            }
            _ => fail(error.to_string()),
        })?
        .map_err(fail)
}

/// A connection to the service, as soon as there is one.
fn connect(session: &Session, service: &str, until: Instant) -> std::result::Result<TcpStream, String> {
    loop {
        let left = until.saturating_duration_since(Instant::now());
        let found = session.membership.master().map_err(|error| error.to_string())?.lookup_service(service);
        let reason = match found.as_deref().map(address_of) {
            Ok(Some(address)) if !left.is_zero() => match TcpStream::connect_timeout(&address, left) {
                Ok(stream) => return Ok(stream),
                Err(error) => format!("its node at {address} does not answer: {error}"),
            },
            Ok(_) => "its address cannot be resolved".to_owned(),
            Err(_) => "nobody offers it".to_owned(),
        };
        if left <= LOOK_AGAIN {
            return Err(reason);
        }
        thread::sleep(LOOK_AGAIN);
    }
}

/// Header, question, answer. The inner error is the service's own.
fn converse<S: Service>(
    timed: &mut Timed<'_>,
    node: &str,
    service: &str,
    request: &S::Request,
) -> io::Result<std::result::Result<S::Response, String>> {
    let invalid = |reason: String| io::Error::new(io::ErrorKind::InvalidData, reason);
    timed.stream.set_nodelay(true)?;
    let (md5, kind) = (S::ros1_md5(), S::type_name());
    let body = ros1::to_bytes(request, 0).map_err(|error| invalid(error.to_string()))?;
    timed.write_all(&header(&[
        ("callerid", node),
        ("service", service),
        ("md5sum", &md5),
        ("type", &kind),
    ]))?;
    let fields = timed.header()?;
    if let Some(reason) = fields.get("error") {
        return Ok(Err(reason.clone()));
    }
    if let Some(other) = fields.get("md5sum").filter(|other| **other != md5 && *other != "*") {
        return Ok(Err(format!("it has the md5 {other}, not that of {kind}, {md5}")));
    }
    timed.write_all(&framed(&body))?;
    let good = timed.byte()? == 1;
    let answer = timed.message()?;
    if !good {
        return Ok(Err(String::from_utf8_lossy(&answer).into_owned()));
    }
    ros1::from_bytes(&answer)
        .map(|(answer, _)| Ok(answer))
        .map_err(|error| invalid(format!("no answer of type {kind}: {error}")))
}
