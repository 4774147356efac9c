//! What a user asks of an analysis, before the data are known.

use serde_json::{Map, Value, json};

use super::{Group, LinkRules, PcAlpha, Resampling, SETTINGS, Setting, Settings};
use crate::{
    independence_tests::{by_name, names, spelled},
    methods::Method,
    model::Model,
    types::{Error, Named, Result, VectorNames, names::position},
};

with_defaults! {
    /// All settings of an analysis. [`Request::for_variables`] gives the [`Settings`] for some data.
    ///
    /// ```
    /// use roscausal_discovery::settings::{Request, setting};
    /// use serde_json::json;
    ///
    /// let given = [("method", json!("pcmciplus")), ("tau_max", json!(3))];
    /// let given = given.map(|(name, value)| (setting(name).expect("a setting"), value));
    /// let request = Request::of(&given)?;
    /// assert_eq!((request.settings.tau_min, request.settings.tau_max), (0, 3));
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    #[derive(Clone, Debug, PartialEq)]
    pub struct Request {
        /// What needs no data.
        pub settings: Settings = Settings::default(),
        /// Columns that are one variable.
        pub vectors: VectorNames = Vec::new(),
        /// What is known of links.
        pub links: Option<LinkRules> = None,
        /// How to resample; 0 resamples: not.
        pub resampling: Resampling = Resampling { resamples: 0, ..Resampling::default() },
        /// Threads of the analysis; 0: all cores.
        pub threads: usize = 0,
        /// Seconds after which the result is a partial one.
        pub time_budget: Option<f64> = None,
    }
}

impl Request {
    /// The defaults of a method.
    pub fn of_method(method: Method) -> Self {
        let info = method.info();
        let settings = Settings {
            method,
            tau_min: info.tau_min,
            cond_ind_test: info.test.to_owned(),
            ..Settings::default()
        };
        Self { settings, ..Self::default() }
    }

    /// The request with these values; what is not given has the default of the method.
    ///
    /// # Errors
    /// The first value that is not allowed on its own.
    pub fn of(given: &[(&'static Setting, Value)]) -> Result<Self> {
        let mut request = Self::default();
        for (setting, value) in given.iter().filter(|(setting, _)| setting.id == "method") {
            setting.put(&mut request, value)?;
        }
        request = Self::of_method(request.settings.method);
        given.iter().try_for_each(|(setting, value)| setting.put(&mut request, value))?;
        let is_given = |id: &str| given.iter().any(|(setting, _)| setting.id == id);
        // A method with one level has it by either name.
        if request.settings.method.info().one_level && is_given("alpha") && !is_given("pc_alpha") {
            request.settings.pc_alpha = PcAlpha::Fixed(request.settings.alpha);
            request.settings.alpha = Settings::default().alpha;
        }
        // As the registry spells it; an unknown one is refused where it is made.
        let wanted = spelled(&request.settings.cond_ind_test);
        if names().any(|known| known == wanted) {
            request.settings.cond_ind_test = wanted;
        }
        Ok(request)
    }

    /// Checks everything that can be known without data.
    ///
    /// # Errors
    /// The first setting that is not allowed, or that nobody reads.
    pub fn check(&self) -> Result<()> {
        self.settings.check()?;
        self.check_readers()?;
        self.check_vectors()?;
        self.resampling().map(drop)
    }

    /// Refuses settings that neither the method nor the test reads.
    pub(super) fn check_readers(&self) -> Result<()> {
        let Settings { method, cond_ind_test, test, .. } = &self.settings;
        let of_links = self.settings.link_assumptions.is_some();
        let given = |setting: &&Setting| setting.is_given(self) || (of_links && setting.id == "links");
        for setting in SETTINGS.iter().filter(given) {
            if let Some(reason) = setting.refusal(*method, cond_ind_test, test.significance) {
                return Err(Error::param(setting.id, reason));
            }
        }
        Ok(())
    }

    fn check_vectors(&self) -> Result<()> {
        if self.vectors.is_empty() {
            return Ok(());
        }
        let (method, test) =
            (self.settings.method, by_name(&self.settings.cond_ind_test, &Default::default())?);
        // F-PCMCI's filter reads columns; what uses no test does so too.
        let by_columns = method == Method::Fpcmci || !method.info().uses_test;
        if !by_columns && test.supports_vectors() {
            return Ok(());
        }
        let reason = format!(
            "{} takes each variable for one column; choose {} parcorrmult and a method that uses a test, such as pcmci",
            if by_columns { method.name() } else { test.name() },
            Named("test")
        );
        Err(Error::param("vectors", reason))
    }

    /// How to resample; `None`: not.
    ///
    /// # Errors
    /// Numbers that make no sense.
    pub fn resampling(&self) -> Result<Option<Resampling>> {
        if self.resampling.resamples == 0 {
            return Ok(None);
        }
        self.resampling.check()?;
        Ok(Some(self.resampling.clone()))
    }

    /// The settings of the method that are not the default and have no field of their own in the model.
    pub(super) fn beyond(&self, model: &Model) -> Map<String, Value> {
        let fields = json!(model);
        let is_field =
            |setting: &Setting| fields.get(setting.id).or_else(|| fields.get(setting.param)).is_some();
        let others = SETTINGS.iter().filter(|setting| setting.group == Group::Method && setting.of_data);
        let given = others.filter(|setting| !is_field(setting) && setting.is_given(self));
        given.map(|setting| (setting.id.to_owned(), (setting.get)(self))).collect()
    }

    /// The settings for these variables.
    ///
    /// # Errors
    /// What is known of links that cannot be: [`Error::Data`] for what is wrong with the rules, of which a surface says where they are.
    pub fn for_variables(&self, names: &[String]) -> Result<Settings> {
        let Settings { tau_min, tau_max, exogenous, .. } = &self.settings;
        let exogenous: Vec<usize> = exogenous.iter().filter_map(|name| position(names, name)).collect();
        let known = |rules: &LinkRules| rules.for_variables(names, [*tau_min, *tau_max], &exogenous);
        let known = self.links.as_ref().map(known).transpose()?;
        Ok(Settings { link_assumptions: known, ..self.settings.clone() })
    }
}

impl Settings {
    /// The settings without those that neither the method nor the test reads: these have their defaults.
    #[must_use]
    pub fn as_read(&self) -> Self {
        let Self { method, cond_ind_test, test, .. } = self;
        let mut request = Request { settings: self.clone(), ..Request::default() };
        let unread =
            |setting: &&Setting| setting.refusal(*method, cond_ind_test, test.significance).is_some();
        for setting in SETTINGS.iter().filter(unread) {
            // A default is always allowed.
            (setting.set)(&mut request, &setting.default_value()).unwrap_or(());
        }
        request.settings
    }
}
