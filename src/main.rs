//! The `roscausal` command.

fn main() {}
