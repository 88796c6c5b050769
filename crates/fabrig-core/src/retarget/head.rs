//! The motion of the head taken off moving sites, so that only the face's is left.
//!
//! A first estimate comes from the sites that no control moves. Once the face is fitted, all
//! sites tell about the head: each frame's rigid motion is fitted again to where the fitted
//! face has them.

use nalgebra::Isometry3;

use super::markers::rigid;
use super::{FitFrame, FitOptions, ResponseModel, RetargetError, Retargeted, fit_clip};
use crate::Point;
use crate::motion::{ClipTracks, HeadPose};

/// Sites that every control moves less than this stand still on the head. (mm)
const STABLE: f64 = 0.8;

/// Fewest of them that tell a rigid motion.
const FEWEST_STABLE: usize = 3;

/// Moving sites as a source has them.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteMotion {
    /// (s)
    pub times: Vec<f64>,
    /// Each site when the face is neutral. [mm, head frame]
    pub neutral: Vec<Point>,
    /// Each site in every frame (mm), `None` where it is not seen.
    pub positions: Vec<Vec<Option<Point>>>,
    /// The positions move with the head; otherwise they are in the head frame already.
    pub has_head_motion: bool,
}

/// Fits a rig's controls to moving sites, and the motion of the head where there is one.
///
/// # Errors
///
/// [`RetargetError`], as [`fit_clip`], and [`RetargetError::FewStableSites`].
pub fn fit_sites(
    model: &mut ResponseModel,
    motion: &SiteMotion,
    options: &FitOptions,
) -> Result<Retargeted, RetargetError> {
    let expected = model.sites().len();
    for list in std::iter::once(motion.neutral.len()).chain(motion.positions.iter().map(Vec::len)) {
        if list != expected {
            return Err(RetargetError::Count {
                what: "positions, one per site",
                expected,
                found: list,
            });
        }
    }
    if motion.times.len() != motion.positions.len() {
        return Err(RetargetError::Count {
            what: "times, one per frame",
            expected: motion.positions.len(),
            found: motion.times.len(),
        });
    }
    for (frame, places) in motion.positions.iter().enumerate() {
        let bad = |p: &Option<Point>| p.is_some_and(|p| !p.iter().all(|c| c.is_finite()));
        if let Some(site) = places.iter().position(bad) {
            return Err(RetargetError::NotFinite {
                frame,
                what: format!("site {site}"),
            });
        }
    }
    if !motion.has_head_motion {
        let still = vec![Isometry3::identity(); motion.times.len()];
        return fit_clip(model, &frames(motion, &still), options);
    }
    let heads = stable_heads(model, motion)?;
    let first = fit_clip(model, &frames(motion, &heads), options)?;
    let heads = refined_heads(model, motion, &first, heads)?;
    let fitted = fit_clip(model, &frames(motion, &heads), options)?;
    let head = heads.iter().map(|motion| HeadPose {
        // The head turns about the scene's pivot; where it went is not told apart from that.
        ..HeadPose::from_rotation(&motion.rotation)
    });
    let tracks = ClipTracks {
        head: head.collect(),
        ..ClipTracks::default()
    };
    Ok(Retargeted {
        clip: fitted.clip.with_tracks(tracks)?,
        ..fitted
    })
}

/// What the face does besides the head.
fn frames(motion: &SiteMotion, heads: &[Isometry3<f64>]) -> Vec<FitFrame> {
    let places = motion.positions.iter().zip(heads).zip(&motion.times);
    places
        .map(|((places, head), &time)| FitFrame {
            time,
            displacements: places
                .iter()
                .zip(&motion.neutral)
                .map(|(p, neutral)| p.map(|p| head.inverse() * p - neutral))
                .collect(),
        })
        .collect()
}

fn stable_heads(
    model: &ResponseModel,
    motion: &SiteMotion,
) -> Result<Vec<Isometry3<f64>>, RetargetError> {
    let mobility = model.mobility();
    let stable: Vec<usize> = (0..mobility.len())
        .filter(|&s| mobility[s] < STABLE)
        .collect();
    let heads = motion.positions.iter().enumerate().map(|(frame, places)| {
        let seen: Vec<usize> = stable
            .iter()
            .copied()
            .filter(|&s| places[s].is_some())
            .collect();
        let from: Vec<Point> = seen.iter().map(|&s| motion.neutral[s]).collect();
        let to: Vec<Point> = seen.iter().filter_map(|&s| places[s]).collect();
        rigid(&from, &to).ok_or(RetargetError::FewStableSites {
            frame,
            expected: FEWEST_STABLE,
            found: seen.len(),
        })
    });
    heads.collect()
}

fn refined_heads(
    model: &mut ResponseModel,
    motion: &SiteMotion,
    fitted: &Retargeted,
    heads: Vec<Isometry3<f64>>,
) -> Result<Vec<Isometry3<f64>>, RetargetError> {
    let count = model.controls().count();
    let mut refined = Vec::with_capacity(heads.len());
    for (frame, head) in heads.into_iter().enumerate() {
        let moved = model.displacements(&fitted.values[frame * count..(frame + 1) * count])?;
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for ((place, neutral), moved) in motion.positions[frame]
            .iter()
            .zip(&motion.neutral)
            .zip(&moved)
        {
            if let Some(place) = place {
                from.push(neutral + moved);
                to.push(*place);
            }
        }
        refined.push(rigid(&from, &to).unwrap_or(head));
    }
    Ok(refined)
}
