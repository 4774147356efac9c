//! Column names, in all spellings that ROS-Causal has written.
//!
//! The original used LaTeX-like names (`r_{gx}`, `r_{\theta}`). Its `\t` became a real TAB. A spreadsheet that took
//! the TAB for a separator then split the name in two (`r_{` and `heta}`).

/// The column names of a header line, with names that a TAB split joined again.
///
/// Returns the names, and how many cells disappeared by joining.
pub fn repaired(cells: &[String]) -> (Vec<String>, usize) {
    let mut names: Vec<String> = Vec::with_capacity(cells.len());
    for cell in cells {
        match names.last_mut() {
            Some(open) if open.ends_with('{') && cell.ends_with('}') => {
                open.push_str("\\t");
                open.push_str(cell);
            }
            _ => names.push(cell.replace('\t', "\\t")),
        }
    }
    let joined = cells.len() - names.len();
    (names, joined)
}

/// The plain spelling of a column name: `r_{\theta}` becomes `r_theta`, `h_{d_g}` becomes `h_d_g`.
pub fn plain(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, '{' | '}' | '\\')).collect()
}

/// The column that a user means by `wanted`: the one with this name, or with the same plain spelling.
pub fn position(names: &[String], wanted: &str) -> Option<usize> {
    let exact = names.iter().position(|name| name == wanted);
    exact.or_else(|| names.iter().position(|name| plain(name) == plain(wanted)))
}

/// The name nearest to `wanted`, if one is close enough.
pub fn nearest<'a, S: AsRef<str>>(names: &'a [S], wanted: &str) -> Option<&'a str> {
    let closeness =
        |name: &str| strsim::jaro_winkler(&plain(name).to_lowercase(), &plain(wanted).to_lowercase());
    let best = names.iter().map(AsRef::as_ref).max_by(|a, b| closeness(a).total_cmp(&closeness(b)))?;
    (closeness(best) > 0.7).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strings(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn a_name_broken_by_a_tab_is_one_name_again() {
        let (names, joined) = repaired(&strings(&["time", "r_{", "heta}", "r_v", "h_{\theta}"]));
        assert_eq!(names, ["time", "r_{\\theta}", "r_v", "h_{\\theta}"]);
        assert_eq!(joined, 1);
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
