//! From a face on the template to a rig.

use nalgebra::Similarity3;
use rayon::prelude::*;

use crate::anatomy::{self, Patch, Resolution};
use crate::mesh::{Mesh, SurfacePoint};
use crate::registration::{Registration, RigidComponent};
use crate::rig::parts::name_parts;
use crate::rig::sockets::{fit_eyes, fit_hinge};
use crate::rig::{Rig, RigError, RigJaw, RigPatch};
use crate::skin::{
    CandidateFinder, FitOptions, NodeAffine, NodeFrames, Pose, SkinBinding, SmoothInterpolation,
    TemplateWeights, fit_to_shapes,
};
use crate::template::{EyeSocket, JawHinge, Template};
use crate::transfer::{
    AlphaField, EyeShapes, JawField, JawMode, JawShapes, LidClosing, LidField, MuscleShape,
    PatchTransfer, ShapeSampler, ShapeWeights, muscle_shapes, size_ratio, smoothed_normals,
};
use crate::{Point, Vector};

/// How a rig is built.
#[derive(Debug, Clone, PartialEq)]
pub struct RigOptions {
    /// How many nodes the patches have.
    pub resolution: Resolution,
    /// Shapes that move no node of a patch by this much are left out of it. (mm)
    pub threshold: f64,
    /// How patches follow the jaw.
    pub jaw_mode: JawMode,
    /// How skin weights are fitted.
    pub fit: FitOptions,
}

impl Default for RigOptions {
    fn default() -> Self {
        Self {
            resolution: Resolution::default(),
            threshold: 0.05,
            jaw_mode: JawMode::default(),
            fit: FitOptions::default(),
        }
    }
}

/// A face and its place on a template: what registration finds out.
#[derive(Debug, Clone)]
pub struct FaceOnTemplate<'a> {
    /// The user's mesh.
    pub face: &'a Mesh,
    /// From its units to the head frame in millimetres.
    pub to_head: Similarity3<f64>,
    /// The face in the template's topology. [mm, head frame]
    pub positions: &'a [Point],
    /// For each vertex of the mesh its place on `positions`.
    pub places: &'a [SurfacePoint],
    /// Pieces of the mesh that are not skin.
    pub rigid: &'a [RigidComponent],
    /// Report as JSON, kept with the rig.
    pub report: String,
}

impl<'a> FaceOnTemplate<'a> {
    /// What registration found out about a face.
    ///
    /// # Errors
    ///
    /// [`RigError::Content`] where the report cannot be written as JSON.
    pub fn from_registration(
        face: &'a Mesh,
        registration: &'a Registration,
    ) -> Result<Self, RigError> {
        let report =
            serde_json::to_string(&registration.report).map_err(|e| RigError::Content {
                reason: e.to_string(),
            })?;
        Ok(Self {
            face,
            to_head: registration.to_head,
            positions: &registration.positions,
            places: &registration.face_points,
            rigid: &registration.rigid_components,
            report,
        })
    }
}

