//! Bags in SQLite: tables `topics` and `messages`.

use std::path::Path;

use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags, OptionalExtension};

use super::{MAX_MESSAGE_BYTES, Messages, is_event_packet};
use crate::recording::error::{Place, RecordingError};

pub struct Bag {
    connection: Connection,
    topic: Option<(i64, String)>,
    others: Vec<String>,
    /// Row of the last message.
    row: i64,
}

fn damaged(row: i64, error: &rusqlite::Error) -> RecordingError {
    RecordingError::Damaged {
        format: "ROS2 DB3",
        place: Place::Record(row.unsigned_abs()),
        what: error.to_string(),
    }
}

impl Bag {
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let first = |error: rusqlite::Error| damaged(0, &error);
        let connection = Connection::open_with_flags(
            path,
            OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX,
        )
        .map_err(first)?;
        connection
            .set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_MESSAGE_BYTES as i32)
            .map_err(first)?;
        let mut topics: Vec<(i64, String)> = {
            let mut statement = connection
                .prepare("SELECT id, name, type FROM topics ORDER BY id")
                .map_err(first)?;
            let rows = statement
                .query_map([], |row| {
                    Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?, row.get::<_, String>(2)?))
                })
                .map_err(first)?;
            let rows: Vec<_> = rows.collect::<Result<_, _>>().map_err(first)?;
            rows.into_iter()
                .filter(|(_, _, kind)| is_event_packet(kind))
                .map(|(id, name, _)| (id, name))
                .collect()
        };
        let topic = (!topics.is_empty()).then(|| topics.remove(0));
        let others = topics.into_iter().map(|(_, name)| name).collect();
        Ok(Self { connection, topic, others, row: i64::MIN })
    }
}

impl Messages for Bag {
    fn next(&mut self) -> Result<Option<Vec<u8>>, RecordingError> {
        let Some((topic, _)) = self.topic else { return Ok(None) };
        // Rows are numbered in the order of recording.
        let found = self
            .connection
            .prepare_cached(
                "SELECT id, data FROM messages WHERE topic_id = ?1 AND id > ?2 ORDER BY id LIMIT 1",
            )
            .and_then(|mut statement| {
                statement
                    .query_row((topic, self.row), |row| {
                        Ok((row.get::<_, i64>(0)?, row.get::<_, Vec<u8>>(1)?))
                    })
                    .optional()
            })
            .map_err(|error| damaged(self.row.max(0), &error))?;
        Ok(found.map(|(row, data)| {
            self.row = row;
            data
        }))
    }

    fn assumed(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        if let Some((_, topic)) = &self.topic {
            sentences.push(format!("topic {topic} is the one to read"));
        }
        if !self.others.is_empty() {
            sentences.push(format!("event topics {} are left out", self.others.join(", ")));
        }
        sentences
    }
}
