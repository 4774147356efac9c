//! Settings within sentences. One sentence goes to surfaces that spell a setting `--tau-max`, `max_lag` or `tau_max`; so it holds the
//! setting itself, and a surface spells it.

use std::fmt;

/// Around the id of a setting. Unicode reserves these two for use within a program; in a text from outside they change no more than how
/// a word is spelled.
const OPEN: char = '\u{fdd0}';
const CLOSE: char = '\u{fdd1}';

/// A setting by its id, within a sentence.
///
/// ```
/// use roscausal_discovery::{Named, spelled_out};
///
/// let sentence = format!("'tau_max.csv' is too short; lower {}", Named("tau_max"));
/// let command = spelled_out(&sentence, |id| format!("--{}", id.replace('_', "-")));
/// assert_eq!(command, "'tau_max.csv' is too short; lower --tau-max");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Named(pub &'static str);

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{OPEN}{}{CLOSE}", self.0)
    }
}

/// So many steps of `dt` seconds in words: `0.2 s`, `3 days`.
#[doc(hidden)]
pub fn time_in_words(dt: f64, steps: usize) -> String {
    let days = [(365.0, "year", 366.0), (89.0, "quarter", 92.0), (28.0, "month", 31.0), (7.0, "week", 7.0)];
    let is = |(from, _, to): &(f64, &str, f64)| (*from..=*to).contains(&(dt / 86_400.0));
    let Some((_, name, _)) = days.into_iter().chain([(1.0, "day", 1.0)]).find(is) else {
        // Three digits behind the point, or two that are not 0.
        let seconds = steps as f64 * dt;
        let digits = (1.0 - libm::log10(seconds).floor()).clamp(3.0, 12.0);
        let scale = libm::pow(10.0, digits);
        return format!("{} s", (seconds * scale).round() / scale);
    };
    format!("{steps} {name}{}", if steps == 1 { "" } else { "s" })
}

/// A sentence with its settings as a surface spells them.
pub fn spelled_out(sentence: &str, spell: impl Fn(&str) -> String) -> String {
    let mut parts = sentence.split(OPEN);
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        if let Some((id, rest)) = part.split_once(CLOSE) { out += &(spell(id) + rest) } else { out += part }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::time_in_words;

    #[test]
    fn a_time_is_said_in_units_that_people_use_and_never_as_0() {
        let day = 86_400.0;
        for (dt, steps, words) in [
            (0.1, 2, "0.2 s"),
            (1.0 / 30.0, 1, "0.033 s"),
            (5e-5, 1, "0.00005 s"),
            (4e-4, 3, "0.0012 s"),
            (3600.0, 1, "3600 s"),
            (day, 2, "2 days"),
            (31.0 * day, 1, "1 month"),
            (91.0 * day, 3, "3 quarters"),
            (0.1, 0, "0 s"),
        ] {
            assert_eq!(time_in_words(dt, steps), words);
        }
    }
}
