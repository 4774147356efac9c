//! `chain DIR [odometry_hz] [people] [dt] [ts_length]` records and analyses until `DIR/stop` appears, then prints
//! what it has sent. See `tests/soak.sh`.

#![allow(clippy::expect_used, reason = "an example ends with its first fault")]

mod chain;

use chain::Chain;
use roscausal_core::params::Value;

fn main() {
    let mut args = std::env::args().skip(1);
    let dir = args
        .next()
        .expect("usage: chain DIR [odometry_hz] [people] [dt] [ts_length] [node.parameter=value ...]");
    let (settings, numbers): (Vec<String>, Vec<String>) = args.partition(|arg| arg.contains('='));
    let number =
        |i: usize, default: f64| numbers.get(i).map_or(default, |text| text.parse().expect("a number"));
    let setting = |text: &String| {
        let (name, value) = text.split_once('=')?;
        let (node, name) = name.split_once('.')?;
        Some((node.to_owned(), name.to_owned(), Value::Str(value.to_owned())))
    };
    let chain = Chain {
        odometry_hz: number(0, 50.0),
        people: number(1, 2.0) as u32,
        batches: (number(2, 0.05), number(3, 1.0)),
        drain: numbers.first().is_some_and(|hz| hz == "0"),
        settings: settings.iter().filter_map(setting).collect(),
        ..Chain::new(dir.as_ref())
    };
    let (odometry, people) = chain.run();
    println!("sent: {odometry} odometry, {people} people messages");
}
