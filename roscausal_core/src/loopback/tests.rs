//! Tests of the loopback bus: order, determinism, shutdown, tasks.

use std::{
    pin::pin,
    sync::{
        Arc, Barrier, Mutex,
        atomic::{AtomicUsize, Ordering},
        mpsc,
    },
    task::{Context, Waker},
};

use roscausal_msgs::{
    pedsim_msgs::{AgentStates, AgentStatesWithGoal},
    std_msgs::Float64,
};

use super::*;
use crate::{
    conformance,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos},
};

const VOLATILE: Qos = Qos::Volatile(10);

#[test]
fn lockstep_passes_the_conformance_tests() {
    let bus = Loopback::lockstep();
    let settle = || bus.advance_to(bus.now().plus_secs(0.005));
    conformance::middleware_conformance(|name| bus.node(name), settle);
    conformance::absolute_parameters_are_shared(&|name: &str| bus.node(name));
}

#[test]
fn live_passes_the_conformance_tests() {
    let start = std::time::Instant::now();
    let bus = Loopback::live(move || Time::from_secs_f64(1.0 + start.elapsed().as_secs_f64()));
    conformance::middleware_conformance(|name| bus.node(name), || ());
    conformance::absolute_parameters_are_shared(&|name: &str| bus.node(name));
}

type Log = Arc<Mutex<Vec<String>>>;

/// A node that answers the others, acts on deadlines, and logs what it receives.
async fn talker(node: LoopbackNode, period: f64, log: Log) {
    let name = node.node_name();
    let inbox = Inbox::new(&node, 100);
    let stated = node.advertise::<Float64>(&name, VOLATILE).unwrap();
    let subscriptions: Vec<_> = ["/a", "/b", "/c", "/clockwork"]
        .into_iter()
        .map(|topic| {
            let events = inbox.sender();
            let hear = move |message: Float64| events.send((topic, message.data));
            node.subscribe(topic, VOLATILE, hear).unwrap()
        })
        .collect();
    let mut deadline = node.now().plus_secs(period);
    loop {
        let line = match inbox.awaited(&node, Some(deadline)).await {
            Next::Event((topic, data)) => {
                if data < 3.0 && topic != name {
                    stated.publish(&Float64 { data: data + 1.0 }).unwrap();
                }
                format!("{name} hears {data} on {topic} at {:?}", node.now())
            }
            Next::Deadline => {
                stated.publish(&Float64 { data: 2.0 }).unwrap();
                deadline = deadline.plus_secs(period);
                format!("{name} is due at {:?}", node.now())
            }
            Next::Shutdown => break,
        };
        log.lock().unwrap().push(line);
    }
    stated.publish(&Float64 { data: 9.0 }).unwrap();
    log.lock().unwrap().push(format!("{name} ends"));
    drop(subscriptions);
}

/// Three nodes that talk to each other, those in `tasks` as tasks and the others as threads. Returns all messages
/// in order.
fn conversation(tasks: &[&str]) -> Vec<String> {
    let bus = Loopback::lockstep();
    let log = Log::default();
    let (mut threads, mut polled) = (Vec::new(), Vec::new());
    for (name, period) in [("a", 0.1), ("b", 0.1), ("c", 0.25)] {
        let log = log.clone();
        if tasks.contains(&name) {
            polled.push(bus.start_task(name, move |node| talker(node, period, log)));
        } else {
            let run = move |node| {
                let waker = Waker::noop();
                assert!(pin!(talker(node, period, log)).poll(&mut Context::from_waker(waker)).is_ready());
            };
            threads.push(bus.start(name, run).unwrap());
        }
    }
    let driver = bus.node("driver");
    let publisher = driver.advertise("/clockwork", VOLATILE).unwrap();
    for step in 1..=10 {
        publisher.publish(&Float64 { data: f64::from(step % 4) }).unwrap();
        bus.advance_to(Time::from_secs_f64(f64::from(step) * 0.17));
    }
    bus.shutdown();
    threads.into_iter().for_each(|thread| thread.join().unwrap());
    polled.into_iter().for_each(|task| task.end().unwrap());
    Arc::into_inner(log).unwrap().into_inner().unwrap()
}

