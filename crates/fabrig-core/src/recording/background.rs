//! A thread of its own for the file: chunks are filled here, compressed and written there.
//!
//! Compressing a chunk takes as long as many frames of simulation. Chunks are handed over
//! without a queue: the one before is on the disk by then, so at most two are in memory, a slow
//! disk slows the simulation instead of filling the memory, and a crash loses at most the chunk
//! being filled and the one being written. What is written does not depend on when.

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{Builder, JoinHandle};

use super::chunk::Chunk;
use super::container::ContainerWriter;

/// A chunk on its way to the file, and whether the system gets everything after it.
struct Job {
    chunk: Chunk,
    is_flushed: bool,
}

/// The thread, and the way to it.
struct Worker<W> {
    jobs: SyncSender<Job>,
    /// Written chunks come back, so that their memory is used again.
    written: Receiver<Chunk>,
    thread: JoinHandle<io::Result<ContainerWriter<W>>>,
}

/// Fills chunks and has them written by a thread.
pub(super) struct BackgroundWriter<W> {
    chunk: Chunk,
    /// Size at which a chunk is closed. (bytes before compression)
    chunk_bytes: usize,
    /// `None` once closed or failed.
    worker: Option<Worker<W>>,
}

impl<W: Write + Send + 'static> BackgroundWriter<W> {
    /// Goes on with a file that has its schemas and channels.
    ///
    /// - `chunk_bytes`: size at which a chunk is closed, before compression
    pub(super) fn new(container: ContainerWriter<W>, chunk_bytes: u64) -> io::Result<Self> {
        let (jobs, incoming) = sync_channel(0);
        let (outgoing, written) = channel();
        let thread = Builder::new()
            .name("fabrig-recording".to_owned())
            .spawn(move || write_all(container, &incoming, &outgoing))?;
        Ok(Self {
            chunk: Chunk::default(),
            // A chunk is kept in memory, and its sizes must fit the decoders of browsers.
            chunk_bytes: chunk_bytes.min(1 << 30) as usize,
            worker: Some(Worker {
                jobs,
                written,
                thread,
            }),
        })
    }

    /// Adds a message to the chunk, and hands the chunk over if it is full.
    pub(super) fn message(
        &mut self,
        channel: u16,
        sequence: u32,
        log_time: u64,
        data: &[u8],
    ) -> io::Result<()> {
        self.chunk.add(channel, sequence, log_time, data);
        if self.chunk.records().len() >= self.chunk_bytes {
            return self.hand_over(false);
        }
        Ok(())
    }

    /// Has what waits written and handed to the system, without waiting for it. What was
    /// flushed before has reached the system when this returns.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.hand_over(true)
    }

    fn hand_over(&mut self, is_flushed: bool) -> io::Result<()> {
        let Some(worker) = &self.worker else {
            return Err(closed());
        };
        let emptied = worker.written.try_recv().unwrap_or_default();
        let chunk = std::mem::replace(&mut self.chunk, emptied);
        if worker.jobs.send(Job { chunk, is_flushed }).is_ok() {
            return Ok(());
        }
        // The thread takes no more chunks because an earlier one failed.
        match self.join() {
            Err(error) => Err(error),
            Ok(_) => Err(closed()),
        }
    }

    /// Closes the file and gives back what it was written to.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.hand_over(false)?;
        self.join()?.finish()
    }
}

impl<W> BackgroundWriter<W> {
    /// Waits for the thread to write what it has.
    fn join(&mut self) -> io::Result<ContainerWriter<W>> {
        let Some(worker) = self.worker.take() else {
            return Err(closed());
        };
        drop(worker.jobs);
        let ended = worker.thread.join();
        ended.unwrap_or_else(|_| Err(io::Error::other("the thread that writes has panicked")))
    }
}

impl<W> Drop for BackgroundWriter<W> {
    fn drop(&mut self) {
        // Nothing writes to the file after its writer is gone. An error has no one to go to.
        let _ = self.join();
    }
}

fn write_all<W: Write>(
    mut container: ContainerWriter<W>,
    incoming: &Receiver<Job>,
    outgoing: &Sender<Chunk>,
) -> io::Result<ContainerWriter<W>> {
    for mut job in incoming {
        container.write_chunk(&job.chunk)?;
        if job.is_flushed {
            container.flush()?;
        }
        job.chunk.clear();
        // The other side needs no memory back once it closes the file.
        let _ = outgoing.send(job.chunk);
    }
    Ok(container)
}

fn closed() -> io::Error {
    io::Error::other("the recording is closed")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Takes so many bytes, then fails as a full disk does.
    struct Disk {
        free: usize,
        written: Vec<u8>,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if bytes.len() > self.free {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.free -= bytes.len();
            self.written.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn writer(free: usize, chunk_bytes: u64) -> BackgroundWriter<Disk> {
        let disk = Disk {
            free,
            written: Vec::new(),
        };
        let mut container = ContainerWriter::new(disk, "test", 1000).expect("begun");
        let schema = container.add_schema("pkg.Name", &[1]).expect("schema");
        container
            .add_channel(schema, "/one", &BTreeMap::new())
            .expect("channel");
        BackgroundWriter::new(container, chunk_bytes).expect("started")
    }

    #[test]
    fn chunks_stand_in_order_and_hold_every_message() {
        let mut writer = writer(usize::MAX, 4000);
        for k in 0..100u32 {
            let data = [k as u8; 300];
            writer
                .message(1, k, u64::from(k), &data)
                .expect("taken while the disk is good");
            if k % 40 == 39 {
                writer.flush().expect("flushed");
            }
        }
        let bytes = writer.finish().expect("finished").written;
        let summary = mcap::Summary::read(&bytes).expect("sound");
        let chunks = summary.expect("summary").chunk_indexes;
        assert!(chunks.len() > 6, "{}", chunks.len());
        let messages = mcap::MessageStream::new(&bytes).expect("sound");
        let times: Vec<u64> = messages.map(|m| m.expect("sound").log_time).collect();
        assert!(times.iter().copied().eq(0..100), "{times:?}");
    }

    #[test]
    fn an_error_of_the_thread_reaches_the_caller_and_closes_the_writer() {
        let mut writer = writer(2000, 1000);
        let mut random = 1u32;
        let failed = (0..100u32).find_map(|k| {
            let data: Vec<u8> = (0..1000)
                .map(|_| {
                    random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (random >> 24) as u8
                })
                .collect();
            writer.message(1, k, u64::from(k), &data).err()
        });
        let error = failed.expect("the disk is full");
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        let again = writer.message(1, 0, 0, &[0; 1000]);
        assert!(again.is_err_and(|e| e.to_string().contains("closed")));
        assert!(writer.finish().is_err());
    }
}
