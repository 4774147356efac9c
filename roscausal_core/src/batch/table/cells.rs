//! Cells as numbers.

use std::collections::BTreeMap;

/// Words for a missing value, in lower case.
const MISSING: [&str; 20] = [
    "", "nan", "na", "n/a", "null", "none", "-", "?", "#n/a", "nat", "--", ".", "<na>", "#na", "#div/0!",
    "#value!", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan",
];

/// How the cells of a file are read.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells<'a> {
    /// Numbers that stand for a missing value.
    pub(super) missing: &'a [f64],
    /// The comma is the decimal point.
    pub(super) decimal_comma: bool,
    /// Words are turned into codes where a column has them.
    pub(super) encode: bool,
}

impl Cells<'_> {
    /// A cell as a number; missing is NaN; `None` for a word.
    ///
    /// # Errors
    /// An infinite value.
    pub(super) fn number(&self, cell: &str) -> Result<Option<f64>, ()> {
        // Most cells are plain numbers.
        let value = match cell.parse::<f64>() {
            Ok(value) if value.is_finite() => Some(value),
            Ok(value) if value.is_nan() => return Ok(Some(f64::NAN)),
            Ok(_) => return Err(()),
            Err(_) => self.other(cell),
        };
        Ok(value.map(|value| if self.missing.contains(&value) { f64::NAN } else { value }))
    }

    /// Missing values, truth values, decimal commas, thin spaces.
    fn other(&self, cell: &str) -> Option<f64> {
        let text = cell.trim();
        if MISSING.iter().any(|word| text.eq_ignore_ascii_case(word)) {
            return Some(f64::NAN);
        }
        let truths = [("true", 1.0), ("false", 0.0), ("yes", 1.0), ("no", 0.0), ("on", 1.0), ("off", 0.0)];
        if let Some((_, value)) = truths.into_iter().find(|(word, _)| text.eq_ignore_ascii_case(word)) {
            return Some(value);
        }
        if text.len() != cell.len() {
            return self.number(text).ok().flatten();
        }
        let (before, after) = text.split_once(',')?;
        // 1,234 may be a thousand where commas separate the cells.
        let thousands = after.len() == 3 && !self.decimal_comma;
        if thousands || after.contains(',') {
            return None;
        }
        let before = if self.decimal_comma { before.replace(['.', '\u{a0}'], "") } else { before.to_owned() };
        format!("{before}.{after}").parse().ok().filter(|value: &f64| value.is_finite())
    }
}

/// The words of one column and their codes, in the order of their first row.
#[derive(Clone, Debug, Default)]
pub(super) struct Codes {
    codes: BTreeMap<String, usize>,
}

impl Codes {
    /// The code of a word.
    pub(super) fn of(&mut self, word: &str) -> f64 {
        let next = self.codes.len();
        *self.codes.entry(word.to_owned()).or_insert(next) as f64
    }

    /// The final code of each code given so far: words in alphabetical order count from 0.
    pub(super) fn sorted(&self) -> Vec<f64> {
        let mut sorted = vec![0.0; self.codes.len()];
        for (place, code) in self.codes.values().enumerate() {
            sorted[*code] = place as f64;
        }
        sorted
    }

    /// The words in the order of their final codes.
    pub(super) fn words(&self) -> Vec<String> {
        self.codes.keys().cloned().collect()
    }

    /// `0 idle, 1 walk`.
    pub(super) fn reported(words: &[String]) -> String {
        const MOST: usize = 12;
        let mut reported: Vec<String> =
            words.iter().take(MOST).enumerate().map(|(code, word)| format!("{code} {word}")).collect();
        if words.len() > MOST {
            reported.push("...".into());
        }
        reported.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_many_spellings() {
        let comma = Cells { decimal_comma: true, ..Cells::default() };
        for (cell, value) in [
            ("1.5", 1.5),
            ("1,5", 1.5),
            (" 2 ", 2.0),
            ("True", 1.0),
            ("no", 0.0),
            ("On", 1.0),
            ("-1e3", -1000.0),
        ] {
            assert_eq!(Cells::default().number(cell), Ok(Some(value)), "{cell}");
        }
        assert_eq!(comma.number("1.234,5"), Ok(Some(1234.5)));
        assert_eq!(comma.number("1,234"), Ok(Some(1.234)));
        assert_eq!(Cells::default().number("1,234"), Ok(None));
        assert_eq!((Cells::default().number("fast"), Cells::default().number("inf")), (Ok(None), Err(())));
    }

    #[test]
    fn missing_values_have_many_names() {
        let cells = Cells { missing: &[-999.0], ..Cells::default() };
        for cell in [
            "", "NaN", "NA", "n/a", "null", "None", "-", "--", ".", "?", "<NA>", "#DIV/0!", "-1.#IND",
            "-999", "-999.0", "NaT",
        ] {
            assert!(matches!(cells.number(cell), Ok(Some(value)) if value.is_nan()), "{cell}");
        }
        assert_eq!(Cells::default().number("-999"), Ok(Some(-999.0)));
    }

    #[test]
    fn words_are_counted_in_alphabetical_order() {
        let mut codes = Codes::default();
        assert_eq!(["walk", "idle", "walk", "run"].map(|word| codes.of(word)), [0.0, 1.0, 0.0, 2.0]);
        assert_eq!(codes.sorted(), [2.0, 0.0, 1.0]);
        assert_eq!(Codes::reported(&codes.words()), "0 idle, 1 run, 2 walk");
    }
}
