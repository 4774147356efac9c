//! A recording played to the nodes: what they record of it.

use std::{path::Path, sync::Arc};

use roscausal_core::{Time, loopback::Loopback, middleware::Raw, nodes, params::Value};
use roscausal_recording::{Player, Recording, Topic};

use crate::common::csv_files;

/// How the nodes hear a recording.
pub(crate) struct Live<'a> {
    /// Parameters that are texts: node, name, value.
    pub(crate) texts: &'a [(&'a str, &'a str, &'a str)],
    /// The data node's signals.
    pub(crate) signals: &'a [&'a str],
    /// Topics that are played.
    pub(crate) wanted: &'a dyn Fn(&Topic) -> bool,
    /// Topics whose messages are sent as bytes.
    pub(crate) raw: &'a dyn Fn(&Topic) -> bool,
}

impl Live<'_> {
    /// The raw batches of everybody, in one piece each, that the nodes record in `dir`.
    pub(crate) fn record(&self, dir: &Path, recording: &str) -> Vec<(String, String)> {
        let bus = Loopback::lockstep();
        let text = |node: &str, name: &str, value: &str| {
            bus.set_node_param(node, name, Value::Str(value.to_owned()));
        };
        for (name, folder) in [("data_dir", "raw"), ("pp_data_dir", "pp")] {
            text("data", name, &dir.join(folder).display().to_string());
        }
        self.texts.iter().for_each(|(node, name, value)| text(node, name, value));
        text("data", "sel_agent", "all");
        bus.set_node_param("data", "ts_length", Value::Double(0.0));
        if !self.signals.is_empty() {
            let signals = self.signals.iter().map(|&signal| Value::Str(signal.to_owned())).collect();
            bus.set_node_param("data", "signals", Value::List(signals));
        }
        let mut recording = Recording::open(Path::new(recording)).expect("opens");
        let (start, _) = recording.span().expect("has messages");
        bus.advance_to(Time { nanosec: 0, ..start });
        let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
        let human = bus.start_task("human", async |mw| nodes::run_task("human", &mw).await);
        let data = bus.start("data", |mw| nodes::data(&mw)).expect("starts");
        let driver = bus.node("driver");
        let all = recording.topics().to_vec();
        let kinds: Vec<_> = all.iter().map(|topic| topic.raw_type().map(Arc::new)).collect();
        recording.select(self.wanted);
        let mut player = Player::new(&driver, &recording, |of| {
            (!(self.raw)(of)).then(|| of.playable()).filter(|_| of.known_type().is_some())
        })
        .expect("plays");
        for record in recording.by_ref() {
            bus.advance_to(record.stamp);
            let of = &all[record.topic];
            match kinds[record.topic].clone().filter(|_| (self.raw)(of)) {
                Some(kind) => {
                    driver.publish_raw(&of.name, Raw { kind, bytes: record.bytes.clone() }).expect("is sent")
                }
                None => player.publish(of, &record).expect("is sent"),
            }
            bus.settle();
        }
        bus.shutdown();
        robot.end().expect("no panic").expect("ends well");
        human.end().expect("no panic").expect("ends well");
        data.join().expect("ends").expect("records");
        csv_files(&dir.join("raw"))
    }
}
