//! The settings of an analysis: one entry each in [`SETTINGS`], from which the command's flags, the discovery node's parameters,
//! Python's keywords and the refusals come.

mod check;
mod links;
mod plain;
mod request;
mod scheme;
mod table;
#[cfg(test)]
mod tests;
mod typed;

use serde_json::{Value, json};

pub use links::LinkRules;
pub use request::Request;
pub use scheme::{Block, FEWEST_RESAMPLES, MOST_RESAMPLES, Resampling, Scheme};
pub(crate) use scheme::{FEWEST_BLOCKS, FEWEST_ROWS};
pub use table::SETTINGS;
pub use typed::{Levels, PcAlpha, Settings};

use crate::{
    independence_tests::{self, Significance, spelled},
    methods::{Method, MethodInfo, Reads},
    types::{Error, Named, Result, text::listed},
};

/// One setting, for all surfaces.
#[derive(Debug)]
pub struct Setting {
    /// Its name in Rust and Python, and in errors.
    pub id: &'static str,
    /// The command's flag, without dashes. A flag without a value gives the value that is not the default.
    pub flag: &'static str,
    /// The discovery node's parameter.
    pub param: &'static str,
    /// What it holds.
    pub kind: Kind,
    /// Unit of the value; empty: none.
    pub unit: &'static str,
    /// What it is, in one line.
    pub help: &'static str,
    /// What the command's `discover` does for the word `auto`; empty: it has no such word.
    pub auto: &'static str,
    /// What happens where it is not set; empty: its default is a value.
    pub unset: &'static str,
    /// The node's value for "not set"; a node's parameter has a value always.
    pub param_unset: &'static str,
    /// Its default with a method, where it differs between them.
    pub by_method: Option<fn(&MethodInfo) -> String>,
    /// What it is about.
    pub group: Group,
    /// Whether few need it.
    pub expert: bool,
    /// Whether it describes the analysis, so that settings that come with data may set it.
    pub of_data: bool,
    /// The most that settings that come with data may ask for: a few times what anybody needs of what only costs time.
    pub most_of_data: f64,
    /// Who reads it.
    pub readers: Readers,
    /// Its value; null: not set.
    pub get: fn(&Request) -> Value,
    set: fn(&mut Request, &Value) -> Result<()>,
}

/// What a setting holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// True or false.
    Flag,
    /// A whole number between these two, both included.
    Count(u64, u64),
    /// A number of steps; the settings say how many are too many.
    Lag,
    /// A number between these two; it may be neither.
    Number(f64, f64),
    /// As [`Kind::Number`], or this word.
    NumberOr(f64, f64, &'static str),
    /// A number of bytes; the command and the node write megabytes.
    Bytes,
    /// One of these words.
    Word(&'static [&'static str]),
    /// The name of a method, in any spelling.
    Method,
    /// The name of a test, in any spelling.
    Test,
    /// Any text.
    Text,
    /// Texts of this form, separated by commas.
    List(&'static str),
    /// The content of a file that ends so. A surface reads it.
    File(&'static str),
}

/// What a setting is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// How the analysis is done.
    Method,
    /// The seed of all random numbers, which is one for whatever a subcommand does.
    Seed,
    /// Analyses of resamples.
    Resampling,
    /// What one run may take.
    Run,
}

/// Who reads a setting. `why` says of those who do not: `granger uses no independence test`.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs, reason = "the fields are said above")]
pub enum Readers {
    /// Every method.
    All,
    /// The methods whose entry in the registry names it.
    Named(Reads, &'static str),
    /// Some methods; another setting does it for those who do not read it.
    Methods { read: fn(&MethodInfo) -> bool, why: &'static str, instead: Option<&'static str> },
    /// Some tests, with the methods that use one for this.
    Tests { method: fn(Method) -> bool, test: fn(&str, Option<Significance>) -> bool, why: &'static str },
}

/// The setting with this name in Rust and Python, as a flag or as a node's parameter.
pub fn setting(name: &str) -> Option<&'static Setting> {
    let spelled = [|s: &Setting| s.id, |s: &Setting| s.flag, |s: &Setting| s.param];
    spelled.iter().find_map(|spell| SETTINGS.iter().find(|setting| spell(setting) == name))
}

/// Whether two texts are the same word or number: 0.0 is 0.
fn is_same(one: &str, other: &str) -> bool {
    match (one.parse::<f64>(), other.parse::<f64>()) {
        (Ok(one), Ok(other)) => one == other,
        _ => one == other,
    }
}

impl Setting {
    /// Puts a value in; null leaves it as it is.
    ///
    /// # Errors
    /// A value of another kind, or one that is not allowed.
    pub fn put(&self, request: &mut Request, value: &Value) -> Result<()> {
        if value.is_null() {
            return Ok(());
        }
        self.kind.check(value).map_err(|reason| Error::param(self.id, reason))?;
        (self.set)(request, value).map_err(|error| match error {
            Error::Param { reason, .. } => Error::param(self.id, reason),
            other => other,
        })
    }

