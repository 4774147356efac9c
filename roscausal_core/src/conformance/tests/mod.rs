//! What every [`Middleware`] must do, as functions that assert it. Implementations call them in their tests.
//!
//! Each conformance test is a function whose name is the claim. [`middleware_conformance`] runs all that hold on any middleware. A
//! test waits until its claim has come true, with a time-out, because discovery and delivery take time. For what
//! must not happen it waits [`QUIET`].
#![allow(clippy::panic, reason = "a claim that does not hold fails the test that calls it")]

mod parameters;
mod services;
mod time;
mod topics;

pub use parameters::*;
pub use services::*;
pub use time::*;
pub use topics::*;

use std::{
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use roscausal_msgs::std_msgs::Float64;

use crate::{
    Result,
    gate::lock,
    middleware::{Middleware, Publish, Qos},
};

/// How long a test waits for what must happen.
pub const PATIENCE: Duration = Duration::from_secs(15);
/// How long a test waits for what must not happen.
pub const QUIET: Duration = Duration::from_millis(300);

/// Runs all conformance tests. `new_node` joins as a node of the given name, with no parameter set. `settle` lets messages
/// arrive and time pass: at least a millisecond on the nodes' clock. It may return before everything has arrived.
///
/// [`absolute_parameters_are_shared`] is not included, because every ROS 2 parameter belongs to a node.
///
/// # Panics
/// If one fails, with its claim and what happened.
pub fn middleware_conformance<M: Middleware>(new_node: impl Fn(&str) -> M, settle: impl Fn()) {
    let (node, settle) = (&new_node, &settle);
    every_subscriber_hears_every_message_in_order(node, settle);
    two_publishers_of_a_topic_are_both_heard(node, settle);
    a_listener_reads_a_topic_by_its_definition(node, settle);
    a_dropped_subscription_hears_nothing_more(node, settle);
    a_dropped_subscription_is_no_longer_counted(node, settle);
    a_latched_topic_gives_a_late_joiner_exactly_the_last_message(node, settle);
    a_volatile_topic_gives_a_late_joiner_nothing(node, settle);
    the_latched_message_of_a_dropped_publisher_is_gone(node, settle);
    another_type_on_a_topic_is_an_error_or_silence(node, settle);
    relative_and_private_names_belong_to_the_node(node, settle);
    illegal_names_are_errors(node);
    topics_are_listed_with_their_types(node, settle);
    every_caller_gets_its_own_answers(node);
    a_late_answer_holds_up_no_other(node);
    no_answer_is_an_error(node);
    a_caller_that_has_left_disturbs_nobody(node);
    a_service_is_offered_once(node);
    a_question_of_another_type_is_an_error(node);
    an_unset_parameter_is_none(node);
    a_set_parameter_reads_back(node);
    private_parameters_are_the_nodes_own(node);
    an_inbox_hands_out_events_in_order(node, settle);
    a_full_inbox_drops_the_oldest_and_counts(node);
    a_deadline_fires_and_not_early(node, settle);
    shutdown_wakes_an_inbox_after_what_is_queued(node, settle);
}

/// Settles until `done`.
fn eventually(settle: impl Fn(), claim: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < PATIENCE, "{claim}: not within {PATIENCE:?}");
        settle();
        thread::sleep(Duration::from_millis(1));
    }
}

/// Settles long enough for something forbidden to happen.
fn quietly(settle: impl Fn()) {
    let start = Instant::now();
    while start.elapsed() < QUIET {
        settle();
        thread::sleep(Duration::from_millis(10));
    }
}

/// The received numbers, in order. Cheap to clone; all clones are one list.
#[derive(Clone, Default)]
struct Heard(Arc<Mutex<Vec<f64>>>);

impl Heard {
    fn hear(&self) -> impl FnMut(Float64) + Send + 'static {
        let heard = self.clone();
        move |message| lock(&heard.0).push(message.data)
    }

    fn all(&self) -> Vec<f64> {
        lock(&self.0).clone()
    }

    /// The received numbers without the negative ones, which only open the connection.
    fn numbers(&self) -> Vec<f64> {
        self.all().into_iter().filter(|number| *number >= 0.0).collect()
    }
}

const VOLATILE: Qos = Qos::Volatile(100);

fn publish(publisher: &impl Publish<Float64>, data: f64) {
    must(publisher.publish(&Float64 { data }), "a publisher takes a message");
}

fn must<T>(result: Result<T>, claim: &str) -> T {
    match result {
        Ok(value) => value,
        Err(error) => panic!("{claim}: {error}"),
    }
}

/// Publishes -1 until all listeners have received it. Some middlewares lose what is sent before both ends have
/// found each other.
fn connect(settle: impl Fn(), publisher: &impl Publish<Float64>, listeners: &[&Heard]) {
    let start = Instant::now();
    let mut sent: Option<Instant> = None;
    while listeners.iter().any(|heard| heard.all().is_empty()) {
        assert!(start.elapsed() < PATIENCE, "subscribers hear a publisher: not within {PATIENCE:?}");
        if sent.is_none_or(|sent| sent.elapsed() > Duration::from_millis(50)) {
            publish(publisher, -1.0);
            sent = Some(Instant::now());
        }
        settle();
        thread::sleep(Duration::from_millis(1));
    }
}
