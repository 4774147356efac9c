//! The discovery node: watches the pool, analyses the oldest batches, publishes the model.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use roscausal_msgs::{
    CausalModel, CausalModelInfo, Time,
    sensor_msgs::{CompressedImage, Image},
    std_msgs::Header,
};

use super::{
    discovery_params::{DiscoveryParams, specs},
    health::Health,
    model_messages::{Origin, causal_model, causal_model_info, images},
};
use crate::{
    Error, Result,
    batch::{
        Table,
        pool::{Claim, Pool, sidecar, write_whole},
    },
    discovery::{Control, DataFrame, Model, Progress, analysis, external},
    draw,
    middleware::{Middleware, Publish, Qos},
    params::Params,
};

/// Wait before what the disk or the middleware refused is tried again.
const TRY_AGAIN_S: f64 = 1.0;
/// Wait between two looks at the pool, and at the wish to end while an analysis runs.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// The discovery node: runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, a pool that cannot be opened, a topic that cannot be advertised.
pub fn discovery<M: Middleware>(mw: &M) -> Result<()> {
    discovery_with(mw, |_| {})
}

/// The discovery node with a listener for the progress of each analysis.
///
/// # Errors
/// As [`discovery`].
pub fn discovery_with<M: Middleware>(
    mw: &M,
    on_progress: impl Fn(Progress) + Send + Sync + 'static,
) -> Result<()> {
    let params = DiscoveryParams::new(&Params::read(mw, &specs())?)?;
    let pool = Pool::open(&params.data_dir, &params.csv_prefix)?;
    let mut node = Node {
        out: Outputs::new(mw)?,
        health: Health::new(mw)?,
        pool,
        params,
        last: None,
        unsaid: None,
        foreign: 0,
        figures: Figures::default(),
        trouble: None,
        tests: Arc::default(),
        on_progress: Arc::new(on_progress),
    };
    tracing::info!("watching {} for batches", node.pool.dir().display());
    let mut not_before = Duration::ZERO;
    while mw.is_ok() {
        if mw.steady() >= not_before {
            match node.look(mw) {
                Ok(busy) => {
                    node.trouble = None;
                    if busy {
                        continue;
                    }
                }
                // Told by the diagnostics, once.
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

/// What the node has done, for the diagnostics.
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
    last: Option<Model>,
    /// A model that could not be written or published yet, with its batches.
    unsaid: Option<(Model, Origin, Vec<Claim>)>,
    figures: Figures,
    trouble: Option<String>,
    foreign: usize,
    /// Of the analysis under way: tests done, tests in all as estimated; both 0 between two.
    tests: Arc<[AtomicUsize; 2]>,
    on_progress: Arc<dyn Fn(Progress) + Send + Sync>,
}

struct Outputs<M: Middleware> {
    model: M::Publisher<CausalModel>,
    info: M::Publisher<CausalModelInfo>,
    dag: (M::Publisher<Image>, M::Publisher<CompressedImage>),
    tsdag: (M::Publisher<Image>, M::Publisher<CompressedImage>),
}

impl<M: Middleware> Outputs<M> {
    fn new(mw: &M) -> Result<Self> {
        Ok(Self {
            model: mw.advertise("/roscausal/causal_model", Qos::Latched)?,
            info: mw.advertise("/roscausal/causal_model_info", Qos::Latched)?,
            dag: (
                mw.advertise("/roscausal/dag", Qos::Latched)?,
                mw.advertise("/roscausal/dag/compressed", Qos::Latched)?,
            ),
            tsdag: (
                mw.advertise("/roscausal/tsdag", Qos::Latched)?,
                mw.advertise("/roscausal/tsdag/compressed", Qos::Latched)?,
            ),
        })
    }
}

impl<M: Middleware> Node<M> {
    /// Analyses the oldest batches if there are enough; whether there was anything to do.
    fn look(&mut self, mw: &M) -> Result<bool> {
        if let Some((model, origin, claims)) = self.unsaid.take() {
            return self.tell(mw, model, origin, claims).map(|()| true);
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

    /// Claims the oldest complete batches, all that one model needs or none.
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
        match self.run_method(mw, &paths) {
            Ok((mut model, origin)) => {
                model.run_time_s = Some((mw.steady() - start).as_secs_f64());
                self.tell(mw, model, origin, claims)
            }
            // The time budget: an attempt like any other.
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

    /// Writes and publishes a model, then lets its batches go. A model that cannot be written is kept until it can.
    fn tell(&mut self, mw: &M, model: Model, origin: Origin, claims: Vec<Claim>) -> Result<()> {
        if let Err(error) = self.publish(mw, &model, &origin) {
            self.unsaid = Some((model, origin, claims));
            return Err(error);
        }
        self.figures.models += 1;
        self.health.sent();
        self.last = Some(model);
        self.pool.finish(claims, self.params.keep_batches.then(|| self.pool.path("analysed")).as_deref())
    }

    /// Runs the method on a thread of its own, so that a wish to end is heard within [`LOOK_AGAIN`] and the health
    /// is told meanwhile.
    fn run_method(&mut self, mw: &M, paths: &[PathBuf]) -> Result<(Model, Origin)> {
        let cancel = Arc::new(AtomicBool::new(false));
        let (on_progress, tests) = (self.on_progress.clone(), self.tests.clone());
        let control = Control::default().cancel_on(cancel.clone()).on_progress(move |progress| {
            tests[0].store(progress.done, Ordering::Relaxed);
            tests[1].store(progress.estimated_total, Ordering::Relaxed);
            on_progress(progress);
        });
        let control = match self.params.time_budget_s {
            Some(budget) => {
                let (clock, end) = (mw.clone(), mw.steady() + Duration::from_secs_f64(budget));
                control.out_of_time(move || clock.steady() >= end)
            }
            None => control,
        };
        let params = self.params.clone();
        let found = thread::scope(|scope| {
            let work = scope.spawn(|| {
                be_nice(params.nice);
                method(&params, paths, &control)
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

    /// Reports the node's health if it is time to.
    fn report(&mut self, mw: &M) {
        let left = self.health.due().secs_since(mw.now());
        // A clock that jumped back must not silence the reports.
        if left > 0.0 && left < 5.0 {
            return;
        }
        let contents = self.pool.contents();
        let trouble = contents.as_ref().err().map(ToString::to_string).or_else(|| self.trouble.clone());
        let [done, of] = [0, 1].map(|which| self.tests[which].load(Ordering::Relaxed));
        let figures = [
            ("batches waiting", contents.map_or(0, |contents| contents.batches.len()).to_string()),
            ("tests done", done.to_string()),
            ("tests in all", of.to_string()),
            ("models", self.figures.models.to_string()),
            ("batches rejected", self.figures.rejected.to_string()),
            ("batches set aside, cut short", self.figures.incomplete.to_string()),
            ("batches dropped, pool full", self.figures.dropped.to_string()),
        ];
        self.health.report(mw, &figures, trouble.as_deref());
    }

    /// Writes the model's files, then publishes: what is announced is there.
    fn publish(&self, mw: &M, model: &Model, origin: &Origin) -> Result<()> {
        let (dag, tsdag) = (draw::dag(model), draw::tsdag(model));
        if let Some(dir) = &self.params.res_dir {
            write_files(dir, model, &origin.batch_id, &dag, &tsdag)?;
        }
        let header = Header { stamp: mw.now(), frame_id: origin.frame_id.clone() };
        for (svg, (raw, compressed)) in [(&dag, &self.out.dag), (&tsdag, &self.out.tsdag)] {
            let (image, png) = images(svg, self.params.image_scale, &header)?;
            raw.publish(&image)?;
            compressed.publish(&png)?;
        }
        self.out.info.publish(&causal_model_info(model, &header, origin, self.last.as_ref()))?;
        self.out.model.publish(&causal_model(model, &header))?;
        tracing::info!("{}: {} links", origin.batch_id, model.links.len());
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

/// Reads the batches as recordings of one system and analyses them.
fn method(params: &DiscoveryParams, paths: &[PathBuf], control: &Control) -> Result<(Model, Origin)> {
    let facts: Vec<Facts> = paths.iter().map(|path| Facts::read(path)).collect();
    let stem =
        |path: &PathBuf| path.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
    let mut origin = Origin {
        batch_id: paths.iter().map(stem).collect::<Vec<_>>().join("+"),
        frame_id: facts[0].frame.clone(),
        ..Origin::default()
    };
    let mut tables: Vec<Table> = Vec::new();
    for path in paths {
        let wanted = tables.first().map(|first| first.names.clone());
        tables.push(Table::read(path, wanted.as_deref())?);
    }
    let dt = tables[0].dt();
    let stamp = |secs: Option<&f64>| secs.map_or(Time::ZERO, |&secs| Time::from_secs_f64(secs));
    origin.start = stamp(tables[0].time.as_ref().and_then(|time| time.first()));
    origin.end = stamp(tables[tables.len() - 1].time.as_ref().and_then(|time| time.last()));
    origin.candidate_features = tables[0].names.clone();
    let warnings: Vec<String> = tables.iter().flat_map(|table| table.warnings.clone()).collect();

    let mut settings = params.settings.clone();
    settings.exogenous =
        facts[0].context.iter().filter(|name| tables[0].names.contains(name)).cloned().collect();
    let mut model = match &params.program {
        Some(program) => external::run(program, paths, &settings, params.threads, control)?,
        None => {
            let data =
                DataFrame::new(tables.iter().map(|t| t.values.clone()).collect(), tables[0].names.clone())?;
            in_pool(params.threads, || analysis::analyse(&data, &settings, control))?
        }
    };
    model.dt = dt;
    model.n_recordings = paths.len();
    model.warnings.splice(0..0, warnings);
    Ok((model, origin))
}

/// Lets the calling thread, and the threads and programs that it starts from now on, stand back for the others.
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

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::param("threads", e))?.install(work)
}

/// What the metadata beside a batch says; a batch without any is complete.
struct Facts {
    complete: bool,
    frame: String,
    context: Vec<String>,
}

impl Facts {
    fn read(batch: &Path) -> Self {
        let name = batch.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        let text = std::fs::read(batch.with_file_name(sidecar(&name))).unwrap_or_default();
        let json: serde_json::Value = serde_json::from_slice(&text).unwrap_or_default();
        let strings = |value: &serde_json::Value| -> Vec<String> {
            let items = value.as_array().into_iter().flatten();
            items.filter_map(|item| item.as_str().map(str::to_owned)).collect()
        };
        Self {
            complete: json["complete"].as_bool().unwrap_or(true),
            frame: json["frame"].as_str().unwrap_or("map").to_owned(),
            context: strings(&json["context"]),
        }
    }
}
