//! What a share of resamples meant in systems whose links are known.
//!
//! 200 systems of 3 to 5 variables and 150 to 400 samples (150 linear, 30 nonlinear, 20 heavy-tailed; 16 % of 5000 pairs are
//! links), ParCorr, 100 subsamples of 0.632, alpha 0.05. `docs/confidence.md` has the table.

/// Lower end of each range, the range in words, and how many of 100 such links were real.
const TABLE: [(f64, &str, u8); 6] = [
    (0.9, "0.9 to 1", 100),
    (0.7, "0.7 to 0.9", 86),
    (0.5, "0.5 to 0.7", 62),
    (0.3, "0.3 to 0.5", 30),
    (0.1, "0.1 to 0.3", 15),
    (0.0, "below 0.1", 3),
];

/// The range that a share of resamples lies in, and how many of 100 links of that range were real in the test systems.
///
/// ```
/// use roscausal_discovery::confidence::share_that_was_real;
///
/// assert_eq!(share_that_was_real(0.95), ("0.9 to 1", 100));
/// assert_eq!(share_that_was_real(0.42), ("0.3 to 0.5", 30));
/// ```
pub fn share_that_was_real(confidence: f64) -> (&'static str, u8) {
    let row = TABLE.into_iter().find(|(from, ..)| confidence >= *from).unwrap_or(TABLE[5]);
    (row.1, row.2)
}
