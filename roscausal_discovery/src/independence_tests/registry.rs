//! The registry of independence tests: name and constructor of each.

#[cfg(feature = "python")]
use super::GpdcPython;
use super::{CmiKnn, Gpdc, Gsquared, ParCorr, RobustParCorr, settings::TestSettings};
use crate::ground::{CondIndTest, Error, Result};

type Build = fn(&TestSettings) -> Result<Box<dyn CondIndTest>>;

/// P-values from a null table of 500 values are told apart down to this, all others as far as a reader wants to know.
const OF_TABLE: f64 = 0.002;
const USUAL: f64 = 0.001;

/// All tests, one line each: name, smallest p-value that is told apart, how it is made. A name is lower case; users may
/// write it in any case, with `_` or `-`.
const TESTS: &[(&str, f64, Build)] = &[
    ("parcorr", USUAL, |s| Ok(Box::new(ParCorr::new(s)?))),
    ("gpdc", OF_TABLE, |s| Ok(Box::new(Gpdc::new(s)?))),
    #[cfg(feature = "python")]
    ("gpdcpython", OF_TABLE, |s| Ok(Box::new(GpdcPython::new(s)?))),
    ("robustparcorr", USUAL, |s| Ok(Box::new(RobustParCorr::new(s)?))),
    ("cmiknn", USUAL, |s| Ok(Box::new(CmiKnn::new(s)?))),
    ("gsquared", USUAL, |s| Ok(Box::new(Gsquared::new(s)?))),
];

/// Names of all tests.
pub fn names() -> impl Iterator<Item = &'static str> {
    TESTS.iter().map(|(name, ..)| *name)
}

/// Smaller p-values than this are not told apart by the test `name`: GPDC's are fractions of 500 null values, so its 0 is
/// only known to be below 0.002.
pub fn smallest_p(name: &str) -> f64 {
    let wanted = spelled(name);
    TESTS.iter().find(|(known, ..)| *known == wanted).map_or(USUAL, |(_, smallest, _)| *smallest)
}

/// A name as the registry spells it.
fn spelled(name: &str) -> String {
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
