//! Laws of topics.

use roscausal_msgs::std_msgs::{Float64, String as Text};

use std::sync::{Arc, Mutex};

use super::{Heard, VOLATILE, connect, eventually, must, publish, quietly};
use crate::{
    Time,
    gate::lock,
    middleware::{Middleware, Publish, Qos, Raw},
    signal::{Definitions, Signal, Signals},
};

/// Messages that may be sent back to back. ROS 1's library drops those beyond 8.
const BURST: usize = 5;

/// Messages arrive at every subscriber exactly once, in the order in which they were sent. They are sent in bursts
/// of 5.
pub fn every_subscriber_hears_every_message_in_order<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, near, far) = (node("order_sender"), node("order_near"), node("order_far"));
    let publisher = must(sender.advertise("/order", VOLATILE), "advertise");
    let (a, b, c) = (Heard::default(), Heard::default(), Heard::default());
    let _near = must(near.subscribe("/order", VOLATILE, a.hear()), "subscribe");
    let _again = must(near.subscribe("/order", VOLATILE, b.hear()), "subscribe twice");
    let _far = must(far.subscribe("/order", VOLATILE, c.hear()), "subscribe");
    connect(settle, &publisher, &[&a, &b, &c]);
    let mut sent = Vec::new();
    for _ in 0..6 {
        for _ in 0..BURST {
            sent.push(sent.len() as f64);
            publish(&publisher, sent.len() as f64 - 1.0);
        }
        let all = || [&a, &b, &c].iter().all(|heard| heard.numbers().len() >= sent.len());
        eventually(settle, "every subscriber hears every message", all);
    }
    quietly(settle);
    for heard in [a, b, c] {
        assert_eq!(heard.numbers(), sent, "every subscriber hears every message once, in order");
    }
}

/// A listener gets the messages of a topic as bytes, whatever their type, with a definition by which they are read; a
/// middleware that cannot says so.
pub fn a_listener_reads_a_topic_by_its_definition<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("raw_sender"), node("raw_listener"));
    let publisher = must(sender.advertise("/raw_numbers", VOLATILE), "advertise");
    let mut signals = Signals::new(
        vec![must(Signal::parse("x = 2 * /raw_numbers.data", 2.0, "signals"), "a signal")],
        Definitions::default(),
    );
    let heard = Arc::new(Mutex::new(Vec::new()));
    let hears = heard.clone();
    let listening = listener.listen("/raw_numbers", move |raw: Raw| lock(&hears).push(raw));
    let _listening = match listening {
        Ok(listening) => listening,
        Err(error) => return assert!(error.to_string().contains("--signal"), "{error}"),
    };
    let arrives = || {
        publish(&publisher, 21.0);
        settle();
        lock(&heard).len() > 1
    };
    eventually(settle, "a listener hears a topic of any type", arrives);
    for raw in lock(&heard).iter() {
        let readings = signals.heard(0, raw, Time::from_secs_f64(1.0));
        assert_eq!(readings.first().map(|reading| reading.value), Some(42.0), "{:?}", signals.trouble());
    }
}

/// A topic may have several publishers, and a subscriber receives from all of them.
pub fn two_publishers_of_a_topic_are_both_heard<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (one, two, listener) = (node("both_one"), node("both_two"), node("both_listener"));
    let first = must(one.advertise("/both", VOLATILE), "advertise");
    let second = must(two.advertise("/both", VOLATILE), "advertise the same topic in another node");
    let heard = Heard::default();
    let _subscription = must(listener.subscribe("/both", VOLATILE, heard.hear()), "subscribe");
    let both = || {
        publish(&first, 1.0);
        publish(&second, 2.0);
        settle();
        let numbers = heard.numbers();
        numbers.contains(&1.0) && numbers.contains(&2.0)
    };
    eventually(settle, "both publishers are heard", both);
}

/// After a subscription is dropped its callback does not run again, and other subscriptions continue.
pub fn a_dropped_subscription_hears_nothing_more<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("dropped_sender"), node("dropped_listener"));
    let publisher = must(sender.advertise("/dropped", VOLATILE), "advertise");
    let (goes, stays) = (Heard::default(), Heard::default());
    let subscription = must(listener.subscribe("/dropped", VOLATILE, goes.hear()), "subscribe");
    let _other = must(listener.subscribe("/dropped", VOLATILE, stays.hear()), "subscribe");
    connect(settle, &publisher, &[&goes, &stays]);
    drop(subscription);
    let before = goes.all();
    publish(&publisher, 1.0);
    eventually(settle, "another subscription is still heard", || stays.numbers() == [1.0]);
    quietly(settle);
    assert_eq!(goes.all(), before, "a dropped subscription hears nothing more");
}

/// [`Publish::subscriber_count`] follows subscriptions as they come and go.
pub fn a_dropped_subscription_is_no_longer_counted<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("count_sender"), node("count_listener"));
    let publisher = must(sender.advertise::<Float64>("/count", VOLATILE), "advertise");
    assert_eq!(publisher.subscriber_count(), 0, "nobody has subscribed");
    let subscription = must(listener.subscribe("/count", VOLATILE, |_: Float64| ()), "subscribe");
    eventually(settle, "a subscriber is counted", || publisher.subscriber_count() == 1);
    drop(subscription);
    eventually(settle, "a dropped subscriber is not counted", || publisher.subscriber_count() == 0);
}

