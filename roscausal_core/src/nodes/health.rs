//! A node's health: `/diagnostics` at 1 Hz, and a warning if an input is silent.

use roscausal_msgs::{
    Time,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    std_msgs::Header,
};

use super::labels::SILENCE;
use crate::{
    Message, Result,
    inbox::Inbox,
    middleware::{Middleware, Publish, Qos, namespace_of},
};

/// Seconds between two reports.
const PERIOD_S: f64 = 1.0;
/// An input that is silent for this many seconds is reported.
const SILENT_S: f64 = 5.0;

/// Inputs, outputs and problems of one node, reported once a second.
pub(super) struct Health<M: Middleware> {
    publisher: M::Publisher<DiagnosticArray>,
    namespace: String,
    started: Time,
    /// When the next report is due.
    pub(super) next: Time,
    inputs: Vec<Input>,
    outputs: u64,
    fails: bool,
    reported: String,
}

struct Input {
    topic: String,
    type_name: String,
    required: bool,
    heard: u64,
    last: Option<Time>,
    /// Longest time between two messages, seconds.
    longest_s: f64,
}

impl Input {
    /// The longest time without a message since `start`, seconds.
    fn silence(&self, start: Time, now: Time) -> f64 {
        self.longest_s.max(now.secs_since(self.last.unwrap_or(start)))
    }
}

impl<M: Middleware> Health<M> {
    pub(super) fn new(mw: &M) -> Result<Self> {
        let (publisher, now) = (mw.advertise("/diagnostics", Qos::Volatile(10))?, mw.now());
        let namespace = namespace_of(&mw.node_name()).to_owned();
        let (inputs, reported) = (Vec::new(), String::new());
        Ok(Self { publisher, namespace, started: now, next: now, inputs, outputs: 0, fails: false, reported })
    }

    /// Registers an input. If it is `required`, its silence is reported. Returns its number for [`Health::heard`].
    pub(super) fn input<T: Message>(&mut self, topic: &str, required: bool) -> usize {
        self.add(topic, T::type_name(), required)
    }

    /// Registers an input of this type; empty: of any.
    pub(super) fn add(&mut self, topic: &str, type_name: String, required: bool) -> usize {
        let topic = match topic.starts_with('/') {
            true => topic.to_owned(),
            false => format!("{}/{topic}", self.namespace),
        };
        self.inputs.push(Input { topic, type_name, required, heard: 0, last: None, longest_s: 0.0 });
        self.inputs.len() - 1
    }

    /// Subscribes to an input, as [`Health::input`]; `event` gets its number.
    pub(super) fn hear<T: Message, E: Send + 'static>(
        &mut self,
        mw: &M,
        inbox: &Inbox<E>,
        (topic, required): (&str, bool),
        event: impl Fn(usize, T) -> E + Send + 'static,
    ) -> Result<M::Subscription> {
        let input = self.input::<T>(topic, required);
        inbox.subscribe(mw, topic, Qos::Volatile(100), move |message| event(input, message))
    }

    pub(super) fn heard(&mut self, input: usize, now: Time) {
        if let Some(input) = self.inputs.get_mut(input) {
            input.longest_s = input.silence(self.started, now);
            input.heard += 1;
            input.last = Some(now);
        }
    }

    pub(super) fn sent(&mut self) {
        self.outputs += 1;
    }

    /// Whether the node's trouble keeps it from its work: an error, not a warning.
    pub(super) fn fails(&mut self, fails: bool) {
        self.fails = fails;
    }

    /// Reports if a report is due. `figures` gives the node's own figures, `trouble` its current problem.
    pub(super) fn report<const N: usize>(
        &mut self,
        mw: &M,
        figures: impl FnOnce() -> [(&'static str, String); N],
        trouble: Option<&str>,
    ) {
        let now = mw.now();
        if now < self.next {
            // A clock that jumped back must not stop the reports.
            self.next = self.next.min(now.plus_secs(PERIOD_S));
            return;
        }
        self.next = now.plus_secs(PERIOD_S);
        let message = trouble.map(str::to_owned).or(self.silent(mw, now));
        self.tell(message.as_deref());
        let pair = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
        let received = |input: &Input| pair(&format!("received {}", input.topic), input.heard.to_string());
        let lost = |(topic, count): (String, u64)| pair(&format!("lost {topic}"), count.to_string());
        let mut values: Vec<KeyValue> = self.inputs.iter().map(received).collect();
        let silence = |input: &Input| {
            pair(&format!("{SILENCE}{}", input.topic), format!("{:.0}", input.silence(self.started, now)))
        };
        values.extend(self.inputs.iter().filter(|input| input.required).map(silence));
        values.extend(mw.lost().into_iter().map(lost));
        values.push(pair("sent", self.outputs.to_string()));
        values.extend(figures().into_iter().map(|(key, value)| pair(key, value)));
        let status = DiagnosticStatus {
            level: match message {
                Some(_) if self.fails => DiagnosticStatus::ERROR,
                Some(_) => DiagnosticStatus::WARN,
                None => DiagnosticStatus::OK,
            },
            name: mw.node_name().trim_start_matches('/').to_owned(),
            message: message.unwrap_or_else(|| "running".to_owned()),
            hardware_id: String::new(),
            values,
        };
        let header = Header { stamp: now, frame_id: String::new() };
        if let Err(error) = self.publisher.publish(&DiagnosticArray { header, status: vec![status] }) {
            tracing::debug!("no diagnostics: {error}");
        }
    }

    fn silent(&self, mw: &M, now: Time) -> Option<String> {
        let quiet_since = |input: &&Input| now.secs_since(input.last.unwrap_or(self.started)) >= SILENT_S;
        let input = self.inputs.iter().filter(|input| input.required).find(quiet_since)?;
        let seconds = now.secs_since(input.last.unwrap_or(self.started));
        if input.type_name.is_empty() {
            return Some(format!("no messages on {} for {seconds:.0} s", input.topic));
        }
        let same =
            mw.topics().into_iter().filter(|(topic, kind)| *kind == input.type_name && *topic != input.topic);
        let same: Vec<String> = same.map(|(topic, _)| topic).collect();
        let others = "; other topics of that type: ";
        let hint = if same.is_empty() { String::new() } else { format!("{others}{}", same.join(", ")) };
        Some(format!("no messages on {} ({}) for {seconds:.0} s{hint}", input.topic, input.type_name))
    }

    /// Logs a problem once when it appears, and once when it is over.
    fn tell(&mut self, message: Option<&str>) {
        // The seconds in a message change, but the problem is the same.
        let kind: String = message.unwrap_or_default().chars().filter(|c| !c.is_ascii_digit()).collect();
        match message {
            Some(message) if kind != self.reported => tracing::warn!("{message}"),
            None if !self.reported.is_empty() => tracing::info!("running again"),
            _ => {}
        }
        self.reported = kind;
    }
}
