//! What a method finds, before it becomes a model.

use ndarray::Array3;

use super::contexts::{of_variables, remarks_on_interventions, without_their_past};
use crate::{
    methods::{
        DynotearsSettings, FpcmciResult, FpcmciSettings, GrangerSettings, LpcmciSettings, Method,
        PcmciResult, Status, VarlingamSettings, get_lagged_dependencies, run_bivci, run_candoit,
        run_dynotears, run_fpcmci, run_fullci, run_granger, run_jpcmciplus, run_lpcmci, run_pcmci,
        run_pcmciplus, run_timino, run_tsfci, run_varlingam,
    },
    settings::Settings,
    types::{CondIndTest, Control, DataFrame, LinkMark, Result, Samples},
};

/// The result of a method.
pub(crate) enum MethodResult {
    /// Of one that keeps all variables.
    Plain(Box<PcmciResult>),
    /// Of one that leaves variables out.
    Filtered(Box<FpcmciResult>),
}

/// Marks and values of all variables of the data, `[cause][effect][lag]`.
pub(crate) struct Found {
    pub(crate) graph: Array3<LinkMark>,
    pub(crate) values: Array3<f64>,
}

/// Of a model of all variables at once, whose links are known at its end only: the time was up before.
fn nothing_yet(data: &DataFrame, settings: &Settings) -> PcmciResult {
    let n_samples = Samples::new(data, settings.tau_max).len();
    let how_far = format!("the time budget ended {} before its model was found", settings.method);
    PcmciResult {
        status: Status::Partial(how_far),
        ..PcmciResult::untested(data.n_vars(), settings.tau_max, n_samples)
    }
}

impl MethodResult {
    /// Runs the method of `settings`.
    pub(crate) fn of(
        data: &DataFrame,
        test: &dyn CondIndTest,
        settings: &Settings,
        control: &Control,
    ) -> Result<Self> {
        let pcmci = settings.pcmci(data);
        let plain = match settings.method {
            Method::Fpcmci => {
                let settings = FpcmciSettings {
                    te_estimator: settings.te_estimator,
                    f_alpha: settings.f_alpha.unwrap_or(settings.alpha),
                    neglect_only_autodep: settings.neglect_only_autodep,
                    seed: settings.seed,
                    pcmci,
                };
                return Ok(Self::Filtered(Box::new(run_fpcmci(data, test, &settings, control)?)));
            }
            Method::Pcmci => run_pcmci(data, test, &pcmci, control),
            Method::Pcmciplus => run_pcmciplus(data, test, &pcmci, &settings.pcmciplus, control),
            Method::Fullci => run_fullci(data, test, &pcmci, control),
            Method::Bivci => run_bivci(data, test, &pcmci, control),
            Method::Lagdep => get_lagged_dependencies(data, test, &pcmci, control),
            Method::Granger => {
                let settings = GrangerSettings {
                    tau_min: pcmci.tau_min,
                    tau_max: pcmci.tau_max,
                    choose_lags: None,
                    alpha_level: pcmci.alpha_level,
                    fdr: pcmci.fdr,
                    exogenous: settings.context(data),
                };
                run_granger(data, &settings, control).map(|found| found.links)
            }
            Method::Varlingam => {
                let settings = VarlingamSettings {
                    tau_max: pcmci.tau_max,
                    alpha_level: pcmci.alpha_level,
                    exogenous: settings.context(data),
                    ..VarlingamSettings::default()
                };
                run_varlingam(data, &settings, control).map(|found| found.links)
            }
            Method::Dynotears => {
                let settings = DynotearsSettings {
                    tau_max: pcmci.tau_max,
                    exogenous: settings.context(data),
                    ..DynotearsSettings::default()
                };
                run_dynotears(data, &settings, control).map(|found| found.links)
            }
            Method::Timino => {
                run_timino(data, &settings.timino(data, test.name())?, control).map(|found| found.links)
            }
            Method::Tsfci => run_tsfci(data, test, &settings.lpcmci(data), control),
            Method::Lpcmci => {
                run_lpcmci(data, test, &settings.lpcmci(data), control).map(|found| found.result)
            }
            Method::Candoit => Self::candoit(data, test, settings, control),
            Method::Jpcmciplus => {
                let chosen = settings.jpcmciplus(data)?;
                let found = run_jpcmciplus(data, test, &chosen, control)?;
                Ok(of_variables(&found, data, &chosen.classes))
            }
        };
        let plain = match plain {
            Err(error) if control.is_timeout(&error) => nothing_yet(data, settings),
            plain => plain?,
        };
        Ok(Self::Plain(Box::new(plain)))
    }

    /// CAnDOIT; the interventions are part of the result, as the causes of what they set.
    fn candoit(
        data: &DataFrame,
        test: &dyn CondIndTest,
        settings: &Settings,
        control: &Control,
    ) -> Result<PcmciResult> {
        let interventions = settings.interventions(data)?;
        let lpcmci = LpcmciSettings { link_assumptions: None, ..settings.lpcmci(data) };
        let mut result =
            run_candoit(data, test, &lpcmci, &interventions, settings.extra_conditions, control)?.result;
        without_their_past(&mut result, &interventions);
        result.remarks.extend(remarks_on_interventions(data, &interventions));
        Ok(result)
    }

    /// Whether the method came to its end.
    pub(crate) fn is_complete(&self) -> bool {
        let status = match self {
            Self::Plain(result) => &result.status,
            Self::Filtered(result) => &result.status,
        };
        *status == Status::Complete
    }

    /// Marks and values of all variables. One that the method leaves out has no link and the value 0.
    pub(crate) fn found(self, n_vars: usize, tau_max: usize) -> Found {
        let result = match self {
            Self::Plain(result) => return Found { graph: result.graph, values: result.val_matrix },
            Self::Filtered(result) => result,
        };
        let shape = (n_vars, n_vars, tau_max + 1);
        let mut all = Found { graph: Array3::default(shape), values: Array3::zeros(shape) };
        let Some(found) = &result.pcmci else { return all };
        let stays = |place: usize| result.features.contains(&result.selected[place]);
        for ((i, j, lag), &mark) in found.graph.indexed_iter() {
            if stays(i) && stays(j) {
                let at = [result.selected[i], result.selected[j], lag];
                all.graph[at] = mark;
                all.values[at] = found.val_matrix[[i, j, lag]];
            }
        }
        all
    }
}
