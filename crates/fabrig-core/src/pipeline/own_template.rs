//! A template made of a rig that somebody has: their neutral face and its shapes.
//!
//! The neutral is registered to a template that is there already; the new one has that one's
//! topology, labels, landmarks and patch layout, the registered face as its skin, and the
//! face's own shapes, carried over through the registration. What the face has no shape for,
//! and skin that its mesh lacks, takes the old template's by deformation transfer.
//!
//! Templates are mirror images of themselves, so what is not alike on both sides is averaged.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use crate::mesh::{Mesh, Topology};
use crate::registration::{
    Progress, Registration, RegistrationOptions, RegistrationReport, register,
};
use crate::rig::{Expression, FaceOnTemplate, Rig, RigOptions, build, carry_expressions};
use crate::template::{EyeSocket, JawHinge, RigidBody, Template, WholeFaceShape};
use crate::transfer::{AlphaMode, Example, OffsetMode, offsets_on_face};
use crate::{Error, Point, Vector};

/// Shapes of the left and of the right meet in a blend this wide to each side. (mm)
const SIDE_BLEND: f64 = 10.0;
/// Displacements below this are left out. (mm)
const STILL: f64 = 0.01;
/// Rounds by which the difference from the old template's shape spreads into unseen skin.
const SPREAD_ROUNDS: usize = 80;

/// How a template is made of a face.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnTemplateOptions {
    /// Name of the template.
    pub name: String,
    /// Whose work the face and its shapes are.
    pub credit: String,
    /// How the face is registered.
    pub registration: RegistrationOptions,
}

/// A template that was made of a face.
#[derive(Debug, Clone)]
pub struct OwnTemplate {
    /// The template, without skin weights.
    pub template: Template,
    /// What registration measured.
    pub report: RegistrationReport,
    /// Shapes that are the face's own.
    pub own: Vec<String>,
    /// Shapes that the face lacks: the old template's, put on the face.
    pub borrowed: Vec<String>,
    /// How far the face was from its own mirror image, in the mean. (mm)
    pub asymmetry_mm: f64,
}

