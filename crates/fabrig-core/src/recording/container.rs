//! The container: MCAP records, compressed chunks, and the summary that readers seek by.
//!
//! The `mcap` crate's own writer gives no say over zstd beyond its level. A recorded mesh
//! repeats its topology after megabytes, farther than a fast level looks back; with long
//! distance matching the same messages take a third of the room, in less time.
//!
//! Source: the MCAP format specification, version 0, at <https://mcap.dev/spec>.

use std::collections::BTreeMap;
use std::io::{self, Write};

use zstd::bulk::Compressor;
use zstd::zstd_safe::CParameter;

use super::chunk::{Chunk, widen};

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
const COMPRESSION: &str = "zstd";
/// Higher levels find short matches in rounded coordinates that cost more than they save.
const COMPRESSION_LEVEL: i32 = 1;
/// How far zstd looks back: 16 MiB, or more where a frame is larger, up to what decoders take
/// without being asked. It also sizes the table of distant matches.
const WINDOW_LOG: std::ops::RangeInclusive<u32> = 24..=27;
/// Shortest distant match. (bytes)
const DISTANT_MATCH: u32 = 32;

/// Kinds of records.
mod opcode {
    pub(super) const HEADER: u8 = 0x01;
    pub(super) const FOOTER: u8 = 0x02;
    pub(super) const SCHEMA: u8 = 0x03;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const CHUNK: u8 = 0x06;
    pub(super) const MESSAGE_INDEX: u8 = 0x07;
    pub(super) const CHUNK_INDEX: u8 = 0x08;
    pub(super) const ATTACHMENT: u8 = 0x09;
    pub(super) const ATTACHMENT_INDEX: u8 = 0x0a;
    pub(super) const STATISTICS: u8 = 0x0b;
    pub(super) const METADATA: u8 = 0x0c;
    pub(super) const METADATA_INDEX: u8 = 0x0d;
    pub(super) const SUMMARY_OFFSET: u8 = 0x0e;
    pub(super) const DATA_END: u8 = 0x0f;
}

/// The content of one record under construction.
#[derive(Default)]
struct Content(Vec<u8>);

