//! What the recorder reports to the journal.

use std::collections::BTreeMap;

use super::{Entry, Header, Sample, Subject};

/// A journal without rows begins again after this many samples, so that it stays small while nobody is recorded.
const MOST_WITHOUT_ROWS: usize = 20_000;

/// Collects the samples for the journal. For each robot, person or signal it keeps only those that a row can depend on: the
/// first and the last between two rows, and all late ones. So a journal is at most about twice as large as its
/// batch, however fast the topics are.
#[derive(Debug, Default)]
pub(in crate::batch) struct Log {
    next_number: u64,
    number: Option<u64>,
    dt_ns: i64,
    /// The newest sample of each robot, person or signal, and whether it has been collected.
    newest: BTreeMap<Subject, (Sample, bool)>,
    entries: Vec<Entry>,
    noted: usize,
}

impl Log {
    /// A log whose first journal is number `first`.
    pub(in crate::batch) fn new(first: u64, dt_ns: i64) -> Self {
        Self { next_number: first, dt_ns, ..Self::default() }
    }

    /// Number of the open journal, if there is one.
    pub(in crate::batch) fn number(&self) -> Option<u64> {
        self.number
    }

    /// Whether the open journal has grown without being useful.
    pub(in crate::batch) fn is_idle_and_large(&self) -> bool {
        self.noted > MOST_WITHOUT_ROWS
    }

    /// Begins the next journal; `header` gets its number.
    pub(in crate::batch) fn begin(&mut self, mut header: Header) {
        header.number = self.next_number;
        self.number = Some(self.next_number);
        self.next_number += 1;
        self.newest.clear();
        self.noted = 0;
        self.entries.push(Entry::Begin(header));
    }

    /// Adds a sample, if a journal is open.
    pub(in crate::batch) fn sample(&mut self, sample: Sample) {
        if self.number.is_none() {
            return;
        }
        let row = |stamp_ns: i64| stamp_ns.div_euclid(self.dt_ns);
        // Of a tracker that tells places only, each of them counts.
        let of_places = matches!(sample.of, Subject::Person(_)) && sample.values.omega.is_nan();
        let noted = match self.newest.get(&sample.of) {
            // Late: its effect is hard to predict, so it is kept.
            Some((newest, _)) if sample.stamp_ns <= newest.stamp_ns => return self.note(sample),
            Some((newest, _)) if !of_places && row(newest.stamp_ns) == row(sample.stamp_ns) => false,
            Some((newest, false)) => {
                self.note(*newest);
                true
            }
            _ => true,
        };
        if noted {
            self.note(sample);
        }
        self.newest.insert(sample.of, (sample, noted));
    }

    /// What a journal begins with is no growth of it.
    pub(in crate::batch) fn begun(&mut self) {
        self.noted = 0;
    }

    /// Ends the open journal, whose batch is complete, and returns its number.
    pub(in crate::batch) fn end(&mut self) -> Option<u64> {
        self.note_newest();
        self.number.take()
    }

    /// Drops the open journal, which is not needed.
    pub(in crate::batch) fn abandon(&mut self) {
        if let Some(number) = self.number.take() {
            self.entries.push(Entry::Abandon(number));
        }
    }

    /// Everything that was collected since the last call.
    pub(in crate::batch) fn take(&mut self) -> Vec<Entry> {
        self.note_newest();
        std::mem::take(&mut self.entries)
    }

    fn note(&mut self, sample: Sample) {
        self.noted += 1;
        self.entries.push(Entry::Sample(sample));
    }

    fn note_newest(&mut self) {
        if self.number.is_none() {
            return;
        }
        let unnoted: Vec<Sample> =
            self.newest.values().filter(|(_, noted)| !noted).map(|(sample, _)| *sample).collect();
        unnoted.into_iter().for_each(|sample| self.note(sample));
        self.newest.values_mut().for_each(|(_, noted)| *noted = true);
    }
}

#[cfg(test)]
mod tests {
    use super::{super::format::tests::header, *};
    use crate::batch::Values;

    fn stamps(log: &mut Log) -> Vec<i64> {
        let stamp =
            |entry: &Entry| if let Entry::Sample(sample) = entry { Some(sample.stamp_ns) } else { None };
        log.take().iter().filter_map(stamp).collect()
    }

    fn at(stamp_ns: i64) -> Sample {
        Sample { of: Subject::Robot, stamp_ns, values: Values::from_array([0.0; 7]) }
    }

    #[test]
    fn only_samples_that_rows_depend_on_are_noted() {
        let mut log = Log::new(1, 100);
        log.sample(at(5));
        assert_eq!(log.take(), []);
        log.begin(header());
        (0..1000).for_each(|t| log.sample(at(t)));
        let noted = stamps(&mut log);
        let wanted: Vec<i64> = (0..10).flat_map(|row| [row * 100, row * 100 + 99]).collect();
        assert_eq!(noted, wanted);
        log.sample(at(950));
        log.sample(at(1000));
        assert_eq!(stamps(&mut log), [950, 1000]);
    }

    #[test]
    fn journals_are_numbered_and_one_of_no_use_is_told() {
        let mut log = Log::new(8, 100);
        log.begin(header());
        assert_eq!((log.end(), log.number()), (Some(8), None));
        log.begin(header());
        log.abandon();
        assert_eq!(log.take().last(), Some(&Entry::Abandon(9)));
    }
}
