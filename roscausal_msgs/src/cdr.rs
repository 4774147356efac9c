//! Messages as ROS 2 sends and records them: CDR (OMG, XCDR version 1), after the four bytes that name the
//! representation. Version 2 (PLAIN_CDR2 and DELIMITED_CDR2) is read, too.

use crate::{
    Message,
    dynamic::as_first_version,
    wire::{Decoder, Encoder, Fault, Layout, WireError},
};

/// CDR, little endian, no options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// The bytes of a message, little endian, after the four bytes that say so.
///
/// # Errors
/// If a string or sequence is longer than 2^32 - 1.
pub fn to_bytes<M: Message>(message: &M) -> Result<Vec<u8>, WireError> {
    let mut encoder = Encoder::new(Layout::CDR, &LITTLE_ENDIAN, 0);
    message.serialize(&mut encoder).map_err(Fault::of::<M>)?;
    Ok(encoder.bytes)
}

/// The message in `bytes`, in either byte order. Up to three bytes of padding may follow it.
///
/// # Errors
/// If the bytes are not exactly one message of this type. No input causes a panic, or allocates much more than its
/// own length.
pub fn from_bytes<M: Message>(bytes: &[u8]) -> Result<M, WireError> {
    let &[high, low, _, _] = bytes.first_chunk().ok_or_else(|| {
        Fault::Truncated { offset: 0, needed: LITTLE_ENDIAN.len(), left: bytes.len() }.of::<M>()
    })?;
    let layout = match u16::from_be_bytes([high, low]) {
        0 => Layout { big_endian: true, ..Layout::CDR },
        1 => Layout::CDR,
        second @ 6..=9 => {
            let schema = M::definition().ros2_schema();
            let schema = schema.ok_or_else(|| Fault::Representation(second).of::<M>())?;
            return from_bytes(&as_first_version(schema, bytes).map_err(Fault::of::<M>)?);
        }
        other => return Err(Fault::Representation(other).of::<M>()),
    };
    let mut decoder = Decoder::new(layout, bytes, LITTLE_ENDIAN.len());
    let message = M::deserialize(&mut decoder).map_err(Fault::of::<M>)?;
    decoder.finish(3).map_err(Fault::of::<M>)?;
    Ok(message)
}