/// Builds the rig of a face.
///
/// # Errors
///
/// [`RigError`] where sizes do not fit, or the template's layout cannot be laid.
pub fn build(
    on_template: &FaceOnTemplate<'_>,
    template: &Template,
    options: &RigOptions,
) -> Result<Rig, RigError> {
    let FaceOnTemplate {
        face,
        to_head,
        positions,
        places,
        rigid,
        ref report,
    } = *on_template;
    if positions.len() != template.skin.vertex_count() {
        return Err(RigError::PositionCount {
            expected: template.skin.vertex_count(),
            found: positions.len(),
        });
    }
    if places.len() != face.vertex_count() {
        return Err(RigError::PlaceCount {
            expected: face.vertex_count(),
            found: places.len(),
        });
    }
    let charts = anatomy::charts(template, options.resolution)?;
    let template_patches = anatomy::lay_patches(template, &charts, template.skin.positions())?;
    let patches = anatomy::lay_patches(template, &charts, positions)?;
    let shapes = muscle_shapes(template, &charts, options.threshold)?;

    let (hinge, jaw_scale) = fit_hinge(template, positions);
    let mut eyes = fit_eyes(template, positions);
    let in_head: Vec<Point> = face.positions().iter().map(|p| to_head * p).collect();
    let parts = name_parts(rigid, &in_head, &mut eyes);

    let jaw_shapes = JawShapes::of(template);
    let on_self = transfer_all(
        template,
        &template_patches,
        &template_patches,
        template.skin.positions(),
        shapes.clone(),
        &template.eyes,
    );
    let transfers = transfer_all(
        template,
        &template_patches,
        &patches,
        positions,
        shapes,
        &eyes,
    );

    let weights = fit_weights(template, &template_patches, &on_self, options);
    let is_rigid = rigid_mask(face.vertex_count(), &parts);
    let skin_places: Vec<Option<SurfacePoint>> = places
        .iter()
        .zip(&is_rigid)
        .map(|(place, rigid)| (!rigid).then_some(*place))
        .collect();
    let node_counts = patches.iter().map(|p| p.neutral.len() as u32).collect();
    let binding = SkinBinding::bind(
        &weights,
        &SmoothInterpolation::new(template),
        &skin_places,
        node_counts,
    )?;

    Ok(Rig {
        template: template.name.clone(),
        template_version: template.version,
        shape_names: template.shapes.iter().map(|s| s.name.clone()).collect(),
        face: face.clone(),
        to_head,
        positions: positions.to_vec(),
        patches: patches
            .into_iter()
            .zip(transfers)
            .map(|(patch, transfer)| RigPatch { patch, transfer })
            .collect(),
        binding,
        jaw: RigJaw {
            hinge,
            scale: jaw_scale,
            shapes: jaw_shapes,
            mode: options.jaw_mode,
        },
        eyes,
        eye_shapes: EyeShapes::of(template),
        parts,
        materials: template.materials.clone(),
        registration_report: report.clone(),
    })
}

/// Fits the skin weights of the template itself, which every face inherits.
///
/// # Errors
///
/// [`RigError`] where the template's layout cannot be laid.
pub fn template_weights(
    template: &Template,
    options: &RigOptions,
) -> Result<TemplateWeights, RigError> {
    let charts = anatomy::charts(template, options.resolution)?;
    let rest = template.skin.positions();
    let patches = anatomy::lay_patches(template, &charts, rest)?;
    let shapes = muscle_shapes(template, &charts, options.threshold)?;
    let transfers = transfer_all(template, &patches, &patches, rest, shapes, &template.eyes);
    Ok(fit_weights(template, &patches, &transfers, options))
}

/// Places of a template's own skin vertices on itself: registration that is exact.
pub fn places_of_self(template: &Template) -> Vec<SurfacePoint> {
    let mut places = vec![None; template.skin.vertex_count()];
    for (triangle, corners) in template.skin.triangles().iter().enumerate() {
        for (k, &v) in corners.iter().enumerate() {
            let mut barycentric = [0.0; 3];
            barycentric[k] = 1.0;
            places[v as usize].get_or_insert(SurfacePoint {
                triangle: triangle as u32,
                barycentric,
                point: template.skin.positions()[v as usize],
                distance: 0.0,
            });
        }
    }
    places
        .into_iter()
        .map(|place| {
            place.unwrap_or(SurfacePoint {
                triangle: 0,
                barycentric: [1.0, 0.0, 0.0],
                point: Point::origin(),
                distance: f64::INFINITY,
            })
        })
        .collect()
}

