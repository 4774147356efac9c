//! How to resample: the scheme, its numbers, and what is refused.

use crate::types::{Error, Result};

/// How the rows of a resample are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
    /// A share of the rows, each once, in the order of time.
    #[default]
    Subsample,
    /// As many rows as there are, drawn with replacement: the reference's.
    Bootstrap,
}

words!(Scheme, "resampling": Subsample "subsample", Bootstrap "bootstrap");

/// How many neighbouring rows are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    /// This many; 1: each row on its own.
    Rows(usize),
    /// The cube root of the number of rows, rounded down.
    CubeRoot,
}

impl Block {
    /// The length for a recording of `n` rows.
    pub(crate) fn length(self, n: usize) -> usize {
        match self {
            Self::Rows(length) => length,
            Self::CubeRoot => (libm::pow(n as f64, 1.0 / 3.0) as usize).max(1),
        }
    }

    /// The block as users write it.
    pub fn name(self) -> String {
        match self {
            Self::Rows(length) => length.to_string(),
            Self::CubeRoot => "cube_root".into(),
        }
    }
}

impl std::str::FromStr for Block {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "cube_root" {
            return Ok(Self::CubeRoot);
        }
        let reason = || format!("'{text}' is neither a number of rows from 1 on nor 'cube_root'");
        let length = text.parse().ok().filter(|&length| length > 0);
        length.map(Self::Rows).ok_or_else(|| Error::param("block", reason()))
    }
}

/// Fewest resamples from which a frequency is told.
pub const FEWEST_RESAMPLES: usize = 20;
/// Most resamples of one analysis.
pub const MOST_RESAMPLES: usize = 10_000;
/// Fewest blocks of a recording set from which rows are drawn.
pub(crate) const FEWEST_BLOCKS: usize = 10;
/// Fewest rows of all recordings from which rows are drawn.
pub(crate) const FEWEST_ROWS: usize = 20;

with_defaults! {
    /// How often and how to resample. [`Resampling::check`] says whether it is valid.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Resampling {
        /// Number of resamples.
        pub resamples: usize = 100,
        /// How rows are drawn.
        pub scheme: Scheme = Scheme::Subsample,
        /// Share of the rows in a subsample, in (0, 1); a bootstrap has none.
        pub share: f64 = 0.632,
        /// Neighbouring rows that are drawn together.
        pub block: Block = Block::Rows(1),
    }
}

impl Resampling {
    /// Checks the numbers on their own, without data.
    ///
    /// # Errors
    /// The first invalid one: its name, its value, and what is allowed.
    pub fn check(&self) -> Result<()> {
        let Self { resamples, share, block, .. } = *self;
        Error::ensure((FEWEST_RESAMPLES..=MOST_RESAMPLES).contains(&resamples), "resamples", || {
            format!("{resamples} is not from {FEWEST_RESAMPLES} to {MOST_RESAMPLES}; 100 tell a share to 0.1")
        })?;
        Error::ensure(share > 0.0 && share < 1.0, "share", || {
            format!("{share} is not between 0 and 1; 0.632 is usual")
        })?;
        Error::ensure(block != Block::Rows(0), "block", || "0 rows make no block; give 1 or more")
    }

    /// How much wider the error of all rows is than the spread of its resamples. A subsample shares its rows with the whole, so its spread
    /// around it is too small (Politis, Romano and Wolf 1999, with the correction for a finite population).
    pub(crate) fn widened(&self) -> f64 {
        match self.scheme {
            Scheme::Subsample => (self.share / (1.0 - self.share)).sqrt(),
            Scheme::Bootstrap => 1.0,
        }
    }
}
