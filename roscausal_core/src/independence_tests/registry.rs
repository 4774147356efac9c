//! The registry of independence tests: name and constructor of each.

use super::{CmiKnn, CondIndTest, Gpdc, Gsquared, ParCorr, RobustParCorr, TestSettings};
use crate::{Error, Result};

type Build = fn(&TestSettings) -> Result<Box<dyn CondIndTest>>;

/// All tests, one line each. Names are lower case. Users may write them in any case, with `_` or `-`.
const TESTS: &[(&str, Build)] = &[
    ("parcorr", |s| Ok(Box::new(ParCorr::new(s)?))),
    ("gpdc", |s| Ok(Box::new(Gpdc::new(s)?))),
    #[cfg(feature = "python")]
    ("gpdcpython", |s| Ok(Box::new(super::GpdcPython::new(s)?))),
    ("robustparcorr", |s| Ok(Box::new(RobustParCorr::new(s)?))),
    ("cmiknn", |s| Ok(Box::new(CmiKnn::new(s)?))),
    ("gsquared", |s| Ok(Box::new(Gsquared::new(s)?))),
];

/// Names of all tests.
pub fn names() -> impl Iterator<Item = &'static str> {
    TESTS.iter().map(|(name, _)| *name)
}

/// The test `name` with `settings`.
///
/// # Errors
/// An unknown name (the message suggests the nearest), or settings that the test does not allow.
pub fn by_name(name: &str, settings: &TestSettings) -> Result<Box<dyn CondIndTest>> {
    let wanted: String = name.chars().filter(|c| !"_-".contains(*c)).flat_map(char::to_lowercase).collect();
    if let Some((_, build)) = TESTS.iter().find(|(known, _)| *known == wanted) {
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
