//! Why did a variable change? Each variable's own surprise, and what was to be expected.
//!
//! From row `a` to row `b`: `y_b - y_a = (forecast of y_b from the rows up to a, without noise - y_a) + sum of phi_i`. `phi_i` is
//! variable i's part: the Shapley value (Shapley 1953; Budhathoki et al. 2022 for anomalies) of `v(Q)` = `y_b` when the variables in
//! Q have the noise that they had and the others none. The parts sum to the change exactly. Of linear equations
//! `phi_i = sum over t of Psi_{b-t}[y, i] e_i(t)`.
//!
//! Example: `y = x`, both without noise but for a push of 1 on x: the change of y is 1, x's part 1, y's own 0.

use crate::{
    model::{Schedule, System},
    random,
};

/// Variables for which every subset is computed; more are sampled.
const MOST_EXACT: usize = 10;
/// Orders of the variables that are sampled then.
const ORDERS: usize = 200;

/// A change, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// `y_b - y_a`.
    pub change: f64,
    /// The part that was to be expected.
    pub expected: f64,
    /// Each variable's surprise.
    pub surprises: Vec<f64>,
    /// The same by row after `a` and variable, `[row * n + variable]`; empty where the equations are not linear.
    pub by_row: Vec<f64>,
}

/// Takes the change of `y` from row `from` to the last of `rows` apart, by Shapley values.
pub fn shapley(system: &System, rows: &[f64], from: usize, y: usize, seed: u64) -> Parts {
    let n = system.len();
    let noise = system.noise(rows, from + 1);
    let free = Schedule::free(n, rows.len() / n - 1 - from);
    // y at the end when only some variables have their noise.
    let outcome = |with: &dyn Fn(usize) -> bool| {
        let mut path = rows[..(from + 1) * n].to_vec();
        system.run(&mut path, &free, |step, var| if with(var) { noise[step * n + var] } else { 0.0 });
        path[path.len() - n + y]
    };
    let change = rows[rows.len() - n + y] - rows[from * n + y];
    let nothing = outcome(&|_| false);
    // Only what drives y, within the rows, has a part.
    let players = drivers(system, y);
    let mut surprises = vec![0.0; n];
    if players.len() <= MOST_EXACT {
        let m = players.len();
        let place = |var: usize| players.iter().position(|&player| player == var);
        let value = |subset: usize| outcome(&|var| place(var).is_some_and(|k| subset >> k & 1 == 1));
        let values: Vec<f64> = (0..1_usize << m).map(value).collect();
        for (k, &player) in players.iter().enumerate() {
            for subset in (0..1_usize << m).filter(|subset| subset >> k & 1 == 0) {
                let weight = 1.0 / (m as f64 * binomial(m - 1, subset.count_ones() as usize));
                surprises[player] += weight * (values[subset | 1 << k] - values[subset]);
            }
        }
    } else {
        for turn in 0..ORDERS {
            let mut order = players.clone();
            for i in (1..order.len()).rev() {
                order.swap(i, random::below(random::at(seed, turn, i), i + 1));
            }
            let mut before = nothing;
            for k in 0..order.len() {
                let now = outcome(&|var| order[..=k].contains(&var));
                surprises[order[k]] += (now - before) / ORDERS as f64;
                before = now;
            }
        }
    }
    Parts { change, expected: nothing - rows[from * n + y], surprises, by_row: Vec::new() }
}

/// The same for linear equations: by variable and by row, in one pass.
pub fn linear(system: &System, rows: &[f64], from: usize, y: usize) -> Parts {
    let n = system.len();
    let steps = rows.len() / n - 1 - from;
    let noise = system.noise(rows, from + 1);
    let free = Schedule::free(n, steps);
    let end = |source: Option<(usize, usize)>| {
        let mut path = rows[..(from + 1) * n].to_vec();
        system.run(&mut path, &free, |step, var| f64::from(source == Some((step, var))));
        path[path.len() - n + y]
    };
    let forecast = end(None);
    let mut by_row = vec![0.0; steps * n];
    let mut surprises = vec![0.0; n];
    for step in 0..steps {
        for var in drivers(system, y) {
            let part = (end(Some((step, var))) - forecast) * noise[step * n + var];
            by_row[step * n + var] = part;
            surprises[var] += part;
        }
    }
    let change = rows[rows.len() - n + y] - rows[from * n + y];
    Parts { change, expected: forecast - rows[from * n + y], surprises, by_row }
}

/// `y` and whatever drives it, in order of number.
pub(crate) fn drivers(system: &System, y: usize) -> Vec<usize> {
    let mut seen = vec![false; system.len()];
    let mut open = vec![y];
    while let Some(var) = open.pop() {
        if !std::mem::replace(&mut seen[var], true)
            && let Some(equation) = &system.equations[var]
        {
            open.extend(equation.parents.iter().map(|parent| parent.var));
        }
    }
    (0..seen.len()).filter(|&var| seen[var]).collect()
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}
