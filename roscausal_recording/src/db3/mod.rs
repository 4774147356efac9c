//! ROS 2's SQLite recordings (storage `sqlite3` of rosbag2).

mod pages;

use std::{
    collections::HashMap,
    fs::File,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use roscausal_core::{Error, Result, Time};
use rusqlite::{Connection, OpenFlags, Row, limits::Limit};

use crate::{
    laps::{BACK_S, LapFinder},
    mcap_file::is_transient_local,
    source::{Moment, Source},
    topic::{Encoding, Record, Topic, Topics, type_name},
};
use pages::{Message, Pages};

/// Messages read at a time.
const PAGE: usize = 256;
/// A row may claim at most the length of the file plus this.
const LONGEST_BESIDE_THE_FILE: u64 = 1 << 16;

pub(crate) struct Db3 {
    path: PathBuf,
    database: Connection,
    topics: Topics,
    /// The database's id of a topic -> index of the topic.
    numbers: HashMap<i64, usize>,
    /// Recording time and row of each message, in order.
    order: Vec<(i64, i64)>,
    next: usize,
    /// The first rows of all laps but the first.
    laps: Vec<i64>,
    damaged: Option<Damaged>,
}

/// How many messages cannot be read, and why the first one cannot.
type Lost = Option<(u32, String)>;

/// What is left of a damaged file: its pages, and the messages by row. SQLite is asked for the topics only.
struct Damaged {
    pages: Pages,
    messages: HashMap<i64, Message>,
}

impl Db3 {
    pub(crate) fn open(path: &Path, losses: &mut Vec<String>) -> Result<Self> {
        let fail = |error: rusqlite::Error| Error::file(path, format!("no recording of ROS 2: {error}"));
        let missing = missing_bytes(path).map_err(|error| Error::file(path, error))?;
        let database = connect(path, missing.is_some()).map_err(fail)?;
        let (topics, numbers, order, next, laps, damaged) = Default::default();
        let mut this = Self { path: path.to_owned(), database, topics, numbers, order, next, laps, damaged };
        this.read_topics().map_err(fail)?;
        let reason = match missing {
            Some(missing) => Some(format!("{missing} bytes at its end are missing")),
            None => this.read_order().err().map(|error| error.to_string()),
        };
        if let Some(reason) = reason {
            this.read_pages().map_err(|error| Error::file(path, error))?;
            losses.push(format!(
                "{}: the database is damaged; it was read as far as it is whole ({reason})",
                path.display()
            ));
        }
        Ok(this)
    }

    fn read_topics(&mut self) -> rusqlite::Result<()> {
        // Later versions of the format have more columns. A missing column is not a fault.
        let profiles = "SELECT count(*) FROM pragma_table_info('topics') WHERE name = 'offered_qos_profiles'";
        let has_profiles: bool = self.database.query_row(profiles, [], |row| row.get(0))?;
        let profiles = if has_profiles { "offered_qos_profiles" } else { "''" };
        let sql = format!("SELECT id, name, type, serialization_format, {profiles} FROM topics ORDER BY id");
        let mut statement = self.database.prepare(&sql)?;
        let topic = |row: &Row<'_>| {
            let format: String = row.get(3)?;
            let profiles: String = row.get(4).unwrap_or_default();
            let topic = Topic {
                name: row.get(1)?,
                type_name: type_name(&row.get::<_, String>(2)?),
                encoding: if format == "cdr" { Encoding::Cdr } else { Encoding::Other(format) },
                md5: None,
                definition: "".into(),
                latched: is_transient_local(&profiles),
                messages: None,
            };
            Ok((row.get(0)?, topic))
        };
        for row in statement.query_map([], topic)? {
            let (number, topic) = row?;
            self.numbers.insert(number, self.topics.add(topic));
        }
        drop(statement);
        self.read_definitions();
        Ok(())
    }

    /// The texts of the types, which ROS 2 stores since Iron.
    fn read_definitions(&mut self) {
        let Ok(mut statement) =
            self.database.prepare("SELECT topic_type, encoded_message_definition FROM message_definitions")
        else {
            return;
        };
        let texts = statement.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?)));
        let texts = texts.into_iter().flatten().flatten();
        let texts: HashMap<String, Arc<str>> =
            texts.map(|(name, text)| (type_name(&name), Arc::from(text))).collect();
        for topic in self.topics.iter_mut() {
            if let Some(text) = texts.get(&topic.type_name) {
                topic.definition = text.clone();
            }
        }
    }

    fn read_order(&mut self) -> rusqlite::Result<()> {
        let mut statement = self.database.prepare("SELECT timestamp, id FROM messages")?;
        let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
        self.order = rows.collect::<rusqlite::Result<_>>()?;
        drop(statement);
        self.sort();
        let mut newest = i64::MIN;
        let goes_back = |(stamp, _): &(i64, i64)| {
            newest = newest.max(*stamp);
            Time::from_nanos(newest).secs_since(Time::from_nanos(*stamp)) > BACK_S
        };
        self.order.sort_unstable_by_key(|(_, row)| *row);
        if self.order.iter().any(goes_back) {
            self.find_laps()?;
        }
        self.sort();
        Ok(())
    }

    /// Finds where the recording time goes back, in the order of the rows.
    fn find_laps(&mut self) -> rusqlite::Result<()> {
        let (mut finder, mut rows) = (LapFinder::default(), Vec::new());
        let mut statement =
            self.database.prepare("SELECT topic_id, timestamp, id FROM messages ORDER BY id")?;
        let message = |row: &Row<'_>| Ok((row.get::<_, i64>(0)?, row.get(1)?, row.get::<_, i64>(2)?));
        for message in statement.query_map([], message)? {
            let (number, stamp, row) = message?;
            let Some(topic) = self.numbers.get(&number) else { continue };
            finder.add(*topic, Time::from_nanos(stamp));
            rows.push(row);
        }
        let first = |number: &u64| rows.get(usize::try_from(*number).ok()?).copied();
        self.laps = finder.finish().begins.iter().filter_map(first).collect();
        Ok(())
    }

    /// Finds the messages without SQLite.
    fn read_pages(&mut self) -> std::io::Result<()> {
        let mut pages = Pages::open(&self.path)?;
        let messages: HashMap<i64, Message> =
            pages.messages()?.into_iter().map(|message| (message.row, message)).collect();
        self.order = messages.values().map(|message| (message.stamp, message.row)).collect();
        self.sort();
        self.damaged = Some(Damaged { pages, messages });
        Ok(())
    }

    /// Puts the messages into their order, each once.
    fn sort(&mut self) {
        self.order.sort_unstable_by_key(|(_, row)| *row);
        self.order.dedup_by_key(|(_, row)| *row);
        let laps = &self.laps;
        self.order.sort_unstable_by_key(|(stamp, row)| (lap_of(laps, *row), *stamp, *row));
    }

    /// The topic with this id in the database, if it is wanted.
    fn wanted(&self, number: i64, wanted: &[bool]) -> Option<usize> {
        let index = self.numbers.get(&number).copied();
        index.filter(|index| wanted.get(*index) == Some(&true))
    }

    /// Reads messages with SQLite. Returns how many cannot be read, and why.
    fn load_whole(
        &self,
        page: &[(i64, i64)],
        wanted: &[bool],
        out: &mut Vec<Record>,
    ) -> rusqlite::Result<Lost> {
        // One transaction for all of them, so the file is locked once and not for each.
        let _reading = self.database.unchecked_transaction()?;
        let mut message = self.database.prepare("SELECT topic_id, data FROM messages WHERE id = ?")?;
        let mut lost = None;
        for (stamp, row) in page {
            let mut read = || {
                let mut rows = message.query([row])?;
                let found = rows.next()?.ok_or(rusqlite::Error::QueryReturnedNoRows)?;
                // SQLite fetches only the bytes that are requested.
                let Some(topic) = self.wanted(found.get(0)?, wanted) else { return Ok(None) };
                let (lap, stamp) = (lap_of(&self.laps, *row), Time::from_nanos(*stamp));
                Ok(Some(Record { topic, lap, stamp, bytes: found.get(1)? }))
            };
            match read() {
                Ok(record) => out.extend(record),
                Err::<_, rusqlite::Error>(error) => count(&mut lost, &error),
            }
        }
        Ok(lost)
    }

    /// Reads messages of a damaged file.
    fn load_damaged(&mut self, page: &[(i64, i64)], wanted: &[bool], out: &mut Vec<Record>) -> Lost {
        let mut lost = None;
        let mut damaged = self.damaged.take()?;
        for message in page.iter().filter_map(|(_, row)| damaged.messages.get(row)) {
            let Some(topic) = self.wanted(message.topic, wanted) else { continue };
            let stamp = Time::from_nanos(message.stamp);
            match damaged.pages.data(message.place) {
                Ok(bytes) => out.push(Record { topic, lap: 0, stamp, bytes }),
                Err(error) => count(&mut lost, &error),
            }
        }
        self.damaged = Some(damaged);
        lost
    }
}

