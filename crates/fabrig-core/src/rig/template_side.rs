//! The half of a rig that every face shares: patches, muscle shapes and skin weights of the
//! template itself.
//!
//! It depends on template and options alone. Skin weights, which take seconds, come with the
//! pack where they were fitted from the same data with the same options (told by a
//! fingerprint of both); what has been made once is kept for the process.

use std::path::Path;
use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use crate::anatomy::{self, Patch, PatchChart};
use crate::atomic_file::write_atomically;
use crate::rig::put_on_face::{FaceSide, ShapesOnFace};
use crate::rig::{RigError, RigOptions};
use crate::skin::{CandidateFinder, NodeAffine, NodeFrames, Pose, TemplateWeights, fit_to_shapes};
use crate::template::{JawHinge, Template};
use crate::transfer::{
    JawMode, JawPose, JawShapes, MuscleShape, OffsetMode, PatchTransfer, ShapeWeights,
    TransferContext, muscle_shapes, smoothed_normals,
};

/// Changes whenever the fit gives other weights for the same data.
const FIT_VERSION: u32 = 1;
/// Templates and options that a process keeps at once.
const KEPT: usize = 4;

/// What a template brings to every rig.
pub(super) struct TemplateSide {
    pub(super) charts: Vec<PatchChart>,
    /// The patches as they lie on the template.
    pub(super) patches: Vec<Patch>,
    pub(super) shapes: Vec<Vec<MuscleShape>>,
    pub(super) weights: TemplateWeights,
}

static MADE: Mutex<Vec<(u64, Arc<TemplateSide>)>> = Mutex::new(Vec::new());

impl TemplateSide {
    /// Takes it from the process, from the pack, or makes it.
    pub(super) fn of(template: &Template, options: &RigOptions) -> Result<Arc<Self>, RigError> {
        let fingerprint = fingerprint(template, options)?;
        if let Ok(made) = MADE.lock()
            && let Some((_, side)) = made.iter().find(|(key, _)| *key == fingerprint)
        {
            return Ok(Arc::clone(side));
        }
        let charts = anatomy::charts(template, options.resolution)?;
        let patches = anatomy::lay_patches(template, &charts, template.skin.positions())?;
        let shapes = muscle_shapes(template, &charts, options.threshold)?;
        let stored =
            TemplateWeights::from_bytes(&template.skin_weights, template, &charts, fingerprint);
        let weights = match stored {
            Some(weights) => weights,
            None => fit_weights(template, &charts, &patches, &shapes, options)?,
        };
        let side = Arc::new(Self {
            charts,
            patches,
            shapes,
            weights,
        });
        if let Ok(mut made) = MADE.lock() {
            made.truncate(KEPT - 1);
            made.insert(0, (fingerprint, Arc::clone(&side)));
        }
        Ok(side)
    }
}

/// Fits the skin weights of the template itself, which every face inherits; what the pack has
/// stored is not looked at.
///
/// # Errors
///
/// [`RigError`] where the template's layout cannot be laid.
pub fn fit_template_weights(
    template: &Template,
    options: &RigOptions,
) -> Result<TemplateWeights, RigError> {
    let charts = anatomy::charts(template, options.resolution)?;
    let patches = anatomy::lay_patches(template, &charts, template.skin.positions())?;
    let shapes = muscle_shapes(template, &charts, options.threshold)?;
    fit_weights(template, &charts, &patches, &shapes, options)
}

/// The weights that a pack brings for these options; `None` where it brings none, or such as
/// were fitted from something else.
///
/// # Errors
///
/// [`RigError`] where the template's layout cannot be laid.
pub fn stored_template_weights(
    template: &Template,
    options: &RigOptions,
) -> Result<Option<TemplateWeights>, RigError> {
    let charts = anatomy::charts(template, options.resolution)?;
    let fingerprint = fingerprint(template, options)?;
    Ok(TemplateWeights::from_bytes(
        &template.skin_weights,
        template,
        &charts,
        fingerprint,
    ))
}

