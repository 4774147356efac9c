//! How strongly does one variable drive another? Total, direct, mediated, with what it rests on.

use roscausal_discovery::{Node, ensure, quantile};
use serde::{Deserialize, Serialize};

use super::{
    Status, ambiguity, caveats,
    sentences::{listed, named, no_effect, short, steps},
};
use crate::{
    effects::{Columns, Paths, Sums},
    graph::{Adjustment, adjustment},
    model::{Directed, Equations, Member, Schedule, Settings, StructuralModel, System},
    quality::all_lagged,
    question::variable,
    random,
    simulate::interval_of,
};

/// Bootstraps of the rows for an interval.
const BOOTSTRAPS: usize = 200;
/// Longest lag that an effect is asked for.
pub const LONGEST_LAG: usize = 100;
/// Rows of an experiment below which it says nothing alone.
const FEWEST_IMPOSED: usize = 50;

/// How strongly does one variable drive another?
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectQuestion {
    /// The cause.
    pub cause: String,
    /// The effect.
    pub effect: String,
    /// Largest lag.
    pub max_lag: usize,
    /// In standard deviations instead of units.
    pub standardised: bool,
}

/// The answer to [`EffectQuestion`]. Lists are by lag, 0 first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EffectAnswer {
    /// How to take it.
    pub status: Status,
    /// Why not OK, in a sentence.
    pub message: String,
    /// Effect of a unit pulse of the cause, by all paths.
    pub total: Vec<f64>,
    /// Lower end of its interval.
    pub lower: Vec<f64>,
    /// Upper end.
    pub upper: Vec<f64>,
    /// By the link itself.
    pub direct: Vec<f64>,
    /// Variables on the paths.
    pub mediators: Vec<String>,
    /// What passes through each at the lag of the largest total effect.
    pub mediated: Vec<f64>,
    /// What the regression at that lag adjusts for, such as `h_dg(t-2)`.
    pub adjustment_set: Vec<String>,
    /// Part of the rest of cause and effect that an unrecorded cause would have to explain to undo the effect.
    pub robustness: f64,
    /// All in words.
    pub text: String,
    /// One sentence each.
    pub caveats: Vec<String>,
}

/// The regression at one lag.
struct AtLag {
    found: Adjustment,
    coefficient: f64,
    bounds: (f64, f64),
    t: f64,
    degrees: f64,
}

/// What one graph says.
struct ByGraph {
    lags: Vec<AtLag>,
    paths: Paths,
    /// Interval of each lag's effect by paths.
    by_paths: Vec<(f64, f64)>,
}

/// Total, direct and mediated effect of one variable on another.
pub fn effect(model: &StructuralModel, question: &EffectQuestion) -> EffectAnswer {
    let refuse = |(status, message)| EffectAnswer { status, message, ..EffectAnswer::default() };
    found(model, question).unwrap_or_else(refuse)
}

