//! Which variables are contexts: what is constant in a recording, and what was imposed.
//!
//! Example, J-PCMCI+: in each of five recordings `age` has one value, so it is a context of space; `hour`, named exogenous, is the
//! same in all recordings at each step, so it is a context of time.
//!
//! Example, CAnDOIT: `do_robot_speed` holds what was imposed on `r_v`, so it is the context of `r_v`.

use ndarray::Axis;

use crate::{
    methods::{
        Intervened, JpcmciPlusResult, JpcmciPlusSettings, NodeClass, PcmciResult, PcmciSettings,
        default_intervention_targets, is_shared,
    },
    numeric::rows::is_constant_column,
    settings::Settings,
    types::{DataFrame, Error, LinkMark, Result, names, same_value, unique},
};

impl Settings {
    /// What J-PCMCI+ takes the variables for.
    pub(crate) fn jpcmciplus(&self, data: &DataFrame) -> Result<JpcmciPlusSettings> {
        let reason = "jpcmciplus compares recordings and there is one; give several, or take pcmciplus";
        Error::ensure_data(data.recordings().len() > 1, || reason)?;
        // What contexts may drive is theirs to say, so exogenous variables make no assumptions here.
        let exogenous = self.context(data);
        let alone = Self { exogenous: Vec::new(), ..self.clone() };
        let class = |var: usize| class_of(data, var, exogenous.contains(&var));
        Ok(JpcmciPlusSettings {
            pcmci: PcmciSettings { tau_min: 0, ..alone.pcmci(data) },
            plus: self.pcmciplus.clone(),
            classes: (0..data.n_vars()).map(class).collect::<Result<_>>()?,
            ..JpcmciPlusSettings::default()
        })
    }

    /// The interventions that CAnDOIT knows of: columns of `acts_on` that are there, and exogenous variables.
    pub(crate) fn interventions(&self, data: &DataFrame) -> Result<Vec<Intervened>> {
        let place = |name: &str| names::position(data.var_names(), name);
        let all = || data.var_names().join(", ");
        if let Some(given) = &self.acts_on {
            for (column, variable) in given {
                for name in [column, variable] {
                    if place(name).is_none() {
                        let reason = format!(
                            "{column}={variable}: there is no column '{name}'; an intervention needs a column that holds what was \
                             imposed, else 0, and its variable another (columns: {})",
                            all()
                        );
                        return Err(Error::param("acts_on", reason));
                    }
                }
            }
        }
        let pairs = self.acts_on.clone().unwrap_or_else(default_intervention_targets);
        let variable_of = |context: usize| {
            let mut of = pairs.iter().filter(|(column, _)| place(column) == Some(context));
            of.find_map(|(_, variable)| place(variable))
        };
        let mut contexts = self.context(data);
        contexts.extend(pairs.iter().filter_map(|(column, _)| place(column)));
        let contexts = unique(contexts);
        Error::ensure(!contexts.is_empty(), "acts_on", || {
            format!(
                "candoit needs interventions, and no column holds one (columns: {}); name it, such as do_robot_speed=r_v, or take \
                 lpcmci",
                all()
            )
        })?;
        if let Some(&context) = contexts.iter().find(|&&var| is_constant_everywhere(data, var)) {
            let name = &data.var_names()[context];
            let reason = format!(
                "'{name}' is the same in all rows, so nothing was imposed; leave it out, or take lpcmci"
            );
            return Err(Error::param("acts_on", reason));
        }
        let intervened = |context: usize| Intervened { variable: variable_of(context), context };
        Ok(contexts.into_iter().map(intervened).collect())
    }
}

