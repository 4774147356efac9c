//! XML-RPC calls with a deadline. rosrust's own calls wait for ever on a master or node that hangs.

use std::time::Duration;

use dxr::{FaultResponse, MethodCall, MethodResponse, TryFromValue, Value as Xml};
use roscausal_core::params::Value;
use ureq::Agent;

/// Size of the longest answer that is read. The largest dictionaries of a parameter server are far smaller.
const MAX_ANSWER: u64 = 16 << 20;

/// Why a call returned no value.
#[derive(Debug)]
pub(crate) enum CallError {
    /// No answer, a late one, or one that is not XML-RPC.
    Unreachable(String),
    /// The other side refused.
    Refused(String),
}

impl std::fmt::Display for CallError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unreachable(reason) | Self::Refused(reason) => f.write_str(reason),
        }
    }
}

/// Calls `method` at `uri` (`http://host:port/`) and returns the third part of ROS's `[code, message, value]`.
pub(crate) fn call<T: TryFromValue>(
    uri: &str,
    method: &str,
    params: Vec<Xml>,
    patience: Duration,
) -> Result<T, CallError> {
    let unreachable = |reason: String| CallError::Unreachable(format!("{uri}: {reason}"));
    let refused = |reason: String| CallError::Refused(format!("{uri}: {method}: {reason}"));
    let request = MethodCall { name: method.into(), params };
    let request = request.to_xml().map_err(|error| refused(error.to_string()))?;
    let answer = post(uri, &request, patience).map_err(unreachable)?;
    let value = MethodResponse::from_xml(&answer).map(|response| response.value);
    let parts = value.and_then(|value| <(i32, Xml, Xml)>::try_from_value(&value));
    let (code, message, value) = parts.map_err(|_| match FaultResponse::from_xml(&answer) {
        Ok(FaultResponse { fault }) => refused(fault.to_string()),
        Err(_) => unreachable(format!("the answer to {method} is not [code, message, value] in XML-RPC")),
    })?;
    match (code, message) {
        (1, _) => T::try_from_value(&value).map_err(|error| refused(error.to_string())),
        (_, Xml::String(message)) => Err(CallError::Refused(message)),
        (_, message) => Err(refused(format!("{message:?}"))),
    }
}

/// One HTTP request on a new connection. Returns the body of the answer.
fn post(uri: &str, body: &str, patience: Duration) -> Result<String, String> {
    // A proxy in the environment is for the internet, not for the robot's network.
    let config = Agent::config_builder().timeout_global(Some(patience)).proxy(None).build();
    let request = Agent::new_with_config(config).post(uri).content_type("text/xml");
    let read = || request.send(body)?.into_body().into_with_config().limit(MAX_ANSWER).read_to_string();
    read().map_err(|error| match error {
        ureq::Error::Timeout(_) => format!("no answer within {:.1} s", patience.as_secs_f64()),
        other => other.to_string(),
    })
}

/// A parameter value as XML-RPC.
pub(crate) fn encode(value: &Value) -> Result<Xml, String> {
    Ok(match value {
        Value::Bool(value) => Xml::Boolean(*value),
        Value::Int(value) => Xml::Integer(
            i32::try_from(*value)
                .map_err(|_| format!("{value} does not fit into the 32 bits of a ROS 1 parameter"))?,
        ),
        Value::Double(value) if value.is_finite() => Xml::Double(*value),
        Value::Double(value) => return Err(format!("{value} cannot be a ROS 1 parameter")),
        Value::Str(text) if text.contains(|c: char| c.is_control() && !c.is_whitespace()) => {
            return Err("control characters cannot be in a ROS 1 parameter".to_owned());
        }
        Value::Str(text) => Xml::String(text.clone()),
        Value::List(values) => Xml::Array(values.iter().map(encode).collect::<Result<_, _>>()?),
    })
}

/// A parameter value from XML-RPC. The error names the unsupported kind.
pub(crate) fn decode(value: Xml) -> Result<Value, String> {
    Ok(match value {
        Xml::Boolean(value) => Value::Bool(value),
        Xml::Integer(value) => Value::Int(value.into()),
        Xml::Double(value) => Value::Double(value),
        Xml::String(text) => Value::Str(text),
        Xml::Array(values) => Value::List(values.into_iter().map(decode).collect::<Result<_, _>>()?),
        Xml::Struct(_) => return Err("a dictionary, where a value or a list is expected".to_owned()),
        other => return Err(format!("{other:?}, where a value or a list is expected")),
    })
}

#[cfg(test)]
mod tests {
    use std::{
        io::{Read, Write},
        time::Instant,
    };

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
        let text = encode(&value).unwrap().to_xml().unwrap();
        assert_eq!(decode(Xml::from_xml(&text).unwrap()), Ok(value));
        for bad in [Value::Int(1 << 40), Value::Double(f64::NAN), Value::Str("\u{1}".to_owned())] {
            assert!(encode(&bad).is_err());
        }
    }

    #[test]
    fn a_silent_server_costs_no_more_than_the_deadline() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let uri = format!("http://{}/", listener.local_addr().unwrap());
        let start = Instant::now();
        let answer = call::<i32>(&uri, "getPid", vec![], Duration::from_millis(300));
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
                // The caller may have hung up.
                let _ = stream.write_all(&answer);
            }
        });
        uri
    }

    #[test]
    fn a_fault_is_a_refusal_with_its_words() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let uri = server(receiver);
        let body = "<?xml version='1.0'?><methodResponse><fault><value><struct><member><name>faultCode</name><value>\
                    <int>1</int></value></member><member><name>faultString</name><value><string>no such method\
                    </string></value></member></struct></value></fault></methodResponse>";
        let answer = format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}", body.len());
        sender.send(answer.into_bytes()).unwrap();
        let answer = call::<i32>(&uri, "getPit", vec![], Duration::from_secs(2));
        assert!(
            matches!(&answer, Err(CallError::Refused(reason)) if reason.contains("getPit") && reason.contains("no such method")),
            "{answer:?}"
        );
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
            let _ = call::<Xml>(&uri, "getParam", vec![], Duration::from_millis(300));
        });
    }
}