fn found(model: &StructuralModel, question: &EffectQuestion) -> Result<EffectAnswer, (Status, String)> {
    let names = model.graph().names();
    let bad = |message: String| (Status::BadRequest, message);
    let cause = variable(names, &question.cause).map_err(bad)?;
    let effect = variable(names, &question.effect).map_err(bad)?;
    let max_lag = question.max_lag;
    ensure(max_lag <= LONGEST_LAG && (max_lag > 0 || cause != effect), || {
        bad(format!(
            "a largest lag of {max_lag} is not answered; ask for 0 to {LONGEST_LAG}, above 0 for a variable on itself"
        ))
    })?;
    let graphs = model.members().iter().map(|member| of_graph(model, member, cause, effect, max_lag));
    let graphs = graphs.collect::<Result<Vec<ByGraph>, String>>();
    let graphs = graphs.map_err(|message| (Status::NotSupported, message))?;
    let deviations = &model.members()[0].model.deviations;
    let unit = if question.standardised && deviations[effect] > 0.0 {
        deviations[cause] / deviations[effect]
    } else {
        1.0
    };
    let count = graphs.len() as f64;
    let average = |of: &dyn Fn(&ByGraph) -> f64| unit * graphs.iter().map(of).sum::<f64>() / count;
    let total: Vec<f64> = (0..=max_lag).map(|lag| average(&|g| g.lags[lag].coefficient)).collect();
    let fold = |lag: usize, first: f64, pick: fn(f64, f64) -> f64, of: fn(&AtLag) -> f64| {
        unit * graphs.iter().map(|g| of(&g.lags[lag])).fold(first, pick)
    };
    let lower = (0..=max_lag).map(|lag| fold(lag, f64::INFINITY, f64::min, |l| l.bounds.0)).collect();
    let upper = (0..=max_lag).map(|lag| fold(lag, f64::NEG_INFINITY, f64::max, |l| l.bounds.1)).collect();
    let direct: Vec<f64> = (0..=max_lag).map(|lag| average(&|g| g.paths.direct(lag))).collect();
    let own = usize::from(cause == effect);
    let peak = (own..=max_lag)
        .max_by(|&a, &b| total[a].abs().total_cmp(&total[b].abs()).then(b.cmp(&a)))
        .unwrap_or(0);
    let through = |k: usize| (k, average(&|g| g.paths.through(k, peak)));
    let others = (0..names.len()).filter(|&k| k != cause && k != effect);
    let mediators: Vec<(usize, f64)> = others.map(through).filter(|(_, part)| *part != 0.0).collect();
    let first = &graphs[0].lags[peak];
    let set: Vec<String> = first.found.set.iter().flatten().map(|&node| model.graph().text(node)).collect();
    let robustness =
        graphs.iter().map(|g| robustness(g.lags[peak].t, g.lags[peak].degrees)).fold(f64::INFINITY, f64::min);
    let effects: Vec<f64> = graphs.iter().map(|g| g.lags[peak].coefficient * unit).collect();
    let path = graphs.iter().any(|g| g.lags.iter().any(|l| l.found.causal_path));
    let doubt = ambiguity::sentence(model, &effects, 0.0)
        .or_else(|| caveats::shared_by(model, &[cause], &[effect]).filter(|_| path));
    let (status, message) = doubt.map_or((Status::Ok, String::new()), |message| (Status::Ambiguous, message));
    let mut answer = EffectAnswer {
        status,
        message,
        mediated: mediators.iter().map(|(_, part)| *part).collect(),
        mediators: mediators.iter().map(|(k, _)| names[*k].clone()).collect(),
        adjustment_set: set,
        robustness,
        total,
        lower,
        upper,
        direct,
        ..EffectAnswer::default()
    };
    if path {
        answer.text = text(model, question, &answer, peak);
    } else {
        answer.text = format!("{}.", no_effect(model, &[cause], &[effect], max_lag));
        answer.caveats.extend(by_plain_regression(model, (cause, effect), max_lag));
    }
    answer.caveats.extend(cautions(model, &graphs, (cause, effect), peak, &answer));
    Ok(answer)
}

/// What a regression on all variables at all lags would say of a pair without a path, where it says more than chance would.
fn by_plain_regression(
    model: &StructuralModel,
    (cause, effect): (usize, usize),
    max_lag: usize,
) -> Option<String> {
    let lines = Settings { equations: Equations::Linear, check: false, ..model.settings().clone() };
    let everything = Directed::fit(model.samples(), &all_lagged(model.graph()).ok()?, &lines, None).ok()?;
    let (n, memory) = (model.graph().len(), everything.graph.memory());
    let response = |system: &System| {
        let mut pulse = Schedule::free(n, max_lag + 1);
        pulse.shift(0, cause, 1.0);
        let end = |schedule: &Schedule| {
            let mut rows = vec![0.0; memory * n];
            system.run(&mut rows, schedule, |_, _| 0.0);
            rows
        };
        let (moved, still) = (end(&pulse), end(&Schedule::free(n, max_lag + 1)));
        (1..=max_lag).map(|lag| (memory + lag) * n + effect).map(|at| moved[at] - still[at]).collect()
    };
    let refits: Vec<Vec<f64>> = everything.members.iter().map(response).collect();
    // Of several lags one is the largest by chance.
    let level = 1.0 - (1.0 - model.settings().interval) / (10 * max_lag.max(1)) as f64;
    let at = |lag: usize| refits.iter().map(|refit| refit[lag]).collect::<Vec<f64>>();
    let differs = |lag: &usize| interval_of(&at(*lag), level).map(f64::signum) != [-1.0, 1.0];
    let mean = |lag: usize| at(lag).iter().sum::<f64>() / refits.len() as f64;
    let strongest = (0..max_lag).filter(differs).max_by(|&a, &b| mean(a).abs().total_cmp(&mean(b).abs()))?;
    let [low, high] = interval_of(&at(strongest), model.settings().interval).map(short);
    let (mean, when) = (short(mean(strongest)), steps(model, strongest + 1));
    Some(format!(
        "a plain regression on all variables at all lags would say {mean} ({low} to {high}) {when} later: the graph may lack a link"
    ))
}

