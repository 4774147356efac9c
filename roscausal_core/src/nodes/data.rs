//! The data node: from both states to batches in a pool.

use std::sync::{Arc, Mutex};

use roscausal_msgs::{
    Features, Humans, RobotState,
    std_msgs::{Header, String as Text},
};

use super::{
    data_params::{recorder, signals, specs, writer},
    health::Health,
    in_namespace, labels, to_its_end,
};
use crate::{
    Result,
    batch::{
        EndedBy, Select,
        fresh::FreshRow,
        postprocess::Postprocess,
        recorder::Recorder,
        writer::{Processing, Writer},
    },
    gate::lock,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos, Raw},
    params::Params,
    signal::Signals,
};

/// Topic of the variables, row by row.
pub const FEATURES_TOPIC: &str = "roscausal/features";

/// Seconds between two writes to the journal: what a crash of the process costs.
const JOURNAL_EVERY_S: f64 = 0.2;
/// Messages that may wait: more than ten seconds of a fast robot.
const INBOX: usize = 20_000;
/// Messages of people that may wait in the middleware: four seconds of a fast tracker. A hundred people make 30 kB each.
const WAITING_PEOPLE: usize = 100;

#[derive(PartialEq)]
enum Event {
    Robot(RobotState),
    /// A robot of `other_robots`, by its position in that list.
    Other(usize, RobotState),
    Humans(Humans),
    Context(String),
    /// A message of a topic of signals, by its position.
    Signal(usize, Raw),
}

/// Progress of the open batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Rows of the open batch.
    pub rows: usize,
    /// Rows that it will have; `None`: until the end.
    pub of: Option<usize>,
    /// Batches recorded before it.
    pub batches: u64,
}

/// The data node. It runs until the middleware ends, then writes what it has.
///
/// # Errors
/// A parameter that is not allowed, a folder that cannot be created, or a topic that cannot be used.
pub fn data<M: Middleware>(mw: &M) -> Result<()> {
    data_with(mw, |_| {})
}

/// The data node with a callback for its progress.
///
/// # Errors
/// As [`data`].
pub fn data_with<M: Middleware>(mw: &M, on_progress: impl Fn(Recorded)) -> Result<()> {
    to_its_end(data_task(mw, on_progress))
}

/// The data node as a task, with a listener for its progress.
///
/// # Errors
/// As [`data`].
pub async fn data_task<M: Middleware>(mw: &M, on_progress: impl Fn(Recorded)) -> Result<()> {
    let params = Params::read(mw, &specs())?;
    let mut signals = signals(&params)?;
    let columns: Vec<_> = signals.signals().iter().map(|signal| (signal.name.clone(), signal.how)).collect();
    let config = recorder(&params)?;
    let length = Arc::new(Mutex::new(None));
    let set = length.clone();
    let take = move |params: &Params| {
        *lock(&set) = Some(recorder(params)?.ts_length_s);
        Ok(())
    };
    mw.on_params(&params, Box::new(take));
    let with_people = config.select != Select::Nobody;
    let mut recorder = Recorder::new(config).with_signals(&columns);
    let writing = writer(&params)?;
    // A script post-processes files; what it would say of a row is not known before.
    let live = match &writing.processing {
        Processing::BuiltIn(postprocess) => {
            recorder = recorder.with_fresh_rows();
            Some((postprocess.clone(), mw.advertise::<Features>(FEATURES_TOPIC, Qos::Volatile(10))?))
        }
        Processing::Script(_) | Processing::None => None,
    };
    let writer = Writer::start(writing)?.that_waits(mw.is_lockstep());
    if let Some(first) = writer.first_journal() {
        recorder = recorder.with_journal(first);
    }
    let mut health = Health::new(mw)?;
    let inbox = Inbox::gathering(mw, INBOX);
    let robot_topic = in_namespace("robot", &params.text("robot"), "roscausal/robot")?;
    let others = params.list("other_robots");
    let robot_input = health.input::<RobotState>(&robot_topic, with_people);
    let humans_input = health.input::<Humans>("roscausal/humans", with_people);
    let _robot = inbox.subscribe(mw, &robot_topic, Qos::Volatile(1000), Event::Robot)?;
    let _humans = inbox.subscribe(mw, "roscausal/humans", Qos::Volatile(WAITING_PEOPLE), Event::Humans)?;

    let mut _others = Vec::new();
    for (place, name) in others.iter().enumerate() {
        let topic = in_namespace("other_robots", name, "roscausal/robot")?;
        let other = move |m| Event::Other(place, m);
        _others.push(inbox.subscribe(mw, &topic, Qos::Volatile(1000), other)?);
    }
    let context = |topic: String| inbox.subscribe(mw, &topic, Qos::Latched, |m: Text| Event::Context(m.data));
    let _context = params.text_if_set("context_topic").map(context).transpose()?;

    let mut _listened = Vec::new();
    for (place, topic) in signals.topics().iter().enumerate() {
        let signal = inbox.sender();
        _listened.push(mw.listen(topic, move |m| signal.send(Event::Signal(place, m)))?);
    }

    let mut reported = Recorded { rows: 0, of: None, batches: 0 };
    let (mut journal_due, mut refused, mut stopped) = (mw.now(), 0_u64, false);
    let mut unnoted = false;
    loop {
        // The last samples are journalled in time even if no message follows them.
        let due = if unnoted { journal_due.min(health.next) } else { health.next };
        let next = inbox.awaited(mw, Some(due)).await;
        if let Some(length) = lock(&length).take() {
            recorder.set_length(length);
        }
        match &next {
            Next::Deadline => {}
            Next::Shutdown => recorder.finish(),
            Next::Event(Event::Robot(state)) => {
                health.heard(robot_input, mw.now());
                if stopped { refused += 1 } else { recorder.robot(state, mw.now()) }
            }
            Next::Event(Event::Other(place, state)) => {
                recorder.other_robot(&others[*place], state, mw.now());
            }
            Next::Event(Event::Context(text)) => {
                if let Err(reason) = recorder.context(text, mw.now()) {
                    tracing::warn!("left out: {reason}");
                }
            }
            Next::Event(Event::Signal(place, message)) => {
                let now = mw.now();
                for reading in signals.heard(*place, message, now).into_iter().filter(|_| !stopped) {
                    recorder.signal(reading.signal, reading.stamp, reading.value, now);
                }
            }
            Next::Event(Event::Humans(people)) => {
                health.heard(humans_input, mw.now());
                if stopped { refused += 1 } else { recorder.humans(people, mw.now()) }
            }
        }
        for row in recorder.take_rows() {
            if let Some((postprocess, features)) = &live
                && let Err(error) = features.publish(&of_row(postprocess, &row))
            {
                tracing::debug!("no features: {error}");
            }
        }
        let is_full = writer.is_full();
        if is_full && !stopped {
            recorder.restart(EndedBy::FullPool);
        }
        stopped = is_full;
        let now = mw.now();
        let batches = recorder.take_numbered_batches();
        // The journal of a batch is complete before the batch is handed over. (A clock may jump back.)
        if !batches.is_empty() || now >= journal_due || next == Next::Shutdown {
            writer.note(recorder.take_journal());
            journal_due = now.plus_secs(JOURNAL_EVERY_S);
            unnoted = false;
        } else {
            unnoted |= matches!(next, Next::Event(_));
        }
        journal_due = journal_due.min(now.plus_secs(JOURNAL_EVERY_S));
        for (batch, journal) in batches {
            reported.batches += 1;
            health.sent();
            writer.write(batch, journal);
        }
        let (rows, of) = recorder.progress();
        if (rows, of) != (reported.rows, reported.of) {
            reported = Recorded { rows, of, ..reported };
            on_progress(reported);
        }
        if next == Next::Shutdown {
            return Ok(());
        }
        report(mw, &mut health, &recorder, &writer, &signals, [inbox.dropped(), refused]);
    }
}

