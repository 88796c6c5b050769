//! The rig: a face that is ready to move, saved and loaded as one file.
//!
//! [`build`] assembles it from a face mesh, its place on the template and the template; it
//! knows nothing of time. [`Rig::targets`] evaluates Eq. 3 for all patches.

mod assemble;
mod close_lids;
mod error;
mod expressions;
mod file;
mod parts;
mod put_on_face;
mod refine_skin;
mod sockets;
mod template_side;
mod tongue;

pub use assemble::{FaceOnTemplate, RigOptions, build, places_of_self, rig_of_template};
pub use error::RigError;
pub use expressions::{Expression, carry_expressions};
pub use file::{FORMAT_VERSION, OLDEST_VERSION};
pub use parts::RigPart;
pub use refine_skin::{FOLDING_PATCHES, SkinRefinement, refine_on_template, refined_face};
pub(crate) use refine_skin::{RING_SHARE, is_called};
pub use template_side::{fit_template_weights, stored_template_weights, write_template_weights};
pub use tongue::PartShape;

use std::path::Path;

use nalgebra::{Point3, Similarity3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Point;
use crate::anatomy::{GridShape, Patch};
use crate::cloth::NodeVariation;
use crate::mesh::Mesh;
use crate::mesh::appearance::Appearance;
use crate::skin::{NodeAffine, SkinBinding};
use crate::template::{EyeSocket, JawHinge, RegionId};
use crate::transfer::{
    EyeShapes, JawMode, JawPose, JawShapes, PatchTransfer, ShapeWeights, TransferContext,
    TransferError,
};

/// Where Eq. 3 puts the nodes of a patch: positions [mm, head frame], velocities (mm/s).
pub type NodeTargets = (Vec<Point3<f32>>, Vec<Vector3<f32>>);

/// The lower jaw of a face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigJaw {
    /// Its hinge.
    pub hinge: JawHinge,
    /// Size against the template's, which scales its slides.
    pub scale: f64,
    /// Shapes that move it.
    pub shapes: JawShapes,
    /// How patches follow it.
    pub mode: JawMode,
}

/// A patch of a face with its muscle shapes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigPatch {
    /// The patch as it lies under this face. [mm, head frame]
    pub patch: Patch,
    /// Its shapes on this face.
    pub transfer: PatchTransfer,
}

/// A face that is ready to move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// Name of the template that it was made with.
    pub template: String,
    /// Version of that template's contents.
    pub template_version: u32,
    /// Names of the template's shapes, in the order of weights.
    pub shape_names: Vec<String>,
    /// The user's mesh, in its own units and vertex order.
    pub face: Mesh,
    /// From the mesh's units to the head frame in millimetres.
    pub to_head: Similarity3<f64>,
    /// The face in the template's topology. [mm, head frame]
    pub positions: Vec<Point>,
    /// Muscles and fat.
    pub patches: Vec<RigPatch>,
    /// Which nodes move which vertices of the face.
    pub binding: SkinBinding,
    /// The lower jaw.
    pub jaw: RigJaw,
    /// Left eye, right eye.
    pub eyes: [EyeSocket; 2],
    /// Shapes that turn the eyeballs.
    pub eye_shapes: [EyeShapes; 2],
    /// Pieces of the mesh that move rigidly: eyeballs, teeth, tongue.
    pub parts: Vec<RigPart>,
    /// Names of the template's regions.
    pub region_names: Vec<String>,
    /// Region of each vertex of the face; none where it is no skin.
    pub regions: Vec<Option<RegionId>>,
    /// Text of the template's `materials.toml`.
    pub materials: String,
    /// What registration reported about this face, as JSON; empty where there was none.
    pub registration_report: String,
    /// Materials and pictures of the face; none where the mesh came without.
    ///
    /// This and what follows is last, so that files of the version before read as faces without.
    pub appearance: Option<Appearance>,
    /// For each patch how its nodes differ from its material, one per node, or nothing where none
    /// does; empty where no patch has any.
    pub variations: Vec<Vec<NodeVariation>>,
}