    /// Whether a request differs from the default of its method here.
    pub(crate) fn is_given(&self, request: &Request) -> bool {
        (self.get)(request) != (self.get)(&Request::of_method(request.settings.method))
    }

    /// Whether a method reads it, with some test. What is held against a threshold is held against alpha, whatever the method.
    pub fn method_reads(&self, method: Method, how: Option<Significance>) -> bool {
        match self.readers {
            Readers::All => true,
            Readers::Named(what, _) => method.reads(what),
            Readers::Methods { .. } if self.id == "alpha" && how == Some(Significance::FixedThres) => true,
            Readers::Methods { read, .. } => read(method.info()),
            Readers::Tests { method: uses, .. } => uses(method),
        }
    }

    /// Whether a test reads it, or no test needs to.
    pub fn test_reads(&self, test: &str, how: Option<Significance>) -> bool {
        if let Readers::Tests { test: reads, .. } = self.readers { reads(&spelled(test), how) } else { true }
    }

    /// Why this method with this test does not read it; `None`: it does.
    pub fn refusal(&self, method: Method, test: &str, how: Option<Significance>) -> Option<String> {
        let by_method = self.method_reads(method, how);
        if by_method && self.test_reads(test, how) {
            return None;
        }
        let shuffle = Some(Significance::ShuffleTest);
        let way = match self.readers {
            Readers::Tests { .. } if by_method && self.test_reads(test, shuffle) => {
                format!(", or with {} shuffle", Named("significance"))
            }
            _ => String::new(),
        };
        let why = match self.readers {
            Readers::All => return None,
            Readers::Named(_, why) => format!("{method} {why}"),
            // Its level is a p-value's.
            Readers::Methods { instead: Some(_), .. } if !method.info().p_values => {
                format!("{method} gives no p-values")
            }
            Readers::Methods { why, instead, .. } => {
                let instead = instead.map_or(String::new(), |other| format!(" ({})", Named(other)));
                format!("{method} {why}{instead}")
            }
            Readers::Tests { why, .. } if by_method => format!("{} {why}", spelled(test)),
            Readers::Tests { .. } if method.info().uses_test => format!("{method} uses no p-value of a test"),
            Readers::Tests { .. } => format!("{method} uses no independence test"),
        };
        Some(format!("{why}; it applies to {}{way}", self.readers()))
    }

    /// Who reads it, in words: `fpcmci and pcmci`, `the test gpdc`.
    pub fn readers(&self) -> String {
        match self.readers {
            Readers::All => "all methods".to_owned(),
            Readers::Named(what, _) => Method::names_that_read(what),
            Readers::Methods { read, .. } => {
                let reading = Method::all().filter(|method| read(method.info())).map(Method::name);
                listed(&reading.collect::<Vec<_>>())
            }
            Readers::Tests { test, .. } => {
                let reading: Vec<_> = independence_tests::names().filter(|name| test(name, None)).collect();
                let word = if reading.len() == 1 { "test" } else { "tests" };
                match reading.len() {
                    n if n == independence_tests::names().count() => "all tests".to_owned(),
                    _ => format!("the {word} {}", listed(&reading)),
                }
            }
        }
    }

    /// Reads a value as people write it.
    ///
    /// # Errors
    /// A text of another kind, in words without the setting's name.
    pub fn read(&self, text: &str) -> std::result::Result<Value, String> {
        let value = match self.kind {
            Kind::Flag => text.parse::<bool>().ok().map(Value::from),
            Kind::Count(..) | Kind::Lag => text.parse::<u64>().ok().map(Value::from),
            Kind::Bytes => text.parse::<u64>().ok().map(|mega| Value::from(mega.saturating_mul(1_000_000))),
            Kind::NumberOr(.., word) if [word, "none"].contains(&text) => Some(word.into()),
            Kind::Number(..) | Kind::NumberOr(..) => text.parse::<f64>().ok().map(Value::from),
            Kind::List(_) => {
                let items = text.split(',').map(str::trim).filter(|item| !item.is_empty());
                Some(items.collect::<Vec<_>>().into())
            }
            Kind::Word(_) | Kind::Method | Kind::Test | Kind::Text | Kind::File(_) => Some(text.into()),
        };
        let value = value.filter(|value| !value.is_null());
        let value = value.ok_or_else(|| format!("'{text}' is not {}", self.kind.wanted()))?;
        self.kind.check(&value).map(|()| value)
    }

