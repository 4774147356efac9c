//! What a share of resamples meant: of the links with it, how many the scenario has.

use std::fmt::Write;

use crate::experiment::runs::Run;

/// Ends of the classes of shares, and the word for each.
const CLASSES: [(f64, f64, &str); 6] = [
    (0.9, 1.01, "firm"),
    (0.7, 0.9, "likely"),
    (0.5, 0.7, "likely"),
    (0.3, 0.5, "unsure"),
    (0.1, 0.3, "unsure"),
    (0.0, 0.1, "absent"),
];

/// A table with a row for each class of shares; empty without resamples. All settings count together.
pub(super) fn table(runs: &[Run]) -> String {
    let shares = || runs.iter().flat_map(|run| run.shares.iter().map(move |share| (run, share)));
    if shares().next().is_none() {
        return String::new();
    }
    let resampled = runs.iter().filter(|run| !run.shares.is_empty()).count();
    let mut text = format!(
        "\n\nWhat a share of resamples meant, in {resampled} runs:\n| share of resamples | word | links | of the scenario |\n\
         |---|---|---|---|"
    );
    for (low, high, word) in CLASSES {
        let of_class = || shares().filter(|(_, share)| (low..high).contains(&share.share));
        let (all, real) = (of_class().count(), of_class().filter(|(run, share)| run.has(share)).count());
        let name = match (low, high) {
            (low, high) if high > 1.0 => format!("from {low}"),
            (0.0, high) => format!("below {high}"),
            (low, high) => format!("{low} to {high}"),
        };
        let percent = match all {
            0 => "-".to_owned(),
            _ => format!("{real}, {:.1} %", 100.0 * real as f64 / all as f64),
        };
        let _ = write!(text, "\n| {name} | {word} | {all} | {percent} |");
    }
    text
}

#[cfg(test)]
mod tests {
    use crate::experiment::runs::Share;

    #[test]
    fn each_share_is_of_one_class_and_counts_as_real_if_the_scenario_has_the_link() {
        let mut run = super::super::tests::run(150.0, 1, &[]);
        let shares =
            [("h_v", "h_dg", 1.0), ("h_dg", "h_risk", 0.95), ("h_dg", "h_v", 0.9), ("h_risk", "h_dg", 0.0)];
        run.shares = shares
            .map(|(cause, effect, share)| Share { cause: cause.into(), effect: effect.into(), share })
            .to_vec();
        let table = super::table(&[run]);
        assert!(table.contains("| from 0.9 | firm | 3 | 2, 66.7 % |"), "{table}");
        assert!(table.contains("| below 0.1 | absent | 1 | 0, 0.0 % |"), "{table}");
        assert!(table.contains("| 0.3 to 0.5 | unsure | 0 | - |"), "{table}");
        assert_eq!(super::table(&[super::super::tests::run(150.0, 1, &[])]), "");
    }
}
