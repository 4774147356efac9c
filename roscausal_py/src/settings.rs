//! Settings as JSON objects, as the Python files make them, read into the engine's. A key that nobody reads is an error.

use std::sync::Arc;

use roscausal_discovery::{
    DataFrame, Dummy, Error, LinkAssumptions, Node, Result,
    independence_tests::{OracleCi, TestSettings},
    methods::{Fdr, JpcmciPlusSettings, LpcmciSettings, NodeClass, PcmciPlusSettings, PcmciSettings},
    names::nearest,
    settings::{Request, SETTINGS, Setting, Settings},
};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// A JSON object whose keys are taken one by one.
pub(crate) struct Given(Map<String, Value>);

impl Given {
    /// Reads the object.
    pub(crate) fn read(json: &str) -> Result<Self> {
        match serde_json::from_str(json) {
            Ok(Value::Object(map)) => Ok(Self(map)),
            _ => Err(Error::param("settings", "they are not a JSON object")),
        }
    }

    /// A value that is given and not null.
    pub(crate) fn take(&mut self, name: &str) -> Option<Value> {
        self.0.remove(name).filter(|value| !value.is_null())
    }

    /// A value of this type.
    fn read_as<T: DeserializeOwned>(&mut self, name: &str, wanted: &str) -> Result<Option<T>> {
        let wrong = |value: &Value| Error::param(name, format!("{value} is not {wanted}"));
        let read = |value: Value| serde_json::from_value(value.clone()).map_err(|_| wrong(&value));
        self.take(name).map(read).transpose()
    }

    /// A number.
    pub(crate) fn number(&mut self, name: &str) -> Result<Option<f64>> {
        self.read_as(name, "a number")
    }

    /// A whole number, not negative.
    pub(crate) fn count(&mut self, name: &str) -> Result<Option<usize>> {
        self.read_as(name, "a whole number of 0 or more")
    }

    /// A word.
    pub(crate) fn word(&mut self, name: &str) -> Result<Option<String>> {
        self.read_as(name, "a word")
    }

    /// True or false.
    pub(crate) fn flag(&mut self, name: &str) -> Result<Option<bool>> {
        self.read_as(name, "true or false")
    }

    /// A list of words; none if it is not given.
    pub(crate) fn words(&mut self, name: &str) -> Result<Vec<String>> {
        Ok(self.read_as(name, "a list of words")?.unwrap_or_default())
    }

    /// A list of numbers; one number is a list of one.
    fn numbers(&mut self, name: &str) -> Result<Option<Vec<f64>>> {
        if self.0.get(name).is_some_and(Value::is_number) {
            return Ok(self.number(name)?.map(|one| vec![one]));
        }
        self.read_as(name, "a number or a list of numbers")
    }

    /// Fails if a key was not taken.
    pub(crate) fn end(self) -> Result<()> {
        let Some(name) = self.0.keys().next() else { return Ok(()) };
        let known: Vec<&str> = SETTINGS.iter().map(|setting| setting.id).collect();
        let hint = nearest(&known, name).map_or(String::new(), |near| format!("; did you mean '{near}'?"));
        Err(Error::param(name, format!("there is no such setting{hint}")))
    }
}

/// Seconds per row, if they are given.
pub(crate) fn of_step(given: &mut Given) -> Result<Option<f64>> {
    match given.number("dt")? {
        Some(dt) if dt <= 0.0 => {
            let reason = format!("{dt} is not a number of seconds above 0; leave it out if there is none");
            Err(Error::param("dt", reason))
        }
        dt => Ok(dt),
    }
}

/// What `rc.discover` asks of an analysis.
pub(crate) fn of_analysis(given: &mut Given) -> Result<Request> {
    let value = |setting: &'static Setting| Some((setting, given.take(setting.id)?));
    Request::of(&SETTINGS.iter().filter_map(value).collect::<Vec<_>>()).map_err(of_rules)
}

/// The data with the request's variables, and the settings for them.
pub(crate) fn for_data(request: &Request, data: Arc<DataFrame>) -> Result<(Arc<DataFrame>, Settings)> {
    let data = match request.vectors.is_empty() {
        true => data,
        false => Arc::new((*data).clone().with_named_vectors(&request.vectors)?),
    };
    let settings = request.for_variables(data.var_names()).map_err(of_rules)?;
    Ok((data, settings))
}

/// What is wrong with rules about links is wrong with this setting.
fn of_rules(error: Error) -> Error {
    match error {
        Error::Data(reason) => Error::param("links", reason),
        other => other,
    }
}

/// The settings of a method, with the reference's words.
pub(crate) fn of_method(given: &mut Given, n_vars: usize) -> Result<(PcmciSettings, PcmciPlusSettings)> {
    let mut settings = PcmciSettings { tau_min: 0, ..PcmciSettings::default() };
    set(&mut settings.tau_min, given.count("tau_min")?);
    set(&mut settings.tau_max, given.count("tau_max")?);
    // No level: a score chooses one.
    settings.pc_alpha = given.numbers("pc_alpha")?.unwrap_or_default();
    set(&mut settings.alpha_level, given.number("alpha_level")?);
    settings.max_conds_dim = given.count("max_conds_dim")?;
    set(&mut settings.max_combinations, given.count("max_combinations")?);
    settings.max_conds_py = given.count("max_conds_py")?;
    settings.max_conds_px = given.count("max_conds_px")?;
    settings.max_conds_px_lagged = given.count("max_conds_px_lagged")?;
    if let Some(fdr) = given.word("fdr_method")? {
        settings.fdr = fdr.parse::<Fdr>()?.as_tigramite();
    }
    settings.link_assumptions =
        given.take("link_assumptions").map(|links| links_of(&links, n_vars)).transpose()?;
    let mut plus = PcmciPlusSettings::default();
    if let Some(rule) = given.word("contemp_collider_rule")? {
        plus.contemp_collider_rule = rule.parse()?;
    }
    set(&mut plus.conflict_resolution, given.flag("conflict_resolution")?);
    set(&mut plus.reset_lagged_links, given.flag("reset_lagged_links")?);
    set(&mut plus.pc_only, given.flag("pc_only")?);
    Ok((settings, plus))
}

