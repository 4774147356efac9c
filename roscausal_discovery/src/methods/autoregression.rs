//! Vector autoregression: every variable regressed on the past of all variables. What Granger causality and VARLiNGAM share.

use std::ops::RangeInclusive;

use ndarray::Array3;

use crate::{
    numeric::{
        least_squares::{LeastSquares, ROUNDING},
        rows::moments,
    },
    types::{CompleteRows, Control, DataFrame, Error, Named, Node, Result, Samples, unique},
};

/// A score by which the number of lags is chosen: `ln det(E'E / n)` of the residuals plus a price per coefficient. The least
/// wins.
///
/// ```
/// use roscausal_discovery::methods::Criterion;
///
/// assert_eq!("hqic".parse::<Criterion>()?, Criterion::Hqic);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Criterion {
    /// Akaike: `2 / n`.
    Aic,
    /// Bayes (Schwarz): `ln(n) / n`. Right in the long run; the usual choice.
    Bic,
    /// Hannan and Quinn: `2 ln(ln(n)) / n`.
    Hqic,
}

impl Criterion {
    /// The score of `n` samples with `parameters` coefficients and this `ln det(E'E / n)`.
    fn score(self, ln_det: f64, n: usize, parameters: usize) -> f64 {
        let n = n as f64;
        let price = match self {
            Self::Aic => 2.0,
            Self::Bic => libm::log(n),
            Self::Hqic => 2.0 * libm::log(libm::log(n)),
        };
        ln_det + price * parameters as f64 / n
    }
}

words!(Criterion, "criterion": Aic "aic", Bic "bic", Hqic "hqic");

/// All variables regressed on all variables at lags `first..=lags`.
pub(super) struct Autoregression {
    /// The samples, at lags up to the largest one.
    pub(super) rows: CompleteRows,
    /// The causes, by lag and then variable: the columns of `fit`.
    pub(super) causes: Vec<Node>,
    /// Targets are the variables.
    pub(super) fit: LeastSquares,
    constant: bool,
}

impl Autoregression {
    /// Fits the variables of `rows`, on a constant too if asked to.
    ///
    /// # Errors
    /// Fewer samples than coefficients.
    pub(super) fn new(rows: CompleteRows, lags: RangeInclusive<usize>, constant: bool) -> Result<Self> {
        let n_vars = rows.n_vars;
        let causes: Vec<Node> =
            lags.flat_map(|lag| (0..n_vars).map(move |var| Node::new(var, lag))).collect();
        let columns: Vec<&[f64]> = causes.iter().map(|&node| rows.column(node)).collect();
        let targets: Vec<&[f64]> = (0..n_vars).map(|var| rows.column(Node::new(var, 0))).collect();
        let needed = causes.len() + usize::from(constant) + 1;
        if rows.len() < needed {
            let (n, coefficients, flag) = (rows.len(), needed - 1, Named("tau_max"));
            let lost = if rows.n_lost > 0 { " (samples with a missing value are left out)" } else { "" };
            return Err(Error::Data(format!(
                "{n} complete samples are too few for {coefficients} coefficients of each variable: record at least {needed}, or lower \
                 {flag}{lost}"
            )));
        }
        let fit = LeastSquares::new(&columns, &targets, constant);
        Ok(Self { rows, causes, fit, constant })
    }

    /// The column of a cause.
    pub(super) fn column(&self, cause: usize, lag: usize) -> Option<usize> {
        self.causes.iter().position(|&node| node == Node::new(cause, lag))
    }

    /// The coefficients `[cause][effect][lag 0..=lags]`; 0 at lag 0.
    pub(super) fn coefficients(&self, lags: usize) -> Array3<f64> {
        let n = self.rows.n_vars;
        let mut coefficients = Array3::zeros((n, n, lags + 1));
        for (k, cause) in self.causes.iter().enumerate() {
            (0..n).for_each(|effect| {
                coefficients[[cause.var, effect, cause.lag]] = self.fit.coefficient(effect, k)
            });
        }
        coefficients
    }

    /// The score of the number of lags.
    pub(super) fn score(&self, criterion: Criterion) -> f64 {
        let parameters = self.rows.n_vars * (self.causes.len() + usize::from(self.constant));
        criterion.score(self.fit.ln_det(), self.rows.len(), parameters)
    }

    /// What is left of the variables, one column each.
    pub(super) fn residuals(&self) -> Vec<Vec<f64>> {
        let n_vars = self.rows.n_vars;
        let of = |target: usize| {
            let mut left = self.rows.column(Node::new(target, 0)).to_vec();
            for (k, &cause) in self.causes.iter().enumerate() {
                let coefficient = self.fit.coefficient(target, k);
                left.iter_mut().zip(self.rows.column(cause)).for_each(|(v, x)| *v -= coefficient * x);
            }
            without_rounding(&mut left, self.rows.column(Node::new(target, 0)));
            left
        };
        (0..n_vars).map(of).collect()
    }

    /// The variables of which some lags are determined by other columns, so that their coefficients say nothing.
    pub(super) fn undetermined(&self) -> Vec<usize> {
        let causes = (0..self.causes.len()).filter(|&k| self.fit.is_undetermined(k));
        unique(causes.map(|k| self.causes[k].var).collect())
    }
}

/// Makes what a perfect fit leaves of `target` zero: it is rounding, and would pass for noise.
pub(super) fn without_rounding(left: &mut [f64], target: &[f64]) {
    if moments(left).1 <= ROUNDING * moments(target).1 {
        left.fill(0.0);
    }
}

/// The complete samples of `data` with `lags` steps of past.
pub(super) fn complete_rows(data: &DataFrame, lags: usize, control: &Control) -> Result<CompleteRows> {
    control.check()?;
    data.check_length(lags, lags)?;
    Ok(Samples::new(data.of_scalars("a model of all variables at once")?, lags).complete())
}