#[test]
fn tasks_and_threads_have_the_same_conversation() {
    let threads = conversation(&[]);
    for tasks in [&["a", "b", "c"][..], &["a"], &["b"], &["a", "c"]] {
        assert_eq!(conversation(tasks), threads, "{tasks:?}");
    }
}

#[test]
fn lockstep_is_the_same_run_every_time() {
    let first = conversation(&[]);
    assert!(first.len() > 200, "{}", first.len());
    assert!(first.iter().any(|line| line.contains("hears 9 on /a")), "the last words are heard");
    for _ in 0..20 {
        assert_eq!(conversation(&[]), first);
    }
}

#[test]
fn a_deadline_is_met_at_its_own_time_however_far_the_clock_is_moved() {
    let bus = Loopback::lockstep();
    let (send, met) = mpsc::channel();
    let thread = bus.start("node", move |node| {
        let inbox = Inbox::<()>::new(&node, 1);
        for step in 1..=30 {
            let deadline = Time::from_secs_f64(f64::from(step) * 0.1);
            assert_eq!(inbox.next(&node, Some(deadline)), Next::Deadline);
            send.send(node.now()).unwrap();
        }
    });
    bus.advance_to(Time::from_secs_f64(10.0));
    thread.unwrap().join().unwrap();
    let expected: Vec<_> = (1..=30).map(|step| Time::from_secs_f64(f64::from(step) * 0.1)).collect();
    assert_eq!(met.try_iter().collect::<Vec<_>>(), expected);
}

#[test]
fn two_drivers_take_turns() {
    let bus = Loopback::lockstep();
    let within = Arc::new(AtomicUsize::new(0));
    let (inside, most) = (within.clone(), Arc::new(AtomicUsize::new(0)));
    let most_seen = most.clone();
    let node = bus.node("node");
    let _subscriptions: Vec<_> = (0..2)
        .map(|_| {
            let (inside, most) = (inside.clone(), most_seen.clone());
            let hear = move |_: Float64| {
                most.fetch_max(inside.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                thread::yield_now();
                inside.fetch_sub(1, Ordering::SeqCst);
            };
            node.subscribe("/x", VOLATILE, hear).unwrap()
        })
        .collect();
    let publisher = node.advertise("/x", VOLATILE).unwrap();
    for _ in 0..500 {
        publisher.publish(&Float64::default()).unwrap();
    }
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| bus.settle());
        }
    });
    assert_eq!(most.load(Ordering::SeqCst), 1);
    assert!(bus.bus.lock().deliveries.is_empty());
}

#[test]
fn a_callback_may_drive_publish_to_itself_and_drop_itself() {
    for bus in [Loopback::lockstep(), Loopback::live(|| Time::ZERO)] {
        let node = bus.node("node");
        let publisher = node.advertise("/x", VOLATILE).unwrap();
        let (again, driven) = (node.advertise("/x", VOLATILE).unwrap(), bus.clone());
        let slot = Arc::new(Mutex::new(None));
        let (own, heard) = (slot.clone(), Arc::new(Mutex::new(Vec::new())));
        let hears = heard.clone();
        let hear = move |message: Float64| {
            hears.lock().unwrap().push(message.data);
            again.publish(&Float64 { data: message.data + 1.0 }).unwrap();
            driven.settle();
            if message.data >= 3.0 {
                own.lock().unwrap().take();
            }
        };
        *slot.lock().unwrap() = Some(node.subscribe("/x", VOLATILE, hear).unwrap());
        publisher.publish(&Float64 { data: 1.0 }).unwrap();
        bus.settle();
        assert_eq!(*heard.lock().unwrap(), [1.0, 2.0, 3.0]);
    }
}

#[test]
fn dropping_a_subscription_waits_for_the_call_under_way() {
    let bus = Loopback::live(|| Time::ZERO);
    let node = bus.node("node");
    let publisher = node.advertise("/x", VOLATILE).unwrap();
    let (entered, done) = (Arc::new(Barrier::new(2)), Arc::new(AtomicBool::new(false)));
    let (enter, finish) = (entered.clone(), done.clone());
    let hear = move |_: Float64| {
        enter.wait();
        thread::sleep(Duration::from_millis(50));
        finish.store(true, Ordering::SeqCst);
    };
    let subscription = node.subscribe("/x", VOLATILE, hear).unwrap();
    thread::scope(|scope| {
        scope.spawn(|| publisher.publish(&Float64::default()).unwrap());
        entered.wait();
        drop(subscription);
        assert!(done.load(Ordering::SeqCst));
    });
}

