//! The flags of an analysis: how it is done, and what it may take.

use std::{fmt::Display, time::Instant};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, threads};
use roscausal_discovery::{
    Choice, Control, DataFrame, PcAlpha, Settings, analyse_with_evidence,
    confidence::{Resampled, Resampling, resample},
    independence_tests::{self, GpSearch},
    methods::{Fdr, Method, MethodInfo, acts_on_of},
    transfer_entropy::TeEstimator,
};

use crate::{chart, interrupt::Interrupt};

/// How to analyse; the same arguments for every subcommand.
#[derive(ClapArgs, Clone)]
pub(crate) struct MethodArgs {
    #[arg(long, default_value = Method::default().name(), help = listed(
        "Discovery method; for `discover` also auto: says which to take for these data and why", Method::names()
    ))]
    pub(super) method: String,
    #[arg(long, help = format!(
        "{}. Default: {}", listed("Independence test", independence_tests::names()), default_of(|info| info.test)
    ))]
    pub(super) test: Option<String>,
    /// Significance level of a link, in (0, 1).
    #[arg(long, default_value_t = 0.05, allow_negative_numbers = true)]
    pub(super) alpha: f64,
    #[arg(long, help = format!("Smallest lag, in steps. Default: {}", default_of(|info| info.tau_min)))]
    pub(super) tau_min: Option<usize>,
    /// Largest lag, in steps; at most 100000.
    #[arg(long, default_value_t = 1)]
    pub(super) tau_max: usize,
    #[arg(long, help = format!(
        "Significance level of the condition selection, in (0, 1); `auto`: chosen by a score. Default: {}",
        default_of(|info| info.pc_alpha)
    ))]
    pub(super) pc_alpha: Option<String>,
    /// Significance level of F-PCMCI's filter; default: alpha.
    #[arg(long, allow_negative_numbers = true)]
    pub(super) f_alpha: Option<f64>,
    #[arg(long, default_value = TeEstimator::default().name(), help = listed("Estimator of F-PCMCI's filter; auto: gaussian for a linear test, else gaussian+dcor", TeEstimator::NAMES))]
    pub(super) te_estimator: String,
    #[arg(
        long, default_value = Fdr::None.name(), default_missing_value = Fdr::Bh.name(), num_args = 0..=1,
        help = listed("Correction for multiple testing", Fdr::NAMES)
    )]
    pub(super) fdr: String,
    #[arg(long, default_value = GpSearch::default().name(), help = listed(
        "How gpdc searches for the maximum of a likelihood (exact: every likelihood exact, slow; the same maxima)",
        GpSearch::NAMES
    ))]
    pub(super) gp_search: String,
    /// Searches of gpdc from this many random places more, of which the best counts; 0: the reference's answers.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(super) gp_restarts: usize,
    /// Columns that may be causes only (interventions, context), separated by commas.
    #[arg(long, value_delimiter = ',')]
    pub(super) exogenous: Vec<String>,
    /// candoit: columns of interventions and the variable that each sets, separated by commas; default: do_robot_speed=r_v,
    /// do_robot_off=r_v, do_human_v=h_v, do_human_stop=h_v, as far as they are there.
    #[arg(long, value_delimiter = ',', value_name = "COLUMN=VARIABLE")]
    pub(super) acts_on: Option<Vec<String>>,
}

/// The word for `--method` that asks for advice.
const AUTO: &str = "auto";

/// Resources of one analysis in the foreground.
#[derive(ClapArgs, Clone)]
pub(crate) struct MeansArgs {
    /// Threads; default: all cores. They do not change the result.
    #[arg(long)]
    pub(super) threads: Option<usize>,
    /// Seconds after which to stop with a partial result (roll: with the windows that came to their end).
    #[arg(long, value_name = "SECONDS")]
    pub(super) time_budget: Option<f64>,
    /// Megabytes that reading the files, or a test, may take; what needs more is refused. Default: what is free.
    #[arg(long, value_name = "MB")]
    pub(super) max_memory: Option<usize>,
}

/// The default of most methods, then that of each other one, by name.
fn default_of<T: PartialEq + Display>(setting: fn(&MethodInfo) -> T) -> String {
    let usual = setting(Method::default().info());
    let others = Method::all().map(Method::info).filter(|info| setting(info) != usual);
    others.fold(usual.to_string(), |text, info| format!("{text}, {} {}", info.name, setting(info)))
}

