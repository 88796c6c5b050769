//! The template's muscle shapes on the patches of a face: offsets, amplitudes, jaw and lids.

use nalgebra::Matrix3;

use crate::anatomy::Patch;
use crate::rig::RigError;
use crate::template::{EyeSocket, JawHinge, Template};
use crate::transfer::{
    AlphaField, AlphaMode, Amplitudes, Example, FaceOffsets, JawField, JawShapes, LidClosing,
    LidField, MuscleShape, Observation, OffsetMode, PatchEvidence, PatchTransfer, ShapeSampler,
    TURN_ALONE, check_examples, fit_alphas, fit_maps, fit_open_angle, jaw_with_shares,
    muscle_shapes_on_face, offsets_on_face, size_ratio,
};
use crate::{Point, Vector};

/// A face beside the template.
#[derive(Clone, Copy)]
pub(super) struct FaceSide<'a> {
    pub(super) template: &'a Template,
    /// As they lie on the template.
    pub(super) template_patches: &'a [Patch],
    /// As they lie under the face.
    pub(super) patches: &'a [Patch],
    /// The face in the template's topology. (mm)
    pub(super) positions: &'a [Point],
    /// The hinge of the face, with the template's angle.
    pub(super) hinge: &'a JawHinge,
    /// The eyes of the face.
    pub(super) eyes: &'a [EyeSocket; 2],
}

/// Muscle shapes on a face before any amplitude.
pub(super) struct ShapesOnFace<'a> {
    face: FaceSide<'a>,
    offsets: FaceOffsets,
    muscles: Vec<Vec<MuscleShape>>,
    /// What the patches do under the jaw: on the template, and on the face.
    template_jaws: Vec<Option<JawField>>,
    jaws: Vec<Option<JawField>>,
    /// Amplitude of each patch without examples.
    priors: Vec<f64>,
    /// Whether displacements are those of the template's own patches.
    is_of_template: bool,
    threshold: f64,
}

impl<'a> ShapesOnFace<'a> {
    /// Puts the shapes there.
    ///
    /// - `on_template`: the muscle shapes of the template
    /// - `threshold`: shapes that move no node of a patch by this much are left out (mm)
    pub(super) fn new(
        face: FaceSide<'a>,
        on_template: &[Vec<MuscleShape>],
        mode: OffsetMode,
        threshold: f64,
    ) -> Result<Self, RigError> {
        let jaw_shapes = JawShapes::of(face.template);
        // Who turns with the jaw, and how far, is the template's word: longer arms swing wider
        // by themselves.
        let jaws = split_jaws(
            &face.template.jaw,
            &jaw_shapes,
            on_template,
            face.template_patches,
        );
        let offsets = offsets_on_face(face.template, face.positions, mode)?;
        let pairs = face.template_patches.iter().zip(face.patches);
        let sizes = pairs.map(|(from, to)| {
            let chart = &to.chart;
            size_ratio(chart.kind, chart.grid, &from.neutral, &to.neutral)
        });
        let shapes = Self {
            face,
            offsets,
            muscles: on_template.to_vec(),
            template_jaws: jaws.clone(),
            jaws,
            priors: sizes.collect(),
            is_of_template: true,
            threshold,
        };
        if mode == OffsetMode::Global {
            Ok(shapes)
        } else {
            shapes.sampled_on_face()
        }
    }

    /// The muscle shapes of the offsets as they are on the face, which leave nothing to an
    /// amplitude of size.
    fn sampled_on_face(mut self) -> Result<Self, RigError> {
        let face = &self.face;
        let charts: Vec<_> = face.patches.iter().map(|p| p.chart.clone()).collect();
        self.muscles = muscle_shapes_on_face(
            face.template,
            face.positions,
            &self.offsets.deltas,
            &charts,
            self.threshold,
        )?;
        if let Some(maps) = &self.offsets.maps {
            let triangles = face.template.skin.triangles();
            // From the template anew: the maps are those of the whole way.
            self.jaws.clone_from(&self.template_jaws);
            for (jaw, chart) in self.jaws.iter_mut().zip(&charts) {
                let Some(jaw) = jaw else { continue };
                jaw.map_residuals(|node| {
                    let node = &chart.nodes[node];
                    let corners = triangles[node.triangle as usize].iter();
                    let shares = corners.zip(node.barycentric);
                    shares.map(|(&v, share)| maps[v as usize] * share).sum()
                });
            }
        }
        self.priors.fill(1.0);
        self.is_of_template = false;
        Ok(self)
    }