impl Rig {
    /// Keeps the materials and pictures of the file that the face came from; returns what a
    /// person should know, such as a picture that is not there.
    ///
    /// # Errors
    ///
    /// [`RigError::Appearance`]: the file cannot be read, or holds another mesh.
    pub fn keep_appearance(&mut self, file: &Path) -> Result<Vec<String>, RigError> {
        let mut notes = Vec::new();
        let appearance = Appearance::of_file(file, &self.face, &mut notes)?;
        if appearance.is_empty() {
            // Then there is nothing to know but that.
            notes.clear();
        }
        self.appearance = (!appearance.is_empty()).then_some(appearance);
        Ok(notes)
    }

    /// As [`Self::keep_appearance`], for a face that was refined.
    ///
    /// - `coarse`: the mesh that it was refined from
    /// - `face_origins`: for each polygon of the face that of `coarse`
    ///
    /// # Errors
    ///
    /// [`RigError::Appearance`]: the file cannot be read, or holds another mesh.
    pub fn keep_appearance_of(
        &mut self,
        coarse: &Mesh,
        face_origins: &[u32],
        file: &Path,
    ) -> Result<Vec<String>, RigError> {
        let mut notes = Vec::new();
        let mut appearance = Appearance::of_file(file, coarse, &mut notes)?;
        if appearance.is_empty() {
            notes.clear();
        }
        if !appearance.of_polygon.is_empty() {
            let origins = face_origins.iter();
            appearance.of_polygon = origins
                .map(|&face| appearance.of_polygon[face as usize])
                .collect();
        }
        self.appearance = (!appearance.is_empty()).then_some(appearance);
        Ok(notes)
    }

    /// Index of a shape in lists of weights.
    pub fn shape_index(&self, name: &str) -> Option<usize> {
        self.shape_names.iter().position(|n| n == name)
    }

    /// Vertices of the face that lie in one of these regions, rising.
    pub fn vertices_in(&self, regions: &[&str]) -> Vec<u32> {
        let is_named = |region: &RegionId| {
            let name = self.region_names.get(region.0 as usize);
            name.is_some_and(|name| regions.contains(&name.as_str()))
        };
        let labels = (0u32..).zip(&self.regions);
        labels
            .filter(|(_, region)| region.as_ref().is_some_and(is_named))
            .map(|(vertex, _)| vertex)
            .collect()
    }

    /// Shapes that move nothing on this face, such as `tongueOut` where the mesh has no tongue.
    pub fn dead_shapes(&self) -> Vec<&str> {
        let is_of_eye = |shape: u32| {
            let looks = self.eye_shapes.iter().flat_map(|eye| eye.look);
            looks.flatten().any(|s| s == shape)
        };
        let moves = |shape: u32| {
            let of_patches = self.patches.iter().flat_map(|p| &p.transfer.shapes);
            let of_parts = self.parts.iter().flat_map(|p| &p.shapes);
            of_patches.map(|s| s.shape).any(|s| s == shape)
                || of_parts.map(|s| s.shape).any(|s| s == shape)
        };
        let names = self.shape_names.iter().enumerate();
        names
            .filter(|(shape, _)| !is_of_eye(*shape as u32) && !moves(*shape as u32))
            .map(|(_, name)| name.as_str())
            .collect()
    }

    /// Grid and neutral nodes of every patch. [mm, head frame]
    pub fn neutral_nodes(&self) -> Vec<(GridShape, Vec<Point3<f32>>)> {
        self.patches
            .iter()
            .map(|p| {
                let nodes = p.patch.neutral.iter().map(|q| q.cast()).collect();
                (p.patch.chart.grid, nodes)
            })
            .collect()
    }

    /// The user's mesh in the head frame. (mm), shape [face vertex_count]
    pub fn face_in_head(&self) -> Vec<Point> {
        let own = self.face.positions().iter();
        own.map(|p| self.to_head * p).collect()
    }