/// A late subscriber of a latched topic gets the last message, only that one, and only once. Then it gets new
/// messages.
pub fn a_latched_topic_gives_a_late_joiner_exactly_the_last_message<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("latched_sender"), node("latched_listener"));
    let publisher = must(sender.advertise("/latched", Qos::Latched), "advertise");
    for number in 0..3 {
        publish(&publisher, f64::from(number));
        quietly(settle);
    }
    let heard = Heard::default();
    let _subscription = must(listener.subscribe("/latched", Qos::Latched, heard.hear()), "subscribe");
    eventually(settle, "a late joiner gets the latched message", || !heard.all().is_empty());
    quietly(settle);
    assert_eq!(heard.all(), [2.0], "a late joiner gets exactly the last message");
    publish(&publisher, 3.0);
    eventually(settle, "a late joiner hears what is new", || heard.all().len() > 1);
    quietly(settle);
    assert_eq!(heard.all(), [2.0, 3.0], "what is new comes once");
}

/// Messages sent on a volatile topic before the subscription are not delivered.
pub fn a_volatile_topic_gives_a_late_joiner_nothing<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("volatile_sender"), node("volatile_listener"));
    let publisher = must(sender.advertise("/volatile", VOLATILE), "advertise");
    publish(&publisher, 1.0);
    quietly(settle);
    let heard = Heard::default();
    let _subscription = must(listener.subscribe("/volatile", VOLATILE, heard.hear()), "subscribe");
    connect(settle, &publisher, &[&heard]);
    quietly(settle);
    assert_eq!(heard.numbers(), Vec::<f64>::new(), "a late joiner of a volatile topic gets nothing old");
}

/// A latched message disappears with its publisher. (Nothing is promised while another publisher of the topic
/// lives.)
pub fn the_latched_message_of_a_dropped_publisher_is_gone<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("gone_sender"), node("gone_listener"));
    let publisher = must(sender.advertise("/gone", Qos::Latched), "advertise");
    publish(&publisher, 1.0);
    quietly(settle);
    drop(publisher);
    quietly(settle);
    let heard = Heard::default();
    let _subscription = must(listener.subscribe("/gone", Qos::Latched, heard.hear()), "subscribe");
    quietly(settle);
    quietly(settle);
    assert_eq!(heard.all(), Vec::<f64>::new(), "a latched message goes with its publisher");
}

/// A subscriber of another type than the publisher's gets an error, or no messages.
pub fn another_type_on_a_topic_is_an_error_or_silence<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("type_sender"), node("type_listener"));
    let publisher = must(sender.advertise("/type", VOLATILE), "advertise");
    let (right, wrong) = (Heard::default(), Heard::default());
    let _right = must(listener.subscribe("/type", VOLATILE, right.hear()), "subscribe");
    let mut hear = wrong.hear();
    let other = node("type_other");
    // The same eight bytes decode as a Float64, and as a text of some length.
    let wrong_type =
        other.subscribe("/type", VOLATILE, move |text: Text| hear(Float64 { data: text.data.len() as f64 }));
    connect(settle, &publisher, &[&right]);
    publish(&publisher, 0.0);
    eventually(settle, "the right type is heard", || right.numbers() == [0.0]);
    quietly(settle);
    assert_eq!(wrong.all(), Vec::<f64>::new(), "another type is never made of the bytes");
    drop(wrong_type);
}

/// `x` is in the node's namespace, `~x` below the node's own name.
pub fn relative_and_private_names_belong_to_the_node<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (sender, listener) = (node("names_sender"), node("names_listener"));
    let (private, relative) = (Heard::default(), Heard::default());
    let to_private = must(sender.advertise("~private_topic", VOLATILE), "advertise a private name");
    let to_relative = must(sender.advertise("relative_topic", VOLATILE), "advertise a relative name");
    let absolute = format!("{}/private_topic", sender.node_name());
    let _private = must(listener.subscribe(&absolute, VOLATILE, private.hear()), "subscribe");
    let _relative = must(listener.subscribe("relative_topic", VOLATILE, relative.hear()), "subscribe");
    connect(settle, &to_private, &[&private]);
    connect(settle, &to_relative, &[&relative]);
}

/// A name that ROS does not allow is an error, for publishers and for subscribers.
pub fn illegal_names_are_errors<M: Middleware>(node: &impl Fn(&str) -> M) {
    let node = node("illegal");
    for name in ["", "/", "a//b", "/a/", "1a", "/a/2b", "a b", "a-b", "a~b", "ä"] {
        assert!(node.advertise::<Float64>(name, VOLATILE).is_err(), "advertise '{name}' is an error");
        let subscription = node.subscribe(name, VOLATILE, |_: Float64| ());
        assert!(subscription.is_err(), "subscribe '{name}' is an error");
    }
}

/// [`Middleware::topics`] lists what every node publishes.
pub fn topics_are_listed_with_their_types<M: Middleware>(node: &impl Fn(&str) -> M, settle: &impl Fn()) {
    let (sender, asker) = (node("listed_sender"), node("listed_asker"));
    let _publisher = must(sender.advertise::<Float64>("/listed", VOLATILE), "advertise");
    let listed = ("/listed".to_owned(), "std_msgs/Float64".to_owned());
    eventually(settle, "a published topic is listed with its type", || asker.topics().contains(&listed));
}
