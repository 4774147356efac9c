//! The flags of settings, made from the table of settings.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use clap::{Arg, ArgAction, ArgMatches, parser::ValueSource};
use roscausal_core::{Error, Result, bounded};
use roscausal_discovery::settings::{Group, Kind, Request, SETTINGS, Setting};
use serde_json::Value;

/// The word for `--method` that asks for advice, and for `--tau-max` that takes it.
pub(crate) const AUTO: &str = "auto";

/// Settings that were given as flags, and their texts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Given(Vec<(&'static Setting, String)>);

impl Given {
    /// The text of a setting, if it was given.
    pub(crate) fn text(&self, id: &str) -> Option<&str> {
        self.0.iter().find(|(setting, _)| setting.id == id).map(|(_, text)| text.as_str())
    }

    /// The number of a setting, if it was given.
    pub(crate) fn number<T: FromStr>(&self, id: &str) -> Option<T> {
        self.text(id)?.parse().ok()
    }

    /// The first one that was given.
    pub(crate) fn first(&self) -> Option<&'static Setting> {
        self.0.first().map(|(setting, _)| *setting)
    }

    /// Only those that `keep` says.
    pub(crate) fn only(&self, keep: impl Fn(&Setting) -> bool) -> Self {
        Self(self.0.iter().filter(|(setting, _)| keep(setting)).cloned().collect())
    }

    /// With the setting as if it were given.
    pub(crate) fn with(&self, setting: &'static Setting, text: &str) -> Self {
        let mut given = self.only(|other| other.id != setting.id);
        given.0.push((setting, text.to_owned()));
        given
    }

    /// The files that are given, by their setting.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&'static Setting, PathBuf)> {
        let named = self.0.iter().filter(|(setting, _)| matches!(setting.kind, Kind::File(_)));
        named.map(|(setting, text)| (*setting, PathBuf::from(text)))
    }

    /// All values.
    ///
    /// # Errors
    /// A value that is not allowed on its own, or a file that cannot be read.
    pub(crate) fn request(&self) -> Result<Request> {
        let value = |(setting, text): &(&'static Setting, String)| {
            let value = match setting.kind {
                Kind::File(ending) => bounded::read_setting(Path::new(text), ending)?.into(),
                // A flag without a value says the other one.
                Kind::Flag => Value::Bool(setting.default_value() == false),
                _ => setting.read(text).map_err(|reason| Error::param(setting.id, reason))?,
            };
            Ok((*setting, value))
        };
        let values = self.0.iter().map(value).collect::<Result<Vec<_>>>()?;
        Request::of(&values).map_err(|error| Error::of_rules(error, self.links()))
    }

    /// The file of what is known of links.
    pub(crate) fn links(&self) -> Option<PathBuf> {
        self.text("links").map(PathBuf::from)
    }
}

/// The flags of the settings in some groups.
pub(crate) fn flags(groups: &'static [Group]) -> impl Iterator<Item = Arg> {
    SETTINGS.iter().filter(|setting| groups.contains(&setting.group)).map(flag)
}

fn flag(setting: &'static Setting) -> Arg {
    let heading = match setting.group {
        _ if setting.expert => "For experts",
        Group::Method | Group::Seed => "Method",
        Group::Resampling => "Confidence",
        Group::Run => "Output",
    };
    let arg = Arg::new(setting.id).long(setting.flag).help_heading(heading);
    let words = setting.kind.words();
    let mut help = setting.help.to_owned();
    if !words.is_empty() {
        help += &format!(": {}", words.join(", "));
    }
    if !setting.auto.is_empty() {
        help += &format!("; for `discover` also {AUTO}: {}", setting.auto);
    }
    let (default, words) = (setting.written(&setting.default_value()), setting.default_words());
    match words.is_empty() {
        false => help += &format!(". Default: {words}"),
        true if !default.is_empty() && setting.kind != Kind::Flag => {
            help += &format!(" [default: {default}]")
        }
        true => {}
    }
    if setting.kind == Kind::Flag {
        let off = if setting.default_value() == true { "Switch off: " } else { "" };
        return arg.action(ArgAction::SetTrue).help(format!("{off}{help}"));
    }
    let check = move |text: &str| match setting.kind {
        Kind::File(_) | Kind::List(_) => Ok(text.to_owned()),
        _ if text == AUTO && !setting.auto.is_empty() => Ok(text.to_owned()),
        _ => setting.read(text).map(|_| text.to_owned()),
    };
    let arg = arg.help(help).value_parser(check).action(ArgAction::Set).value_name(value_name(setting));
    match setting.kind {
        Kind::Number(..) | Kind::NumberOr(..) => arg.allow_negative_numbers(true),
        Kind::List(_) => arg.value_delimiter(',').action(ArgAction::Append),
        // A correction or none: the flag alone means the usual one.
        Kind::Word(["none", usual, ..]) => arg.num_args(0..=1).default_missing_value(*usual),
        _ => arg,
    }
}

