//! A message on the ROS 1 wire: our types and our bounded codec behind rosrust's traits.

use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use roscausal_msgs::{Message, ros1};

/// A message as rosrust carries it. Bytes that are not an `M` become a reason instead of a failure inside rosrust.
/// So the subscription can say on which topic and from whom they came.
#[derive(Clone, Debug)]
pub(crate) struct Wire<M> {
    /// `header.seq`, if the type begins with a header.
    pub(crate) seq: Option<u32>,
    pub(crate) body: Result<M, String>,
}

impl<M: Message> Wire<M> {
    pub(crate) fn new(message: M) -> Self {
        Self { seq: None, body: Ok(message) }
    }

    fn read(bytes: &[u8]) -> Self {
        match ros1::from_bytes(bytes) {
            Ok((message, seq)) => {
                Self { seq: seq.filter(|_| M::definition().is_numbered()), body: Ok(message) }
            }
            Err(error) => Self { seq: None, body: Err(error.to_string()) },
        }
    }

    fn bytes(&self) -> io::Result<Vec<u8>> {
        let invalid = |reason: String| io::Error::new(io::ErrorKind::InvalidData, reason);
        let message = self.body.as_ref().map_err(|reason| invalid(reason.clone()))?;
        ros1::to_bytes(message, self.seq.unwrap_or_default()).map_err(|error| invalid(error.to_string()))
    }
}

impl<M: Message> Default for Wire<M> {
    fn default() -> Self {
        Self::new(M::default())
    }
}

impl<M: Message> PartialEq for Wire<M> {
    fn eq(&self, other: &Self) -> bool {
        matches!((self.bytes(), other.bytes()), (Ok(own), Ok(others)) if own == others)
    }
}

impl<M: Message> rosrust::RosMsg for Wire<M> {
    fn encode<W: Write>(&self, mut writer: W) -> io::Result<()> {
        writer.write_all(&self.bytes()?)
    }

    fn decode<R: Read>(mut reader: R) -> io::Result<Self> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes)?;
        Ok(Self::read(&bytes))
    }

    fn decode_slice(bytes: &[u8]) -> io::Result<Self> {
        // the first four bytes are the length
        Ok(Self::read(bytes.get(4..).unwrap_or_default()))
    }
}

impl<M: Message> rosrust::Message for Wire<M> {
    fn msg_definition() -> String {
        M::ros1_definition().to_owned()
    }

    fn md5sum() -> String {
        M::ros1_md5().to_owned()
    }

    fn msg_type() -> String {
        M::type_name()
    }

    fn set_header(&mut self, _clock: &Arc<dyn rosrust::Clock>, seq: &Arc<AtomicUsize>) {
        self.seq = Some(seq.fetch_add(1, Ordering::SeqCst) as u32);
    }
}

/// ROS 1's word for any type, and for any md5.
pub(crate) const ANY: &str = "*";

/// The bytes of a message of any type.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AnyWire(pub(crate) Vec<u8>);

impl rosrust::RosMsg for AnyWire {
    fn encode<W: Write>(&self, mut writer: W) -> io::Result<()> {
        writer.write_all(&self.0)
    }

    fn decode<R: Read>(mut reader: R) -> io::Result<Self> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes)?;
        Ok(Self(bytes))
    }

    fn decode_slice(bytes: &[u8]) -> io::Result<Self> {
        // the first four bytes are the length
        Ok(Self(bytes.get(4..).unwrap_or_default().to_vec()))
    }
}

impl rosrust::Message for AnyWire {
    fn msg_definition() -> String {
        String::new()
    }

    fn md5sum() -> String {
        ANY.to_owned()
    }

    fn msg_type() -> String {
        ANY.to_owned()
    }
}
