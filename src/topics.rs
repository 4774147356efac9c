//! `roscausal topics`: what a recording holds, topic by topic. The offset is the stamp of a message minus the time of its recording.

mod signals;

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::{Result, Time, signal::Definitions};
use roscausal_recording::{Record, Recording};

use crate::{
    interrupt::Interrupt,
    recording::{
        clocks::{Offset, Offsets, add_early, is_tf},
        runs,
        stamps::Stamps,
    },
    report::WIDEST,
};

/// Arguments of `roscausal topics`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// Recording: .bag, .mcap, .db3, or a folder of them.
    recording: PathBuf,
    /// List every number in the messages instead, as --signal takes it, with its rate, range and gaps.
    #[arg(long)]
    signals: bool,
}

/// What is counted of a topic.
#[derive(Clone, Copy, Default)]
struct Count {
    messages: u64,
    /// When the last message was recorded, and in which run of the recording.
    last: Option<(u32, Time)>,
    /// Time between messages of a run, all together and at most. Seconds.
    length_s: f64,
    gap_s: f64,
    /// Runs with messages.
    runs: u64,
}

impl Count {
    fn add(&mut self, record: &Record) {
        match self.last.filter(|(lap, _)| *lap == record.lap) {
            Some((_, last)) => {
                let step = record.stamp.secs_since(last);
                self.length_s += step;
                self.gap_s = self.gap_s.max(step);
            }
            None => self.runs += 1,
        }
        self.last = Some((record.lap, record.stamp));
        self.messages += 1;
    }

    /// Messages per second between the first and the last one; `None` for a single one.
    fn rate(&self) -> Option<f64> {
        (self.length_s > 0.0).then(|| (self.messages - self.runs) as f64 / self.length_s)
    }

    /// The rate and the longest gap as texts.
    fn texts(&self) -> [String; 2] {
        let known = |rate| [format!("{rate:.2}"), format!("{:.3}", self.gap_s)];
        self.rate().map_or_else(|| ["-"; 2].map(str::to_owned), known)
    }
}

/// Runs `roscausal topics`: a table with one line for each topic, in the order of the names.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    interrupt.nothing_at_stake("what was printed is all there is");
    if args.signals {
        return signals::run(&args.recording, interrupt);
    }
    let mut recording = Recording::open(&args.recording)?;
    let topics = recording.topics().to_vec();
    let mut counts = vec![Count::default(); topics.len()];
    let definitions = Definitions::of("");
    let stamps: Vec<Option<Stamps>> =
        topics.iter().map(|topic| Stamps::of(topic, &definitions).filter(|_| !is_tf(topic))).collect();
    let mut offsets: Vec<Offsets> = topics.iter().map(|_| Offsets::default()).collect();
    for record in recording.by_ref() {
        interrupt.check()?;
        if let Some(stamp) = stamps[record.topic].as_ref().and_then(|stamps| stamps.first(&record.bytes)) {
            offsets[record.topic].add(counts[record.topic].messages, stamp, record.stamp);
        }
        counts[record.topic].add(&record);
    }
    let mut offsets: Vec<Option<Offset>> = offsets.into_iter().map(Offsets::finish).collect();
    add_early(&topics, &mut offsets);
    let mut lines: Vec<_> = topics.iter().zip(&counts).zip(&offsets).collect();
    lines.sort_by_key(|((topic, _), _)| (&topic.name, &topic.type_name));
    let names = topics.iter().map(|topic| topic.name.len()).max().unwrap_or(0).clamp(5, WIDEST);
    let types = topics.iter().map(|topic| topic.type_name.len()).max().unwrap_or(0).clamp(4, WIDEST);
    let columns = "messages  rate, Hz     gap, s   offset, s  spread, s  jumps";
    say!("{:names$}  {:types$}  {columns}", "topic", "type");
    for ((topic, count), offset) in lines {
        let [rate, gap] = count.texts();
        let (name, kind, messages) = (&topic.name, &topic.type_name, count.messages);
        let [offset, spread, jumps] =
            offset.as_ref().map_or_else(|| ["-"; 3].map(str::to_owned), Offset::texts);
        say!(
            "{name:names$}  {kind:types$}  {messages:>8}  {rate:>8}  {gap:>9}  {offset:>10}  {spread:>9}  {jumps:>5}"
        );
    }
    if recording.laps() > 1 {
        tell!("note: {}: {}", args.recording.display(), runs(recording.laps()));
    }
    recording.losses().iter().for_each(|loss| tell!("note: {loss}"));
    Ok(())
}