fn class_of(data: &DataFrame, var: usize, exogenous: bool) -> Result<NodeClass> {
    let name = &data.var_names()[var];
    match data.recordings().iter().position(|recording| !is_constant_column(recording.column(var))) {
        None if differs(data, var) => Ok(NodeClass::SpaceContext),
        Some(_) if exogenous && are_cut(data, var) => {
            let rows: Vec<String> = data.recordings().iter().map(|rows| rows.nrows().to_string()).collect();
            let shortest = data.recordings().iter().map(|rows| rows.nrows()).min().unwrap_or(0);
            let reason = format!(
                "'{name}' is the same in all recordings, but these have different lengths ({} rows), and a context of time needs the \
                 same steps in all; take the rows 1..{shortest} of each",
                rows.join(", ")
            );
            Err(Error::param("exogenous", reason))
        }
        Some(recording) if exogenous && !is_shared(data, var) => {
            let reason = format!(
                "'{name}' varies within recording {} and is not the same in all recordings at each step, so it is not a context of \
                 jpcmciplus; leave it out, or take candoit for interventions and pcmciplus for other causes",
                recording + 1
            );
            Err(Error::param("exogenous", reason))
        }
        Some(_) if exogenous => Ok(NodeClass::TimeContext),
        _ => Ok(NodeClass::System),
    }
}

/// Whether a variable is the same in all recordings as far as these go, and some end earlier.
fn are_cut(data: &DataFrame, var: usize) -> bool {
    let Some(longest) = data.recordings().iter().max_by_key(|rows| rows.nrows()) else { return false };
    let begins =
        |rows: &ndarray::Array2<f64>| rows.column(var).iter().zip(longest.column(var)).all(same_value);
    let is_cut = data.recordings().iter().any(|rows| rows.nrows() < longest.nrows());
    is_cut && data.recordings().iter().all(begins)
}

fn is_constant_everywhere(data: &DataFrame, var: usize) -> bool {
    data.recordings().iter().all(|recording| is_constant_column(recording.column(var))) && !differs(data, var)
}

/// Whether two recordings hold different values of a variable that is constant in each.
fn differs(data: &DataFrame, var: usize) -> bool {
    let mut values =
        data.recordings().iter().filter_map(|r| r.column(var).iter().copied().find(|v| !v.is_nan()));
    let first = values.next();
    values.any(|value| Some(value) != first)
}

/// What J-PCMCI+ finds among the variables of the data; what it finds of the dummy is told.
pub(super) fn of_variables(found: &JpcmciPlusResult, data: &DataFrame, classes: &[NodeClass]) -> PcmciResult {
    let n = data.n_vars();
    let vars: Vec<usize> = (0..n).collect();
    let mut result = found.result.on_features(&vars);
    result.parents = found.result.parents.iter().take(n).cloned().collect();
    let contexts = data.listed((0..n).filter(|&var| classes[var] != NodeClass::System));
    let differing = data.listed((0..n).filter(|&var| !found.dummy_parents[var].is_empty()));
    if !contexts.is_empty() {
        result.remarks.push(format!("taken as contexts, which drive and are not driven: {contexts}"));
    }
    if !differing.is_empty() {
        result.remarks.push(format!(
            "the recordings differ in {differing} for reasons that no column tells; that makes no link, because each recording was \
             compared with itself only"
        ));
    }
    result
}

/// What a reader should know of links from interventions.
pub(super) fn remarks_on_interventions(data: &DataFrame, interventions: &[Intervened]) -> Vec<String> {
    let name = |var: usize| &data.var_names()[var];
    let remark = |one: &Intervened| match one.variable {
        Some(variable) => {
            format!("'{}' drives '{}': this was given, not found", name(one.context), name(variable))
        }
        None => format!(
            "what '{}' acts on is not among the variables, so it may drive any of them; acts-on names its variable",
            name(one.context)
        ),
    };
    interventions.iter().map(remark).collect()
}

/// Removes the past of contexts from a graph: it was given, and says nothing of the system.
pub(super) fn without_their_past(result: &mut PcmciResult, interventions: &[Intervened]) {
    for one in interventions {
        let at = one.context;
        for lag in 1..result.graph.len_of(Axis(2)) {
            result.graph[[at, at, lag]] = LinkMark::Absent;
            result.val_matrix[[at, at, lag]] = 0.0;
            result.p_matrix[[at, at, lag]] = 1.0;
        }
    }
}