/// The lap of a row.
fn lap_of(laps: &[i64], row: i64) -> u32 {
    u32::try_from(laps.partition_point(|first| *first <= row)).unwrap_or(0)
}

/// How much shorter the file is than its header says. SQLite itself may not notice.
fn missing_bytes(path: &Path) -> std::io::Result<Option<u64>> {
    let mut file = File::open(path)?;
    let mut header = [0; 100];
    file.read_exact(&mut header)?;
    let number =
        |at: usize| header[at..at + 4].iter().fold(0u64, |value, byte| value << 8 | u64::from(*byte));
    // Writers from before 2010 do not update the number of pages. Then the two counters differ.
    if number(24) != number(92) {
        return Ok(None);
    }
    let page = match number(16) >> 16 {
        1 => 65536,
        size => size,
    };
    let missing = (number(28) * page).saturating_sub(file.metadata()?.len());
    Ok(Some(missing).filter(|missing| *missing > 0))
}

/// Opens for reading, and leaves nothing beside the file. A database that was never closed has its last changes in a file beside it:
/// a log of writes (WAL) is read with it; what would have to be written into the database first is ignored.
fn connect(path: &Path, cut: bool) -> rusqlite::Result<Connection> {
    let options = if has_log(path) { WITH_LOG } else { "mode=ro" };
    let database = open(path, options)?;
    if options == WITH_LOG {
        // The index of the log stays in memory, instead of a file beside it.
        database.pragma_update(None, "locking_mode", "exclusive")?;
    }
    if cut {
        // SQLite refuses a file that is shorter than its header says, unless it is opened for repair.
        database.pragma_update(None, "writable_schema", true)?;
    }
    let probe =
        |database: &Connection| database.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()));
    if probe(&database).is_ok() {
        return guarded(database, path);
    }
    let database = open(path, "immutable=1")?;
    probe(&database)?;
    guarded(database, path)
}

