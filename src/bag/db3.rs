//! Bags in rosbag2's older storage, sqlite3: the only file that knows `rusqlite`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags, OptionalExtension as _, Row, ffi};

use super::channels::Channels;
use super::mcap_file::ScannedFile;
use super::segment::Segment;
use super::topic::{OnMessage, RawView, TopicInfo};
use super::{BagError, Damage, FileHealth};

/// Rows that are loaded at once when messages are merged by time.
const ROWS_TOGETHER: u64 = 4096;

/// Reads a whole file, hands on its messages in the order of their rows, and returns the state of the file.
///
/// # Errors
/// Where the file cannot be opened or has other tables than a bag. Damage among the messages is no error.
pub(super) fn scan(path: &Path, on_message: &mut OnMessage<'_>) -> Result<ScannedFile, BagError> {
    let refused = |error: rusqlite::Error| BagError::Database { path: path.to_owned(), problem: error.to_string() };
    let bytes = std::fs::metadata(path).map_err(BagError::io(path, "read"))?.len();
    let connection = open(path).map_err(refused)?;
    let topics = topics(&connection).map_err(refused)?;
    let library = library(&connection).unwrap_or_default();
    let mut health = FileHealth { path: path.to_owned(), bytes, storage: "sqlite3", library, ..FileHealth::default() };
    let mut segments: Vec<Segment> = vec![];
    let mut last_good_ns = None;
    let result = rows(&connection, &topics, 0, u64::MAX, &mut |row, message| {
        on_message(message);
        health.messages += 1;
        last_good_ns = Some(message.log_time_ns);
        let at = row - row % ROWS_TOGETHER;
        if segments.last().is_none_or(|last| last.at != at) {
            segments.push(Segment::rows(at, at + ROWS_TOGETHER));
        }
        if let Some(last) = segments.last_mut() {
            last.count(message.log_time_ns);
        }
    });
    health.unchecked_messages = health.messages;
    health.finished = result.is_ok();
    if let Err(error) = result {
        health.damage.push(Damage {
            at_byte: 0,
            lost_bytes: 0,
            problem: format!("the database cannot be read on ({error})"),
            places: 1,
            recovered_messages: health.messages,
            last_good_ns,
        });
    }
    let channels = Channels::of(topics.into_iter().collect());
    Ok(ScannedFile { health, channels, segments })
}

/// Loads segments of a scanned file again.
#[derive(Debug)]
pub(super) struct Db3Loader {
    path: PathBuf,
    connection: Connection,
    topics: BTreeMap<u16, Arc<TopicInfo>>,
}

impl Db3Loader {
    /// Opens a scanned file.
    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let refused = |error: rusqlite::Error| BagError::Database { path: path.to_owned(), problem: error.to_string() };
        let connection = open(path).map_err(refused)?;
        let topics = topics(&connection).map_err(refused)?;
        Ok(Self { path: path.to_owned(), connection, topics })
    }

    /// Hands on the messages of a range of rows.
    pub(super) fn load(&mut self, segment: &Segment, on_message: &mut OnMessage<'_>) -> Result<(), BagError> {
        rows(&self.connection, &self.topics, segment.at, segment.end, &mut |_, message| on_message(message))
            .map_err(|error| BagError::Database { path: self.path.clone(), problem: error.to_string() })
    }
}

/// Opens a database that holds a bag in plain tables: a view or a virtual table may compute without an end.
fn open(path: &Path) -> rusqlite::Result<Connection> {
    let connection =
        Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    for name in ["topics", "messages", "message_definitions", "schema"] {
        // Generated columns are computed as well.
        let sql = "SELECT type = 'table' AND rootpage > 0 AND sql NOT LIKE '%generated%' AND sql NOT LIKE '% as (%' FROM sqlite_schema \
                   WHERE name = ?1 COLLATE NOCASE";
        let plain = connection.query_row(sql, [name], |row| row.get::<_, bool>(0)).optional()?;
        if plain == Some(false) {
            let problem = format!(
                "`{name}` is no plain table: expected the tables of a rosbag2 database, found a view or computed columns"
            );
            return Err(rusqlite::Error::SqliteFailure(ffi::Error::new(ffi::SQLITE_ERROR), Some(problem)));
        }
    }
    Ok(connection)
}

/// A column that older versions of rosbag2 did not write yet.
fn optional(row: &Row<'_>, column: &str) -> String {
    row.get(column).unwrap_or_default()
}

fn topics(connection: &Connection) -> rusqlite::Result<BTreeMap<u16, Arc<TopicInfo>>> {
    let mut found = BTreeMap::new();
    let mut statement = connection.prepare("SELECT * FROM topics ORDER BY id")?;
    let mut rows = statement.query([])?;
    while let Some(row) = rows.next()? {
        let type_name: String = row.get("type")?;
        let type_hash = optional(row, "type_description_hash");
        let (schema_encoding, schema) = schema(connection, &type_name, &type_hash).unwrap_or_default();
        let topic = TopicInfo {
            name: row.get("name")?,
            encoding: row.get("serialization_format")?,
            schema_encoding,
            schema: schema.into_bytes().into(),
            offered_qos_profiles: optional(row, "offered_qos_profiles"),
            type_hash,
            type_name,
            metadata: BTreeMap::new(),
        };
        found.insert(row.get("id")?, Arc::new(topic));
    }
    Ok(found)
}

/// The definition of a type, of several that of the topic's own version; Iron and later keep it.
fn schema(connection: &Connection, type_name: &str, type_hash: &str) -> rusqlite::Result<(String, String)> {
    let of = |sql: &str, parameters: &[&str]| {
        connection.query_row(sql, rusqlite::params_from_iter(parameters), |row| Ok((row.get(0)?, row.get(1)?)))
    };
    let sql = "SELECT encoding, encoded_message_definition FROM message_definitions WHERE topic_type = ?1";
    of(&format!("{sql} AND type_description_hash = ?2"), &[type_name, type_hash]).or_else(|_| of(sql, &[type_name]))
}

fn library(connection: &Connection) -> rusqlite::Result<String> {
    let sql = "SELECT schema_version, ros_distro FROM schema";
    connection.query_row(sql, [], |row| {
        Ok(format!("rosbag2 schema {} ({})", row.get::<_, i64>(0)?, row.get::<_, String>(1)?))
    })
}

/// Hands on the messages of the rows `from..to`, each with its row.
fn rows(
    connection: &Connection,
    topics: &BTreeMap<u16, Arc<TopicInfo>>,
    from: u64,
    to: u64,
    on_row: &mut dyn FnMut(u64, RawView<'_>),
) -> rusqlite::Result<()> {
    let sql = "SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ?1 AND id < ?2 ORDER BY id";
    let bound = |row: u64| i64::try_from(row).unwrap_or(i64::MAX);
    let mut statement = connection.prepare(sql)?;
    let mut rows = statement.query([bound(from), bound(to)])?;
    while let Some(row) = rows.next()? {
        let Some(topic) = topics.get(&row.get(1)?) else { continue };
        let log_time_ns = row.get(2)?;
        let data = row.get_ref(3)?.as_blob()?;
        let number = u64::try_from(row.get::<_, i64>(0)?).unwrap_or_default();
        on_row(number, RawView { topic, log_time_ns, publish_time_ns: log_time_ns, sequence: 0, data });
    }
    Ok(())
}
