//! When a mechanism changes: a detector that reads batch after batch.
//!
//! Two graphs of the same system differ by chance, so links that come and go between models are not changes. Here the *slope* of
//! each effect on each cause is compared, given what else drives the effect, in two stages:
//!
//! 1. The batches since the last change are the regime. A new batch is compared with them: for each link a test of one slope
//!    in both, corrected for their number (Benjamini and Hochberg).
//! 2. If a link differs at [`Levels::suspect`], it is **suspected**, and the batch is held back. Else it joins the regime.
//! 3. The next batch decides. If the link differs in both batches together at [`Levels::confirm`], in the new one alone, and in
//!    the same direction, it is **confirmed**: `when.rs` tells the rows between which it changed, and what comes after them in
//!    both batches is the new regime. Else it is **withdrawn**, and the batch that was held back joins the regime after all.
//! 4. What else changed with it is looked for given it, in the same two batches and in the next ones: all of the new regime is
//!    compared with the one before.
//!
//! How much a link differs from batch to batch while nothing changes is learnt on the way (`baseline.rs`): rows that hang
//! together, as those of one encounter, would else show changes all the time. So nothing is suspected before the fourth batch.
//!
//! Each batch is centred by itself, and slopes do not depend on the size of any noise, so a mean or a spread that changes is no
//! event. A change that a batch has within itself leaves neither slope there; that is why what comes behind it must show it alone, and
//! why the kind and the new slope are those of the newest one alone.
//! A regime that returns is recognised ([`ChangeEvent::same_as`]). Columns of interventions are causes that nobody compares.
//! Sources: Chow 1960 (test of two regressions), MacKinnon and White 1985 (HC3), Huang et al. 2020 (change as change of a
//! mechanism). Slopes are linear: a mechanism that changes its form but no slope is not seen by them. [`Form::Curve`] compares any
//! smooth mechanism in the same two stages, by a score test on a Gaussian process of both groups (`curves.rs`).
//!
//! ```
//! use ndarray::Array2;
//! use roscausal_discovery::{Control, changes::{Detector, Levels, Status}};
//!
//! # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! let names = vec!["a".to_owned(), "b".to_owned()];
//! let mut detector = Detector::new(names, 1, &[], Levels::default())?;
//! let mut events = Vec::new();
//! for batch in 0..8 {
//!     let mut values = Array2::zeros((200, 2));
//!     for t in 1..200 {
//! #         let i = 400 * batch + 2 * t;
//!         values[[t, 0]] = noise(i);
//!         // From the fifth batch on `a` no longer drives `b`.
//!         values[[t, 1]] = if batch < 4 { 0.8 * values[[t - 1, 0]] } else { 0.0 } + noise(i + 1);
//!     }
//!     events.extend(detector.read(&values, &Control::default())?);
//! }
//! let confirmed: Vec<_> = events.iter().filter(|event| event.status == Status::Confirmed).collect();
//! assert_eq!((confirmed.len(), confirmed[0].cause.as_str(), confirmed[0].kind.name()), (1, "a", "vanished"));
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```

mod baseline;
mod batch;
mod compare;
mod curves;
mod detector;
mod event;
mod place;
mod score;
mod terms;
mod when;

pub use detector::{Detector, Levels};
pub use event::{ChangeEvent, Form, Kind, Status};

#[cfg(test)]
mod tests;