/// Without locks, for which SQLite would write files beside the database.
const WITH_LOG: &str = if cfg!(unix) { "mode=ro&vfs=unix-none" } else { "mode=ro" };

/// Opens a database for reading, with these options of SQLite's.
fn open(path: &Path, options: &str) -> rusqlite::Result<Connection> {
    // Any character may have a meaning in a URI.
    let name: String =
        path.as_os_str().as_encoded_bytes().iter().map(|byte| format!("%{byte:02x}")).collect();
    let flags =
        OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
    Connection::open_with_flags(format!("file:{name}?{options}"), flags)
}

/// Whether the database writes into a log first (its header says so).
fn has_log(path: &Path) -> bool {
    let mut header = [0; 20];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut header));
    read.is_ok() && header[18..20].contains(&2)
}

/// A recording holds tables with rows. A view or a computed column could be endless, or arbitrarily large.
fn guarded(database: Connection, path: &Path) -> rusqlite::Result<Connection> {
    let length = std::fs::metadata(path).map_or(u64::MAX, |file| file.len());
    let longest = i32::try_from(length.saturating_add(LONGEST_BESIDE_THE_FILE)).unwrap_or(i32::MAX);
    database.set_limit(Limit::SQLITE_LIMIT_LENGTH, longest)?;
    database.pragma_update(None, "trusted_schema", false)?;
    // What SQLite makes of them counts, not what the schema says of itself: the text of a table may be that of a view.
    let made_up = "SELECT name FROM pragma_table_list AS tables WHERE lower(name) IN ('topics', 'messages', 'message_definitions') \
                   AND (type <> 'table' OR EXISTS (SELECT 1 FROM pragma_table_xinfo(tables.name) WHERE hidden <> 0))";
    match database.query_row(made_up, [], |row| row.get::<_, String>(0)) {
        Err(rusqlite::Error::QueryReturnedNoRows) => Ok(database),
        Err(error) => Err(error),
        Ok(name) => {
            Err(rusqlite::Error::ToSqlConversionFailure(format!("its {name} is not a plain table").into()))
        }
    }
}

impl Source for Db3 {
    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn next_start(&self) -> Option<Moment> {
        let (stamp, row) = self.order.get(self.next)?;
        Some((lap_of(&self.laps, *row), Time::from_nanos(*stamp)))
    }

    fn laps(&self) -> u32 {
        lap_of(&self.laps, i64::MAX) + 1
    }

    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> std::result::Result<(), String> {
        let end = self.order.len().min(self.next + PAGE);
        let page = self.order[self.next..end].to_vec();
        self.next = end;
        let path = self.path.display().to_string();
        let lost = match self.damaged.is_some() {
            true => self.load_damaged(&page, wanted, out),
            false => self.load_whole(&page, wanted, out).map_err(|error| format!("{path}: {error}"))?,
        };
        lost.map_or(Ok(()), |(lost, reason)| {
            Err(format!("{path}: {lost} messages cannot be read and are left out: {reason}"))
        })
    }

