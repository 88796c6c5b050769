//! How fine patches have to be for what is asked of them.
//!
//! What each resolution costs was measured against the finest ([`resolution_rows`], which
//! `fabrig bench resolution` prints): the skin of the bundled face through the expressions of
//! the bundled take, with everything modelled. Coarser patches are not only coarser curves between
//! the same points, they are other cloth: so the skins were compared, not the curves.

use std::ops::ControlFlow;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point3;
use serde::Serialize;

use super::{RigFaceOptions, TimeStatistics, rig_face};
use crate::Error;
use crate::anatomy::Resolution;
use crate::mesh::Mesh;
use crate::motion::Clip;
use crate::scene::{Economy, Scene, Simulation};
use crate::template::Template;

/// From the chin to the hairline, of an adult. (mm)
const FACE_HEIGHT: f64 = 185.0;

/// Largest difference of a frame that a resolution made in the first 6 s of the bundled take, as the
/// root mean square over the skin: 0.173, 0.097 and 0.078, rounded up. (mm)
const MEASURED: [(&str, Resolution, f64); 4] = [
    ("coarse", Resolution::COARSE, 0.18),
    ("standard", Resolution::STANDARD, 0.10),
    ("fine", Resolution::FINE, 0.08),
    ("finest", Resolution::FINEST, 0.0),
];

/// Frames a second that are compared.
const COMPARED: usize = 10;

/// How many nodes patches have: as many as it is said, or as are needed. In text `standard`,
/// `0.3mm` or `900px`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PatchDetail {
    /// As many as this.
    Grid(Resolution),
    /// The fewest with which the skin is so near to the finest, as the root mean square of the
    /// worst frame. (mm)
    Within(f64),
    /// The fewest with which that is half a pixel, in a picture in which the face is so high from
    /// the chin to the hairline. (pixels)
    InView(f64),
}

/// A text that says no [`PatchDetail`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{found}' is not {}", Self::EXPECTED)]
pub struct PatchDetailError {
    /// What was found.
    pub found: String,
}

impl PatchDetailError {
    /// What there should have been.
    pub const EXPECTED: &str = "one of coarse, standard, fine, finest, an accuracy such as 0.3mm, or \
                                the height of the face in a picture such as 900px";
}

impl PatchDetail {
    /// The coarsest resolution that does.
    pub fn resolution(&self) -> Resolution {
        let tolerance = match self {
            Self::Grid(resolution) => return *resolution,
            Self::Within(mm) => *mm,
            Self::InView(pixels) => 0.5 * FACE_HEIGHT / pixels,
        };
        let does = MEASURED.iter().find(|(_, _, cost)| *cost <= tolerance);
        does.map_or(Resolution::FINEST, |(_, resolution, _)| *resolution)
    }
}

impl Default for PatchDetail {
    fn default() -> Self {
        Self::Grid(Resolution::default())
    }
}

impl FromStr for PatchDetail {
    type Err = PatchDetailError;

    fn from_str(text: &str) -> Result<Self, PatchDetailError> {
        let text = text.trim();
        let named = MEASURED.iter().find(|(name, _, _)| *name == text);
        if let Some((_, resolution, _)) = named {
            return Ok(Self::Grid(*resolution));
        }
        let number = |unit: &str| {
            let number = text.strip_suffix(unit)?.trim().parse::<f64>().ok()?;
            (number > 0.0 && number.is_finite()).then_some(number)
        };
        let read = number("mm").map(Self::Within);
        read.or_else(|| number("px").map(Self::InView))
            .ok_or_else(|| PatchDetailError {
                found: text.to_owned(),
            })
    }
}

/// What a resolution costs, in millimetres and in time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResolutionRow {
    /// Its name.
    pub name: &'static str,
    /// Nodes of all patches.
    pub nodes: usize,
    /// Difference of the skin to that of the finest, root mean square over all vertices: of the
    /// middle frame and of the worst. (mm)
    pub rms: [f64; 2],
    /// Largest difference of a vertex. (mm)
    pub largest: f64,
    /// Building the rig. (s)
    pub build: f64,
    /// Frames. (ms)
    pub frame: TimeStatistics,
}

