//! How an analysis is done, and what it may take.

use std::{path::PathBuf, time::Instant};

use roscausal_core::{Error, Result, threads};
use roscausal_discovery::{
    Control, DataFrame, Recommendation, Settings,
    confidence::{Resampled, Resampling, resample},
    methods::Method,
    settings::{Group, Kind, Readers, Request, SETTINGS, setting},
};

use super::ResampleArgs;
use crate::{
    chart,
    interrupt::Interrupt,
    settings::{AUTO, Given, of_groups},
};

/// How to analyse; the same arguments for every subcommand.
#[derive(Clone, Debug, Default)]
pub(crate) struct MethodArgs(Given);

of_groups!(MethodArgs, &[Group::Method]);

/// Resources of one analysis.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeansArgs {
    /// Threads; none or 0: all cores.
    pub(crate) threads: Option<usize>,
    /// Seconds after which to stop with a partial result.
    pub(crate) time_budget: Option<f64>,
    /// Megabytes that reading the files, or a test, may take; none: what is free, and no limit.
    pub(crate) max_memory: Option<u64>,
}

of_groups!(MeansArgs, &[Group::Run]);

impl MethodArgs {
    fn of(given: Given) -> Self {
        Self(given)
    }

    /// The largest lag, before anything is checked.
    pub(super) fn tau_max(&self) -> usize {
        self.0.number("tau_max").unwrap_or(Settings::default().tau_max)
    }

    /// The settings for these variables.
    pub(crate) fn for_variables(&self, request: &Request, names: &[String]) -> Result<Settings> {
        request.for_variables(names).map_err(|error| Error::of_rules(error, self.0.links()))
    }

    /// Whether the method is to be chosen.
    pub(super) fn is_auto(&self) -> bool {
        self.0.text("method") == Some(AUTO)
    }

    /// Whether the largest lag is to be found.
    pub(super) fn finds_lag(&self) -> bool {
        self.0.text("tau_max") == Some(AUTO)
    }

    /// As [`MethodArgs::request`], before a method is chosen: that of LPCMCI, which any data can be read for. Whether the chosen
    /// method reads what is given is checked once it is known.
    pub(super) fn request_for_reading(&self, seed: u64) -> Result<Request> {
        let given = self.0.only(|setting| setting.id != "tau_max" || !self.finds_lag());
        let method = match setting("method") {
            Some(method) if self.is_auto() => method,
            _ => return Self(given).request(seed),
        };
        let given = given.with(method, Method::Lpcmci.name());
        given.only(|setting| matches!(setting.readers, Readers::All)).request()?.check()?;
        seeded(&given, seed)
    }

    /// The settings with the method and test that `recommended` names, unless the user named the test or the lag.
    pub(super) fn chosen(&self, recommended: &Recommendation, request: &Request) -> Result<Settings> {
        let settings = &request.settings;
        let mut chosen = recommended.applied(settings);
        if self.0.text("test").is_some() {
            chosen.cond_ind_test.clone_from(&settings.cond_ind_test);
        }
        if self.0.text("tau_min").is_some() {
            chosen.tau_min = settings.tau_min;
        }
        Request { settings: chosen.clone(), ..request.clone() }.check()?;
        Ok(chosen)
    }

    /// The arguments as checked settings.
    pub(crate) fn request(&self, seed: u64) -> Result<Request> {
        let request = seeded(&self.0, seed)?;
        request.check()?;
        Ok(request)
    }
}

fn seeded(given: &Given, seed: u64) -> Result<Request> {
    let mut request = given.request()?;
    request.settings.seed = seed;
    Ok(request)
}

/// An analysis that a node does: what is asked, and the files that are named.
pub(crate) struct Analysis {
    request: Request,
    files: Vec<(&'static str, PathBuf)>,
}

impl Analysis {
    /// The analysis of these arguments.
    ///
    /// # Errors
    /// A setting that is not allowed, or a file that cannot be read.
    pub(crate) fn of(
        method: &MethodArgs,
        means: &MeansArgs,
        resample: &ResampleArgs,
        seed: u64,
    ) -> Result<Self> {
        let mut request = method.request(seed)?;
        if let Some(resampling) = resample.asked()? {
            request.resampling = resampling;
        }
        means.within_budget(Control::default())?;
        request.threads = means.threads.unwrap_or(0);
        request.time_budget = means.time_budget;
        request.settings.test.max_memory = means.max_bytes();
        Ok(Self { request, files: method.0.files().map(|(setting, file)| (setting.param, file)).collect() })
    }

    /// The node's parameters that are set.
    pub(crate) fn params(&self) -> impl Iterator<Item = (&'static str, String)> {
        SETTINGS.iter().filter_map(|setting| {
            if let Kind::File(_) = setting.kind {
                let file = self.files.iter().find(|(param, _)| *param == setting.param);
                return file.map(|(param, file)| (*param, file.display().to_string()));
            }
            let value = (setting.get)(&self.request);
            (!value.is_null()).then(|| (setting.param, setting.as_param(&value)))
        })
    }
}

impl MeansArgs {
    fn of(given: Given) -> Self {
        Self {
            threads: given.number("threads"),
            time_budget: given.number("time_budget"),
            max_memory: given.number("max_memory"),
        }
    }

    /// Bytes that reading the files, or a test, may take.
    pub(crate) fn max_bytes(&self) -> Option<u64> {
        self.max_memory.map(|megabytes| megabytes.saturating_mul(1_000_000))
    }

    /// Works with the given number of threads.
    pub(crate) fn in_pool<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        threads::in_pool(self.threads.unwrap_or(0), work)
    }

    /// The control of a run that begins now and ends when the time budget is used up.
    ///
    /// # Errors
    /// A budget that is no time.
    pub(crate) fn within_budget(&self, control: Control) -> Result<Control> {
        let Some(budget) = self.time_budget else { return Ok(control) };
        if budget.is_nan() || budget <= 0.0 {
            return Err(Error::param("time_budget", format!("{budget} is not a number of seconds above 0")));
        }
        let start = Instant::now();
        Ok(control.out_of_time(move || start.elapsed().as_secs_f64() > budget))
    }

    /// Runs the analysis with a progress bar (unless `quiet`), within the given time budget and threads.
    pub(super) fn analyse(
        &self,
        data: &DataFrame,
        settings: &Settings,
        resampling: Option<&Resampling>,
        interrupt: &Interrupt,
        quiet: bool,
    ) -> Result<Resampled> {
        let start = Instant::now();
        let bar = chart::bar("discovery", 0, quiet);
        let shown = bar.clone();
        let control = Control::default().cancel_on(interrupt.flag());
        let control = control.on_progress(move |progress| chart::show(&shown, progress));
        let control = self.within_budget(control)?;
        let mut found = self.in_pool(|| Ok(resample(data, settings, resampling, &control)?))?;
        bar.finish_and_clear();
        if let Some(effort) = control.effort() {
            tracing::info!("{effort}");
        }
        found.model.run_time_s = Some(start.elapsed().as_secs_f64());
        Ok(found)
    }
}
