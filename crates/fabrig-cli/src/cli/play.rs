//! What is shown live.

use std::path::PathBuf;

use clap::Args;
#[cfg(feature = "play")]
use fabrig_core::recording::RecordingOptions;

use super::animate::{Recorded, parse_rate};
use super::{SceneArgs, TakeArgs};

#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// Recording (.mcap, or .mcap.partial of a killed run), or a rig (.fabrig) to simulate
    pub(crate) input: PathBuf,
    /// A take for the rig, played over and over; without it the face rests until a weight is set
    #[arg(long, value_name = "TAKE")]
    pub(crate) motion: Option<PathBuf>,
    /// Address to listen at; 0.0.0.0 lets other machines in
    #[arg(long, default_value = "127.0.0.1")]
    pub(crate) host: String,
    /// Port to listen at, 0 for any that is free
    #[arg(long, default_value_t = 8765)]
    pub(crate) port: u16,
    /// Play so many times as quick, 0 to begin paused
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = parse_rate)]
    pub(crate) speed: f64,
    /// End after the recording or take was played once, instead of beginning anew
    #[arg(long)]
    pub(crate) once: bool,
    /// Meshes per second at most, of the skin and of the patches: browsers show no more
    #[arg(long, value_name = "HZ", default_value_t = 15.0, value_parser = parse_rate)]
    pub(crate) mesh_hz: f64,
    /// Point clouds per second at most
    #[arg(long, value_name = "HZ", default_value_t = 15.0, value_parser = parse_rate)]
    pub(crate) points_hz: f64,
    /// Of a rig, send only these, with commas between [default: all but strain and magnets]
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    pub(crate) record: Vec<Recorded>,
    /// Also write the layout for Foxglove
    #[arg(long, value_name = "OUT.json")]
    pub(crate) layout: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) take: TakeArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Print the address as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl PlayArgs {
    /// What is sent how often.
    #[cfg(feature = "play")]
    pub(crate) fn options(&self) -> RecordingOptions {
        let options = RecordingOptions {
            skin_hz: self.mesh_hz,
            patches_hz: self.mesh_hz,
            points_hz: self.points_hz,
            // Nobody compares the bytes of what is live.
            timings: true,
            ..RecordingOptions::default()
        };
        if self.record.is_empty() {
            return options;
        }
        let kinds: Vec<_> = self.record.iter().map(|&what| what.into()).collect();
        options.only(&kinds)
    }
}
