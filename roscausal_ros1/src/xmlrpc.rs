//! XML-RPC calls with a deadline: rosrust's own wait for ever on a master or node that hangs.

use std::{
    fmt::Write as _,
    io::{Read, Write as _},
    net::{TcpStream, ToSocketAddrs},
    time::{Duration, Instant},
};

use roscausal_core::params::Value;
use roxmltree::{Document, Node};

/// The longest answer that is read; a parameter server's largest dictionaries stay far below.
const MAX_ANSWER: u64 = 16 << 20;

/// Why a call gave no value.
#[derive(Debug)]
pub(crate) enum CallError {
    /// Nobody answered, or not in time, or with something that is no XML-RPC.
    Unreachable(String),
    /// The other side answered that it will not.
    Refused(String),
}

impl std::fmt::Display for CallError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unreachable(reason) | Self::Refused(reason) => f.write_str(reason),
        }
    }
}

/// Calls `method` at `uri` (`http://host:port/`) and gives the third part of ROS's `[code, message, value]`.
pub(crate) fn call(
    uri: &str,
    method: &str,
    params: &[Value],
    patience: Duration,
) -> Result<Value, CallError> {
    let mut body = format!("<?xml version=\"1.0\"?><methodCall><methodName>{method}</methodName><params>");
    for param in params {
        body.push_str("<param>");
        encode(param, &mut body).map_err(CallError::Refused)?;
        body.push_str("</param>");
    }
    body.push_str("</params></methodCall>");
    let answer =
        post(uri, &body, patience).map_err(|error| CallError::Unreachable(format!("{uri}: {error}")))?;
    let document = Document::parse(&answer)
        .map_err(|error| CallError::Unreachable(format!("{uri}: no XML-RPC: {error}")))?;
    let value = document.descendants().find(|node| node.has_tag_name("value"));
    let value = value.ok_or_else(|| CallError::Unreachable(format!("{uri}: an answer without value")))?;
    if document.descendants().any(|node| node.has_tag_name("fault")) {
        let words: Vec<_> =
            value.descendants().filter(Node::is_text).filter_map(|node| node.text()).collect();
        return Err(CallError::Refused(format!("{uri}: {method} failed: {}", words.join(" "))));
    }
    let parts = value
        .descendants()
        .find(|node| node.has_tag_name("data"))
        .map(|data| data.children().filter(|node| node.has_tag_name("value")).collect::<Vec<_>>());
    let Some([code, message, value]) = parts.as_deref() else {
        return Err(CallError::Unreachable(format!(
            "{uri}: the answer to {method} is not [code, message, value]"
        )));
    };
    match decode(*code) {
        Ok(Value::Int(1)) => decode(*value).map_err(CallError::Refused),
        _ => Err(CallError::Refused(decode(*message).map_or_else(|error| error, |text| text_of(&text)))),
    }
}

fn text_of(value: &Value) -> String {
    if let Value::Str(text) = value { text.clone() } else { format!("{value:?}") }
}

/// One HTTP/1.0 request; the answer's body.
fn post(uri: &str, body: &str, patience: Duration) -> Result<String, String> {
    let deadline = Instant::now() + patience;
    let left = || deadline.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
    let address = uri.strip_prefix("http://").ok_or("not of the form http://host:port/")?;
    let (host, path) = address.split_once('/').unwrap_or((address, ""));
    let addresses =
        host.to_socket_addrs().map_err(|error| format!("host unknown or port missing ({error})"))?;
    let mut failure = "the host has no address".to_owned();
    let mut connected = None;
    for address in addresses {
        match TcpStream::connect_timeout(&address, left()) {
            Ok(stream) => {
                connected = Some(stream);
                break;
            }
            Err(error) => failure = error.to_string(),
        }
    }
    let mut stream = connected.ok_or(failure)?;
    let request = format!(
        "POST /{path} HTTP/1.0\r\nHost: {host}\r\nContent-Type: text/xml\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    let timed = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut => {
            format!("no answer within {:.1} s", patience.as_secs_f64())
        }
        _ => error.to_string(),
    };
    stream.set_write_timeout(Some(left())).map_err(timed)?;
    stream.write_all(request.as_bytes()).map_err(timed)?;
    let mut answer = Vec::new();
    let mut chunk = [0; 16 << 10];
    loop {
        stream.set_read_timeout(Some(left())).map_err(timed)?;
        let count = stream.read(&mut chunk).map_err(timed)?;
        answer.extend_from_slice(&chunk[..count]);
        if count == 0 || is_complete(&answer) {
            break;
        }
        if answer.len() as u64 > MAX_ANSWER {
            return Err("an answer too large to be true".to_owned());
        }
        if Instant::now() >= deadline {
            return Err(format!("no full answer within {:.1} s", patience.as_secs_f64()));
        }
    }
    let answer = String::from_utf8(answer).map_err(|_| "an answer that is not UTF-8")?;
    let (head, body) = answer.split_once("\r\n\r\n").ok_or("an answer that is no HTTP")?;
    let status = head.lines().next().unwrap_or_default();
    if status.split_whitespace().nth(1) == Some("200") { Ok(body.to_owned()) } else { Err(status.to_owned()) }
}

/// Whether the announced length has come: some servers keep the connection open.
fn is_complete(answer: &[u8]) -> bool {
    let Some(end) = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n") else { return false };
    let head = String::from_utf8_lossy(&answer[..end]);
    let length = head.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        if name.eq_ignore_ascii_case("content-length") { value.trim().parse::<usize>().ok() } else { None }
    });
    length.is_some_and(|length| answer.len() - end - 4 >= length)
}

