//! The reasoning node: the newest rows and the newest model in; predictions, and answers to questions, out. It advises and commands
//! nothing.
//!
//! The node's thread owns rows and model. Equations are fitted on a thread of their own, and answers are computed by a pool of threads
//! on copies, so that a long question or a fit holds up neither the rows nor the next question. On a lockstep bus all of it happens in line, so
//! that a run is a function of its seed, unless it runs beside the bus.

use std::{
    sync::{
        Arc, Weak,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use rayon::{ThreadPool, ThreadPoolBuilder};
use roscausal_discovery::DataFrame;
use roscausal_msgs::{
    Cancel, CancelRequest, CancelResponse, CausalModelInfo, Effect, EffectRequest, EffectResponse, Explain,
    ExplainRequest, ExplainResponse, Features, Prediction, Route, RouteRequest, RouteResponse, Time, WhatIf,
    WhatIfRequest, WhatIfResponse,
    nav_msgs::OccupancyGrid,
    nav2_msgs::CostmapFilterInfo,
    std_msgs::{Header, String as Text},
};
use roscausal_reasoning::{
    Facts, StructuralModel,
    answer::{self, EffectQuestion, ExplainQuestion, Status},
    graph::Graph,
    question::Situation,
};

use super::{
    FEATURES_TOPIC,
    health::Health,
    reasoning_messages::{
        effect_response, explain_response, forecast, graph_of, route_response, structural_model, what_if,
        what_if_response,
    },
    reasoning_params::{ReasoningParams, specs},
    reasoning_rows::{Answerable, Moment, Rows},
    reasoning_score::Score,
};
use crate::{
    Error, Result,
    house::costs as costs_of,
    inbox::{Inbox, Next, Sender},
    middleware::{Middleware, Publish, Qos, Reply, namespace_of},
    params::Params,
};

/// Topic of what will happen if nobody intervenes.
pub const PREDICTION_TOPIC: &str = "roscausal/prediction";
/// Topic of the equations, as JSON.
pub const STRUCTURAL_MODEL_TOPIC: &str = "roscausal/structural_model";
/// Names of the services.
pub const WHAT_IF_SERVICE: &str = "roscausal/what_if";
/// Why did a variable change?
pub const EXPLAIN_SERVICE: &str = "roscausal/explain";
/// How strongly does one variable drive another?
pub const EFFECT_SERVICE: &str = "roscausal/effect";
/// Where and when should the robot go?
pub const ROUTE_SERVICE: &str = "roscausal/route";
/// Topic of what people by place and hour cost a planner, and that of how Nav2 reads it.
pub const ROUTE_COSTS_TOPIC: &str = "roscausal/route_costs";
const COSTS_INFO_TOPIC: &str = "roscausal/route_costs_info";
/// Ends questions.
pub const CANCEL_SERVICE: &str = "roscausal/cancel";

/// Messages and questions that may wait.
const INBOX: usize = 20_000;
/// Questions that may be open at a time.
const MOST_QUESTIONS: usize = 64;
/// Predictions take at most this part of the time: after one, its cost times this passes without another.
const REST: u32 = 4;
/// Steps that an explanation without times looks back over.
const LOOK_BACK: usize = 10;
/// An answer says how old its newest row is from so many steps on. Steps.
const OLD: f64 = 3.0;

enum Event {
    Features(Features),
    Model(CausalModelInfo),
    WhatIf(WhatIfRequest, Reply<WhatIfResponse>),
    Explain(ExplainRequest, Reply<ExplainResponse>),
    Effect(EffectRequest, Reply<EffectResponse>),
    Route(RouteRequest, Reply<RouteResponse>),
    Cancel(CancelRequest, Reply<CancelResponse>),
    /// The fit of the graph with this number.
    Fitted(u64, Result<StructuralModel>),
    Costs(Result<OccupancyGrid>),
}

/// A graph to reason on, and since when there is one.
struct Wanted {
    number: u64,
    graph: Graph,
    facts: Facts,
    since: Option<Time>,
}

struct Node<M: Middleware> {
    mw: M,
    /// Whether fits and answers hold up the bus, so that a run is a function of its seed.
    in_line: bool,
    params: ReasoningParams,
    context: Vec<String>,
    pool: Arc<ThreadPool>,
    /// For fits: they take seconds, and no answer waits for them.
    fits: Arc<ThreadPool>,
    open: Arc<AtomicUsize>,
    /// When questions of what if were asked, and what ends them, while they are being answered.
    asked: Vec<(Duration, Weak<AtomicBool>)>,
    rows: Rows,
    wanted: Option<Wanted>,
    model: Option<Arc<StructuralModel>>,
    /// Why there is no model.
    refused: Option<String>,
    fitting: bool,
    /// Since when there is the graph of the model, and that of the fit that was begun last.
    since: Option<Time>,
    fitted_since: Option<Time>,
    next_fit: Time,
    score: Score,
    rest_until: Duration,
    figures: [u64; 3],
    bad_message: Option<String>,
    prediction: M::Publisher<Prediction>,
    structural: M::Publisher<Text>,
    /// The grid of costs, where there is a house.
    costs: Option<M::Publisher<OccupancyGrid>>,
    fitted: Sender<Event>,
}

/// The reasoning node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, a file that cannot be read, or a topic or service that cannot be used.
pub fn reasoning<M: Middleware>(mw: &M) -> Result<()> {
    with_inbox(mw, Inbox::new(mw, INBOX), mw.is_lockstep())
}

/// The reasoning node beside a lockstep bus, which does not wait for it: for a run that somebody watches. What it answers depends on
/// when it is asked; nothing else of the run depends on it.
///
/// # Errors
/// As [`reasoning`].
pub fn reasoning_beside<M: Middleware>(mw: &M) -> Result<()> {
    with_inbox(mw, Inbox::detached(mw, INBOX), false)
}

fn with_inbox<M: Middleware>(mw: &M, inbox: Inbox<Event>, in_line: bool) -> Result<()> {
    let params = ReasoningParams::new(&Params::read(mw, &specs())?)?;
    let mut health = Health::new(mw)?;
    let mut node = Node::new(mw, params, inbox.sender(), in_line)?;
    let features_input = health.input::<Features>(FEATURES_TOPIC, true);
    let model_input = health.input::<CausalModelInfo>("roscausal/causal_model_info", false);
    let to = || inbox.sender();
    let (asked, why, strength, way, end) = (to(), to(), to(), to(), to());
    let _what_if =
        mw.serve::<WhatIf>(WHAT_IF_SERVICE, move |q, reply| asked.send(Event::WhatIf(q, reply)))?;
    let _explain =
        mw.serve::<Explain>(EXPLAIN_SERVICE, move |q, reply| why.send(Event::Explain(q, reply)))?;
    let _effect =
        mw.serve::<Effect>(EFFECT_SERVICE, move |q, reply| strength.send(Event::Effect(q, reply)))?;
    let _route = mw.serve::<Route>(ROUTE_SERVICE, move |q, reply| way.send(Event::Route(q, reply)))?;
    // Nav2 asks how to read the grid; ROS 1 does not have this type.
    let info = CostmapFilterInfo {
        filter_mask_topic: format!("{}/{ROUTE_COSTS_TOPIC}", namespace_of(&mw.node_name())),
        multiplier: 1.0,
        ..CostmapFilterInfo::default()
    };
    let _info = match node.costs.as_ref().map(|_| mw.advertise(COSTS_INFO_TOPIC, Qos::Latched)) {
        Some(Ok(topic)) => topic.publish(&info).map(|()| Some(topic))?,
        _ => None,
    };
    let _cancel = mw.serve::<Cancel>(CANCEL_SERVICE, move |q, reply| end.send(Event::Cancel(q, reply)))?;
    let _models = match node.wanted {
        Some(_) => None,
        None => Some(inbox.subscribe(mw, "roscausal/causal_model_info", Qos::Latched, Event::Model)?),
    };
    let _rows = inbox.subscribe(mw, FEATURES_TOPIC, Qos::Volatile(10), Event::Features)?;
    loop {
        match inbox.next(mw, Some(health.next.min(node.next_fit))) {
            Next::Shutdown => return Ok(()),
            Next::Deadline => {}
            Next::Event(Event::Features(row)) => {
                health.heard(features_input, mw.now());
                if node.row(&row) {
                    health.sent();
                }
            }
            Next::Event(Event::Model(info)) => {
                health.heard(model_input, mw.now());
                node.new_model(&info);
            }
            Next::Event(Event::Fitted(number, result)) => node.take_fit(number, result),
            Next::Event(Event::WhatIf(request, reply)) => node.what_if(request, reply),
            Next::Event(Event::Explain(request, reply)) => node.explain(request, reply),
            Next::Event(Event::Effect(request, reply)) => node.effect(request, reply),
            Next::Event(Event::Costs(grid)) => node.take_costs(grid),
            Next::Event(Event::Route(request, reply)) => node.route(request, reply),
            Next::Event(Event::Cancel(request, reply)) => reply.send(node.cancel(&request)),
        }
        if mw.now() >= node.next_fit {
            node.fit();
            node.find_costs();
        }
        node.report(&mut health, inbox.dropped());
    }
}

impl<M: Middleware> Node<M> {
    fn new(mw: &M, params: ReasoningParams, fitted: Sender<Event>, in_line: bool) -> Result<Self> {
        let (pool, fits) = (pool("reasoning", params.threads)?, pool("reasoning-fit", params.threads)?);
        let mut rows = Rows::new(params.max_samples, &params.person);
        params.data.iter().try_for_each(|file| rows.add_file(file))?;
        let wanted =
            params.graph.clone().map(|(graph, facts)| Wanted { number: 1, graph, facts, since: None });
        Ok(Self {
            context: params.acts_on.iter().map(|(column, _)| column.clone()).collect(),
            pool,
            fits,
            open: Arc::default(),
            asked: Vec::new(),
            rows,
            wanted,
            model: None,
            refused: None,
            fitting: false,
            since: None,
            fitted_since: None,
            next_fit: mw.now(),
            score: Score::default(),
            rest_until: Duration::ZERO,
            figures: [0; 3],
            bad_message: None,
            prediction: mw.advertise(PREDICTION_TOPIC, Qos::Volatile(10))?,
            structural: mw.advertise(STRUCTURAL_MODEL_TOPIC, Qos::Latched)?,
            costs: match params.house {
                Some(_) => Some(mw.advertise(ROUTE_COSTS_TOPIC, Qos::Latched)?),
                None => None,
            },
            fitted,
            mw: mw.clone(),
            in_line,
            params,
        })
    }

    /// Takes a row: scores what was predicted of it, and predicts. Returns whether a prediction was published.
    fn row(&mut self, row: &Features) -> bool {
        match self.rows.add(row) {
            Ok(true) => self.bad_message = None,
            Ok(false) => return false,
            Err(reason) => {
                self.bad_message = Some(reason);
                return false;
            }
        }
        let Some(model) = self.model.clone() else {
            // The first rows that are enough are fitted at once.
            if self.wanted.is_some() && self.rows.len() == self.params.min_samples {
                self.next_fit = self.mw.now();
            }
            return false;
        };
        let Ok(moment) = self.rows.at(model.graph().names(), None) else { return false };
        let last = moment.rows.row(moment.now).to_vec();
        let stamp = moment.stamp(moment.now);
        if self.rows.is_imposed(&self.context) || moment.now == 0 {
            self.score.forget_pending();
        }
        let step_ns = self.rows.step_s().map_or(1, |step| (step * 1e9) as i64);
        self.score.observed(stamp.as_nanos(), step_ns, &last, &model.members()[0].model.deviations);
        self.predict(&model, &moment, last)
    }

    fn predict(&mut self, model: &StructuralModel, moment: &Moment, last: Vec<f64>) -> bool {
        let start = self.mw.steady();
        if !self.in_line && start < self.rest_until {
            return false;
        }
        let situation = Situation { rows: moment.rows.view(), now: moment.now };
        let (horizon, paths, seed) =
            (self.params.horizon, self.params.prediction_paths, self.params.settings.seed);
        let answer = self.pool.install(|| answer::predict(model, &situation, horizon, paths, seed));
        let end = self.mw.steady();
        self.rest_until = end + (end - start) * REST;
        if answer.status == Status::BadRequest {
            self.bad_message =
                Some(format!("no predictions (parameters horizon and prediction_paths): {}", answer.message));
        }
        let Some(outlook) = answer.outlooks.into_iter().next().filter(|outlook| !outlook.refused) else {
            return false;
        };
        let stamp = moment.stamp(moment.now);
        self.score.predicted(stamp.as_nanos(), last, outlook.forecasts.clone());
        let message = Prediction {
            header: Header { stamp, frame_id: String::new() },
            dt: self.rows.step_s().or(answer.dt).unwrap_or(f64::NAN),
            model_id: answer.model_id,
            forecasts: outlook.forecasts.into_iter().map(forecast).collect(),
            coverage: self.score.coverage(),
        };
        if let Err(error) = self.prediction.publish(&message) {
            tracing::debug!("no prediction: {error}");
        }
        self.figures[0] += 1;
        true
    }

    fn new_model(&mut self, info: &CausalModelInfo) {
        match graph_of(info, &self.context) {
            Ok((graph, facts)) => {
                let number = self.wanted.as_ref().map_or(0, |wanted| wanted.number) + 1;
                self.wanted = Some(Wanted { number, graph, facts, since: Some(info.header.stamp) });
                self.next_fit = self.mw.now();
            }
            Err(error) => {
                tracing::warn!("the model of {} cannot be reasoned on: {error}", info.batch_id);
                if self.model.is_none() {
                    self.refused = Some(error.to_string());
                }
            }
        }
    }

    /// Fits the equations, on a thread of their own.
    fn fit(&mut self) {
        self.next_fit = self.mw.now().plus_secs(self.params.refit_every_s);
        let Some(wanted) = &self.wanted else { return };
        if self.fitting || self.rows.len() < self.params.min_samples {
            return;
        }
        let mut facts = wanted.facts.clone();
        let step = self.rows.step_s();
        if let (Some(of_model), Some(step)) = (facts.dt, step)
            && (of_model - step).abs() > 0.1 * of_model
        {
            let reason = format!(
                "the model has a step of {of_model} s and the rows one of {step} s; give the data node that dt, or wait for a new model"
            );
            return self.no_model(reason);
        }
        facts.dt = facts.dt.or(step);
        let data = match self.rows.data(wanted.graph.names(), &self.context) {
            Ok(data) => data,
            Err(error) => return self.no_model(error.to_string()),
        };
        let (number, graph) = (wanted.number, wanted.graph.clone());
        let (settings, acts_on, pool) =
            (self.params.settings.clone(), self.params.acts_on.clone(), self.fits.clone());
        let work = move |data: DataFrame| {
            Ok(pool.install(|| StructuralModel::fit(&data, &graph, &settings, &acts_on))?.with_facts(facts))
        };
        (self.fitting, self.fitted_since) = (true, wanted.since);
        if self.in_line {
            return self.take_fit(number, work(data));
        }
        let inbox = self.fitted.clone();
        let begun = thread::Builder::new().name("reasoning-fit".into()).spawn(move || {
            let died =
                || Error::Data("the fit ended by an internal error; please report it with the data".into());
            let fitted = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(data)));
            inbox.send(Event::Fitted(number, fitted.unwrap_or_else(|_| Err(died()))));
        });
        if let Err(error) = begun {
            self.fitting = false;
            tracing::warn!("no thread for a fit: {error}");
        }
    }

    fn no_model(&mut self, reason: String) {
        if self.refused.as_ref() != Some(&reason) {
            tracing::warn!("no model to reason on: {reason}");
        }
        self.refused = Some(reason);
        self.model = None;
        self.score.forget_pending();
    }

    /// Takes a fit. If another model came meanwhile, that one is fitted next, and this one serves until then: models may come faster
    /// than fits end.
    fn take_fit(&mut self, number: u64, result: Result<StructuralModel>) {
        self.fitting = false;
        let newest = self.wanted.as_ref().is_none_or(|wanted| wanted.number == number);
        if !newest {
            self.next_fit = self.mw.now();
        }
        match result {
            Ok(model) => {
                self.figures[1] += 1;
                if let Err(error) = self.structural.publish(&Text { data: structural_model(&model) }) {
                    tracing::warn!("the structural model is not published: {error}");
                }
                (self.refused, self.model) = (None, Some(Arc::new(model)));
                self.since = self.fitted_since;
            }
            Err(error) if newest => self.no_model(error.to_string()),
            Err(_) => {}
        }
    }

    /// The model, or why there is none.
    fn ready(&self) -> Answerable<Arc<StructuralModel>> {
        if let Some(model) = &self.model {
            return Ok(model.clone());
        }
        let (rows, least) = (self.rows.len(), self.params.min_samples);
        let no_model = |reason: &str| Err((Status::NoModel, reason.to_owned()));
        match (&self.refused, &self.wanted) {
            (Some(reason), _) => no_model(reason),
            (None, None) => no_model(
                "there is no causal model yet; start roscausal_discovery, or give a file as parameter graph",
            ),
            (None, Some(_)) if rows < least => {
                let way = "ask again later, or give batches as parameter data";
                let reason = format!("there are {rows} rows and {least} are needed (min_samples); {way}");
                Err((Status::NoData, reason))
            }
            (None, Some(_)) => no_model("the model is being fitted; ask again in a few seconds"),
        }
    }

    /// Model and rows for a question about a stamp (0: the newest).
    fn situation(&self, stamp: Time) -> Answerable<(Arc<StructuralModel>, Moment)> {
        let model = self.ready()?;
        let moment = self.rows.at(model.graph().names(), (stamp != Time::ZERO).then_some(stamp))?;
        Ok((model, moment))
    }

    /// What this node adds to every answer: the model's age and its live score.
    fn caveats(&self) -> Vec<String> {
        let age = self.since.map(|since| {
            format!("the causal model was found {:.0} s ago", self.mw.now().secs_since(since).max(0.0))
        });
        [age, self.score.sentence(), self.score.trouble()].into_iter().flatten().collect()
    }

    /// How old the row is that an answer begins at, if that is more than a robot takes for now.
    fn age(&self, moment: &Moment) -> Option<String> {
        let age_s = self.mw.now().secs_since(moment.stamp(moment.now));
        let steps = age_s / self.rows.step_s()?;
        (steps > OLD).then(|| {
            format!(
                "the newest row is {age_s:.1} s old, {steps:.0} steps, and the forecast begins there, not now"
            )
        })
    }

    /// Computes an answer beside the node, in line on a lockstep bus.
    fn answer<R: Send + 'static>(
        &mut self,
        reply: Reply<R>,
        refuse: impl FnOnce(Status, String) -> R,
        compute: impl FnOnce() -> R + Send + 'static,
    ) {
        self.figures[2] += 1;
        if self.in_line {
            return reply.send(self.pool.install(compute));
        }
        if self.open.fetch_add(1, Ordering::Relaxed) >= MOST_QUESTIONS {
            self.open.fetch_sub(1, Ordering::Relaxed);
            let reason = format!("{MOST_QUESTIONS} questions are open; wait for their answers");
            return reply.send(refuse(Status::BadRequest, reason));
        }
        let open = Open(self.open.clone());
        self.pool.spawn(move || {
            let _open = open;
            reply.send(compute());
        });
    }

    fn what_if(&mut self, request: WhatIfRequest, reply: Reply<WhatIfResponse>) {
        let stamp = request.stamp;
        let refuse = |status: Status, message: String| WhatIfResponse {
            status: status as u8,
            message,
            stamp,
            dt: f64::NAN,
            ..WhatIfResponse::default()
        };
        let (horizon, paths, seed) = (self.params.horizon, self.params.paths, self.params.settings.seed);
        if request.patience.is_nan() || request.patience < 0.0 {
            let reason = format!("patience is {}; give seconds, 0: any time", request.patience);
            return reply.send(refuse(Status::BadRequest, reason));
        }
        // On a lockstep bus an answer takes no time.
        let patience = Some(request.patience).filter(|patience| *patience > 0.0 && !self.in_line);
        let until = patience.map(|patience| self.mw.steady().as_secs_f64() + patience);
        let clock = self.mw.clone();
        let cancelled = Arc::new(AtomicBool::new(false));
        self.asked.retain(|(_, of)| of.strong_count() > 0);
        self.asked.push((self.mw.steady(), Arc::downgrade(&cancelled)));
        let ended = cancelled.clone();
        let late = move || {
            ended.load(Ordering::Relaxed) || until.is_some_and(|until| clock.steady().as_secs_f64() > until)
        };
        let mut question = match what_if(request, horizon, paths, seed) {
            Ok(question) => question,
            Err(reason) => return reply.send(refuse(Status::BadRequest, reason)),
        };
        question.allow_extrapolation |= self.params.allow_extrapolation;
        let (model, moment) = match self.situation(stamp) {
            Ok(both) => both,
            Err((status, reason)) => return reply.send(refuse(status, reason)),
        };
        let mut caveats = self.caveats();
        caveats.extend(self.age(&moment).filter(|_| stamp == Time::ZERO));
        self.answer(reply, refuse, move || {
            let situation = Situation { rows: moment.rows.view(), now: moment.now };
            let mut answer = answer::what_if_until(&model, &situation, &question, &late);
            if answer.status == Status::Late && cancelled.load(Ordering::Relaxed) {
                "the question was cancelled".clone_into(&mut answer.message);
            }
            what_if_response(answer, moment.stamp(moment.now), caveats)
        });
    }

    fn cancel(&mut self, request: &CancelRequest) -> CancelResponse {
        let now = self.mw.steady();
        let is_meant = |at: Duration| {
            now.saturating_sub(at).as_secs_f64() >= request.older_than || request.older_than.is_nan()
        };
        let meant = self.asked.iter().filter(|(at, _)| is_meant(*at)).filter_map(|(_, of)| of.upgrade());
        let ended = meant.filter(|of| !of.swap(true, Ordering::Relaxed)).count();
        CancelResponse { ended: u32::try_from(ended).unwrap_or(u32::MAX) }
    }

    fn explain(&mut self, request: ExplainRequest, reply: Reply<ExplainResponse>) {
        let (from, to) = (request.from_time, request.to_time);
        let refuse = |status: Status, message: String| ExplainResponse {
            status: status as u8,
            message,
            from_time: from,
            to_time: to,
            ..ExplainResponse::default()
        };
        if (from == Time::ZERO) != (to == Time::ZERO) {
            let reason = "give both times of the change, or 0 for both: the largest recent one".to_owned();
            return reply.send(refuse(Status::BadRequest, reason));
        }
        let (model, moment) = match self.situation(to) {
            Ok(both) => both,
            Err((status, reason)) => return reply.send(refuse(status, reason)),
        };
        let row = |stamp: Time| moment.stamps.partition_point(|&at| at <= stamp.as_nanos()).checked_sub(1);
        let rows = match (from == Time::ZERO, row(from)) {
            (true, _) => (None, None),
            (false, Some(first)) => (Some(first), Some(moment.now)),
            (false, None) => {
                let (from, to) = (from.as_secs_f64(), to.as_secs_f64());
                let reason = format!(
                    "there are no rows without a gap from {from:.3} s to {to:.3} s; ask for a later change"
                );
                return reply.send(refuse(Status::NoData, reason));
            }
        };
        let question = ExplainQuestion {
            variable: request.variable,
            from_row: rows.0,
            to_row: rows.1,
            horizon: LOOK_BACK,
            seed: self.params.settings.seed,
            start: moment.stamp(0).as_secs_f64(),
        };
        let caveats = self.caveats();
        self.answer(reply, refuse, move || {
            let situation = Situation { rows: moment.rows.view(), now: moment.now };
            explain_response(answer::explain(&model, &situation, &question), &moment, caveats)
        });
    }

    fn effect(&mut self, request: EffectRequest, reply: Reply<EffectResponse>) {
        let refuse = |status: Status, message: String| EffectResponse {
            status: status as u8,
            message,
            ..EffectResponse::default()
        };
        let model = match self.ready() {
            Ok(model) => model,
            Err((status, reason)) => return reply.send(refuse(status, reason)),
        };
        let max_lag = match request.max_lag {
            0 => model.graph().largest_lag().clamp(1, answer::LONGEST_LAG),
            lag => lag as usize,
        };
        let question = EffectQuestion {
            cause: request.cause,
            effect: request.effect,
            max_lag,
            standardised: request.standardised,
        };
        let caveats = self.caveats();
        self.answer(reply, refuse, move || effect_response(answer::effect(&model, &question), caveats));
    }

    fn route(&mut self, request: RouteRequest, reply: Reply<RouteResponse>) {
        let refuse = |status: Status, message: String| RouteResponse {
            status: status as u8,
            message,
            ..RouteResponse::default()
        };
        let Some(house) = self.params.house.clone() else {
            let reason =
                "there is no map; start this node with the parameters route_map, route_model and route_days";
            return reply.send(refuse(Status::NoData, reason.into()));
        };
        self.answer(reply, refuse, move || {
            route_response(&house, &request).unwrap_or_else(|(status, reason)| refuse(status, reason))
        });
    }

    /// Computes what people cost a planner at this hour, beside the node.
    fn find_costs(&self) {
        let Some(house) = self.params.house.clone() else { return };
        let stamp = self.mw.now();
        let hour = (stamp.as_secs_f64() / 3600.0 + self.params.house_hour).rem_euclid(24.0);
        let (cell, inbox) = (self.params.house_cell, self.fitted.clone());
        let work = move || {
            let told = house.newest()?;
            let header = Header { stamp, frame_id: "map".into() };
            Ok(OccupancyGrid { header, ..costs_of(&told.0, &told.1, hour, cell) })
        };
        if self.in_line {
            return self.take_costs(work());
        }
        self.pool.spawn(move || inbox.send(Event::Costs(work())));
    }

    fn take_costs(&self, grid: Result<OccupancyGrid>) {
        let Some(topic) = &self.costs else { return };
        if let Err(error) = grid.and_then(|grid| topic.publish(&grid)) {
            tracing::warn!("no grid of costs: {error}");
        }
    }

    fn report(&self, health: &mut Health<M>, dropped: u64) {
        let [predictions, fits, questions] = self.figures;
        let figure = |value: f64| if value.is_nan() { String::new() } else { format!("{value:.3}") };
        let figures = || {
            [
                ("rows", self.rows.len().to_string()),
                ("predictions", predictions.to_string()),
                ("fits", fits.to_string()),
                ("questions", questions.to_string()),
                ("questions open", self.open.load(Ordering::Relaxed).to_string()),
                ("model", self.model.as_ref().map_or(String::new(), |model| model.id())),
                ("coverage", figure(self.score.coverage())),
                ("skill over the last value", figure(self.score.skill())),
                ("steps scored", self.score.rows().to_string()),
                ("messages dropped", dropped.to_string()),
            ]
        };
        let trouble =
            self.refused.clone().or_else(|| self.score.trouble()).or_else(|| self.bad_message.clone());
        health.report(&self.mw, figures, trouble.as_deref());
    }
}

/// Threads for a kind of work; 0: all cores.
fn pool(name: &'static str, threads: usize) -> Result<Arc<ThreadPool>> {
    let died = |_| tracing::error!("a thread ended by an internal error; please report it with the question");
    let builder = ThreadPoolBuilder::new().num_threads(threads).panic_handler(died);
    let pool = builder.thread_name(move |k| format!("{name}-{k}")).build();
    pool.map(Arc::new).map_err(|e| Error::param("threads", e))
}

/// Counts a question as open until it is dropped.
struct Open(Arc<AtomicUsize>);

impl Drop for Open {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
