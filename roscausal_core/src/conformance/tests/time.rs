//! Laws of inboxes: order, bounds, deadlines, shutdown.

use std::{sync::mpsc, thread};

use roscausal_msgs::std_msgs::Float64;

use super::{Heard, VOLATILE, connect, eventually, must, publish, quietly};
use crate::{
    Time,
    inbox::{Inbox, Next},
    middleware::Middleware,
};

/// Runs a node on a thread of its own until it ends.
fn alongside<T: Send + 'static>(
    settle: &impl Fn(),
    claim: &str,
    run: impl FnOnce() -> T + Send + 'static,
) -> T {
    let thread = thread::spawn(run);
    eventually(settle, claim, || thread.is_finished());
    match thread.join() {
        Ok(value) => value,
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Events leave an inbox in the order in which they were sent, on the thread that owns it.
pub fn an_inbox_hands_out_events_in_order<M: Middleware>(node: &impl Fn(&str) -> M, settle: &impl Fn()) {
    let (sender, reader) = (node("inbox_sender"), node("inbox_reader"));
    let publisher = must(sender.advertise("/inbox", VOLATILE), "advertise");
    let (heard, reads) = (Heard::default(), reader.clone());
    let mut hear = heard.hear();
    let thread = thread::spawn(move || {
        let inbox = Inbox::new(&reads, 100);
        let events = inbox.sender();
        let _subscription =
            reads.subscribe("/inbox", VOLATILE, move |message: Float64| events.send(message))?;
        while let Next::Event(message) = inbox.next(&reads, None) {
            hear(message);
        }
        crate::Result::Ok(())
    });
    connect(settle, &publisher, &[&heard]);
    let numbers: Vec<f64> = (0..5).map(f64::from).collect();
    numbers.iter().for_each(|number| publish(&publisher, *number));
    eventually(settle, "events arrive in the node's thread", || heard.numbers() == numbers);
    reader.shutdown();
    eventually(settle, "the node ends", || thread.is_finished());
    if let Ok(ended) = thread.join() {
        must(ended, "subscribe");
    }
}

/// An inbox holds as many events as it was made for. Further events drop the oldest ones, which are counted.
pub fn a_full_inbox_drops_the_oldest_and_counts<M: Middleware>(node: &impl Fn(&str) -> M) {
    let node = node("inbox_full");
    let inbox = Inbox::new(&node, 3);
    let sender = inbox.sender();
    (0..10).for_each(|event| sender.send(event));
    assert_eq!(inbox.dropped(), 7, "each dropped event is counted");
    for event in 7..10 {
        assert_eq!(inbox.next(&node, None), Next::Event(event), "the newest are kept, oldest first");
    }
    drop(inbox);
    sender.send(10);
}

/// A wait ends at its deadline and not before, every time.
pub fn a_deadline_fires_and_not_early<M: Middleware>(node: &impl Fn(&str) -> M, settle: &impl Fn()) {
    let node = node("deadline");
    let late = alongside(settle, "deadlines fire", move || {
        let inbox = Inbox::<()>::new(&node, 3);
        let start = node.now();
        let deadlines = (1..=3).map(|step| start.plus_secs(0.02 * f64::from(step)));
        let wait = |deadline| (inbox.next(&node, Some(deadline)), node.now().secs_since(deadline));
        let past = (inbox.next(&node, Some(Time::ZERO)), 0.0);
        deadlines.map(wait).chain([past]).collect::<Vec<_>>()
    });
    for (next, late) in late {
        assert_eq!(next, Next::Deadline, "a deadline fires");
        assert!(late >= 0.0, "a deadline fired {} s early", -late);
    }
}

/// [`Middleware::shutdown`] ends the wait of a node after it got what was queued. Other nodes continue.
pub fn shutdown_wakes_an_inbox_after_what_is_queued<M: Middleware>(
    node: &impl Fn(&str) -> M,
    settle: &impl Fn(),
) {
    let (ends, goes_on) = (node("shutdown"), node("shutdown_other"));
    assert!(ends.is_ok(), "a new node is ok");
    let (waits, (ready, is_ready)) = (ends.clone(), mpsc::channel());
    let thread = thread::spawn(move || {
        let inbox = Inbox::new(&waits, 10);
        let sender = inbox.sender();
        // Only a node that is woken gets this far.
        let _ = ready.send(sender.clone());
        let first = inbox.next(&waits, None);
        [first, inbox.next(&waits, None), inbox.next(&waits, None)]
    });
    let mut sender = None;
    eventually(settle, "a node starts", || {
        sender = is_ready.try_recv().ok();
        sender.is_some()
    });
    quietly(settle);
    assert!(!thread.is_finished(), "without a deadline a node waits for events alone");
    ends.shutdown();
    if let Some(sender) = sender {
        sender.send(1);
    }
    eventually(settle, "shutdown wakes a waiting node", || thread.is_finished());
    if let Ok(got) = thread.join() {
        let queued = usize::from(got[0] == Next::Event(1));
        assert!(
            got[queued..].iter().all(|next| *next == Next::Shutdown),
            "after the queued, the end: {got:?}"
        );
    }
    let ended = node("shutdown_queued");
    let inbox = Inbox::new(&ended, 10);
    inbox.sender().send(2);
    ended.shutdown();
    assert!(!ended.is_ok(), "a node that is shut down is not ok");
    assert_eq!(inbox.next(&ended, None), Next::Event(2), "what is queued comes before the end");
    assert_eq!(inbox.next(&ended, None), Next::Shutdown, "then the end");
    assert!(goes_on.is_ok(), "other nodes go on");
}
