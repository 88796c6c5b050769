//! What is simulated and recorded.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use fabrig_core::recording::{RecordedKind, RecordingOptions};
use fabrig_core::scene::{RecordingChoice, Tolerance};

use super::TakeArgs;

#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// Frames per second of the simulation [default: the scene's, or else the take's]
    #[arg(long)]
    pub(crate) fps: Option<f64>,
    /// Substeps of the cloth per 1/60 s [default: the solver's]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) substeps: Option<u32>,
    /// By how much frames may differ from the full model, as the root mean square over any patch:
    /// millimetres, or percent of the face's height such as 0.05%; off models everything [default:
    /// the scene's, or else 0.1]
    #[arg(long, value_name = "MM|%|off")]
    pub(crate) economy: Option<Tolerance>,
    /// Gravity in mm/s^2, world axes, +Y up [default: 0,-9810,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(crate) gravity: Option<[f32; 3]>,
    /// Wind in mm/s, world axes, added to the take's own
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(crate) wind: Option<[f32; 3]>,
    /// Leave the cloth out: patches stand where the muscle shapes want them
    #[arg(long)]
    pub(crate) without_dynamics: bool,
    /// Skin and fat of the face that are not its own, with commas between: looser_skin,
    /// firmer_skin, more_fat, less_fat, aged
    #[arg(long, value_name = "PRESET", value_delimiter = ',')]
    pub(crate) preset: Vec<String>,
    /// What is modelled, as TOML: `docs/scenes.md`; what else is given here goes before it
    #[arg(long = "scene", value_name = "SCENE.toml")]
    pub(crate) file: Option<PathBuf>,
    /// Which patches collide [default: none]
    #[arg(long, value_enum)]
    pub(crate) contact: Option<ContactPairs>,
    /// Things that the face can touch: a TOML file of `colliders` tables
    #[arg(long, value_name = "COLLIDERS.toml")]
    pub(crate) colliders: Option<PathBuf>,
    /// Let lips stick to each other
    #[arg(long)]
    pub(crate) sticky_lips: bool,
}

/// Which patches collide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ContactPairs {
    /// None
    None,
    /// Ring muscles with themselves: lips, and lids with eyeballs
    Sphincter,
    /// All that are not attached to each other
    All,
}

/// Something that a recording can hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Recorded {
    /// Skin, eyeballs, teeth and tongue as shaded meshes
    Skin,
    /// Muscles and fat as shaded meshes
    Patches,
    /// Skin vertices and patch nodes as points
    Points,
    /// Where the muscle shapes want the patch nodes, as points
    Magnets,
    /// Patches coloured by their stretch
    Strain,
    /// Arrows where things touch
    Contacts,
    /// What the face touches
    Colliders,
    /// The weights of the shapes
    Weights,
    /// The cloth's energies
    Energies,
    /// Distances of the patches from their muscle shapes
    Errors,
    /// Times of every frame; equal inputs then no longer give equal bytes
    Timings,
}

impl From<Recorded> for RecordedKind {
    fn from(recorded: Recorded) -> Self {
        match recorded {
            Recorded::Skin => Self::Skin,
            Recorded::Patches => Self::Patches,
            Recorded::Points => Self::Points,
            Recorded::Magnets => Self::Magnets,
            Recorded::Strain => Self::Strain,
            Recorded::Contacts => Self::Contacts,
            Recorded::Colliders => Self::Colliders,
            Recorded::Weights => Self::Weights,
            Recorded::Energies => Self::Energies,
            Recorded::Errors => Self::Errors,
            Recorded::Timings => Self::Timings,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct RecordingArgs {
    /// Record only these, with commas between [default: the scene's, or else skin, patches, points,
    /// contacts, colliders, weights, energies, errors]
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    pub(crate) record: Vec<Recorded>,
    /// Skin meshes per second in the recording, 0 for none [default: the scene's, or else 30]
    #[arg(long, value_parser = parse_rate)]
    pub(crate) skin_hz: Option<f64>,
    /// Patch meshes per second in the recording, 0 for none [default: the scene's, or else 30]
    #[arg(long, value_parser = parse_rate)]
    pub(crate) patches_hz: Option<f64>,
    /// Point clouds per second in the recording, 0 for none [default: the scene's, or else 10]
    #[arg(long, value_parser = parse_rate)]
    pub(crate) points_hz: Option<f64>,
    /// Patch meshes coloured by their stretch per second in the recording, 0 for none [default: the
    /// scene's, or else 0]
    #[arg(long, value_parser = parse_rate)]
    pub(crate) strain_hz: Option<f64>,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl RecordingArgs {
    /// What is written how often: as the arguments say, or else the scene.
    pub(crate) fn options(&self, of_scene: &RecordingChoice) -> RecordingOptions {
        let kinds: Vec<RecordedKind> = self.record.iter().map(|&what| what.into()).collect();
        let own = RecordingChoice {
            record: Some(kinds).filter(|kinds| !kinds.is_empty()),
            skin_hz: self.skin_hz,
            patches_hz: self.patches_hz,
            points_hz: self.points_hz,
            strain_hz: self.strain_hz,
        };
        own.or(of_scene).options()
    }
}

#[derive(Debug, Args)]
pub(crate) struct AnimateArgs {
    /// Rig, as `fabrig rig` makes it; a scene with one face may have its own
    #[arg(required_unless_present = "file")]
    pub(crate) rig: Option<PathBuf>,
    /// Live Link Face, ARKit, OpenFace, py-feat or MediaPipe CSV, MediaPipe JSON, Face Cap text
    /// or keyed text; a scene with faces may have its own
    #[arg(long, value_name = "TAKE", required_unless_present = "file")]
    pub(crate) motion: Option<PathBuf>,
    /// Where to write the recording
    #[arg(short, long, value_name = "OUT.mcap")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) take: TakeArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Where to write the recording
    #[arg(short, long, value_name = "OUT.mcap", default_value = "demo.mcap")]
    pub(crate) output: PathBuf,
    /// Also keep the rig
    #[arg(long, value_name = "FACE.fabrig")]
    pub(crate) rig: Option<PathBuf>,
    /// What is played
    #[arg(long, value_enum, default_value_t = DemoScene::Performance)]
    pub(crate) story: DemoScene,
    /// Also draw the story (contact or physics) into this folder
    #[arg(long, value_name = "FOLDER")]
    pub(crate) pictures: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
}

/// What the demo plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DemoScene {
    /// A performance of twelve seconds
    Performance,
    /// Lips that stick, a finger on the cheek, a ball on the forehead, blinks: contact is on
    Contact,
    /// Forehead lines, crow's feet, lying down, a gust, a shake of the head: skin is loose and
    /// fine
    Physics,
}

pub(super) fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate >= 0.0 => Ok(rate),
        _ => Err("expected a number of times per second, at least 0".to_owned()),
    }
}

fn parse_vector(text: &str) -> Result<[f32; 3], String> {
    let numbers: Vec<f32> = text
        .split(',')
        .map(|part| part.trim().parse::<f32>())
        .collect::<Result<_, _>>()
        .map_err(|_| "expected three numbers X,Y,Z".to_owned())?;
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok([x, y, z]),
        _ => Err("expected three finite numbers X,Y,Z".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_are_three_finite_numbers() {
        assert_eq!(parse_vector("1,-2.5, 3"), Ok([1.0, -2.5, 3.0]));
        for bad in ["", "1,2", "1,2,3,4", "1,x,3", "1,nan,3"] {
            assert!(parse_vector(bad).is_err(), "{bad}");
        }
    }
}
