//! No stamp from outside bounds a loop: one that is years ahead costs the recorder nothing.

use std::time::Instant;

use roscausal_core::{
    Time,
    batch::{
        Sampling, Select,
        recorder::{Recorder, RecorderConfig},
    },
};
use roscausal_msgs::{HumanState, Humans, RobotState, std_msgs::Header};

/// The time of 2001, seconds.
const BEGIN: f64 = 1e9;

fn recorder() -> Recorder {
    Recorder::new(RecorderConfig {
        dt_s: 0.1,
        ts_length_s: Some(1.0),
        max_gap_s: 0.5,
        sampling: Sampling::default(),
        select: Select::All,
    })
}

fn header(seconds: f64) -> Header {
    Header { stamp: Time::from_secs_f64(seconds), frame_id: "map".into() }
}

fn robot(seconds: f64) -> RobotState {
    RobotState { header: header(seconds), ..RobotState::default() }
}

fn humans(seconds: f64) -> Humans {
    let human = HumanState { header: header(seconds), id: 1, ..HumanState::default() };
    Humans { header: header(seconds), humans: vec![human] }
}

/// Robot and person at 20 Hz.
fn feed(recorder: &mut Recorder, from: f64, seconds: f64) {
    for number in 0..(20.0 * seconds) as u32 {
        let at = from + 0.05 * f64::from(number);
        recorder.robot(&robot(at), Time::ZERO);
        recorder.humans(&humans(at), Time::ZERO);
    }
}

#[test]
fn no_row_is_written_for_the_time_up_to_a_stamp_far_away() {
    for far in [3e8, -3e8, 100.0] {
        for of_robot in [true, false] {
            let mut recorder = recorder();
            feed(&mut recorder, BEGIN, 3.0);
            match of_robot {
                true => recorder.robot(&robot(BEGIN + 3.0 + far), Time::ZERO),
                false => recorder.humans(&humans(BEGIN + 3.0 + far), Time::ZERO),
            }
            feed(&mut recorder, BEGIN + 3.0, 3.0);
            recorder.finish();
            let rows = recorder.counts().rows + recorder.counts().waited;
            assert!((30..120).contains(&rows), "{far}: {rows} rows");
            let complete = recorder.take_batches().iter().filter(|batch| batch.complete).count();
            assert!(complete >= 3, "{far}: {complete} batches");
        }
    }
}

#[test]
fn clocks_that_differ_for_good_cost_nothing() {
    let (mut recorder, begin) = (recorder(), Instant::now());
    for number in 0..1000 {
        let at = 0.05 * f64::from(number);
        recorder.robot(&robot(1000.0 + at), Time::ZERO);
        recorder.humans(&humans(1.7e9 + at), Time::ZERO);
    }
    recorder.finish();
    assert!(recorder.counts().rows + recorder.counts().waited < 50_000);
    assert!(recorder.counts().jumps > 0 && begin.elapsed().as_secs() < 10);
}
