//! Foxglove's server with our topics.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, Result};
use foxglove::websocket::Capability;
use foxglove::{
    Context, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};

use super::parameters::{Change, Parameters};

/// Messages that wait for a viewer; older ones are dropped where it is slow.
const BACKLOG: usize = 64;

/// A topic to serve.
pub(super) struct Topic {
    pub(super) topic: String,
    pub(super) schema: String,
    pub(super) descriptors: Vec<u8>,
    pub(super) metadata: BTreeMap<String, String>,
}

/// What viewers are told before the first frame.
pub(super) struct Announcement {
    pub(super) name: String,
    pub(super) topics: Vec<Topic>,
    pub(super) speed: f64,
    /// Shapes whose weights can be set; none for a recording.
    pub(super) weights: Vec<String>,
    /// Whether the weights are a take's; `None` where there is no take.
    pub(super) follows_take: Option<bool>,
}

/// A server that listens.
pub(super) struct Server {
    handle: Arc<WebSocketServerHandle>,
    /// The server itself holds it weakly, and has no channels without it.
    _context: Arc<Context>,
    channels: Vec<Arc<RawChannel>>,
    incoming: Receiver<Change>,
    pending: Mutex<VecDeque<Change>>,
}

impl Server {
    pub(super) fn start(host: &str, port: u16, announcement: Announcement) -> Result<Self> {
        let context = Context::new();
        let channels = announcement.topics.into_iter().map(|topic| {
            let schema = Schema::new(topic.schema, "protobuf", topic.descriptors);
            context
                .channel_builder(topic.topic)
                .message_encoding("protobuf")
                .schema(schema)
                .metadata(topic.metadata)
                .build_raw()
                .context("a topic cannot be served")
        });
        let channels = channels.collect::<Result<Vec<_>>>()?;
        let (changes, incoming) = channel();
        let parameters = Arc::new(Parameters::new(
            announcement.speed,
            &announcement.weights,
            announcement.follows_take,
            changes,
        ));
        let handler = Arc::clone(&parameters);
        let handle = WebSocketServer::new()
            .context(&context)
            .name(announcement.name)
            .bind(host, port)
            .capabilities([Capability::Time, Capability::Parameters])
            .parameter_handler(handler)
            .message_backlog_size(BACKLOG)
            .start_blocking()
            .with_context(|| format!("cannot listen at {host}:{port}"))?;
        let handle = Arc::new(handle);
        parameters.tell(&handle);
        Ok(Self {
            handle,
            _context: context,
            channels,
            incoming,
            pending: Mutex::new(VecDeque::new()),
        })
    }

    pub(super) fn port(&self) -> u16 {
        self.handle.port()
    }

    /// Whether anybody looks at anything.
    pub(super) fn is_watched(&self) -> bool {
        self.channels.iter().any(|channel| channel.has_sinks())
    }

    /// What viewers set since the last call.
    pub(super) fn changes(&self) -> Vec<Change> {
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        pending.extend(self.incoming.try_iter());
        pending.drain(..).collect()
    }

    /// Whether there is something in [`Self::changes`].
    pub(super) fn has_changes(&self) -> bool {
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        pending.extend(self.incoming.try_iter());
        !pending.is_empty()
    }

    /// Sends a message on a topic, by its index.
    pub(super) fn send(&self, topic: usize, log_time: u64, data: &[u8]) {
        if let Some(channel) = self.channels.get(topic) {
            channel.log_with_meta(data, PartialMetadata::with_log_time(log_time));
        }
    }

    /// Tells viewers what time it is in what they see. (ns)
    pub(super) fn time(&self, log_time: u64) {
        self.handle.broadcast_time(log_time);
    }

    /// Says goodbye to viewers.
    pub(super) fn stop(self) {
        // A viewer that sets a parameter right now holds it too; its end is the program's then.
        if let Some(handle) = Arc::into_inner(self.handle) {
            handle.stop().wait_blocking();
        }
    }
}
