//! A recording, message by message.

use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Result, bail};
use fabrig_core::recording::{MessageReader, RecordedMessage};

use super::Source;
use super::parameters::Change;
use super::server::{Announcement, Server, Topic};
use crate::cli::PlayArgs;
use crate::commands::stem;

/// How long the last instant is shown. (s)
const LAST_SHOWN: f64 = 1.0 / 60.0;

/// The source.
pub(super) struct Recording {
    path: PathBuf,
    is_partial: bool,
    reader: MessageReader,
    /// The first message of the next frame.
    next: Option<RecordedMessage>,
    speed: f64,
    /// Shortest time between messages on each topic. (ns)
    gaps: Vec<u64>,
    /// When the last message went out on each topic. (ns)
    sent: Vec<Option<u64>>,
}

impl Recording {
    pub(super) fn open(args: &PlayArgs) -> Result<Self> {
        if !args.record.is_empty() {
            bail!("--record chooses what a rig sends; a recording has what was recorded");
        }
        let path = args.input.clone();
        let is_partial = path.extension().is_some_and(|e| e == "partial");
        let reader = MessageReader::open(&path, is_partial)?;
        // A little less than the period, so that rounding drops nothing.
        let gap = |hz: f64| {
            if hz > 0.0 {
                (0.999e9 / hz) as u64
            } else {
                u64::MAX
            }
        };
        let gaps = reader
            .topics()
            .iter()
            .map(|topic| match topic.schema.as_str() {
                "foxglove.SceneUpdate" => gap(args.mesh_hz),
                "foxglove.PointCloud" => gap(args.points_hz),
                _ => 0,
            });
        Ok(Self {
            gaps: gaps.collect(),
            sent: vec![None; reader.topics().len()],
            path,
            is_partial,
            reader,
            next: None,
            speed: args.speed,
        })
    }

    fn pass_on(&mut self, server: &Server, message: &RecordedMessage) {
        let topic = message.topic;
        let is_due = match self.sent[topic] {
            None => self.gaps[topic] < u64::MAX,
            Some(before) => message.log_time.saturating_sub(before) >= self.gaps[topic],
        };
        if is_due {
            self.sent[topic] = Some(message.log_time);
            server.send(topic, message.log_time, &message.data);
        }
    }
}

impl Source for Recording {
    fn announcement(&self) -> Announcement {
        let topics = self.reader.topics().iter().map(|topic| Topic {
            topic: topic.topic.clone(),
            schema: topic.schema.clone(),
            descriptors: topic.descriptors.clone(),
            metadata: topic.metadata.clone(),
        });
        Announcement {
            name: format!("fabrig: {}", stem(&self.path)),
            topics: topics.collect(),
            speed: self.speed,
            weights: Vec::new(),
            follows_take: None,
        }
    }

    fn layout(&self) -> Option<String> {
        None
    }

    fn set(&mut self, _change: &Change) {}

    fn send(&mut self, server: &Server) -> Result<ControlFlow<(), f64>> {
        let first = match self.next.take() {
            Some(message) => message,
            None => match self.reader.next_message()? {
                Some(message) => message,
                None => return Ok(ControlFlow::Break(())),
            },
        };
        let now = first.log_time;
        server.time(now);
        self.pass_on(server, &first);
        while let Some(message) = self.reader.next_message()? {
            if message.log_time != now {
                let shown = message.log_time.saturating_sub(now) as f64 / 1e9;
                self.next = Some(message);
                return Ok(ControlFlow::Continue(shown));
            }
            self.pass_on(server, &message);
        }
        Ok(ControlFlow::Continue(LAST_SHOWN))
    }

    fn restart(&mut self) -> Result<()> {
        self.reader = MessageReader::open(&self.path, self.is_partial)?;
        self.sent.fill(None);
        self.next = None;
        Ok(())
    }
}
