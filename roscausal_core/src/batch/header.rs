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
}
