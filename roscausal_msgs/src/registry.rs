//! The registry of message types: for code that learns a type only at run time.

use crate::{Definition, Message};

/// An operation on a message type that is known only at run time; see [`visit`].
pub trait TypeVisitor {
    /// The result of the operation.
    type Output;

    /// Runs the operation with `M`.
    fn visit<M: Message>(self) -> Self::Output;
}

macro_rules! registry {
    ($($message:ty),* $(,)?) => {
        /// All message types of this crate, for backends and recordings. A name occurs twice if its fields differ
        /// between the ROS versions ([`Definition::wires`]), or if two md5 sums are in use for it (pedsim's
        /// agents).
        pub fn types() -> Vec<&'static Definition> {
            vec![$(<$message as Message>::definition()),*]
        }

        /// Calls `visitor` with the type of a definition; `None` if this crate does not have it.
        pub fn visit<V: TypeVisitor>(definition: &Definition, visitor: V) -> Option<V::Output> {
            $(if std::ptr::eq(<$message as Message>::definition(), definition) {
                return Some(visitor.visit::<$message>());
            })*
            None
        }
    };
}

include!(concat!(env!("OUT_DIR"), "/registry.rs"));