    /// Reads the value of a node's parameter; null: it says "not set".
    ///
    /// # Errors
    /// As [`Setting::read`].
    pub fn of_param(&self, text: &str) -> std::result::Result<Value, String> {
        let plain = text.trim_matches(['[', ']']);
        if plain.is_empty() || is_same(plain, self.param_unset) {
            return Ok(Value::Null);
        }
        match self.kind {
            // No level is 0.
            Kind::NumberOr(.., word) if is_same(plain, "0") => Ok(word.into()),
            _ => self.read(plain),
        }
    }

    /// The value as the node's parameter has it.
    pub fn as_param(&self, value: &Value) -> String {
        match self.kind {
            Kind::NumberOr(.., word) if value == word => "0".to_owned(),
            _ if value.is_null() => self.param_unset.to_owned(),
            _ => self.written(value),
        }
    }

    /// A value as people write it; what [`Setting::read`] reads.
    pub fn written(&self, value: &Value) -> String {
        match value {
            Value::String(text) => text.clone(),
            Value::Array(items) => {
                let texts = items.iter().map(|item| item.as_str().map_or(item.to_string(), str::to_owned));
                texts.collect::<Vec<_>>().join(",")
            }
            Value::Number(n) if self.kind == Kind::Bytes => {
                n.as_u64().map_or(n.to_string(), |bytes| (bytes / 1_000_000).to_string())
            }
            Value::Null => String::new(),
            other => other.to_string(),
        }
    }

    /// The default; null: there is none, and [`Setting::unset`] says what happens.
    pub fn default_value(&self) -> Value {
        (self.get)(&Request::default())
    }

    /// The default of most methods, then that of each other one, by name; without methods what happens where it is not set.
    pub fn default_words(&self) -> String {
        let Some(of) = self.by_method else { return self.unset.to_owned() };
        let usual = of(Method::default().info());
        let others = Method::all().map(Method::info).filter(|info| of(info) != usual);
        others.fold(usual.clone(), |text, info| format!("{text}, {} {}", info.name, of(info)))
    }
}

impl Kind {
    /// The words that there are, where they are all that is allowed.
    pub fn words(&self) -> Vec<&'static str> {
        match self {
            Self::Word(words) => words.to_vec(),
            Self::Method => Method::names().collect(),
            Self::Test => independence_tests::names().filter(|name| *name != "gpdcpython").collect(),
            _ => Vec::new(),
        }
    }

    /// What is wanted, after "is not".
    fn wanted(&self) -> String {
        match self {
            Self::Flag => "true or false".into(),
            Self::Count(least, most) => format!("a whole number from {least} to {most}"),
            Self::Number(least, f64::INFINITY) => format!("a number above {least}"),
            Self::Number(least, most) => format!("a number between {least} and {most}"),
            Self::NumberOr(least, most, word) => {
                format!("a number between {least} and {most}, or '{word}'")
            }
            Self::Bytes | Self::Lag => "a whole number of 0 or more".into(),
            Self::Word(words) => format!("one of {}", words.join(", ")),
            Self::Method | Self::Test | Self::Text | Self::File(_) => "a word".into(),
            Self::List(form) => format!("a list of {form}"),
        }
    }

    fn check(&self, value: &Value) -> std::result::Result<(), String> {
        let fits = match self {
            Self::Flag => value.is_boolean(),
            Self::Count(least, most) => value.as_u64().is_some_and(|n| (*least..=*most).contains(&n)),
            Self::Bytes | Self::Lag => value.is_u64(),
            // Whether it lies between the two, the settings check: they have words for it.
            Self::Number(..) => value.is_number(),
            Self::NumberOr(.., word) => value.is_number() || value == word,
            Self::Text => value.is_string() || value.is_u64(),
            // An unknown word is an error with the nearest known one.
            Self::Word(_) | Self::Method | Self::Test => value.is_string(),
            Self::List(_) => value.is_array() || value.is_object(),
            Self::File(_) => true,
        };
        if fits { Ok(()) } else { Err(format!("{value} is not {}", self.wanted())) }
    }
}

/// The table as JSON, for a surface in another language: id, words, default and help of each setting.
///
/// ```
/// use roscausal_discovery::settings;
///
/// let all = settings::as_json();
/// assert!(all.as_array().is_some_and(|all| all.iter().any(|one| one["id"] == "gp_restarts")));
/// ```
pub fn as_json() -> Value {
    let one = |setting: &Setting| {
        json!({
            "id": setting.id, "words": setting.kind.words(), "default": setting.default_value(), "help": setting.help,
            "unset": setting.unset, "readers": setting.readers(),
        })
    };
    SETTINGS.iter().map(one).collect()
}