/// Puts the muscle shapes of every patch on a face.
fn transfer_all(
    template: &Template,
    template_patches: &[Patch],
    patches: &[Patch],
    positions: &[Point],
    shapes: Vec<Vec<MuscleShape>>,
    eyes: &[EyeSocket; 2],
) -> Vec<PatchTransfer> {
    let jaw_shapes = JawShapes::of(template);
    let closing = LidClosing::new(template, positions);
    let sampler = ShapeSampler::new(template);
    let sizes: Vec<f64> = template_patches
        .iter()
        .zip(patches)
        .map(|(on_template, on_face)| {
            let chart = &on_face.chart;
            size_ratio(
                chart.kind,
                chart.grid,
                &on_template.neutral,
                &on_face.neutral,
            )
        })
        .collect();
    let field = AlphaField::new(template, patches, &sizes);
    let corrections = closing.corrections(field.by_vertex());
    template_patches
        .iter()
        .zip(patches)
        .zip(shapes)
        .zip(sizes)
        .map(|(((on_template, on_face), mut shapes), alpha)| {
            let chart = &on_face.chart;
            let (from, to) = (&on_template.neutral, &on_face.neutral);
            let alphas: Vec<f64> = chart.nodes.iter().map(|node| field.at(node)).collect();
            let factors: Vec<f64> = alphas.iter().map(|a| a / alpha).collect();
            let deltas = |shape: Option<u32>| {
                let shape = shape?;
                let found = shapes.iter().find(|s| s.shape == shape)?;
                Some(found.deltas.as_slice())
            };
            let mut jaw = JawField::split(
                &template.jaw,
                from,
                deltas(jaw_shapes.open),
                deltas(jaw_shapes.close),
            );
            let lids = LidField::new(from, &template.eyes, to, eyes, &shapes, &alphas);
            if let Some(jaw) = &mut jaw {
                jaw.scale_residuals(&factors);
            }
            for shape in &mut shapes {
                for (delta, factor) in shape.deltas.iter_mut().zip(&factors) {
                    *delta *= *factor as f32;
                }
            }
            for (shape, corrections) in &corrections {
                let Some(muscle) = shapes.iter_mut().find(|s| s.shape == *shape) else {
                    continue;
                };
                for (delta, node) in muscle.deltas.iter_mut().zip(&chart.nodes) {
                    let correction: Vector = sampler.blend(node, corrections);
                    *delta += (correction / alpha).cast::<f32>();
                }
            }
            PatchTransfer {
                alpha,
                shapes,
                jaw,
                lids,
            }
        })
        .collect()
}

/// Poses the template's own patches in each of its shapes and fits the skin to that.
fn fit_weights(
    template: &Template,
    patches: &[Patch],
    transfers: &[PatchTransfer],
    options: &RigOptions,
) -> TemplateWeights {
    let triangles = template.skin.triangles();
    let normals = smoothed_normals(template.skin.positions(), &triangles, 0);
    let finder = CandidateFinder::new(template, &triangles, &normals, patches, &options.fit);
    let poser = TemplatePoser {
        template,
        transfers,
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
    fit_to_shapes(template, &normals, &finder, &poses, &options.fit)
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
        let context = crate::transfer::TransferContext {
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
        let pose = crate::transfer::JawPose::at(hinge, &self.jaw_shapes, 1.0, &weights);
        let (rotation, shift) = pose.affine(hinge);
        affines.push(NodeAffine {
            turn: (rotation - nalgebra::Matrix3::identity()).cast(),
            shift: shift.cast(),
        });
        let mut displacements = vec![nalgebra::Vector3::zeros(); self.template.skin.vertex_count()];
        for &(vertex, delta) in &self.template.shapes[shape].deltas {
            displacements[vertex as usize] = delta.cast();
        }
        Pose {
            affines,
            displacements,
        }
    }
}

fn rigid_mask(vertex_count: usize, parts: &[crate::rig::RigPart]) -> Vec<bool> {
    let mut mask = vec![false; vertex_count];
    for part in parts {
        for &v in &part.vertices {
            mask[v as usize] = true;
        }
    }
    mask
}
