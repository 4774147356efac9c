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

/// A sentence with its settings as a surface spells them.
pub fn spelled_out(sentence: &str, spell: impl Fn(&str) -> String) -> String {
    let mut parts = sentence.split(OPEN);
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        if let Some((id, rest)) = part.split_once(CLOSE) { out += &(spell(id) + rest) } else { out += part }
    }
    out
}
