//! `roscausal topics`: what a recording holds, topic by topic.

mod signals;

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, Time};
use roscausal_recording::Recording;

use crate::{interrupt::Interrupt, terminal};

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
    /// Times of the first and the last message.
    span: Option<(Time, Time)>,
    /// The longest time without a message, seconds.
    gap_s: f64,
}

impl Count {
    fn add(&mut self, stamp: Time) {
        let (first, last) = self.span.unwrap_or((stamp, stamp));
        self.gap_s = self.gap_s.max(stamp.secs_since(last));
        self.span = Some((first, stamp));
        self.messages += 1;
    }

    /// Messages per second between the first and the last one; `None` for a single one.
    fn rate(&self) -> Option<f64> {
        let (first, last) = self.span?;
        let length = last.secs_since(first);
        (length > 0.0).then(|| (self.messages - 1) as f64 / length)
    }
}

/// Runs `roscausal topics`: a table with one line for each topic, in the order of the names.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    if args.signals {
        return signals::run(&args.recording, interrupt);
    }
    let mut recording = Recording::open(&args.recording)?;
    let topics = recording.topics().to_vec();
    let mut counts = vec![Count::default(); topics.len()];
    for record in recording.by_ref() {
        if interrupt.is_set() {
            return Err(Error::Cancelled("by the user".into()));
        }
        counts[record.topic].add(record.stamp);
    }
    let mut lines: Vec<_> = topics.iter().zip(&counts).collect();
    lines.sort_by(|a, b| (&a.0.name, &a.0.type_name).cmp(&(&b.0.name, &b.0.type_name)));
    let names = lines.iter().map(|(topic, _)| topic.name.len()).max().unwrap_or(0).max(5);
    let types = lines.iter().map(|(topic, _)| topic.type_name.len()).max().unwrap_or(0).max(4);
    terminal::say!(
        "{:names$}  {:types$}  {:>8}  {:>8}  {:>9}",
        "topic",
        "type",
        "messages",
        "rate, Hz",
        "gap, s"
    );
    for (topic, count) in lines {
        let rate = count.rate().map_or_else(|| "-".to_owned(), |rate| format!("{rate:.2}"));
        let gap = count.rate().map_or_else(|| "-".to_owned(), |_| format!("{:.3}", count.gap_s));
        let (name, kind, messages) = (&topic.name, &topic.type_name, count.messages);
        terminal::say!("{name:names$}  {kind:types$}  {messages:>8}  {rate:>8}  {gap:>9}");
    }
    for loss in recording.losses() {
        terminal::tell!("note: {loss}");
    }
    Ok(())
}
