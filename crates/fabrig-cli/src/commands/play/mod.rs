//! `fabrig play`: a recording, or a rig that is simulated meanwhile, to Foxglove over its
//! WebSocket protocol.

mod clock;
mod face;
mod parameters;
mod recording;
mod server;

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use fabrig_core::atomic_file::write_atomically;

use self::clock::Clock;
use self::parameters::Change;
use self::server::{Announcement, Server};
use super::{Outcome, check_output};
use crate::cli::PlayArgs;
use crate::console::Console;

/// How long to wait before looking again whether somebody watches. (s)
const IDLE: Duration = Duration::from_millis(20);
/// Longest sleep between looks at Ctrl-C and at what viewers set. (s)
const NAP: Duration = Duration::from_millis(50);

/// What is played, frame by frame.
trait Source {
    /// What viewers are told before the first frame.
    fn announcement(&self) -> Announcement;
    /// The layout for Foxglove, if it is not in the recording.
    fn layout(&self) -> Option<String>;
    /// Takes what a viewer set; returns the value that it has now, `None` for one that cannot be.
    fn set(&mut self, change: &Change);
    /// Sends one frame; says how long it is shown (s), or that there are no more.
    fn send(&mut self, server: &Server) -> Result<ControlFlow<(), f64>>;
    /// Begins anew.
    fn restart(&mut self) -> Result<()>;
}

pub(crate) fn run(console: &Console, args: &PlayArgs) -> Result<Outcome> {
    if let Some(path) = &args.layout {
        check_output(path)?;
    }
    let mut source: Box<dyn Source> = if is_rig(&args.input) {
        Box::new(face::SimulatedFace::new(args)?)
    } else {
        if args.motion.is_some() {
            bail!("--motion plays a take on a rig (.fabrig); a recording has its own");
        }
        Box::new(recording::Recording::open(args)?)
    };
    if let Some(path) = &args.layout {
        let Some(layout) = source.layout() else {
            bail!("--layout: a recording carries its layout; import its fabrig.foxglove.json");
        };
        write_atomically(path, |file| file.write_all(layout.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let server = Server::start(&args.host, args.port, source.announcement())?;
    say_where(console, args, server.port())?;
    let played = play(console, args, source.as_mut(), &server);
    server.stop();
    played
}

fn is_rig(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("fabrig"))
}

fn say_where(console: &Console, args: &PlayArgs, port: u16) -> Result<()> {
    let url = format!("ws://{}:{port}", args.host);
    if args.json {
        let said = serde_json::json!({"url": url, "port": port});
        console.result(&serde_json::to_string(&said)?);
        return Ok(());
    }
    console.result(&format!("{:<20}{}", "playing", args.input.display()));
    console.result(&format!("{:<20}{url}", "at"));
    console.result(&format!(
        "{:<20}in Foxglove: Open connection, Foxglove WebSocket, this address; Ctrl-C ends it",
        "watch"
    ));
    Ok(())
}

fn play(
    console: &Console,
    args: &PlayArgs,
    source: &mut dyn Source,
    server: &Server,
) -> Result<Outcome> {
    let mut clock = Clock::new(args.speed);
    while !console.is_stopped() {
        for change in server.changes() {
            match change {
                Change::Speed(speed) => clock.set_speed(speed),
                other => source.set(&other),
            }
        }
        // Nothing is computed or read while nobody watches.
        if !server.is_watched() || clock.is_paused() {
            clock.forget();
            std::thread::sleep(IDLE);
            continue;
        }
        let shown = match source.send(server)? {
            ControlFlow::Continue(shown) => shown,
            ControlFlow::Break(()) if args.once => break,
            ControlFlow::Break(()) => {
                source.restart()?;
                continue;
            }
        };
        clock.add(shown);
        while let Some(rest) = clock.rest() {
            if console.is_stopped() || server.has_changes() {
                break;
            }
            std::thread::sleep(rest.min(NAP));
        }
    }
    Ok(Outcome::Done)
}