/// Plays a take on rigs of every resolution and holds the skin against that of the finest, which
/// comes last.
///
/// - `frame_count`: frames at 60 a second, at most
/// - `tell`: is told the name of each that is done, and whether to go on
///
/// # Errors
///
/// [`Error`] of rigging and of simulating; [`crate::pipeline::rig_face`] says what it is where it
/// was told to stop.
pub fn resolution_rows(
    face: &Mesh,
    template: &Template,
    clip: &Clip,
    frame_count: usize,
    tell: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Vec<ResolutionRow>, Error> {
    let mut played: Vec<(ResolutionRow, Vec<Vec<Point3<f32>>>)> = Vec::new();
    for (name, resolution, _) in MEASURED {
        let mut options = RigFaceOptions::default();
        options.rig.resolution = resolution;
        let clock = Instant::now();
        let rigged = rig_face(face, template, &options, &mut |_| tell(name))?;
        let build = clock.elapsed().as_secs_f64();
        let rig = Arc::new(rigged.rig);
        let nodes = rig.patches.iter().map(|p| p.patch.neutral.len()).sum();
        let scene = Scene {
            economy: Economy::OFF,
            ..Scene::default()
        };
        let mut simulation = Simulation::new(rig, scene, Some(clip.clone()))?;
        let (mut times, mut skins) = (Vec::new(), Vec::new());
        for frame in 0..frame_count {
            let clock = Instant::now();
            simulation.advance(1.0 / 60.0)?;
            times.push(clock.elapsed().as_secs_f64() * 1e3);
            if (frame + 1).is_multiple_of(60 / COMPARED) {
                skins.push(simulation.skin().to_vec());
            }
        }
        let row = ResolutionRow {
            name,
            nodes,
            rms: [0.0; 2],
            largest: 0.0,
            build,
            frame: TimeStatistics::of(times),
        };
        played.push((row, skins));
    }
    let finest = played.last().map(|(_, skins)| skins.clone());
    let finest = finest.unwrap_or_default();
    Ok(played
        .into_iter()
        .map(|(row, skins)| compared(row, &skins, &finest))
        .collect())
}

fn compared(
    row: ResolutionRow,
    skins: &[Vec<Point3<f32>>],
    finest: &[Vec<Point3<f32>>],
) -> ResolutionRow {
    let mut largest = 0.0f64;
    let pairs = skins.iter().zip(finest);
    let mut rms: Vec<f64> = pairs
        .map(|(skin, finest)| {
            let mut sum = 0.0;
            for (p, q) in skin.iter().zip(finest) {
                let square = f64::from((p - q).norm_squared());
                largest = largest.max(square.sqrt());
                sum += square;
            }
            (sum / skin.len().max(1) as f64).sqrt()
        })
        .collect();
    rms.sort_by(f64::total_cmp);
    let at = |k: usize| rms.get(k).copied().unwrap_or(0.0);
    ResolutionRow {
        rms: [at(rms.len() / 2), at(rms.len().saturating_sub(1))],
        largest,
        ..row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detail_is_read_and_chosen_by_what_was_measured() {
        let read = |text: &str| text.parse::<PatchDetail>();
        assert_eq!(read("fine"), Ok(PatchDetail::Grid(Resolution::FINE)));
        assert_eq!(read("0.3 mm"), Ok(PatchDetail::Within(0.3)));
        assert_eq!(read("900px"), Ok(PatchDetail::InView(900.0)));
        for bad in ["huge", "", "-1mm", "0px", "nan mm", "3"] {
            let error = read(bad).unwrap_err();
            assert!(error.to_string().contains("is not one of coarse"), "{bad}");
        }
        let mut before = f64::INFINITY;
        for (name, resolution, cost) in MEASURED {
            assert_eq!(read(name), Ok(PatchDetail::Grid(resolution)));
            assert_eq!(PatchDetail::Within(cost.max(1e-9)).resolution(), resolution);
            assert!(cost < before, "{name} is no better than what is coarser");
            before = cost;
        }
        assert_eq!(PatchDetail::InView(1e9).resolution(), Resolution::FINEST);
        assert_eq!(PatchDetail::InView(1.0).resolution(), Resolution::COARSE);
    }
}