    /// As [`Self::face_in_head`], in the precision of the moving skin.
    pub fn skin_at_rest(&self) -> Vec<Point3<f32>> {
        self.face_in_head().iter().map(|p| p.cast()).collect()
    }

    /// What all patches share when Eq. 3 is evaluated.
    pub fn transfer_context(&self) -> TransferContext<'_> {
        TransferContext {
            hinge: &self.jaw.hinge,
            jaw_shapes: &self.jaw.shapes,
            jaw_mode: self.jaw.mode,
            eyes: &self.eyes,
        }
    }

    /// Checks weights before they are used: one per shape, all finite.
    ///
    /// # Errors
    ///
    /// [`TransferError::WeightCount`], [`TransferError::WeightNotFinite`].
    pub fn check_weights(&self, weights: &[f32]) -> Result<(), TransferError> {
        if weights.len() != self.shape_names.len() {
            return Err(TransferError::WeightCount {
                expected: self.shape_names.len(),
                found: weights.len(),
            });
        }
        match weights.iter().position(|w| !w.is_finite()) {
            None => Ok(()),
            Some(shape) => Err(TransferError::WeightNotFinite {
                shape,
                value: weights[shape],
            }),
        }
    }

    /// Eq. 3 on every patch: where the muscle shapes want the nodes, and how fast that moves.
    ///
    /// `out` holds one list of positions [mm, head frame] and one of velocities (mm/s) a
    /// patch; they are resized.
    ///
    /// # Errors
    ///
    /// [`TransferError`] where weights are not one finite number per shape, or `out` is not
    /// one buffer per patch.
    pub fn targets(
        &self,
        at: ShapeWeights<'_>,
        out: &mut [NodeTargets],
    ) -> Result<(), TransferError> {
        self.targets_of(at, |_| true, out)
    }

    /// As [`Self::targets`], of the patches of which `is_wanted` says so; the others are left as
    /// they are.
    ///
    /// # Errors
    ///
    /// As [`Self::targets`].
    pub fn targets_of(
        &self,
        at: ShapeWeights<'_>,
        is_wanted: impl Fn(usize) -> bool + Sync,
        out: &mut [NodeTargets],
    ) -> Result<(), TransferError> {
        self.check_weights(at.weights)?;
        if let Some(rates) = at.rates {
            self.check_weights(rates)?;
        }
        if out.len() != self.patches.len() {
            return Err(TransferError::PatchCount {
                expected: self.patches.len(),
                found: out.len(),
            });
        }
        let context = self.transfer_context();
        self.patches
            .par_iter()
            .zip(out)
            .enumerate()
            .filter(|(index, _)| is_wanted(*index))
            .for_each(|(_, (patch, (positions, velocities)))| {
                let neutral: Vec<Point3<f32>> =
                    patch.patch.neutral.iter().map(|q| q.cast()).collect();
                positions.resize(neutral.len(), Point3::origin());
                velocities.resize(neutral.len(), Vector3::zeros());
                patch
                    .transfer
                    .evaluate(&context, &neutral, at, positions, velocities);
            });
        Ok(())
    }

    /// Where the mandible stands under the given weights.
    pub fn jaw_pose(&self, weights: &[f32]) -> JawPose {
        JawPose::at(&self.jaw.hinge, &self.jaw.shapes, self.jaw.scale, weights)
    }

    /// What the mandible does to space under the given weights.
    pub fn mandible(&self, weights: &[f32]) -> NodeAffine {
        let pose = self.jaw_pose(weights);
        if pose.angle == 0.0 && pose.slide == crate::Vector::zeros() {
            return NodeAffine::identity();
        }
        let (rotation, shift) = pose.affine(&self.jaw.hinge);
        NodeAffine {
            turn: (rotation - nalgebra::Matrix3::identity()).cast(),
            shift: shift.cast(),
        }
    }
}
