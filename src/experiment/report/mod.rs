//! What an experiment found: tables and plots of its runs.

mod counts;
mod plots;
mod shares;
mod tables;

use roscausal_core::Result;

use self::{
    counts::groups,
    plots::{Factor, plot},
    tables::{recall_csv, runs_csv, scores_csv},
};
use super::runs::Run;

/// The tables as text.
pub(super) fn text(runs: &[Run]) -> String {
    tables::text(runs) + &shares::table(runs)
}

/// Name and text of every file.
pub(super) fn files(runs: &[Run]) -> Result<Vec<(&'static str, String)>> {
    let groups = groups(runs);
    Ok(vec![
        ("recall.csv", recall_csv(&groups)?),
        ("scores.csv", scores_csv(&groups)?),
        ("runs.csv", runs_csv(runs)?),
        ("length.svg", plot(&groups, Factor::Length)),
        ("step.svg", plot(&groups, Factor::Rate)),
    ])
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use roscausal_discovery::methods::Method;

    use super::{counts::Link, *};
    use crate::{expected::PAPER, experiment::grid::Setting};

    pub(super) fn run(length: f64, seed: u64, found: &[(&str, &str)]) -> Run {
        let links = |links: &[(&str, &str)]| -> Vec<Link> {
            links.iter().map(|(cause, effect)| ((*cause).to_owned(), (*effect).to_owned())).collect()
        };
        let setting = Setting {
            scenario: "thor".into(),
            length,
            step: 0.3,
            risk_model: "v1_1".into(),
            risk_lag: 1,
            method: Method::Fpcmci,
            test: "gpdc".into(),
        };
        Run {
            setting,
            seed,
            rest: String::new(),
            n_samples: 100,
            found: links(found),
            expected: links(&PAPER),
            shares: Vec::new(),
            run_time_s: 0.5 * length,
        }
    }

    #[test]
    fn tables_have_one_row_per_link_and_setting() {
        let runs = [run(150.0, 1, &PAPER), run(75.0, 1, &[])];
        let files: BTreeMap<&str, String> = files(&runs).expect("tables").into_iter().collect();
        assert_eq!(files["recall.csv"].lines().count(), 1 + 2 * 6);
        assert!(
            files["recall.csv"]
                .contains("thor,150,0.3,v1_1,1,fpcmci,gpdc,h_dg,h_v,true,1,1,0.2065,1.0000,1.0000\n")
        );
        assert_eq!(files["scores.csv"].lines().count(), 3);
        assert!(files["runs.csv"].contains(",1,100,h_v->h_dg h_dg->h_v h_risk->h_v h_v->h_risk,75.000"));
        assert!(files["length.svg"].contains("length of the recording"));
        assert!(!files["length.svg"].contains("NaN") && !files["step.svg"].contains("NaN"));
    }
}