#[test]
fn nothing_is_left_of_nodes_that_are_gone() {
    let bus = Loopback::lockstep();
    for _ in 0..10 {
        let run = |node: LoopbackNode| {
            let inbox = Inbox::<()>::new(&node, 1);
            let publisher = node.advertise::<Float64>("/x", Qos::Latched).unwrap();
            publisher.publish(&Float64::default()).unwrap();
            let _subscription = node.subscribe("/x", Qos::Latched, |_: Float64| ()).unwrap();
            inbox.next(&node, None)
        };
        let thread = bus.start("node", run).unwrap();
        bus.shutdown();
        assert_eq!(thread.join().unwrap(), Next::Shutdown);
    }
    bus.settle();
    bus.node("last");
    let state = bus.bus.lock();
    assert_eq!((state.topics.len(), state.members.len(), state.deliveries.len()), (0, 0, 0));
    assert!(state.nodes.len() <= 1);
}

#[test]
fn a_node_that_panics_does_not_stop_the_others() {
    let bus = Loopback::lockstep();
    let run = |node: LoopbackNode| {
        let inbox = Inbox::<()>::new(&node, 1);
        inbox.next(&node, Some(Time::from_secs_f64(1.0)));
        panic!("on purpose");
    };
    let thread = bus.start("panics", run).unwrap();
    bus.advance_to(Time::from_secs_f64(5.0));
    assert!(thread.join().is_err());
    bus.advance_to(Time::from_secs_f64(6.0));
}

#[test]
fn a_task_that_panics_does_not_stop_the_others_and_one_dropped_leaves_nothing() {
    let bus = Loopback::lockstep();
    let panics = bus.start_task("panics", |node| async move {
        let inbox = Inbox::<()>::new(&node, 1);
        inbox.awaited(&node, Some(Time::from_secs_f64(1.0))).await;
        assert!(node.now() < Time::from_secs_f64(1.0), "on purpose");
    });
    let waits = |node: LoopbackNode| async move {
        let inbox = Inbox::<()>::new(&node, 1);
        let _publisher = node.advertise::<Float64>("/x", VOLATILE).unwrap();
        inbox.awaited(&node, None).await
    };
    let (ended, dropped) = (bus.start_task("ended", waits), bus.start_task("dropped", waits));
    bus.advance_to(Time::from_secs_f64(5.0));
    assert!(panics.is_finished() && !ended.is_finished());
    let panic = panics.end().unwrap_err();
    assert_eq!(panic.downcast_ref(), Some(&"on purpose"));
    assert_eq!(ended.end().unwrap(), Next::Shutdown);
    assert_eq!(bus.bus.lock().topics.len(), 1);
    drop(dropped);
    bus.settle();
    let state = bus.bus.lock();
    assert_eq!((state.topics.len(), state.members.len()), (0, 0));
}

#[test]
fn a_detached_node_holds_nobody_up_and_hears_of_the_end() {
    let bus = Loopback::lockstep();
    let (release, released) = mpsc::channel::<()>();
    let thread = bus.start("slow", move |node| {
        let inbox = Inbox::<()>::detached(&node, 1);
        released.recv().unwrap();
        inbox.next(&node, None)
    });
    bus.advance_to(Time::from_secs_f64(1.0));
    bus.shutdown();
    release.send(()).unwrap();
    assert_eq!(thread.unwrap().join().unwrap(), Next::Shutdown);
}

#[test]
fn two_forms_of_one_type_are_told_apart_by_their_md5() {
    let node = Loopback::lockstep().node("node");
    let _publisher = node.advertise::<AgentStates>("/agents", VOLATILE).unwrap();
    let error = node.subscribe("/agents", VOLATILE, |_: AgentStatesWithGoal| ()).err().unwrap();
    assert!(error.to_string().contains("md5 aa81ea94344df8d81e135b65d4d499b1"), "{error}");
}