    /// The patch that displacements start from: the template's where they are the template's.
    fn origin(&self, patch: usize) -> &'a Patch {
        if self.is_of_template {
            &self.face.template_patches[patch]
        } else {
            &self.face.patches[patch]
        }
    }

    /// The transfer of every patch, and the angle of the jaw (rad): fitted to examples where
    /// there are some.
    pub(super) fn fitted(
        mut self,
        examples: &[Example],
        mode: AlphaMode,
    ) -> Result<(Vec<PatchTransfer>, f64), RigError> {
        if examples.is_empty() || mode == AlphaMode::Size {
            return Ok((self.transfers(&self.even()), self.face.hinge.open_angle));
        }
        let template = self.face.template;
        check_examples(
            examples,
            template.shapes.len(),
            template.skin.vertex_count(),
        )?;
        let jaw_shapes = JawShapes::of(template);
        if matches!(mode, AlphaMode::Map | AlphaMode::Own) {
            let sized: Vec<Matrix3<f64>> = self
                .field_of(&self.priors)
                .by_vertex()
                .iter()
                .map(|alpha| Matrix3::identity() * *alpha)
                .collect();
            let offsets = self.offsets.mapped(sized);
            let maps = fit_maps(template, &jaw_shapes, &offsets.deltas, examples);
            self.offsets = offsets.mapped(maps);
            if mode == AlphaMode::Own {
                self.take_own_shapes(examples);
            }
            self = self.sampled_on_face()?;
        }
        let (amplitudes, open_angle) = self.fit(examples, mode);
        let is_jaw = |example: &Example| {
            let shape = example.shape().map(|shape| shape as u32);
            shape.is_some() && shape == jaw_shapes.open
        };
        let hinge = JawHinge {
            open_angle,
            ..*self.face.hinge
        };
        if mode == AlphaMode::Own && examples.iter().any(is_jaw) {
            self.jaws = split_jaws(&hinge, &jaw_shapes, &self.muscles, self.face.patches);
        } else if amplitudes.jaw.iter().any(|shares| *shares != TURN_ALONE) {
            self.jaws = self.jaws_with_shares(&amplitudes, &hinge, &jaw_shapes);
        }
        Ok((self.transfers(&amplitudes), open_angle))
    }

    /// The patches under the jaw with fitted shares, which neighbours have alike where they meet.
    fn jaws_with_shares(
        &self,
        amplitudes: &Amplitudes,
        hinge: &JawHinge,
        jaw_shapes: &JawShapes,
    ) -> Vec<Option<JawField>> {
        let FaceSide {
            template, patches, ..
        } = self.face;
        let with_jaw = || (0..patches.len()).filter(|&p| self.jaws[p].is_some());
        // Fields are about 1.
        let turn = with_jaw().map(|p| (&patches[p], amplitudes.jaw[p][0]));
        let turn = AlphaField::new(template, turn);
        let straight = with_jaw().map(|p| (&patches[p], 1.0 + amplitudes.jaw[p][1]));
        let straight = AlphaField::new(template, straight);
        let of_patches = self.field_of(&amplitudes.by_patch);
        self.evidence()
            .iter()
            .zip(patches)
            .map(|(evidence, patch)| {
                let nodes = &patch.chart.nodes;
                let shares: Vec<[f64; 2]> = nodes
                    .iter()
                    .map(|node| [turn.at(node), straight.at(node) - 1.0])
                    .collect();
                let mut jaw = jaw_with_shares(evidence, hinge, jaw_shapes, &shares)?;
                // What is besides the turn is whole already; amplitudes will scale it.
                let factors: Vec<f64> = nodes.iter().map(|n| 1.0 / of_patches.at(n)).collect();
                jaw.scale_residuals(&factors);
                Some(jaw)
            })
            .collect()
    }

    /// The patches before any amplitude.
    fn evidence(&self) -> Vec<PatchEvidence<'_>> {
        (0..self.face.patches.len())
            .map(|p| PatchEvidence {
                neutral: &self.face.patches[p].neutral,
                shapes: &self.muscles[p],
                jaw: self.jaws[p].as_ref(),
                prior: self.priors[p],
            })
            .collect()
    }

    /// The face's own shapes in the place of the template's, where it has them.
    fn take_own_shapes(&mut self, examples: &[Example]) {
        for example in examples {
            let Some(shape) = example.shape() else {
                continue;
            };
            let own = example.deltas.iter().zip(&example.is_seen);
            for (delta, (own, is_seen)) in self.offsets.deltas[shape].iter_mut().zip(own) {
                if *is_seen {
                    *delta = *own;
                }
            }
        }
    }

    fn field_of(&self, alphas: &[f64]) -> AlphaField {
        let pairs = self.face.patches.iter().zip(alphas.iter().copied());
        AlphaField::new(self.face.template, pairs)
    }

    /// Amplitudes without examples.
    pub(super) fn even(&self) -> Amplitudes {
        Amplitudes::even(self.priors.clone(), &self.muscles)
    }

    /// Amplitudes and the jaw's angle (rad) from expressions of the face.
    fn fit(&self, examples: &[Example], mode: AlphaMode) -> (Amplitudes, f64) {
        let face = &self.face;
        let sampler = ShapeSampler::on(face.template, face.positions);
        let observations: Vec<Observation> = examples
            .iter()
            .map(|example| {
                let sampled = sampler.sample_deltas(example.deltas.clone());
                let is_seen = |triangle: u32| {
                    let corners = sampler.triangles()[triangle as usize];
                    corners.iter().all(|&v| example.is_seen[v as usize])
                };
                let of_patch = |patch: &Patch| {
                    let deltas = sampler.patch_deltas(&sampled, &patch.chart);
                    let nodes = patch.chart.nodes.iter().zip(deltas);
                    nodes
                        .map(|(node, delta)| is_seen(node.triangle).then_some(delta))
                        .collect()
                };
                Observation {
                    weights: example.weights.clone(),
                    deltas: face.patches.iter().map(of_patch).collect(),
                }
            })
            .collect();
        let evidence = self.evidence();
        let jaw_shapes = JawShapes::of(face.template);
        let open_angle = fit_open_angle(face.hinge, &jaw_shapes, &evidence, &observations);
        let hinge = JawHinge {
            open_angle,
            ..*face.hinge
        };
        let amplitudes = fit_alphas(&hinge, &jaw_shapes, &evidence, &observations, mode);
        (amplitudes, open_angle)
    }

    /// The transfer of every patch.
    pub(super) fn transfers(&self, amplitudes: &Amplitudes) -> Vec<PatchTransfer> {
        let FaceSide {
            template,
            patches,
            positions,
            ..
        } = self.face;
        let sampler = ShapeSampler::new(template);
        let of_patches = self.field_of(&amplitudes.by_patch);
        let mut pairs = amplitudes.by_patch.iter().zip(&amplitudes.by_shape);
        let is_even = pairs.all(|(alpha, by_shape)| by_shape.iter().all(|a| a == alpha));
        // Neighbouring patches share one amplitude where they meet, shape by shape.
        let by_shape: Vec<Option<AlphaField>> = (0..template.shapes.len() as u32)
            .map(|shape| {
                let of_patch = |p: usize| {
                    let place = self.muscles[p].iter().position(|s| s.shape == shape)?;
                    Some((&patches[p], amplitudes.by_shape[p][place]))
                };
                let known: Vec<_> = (0..patches.len()).filter_map(of_patch).collect();
                (!is_even).then(|| AlphaField::new(template, known))
            })
            .collect();
        let field = |shape: u32| by_shape[shape as usize].as_ref().unwrap_or(&of_patches);
        let closing = LidClosing::new(template, positions);
        let corrections = closing.corrections(|shape, v| {
            self.offsets.deltas[shape as usize][v] * field(shape).by_vertex()[v]
        });
        (0..patches.len())
            .map(|p| {
                let patch = &patches[p];
                let chart = &patch.chart;
                let alpha = amplitudes.by_patch[p];
                let mut shapes = self.muscles[p].clone();
                let lids = LidField::new(
                    &self.origin(p).neutral,
                    if self.is_of_template {
                        &template.eyes
                    } else {
                        self.face.eyes
                    },
                    &patch.neutral,
                    self.face.eyes,
                    &shapes,
                    |node, shape| field(shapes[shape].shape).at(&chart.nodes[node]),
                );
                let mut jaw = self.jaws[p].clone();
                if let Some(jaw) = &mut jaw {
                    let nodes = chart.nodes.iter();
                    let factors: Vec<f64> = nodes.map(|node| of_patches.at(node) / alpha).collect();
                    jaw.scale_residuals(&factors);
                }
                for shape in &mut shapes {
                    let field = field(shape.shape);
                    for (delta, node) in shape.deltas.iter_mut().zip(&chart.nodes) {
                        *delta *= (field.at(node) / alpha) as f32;
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
                    held: Vec::new(),
                }
            })
            .collect()
    }
}

/// What the patches do under the jaw, from their muscle shapes.
fn split_jaws(
    hinge: &JawHinge,
    jaw: &JawShapes,
    muscles: &[Vec<MuscleShape>],
    patches: &[Patch],
) -> Vec<Option<JawField>> {
    let pairs = muscles.iter().zip(patches);
    pairs
        .map(|(shapes, patch)| {
            let deltas = |shape: Option<u32>| {
                let found = shapes.iter().find(|s| Some(s.shape) == shape)?;
                Some(found.deltas.as_slice())
            };
            JawField::split(hinge, &patch.neutral, deltas(jaw.open), deltas(jaw.close))
        })
        .collect()
}