/// What the help calls a flag's value.
fn value_name(setting: &Setting) -> &'static str {
    match setting.kind {
        _ if !setting.unit.is_empty() => setting.unit,
        Kind::List(form) => form,
        Kind::File("toml") => "FILE.toml",
        Kind::File(_) => "FILE.csv",
        Kind::Count(..) | Kind::Lag | Kind::Bytes => "N",
        Kind::Number(..) | Kind::NumberOr(..) => "NUMBER",
        Kind::Flag | Kind::Word(_) | Kind::Method | Kind::Test | Kind::Text => "NAME",
    }
}

/// The settings in some groups that were given.
pub(crate) fn given(matches: &ArgMatches, groups: &[Group]) -> Given {
    let texts = |setting: &'static Setting| {
        if matches.value_source(setting.id) != Some(ValueSource::CommandLine) {
            return None;
        }
        let text = match setting.kind {
            Kind::Flag => String::new(),
            _ => {
                let all = matches.get_many::<String>(setting.id).into_iter().flatten();
                all.map(String::as_str).collect::<Vec<_>>().join(",")
            }
        };
        Some((setting, text))
    };
    Given(SETTINGS.iter().filter(|setting| groups.contains(&setting.group)).filter_map(texts).collect())
}

/// Arguments of a subcommand that are the flags of some groups of settings.
macro_rules! of_groups {
    ($type:ty, $groups:expr) => {
        impl clap::FromArgMatches for $type {
            fn from_arg_matches(matches: &clap::ArgMatches) -> clap::error::Result<Self> {
                Ok(Self::of(crate::settings::given(matches, $groups)))
            }

            fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> clap::error::Result<()> {
                *self = Self::from_arg_matches(matches)?;
                Ok(())
            }
        }

        impl clap::Args for $type {
            fn augment_args(command: clap::Command) -> clap::Command {
                command.args(crate::settings::flags($groups))
            }

            fn augment_args_for_update(command: clap::Command) -> clap::Command {
                Self::augment_args(command)
            }
        }
    };
}
pub(crate) use of_groups;

#[cfg(test)]
mod tests {
    use clap::Command;

    use super::*;

    #[test]
    fn every_subcommand_that_analyses_has_every_setting() {
        let command = crate::cli::command();
        for name in ["discover", "roll", "replay", "demo", "report"] {
            let own = command.find_subcommand(name).expect(name);
            for setting in &SETTINGS {
                // A report of data is of one analysis.
                if name == "report" && setting.group == Group::Resampling {
                    continue;
                }
                let flag = own.get_arguments().find(|arg| arg.get_long() == Some(setting.flag));
                assert!(flag.is_some_and(|flag| flag.get_help().is_some()), "{name} --{}", setting.flag);
            }
        }
    }

    #[test]
    fn a_value_of_every_setting_arrives() {
        for setting in SETTINGS.iter().filter(|setting| !matches!(setting.kind, Kind::File(_))) {
            let groups: &[Group] = &[Group::Method, Group::Seed, Group::Resampling, Group::Run];
            let command = Command::new("test").args(SETTINGS.iter().map(flag));
            let text = match setting.kind {
                Kind::Flag => "",
                Kind::Count(..) | Kind::Lag | Kind::Bytes | Kind::Text => "3",
                Kind::Number(..) | Kind::NumberOr(..) => "0.25",
                Kind::Word(words) => words[words.len() - 1],
                Kind::Method | Kind::Test => setting.kind.words().last().copied().expect("a name"),
                Kind::List(form) if form.contains('=') => "a=b,c=d",
                Kind::List(_) => "a,b",
                Kind::File(_) => continue,
            };
            let word = if text.is_empty() {
                format!("--{}", setting.flag)
            } else {
                format!("--{}={text}", setting.flag)
            };
            let request =
                given(&command.get_matches_from(["test", word.as_str()]), groups).request().expect(&word);
            let value = (setting.get)(&request);
            assert_ne!(value, setting.default_value(), "{word}");
            assert!(setting.kind == Kind::Flag || setting.written(&value) == text, "{word}: {value}");
        }
    }
}
