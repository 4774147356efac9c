//! Human-robot interaction simulator.
