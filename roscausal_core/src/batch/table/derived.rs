//! Variables derived from the columns of a table: `closing = diff(dist)`.

use ndarray::{Array2, ArrayView2, s};
use roscausal_discovery::{Named, names::plain};

use super::Table;
use crate::{
    Error, Result,
    batch::expression::{Expression, Moment},
    ensure,
};

/// The definition of a variable: its name, and an expression over columns and earlier variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    name: String,
    text: String,
    /// The names in it.
    used: Vec<String>,
}

impl Derived {
    /// A definition from `name = expression`.
    ///
    /// # Errors
    /// A bad name or expression, as an error of the parameter `feature`.
    pub fn parse(definition: &str) -> Result<Self> {
        let fault = |reason: String| Error::param("feature", reason);
        let Some((name, text)) = definition.split_once('=') else {
            return Err(fault(format!(
                "'{definition}' has no '='; write name = expression, such as closing = diff(dist)"
            )));
        };
        let (name, text) = (name.trim().to_owned(), text.trim().to_owned());
        let legal = |c: char| c.is_alphanumeric() || "_-.{}\\".contains(c);
        ensure(!name.is_empty() && name.chars().all(legal), || {
            fault(format!("'{name}' is not a valid variable name; use letters, digits and '_'"))
        })?;
        let used = Expression::names_in(&text).map_err(|reason| fault(format!("{name} = {reason}")))?;
        Ok(Self { name, text, used })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The columns that these definitions need, of which those they define themselves are none.
    pub fn needed(all: &[Self]) -> Vec<String> {
        let mut needed: Vec<String> = Vec::new();
        for (place, derived) in all.iter().enumerate() {
            let own = |name: &String| all[..place].iter().any(|other| plain(&other.name) == plain(name));
            for name in derived.used.iter().filter(|name| !own(name)) {
                if !needed.contains(name) {
                    needed.push(name.clone());
                }
            }
        }
        needed
    }
}

/// A row of a table.
struct Row<'a> {
    values: ArrayView2<'a, f64>,
    time: Option<&'a [f64]>,
    row: usize,
}

impl Moment for Row<'_> {
    fn time(&self) -> f64 {
        self.time.and_then(|time| time.get(self.row)).copied().unwrap_or(f64::NAN)
    }

    fn cell(&self, column: usize) -> f64 {
        self.values.get((self.row, column)).copied().unwrap_or(f64::NAN)
    }

    fn earlier(&self, rows: usize) -> Option<Self> {
        Some(Self { row: self.row.checked_sub(rows)?, ..*self })
    }
}

impl Table {
    /// Adds the variables that are defined, in this order.
    ///
    /// # Errors
    /// A name that there is already, or an unknown column, as an error of the parameter `feature`.
    pub fn derive(&mut self, definitions: &[Derived]) -> Result<()> {
        let fault =
            |derived: &Derived, reason: &str| Error::param("feature", format!("{} = {reason}", derived.name));
        for derived in definitions {
            if self.names.iter().any(|name| plain(name) == plain(&derived.name)) {
                let reason = "...: there is a column or variable of that name already; choose another";
                return Err(fault(derived, reason));
            }
            let expression = Expression::of_columns(&derived.text, &self.names)
                .map_err(|reason| fault(derived, &reason))?;
            if expression.mentions_time() && self.time.is_none() {
                let times = Named("time_column");
                let reason = format!("...: it needs times, and the table has none; {times} names them");
                return Err(fault(derived, &reason));
            }
            let (rows, columns) = self.values.dim();
            let row = |row| Row { values: self.values.view(), time: self.time.as_deref(), row };
            let found: Vec<f64> = (0..rows).map(|at| expression.value(&row(at))).collect();
            let mut values = Array2::zeros((rows, columns + 1));
            values.slice_mut(s![.., ..columns]).assign(&self.values);
            values.column_mut(columns).iter_mut().zip(found).for_each(|(cell, value)| *cell = value);
            self.values = values;
            self.names.push(derived.name.clone());
        }
        Ok(())
    }

    /// Keeps the columns that `wanted` names, in that order: names, patterns and ranges as in
    /// [`Reading::columns`](super::Reading::columns).
    ///
    /// # Errors
    /// A name that is not there, as an error of the parameter `columns`.
    pub fn keep(&mut self, wanted: &[String]) -> Result<()> {
        let kept = Self::places(&self.names, wanted)?;
        self.values = self.values.select(ndarray::Axis(1), &kept);
        self.names = kept.iter().map(|&column| self.names[column].clone()).collect();
        Ok(())
    }

    /// The places of the columns that `wanted` chooses of these names, as [`Table::keep`].
    ///
    /// # Errors
    /// As [`Table::keep`].
    pub fn places(names: &[String], wanted: &[String]) -> Result<Vec<usize>> {
        super::columns::chosen(names, wanted, None).map_err(|reason| Error::param("columns", reason))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn parsed(definitions: &[&str]) -> Vec<Derived> {
        definitions.iter().map(|text| Derived::parse(text).expect("parses")).collect()
    }

    #[test]
    fn variables_are_derived_from_columns_and_from_each_other() {
        let values = array![[0.0, 1.0], [3.0, 4.0], [9.0, 4.0]];
        let names = ["x", "y pos"].map(str::to_owned).to_vec();
        let mut table = Table { names, values, time: Some(vec![0.0, 0.5, 1.0]), notes: Vec::new() };
        let all = parsed(&["vx = rate(x)", "twice=2*vx", "d = norm(x, \"y pos\")", "late = lag(x, 1)"]);
        assert_eq!(Derived::needed(&all), ["x", "y pos"]);
        table.derive(&all).expect("derives");
        assert_eq!(table.names, ["x", "y pos", "vx", "twice", "d", "late"]);
        assert_eq!(table.values.row(1).to_vec(), [3.0, 4.0, 6.0, 12.0, 5.0, 0.0]);
        assert!(table.values[[0, 2]].is_nan() && table.values[[0, 5]].is_nan());
        table.keep(&["d".into(), "v*".into()]).expect("keeps");
        assert_eq!((table.names.len(), table.values[[1, 0]]), (2, 5.0));
    }

    #[test]
    fn a_bad_definition_is_one_sentence() {
        let fault = |text: &str| Derived::parse(text).expect_err(text).to_string();
        assert!(fault("2 * x").contains("has no '='"));
        assert!(fault("a b = x").contains("not a valid variable name"));
        assert!(fault("a = x +").contains("is missing"));
        let table = Table { names: vec!["x".into()], values: array![[1.0]], time: None, notes: Vec::new() };
        for (text, part) in [
            ("x = x + 1", "already"),
            ("a = y", "'y' is unknown; columns: x"),
            ("a = rate(x)", "needs times"),
        ] {
            let reported = table.clone().derive(&parsed(&[text])).expect_err(text).to_string();
            assert!(reported.contains(part), "{reported}");
        }
    }
}