impl Content {
    fn u16(mut self, value: u16) -> Self {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn u32(mut self, value: u32) -> Self {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn u64(mut self, value: u64) -> Self {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn bytes(mut self, value: &[u8]) -> Self {
        self = self.u32(value.len() as u32);
        self.0.extend_from_slice(value);
        self
    }

    fn text(self, value: &str) -> Self {
        self.bytes(value.as_bytes())
    }

    fn map(self, value: &BTreeMap<String, String>) -> Self {
        let entries = value.iter().fold(Self::default(), |content, (key, value)| {
            content.text(key).text(value)
        });
        self.bytes(&entries.0)
    }
}

/// What is counted for the statistics record.
#[derive(Default)]
struct Counts {
    times: Option<(u64, u64)>,
    by_channel: BTreeMap<u16, u64>,
    attachments: u32,
    metadata: u32,
}

/// Writes an MCAP file from its start to its end; nothing is sought or read back.
pub(super) struct ContainerWriter<W> {
    out: W,
    /// Bytes written. (bytes)
    position: u64,
    data_crc: crc32fast::Hasher,
    compressor: Compressor<'static>,
    schemas: Vec<Content>,
    channels: Vec<Content>,
    chunk_indexes: Vec<Content>,
    attachment_indexes: Vec<Content>,
    metadata_indexes: Vec<Content>,
    counts: Counts,
}

impl<W: Write> ContainerWriter<W> {
    /// Begins a file.
    ///
    /// - `period_bytes`: after how many bytes messages resemble earlier ones
    pub(super) fn new(out: W, library: &str, period_bytes: usize) -> io::Result<Self> {
        let mut compressor = Compressor::new(COMPRESSION_LEVEL)?;
        compressor.long_distance_matching(true)?;
        compressor.set_parameter(CParameter::LdmMinMatch(DISTANT_MATCH))?;
        let reach = (period_bytes + period_bytes / 4)
            .next_power_of_two()
            .ilog2();
        compressor.window_log(reach.clamp(*WINDOW_LOG.start(), *WINDOW_LOG.end()))?;
        let mut writer = Self {
            out,
            position: 0,
            data_crc: crc32fast::Hasher::new(),
            compressor,
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk_indexes: Vec::new(),
            attachment_indexes: Vec::new(),
            metadata_indexes: Vec::new(),
            counts: Counts::default(),
        };
        writer.write(&MAGIC)?;
        let header = Content::default().text("").text(library);
        writer.record(opcode::HEADER, &header)?;
        Ok(writer)
    }

    /// Describes a kind of message; gives its id.
    pub(super) fn add_schema(&mut self, name: &str, descriptors: &[u8]) -> io::Result<u16> {
        let id = self.schemas.len() as u16 + 1;
        let schema = Content::default().u16(id).text(name).text("protobuf");
        let schema = schema.bytes(descriptors);
        self.record(opcode::SCHEMA, &schema)?;
        self.schemas.push(schema);
        Ok(id)
    }

    /// Opens a topic; gives the id of its channel.
    pub(super) fn add_channel(
        &mut self,
        schema: u16,
        topic: &str,
        metadata: &BTreeMap<String, String>,
    ) -> io::Result<u16> {
        let id = self.channels.len() as u16 + 1;
        let channel = Content::default().u16(id).u16(schema).text(topic);
        let channel = channel.text("protobuf").map(metadata);
        self.record(opcode::CHANNEL, &channel)?;
        self.channels.push(channel);
        Ok(id)
    }

    /// Writes a named table of words.
    pub(super) fn add_metadata(
        &mut self,
        name: &str,
        table: &BTreeMap<String, String>,
    ) -> io::Result<()> {
        let metadata = Content::default().text(name).map(table);
        let (offset, length) = self.record(opcode::METADATA, &metadata)?;
        let index = Content::default().u64(offset).u64(length).text(name);
        self.metadata_indexes.push(index);
        self.counts.metadata += 1;
        Ok(())
    }

    /// Attaches a file.
    pub(super) fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> io::Result<()> {
        let (log_time, create_time) = (0, 0);
        let mut attachment = Content::default().u64(log_time).u64(create_time);
        attachment = attachment
            .text(name)
            .text(media_type)
            .u64(data.len() as u64);
        attachment.0.extend_from_slice(data);
        let crc = crc32fast::hash(&attachment.0);
        let (offset, length) = self.record(opcode::ATTACHMENT, &attachment.u32(crc))?;
        let index = Content::default().u64(offset).u64(length);
        let index = index.u64(log_time).u64(create_time).u64(data.len() as u64);
        self.attachment_indexes
            .push(index.text(name).text(media_type));
        self.counts.attachments += 1;
        Ok(())
    }

    /// Compresses and writes a chunk with its indexes; nothing for one without messages.
    pub(super) fn write_chunk(&mut self, messages: &Chunk) -> io::Result<()> {
        let Some((first, last)) = messages.times() else {
            return Ok(());
        };
        widen(&mut self.counts.times, first);
        widen(&mut self.counts.times, last);
        let records = messages.records();
        let compressed = self.compressor.compress(records)?;
        let uncompressed_size = records.len() as u64;
        let mut chunk = Content::default().u64(first).u64(last);
        chunk = chunk.u64(uncompressed_size);
        chunk = chunk.u32(crc32fast::hash(records));
        chunk = chunk.text(COMPRESSION).u64(compressed.len() as u64);
        chunk.0.extend_from_slice(&compressed);
        let (offset, length) = self.record(opcode::CHUNK, &chunk)?;

        let index_start = self.position;
        let mut index_offsets = Content::default();
        for (&channel, messages) in messages.index() {
            *self.counts.by_channel.entry(channel).or_default() += messages.len() as u64;
            index_offsets = index_offsets.u16(channel).u64(self.position);
            let entries = messages
                .iter()
                .fold(Content::default(), |entries, &(time, offset)| {
                    entries.u64(time).u64(offset)
                });
            let index = Content::default().u16(channel).bytes(&entries.0);
            self.record(opcode::MESSAGE_INDEX, &index)?;
        }
        let index = Content::default().u64(first).u64(last);
        let index = index.u64(offset).u64(length).bytes(&index_offsets.0);
        let index = index.u64(self.position - index_start).text(COMPRESSION);
        let index = index.u64(compressed.len() as u64).u64(uncompressed_size);
        self.chunk_indexes.push(index);
        Ok(())
    }

    /// Hands everything to the system.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Closes the file and gives back what it was written to.
    pub(super) fn finish(mut self) -> io::Result<W> {
        let crc = self.data_crc.clone().finalize();
        self.record(opcode::DATA_END, &Content::default().u32(crc))?;

        let summary_start = self.position;
        let statistics = self.statistics();
        let groups = [
            (opcode::SCHEMA, std::mem::take(&mut self.schemas)),
            (opcode::CHANNEL, std::mem::take(&mut self.channels)),
            (opcode::STATISTICS, vec![statistics]),
            (opcode::CHUNK_INDEX, std::mem::take(&mut self.chunk_indexes)),
            (
                opcode::ATTACHMENT_INDEX,
                std::mem::take(&mut self.attachment_indexes),
            ),
            (
                opcode::METADATA_INDEX,
                std::mem::take(&mut self.metadata_indexes),
            ),
        ];
        let mut summary = Vec::new();
        let mut offsets = Vec::new();
        for (opcode, records) in groups.iter().filter(|(_, records)| !records.is_empty()) {
            let start = summary.len();
            for record in records {
                append_record(&mut summary, *opcode, record);
            }
            let offset = Content(vec![*opcode]).u64(summary_start + start as u64);
            offsets.push(offset.u64((summary.len() - start) as u64));
        }
        let offsets_start = summary_start + summary.len() as u64;
        for offset in &offsets {
            append_record(&mut summary, opcode::SUMMARY_OFFSET, offset);
        }
        // The checksum runs up to itself, inside the footer.
        let footer = Content::default().u64(summary_start).u64(offsets_start);
        append_record(&mut summary, opcode::FOOTER, &footer.u32(0));
        let crc_at = summary.len() - 4;
        let crc = crc32fast::hash(&summary[..crc_at]);
        summary[crc_at..].copy_from_slice(&crc.to_le_bytes());
        self.write(&summary)?;
        self.write(&MAGIC)?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn statistics(&self) -> Content {
        let counts = &self.counts;
        let (first, last) = counts.times.unwrap_or_default();
        let by_channel = counts.by_channel.iter();
        let by_channel = by_channel.fold(Content::default(), |content, (&channel, &count)| {
            content.u16(channel).u64(count)
        });
        Content::default()
            .u64(counts.by_channel.values().sum())
            .u16(self.schemas.len() as u16)
            .u32(self.channels.len() as u32)
            .u32(counts.attachments)
            .u32(counts.metadata)
            .u32(self.chunk_indexes.len() as u32)
            .u64(first)
            .u64(last)
            .bytes(&by_channel.0)
    }

    /// Writes a record; gives its offset and length.
    fn record(&mut self, opcode: u8, content: &Content) -> io::Result<(u64, u64)> {
        let offset = self.position;
        self.write(&[opcode])?;
        self.write(&(content.0.len() as u64).to_le_bytes())?;
        self.write(&content.0)?;
        Ok((offset, self.position - offset))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.data_crc.update(bytes);
        self.position += bytes.len() as u64;
        self.out.write_all(bytes)
    }
}

fn append_record(bytes: &mut Vec<u8>, opcode: u8, content: &Content) {
    bytes.push(opcode);
    bytes.extend_from_slice(&(content.0.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&content.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with two topics whose messages repeat after `size` bytes.
    fn written(size: usize, rounds: u64, period_bytes: usize) -> Vec<u8> {
        let mut writer = ContainerWriter::new(Vec::new(), "test", period_bytes).expect("begun");
        let table = BTreeMap::from([("a".to_owned(), "b".to_owned())]);
        writer.add_metadata("about", &table).expect("metadata");
        writer
            .attach("x.txt", "text/plain", b"words")
            .expect("attached");
        let schema = writer.add_schema("pkg.Name", &[1, 2, 3]).expect("schema");
        let one = writer.add_channel(schema, "/one", &table).expect("one");
        let two = writer
            .add_channel(schema, "/two", &BTreeMap::new())
            .expect("two");
        // Noise has no short matches, so that only the repetition can be compressed.
        let mut state = 1u32;
        let mut noise: Vec<u8> = std::iter::repeat_with(|| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
        .take(size)
        .collect();
        let mut chunk = Chunk::default();
        for k in 0..rounds {
            noise[0] = k as u8;
            chunk.add(one, k as u32, k * 10, &noise);
            chunk.add(two, k as u32, k * 10, &[k as u8]);
        }
        writer.write_chunk(&chunk).expect("chunk");
        writer.finish().expect("finished")
    }

    #[test]
    fn another_reader_finds_everything() {
        let bytes = written(1000, 50, 1000);
        let summary = mcap::Summary::read(&bytes)
            .expect("sound")
            .expect("summary");
        let statistics = summary.stats.as_ref().expect("statistics");
        assert_eq!(statistics.message_count, 100);
        assert_eq!(statistics.message_end_time, 490);
        assert_eq!((summary.schemas.len(), summary.channels.len()), (1, 2));
        let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]);
        assert_eq!(&*attachment.expect("sound").data, b"words");
        let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]);
        assert_eq!(metadata.expect("sound").metadata["a"], "b");
        let messages = mcap::MessageStream::new(&bytes).expect("sound");
        let messages: Vec<_> = messages.collect::<Result<_, _>>().expect("sound");
        assert_eq!(messages.len(), 100);
        let last = &messages[99];
        assert_eq!((last.channel.topic.as_str(), last.log_time), ("/two", 490));
        assert_eq!(*last.data, [49]);
        // The indexes lead to the same messages.
        let chunk = &summary.chunk_indexes[0];
        let indexes = summary.read_message_indexes(&bytes, chunk).expect("sound");
        assert_eq!(indexes.values().map(Vec::len).sum::<usize>(), 100);
    }

    #[test]
    fn repetition_beyond_the_usual_window_is_found() {
        let size = 3 << 20;
        let near = written(size, 5, size).len();
        assert!(
            near < size * 11 / 10,
            "{near} bytes for one noise of {size}"
        );
    }
}