fn encode(value: &Value, out: &mut String) -> Result<(), String> {
    out.push_str("<value>");
    match value {
        Value::Bool(value) => {
            write!(out, "<boolean>{}</boolean>", u8::from(*value)).map_err(|e| e.to_string())?
        }
        Value::Int(value) => {
            let value = i32::try_from(*value)
                .map_err(|_| format!("{value} does not fit into the 32 bits of a ROS 1 parameter"))?;
            write!(out, "<int>{value}</int>").map_err(|e| e.to_string())?;
        }
        Value::Double(value) if value.is_finite() => {
            write!(out, "<double>{value:?}</double>").map_err(|e| e.to_string())?;
        }
        Value::Double(value) => return Err(format!("{value} cannot be a ROS 1 parameter")),
        Value::Str(text) => {
            out.push_str("<string>");
            for c in text.chars() {
                match c {
                    '&' => out.push_str("&amp;"),
                    '<' => out.push_str("&lt;"),
                    '>' => out.push_str("&gt;"),
                    '\t' | '\n' | '\r' => out.push(c),
                    c if c.is_control() => {
                        return Err("control characters cannot be in a ROS 1 parameter".to_owned());
                    }
                    c => out.push(c),
                }
            }
            out.push_str("</string>");
        }
        Value::List(values) => {
            out.push_str("<array><data>");
            values.iter().try_for_each(|value| encode(value, out))?;
            out.push_str("</data></array>");
        }
    }
    out.push_str("</value>");
    Ok(())
}

/// The value in a `<value>` element; the error names the kind that nobody here can use.
fn decode(value: Node<'_, '_>) -> Result<Value, String> {
    let Some(kind) = value.children().find(Node::is_element) else {
        return Ok(Value::Str(value.text().unwrap_or_default().to_owned()));
    };
    let text = kind.text().unwrap_or_default();
    let bad = || format!("'{text}' is no {}", kind.tag_name().name());
    Ok(match kind.tag_name().name() {
        "boolean" => Value::Bool(text.trim() == "1" || text.trim() == "true"),
        "int" | "i4" | "i8" => Value::Int(text.trim().parse().map_err(|_| bad())?),
        "double" => Value::Double(text.trim().parse().map_err(|_| bad())?),
        "string" => Value::Str(text.to_owned()),
        "array" => {
            let data = kind.children().find(|node| node.has_tag_name("data"));
            let values =
                data.into_iter().flat_map(|data| data.children()).filter(|node| node.has_tag_name("value"));
            Value::List(values.map(decode).collect::<Result<_, _>>()?)
        }
        "struct" => return Err("a dictionary, where a value or a list is expected".to_owned()),
        other => return Err(format!("a value of the kind <{other}>, which ROS parameters do not have here")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_survive_the_way_to_the_master_and_back() {
        let value = Value::List(vec![
            Value::Bool(true),
            Value::Int(-7),
            Value::Double(1e-9),
            Value::Str("a <b> & 'c' \u{e9}\n".to_owned()),
            Value::List(vec![]),
        ]);
        let mut text = String::new();
        encode(&value, &mut text).unwrap();
        assert_eq!(decode(Document::parse(&text).unwrap().root_element()), Ok(value));
        assert!(encode(&Value::Int(1 << 40), &mut text).is_err());
        assert!(encode(&Value::Double(f64::NAN), &mut text).is_err());
    }

    #[test]
    fn a_silent_server_costs_no_more_than_the_deadline() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let uri = format!("http://{}/", listener.local_addr().unwrap());
        let start = Instant::now();
        let answer = call(&uri, "getPid", &[], Duration::from_millis(300));
        assert!(
            matches!(answer, Err(CallError::Unreachable(reason)) if reason.contains("no answer within 0.3 s"))
        );
        assert!(start.elapsed() < Duration::from_secs(2));
    }

    /// A server that answers each call with the next of the given texts.
    fn server(answers: std::sync::mpsc::Receiver<Vec<u8>>) -> String {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let uri = format!("http://{}/", listener.local_addr().unwrap());
        std::thread::spawn(move || {
            while let Ok(answer) = answers.recv() {
                let (mut stream, _) = listener.accept().unwrap();
                let _ = stream.read(&mut [0; 4096]);
                // The caller may have had enough.
                let _ = stream.write_all(&answer);
            }
        });
        uri
    }

    #[test]
    fn a_hostile_answer_is_refused_or_read() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let uri = server(receiver);
        let body = "<?xml version='1.0'?><methodResponse><params><param><value><array><data><value><int>1</int></value>\
                    <value><string>ok</string></value><value><array><data><value><double>0.5</double></value></data>\
                    </array></value></data></array></value></param></params></methodResponse>";
        let whole = format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}", body.len());
        let target = roscausal_fuzz::Target {
            corpus: format!("{}/tests/corpus/xmlrpc", env!("CARGO_MANIFEST_DIR")).into(),
            seeds: vec![whole.clone().into_bytes(), whole.replace("Content-Length", "X").into_bytes()],
            tokens: &[
                b"<value><array><data>",
                b"<value>",
                b"</value>",
                b"Content-Length: 99999999999999999999\r\n",
                b"Transfer-Encoding: chunked\r\n",
                b"\r\n\r\n",
                b"<!DOCTYPE a [<!ENTITY b 'c'>]>",
                b"&b;",
                b"<fault>",
            ],
            bytes_per_byte: 1000,
        };
        target.run(|input| {
            sender.send(input.to_vec()).unwrap();
            let _ = call(&uri, "getParam", &[], Duration::from_millis(300));
        });
    }
}
