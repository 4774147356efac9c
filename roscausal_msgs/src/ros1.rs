//! Messages as ROS 1 sends and records them: little endian, no alignment, lengths before strings and sequences,
//! `seq` in every header.

use crate::{
    Message,
    wire::{Decoder, Encoder, Fault, Layout, WireError},
};

/// The bytes of a message. `seq`, the count of the publisher, goes into its first header; further headers have 0.
///
/// # Errors
/// If a string or sequence is longer than 2^32 - 1.
pub fn to_bytes<M: Message>(message: &M, seq: u32) -> Result<Vec<u8>, WireError> {
    let mut encoder = Encoder::new(Layout::ROS1, &[], seq);
    message.serialize(&mut encoder).map_err(Fault::of::<M>)?;
    Ok(encoder.bytes)
}

/// The message in `bytes`, which must end with it, and the `seq` of its first header if it has one.
///
/// # Errors
/// If the bytes are not exactly one message of this type. No input causes a panic, or allocates much more than its
/// own length.
pub fn from_bytes<M: Message>(bytes: &[u8]) -> Result<(M, Option<u32>), WireError> {
    let mut decoder = Decoder::new(Layout::ROS1, bytes, 0);
    let message = M::deserialize(&mut decoder).map_err(Fault::of::<M>)?;
    Ok((message, decoder.finish(0).map_err(Fault::of::<M>)?))
}
