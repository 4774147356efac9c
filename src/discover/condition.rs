//! `--where`: comparisons of columns and numbers, joined by `and`.

use std::str::FromStr;

use ndarray::ArrayView1;
use roscausal_core::Result;

/// The comparisons, the longer symbols first.
const SYMBOLS: [&str; 6] = ["<=", ">=", "==", "!=", "<", ">"];

/// Whether a row fulfils a condition.
pub(super) type Test = Box<dyn Fn(ArrayView1<'_, f64>) -> bool>;

/// A condition on a row: all comparisons hold. A missing value fulfils none.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Condition(Vec<(Term, &'static str, Term)>);

#[derive(Clone, Debug, PartialEq)]
enum Term {
    Number(f64),
    Column(String),
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let comparison = |part: &str| {
            let found = SYMBOLS.iter().filter_map(|symbol| Some((part.find(symbol)?, *symbol)));
            let (at, symbol) = found.min_by_key(|(at, symbol)| (*at, 2 - symbol.len()))?;
            let (left, right) = (part[..at].trim(), part[at + symbol.len()..].trim());
            (!left.is_empty() && !right.is_empty()).then(|| (term(left), symbol, term(right)))
        };
        let parts = text.split(" and ").flat_map(|part| part.split("&&"));
        let parts: Option<Vec<_>> = parts.map(comparison).collect();
        let reason = "give comparisons joined by 'and', such as 'near < 3 and r_v > 0'";
        parts.map(Self).ok_or_else(|| reason.into())
    }
}

fn term(text: &str) -> Term {
    text.parse().map_or_else(|_| Term::Column(text.to_owned()), Term::Number)
}

impl Condition {
    /// The columns in it.
    pub(super) fn columns(&self) -> impl Iterator<Item = &str> {
        self.0.iter().flat_map(|(left, _, right)| [left, right]).filter_map(|term| match term {
            Term::Column(name) => Some(name.as_str()),
            Term::Number(_) => None,
        })
    }

    /// The condition as a function of a row; `column` finds the place of a name.
    pub(super) fn on(&self, column: impl Fn(&str) -> Result<usize>) -> Result<Test> {
        // A number, or the place of a column.
        let placed = |term: &Term| match term {
            Term::Number(number) => Ok((Some(*number), 0)),
            Term::Column(name) => column(name).map(|place| (None, place)),
        };
        let parts = self.0.iter().map(|(left, symbol, right)| Ok((placed(left)?, *symbol, placed(right)?)));
        let parts = parts.collect::<Result<Vec<_>>>()?;
        Ok(Box::new(move |row: ArrayView1<'_, f64>| {
            parts.iter().all(|((left, a), symbol, (right, b))| {
                let (left, right) = (left.unwrap_or_else(|| row[*a]), right.unwrap_or_else(|| row[*b]));
                match *symbol {
                    "<=" => left <= right,
                    ">=" => left >= right,
                    "==" => left == right,
                    "!=" => left != right && !left.is_nan() && !right.is_nan(),
                    "<" => left < right,
                    _ => left > right,
                }
            })
        }))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn comparisons_are_joined_by_and_and_a_missing_value_fulfils_none() {
        let place = |name: &str| Ok(["a", "b"].iter().position(|other| *other == name).expect("is there"));
        for (text, expected) in [
            ("a < 3", [true, false, false]),
            ("a<=3 and b!=0", [true, false, false]),
            ("a >= b", [false, true, false]),
            ("b > -1 && 2 == b", [true, false, false]),
        ] {
            let condition = text.parse::<Condition>().expect(text).on(place).expect("columns");
            let rows = array![[1.0, 2.0], [3.0, 0.0], [f64::NAN, f64::NAN]];
            let found: Vec<bool> = rows.rows().into_iter().map(&condition).collect();
            assert_eq!(found, expected, "{text}");
        }
        for wrong in ["", "a", "a <", "> 3", "a < 3 or"] {
            assert!(wrong.parse::<Condition>().is_err() || wrong.ends_with("or"), "{wrong}");
        }
    }
}