/// The help of an argument that takes one of these words.
fn listed<'a>(what: &str, words: impl IntoIterator<Item = &'a (impl AsRef<str> + ?Sized + 'a)>) -> String {
    let words: Vec<&str> = words.into_iter().map(AsRef::as_ref).collect();
    format!("{what}: {}", words.join(", "))
}

impl MethodArgs {
    /// The columns that may be causes only.
    pub(crate) fn exogenous(&self) -> &[String] {
        &self.exogenous
    }

    /// Whether the method is to be chosen.
    pub(super) fn is_auto(&self) -> bool {
        self.method == AUTO
    }

    /// As [`MethodArgs::settings`], before a method is chosen: those of LPCMCI, which any data can be read for. Whether the chosen
    /// method reads them is checked once it is known.
    pub(super) fn settings_for_reading(&self, seed: u64) -> Result<Settings> {
        if !self.is_auto() {
            return self.settings(seed);
        }
        let given = Self { method: Method::Lpcmci.name().to_owned(), ..self.clone() }.unchecked(seed)?;
        let usual = Settings::default();
        let of_any = Settings {
            f_alpha: None,
            te_estimator: usual.te_estimator,
            acts_on: None,
            gp_search: usual.gp_search,
            gp_restarts: usual.gp_restarts,
            ..given.clone()
        };
        of_any.check()?;
        Ok(given)
    }

    /// The settings with the method and test that `choice` names, unless the user named the test or the lag.
    pub(super) fn chosen(&self, choice: &Choice, settings: &Settings) -> Result<Settings> {
        let mut chosen = choice.applied(settings);
        if self.test.is_some() {
            chosen.cond_ind_test.clone_from(&settings.cond_ind_test);
        }
        chosen.tau_min = self.tau_min.unwrap_or(chosen.tau_min);
        chosen.check()?;
        Ok(chosen)
    }

    /// The arguments as checked settings.
    pub(crate) fn settings(&self, seed: u64) -> Result<Settings> {
        let settings = self.unchecked(seed)?;
        settings.check()?;
        Ok(settings)
    }

    fn unchecked(&self, seed: u64) -> Result<Settings> {
        let pc_alpha = match self.pc_alpha.as_deref() {
            None => PcAlpha::Default,
            Some("auto" | "none") => PcAlpha::ByScore,
            Some(text) => PcAlpha::Fixed(text.parse().map_err(|_| {
                Error::param("pc-alpha", format!("'{text}' is neither a number in (0, 1) nor 'auto'"))
            })?),
        };
        let method: Method = self.method.parse()?;
        Ok(Settings {
            method,
            cond_ind_test: usual_spelling(self.test.as_deref().unwrap_or(method.info().test)),
            alpha: self.alpha,
            pc_alpha,
            tau_min: self.tau_min.unwrap_or(method.info().tau_min),
            tau_max: self.tau_max,
            f_alpha: self.f_alpha,
            te_estimator: self.te_estimator.parse()?,
            fdr: self.fdr.parse()?,
            gp_search: self.gp_search.parse()?,
            gp_restarts: self.gp_restarts,
            exogenous: self.exogenous.clone(),
            acts_on: self.acts_on.as_deref().map(acts_on_of).transpose()?,
            seed,
            ..Settings::default()
        })
    }
}

/// A test's name as the registry spells it, whatever its case; an unknown one as it is.
fn usual_spelling(test: &str) -> String {
    let plain = |name: &str| name.replace(['-', '_'], "").to_lowercase();
    let known = independence_tests::names().find(|known| plain(known) == plain(test));
    known.map_or_else(|| test.to_owned(), str::to_owned)
}

impl MeansArgs {
    /// `--max-memory` in bytes.
    pub(crate) fn most_bytes(&self) -> Option<u64> {
        self.max_memory.map(|megabytes| (megabytes as u64).saturating_mul(1_000_000))
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
            let reason = format!("{budget} is not a number of seconds above 0");
            return Err(Error::param("time-budget", reason));
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
        let mut found = self.in_pool(|| {
            let Some(resampling) = resampling else {
                let (model, evidence) = analyse_with_evidence(data, settings, &control)?;
                return Ok(Resampled { model, evidence, graphs: Vec::new() });
            };
            Ok(resample(data, settings, resampling, &control)?)
        })?;
        bar.finish_and_clear();
        if let Some(effort) = control.effort() {
            tracing::info!("{effort}");
        }
        found.model.run_time_s = Some(start.elapsed().as_secs_f64());
        Ok(found)
    }
}