fn of_graph(
    model: &StructuralModel,
    member: &Member,
    cause: usize,
    effect: usize,
    max_lag: usize,
) -> Result<ByGraph, String> {
    let graph = &member.model.graph;
    if let Some(reason) = &member.model.summaries[effect].missing {
        return Err(reason.clone());
    }
    let (samples, seed) = (model.samples(), model.settings().seed);
    let horizon = max_lag.max(graph.largest_lag());
    let paths = Paths::fit(samples, graph, (cause, effect), horizon, (BOOTSTRAPS, seed));
    let paths = paths.map_err(|e| e.to_string())?;
    let tail = 0.5 * (1.0 - model.settings().interval);
    let by_paths = (0..=max_lag).map(|lag| bounds(paths.drawn.iter().map(|lags| lags[lag]), tail)).collect();
    let lags =
        (0..=max_lag).map(|lag| at_lag(model, member, Node::new(cause, lag), Node::new(effect, 0), tail));
    Ok(ByGraph { lags: lags.collect::<Result<_, String>>()?, paths, by_paths })
}

/// The quantiles `tail` and its counterpart.
pub(super) fn bounds(values: impl Iterator<Item = f64>, tail: f64) -> (f64, f64) {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    (quantile(&values, tail), quantile(&values, 1.0 - tail))
}

/// The regression of the effect on the cause at one lag and the optimal set.
fn at_lag(model: &StructuralModel, member: &Member, x: Node, y: Node, tail: f64) -> Result<AtLag, String> {
    let found = adjustment(&member.model.graph, &[x], y);
    let none = |coefficient, found| {
        let bounds = (coefficient, coefficient);
        Ok(AtLag { found, coefficient, bounds, t: 0.0, degrees: 1.0 })
    };
    if x == y {
        return none(1.0, found);
    }
    let Some(set) = found.set.clone().filter(|_| found.causal_path) else { return none(0.0, found) };
    // Rows in which an experiment imposed what lies on the paths do not show the effect.
    let cut: Vec<Node> = found.mediators.iter().copied().chain([y]).collect();
    let mut nodes: Vec<Node> = set.iter().copied().chain([x, y]).collect();
    nodes.sort_unstable();
    let columns = Columns::of(model.samples(), nodes, found.window, &cut);
    let position = |node: Node| columns.position(node);
    let regressors: Vec<usize> = [x].iter().chain(&set).map(|&node| position(node)).collect();
    let target = position(y);
    let degrees = columns.products.n as f64 - regressors.len() as f64 - 1.0;
    ensure(degrees >= 10.0, || {
        let (rows, cause, others) = (columns.products.n, member.model.graph.text(x), set.len());
        format!("{rows} rows are too few to adjust the effect of {cause} for {others} others; record longer")
    })?;
    let coefficient = |sums: &Sums| sums.regress(target, &regressors).0[0];
    let whole = columns.products.whole();
    ensure(whole.deviation(regressors[0]) != 0.0, || {
        let name = &member.model.graph.names()[x.var];
        format!("{name} has one value in all rows, which say nothing of its effect; record it with others")
    })?;
    let (all, rss) = whole.regress(target, &regressors);
    let (_, own) = whole.regress(regressors[0], &regressors[1..]);
    let error = (rss / degrees / own).sqrt();
    let prefix = columns.products.prefix();
    let draw = |k: usize| {
        coefficient(&prefix.resampled(random::at(model.settings().seed, k, 6), &columns.stretches))
    };
    let (low, high) = bounds((0..BOOTSTRAPS).map(draw), tail);
    let t = if error > 0.0 { all[0] / error } else { 0.0 };
    Ok(AtLag { found, coefficient: all[0], bounds: (low.min(all[0]), high.max(all[0])), t, degrees })
}

/// The robustness value (Cinelli and Hazlett 2020): an unrecorded cause that explains this part of what is left of both cause and
/// effect would be enough to undo the effect.
fn robustness(t: f64, degrees: f64) -> f64 {
    let f = t.abs() / degrees.sqrt();
    0.5 * ((f.powi(4) + 4.0 * f * f).sqrt() - f * f)
}

