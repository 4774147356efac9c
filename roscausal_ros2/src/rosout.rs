//! Log messages on `/rosout`.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, TryLockError};

use ros2_client::Log;
use roscausal_core::Result;
use roscausal_ros::{Console, lock};
use tracing::Level;

use crate::Ros2;

impl Ros2 {
    /// Also sends log messages to `/rosout`, for as long as the node lives.
    ///
    /// # Errors
    /// If the topic cannot be created.
    pub fn log_with(&self, console: &Console) -> Result<()> {
        let inner = &self.inner;
        let participant = &inner.participant;
        let outbox = Outbox::new(participant.rosout()?);
        let name = participant.names.logger();
        let node = Arc::downgrade(inner);
        console.forward(move |record| {
            let Some(node) = node.upgrade() else { return };
            let now = node.clock.now();
            let log = Log {
                stamp: ros2_client::builtin_interfaces::Time::new(now.sec, now.nanosec),
                level: match record.level {
                    Level::ERROR => Log::ERROR,
                    Level::WARN => Log::WARN,
                    Level::INFO => Log::INFO,
                    Level::DEBUG | Level::TRACE => Log::DEBUG,
                },
                name: name.clone(),
                msg: record.text,
                file: record.file,
                function: record.function,
                line: record.line,
            };
            outbox.send(log, |writer, log| drop(writer.write(&node.participant, log)));
        });
        Ok(())
    }
}

/// Hands messages to a writer one at a time. Nobody waits: a thread that finds another one at the writer leaves its
/// message to that one.
struct Outbox<W, M> {
    writer: Mutex<W>,
    waiting: Mutex<VecDeque<M>>,
}

impl<W, M> Outbox<W, M> {
    fn new(writer: W) -> Self {
        Self { writer: Mutex::new(writer), waiting: Mutex::default() }
    }

    fn send(&self, message: M, write: impl Fn(&mut W, M)) {
        lock(&self.waiting).push_back(message);
        // Checks again after the writer is free: other threads may have left messages meanwhile.
        while !lock(&self.waiting).is_empty() {
            let mut writer = match self.writer.try_lock() {
                Ok(writer) => writer,
                Err(TryLockError::Poisoned(writer)) => writer.into_inner(),
                Err(TryLockError::WouldBlock) => return,
            };
            loop {
                let Some(message) = lock(&self.waiting).pop_front() else { break };
                write(&mut writer, message);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_threads_log_at_once_is_all_sent_in_each_ones_order() {
        let outbox = Outbox::new(Vec::new());
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let outbox = &outbox;
                scope.spawn(move || {
                    (0..2000).for_each(|k| outbox.send((thread, k), |sent, message| sent.push(message)))
                });
            }
        });
        let sent = outbox.writer.into_inner().unwrap();
        for thread in 0..4 {
            let own: Vec<_> = sent.iter().filter(|(of, _)| *of == thread).map(|(_, k)| *k).collect();
            assert_eq!(own, (0..2000).collect::<Vec<_>>());
        }
    }
}
