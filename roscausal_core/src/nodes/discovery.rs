//! The discovery node: watches the pool, analyses the oldest batches, publishes the model.

use std::{
    collections::{BTreeMap, VecDeque},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use roscausal_discovery::{
    Control, DataProfile, Evidence, Levelled, Levels, Model, Progress,
    changes::{Form, Status},
    confidence::{resample, set_step},
    draw,
};
use roscausal_msgs::{
    CausalModel, CausalModelInfo, ModelChanges, Time,
    sensor_msgs::{CompressedImage, Image},
    std_msgs::{Header, String as Text},
};

use super::{
    discovery_params::{DiscoveryParams, specs},
    health::Health,
    model_changes::{CHANGES_TOPIC, model_changes, write_events},
    model_messages::{Origin, causal_model, causal_model_info, images},
    regime::{NewBatch, Regime, Rolling},
};
use crate::{
    Error, Result,
    batch::{
        joint::{Facts, Joint, Part, People},
        pool::{Claim, Pool, write_whole},
    },
    error::parameter,
    external,
    gate::lock,
    middleware::{Middleware, Publish, Qos},
    params::Params,
    threads::in_pool,
};

/// Topic of what stands behind each model: JSON with `batch` (as `batch_id` of the model), `conclusion` and `advice` (sentences of its summary) and `evidence`.
pub const EVIDENCE_TOPIC: &str = "roscausal/causal_evidence";
/// Folder beside the models that holds what stands behind them, a file of the same name for each.
pub const EVIDENCE_FOLDER: &str = "evidence";

/// Seconds before something that the disk or the middleware refused is tried again.
const TRY_AGAIN_S: f64 = 1.0;
/// Time between two checks of the pool, and of a request to end while an analysis runs.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// The discovery node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, a pool that cannot be opened, or a topic that cannot be advertised.
pub fn discovery<M: Middleware>(mw: &M) -> Result<()> {
    discovery_with(mw, |_| {})
}

/// The discovery node with a callback for the progress of each analysis.
///
/// # Errors
/// As [`discovery`].
pub fn discovery_with<M: Middleware>(
    mw: &M,
    on_progress: impl Fn(Progress) + Send + Sync + 'static,
) -> Result<()> {
    let read = Params::read(mw, &specs())?;
    let params = DiscoveryParams::new(&read)?;
    let pool = Pool::open(&params.data_dir, &params.csv_prefix)?.with_id_format(params.ids.clone());
    let kept = params.keep_batches.then(|| pool.path("analysed"));
    let rolling = params.rolling.map(|rolling| Rolling::open(&pool, rolling, kept)).transpose()?;
    let news = Arc::new(Mutex::new(None));
    let taken = news.clone();
    let take = move |params: &Params| {
        *lock(&taken) = Some(DiscoveryParams::new(params)?);
        Ok(())
    };
    mw.on_params(&read, Box::new(take));
    let mut node = Node {
        news,
        out: Outputs::new(mw)?,
        rolling,
        health: Health::new(mw)?,
        pool,
        params,
        last: BTreeMap::new(),
        unsaid: None,
        foreign: 0,
        figures: Figures::default(),
        trouble: None,
        tests: Arc::default(),
        on_progress: Arc::new(on_progress),
    };
    tracing::info!("watching {} for batches", node.pool.dir().display());
    let mut not_before = Duration::ZERO;
    node.tell_what_is_known(mw)?;
    while mw.is_ok() {
        if mw.steady() >= not_before {
            match node.look(mw) {
                Ok(busy) => {
                    node.trouble = None;
                    if busy {
                        continue;
                    }
                }
                // The diagnostics report it, once.
                Err(error) => {
                    node.trouble = Some(error.to_string());
                    not_before = mw.steady() + Duration::from_secs_f64(TRY_AGAIN_S);
                }
            }
        }
        node.report(mw);
        thread::sleep(LOOK_AGAIN);
    }
    Ok(())
}

/// Counters for the diagnostics.
#[derive(Default)]
struct Figures {
    models: u64,
    rejected: u64,
    incomplete: u64,
    dropped: u64,
}

struct Node<M: Middleware> {
    out: Outputs<M>,
    health: Health<M>,
    pool: Pool,
    params: DiscoveryParams,
    /// Parameters that were set since, for the next batch.
    news: Arc<Mutex<Option<DiscoveryParams>>>,
    /// The previous model of each person, and of all.
    last: BTreeMap<String, Model>,
    /// The present regime, if models roll on.
    rolling: Option<Rolling>,
    /// What could not be written or published yet.
    unsaid: Option<Unsaid>,
    figures: Figures,
    trouble: Option<String>,
    foreign: usize,
    /// Progress of the current analysis: tests done, and estimated tests in total. Both are 0 between analyses.
    tests: Arc<[AtomicUsize; 2]>,
    on_progress: Arc<dyn Fn(Progress) + Send + Sync>,
}

/// Models and their batches; and the regime with them, until it is written and told.
struct Unsaid {
    found: VecDeque<Found>,
    claims: Vec<Claim>,
    regime: Option<Regime>,
}

struct Outputs<M: Middleware> {
    model: M::Publisher<CausalModel>,
    info: M::Publisher<CausalModelInfo>,
    evidence: M::Publisher<Text>,
    changes: M::Publisher<ModelChanges>,
    dag: (M::Publisher<Image>, M::Publisher<CompressedImage>),
    tsdag: (M::Publisher<Image>, M::Publisher<CompressedImage>),
}

impl<M: Middleware> Outputs<M> {
    fn new(mw: &M) -> Result<Self> {
        let picture = |topic: &str| {
            let compressed = mw.advertise(&format!("{topic}/compressed"), Qos::Latched)?;
            Ok::<_, Error>((mw.advertise(topic, Qos::Latched)?, compressed))
        };
        Ok(Self {
            model: mw.advertise("roscausal/causal_model", Qos::Latched)?,
            info: mw.advertise("roscausal/causal_model_info", Qos::Latched)?,
            evidence: mw.advertise(EVIDENCE_TOPIC, Qos::Latched)?,
            changes: mw.advertise(CHANGES_TOPIC, Qos::Latched)?,
            dag: picture("roscausal/dag")?,
            tsdag: picture("roscausal/tsdag")?,
        })
    }
}

impl<M: Middleware> Node<M> {
    /// Analyses the oldest batches if there are enough. Returns whether there was anything to do.
    fn look(&mut self, mw: &M) -> Result<bool> {
        if let Some(unsaid) = self.unsaid.take() {
            return self.tell(mw, unsaid).map(|()| true);
        }
        if let Some(params) = lock(&self.news).take() {
            tracing::info!("new parameters from the next batch on");
            self.params = params;
        }
        self.pool.finish_all(self.params.keep_batches.then(|| self.pool.path("analysed")).as_deref())?;
        let contents = self.pool.contents()?;
        if contents.foreign.len() > self.foreign {
            let names: Vec<String> = contents.foreign.iter().cloned().collect();
            tracing::warn!("{}: left alone, no batches: {}", self.pool.dir().display(), names.join(", "));
        }
        self.foreign = contents.foreign.len();
        let surplus = match self.params.max_pool_size {
            0 => 0,
            most => contents.batches.len().saturating_sub(most),
        };
        for name in &contents.batches[..surplus] {
            if let Some(claim) = self.pool.claim(name)? {
                tracing::warn!("dropped {name}: more than max_pool_size batches wait for analysis");
                self.pool.remove(claim)?;
                self.figures.dropped += 1;
            }
        }
        let claims = self.claim(&contents.batches[surplus..])?;
        if claims.is_empty() {
            return Ok(false);
        }
        self.analyse(mw, claims)?;
        Ok(true)
    }

    /// Claims the oldest complete batches: all that one model needs, or none.
    fn claim(&mut self, batches: &[String]) -> Result<Vec<Claim>> {
        let mut claims = Vec::new();
        for name in batches {
            let Some(claim) = self.pool.claim(name)? else { continue };
            if claim.attempt() > self.params.max_attempts {
                let reason = format!("{} analyses of it ended without a result", claim.attempt() - 1);
                tracing::warn!("rejected {name}: {reason}");
                self.pool.reject(claim, &reason)?;
                self.figures.rejected += 1;
            } else if !self.params.analyse_incomplete && !Facts::read(&self.pool.path(name)).complete {
                tracing::warn!("set aside {name}: its recording was cut short (analyse_incomplete takes it)");
                self.pool.keep(claim, &self.pool.path("incomplete"))?;
                self.figures.incomplete += 1;
            } else {
                claims.push(claim);
            }
            if claims.len() == self.params.batches_per_model {
                return Ok(claims);
            }
        }
        claims.into_iter().try_for_each(Claim::abandon)?;
        Ok(Vec::new())
    }

    fn analyse(&mut self, mw: &M, claims: Vec<Claim>) -> Result<()> {
        let names: Vec<String> = claims.iter().map(|claim| claim.name().to_owned()).collect();
        let paths: Vec<PathBuf> = names.iter().map(|name| self.pool.path(name)).collect();
        tracing::info!("analysing {}", names.join(" with "));
        let start = mw.steady();
        match self.models_of(mw, &names, &paths) {
            Ok((mut found, regime)) => {
                let run_time = (mw.steady() - start).as_secs_f64();
                found.iter_mut().for_each(|(_, model, ..)| model.run_time_s = Some(run_time));
                self.tell(mw, Unsaid { found: found.into(), claims, regime })
            }
            // The time budget ended it: an attempt like any other.
            Err(Error::Cancelled(reason)) if mw.is_ok() => {
                tracing::warn!("{}: no result, {reason}", names.join(", "));
                Ok(())
            }
            Err(Error::Cancelled(reason)) => {
                tracing::info!("{} stays in the pool: {reason}", names.join(", "));
                claims.into_iter().try_for_each(Claim::abandon)
            }
            Err(error) => {
                tracing::error!("rejected {}: {error}", names.join(", "));
                self.figures.rejected += claims.len() as u64;
                claims.into_iter().try_for_each(|claim| self.pool.reject(claim, &error.to_string()))
            }
        }
    }

    /// What the method makes of batches.
    fn models_of(&mut self, mw: &M, names: &[String], paths: &[PathBuf]) -> Result<Made> {
        let params = self.params.clone();
        let rolling = self.rolling.take();
        let found = self.run_method(mw, |control| match (&rolling, names, paths) {
            (Some(rolling), [name], [path]) => {
                let (people, tau_max) = (people_of(&params), params.request.settings.tau_max);
                let form = Form::of_test(&params.request.settings.cond_ind_test);
                let exogenous = &params.request.settings.exogenous;
                let new = NewBatch { name, path, people, tau_max, form, exogenous };
                roll(&params, rolling, &new, control)
            }
            _ => Ok((method(&params, paths, None, control)?, None)),
        });
        self.rolling = rolling;
        found
    }

    /// Publishes the changes that an earlier process told, and completes what it left.
    fn tell_what_is_known(&self, mw: &M) -> Result<()> {
        let Some(rolling) = self.rolling.as_ref().filter(|rolling| !rolling.regime.last.is_empty()) else {
            return Ok(());
        };
        rolling.tidy()?;
        self.publish_changes(mw, &rolling.regime, "map")
    }

    /// Writes the regime, and tells what changed: what is announced is on disk.
    fn tell_changes(&mut self, mw: &M, regime: Regime, frame_id: &str) -> Result<()> {
        let Some(rolling) = &mut self.rolling else { return Ok(()) };
        let reported = rolling.regime.events.last().map_or(0, |reported| reported.number);
        rolling.save(regime)?;
        let Some(rolling) = &self.rolling else { return Ok(()) };
        for reported in rolling.regime.events.iter().filter(|event| event.number > reported) {
            match reported.event.status {
                Status::Confirmed => tracing::warn!("{}: {}", reported.batch, reported.event.sentence()),
                _ => tracing::info!("{}: {}", reported.batch, reported.event.sentence()),
            }
        }
        self.publish_changes(mw, &rolling.regime, frame_id)
    }

    fn publish_changes(&self, mw: &M, regime: &Regime, frame_id: &str) -> Result<()> {
        if let Some(dir) = &self.params.res_dir {
            write_events(dir, regime)?;
        }
        let header = Header { stamp: mw.now(), frame_id: frame_id.to_owned() };
        self.out.changes.publish(&model_changes(regime, header))
    }

    /// Writes and publishes changes and models, then releases their batches. What cannot be written is kept until it can.
    fn tell(&mut self, mw: &M, mut unsaid: Unsaid) -> Result<()> {
        if let Some(regime) = unsaid.regime.take() {
            let frame = unsaid.found.front().map_or(String::new(), |(.., origin)| origin.frame_id.clone());
            if let Err(error) = self.tell_changes(mw, regime.clone(), &frame) {
                self.unsaid = Some(Unsaid { regime: Some(regime), ..unsaid });
                return Err(error);
            }
        }
        while let Some(found) = unsaid.found.pop_front() {
            if let Err(error) = self.publish(mw, &found) {
                unsaid.found.push_front(found);
                self.unsaid = Some(unsaid);
                return Err(error);
            }
            self.figures.models += 1;
            self.health.sent();
            self.last.insert(found.0, found.1);
        }
        match &self.rolling {
            Some(rolling) => rolling.finish(unsaid.claims),
            None => {
                let kept = self.params.keep_batches.then(|| self.pool.path("analysed"));
                self.pool.finish(unsaid.claims, kept.as_deref())
            }
        }
    }

    /// Runs the method on a thread of its own. So a request to end is noticed within [`LOOK_AGAIN`], and health
    /// reports continue.
    fn run_method(&mut self, mw: &M, method: impl FnOnce(&Control) -> Result<Made> + Send) -> Result<Made> {
        let cancel = Arc::new(AtomicBool::new(false));
        let (on_progress, tests) = (self.on_progress.clone(), self.tests.clone());
        let mut control = Control::default().cancel_on(cancel.clone()).on_progress(move |progress| {
            tests[0].store(progress.done, Ordering::Relaxed);
            tests[1].store(progress.estimated_total, Ordering::Relaxed);
            on_progress(progress);
        });
        if let Some(budget) = self.params.request.time_budget {
            let (clock, end) = (mw.clone(), mw.steady() + Duration::from_secs_f64(budget));
            control = control.out_of_time(move || clock.steady() >= end);
        }
        let nice = self.params.nice;
        let found = thread::scope(|scope| {
            let work = scope.spawn(|| {
                be_nice(nice);
                method(&control)
            });
            while !work.is_finished() {
                if !mw.is_ok() {
                    cancel.store(true, Ordering::Relaxed);
                }
                self.report(mw);
                thread::sleep(LOOK_AGAIN / 10);
            }
            let died = || {
                Error::Data("the analysis ended by an internal error; please report it with the batch".into())
            };
            work.join().unwrap_or_else(|_| Err(died()))
        });
        self.tests.iter().for_each(|tests| tests.store(0, Ordering::Relaxed));
        found
    }

    /// Reports the node's health if a report is due.
    fn report(&mut self, mw: &M) {
        let left = self.health.next.secs_since(mw.now());
        // A clock that jumped back must not stop the reports.
        if left > 0.0 && left < 5.0 {
            return;
        }
        let contents = self.pool.contents();
        let trouble = contents.as_ref().err().map(ToString::to_string).or_else(|| self.trouble.clone());
        let [done, of] = [0, 1].map(|which| self.tests[which].load(Ordering::Relaxed));
        let regime = self.rolling.as_ref().map(|rolling| &rolling.regime);
        let figures = [
            ("batches waiting", contents.map_or(0, |contents| contents.batches.len()).to_string()),
            ("tests done", done.to_string()),
            ("tests in all", of.to_string()),
            ("models", self.figures.models.to_string()),
            ("batches rejected", self.figures.rejected.to_string()),
            ("batches set aside, cut short", self.figures.incomplete.to_string()),
            ("batches dropped, pool full", self.figures.dropped.to_string()),
            ("batches of the model", regime.map_or(0, |regime| regime.window.len()).to_string()),
            ("regime", regime.map_or(0, Regime::number).to_string()),
            ("changes confirmed", regime.map_or(0, |regime| regime.count(Status::Confirmed)).to_string()),
            ("change suspected", regime.and_then(Regime::suspicion).unwrap_or_else(|| "none".into())),
        ];
        self.health.report(mw, || figures, trouble.as_deref());
    }

    /// Writes the model's files, then publishes: what is announced exists.
    fn publish(&self, mw: &M, (person, model, evidence, origin): &Found) -> Result<()> {
        let (dag, tsdag) = (draw::dag(model), draw::tsdag(model));
        let summary = model.summary().spelled(parameter);
        if let Some(dir) = &self.params.res_dir {
            if let Some(evidence) = evidence {
                write_evidence(dir, evidence, &origin.batch_id)?;
            }
            write_files(dir, model, &origin.batch_id, &dag, &tsdag)?;
        }
        let header = Header { stamp: mw.now(), frame_id: origin.frame_id.clone() };
        for (svg, (raw, compressed)) in [(&dag, &self.out.dag), (&tsdag, &self.out.tsdag)] {
            let (image, png) = images(svg, self.params.image_scale, &header)?;
            raw.publish(&image)?;
            compressed.publish(&png)?;
        }
        if let Some(evidence) = evidence {
            let advice: Vec<&str> = summary.advice.iter().map(|advice| advice.text.as_str()).collect();
            let data = serde_json::json!({
                "batch": origin.batch_id, "conclusion": summary.conclusion, "advice": advice, "evidence": evidence,
            });
            self.out.evidence.publish(&Text { data: data.to_string() })?;
        }
        self.out.info.publish(&causal_model_info(model, &header, origin, self.last.get(person)))?;
        self.out.model.publish(&causal_model(model, &header))?;
        let (stated, next) = (summary.conclusion.iter(), summary.advice.iter().map(|advice| &advice.text));
        let stated: Vec<&str> = stated.chain(next).map(String::as_str).collect();
        tracing::info!("{}: {} links. {}", origin.batch_id, model.links.len(), stated.join(" "));
        Ok(())
    }
}

fn write_files(dir: &Path, model: &Model, name: &str, dag: &str, tsdag: &str) -> Result<()> {
    for (suffix, svg) in [("dag", dag), ("tsdag", tsdag)] {
        write_whole(&dir.join(format!("{name}.{suffix}.svg")), svg.as_bytes())?;
        write_whole(&dir.join(format!("{name}.{suffix}.png")), &draw::rasterise(svg, 2.0)?.png)?;
    }
    write_whole(&dir.join(format!("{name}.json")), model.to_file_json().as_bytes())
}

/// In a folder of its own, so that the models stay the only JSON files of theirs.
fn write_evidence(dir: &Path, evidence: &Evidence, name: &str) -> Result<()> {
    let dir = dir.join(EVIDENCE_FOLDER);
    std::fs::create_dir_all(&dir).map_err(|e| Error::file(&dir, e))?;
    write_whole(&dir.join(format!("{name}.json")), evidence.to_json().as_bytes())
}

/// Whose model it is (empty: everybody's), the model, what stands behind it (a program tells nothing), and where it comes
/// from.
type Found = (String, Model, Option<Evidence>, Origin);

/// The models of batches, and the regime with them if models roll on.
type Made = (Vec<Found>, Option<Regime>);

/// A program reads the batches itself, so it makes one model.
fn people_of(params: &DiscoveryParams) -> People {
    if params.program.is_some() { People::Joint } else { params.people }
}

/// Reads a new batch for changes, and makes the model of the present regime. If the batches before do not fit, of it alone.
fn roll(params: &DiscoveryParams, rolling: &Rolling, new: &NewBatch<'_>, control: &Control) -> Result<Made> {
    let mut regime = rolling.regime.clone();
    let is_new = regime.last != new.name;
    in_pool(params.request.threads, || regime.read(new, &rolling.params, control))?;
    let paths = rolling.paths(&regime, new.path);
    let mut found = match method(params, &paths, Some(&regime), control) {
        Err(error) if paths.len() > 1 && !matches!(error, Error::Cancelled(_)) => {
            tracing::warn!("{}: not analysed with the batches before it: {error}", new.name);
            regime.begin_anew();
            method(params, &[new.path.to_owned()], Some(&regime), control)?
        }
        found => found?,
    };
    found.iter_mut().for_each(|(person, model, ..)| regime.age(person, model, is_new));
    Ok((found, Some(regime)))
}

/// Reads the batches as recordings of one system and analyses them: one model, or one per person. A model that rolls on has the
/// rows of the present regime, and the name of its newest batch.
fn method(
    params: &DiscoveryParams,
    paths: &[PathBuf],
    regime: Option<&Regime>,
    control: &Control,
) -> Result<Vec<Found>> {
    let mut joint = Joint::read(paths)?;
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<String> = paths.iter().map(name).collect();
    let mut stems = names.iter().map(|name| name.strip_suffix(".csv").unwrap_or(name));
    let batch_id = match regime {
        Some(_) => stems.next_back().unwrap_or_default().to_owned(),
        None => stems.collect::<Vec<_>>().join("+"),
    };
    let stamp = |secs: Option<f64>| secs.map_or(Time::ZERO, Time::from_secs_f64);
    let (start, end) = joint.span();
    let mut found = Vec::new();
    for part in joint.parts(people_of(params))? {
        let part = if let Some(regime) = regime { regime.of_present(part, &names)? } else { part };
        let mut request = params.request.clone();
        let named = &params.request.settings.exogenous;
        let new = part.exogenous.iter().filter(|name| !named.contains(name)).cloned();
        request.settings.exogenous.extend(new);
        let data = part.data.with_named_vectors(&request.vectors)?;
        let settings = request.for_variables(data.var_names());
        let settings = settings.map_err(|error| Error::of_rules(error, params.links.as_ref()))?;
        // Batches follow one another in one run; with `remove` each has a level of its own all the same.
        let each = if settings.levels == Levels::Remove { data.recordings().len() } else { 0 };
        let Levelled { data, settings, note } = Levelled::of(data, &(0..each).collect::<Vec<_>>(), settings);
        let part = Part { data, ..part };
        let (mut model, evidence) = match &params.program {
            Some(program) => {
                (external::run(program, paths, &settings, params.request.threads, control)?, None)
            }
            None => in_pool(params.request.threads, || {
                let found = resample(&part.data, &settings, params.resampling.as_ref(), control)?;
                Ok((found.model, Some(found.evidence)))
            })?,
        };
        set_step(&mut model, joint.dt);
        let (profile, _) = DataProfile::of(&part.data, settings.tau_max);
        model.about_data = Some(settings.look_later(profile, &part.data, joint.dt));
        model.warnings.extend(note);
        model.n_recordings = part.data.recordings().len();
        let person = part.person.map_or(String::new(), |id| format!("_person_{id}"));
        let origin = Origin {
            batch_id: format!("{batch_id}{person}"),
            frame_id: joint.frame().to_owned(),
            start: stamp(start),
            end: stamp(end),
            candidate_features: part.data.var_names().to_vec(),
        };
        found.push((person, model, evidence, origin));
    }
    let with_warnings = |(person, mut model, evidence, origin): Found| {
        model.warnings.splice(0..0, joint.warnings.iter().cloned());
        (person, model.spelled(parameter), evidence, origin)
    };
    Ok(found.into_iter().map(with_warnings).collect())
}

/// Lowers the priority of the calling thread, and of the threads and programs that it starts from now on.
fn be_nice(nice: i32) {
    #[cfg(target_os = "linux")]
    if nice > 0
        && let Err(error) = rustix::process::setpriority_process(None, nice)
    {
        tracing::warn!("nice {nice} is refused: {error}");
    }
    #[cfg(not(target_os = "linux"))]
    let _ = nice;
}
