//! What is written of a batch: its CSV file and the JSON beside it.

use serde_json::{Map, Value as Json, json};

use crate::batch::{
    Gap, Imposed,
    recording::{Column, EndedBy, Recording},
};

/// Version of the metadata beside a batch.
const SCHEMA: &str = "roscausal-batch/1";

/// The JSON beside a batch, which notes `parameters`, how it was recorded, and for a post-processed one its `source`.
pub(super) fn metadata(
    batch: &Recording,
    recovered: bool,
    parameters: &Map<String, Json>,
    columns: &[Column],
    source: Option<&str>,
) -> Vec<u8> {
    let seconds = |row: usize| batch.stamp(row).as_secs_f64();
    let gap = |gap: Gap| json!({ "body": gap.body, "from": gap.from, "to": gap.to });
    let imposed =
        |one: Imposed| json!({ "column": one.column, "value": one.value, "from": one.from, "to": one.to });
    let unit = |column: &Column| json!({ "name": column.name, "unit": column.unit });
    let mut facts = json!({
        "schema": SCHEMA,
        "software_version": env!("CARGO_PKG_VERSION"),
        "complete": batch.complete,
        "ended_by": batch.ended_by.map_or("", EndedBy::as_str),
        "recovered": recovered,
        "frame": batch.frame,
        "dt": batch.dt_ns as f64 * 1e-9,
        "n_rows": batch.n_rows(),
        "start": seconds(0),
        "end": seconds(batch.n_rows().saturating_sub(1)),
        "time_unit": "s",
        "ids": batch.people.keys().collect::<Vec<_>>(),
        "gaps": batch.gaps().into_iter().map(gap).collect::<Vec<_>>(),
        "context": batch.context.keys().collect::<Vec<_>>(),
        "interventions": batch.interventions().into_iter().map(imposed).collect::<Vec<_>>(),
        "parameters": parameters,
    });
    // It may have been set after the node had started.
    if let (Some(noted), Some(length)) = (facts["parameters"].get_mut("ts_length"), batch.length_s)
        && noted.as_f64().unwrap_or(0.0) != length
    {
        *noted = json!(length);
    }
    if !columns.is_empty() {
        facts["columns"] = columns.iter().map(unit).collect();
    }
    if let Some(source) = source {
        facts["source"] = json!(source);
    }
    let mut bytes = serde_json::to_vec_pretty(&facts).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// `time` and the columns. Missing values are empty cells. Numbers are as short as possible, yet exact.
pub(super) fn csv(batch: &Recording, columns: &[Column]) -> Vec<u8> {
    use std::fmt::Write;
    let mut text = String::from("time");
    for column in columns {
        text.push(',');
        text.push_str(&column.name);
    }
    text.push('\n');
    for row in 0..batch.n_rows() {
        text.push_str(&seconds(batch.stamp(row).as_nanos()));
        for column in columns {
            text.push(',');
            let value = column.values.get(row).copied().unwrap_or(f64::NAN);
            if value.is_finite() {
                let _ = write!(text, "{value}");
            }
        }
        text.push('\n');
    }
    text.into_bytes()
}

/// Nanoseconds as exact decimal seconds.
pub(super) fn seconds(nanos: i64) -> String {
    let (sign, nanos) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
    let text = format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