/// Makes a template of a neutral face and its shapes.
///
/// - `base`: the template whose topology and layout the new one takes over
///
/// # Errors
///
/// [`Error::Registration`] where the face is refused, [`Error::Transfer`] and [`Error::Rig`]
/// where its shapes do not fit it.
pub fn template_from_face(
    face: &Mesh,
    expressions: &[Expression],
    base: &Template,
    options: &OwnTemplateOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<OwnTemplate, Error> {
    let registration = register(face, base, &options.registration, progress)?;
    let examples = carry_expressions(face, &registration, base, expressions)?;
    let mirror = Mirror(&base.mirror);
    let positions = mirror.symmetric_points(&registration.positions);
    let pairs = positions.iter().zip(&registration.positions);
    let asymmetry: f64 = pairs.map(|(p, q)| (p - q).norm()).sum();
    let rig = own_rig(face, &registration, base, &examples)?;

    let borrowed = offsets_on_face(base, &positions, OffsetMode::DeformationTransfer)?.deltas;
    let own = own_shapes(base, &examples, &borrowed, &positions);
    let shape_of = |shape: usize| {
        let partner = mirrored_shape(base, shape);
        let one = own.get(&shape);
        let other = own.get(&partner).map(|deltas| mirror.image(deltas));
        let deltas = match (one, other) {
            (Some(one), Some(other)) => mean(one, &other),
            (Some(one), None) => one.clone(),
            (None, Some(other)) => other,
            (None, None) => mean(&borrowed[shape], &mirror.image(&borrowed[partner])),
        };
        WholeFaceShape {
            name: base.shapes[shape].name.clone(),
            deltas: (0u32..)
                .zip(deltas)
                .filter(|(_, delta)| delta.norm() >= STILL)
                .collect(),
        }
    };
    let count = base.shapes.len();
    let is_own = |s: &usize| own.contains_key(s) || own.contains_key(&mirrored_shape(base, *s));
    let names = |is_wanted: bool| -> Vec<String> {
        let of = (0..count).filter(|s| is_own(s) == is_wanted);
        of.map(|s| base.shapes[s].name.clone()).collect()
    };
    let eyes = symmetric_eyes(&rig.eyes);
    let jaw_scale = rig.jaw.scale;
    let hinge = &rig.jaw.hinge;
    let mut template = Template {
        name: options.name.clone(),
        version: 1,
        credit: format!(
            "{}\nTopology, landmarks, regions, muscles, teeth and tongue of the template {}: {}",
            options.credit, base.name, base.credit
        ),
        skin: base.skin.with_positions(positions.clone())?,
        shapes: (0..count).map(shape_of).collect(),
        jaw: JawHinge {
            center: Point::new(0.0, hinge.center.y, hinge.center.z),
            axis: Vector::x(),
            open_angle: hinge.open_angle,
            forward: base.jaw.forward * jaw_scale,
            left: base.jaw.left * jaw_scale,
        },
        eyes,
        skin_weights: Vec::new(),
        ..base.clone()
    };
    move_parts(&mut template, base)?;
    Ok(OwnTemplate {
        template,
        own: names(true),
        borrowed: names(false),
        asymmetry_mm: asymmetry / positions.len().max(1) as f64,
        report: registration.report,
    })
}

/// The face with its own shapes as a rig: its eyes, and how far its jaw opens.
fn own_rig(
    face: &Mesh,
    registration: &Registration,
    base: &Template,
    examples: &[Example],
) -> Result<Rig, Error> {
    let mut on_template = FaceOnTemplate::from_registration(face, registration)?;
    on_template.examples = examples;
    let options = RigOptions {
        alpha: AlphaMode::Own,
        ..RigOptions::default()
    };
    Ok(build(&on_template, base, &options)?)
}

/// The face's own shapes by their index, on all of the template's vertices. (mm)
fn own_shapes(
    base: &Template,
    examples: &[Example],
    borrowed: &[Vec<Vector>],
    positions: &[Point],
) -> BTreeMap<usize, Vec<Vector>> {
    let topology = Topology::from_mesh(&base.skin);
    let mut own = BTreeMap::new();
    for example in examples {
        let active: Vec<usize> = (0..example.weights.len())
            .filter(|&s| example.weights[s] == 1.0)
            .collect();
        let is_whole = example.weights.iter().all(|w| *w == 0.0 || *w == 1.0);
        match active[..] {
            [shape] if is_whole => {
                let deltas = filled(&topology, example, &example.deltas, &borrowed[shape]);
                own.insert(shape, deltas);
            }
            // Both sides in one mesh: each takes its half.
            [a, b] if is_whole && mirrored_shape(base, a) == b => {
                for shape in [a, b] {
                    let sign = if base.shapes[shape].name.ends_with("Left") {
                        1.0
                    } else {
                        -1.0
                    };
                    let share = |p: &Point| {
                        let t = (sign * p.x / SIDE_BLEND).clamp(-1.0, 1.0);
                        0.5 + 0.25 * t * (3.0 - t * t)
                    };
                    let pairs = example.deltas.iter().zip(positions);
                    let half: Vec<Vector> = pairs.map(|(d, p)| d * share(p)).collect();
                    let deltas = filled(&topology, example, &half, &borrowed[shape]);
                    own.entry(shape).or_insert(deltas);
                }
            }
            _ => {}
        }
    }
    own
}

/// Displacements with the gaps of unseen skin filled: the borrowed shape, and what the seen skin
/// around does otherwise, fading into them.
fn filled(
    topology: &Topology,
    example: &Example,
    own: &[Vector],
    borrowed: &[Vector],
) -> Vec<Vector> {
    let mut difference: Vec<Vector> = own
        .iter()
        .zip(borrowed)
        .zip(&example.is_seen)
        .map(|((own, borrowed), seen)| {
            if *seen {
                own - borrowed
            } else {
                Vector::zeros()
            }
        })
        .collect();
    let unseen: Vec<u32> = (0u32..)
        .zip(&example.is_seen)
        .filter(|(_, seen)| !**seen)
        .map(|(v, _)| v)
        .collect();
    for _ in 0..SPREAD_ROUNDS {
        let next: Vec<Vector> = unseen
            .iter()
            .map(|&v| {
                let around = topology.neighbours(v);
                let sum: Vector = around.iter().map(|&n| difference[n as usize]).sum();
                sum / around.len().max(1) as f64
            })
            .collect();
        for (&v, d) in unseen.iter().zip(next) {
            difference[v as usize] = d;
        }
    }
    let pairs = borrowed.iter().zip(&difference);
    pairs.map(|(borrowed, by)| borrowed + by).collect()
}

/// Eyeballs, teeth and tongue go to where the new skin has room for them.
fn move_parts(template: &mut Template, base: &Template) -> Result<(), Error> {
    let around = |region: &str| -> Vec<usize> {
        let id = base.regions.find(region);
        let labels = base.regions.vertex_regions.iter().enumerate();
        labels
            .filter(|(_, r)| Some(**r) == id)
            .map(|(v, _)| v)
            .collect()
    };
    let upper = around("mouth_interior_upper");
    let lower = around("mouth_interior_lower");
    let mut scales = Vec::new();
    for (part, old) in template.rigid_parts.iter_mut().zip(&base.rigid_parts) {
        let (from, to, scale) = match part.follows {
            RigidBody::EyeLeft | RigidBody::EyeRight => {
                let eye = usize::from(part.follows == RigidBody::EyeRight);
                let (from, to) = (&base.eyes[eye], &template.eyes[eye]);
                (from.center, to.center, to.radius / from.radius)
            }
            RigidBody::Skull => fit(&upper, base, &template.skin),
            RigidBody::Mandible => fit(&lower, base, &template.skin),
        };
        let moved = old.mesh.positions().iter();
        let moved = moved.map(|p| to + (p - from) * scale).collect();
        part.mesh = old.mesh.with_positions(moved)?;
        scales.push(scale);
    }
    for (_, part, deltas) in &mut template.part_deltas {
        let scale = scales.get(*part as usize).copied().unwrap_or(1.0);
        deltas.iter_mut().for_each(|d| *d *= scale);
    }
    Ok(())
}

/// The move and growth of some vertices: centres before and after, and the ratio of their
/// root mean square distances from them.
fn fit(vertices: &[usize], base: &Template, skin: &Mesh) -> (Point, Point, f64) {
    let center = |p: &[Point]| {
        let sum: Vector = vertices.iter().map(|&v| p[v].coords).sum();
        Point::from(sum / vertices.len().max(1) as f64)
    };
    let (before, after) = (base.skin.positions(), skin.positions());
    let (from, to) = (center(before), center(after));
    let size = |p: &[Point], c: Point| -> f64 {
        vertices
            .iter()
            .map(|&v| (p[v] - c).norm_squared())
            .sum::<f64>()
            .sqrt()
    };
    let ratio = size(after, to) / size(before, from);
    (from, to, if ratio.is_finite() { ratio } else { 1.0 })
}

fn symmetric_eyes(eyes: &[EyeSocket; 2]) -> [EyeSocket; 2] {
    let [left, right] = eyes;
    let across = Point::new(-right.center.x, right.center.y, right.center.z);
    let left = EyeSocket {
        center: nalgebra::center(&left.center, &across),
        radius: 0.5 * (left.radius + right.radius),
        look_angles: left.look_angles,
    };
    let c = left.center;
    [
        left,
        EyeSocket {
            center: Point::new(-c.x, c.y, c.z),
            ..left
        },
    ]
}

/// The shape that does on the other side what this one does.
fn mirrored_shape(base: &Template, shape: usize) -> usize {
    let name = base.shapes[shape].name.as_str();
    let other = match (name.strip_suffix("Left"), name.strip_suffix("Right")) {
        (Some(stem), _) => format!("{stem}Right"),
        (_, Some(stem)) => format!("{stem}Left"),
        _ => return shape,
    };
    base.shape_index(&other).unwrap_or(shape)
}

fn mean(a: &[Vector], b: &[Vector]) -> Vec<Vector> {
    a.iter().zip(b).map(|(a, b)| (a + b) / 2.0).collect()
}

/// For each vertex its mirror image.
struct Mirror<'a>(&'a [u32]);

impl Mirror<'_> {
    fn image(&self, deltas: &[Vector]) -> Vec<Vector> {
        let of = |&v: &u32| {
            let d = deltas[v as usize];
            Vector::new(0.0 - d.x, d.y, d.z)
        };
        self.0.iter().map(of).collect()
    }

    /// Each point and the mirror image of its partner, averaged: exact mirror images.
    fn symmetric_points(&self, points: &[Point]) -> Vec<Point> {
        let mut out = points.to_vec();
        for (v, &image) in self.0.iter().enumerate() {
            let (p, q) = (points[v], points[image as usize]);
            let left = Point::new(0.5 * (p.x - q.x), 0.5 * (p.y + q.y), 0.5 * (p.z + q.z));
            if v <= image as usize {
                out[image as usize] = Point::new(0.0 - left.x, left.y, left.z);
                out[v] = left;
            }
        }
        out
    }
}