    fn held(&self) -> Option<u64> {
        Some(self.order.len() as u64)
    }

    fn span(&self) -> Option<(Time, Time)> {
        let stamps = || self.order.iter().map(|(stamp, _)| *stamp);
        // Without laps they are in order.
        let (first, last) = match self.laps.is_empty() {
            true => (self.order.first()?.0, self.order.last()?.0),
            false => (stamps().min()?, stamps().max()?),
        };
        Some((Time::from_nanos(first), Time::from_nanos(last)))
    }

    fn progress(&self) -> f64 {
        if self.order.is_empty() { 1.0 } else { self.next as f64 / self.order.len() as f64 }
    }
}

/// Counts a message that cannot be read; the first reason is kept.
fn count(lost: &mut Lost, reason: &dyn std::fmt::Display) {
    lost.get_or_insert_with(|| (0, reason.to_string())).0 += 1;
}

#[cfg(test)]
mod tests {
    use super::*;

    const MESSAGES: &str =
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)";

    /// A database with this text of its table of topics, which SQLite made from another one.
    fn forged(dir: &Path, plain: &str, text: &str, cut: usize) -> PathBuf {
        let path = dir.join("forged.db3");
        let _ = std::fs::remove_file(&path);
        let database = Connection::open(&path).expect("opens");
        database.execute_batch(&format!("{plain}; {MESSAGES};")).expect("makes");
        for row in 0..40 {
            database.execute("INSERT INTO messages VALUES(?, 1, 1, zeroblob(3000))", [row]).expect("inserts");
        }
        if plain != text {
            database.pragma_update(None, "writable_schema", true).expect("may");
            let set = "UPDATE sqlite_schema SET rootpage = 0, sql = ? WHERE name = 'topics'";
            database.execute(set, [text]).expect("forges");
        }
        drop(database);
        let bytes = std::fs::read(&path).expect("reads");
        std::fs::write(&path, &bytes[..bytes.len() - cut]).expect("cuts");
        path
    }

    #[test]
    fn a_table_that_is_made_up_is_refused_however_its_schema_spells_it() {
        let dir = tempfile::tempdir().expect("a folder");
        let columns = "id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT";
        let plain = format!("CREATE TABLE topics({columns})");
        let generated = |how: &str| format!("CREATE TABLE topics({columns} {how})");
        let endless = "CREATE VIEW topics(id, name, type, serialization_format) AS\nWITH RECURSIVE t(x) AS\n(SELECT 1 UNION ALL \
                       SELECT x + 1 FROM t) SELECT x, '/a', 'b', 'cdr' FROM t";
        for how in ["AS('x')", "as\n('x')", "GENERATED ALWAYS AS ('x') STORED", "AS/**/('x') VIRTUAL"] {
            let text = generated(how);
            let opened = Db3::open(&forged(dir.path(), &text, &text, 0), &mut Vec::new());
            assert!(opened.is_err_and(|error| error.to_string().contains("not a plain table")), "{how}");
        }
        for cut in [0, 4096] {
            assert!(Db3::open(&forged(dir.path(), &plain, endless, cut), &mut Vec::new()).is_err(), "{cut}");
        }
        assert!(Db3::open(&forged(dir.path(), &plain, &plain, 0), &mut Vec::new()).is_ok());
    }

    #[test]
    fn a_log_of_writes_is_read_and_nothing_is_left_beside_the_file() {
        let dir = tempfile::tempdir().expect("a folder");
        let (written, path) = (dir.path().join("w.db3"), dir.path().join("read/a %41?#.db3"));
        let database = Connection::open(&written).expect("opens");
        database.pragma_update(None, "journal_mode", "wal").expect("has a log");
        let topics =
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)";
        let first = "INSERT INTO messages VALUES(1, 1, 1, x'00')";
        database.execute_batch(&format!("{topics}; {MESSAGES}; {first};")).expect("makes");
        database.execute_batch("PRAGMA wal_checkpoint(truncate)").expect("empties its log");
        database.execute("INSERT INTO messages VALUES(2, 1, 2, x'00')", []).expect("inserts");
        std::fs::create_dir(dir.path().join("read")).expect("makes");
        std::fs::copy(&written, &path).expect("copies");
        let rows = |path: &Path| Db3::open(path, &mut Vec::new()).map(|file| file.order.len());
        let names = || std::fs::read_dir(dir.path().join("read")).expect("lists").count();
        assert_eq!((rows(&path).expect("reads"), names()), (1, 1));
        let log = path.with_file_name("a %41?#.db3-wal");
        std::fs::copy(dir.path().join("w.db3-wal"), log).expect("copies");
        assert_eq!((rows(&path).expect("reads"), names()), (2, 2));
    }
}
