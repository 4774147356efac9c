//! One client of a service, from its header to its last question.

use std::io::{self, Write};
use std::net::TcpStream;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use roscausal_core::middleware::Reply;
use roscausal_msgs::{Service, ros1};
use roscausal_ros::lock;

use super::Shared;
use super::frame::{Timed, framed, header};

/// How long a client may take to say what it began to say, and to take its answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often a connection looks whether the service has ended.
const LOOK: Duration = Duration::from_millis(250);

/// Answers one question, or all that a persistent client has.
///
/// # Errors
/// A client that breaks the protocol, or breaks off.
pub(super) fn attend<S: Service>(stream: TcpStream, shared: &Shared<S>) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let asked = timed(&stream).header()?;
    let field = |key: &str| asked.get(key).map(String::as_str);
    let md5 = S::ros1_md5();
    let kind = S::type_name();
    if field("probe") == Some("1") {
        return timed(&stream).write_all(&header(&[
            ("callerid", &shared.node),
            ("md5sum", &md5),
            ("type", &kind),
        ]));
    }
    let refusal = match (field("service"), field("md5sum")) {
        (Some(service), _) if service != shared.service => {
            Some(format!("this is the service {}, not {service}", shared.service))
        }
        (_, Some("*")) => None,
        (_, Some(other)) if other == md5 => None,
        (_, other) => Some(format!(
            "the service {} is a {kind} with md5 {md5}, not one with md5 {}",
            shared.service,
            other.unwrap_or("(none)")
        )),
    };
    if let Some(reason) = refusal {
        return timed(&stream).write_all(&header(&[("error", &reason)]));
    }
    let own =
        [("callerid", shared.node.as_str()), ("md5sum", &md5), ("service", &shared.service), ("type", &kind)];
    timed(&stream).write_all(&header(&own))?;
    let persistent = field("persistent") == Some("1");
    let mut first = true;
    while next_begins(&stream, shared, persistent && !first)? {
        let request = timed(&stream).message()?;
        let answer = match ros1::from_bytes::<S::Request>(&request) {
            Ok((request, _)) => answer_of(shared, request),
            Err(error) => Err(format!("no question of type {kind}: {error}")),
        };
        let body = answer.and_then(|answer| ros1::to_bytes(&answer, 0).map_err(|error| error.to_string()));
        let (good, body) = body.map_or_else(|reason| (0, reason.into_bytes()), |body| (1, body));
        timed(&stream).write_all(&[&[good][..], &framed(&body)].concat())?;
        if !persistent {
            return Ok(());
        }
        first = false;
    }
    Ok(())
}

fn timed(stream: &TcpStream) -> Timed<'_> {
    Timed { stream, until: Instant::now() + PATIENCE }
}

/// Waits for the first byte of a question. False once the client has left or the service has ended. A client that has
/// asked before may take its time.
fn next_begins<S: Service>(stream: &TcpStream, shared: &Shared<S>, may_rest: bool) -> io::Result<bool> {
    let start = Instant::now();
    stream.set_read_timeout(Some(LOOK))?;
    while shared.gate.is_open() {
        match stream.peek(&mut [0]) {
            Ok(arrived) => return Ok(arrived > 0),
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                if !may_rest && start.elapsed() > PATIENCE {
                    return Err(error);
                }
            }
            Err(error) => return Err(error),
        }
    }
    Ok(false)
}

/// The service's answer to a question, however long it takes, or why there is none.
fn answer_of<S: Service>(shared: &Shared<S>, request: S::Request) -> Result<S::Response, String> {
    let (sender, receiver) = mpsc::channel();
    // Dropped if the service has ended.
    let reply = Reply::new(move |answer| drop(sender.send(answer)));
    shared.gate.pass(|| (lock(&shared.callback))(request, reply));
    loop {
        match receiver.recv_timeout(LOOK) {
            Ok(answer) => return answer,
            Err(RecvTimeoutError::Timeout) if shared.gate.is_open() => {}
            Err(_) => return Err("the node ends".to_owned()),
        }
    }
}
