//! Messages on their way into the container, with what an index needs to know of them.
//!
//! Source: the MCAP format specification, version 0, at <https://mcap.dev/spec>.

use std::collections::BTreeMap;

/// Kind of a record that holds a message.
const MESSAGE: u8 = 0x05;
/// Fields of such a record before its data: channel, sequence, log and publish time. (bytes)
const MESSAGE_HEADER: usize = 2 + 4 + 8 + 8;

/// Messages that are compressed together.
#[derive(Default)]
pub(super) struct Chunk {
    records: Vec<u8>,
    /// First and last log time. (ns)
    times: Option<(u64, u64)>,
    /// Log time and offset of every message, by channel.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
}

impl Chunk {
    /// Adds a message.
    pub(super) fn add(&mut self, channel: u16, sequence: u32, log_time: u64, data: &[u8]) {
        let offset = self.records.len() as u64;
        let length = (MESSAGE_HEADER + data.len()) as u64;
        self.records.push(MESSAGE);
        self.records.extend_from_slice(&length.to_le_bytes());
        self.records.extend_from_slice(&channel.to_le_bytes());
        self.records.extend_from_slice(&sequence.to_le_bytes());
        self.records.extend_from_slice(&log_time.to_le_bytes());
        self.records.extend_from_slice(&log_time.to_le_bytes());
        self.records.extend_from_slice(data);
        let index = self.index.entry(channel).or_default();
        index.push((log_time, offset));
        widen(&mut self.times, log_time);
    }

    /// Takes all messages out and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.records.clear();
        self.times = None;
        self.index.clear();
    }

    /// The messages as records.
    pub(super) fn records(&self) -> &[u8] {
        &self.records
    }

    /// First and last log time; `None` without messages. (ns)
    pub(super) fn times(&self) -> Option<(u64, u64)> {
        self.times
    }

    /// Log time (ns) and offset (bytes) of every message, by channel.
    pub(super) fn index(&self) -> &BTreeMap<u16, Vec<(u64, u64)>> {
        &self.index
    }
}

/// Makes a span of time hold another instant. (ns)
pub(super) fn widen(times: &mut Option<(u64, u64)>, time: u64) {
    let (first, last) = times.unwrap_or((time, time));
    *times = Some((first.min(time), last.max(time)));
}
