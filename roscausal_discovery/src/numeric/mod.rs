//! Numbers: random ones, rows of them, and the distributions of tests. Nothing here knows a test or a method.

pub(crate) mod beta;
pub(crate) mod least_squares;
pub(crate) mod normal;
pub(crate) mod pcg64;
pub(crate) mod random;
pub(crate) mod rows;
pub(crate) mod slope;
pub(crate) mod special;
pub(crate) mod student_t;
