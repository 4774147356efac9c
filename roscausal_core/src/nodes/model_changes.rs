//! Changes of mechanisms as messages and files.

use std::{fs, path::Path};

use roscausal_discovery::changes::Status;
use roscausal_msgs::{ModelChange, ModelChanges, Time, std_msgs::Header};

use super::{
    recorded_changes::{CHANGES_FOLDER, RecordedChange},
    regime::Regime,
};
use crate::{Error, Result, batch::pool::write_whole};

/// Topic of the changes: the last 64, latched.
pub const CHANGES_TOPIC: &str = "roscausal/model_changes";

/// What is published of a regime.
pub(super) fn model_changes(regime: &Regime, header: Header) -> ModelChanges {
    let (regime_since, batches) = regime.since();
    ModelChanges { header, regime_since, batches, changes: regime.events.iter().map(model_change).collect() }
}

fn model_change(reported: &RecordedChange) -> ModelChange {
    let event = &reported.event;
    let stamp =
        |end: usize| reported.changed_from_to.map_or(Time::ZERO, |ends| Time::from_secs_f64(ends[end]));
    ModelChange {
        id: event.id.clone(),
        status: match event.status {
            Status::Suspected => ModelChange::SUSPECTED,
            Status::Confirmed => ModelChange::CONFIRMED,
            Status::Withdrawn => ModelChange::WITHDRAWN,
        },
        kind: event.kind.name().to_owned(),
        cause: event.cause.clone(),
        effect: event.effect.clone(),
        lag: u32::try_from(event.lag).unwrap_or(u32::MAX),
        before: event.before,
        after: event.after,
        p_value: event.p_value,
        told: Time::from_secs_f64(reported.told),
        changed_from: stamp(0),
        changed_to: stamp(1),
        batch_id: reported.batch.clone(),
        description: event.sentence(),
    }
}

/// Writes a file for each event, named by its number; one that is there is left alone.
pub(super) fn write_events(dir: &Path, regime: &Regime) -> Result<()> {
    let dir = dir.join(CHANGES_FOLDER);
    for reported in &regime.events {
        let path = dir.join(format!("{:06}.json", reported.number));
        let text = serde_json::to_string_pretty(reported).map_err(|e| Error::Data(e.to_string()))? + "\n";
        if fs::read(&path).is_ok_and(|there| there == text.as_bytes()) {
            continue;
        }
        fs::create_dir_all(&dir).map_err(|e| Error::file(&dir, e))?;
        write_whole(&path, text.as_bytes())?;
    }
    Ok(())
}
