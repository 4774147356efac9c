//! Equations that are computed one after the other, step by step, with or without interventions.

use std::sync::Arc;

use super::equation::Equation;

/// What is imposed on which variable at which step.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    n: usize,
    /// What is acted on, also by a shift of 0.
    touched: Vec<bool>,
    /// `[step * n + var]`: the value that is set, or NaN.
    set: Vec<f64>,
    /// What is added to the value that would be.
    shift: Vec<f64>,
}

impl Schedule {
    /// Nothing imposed on `n` variables for `steps` steps.
    pub fn free(n: usize, steps: usize) -> Self {
        let cells = n * steps;
        Self { n, touched: vec![false; cells], set: vec![f64::NAN; cells], shift: vec![0.0; cells] }
    }

    /// Sets a variable at a step (0: the first); what does not exist is left alone.
    pub fn set(&mut self, step: usize, var: usize, value: f64) {
        if let Some(cell) = self.set.get_mut(step * self.n + var) {
            *cell = value;
            self.touched[step * self.n + var] = true;
        }
    }

    /// Shifts a variable at a step.
    pub fn shift(&mut self, step: usize, var: usize, by: f64) {
        if let Some(cell) = self.shift.get_mut(step * self.n + var) {
            *cell += by;
            self.touched[step * self.n + var] = true;
        }
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.set.len() / self.n.max(1)
    }

    /// Whether a variable is set at a step.
    pub fn is_set(&self, step: usize, var: usize) -> bool {
        !self.set[step * self.n + var].is_nan()
    }

    /// Whether a variable is set at all steps: then its equation is not asked.
    pub(crate) fn is_always_set(&self, var: usize) -> bool {
        (0..self.steps()).all(|step| self.is_set(step, var))
    }

    /// The value that a variable is set to at a step.
    pub fn value(&self, step: usize, var: usize) -> Option<f64> {
        let value = self.set[step * self.n + var];
        (!value.is_nan()).then_some(value)
    }

    /// What is added to a variable at a step.
    pub fn moved(&self, step: usize, var: usize) -> f64 {
        self.shift[step * self.n + var]
    }

    /// Whether a variable is set or shifted at a step.
    pub fn touches(&self, step: usize, var: usize) -> bool {
        self.touched.get(step * self.n + var).copied().unwrap_or(false)
    }

    /// The variables that are acted on.
    pub(crate) fn acting(&self) -> Vec<usize> {
        let is = |var: &usize| (0..self.steps()).any(|step| self.touches(step, *var));
        (0..self.n).filter(is).collect()
    }

    /// Whether anything is acted on.
    pub fn is_free(&self) -> bool {
        !self.touched.contains(&true)
    }
}

/// The equations of all variables; one that could not be fitted gives NaN.
#[derive(Clone, Debug)]
pub struct System {
    /// By variable.
    pub equations: Vec<Option<Arc<Equation>>>,
    /// Variables, causes at lag 0 first.
    pub order: Vec<usize>,
    /// Rows of the past that the equations read.
    pub memory: usize,
}

impl System {
    /// Number of variables.
    pub fn len(&self) -> usize {
        self.equations.len()
    }

    /// Whether there is no variable.
    pub fn is_empty(&self) -> bool {
        self.equations.is_empty()
    }

    /// The expected value of `var` at row `t` of `rows`, which are one after the other.
    pub fn expected(&self, rows: &[f64], t: usize, var: usize, scratch: &mut Vec<f64>) -> f64 {
        let Some(equation) = &self.equations[var] else { return f64::NAN };
        self.parents(rows, t, equation, scratch);
        equation.mean(scratch)
    }

    /// The parents' values of an equation at row `t`.
    pub(crate) fn parents(&self, rows: &[f64], t: usize, equation: &Equation, values: &mut Vec<f64>) {
        let n = self.len();
        values.clear();
        values.extend(equation.parents.iter().map(|parent| rows[(t - parent.lag) * n + parent.var]));
    }

    /// Continues `rows`, which begin with the past, by the steps of a schedule: `x := f(parents) + noise(step, var)`, and what is
    /// imposed. At least [`System::memory`] rows of the past are there.
    pub fn run(&self, rows: &mut Vec<f64>, schedule: &Schedule, mut noise: impl FnMut(usize, usize) -> f64) {
        let n = self.len();
        let past = rows.len() / n;
        let mut scratch = Vec::new();
        rows.resize((past + schedule.steps()) * n, f64::NAN);
        for step in 0..schedule.steps() {
            for &var in &self.order {
                let mut value = schedule.set[step * n + var];
                if !schedule.is_set(step, var) {
                    let expected = self.expected(rows, past + step, var, &mut scratch);
                    value = expected + noise(step, var) + schedule.moved(step, var);
                }
                rows[(past + step) * n + var] = value;
            }
        }
    }

    /// The noise that rows had: `e = x - f(parents)`, from row `first` on, one row after the other.
    pub fn noise(&self, rows: &[f64], first: usize) -> Vec<f64> {
        let n = self.len();
        let mut scratch = Vec::new();
        let mut noise = Vec::with_capacity(rows.len().saturating_sub(first * n));
        for t in first..rows.len() / n {
            noise.extend((0..n).map(|var| rows[t * n + var] - self.expected(rows, t, var, &mut scratch)));
        }
        noise
    }
}
