//! A possible link: where a mechanism may change.

use serde::{Deserialize, Serialize};

/// A possible link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Place {
    pub(super) cause: usize,
    pub(super) effect: usize,
    pub(super) lag: usize,
}
