//! Names of variables: their plain spelling, and the one that a user meant.

use super::visible;

/// The plain spelling of a variable's name: `r_{\theta}` becomes `r_theta`, `h_{d_g}` becomes `h_d_g`. What a reader could not see
/// is spelled out, as [`visible::line`] does it.
///
/// ```
/// assert_eq!(roscausal_discovery::names::plain("r_{\\theta}"), "r_theta");
/// ```
pub fn plain(name: &str) -> String {
    let shown: String = name.chars().filter(|c| !matches!(c, '{' | '}' | '\\')).collect();
    visible::line(&shown).into_owned()
}

/// The variable that a user means by `wanted`: the exact name, or the one with the same plain spelling.
pub fn position(names: &[String], wanted: &str) -> Option<usize> {
    let exact = names.iter().position(|name| name == wanted);
    exact.or_else(|| names.iter().position(|name| plain(name) == plain(wanted)))
}

/// The name nearest to `wanted`, if one is close enough.
///
/// ```
/// use roscausal_discovery::names::nearest;
///
/// assert_eq!(nearest(&["speed", "distance"], "sped"), Some("speed"));
/// assert_eq!(nearest(&["speed", "distance"], "risk"), None);
/// ```
pub fn nearest<'a, S: AsRef<str>>(names: &'a [S], wanted: &str) -> Option<&'a str> {
    let closeness =
        |name: &str| strsim::jaro_winkler(&plain(name).to_lowercase(), &plain(wanted).to_lowercase());
    let best = names.iter().map(AsRef::as_ref).max_by(|a, b| closeness(a).total_cmp(&closeness(b)))?;
    (closeness(best) > 0.7).then_some(best)
}

/// What to say of the `names` that there are, where one is `wanted` that there is not; `what` they are.
///
/// ```
/// use roscausal_discovery::names::instead;
///
/// let told = instead(&["speed", "distance"], "sped", "columns:");
/// assert_eq!(told, "did you mean 'speed'? columns: speed, distance");
/// ```
pub fn instead<S: AsRef<str>>(names: &[S], wanted: &str, what: &str) -> String {
    let hint = nearest(names, wanted).map_or(String::new(), |near| format!("did you mean '{near}'? "));
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    format!("{hint}{what} {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strings(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn a_column_is_found_by_its_plain_spelling() {
        let names = strings(&["r_{\\theta}", "h_{d_g}", "h_v"]);
        assert_eq!(position(&names, "r_theta"), Some(0));
        assert_eq!(position(&names, "h_d_g"), Some(1));
        assert_eq!(position(&names, "h_risk"), None);
        assert_eq!(nearest(&names, "r_teta"), Some("r_{\\theta}"));
        assert_eq!(nearest(&names, "zzzz"), None);
    }
}
