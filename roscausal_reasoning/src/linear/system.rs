//! A system of linear equations over time: `x(t) = c + sum over lags of Phi_lag x(t - lag) + e(t)`, lag 0 included.
//!
//! Path coefficients (Wright 1921; Runge et al. 2015): `Psi_0 = (I - Phi_0)^-1`,
//! `Psi_lag = Psi_0 sum_{s=1..lag} Phi_s Psi_{lag-s}`; `Psi_lag[j, i]` is the effect on `x_j(t)` of a unit pulse of `x_i(t - lag)`.
//! Mediated by `k`: `Psi - Psi^(k)`, where `Psi^(k)` has no link into `k`.

use ndarray::{Array1, Array2};

/// Coefficients `[lag]` of `[effect, cause]`, constants, and an order of the variables at lag 0.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearSystem {
    /// `Phi`, lag 0 first.
    pub coefficients: Vec<Array2<f64>>,
    /// Constants.
    pub intercepts: Vec<f64>,
    /// Variables, causes at lag 0 first.
    pub order: Vec<usize>,
}

impl LinearSystem {
    /// Number of variables.
    pub fn len(&self) -> usize {
        self.intercepts.len()
    }

    /// Whether there is no variable.
    pub fn is_empty(&self) -> bool {
        self.intercepts.is_empty()
    }

    /// The effects of unit pulses, at lags 0 to `horizon`.
    pub fn effects(&self, horizon: usize) -> Vec<Array2<f64>> {
        self.effects_without(horizon, None)
    }

    /// The effects that do not pass through `mediator`.
    pub fn effects_around(&self, mediator: usize, horizon: usize) -> Vec<Array2<f64>> {
        self.effects_without(horizon, Some(mediator))
    }

    fn effects_without(&self, horizon: usize, mediator: Option<usize>) -> Vec<Array2<f64>> {
        let n = self.len();
        let mut effects: Vec<Array2<f64>> = Vec::with_capacity(horizon + 1);
        for lag in 0..=horizon {
            let mut now = if lag == 0 { Array2::eye(n) } else { Array2::zeros((n, n)) };
            for s in 1..=lag.min(self.coefficients.len().saturating_sub(1)) {
                now = now + self.coefficients[s].dot(&effects[lag - s]);
            }
            if let Some(k) = mediator {
                let own = f64::from(lag == 0);
                (0..n).for_each(|i| now[[k, i]] = if i == k { own } else { 0.0 });
            }
            // (I - Phi_0)^-1, by substitution in the order of lag 0.
            for (position, &j) in self.order.iter().enumerate() {
                if mediator == Some(j) {
                    continue;
                }
                for &i in &self.order[..position] {
                    let b = self.coefficients[0][[j, i]];
                    if b != 0.0 {
                        let row: Array1<f64> = &now.row(i) * b;
                        now.row_mut(j).scaled_add(1.0, &row);
                    }
                }
            }
            effects.push(now);
        }
        effects
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    /// x0 -> x1 -> x2 at lag 0 and 1, x0 -> x2 at lag 1.
    fn chain() -> LinearSystem {
        LinearSystem {
            coefficients: vec![
                array![[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]],
                array![[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.3, 2.0, 0.0]],
            ],
            intercepts: vec![0.0; 3],
            order: vec![0, 1, 2],
        }
    }

    #[test]
    fn an_effect_is_the_sum_over_paths() {
        let effects = chain().effects(3);
        assert_eq!((effects[0][[1, 0]], effects[0][[2, 0]]), (0.5, 0.0));
        assert!((effects[1][[2, 0]] - 1.3).abs() < 1e-15);
        assert_eq!(effects[2], Array2::<f64>::zeros((3, 3)));
    }

    #[test]
    fn around_a_mediator_the_direct_link_remains() {
        let around = chain().effects_around(1, 1);
        assert_eq!(around[1][[2, 0]], 0.3);
        assert_eq!(around[0][[1, 0]], 0.0);
        assert_eq!(around[0][[1, 1]], 1.0);
    }
}