/// Fits the weights of a pack at default options and writes them beside it, as
/// `skin_weights.bin`. Returns the size of the file. (bytes)
///
/// # Errors
///
/// [`RigError`]; the file is only replaced by a whole one.
pub fn write_template_weights(template: &Template, folder: &Path) -> Result<usize, RigError> {
    let options = RigOptions::default();
    let weights = fit_template_weights(template, &options)?;
    let bytes = weights
        .to_bytes(template, fingerprint(template, &options)?)
        .ok_or_else(|| RigError::Content {
            reason: "the skin weights cannot be encoded".to_owned(),
        })?;
    let path = folder.join("skin_weights.bin");
    write_atomically(&path, |file| file.write_all(&bytes))
        .map_err(|source| RigError::Io { path, source })?;
    Ok(bytes.len())
}

/// FNV-1a over everything that weights are fitted from.
fn fingerprint(template: &Template, options: &RigOptions) -> Result<u64, RigError> {
    let basis = (
        FIT_VERSION,
        (&template.skin, &template.mirror, &template.regions),
        (&template.shapes, &template.jaw, &template.eyes),
        &template.patch_layout,
        (options.resolution, options.threshold.to_bits()),
        (options.jaw_mode, options.fit),
    );
    let bytes = postcard::to_allocvec(&basis).map_err(|e| RigError::Content {
        reason: e.to_string(),
    })?;
    Ok(bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    }))
}

/// Poses the template's own patches in each of its shapes and fits the skin to that.
fn fit_weights(
    template: &Template,
    charts: &[PatchChart],
    patches: &[Patch],
    shapes: &[Vec<MuscleShape>],
    options: &RigOptions,
) -> Result<TemplateWeights, RigError> {
    let rest = template.skin.positions();
    let put = ShapesOnFace::new(
        FaceSide {
            template,
            template_patches: patches,
            patches,
            positions: rest,
            hinge: &template.jaw,
            eyes: &template.eyes,
        },
        shapes,
        OffsetMode::Global,
        options.threshold,
    )?;
    let transfers = put.transfers(&put.even());
    let triangles = template.skin.triangles();
    let normals = smoothed_normals(rest, &triangles, 0);
    let finder = CandidateFinder::new(template, &triangles, &normals, patches, &options.fit);
    let poser = TemplatePoser {
        template,
        transfers: &transfers,
        jaw_shapes: JawShapes::of(template),
        jaw_mode: options.jaw_mode,
        frames: patches
            .iter()
            .map(|p| {
                let rest = p.neutral.iter().map(|q| q.cast()).collect();
                NodeFrames::new(p.chart.grid, rest)
            })
            .collect(),
    };
    let poses: Vec<Pose> = (0..template.shapes.len())
        .into_par_iter()
        .map(|s| poser.pose(s))
        .collect();
    Ok(fit_to_shapes(
        template,
        charts,
        &normals,
        &finder,
        &poses,
        &options.fit,
    ))
}

struct TemplatePoser<'a> {
    template: &'a Template,
    transfers: &'a [PatchTransfer],
    jaw_shapes: JawShapes,
    jaw_mode: JawMode,
    frames: Vec<NodeFrames>,
}

impl TemplatePoser<'_> {
    /// One shape at weight 1: what every node and the mandible do, and what the skin does.
    fn pose(&self, shape: usize) -> Pose {
        let mut weights = vec![0.0; self.template.shapes.len()];
        weights[shape] = 1.0;
        let hinge: &JawHinge = &self.template.jaw;
        let context = TransferContext {
            hinge,
            jaw_shapes: &self.jaw_shapes,
            jaw_mode: self.jaw_mode,
            eyes: &self.template.eyes,
        };
        let mut affines = Vec::new();
        for (transfer, frames) in self.transfers.iter().zip(&self.frames) {
            let rest = frames.rest();
            let mut now = rest.to_vec();
            let mut velocities = vec![nalgebra::Vector3::zeros(); rest.len()];
            let at = ShapeWeights {
                weights: &weights,
                rates: None,
            };
            transfer.evaluate(&context, rest, at, &mut now, &mut velocities);
            let start = affines.len();
            affines.resize(start + rest.len(), NodeAffine::identity());
            frames.affines(&now, &mut affines[start..]);
        }
        let pose = JawPose::at(hinge, &self.jaw_shapes, 1.0, &weights);
        let (rotation, shift) = pose.affine(hinge);
        affines.push(NodeAffine {
            turn: (rotation - nalgebra::Matrix3::identity()).cast(),
            shift: shift.cast(),
        });
        let displacements = self.template.shapes[shape].spread(self.template.skin.vertex_count());
        Pose {
            affines,
            displacements: displacements.iter().map(|d| d.cast()).collect(),
        }
    }
}