/// The variables of a row, as the batch will have them.
fn of_row(postprocess: &Postprocess, row: &FreshRow) -> Features {
    let header = Header { stamp: row.stamp(), frame_id: row.tail.frame.clone() };
    let (names, values) = postprocess.newest(&row.tail, row.first, row.by_id).into_iter().unzip();
    Features { header, names, values }
}

fn report<M: Middleware>(
    mw: &M,
    health: &mut Health<M>,
    recorder: &Recorder,
    writer: &Writer,
    signals: &Signals,
    [dropped, refused]: [u64; 2],
) {
    if mw.now() < health.next {
        return;
    }
    let (counts, status, journal) = (recorder.counts(), writer.status(), writer.journal_status());
    let [per_row, ahead] = recorder.spacing().unwrap_or_default();
    let figures = [
        ("rows recorded", counts.rows),
        ("rows of the open batch", recorder.progress().0 as u64),
        ("rows of a batch", recorder.progress().1.unwrap_or(0) as u64),
        (labels::PER_ROW, (100.0 * per_row).round() as u64),
        (labels::AHEAD, (1000.0 * ahead).round() as u64),
        (labels::FOLLOWS, recorder.follows()),
        ("batches written", status.written),
        ("batches post-processed", status.processed),
        ("post-processings failed", status.failed),
        ("batches lost", status.lost),
        ("batches dropped, pool full", status.dropped),
        ("batches recovered", status.recovered),
        ("samples not journalled", journal.unprotected),
        ("messages dropped", dropped),
        ("messages not recorded, pool full", refused),
        ("duplicate stamps", counts.duplicates),
        (labels::TOO_LATE, counts.late),
        (labels::FOREIGN, counts.foreign_frame),
        ("too many people or samples", counts.crowded),
        (labels::JUMPS, counts.jumps),
        (labels::SIGNALS_UNREAD, signals.unreadable()),
    ]
    .map(|(name, figure)| (name, figure.to_string()));
    // A disk or pool that is full, or nobody of those who are to be recorded.
    health.fails(status.trouble.is_some() || recorder.trouble().is_some());
    let trouble = status.trouble.or(status.last_failure).or(journal.trouble);
    let trouble = trouble.or_else(|| signals.trouble().map(str::to_owned)).or_else(|| recorder.trouble());
    health.report(mw, || figures, trouble.as_deref());
}
