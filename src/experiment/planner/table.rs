//! The trials as a table, and each of them as CSV.

use std::fmt::Write;

use super::{Drive, Policy, Trial};

/// A row for each policy: means over the seeds, with their standard deviation.
pub(super) fn markdown(policies: &[Policy], trials: &[Trial]) -> String {
    let mut text = "| policy | goal reached | time to the goal, s | mean risk | risk, 95 % quantile | on collision course, s | \
                    nearest, m | questions answered |\n|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for policy in policies {
        let own: Vec<&Trial> = trials.iter().filter(|trial| trial.policy == *policy).collect();
        let of = |value: &dyn Fn(&Trial) -> f64| {
            let all: Vec<f64> = own.iter().map(|trial| value(trial)).filter(|x| x.is_finite()).collect();
            spread(&all)
        };
        let reached = own.iter().filter(|trial| trial.drive.seconds.is_some()).count();
        let (time, time_sd) = of(&|trial| trial.drive.seconds.unwrap_or(f64::NAN));
        let (risk, risk_sd) = of(&mean_risk);
        let (high, high_sd) = of(&high_risk);
        let (course, course_sd) = of(&|trial| trial.drive.collision_s);
        let (nearest, nearest_sd) = of(&|trial| trial.drive.nearest);
        let asked: u64 = own.iter().map(|trial| trial.drive.asked).sum();
        let answered: u64 = own.iter().map(|trial| trial.drive.answered).sum();
        let questions = if asked == 0 { String::new() } else { format!("{answered} of {asked}") };
        let (name, all) = (policy.name(), own.len());
        let _ = writeln!(
            text,
            "| {name} | {reached} of {all} | {time:.1} ± {time_sd:.1} | {risk:.3} ± {risk_sd:.3} | {high:.2} ± {high_sd:.2} | \
             {course:.1} ± {course_sd:.1} | {nearest:.2} ± {nearest_sd:.2} | {questions} |"
        );
    }
    for other in policies.iter().filter(|policy| **policy != Policy::Planner) {
        let pairs: Vec<(&Trial, &Trial)> = trials
            .iter()
            .filter(|trial| trial.policy == Policy::Planner)
            .filter_map(|own| {
                Some((own, trials.iter().find(|one| one.seed == own.seed && one.policy == *other)?))
            })
            .collect();
        let differs = |value: &dyn Fn(&Trial) -> f64, digits: usize| {
            let all: Vec<f64> =
                pairs.iter().map(|(own, one)| value(own) - value(one)).filter(|x| x.is_finite()).collect();
            let (mean, sd) = spread(&all);
            // The normal 95 % interval of the mean.
            let half = 1.96 * sd / (all.len() as f64).sqrt();
            format!("{mean:+.digits$} ± {half:.digits$}")
        };
        let _ = writeln!(
            text,
            "\nThe planner less '{}', by pairs of the same seed (mean, 95 % interval): time {} s, mean risk {}, risk's quantile {}, \
             on collision course {} s.",
            other.name(),
            differs(&|trial| trial.drive.seconds.unwrap_or(f64::NAN), 1),
            differs(&mean_risk, 4),
            differs(&high_risk, 3),
            differs(&|trial| trial.drive.collision_s, 1)
        );
    }
    text
}

/// Every trial.
pub(super) fn csv(trials: &[Trial]) -> String {
    let mut text = "seed,policy,seconds,mean_risk,high_risk,collision_s,nearest,asked,answered\n".to_owned();
    for trial in trials {
        let Drive { collision_s, nearest, asked, answered, .. } = &trial.drive;
        let seconds = trial.drive.seconds.map_or(String::new(), |seconds| format!("{seconds:.2}"));
        let (policy, seed) = (trial.policy.name(), trial.seed);
        let (mean, high) = (mean_risk(trial), high_risk(trial));
        let _ = writeln!(
            text,
            "{seed},\"{policy}\",{seconds},{mean},{high},{collision_s:.2},{nearest},{asked},{answered}"
        );
    }
    text
}

/// Mean and standard deviation.
fn spread(all: &[f64]) -> (f64, f64) {
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    (mean, (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt())
}

fn mean_risk(trial: &Trial) -> f64 {
    trial.drive.risks.iter().sum::<f64>() / trial.drive.risks.len() as f64
}

fn high_risk(trial: &Trial) -> f64 {
    let mut risks = trial.drive.risks.clone();
    risks.sort_unstable_by(f64::total_cmp);
    roscausal_discovery::quantile(&risks, 0.95)
}