fn text(model: &StructuralModel, question: &EffectQuestion, answer: &EffectAnswer, peak: usize) -> String {
    let EffectQuestion { cause, effect, .. } = question;
    let when =
        if peak == 0 { "at the same time".to_owned() } else { format!("{} later", steps(model, peak)) };
    let unit = if question.standardised { "standard deviation" } else { "unit" };
    let mut ways = vec![format!("{} directly", short(answer.direct[peak]))];
    let strongest =
        (0..answer.direct.len()).max_by(|&a, &b| answer.direct[a].abs().total_cmp(&answer.direct[b].abs()));
    if let Some(lag) = strongest.filter(|&lag| answer.direct[peak] == 0.0 && answer.direct[lag] != 0.0) {
        let when =
            if lag == 0 { "at the same time".to_owned() } else { format!("after {}", steps(model, lag)) };
        ways[0] += &format!(" at that lag (the link itself acts {when}: {})", short(answer.direct[lag]));
    }
    let through = answer.mediators.iter().zip(&answer.mediated);
    ways.extend(through.map(|(name, part)| format!("{} through {name}", short(*part))));
    let [by, low, high] = [&answer.total, &answer.lower, &answer.upper].map(|of| short(of[peak]));
    let ways = listed(&ways);
    let mut sentences = vec![format!(
        "A pulse of one {unit} of {cause} moves {effect} the most {when}: by {by} ({low} to {high}), {ways}"
    )];
    if !answer.adjustment_set.is_empty() {
        sentences.push(format!("Adjusted for {}", listed(&answer.adjustment_set)));
    }
    format!("{}.", sentences.join(". "))
}

fn cautions(
    model: &StructuralModel,
    graphs: &[ByGraph],
    (cause, effect): (usize, usize),
    peak: usize,
    answer: &EffectAnswer,
) -> Vec<String> {
    let names = model.graph().names();
    let mut stated = vec![caveats::imposed(model, cause, "this effect")];
    stated.extend(from_experiment(model, (cause, effect), peak));
    let any_path = graphs.iter().any(|g| g.lags[peak].found.causal_path);
    if any_path && peak + usize::from(cause != effect) > 0 {
        let (percent, cause, effect) = (short(100.0 * answer.robustness), &names[cause], &names[effect]);
        stated.push(format!(
            "an unrecorded cause that explains {percent} % of what is left of both {cause} and {effect} would be enough to \
             undo it"
        ));
    }
    for graph in graphs {
        let (by_set, by_paths) = (&graph.lags[peak], graph.by_paths[peak]);
        let paths = graph.paths.total[peak];
        let apart = (paths < by_set.bounds.0 || paths > by_set.bounds.1)
            && (by_set.coefficient < by_paths.0 || by_set.coefficient > by_paths.1);
        if by_set.found.causal_path && apart {
            let (paths, coefficient) = (short(paths), short(by_set.coefficient));
            stated.push(format!(
                "the graph does not fit the data: by its paths the effect is {paths}, by adjustment {coefficient}"
            ));
        }
        if by_set.found.causal_path && by_set.found.set.is_none() {
            stated.push("no adjustment set exists; ask what-if, which simulates".to_owned());
        }
    }
    stated.extend(caveats::weakest_link(model, &caveats::strongest_path(model, cause, effect)));
    let is_curved = |var: &usize| model.members()[0].model.summaries[*var].process.is_some();
    let curved: Vec<usize> = (0..names.len()).filter(is_curved).collect();
    if !curved.is_empty() {
        let (noun, curved) =
            (if curved.len() == 1 { "equation" } else { "equations" }, named(model, &curved));
        stated.push(format!(
            "the {noun} of {curved} may be curved: this is the effect on average, ask what-if for the one from a state"
        ));
    }
    stated.extend(caveats::of_model(model));
    stated
}

/// The same effect from the rows alone in which an experiment imposed the cause.
fn from_experiment(model: &StructuralModel, (cause, effect): (usize, usize), peak: usize) -> Option<String> {
    if cause == effect || model.samples().times_imposed(cause) < FEWEST_IMPOSED {
        return None;
    }
    let (x, y) = (Node::new(cause, peak), Node::new(effect, 0));
    let (rows, coefficient, error) = model.samples().effect_where_imposed(x, y)?;
    let name = &model.graph().names()[cause];
    let (effect, error) = (short(coefficient), short(error));
    Some(format!(
        "from the {rows} rows alone in which {name} was imposed the effect is {effect} (standard error {error})"
    ))
}
