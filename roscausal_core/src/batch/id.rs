//! Ids of batches: the time of the first row as `strftime` writes it, such as `20261122_143005`.

use chrono::{
    DateTime, NaiveDate, NaiveDateTime, NaiveTime,
    format::{Item, StrftimeItems},
};

use crate::{Error, Result, Time};

/// The `strftime` format of batch ids (UTC), checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IdFormat(String);

impl Default for IdFormat {
    fn default() -> Self {
        Self("%Y%m%d_%H%M%S".into())
    }
}

impl IdFormat {
    /// Checks a format.
    ///
    /// # Errors
    /// A text that `strftime` does not know, as an error of the parameter `id_format`.
    pub fn new(format: &str) -> Result<Self> {
        if format.is_empty() || StrftimeItems::new(format).any(|item| matches!(item, Item::Error)) {
            let reason = format!("'{format}' is not a strftime format; such as %Y%m%d_%H%M%S");
            return Err(Error::param("id_format", reason));
        }
        // An id is part of a file name.
        Ok(Self(format.replace(['/', '\\'], "-")))
    }

    /// The id of a batch that begins at `start`.
    pub fn id(&self, start: Time) -> String {
        let start = DateTime::from_timestamp(i64::from(start.sec), start.nanosec).unwrap_or_default();
        start.format(&self.0).to_string()
    }

    /// The time that an id, or a name that begins with one, tells; `None` when it is not of this format, or when the
    /// format has no date.
    pub fn start(&self, id: &str) -> Option<NaiveDateTime> {
        let with_time = NaiveDateTime::parse_and_remainder(id, &self.0).map(|(time, _)| time);
        let date =
            || NaiveDate::parse_and_remainder(id, &self.0).map(|(date, _)| date.and_time(NaiveTime::MIN));
        with_time.or_else(|_| date()).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_tells_the_time_it_was_made_of() {
        let start = Time { sec: 1_700_000_123, nanosec: 0 };
        let time = DateTime::from_timestamp(1_700_000_123, 0).map(|time| time.naive_utc());
        for format in
            ["%Y%m%d_%H%M%S", "%d.%m.%Y-%H%M%S", "%H%M%S_%d%m%y", "%s", "%d/%m/%Y %T", "%Y%m%d_%H%M%S%.3f"]
        {
            let format = IdFormat::new(format).expect("a format");
            let id = format.id(start);
            assert_eq!(format.start(&id), time, "{id}");
            assert_eq!(format.start(&format!("{id}_2.csv")), time, "{id} with what follows an id in a name");
            assert!(!id.contains('/'), "{id}");
        }
        let day = IdFormat::new("%j of %Y").expect("a format");
        assert_eq!(
            day.start(&day.id(start)),
            NaiveDate::from_ymd_opt(2023, 11, 14).map(|day| day.and_time(NaiveTime::MIN))
        );
        assert_eq!(IdFormat::default().start("kitchen"), None);
    }

    #[test]
    fn what_is_no_format_is_refused_by_name() {
        for format in ["%Q", ""] {
            let error = IdFormat::new(format).expect_err("no format").to_string();
            assert!(error.starts_with("parameter 'id_format'"), "{error}");
        }
    }
}
