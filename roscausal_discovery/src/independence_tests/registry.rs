//! The registry of independence tests: name and constructor of each.

#[cfg(feature = "python")]
use super::GpdcPython;
use super::{
    CmiKnn, CmiSymb, Gpdc, Gsquared, ParCorr, ParCorrVector, ParCorrWls, RegressionCi, RobustParCorr,
    settings::{Significance, TestSettings},
};
use crate::types::{CondIndTest, Error, Result};

type Build = fn(&TestSettings) -> Result<Box<dyn CondIndTest>>;

/// Smallest p-value of a null distribution of 500 values, or of as many surrogates. The p-values of the other tests are resolved as
/// far as a reader needs them.
const OF_TABLE: f64 = 0.002;
const USUAL: f64 = 0.001;

/// All tests, one line each: name, smallest p-value that is distinguished, constructor. Names are lower case. Users may
/// write them in any case, with `_` or `-`.
const TESTS: &[(&str, f64, Build)] = &[
    ("parcorr", USUAL, |s| Ok(Box::new(ParCorr::new(s)?))),
    ("gpdc", USUAL, |s| Ok(Box::new(Gpdc::new(s)?))),
    #[cfg(feature = "python")]
    ("gpdcpython", OF_TABLE, |s| Ok(Box::new(GpdcPython::new(s)?))),
    ("robustparcorr", USUAL, |s| Ok(Box::new(RobustParCorr::new(s)?))),
    ("parcorrwls", USUAL, |s| Ok(Box::new(ParCorrWls::new(s)?))),
    ("parcorrmult", USUAL, |s| Ok(Box::new(ParCorrVector::new(s)?))),
    ("regressionci", USUAL, |s| Ok(Box::new(RegressionCi::new(s)?))),
    ("cmiknn", USUAL, |s| Ok(Box::new(CmiKnn::new(s)?))),
    ("cmisymb", OF_TABLE, |s| Ok(Box::new(CmiSymb::new(s)?))),
    ("gsquared", USUAL, |s| Ok(Box::new(Gsquared::new(s)?))),
];

/// Names of all tests.
pub fn names() -> impl Iterator<Item = &'static str> {
    TESTS.iter().map(|(name, ..)| *name)
}

/// P-values of the test `name` below this are indistinguishable. CMIsymb's p-values are fractions of 500 surrogates, so its least
/// only means "below 0.002".
pub fn smallest_p(name: &str) -> f64 {
    let wanted = spelled(name);
    TESTS.iter().find(|(known, ..)| *known == wanted).map_or(USUAL, |(_, smallest, _)| *smallest)
}

/// Whether the test `name` draws surrogates, or values of a null distribution, where its p-values are made in this way.
pub fn draws(name: &str, significance: Option<Significance>) -> bool {
    let name = spelled(name);
    let (has_table, shuffles) =
        (["gpdc", "gpdcpython"].contains(&name.as_str()), ["cmiknn", "cmisymb"].contains(&name.as_str()));
    match significance {
        None => has_table || shuffles,
        Some(Significance::Analytic) => has_table,
        Some(Significance::ShuffleTest) => true,
        Some(Significance::FixedThres) => false,
    }
}

/// A name as the registry spells it: lower case, without `_` and `-`.
pub fn spelled(name: &str) -> String {
    name.chars().filter(|c| !"_-".contains(*c)).flat_map(char::to_lowercase).collect()
}

/// The test `name` with `settings`.
///
/// # Errors
/// An unknown name (the message suggests the nearest), or settings that the test does not allow.
pub fn by_name(name: &str, settings: &TestSettings) -> Result<Box<dyn CondIndTest>> {
    let wanted = spelled(name);
    if let Some((_, _, build)) = TESTS.iter().find(|(known, ..)| *known == wanted) {
        settings.check()?;
        return build(settings);
    }
    if cfg!(not(feature = "python")) && wanted == "gpdcpython" {
        let way = "build with `--features python`, or use gpdc";
        return Err(Error::param("test", format!("gpdc-python is not part of this build; {way}")));
    }
    let nearest =
        names().max_by(|a, b| strsim::jaro_winkler(a, &wanted).total_cmp(&strsim::jaro_winkler(b, &wanted)));
    let all = names().collect::<Vec<_>>().join(", ");
    let hint = nearest.map_or(String::new(), |n| format!("; did you mean '{n}'?"));
    Err(Error::param("test", format!("there is no independence test '{name}'{hint} (known: {all})")))
}
