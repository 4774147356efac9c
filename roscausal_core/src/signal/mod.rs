//! Signals: any number of any topic as a variable, such as `v_cmd = /cmd_vel.linear.x`.
//!
//! [`Signal`] is the checked text: a name and an expression over the fields of one topic. [`Signals`] binds signals to the
//! definitions that come with the messages, and reads each message's values. [`How`] says what a row holds of values that
//! come at their own rate.
//!
//! The expressions:
//! - `/topic.field.field[2].x`: a number; a truth value is 0 or 1, a time is seconds; `.roll`, `.pitch` and `.yaw` of an
//!   orientation.
//! - `count(p)`, `sum(p)`, `mean(p)`, `min(p)`, `max(p)` of an array, `norm(p)` of a vector or an array, `length(p)` of a way.
//! - `rate(e)`: change per second from message to message. `hz(/topic)`: messages per second. `delay(/topic)`: seconds from
//!   a message's stamp to its arrival.
//! - `+ - * / ^`, brackets, `pi`, numbers with units as in `batch::expression` (`30 deg`), its functions of one number, `min`,
//!   `max`; comparisons `< <= > >= == !=` are 1 or 0, also with a text: `/battery.state == "full"`.
//! - Around the whole: `hold(e, 30)` (the last value for at most 30 s), `linear(e)` (between two values), `average(e)` (of
//!   the values since the row before). Default: the last value for at most `signal_max_age`. Within them, `only(e, condition)`:
//!   only messages count in which the condition is not 0.
//!
//! Why not a library for the expressions: as in `batch::expression`, the names, which are paths into messages, and the
//! sentences about them are most of it.

mod bind;
mod definitions;
mod heard;
mod parse;

pub use definitions::Definitions;
pub use heard::{Reading, Signals};
pub use parse::{How, Signal};
