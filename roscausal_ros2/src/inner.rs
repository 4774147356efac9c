//! What the clones of a node share: its participant, its parameters and its clock.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use ros2_client::parameters::raw::ParameterEvent;
use roscausal_core::{Result, middleware::Qos, params::Value};
use roscausal_msgs::rosgraph_msgs;
use roscausal_ros::{Clock, Life, lock};
use tracing::error;

use crate::dds::{Participant, Subscription, Writer};
use crate::rcl::{Parameters, USE_SIM_TIME};

/// What the clones of a node share.
pub(crate) struct Inner {
    pub(crate) participant: Arc<Participant>,
    pub(crate) parameters: Parameters,
    /// The topic that announces changes of parameters.
    pub(crate) parameter_events: Mutex<Writer<ParameterEvent>>,
    pub(crate) clock: Clock,
    pub(crate) life: Life,
    pub(crate) clock_subscription: Mutex<Option<Subscription>>,
    pub(crate) failed: AtomicBool,
}

impl Inner {
    pub(crate) fn use_sim_time(self: &Arc<Self>, on: bool) -> Result<()> {
        self.clock.simulate(on);
        let mut subscription = lock(&self.clock_subscription);
        if !on {
            *subscription = None;
        } else if subscription.is_none() {
            let inner = Arc::downgrade(self);
            let tick = move |message: rosgraph_msgs::Clock| {
                if let Some(inner) = inner.upgrade() {
                    inner.clock.tick(message.clock);
                    inner.life.wake();
                }
            };
            *subscription = Some(self.participant.subscribe("/clock", Qos::Volatile(10), tick)?);
        }
        Ok(())
    }

    /// Called for each parameter that is set from outside.
    pub(crate) fn parameter_set(self: &Arc<Self>, name: &str, value: &Value) {
        if name == USE_SIM_TIME.name
            && let Err(error) = self.use_sim_time(*value == Value::Bool(true))
        {
            error!("{error}");
        }
    }

    pub(crate) fn fail(&self, reason: &str) {
        error!("{reason}; the node ends, to be started again");
        self.failed.store(true, Ordering::SeqCst);
        self.life.end();
    }

    pub(crate) fn leave(&self) {
        self.life.end();
        drop(lock(&self.clock_subscription).take());
        self.participant.leave();
    }
}