/// What LPCMCI reads beside the settings of all methods.
pub(crate) fn of_latent(given: &mut Given, shared: &PcmciSettings) -> Result<LpcmciSettings> {
    let mut settings = LpcmciSettings {
        tau_min: shared.tau_min,
        tau_max: shared.tau_max,
        link_assumptions: shared.link_assumptions.clone(),
        max_p_global: given.count("max_p_global")?,
        max_p_non_ancestral: given.count("max_p_non_ancestral")?,
        max_q_global: given.count("max_q_global")?,
        max_pds_set: given.count("max_pds_set")?,
        ..LpcmciSettings::default()
    };
    set(&mut settings.pc_alpha, shared.pc_alpha.first().copied());
    set(&mut settings.n_preliminary_iterations, given.count("n_preliminary_iterations")?);
    set(&mut settings.max_cond_px, given.count("max_cond_px")?);
    set(&mut settings.prelim_with_collider_rules, given.flag("prelim_with_collider_rules")?);
    set(&mut settings.non_ancestral_phase, given.flag("non_ancestral_phase")?);
    Ok(settings)
}

/// What each variable is to J-PCMCI+, the dummies last.
pub(crate) fn of_contexts(given: &mut Given) -> Result<JpcmciPlusSettings> {
    let (mut classes, mut dummies) = (Vec::new(), Vec::new());
    for word in given.words("node_classification")? {
        match word.as_str() {
            "system" => classes.push(NodeClass::System),
            "space_context" => classes.push(NodeClass::SpaceContext),
            "time_context" => classes.push(NodeClass::TimeContext),
            "space_dummy" => dummies.push(Dummy::Space),
            "time_dummy" => dummies.push(Dummy::Time),
            other => {
                let known = "system, space_context, time_context, space_dummy, time_dummy";
                return Err(Error::param("node_classification", format!("'{other}' is not one of {known}")));
            }
        }
    }
    Ok(JpcmciPlusSettings { classes, dummies, ..JpcmciPlusSettings::default() })
}

/// The oracle that the JSON of a test's name and settings describes, if it does.
pub(crate) fn oracle_of(json: &str) -> Result<Option<OracleCi>> {
    let mut given = Given::read(json)?;
    let (Some(links), Some(n_vars)) = (given.take("links"), given.count("n_vars")?) else { return Ok(None) };
    OracleCi::new(&links_of(&links, n_vars)?).map(Some)
}

/// Puts a value that is given into its place.
pub(crate) fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

/// `[[cause, effect, lag, mark], ..]`.
fn links_of(value: &Value, n_vars: usize) -> Result<LinkAssumptions> {
    let mut links = LinkAssumptions::none(n_vars);
    for link in value.as_array().into_iter().flatten() {
        let at = |k: usize| link[k].as_u64().and_then(|v| usize::try_from(v).ok());
        let (Some(cause), Some(effect), Some(lag), Some(mark)) = (at(0), at(1), at(2), link[3].as_str())
        else {
            let reason = format!("{link} is not [cause, effect, lag, mark]");
            return Err(Error::param("link_assumptions", reason));
        };
        links.insert(cause, effect, lag, mark.parse()?)?;
    }
    Ok(links)
}

/// `[[[variable, lag], ..], ..]`: a list of nodes per target.
pub(crate) fn parents_of(value: &Value) -> Result<Vec<Vec<Node>>> {
    let wrong = |node: &Value| Error::param("parents", format!("{node} is not [variable, lag]"));
    let node = |node: &Value| {
        let at = |k: usize| node[k].as_u64().and_then(|v| usize::try_from(v).ok());
        at(0).zip(at(1)).map(|(var, lag)| Node::new(var, lag)).ok_or_else(|| wrong(node))
    };
    let lists = value.as_array().into_iter().flatten();
    lists.map(|list| list.as_array().into_iter().flatten().map(node).collect()).collect()
}

/// Name and settings of an independence test.
pub(crate) fn of_test(json: &str) -> Result<(String, TestSettings)> {
    let mut given = Given::read(json)?;
    let name = given.word("name")?.unwrap_or_default();
    let mut settings = TestSettings {
        significance: given.word("significance")?.map(|word| word.parse()).transpose()?,
        sig_samples: given.count("sig_samples")?,
        sig_blocklength: given.count("sig_blocklength")?,
        confidence: given.word("confidence")?.map(|word| word.parse()).transpose()?,
        conf_blocklength: given.count("conf_blocklength")?,
        max_memory: given.count("max_memory")?.map(|bytes| bytes as u64),
        as_tigramite: true,
        ..TestSettings::default()
    };
    set(&mut settings.knn, given.number("knn")?);
    set(&mut settings.shuffle_neighbors, given.count("shuffle_neighbors")?);
    set(&mut settings.transform, given.word("transform")?);
    set(&mut settings.conf_lev, given.number("conf_lev")?);
    set(&mut settings.conf_samples, given.count("conf_samples")?);
    set(&mut settings.seed, given.count("seed")?.map(|seed| seed as u64));
    given.end()?;
    Ok((name, settings))
}
