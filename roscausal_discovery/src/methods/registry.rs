//! The methods by name: one line each says what a user, a command and a node have to know of it.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use crate::ground::{Error, Result};

/// A method of causal discovery.
///
/// ```
/// use roscausal_discovery::methods::Method;
///
/// let method: Method = "PCMCI+".parse()?;
/// assert_eq!(method, Method::Pcmciplus);
/// assert!(method.info().lag_zero && !method.info().hidden_causes);
/// let error = "pcmcip".parse::<Method>().unwrap_err().to_string();
/// assert!(error.contains("did you mean 'pcmci'?"));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// PCMCI behind a transfer-entropy filter ([`run_fpcmci`](super::run_fpcmci)).
    #[default]
    Fpcmci,
    /// Lagged links ([`run_pcmci`](super::run_pcmci)).
    Pcmci,
    /// Lagged and contemporaneous links ([`run_pcmciplus`](super::run_pcmciplus)).
    Pcmciplus,
    /// Each link given all others ([`run_fullci`](super::run_fullci)).
    Fullci,
    /// Each link given its target's own past ([`run_bivci`](super::run_bivci)).
    Bivci,
    /// Each link given nothing ([`get_lagged_dependencies`](super::get_lagged_dependencies)).
    Lagdep,
    /// Links where common causes may be hidden ([`run_lpcmci`](super::run_lpcmci)).
    Lpcmci,
}

/// A setting that some methods read and others do not. Every method reads the test, its level, the lags, the correction,
/// the exogenous variables and the seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// Level of the condition selection.
    PcAlpha,
    /// Level of the transfer-entropy filter.
    FAlpha,
    /// Estimator of the transfer-entropy filter.
    TeEstimator,
    /// Whether variables that depend on their own past only are left out.
    NeglectOnlyAutodep,
}

/// What there is to know of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MethodInfo {
    /// The method.
    pub method: Method,
    /// The name that users choose it by; any case, `_` and `-` anywhere.
    pub name: &'static str,
    /// Other names of it.
    pub aliases: &'static [&'static str],
    /// Smallest lag, where the user gives none.
    pub tau_min: usize,
    /// Level of the condition selection, where the user gives none.
    pub pc_alpha: f64,
    /// The settings that it reads and not every method does.
    pub reads: &'static [Reads],
    /// Whether it tests links at lag 0.
    pub lag_zero: bool,
    /// Whether it allows for causes that were not recorded.
    pub hidden_causes: bool,
    /// Whether it analyses several recordings as one system.
    pub several_recordings: bool,
    /// Whether each link comes with a p-value.
    pub p_values: bool,
}

/// What most methods have in common.
const USUAL: MethodInfo = MethodInfo {
    method: Method::Pcmci,
    name: "pcmci",
    aliases: &[],
    tau_min: 1,
    pc_alpha: 0.2,
    reads: &[],
    lag_zero: true,
    hidden_causes: false,
    several_recordings: true,
    p_values: true,
};

/// All methods, in the order of the enum: one entry each, which says how the method differs from the usual.
const METHODS: [MethodInfo; 7] = {
    use Reads::{FAlpha, NeglectOnlyAutodep, PcAlpha, TeEstimator};
    const OF_FILTER: &[Reads] = &[PcAlpha, FAlpha, TeEstimator, NeglectOnlyAutodep];
    [
        MethodInfo { method: Method::Fpcmci, name: "fpcmci", reads: OF_FILTER, lag_zero: false, ..USUAL },
        MethodInfo { method: Method::Pcmci, name: "pcmci", reads: &[PcAlpha], ..USUAL },
        MethodInfo {
            method: Method::Pcmciplus,
            name: "pcmciplus",
            aliases: &["pcmci+"],
            tau_min: 0,
            pc_alpha: 0.01,
            reads: &[PcAlpha],
            ..USUAL
        },
        MethodInfo { method: Method::Fullci, name: "fullci", ..USUAL },
        MethodInfo { method: Method::Bivci, name: "bivci", ..USUAL },
        MethodInfo { method: Method::Lagdep, name: "lagdep", aliases: &["laggeddependencies"], ..USUAL },
        MethodInfo {
            method: Method::Lpcmci,
            name: "lpcmci",
            tau_min: 0,
            pc_alpha: 0.05,
            reads: &[PcAlpha],
            hidden_causes: true,
            ..USUAL
        },
    ]
};

impl Method {
    /// All methods.
    pub fn all() -> impl Iterator<Item = Self> {
        METHODS.iter().map(|info| info.method)
    }

    /// Names of all methods.
    pub fn names() -> impl Iterator<Item = &'static str> {
        METHODS.iter().map(|info| info.name)
    }

    /// Its line in the registry.
    pub fn info(self) -> &'static MethodInfo {
        &METHODS[self as usize]
    }

    /// The name that users choose it by.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// Whether it reads this setting.
    pub fn reads(self, setting: Reads) -> bool {
        self.info().reads.contains(&setting)
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wanted: String =
            text.chars().filter(|c| !"_-".contains(*c)).flat_map(char::to_lowercase).collect();
        let is_meant = |info: &&MethodInfo| info.name == wanted || info.aliases.contains(&wanted.as_str());
        match METHODS.iter().find(is_meant) {
            Some(info) => Ok(info.method),
            None => Err(Error::unknown("method", text, &Self::names().collect::<Vec<_>>())),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_its_line_in_the_order_of_the_enum() {
        for (place, method) in Method::all().enumerate() {
            assert_eq!((method as usize, method.info().method), (place, method));
            assert_eq!(method.name().parse::<Method>().unwrap(), method);
            // Files write it as users do.
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("\"{method}\""));
        }
    }

    #[test]
    fn a_method_is_known_by_its_aliases_in_any_spelling() {
        for (text, method) in [
            ("F-PCMCI", Method::Fpcmci),
            ("PCMCI", Method::Pcmci),
            ("pcmci+", Method::Pcmciplus),
            ("pcmci_plus", Method::Pcmciplus),
            ("lagged_dependencies", Method::Lagdep),
        ] {
            assert_eq!(text.parse::<Method>().unwrap(), method, "{text}");
        }
    }

    #[test]
    fn an_unknown_method_is_an_error_that_names_the_nearest() {
        for (text, near) in [("fpcmi", "fpcmci"), ("pcmciplu", "pcmciplus"), ("bivc", "bivci")] {
            let error = text.parse::<Method>().unwrap_err().to_string();
            assert!(error.contains(&format!("did you mean '{near}'?")), "{error}");
        }
        assert!("".parse::<Method>().is_err());
    }
}
