//! A face as every format wants it: rest vertices in the unit of the file, polygons, texture
//! coordinates, sections of one material.

use nalgebra::{Isometry3, Similarity3, Translation3, UnitQuaternion, Vector3};

use super::LengthUnit;
use crate::mesh::appearance::Appearance;
use crate::mesh::{CornerUvs, Mesh, Polygons, vertex_normals};
use crate::{Point, Vector};

/// Lengths that a mesh's unit is taken for when it is this near to them: its scale is measured
/// on the face, and faces differ. (mm)
const USUAL_UNITS: [f64; 5] = [1.0, 10.0, 25.4, 100.0, 1000.0];
const UNIT_TOLERANCE: f64 = 0.25;

/// From the head frame to the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    /// From the user's units and place to the head frame. (mm)
    to_head: Similarity3<f64>,
    /// From the user's unit to the file's.
    factor: f64,
    /// Length of one unit of the file. (mm)
    pub(super) millimetres_per_unit: f64,
    /// Millimetres at true head size in one unit of the file: differs from the above where the
    /// head is larger or smaller than it says.
    true_millimetres: f64,
}

impl Placement {
    /// - `to_head`: from the user's mesh to the head frame (mm)
    pub(super) fn new(to_head: Similarity3<f64>, unit: LengthUnit) -> Self {
        let scale = to_head.scaling();
        let near = |usual: &f64| (scale / usual - 1.0).abs() <= UNIT_TOLERANCE;
        let own = USUAL_UNITS.into_iter().find(near).unwrap_or(scale);
        let millimetres_per_unit = unit.millimetres(own);
        let factor = own / millimetres_per_unit;
        Self {
            to_head,
            factor,
            millimetres_per_unit,
            true_millimetres: scale / factor,
        }
    }

    /// A place of the user's mesh in the file.
    pub(super) fn point(&self, own: &Point) -> Point {
        own * self.factor
    }

    /// A displacement of the head frame (mm) in the file.
    pub(super) fn offset(&self, millimetres: &Vector) -> Vector {
        let turned = self.to_head.isometry.rotation.inverse() * millimetres;
        turned / self.true_millimetres
    }

    /// Length in the head frame of an offset in the file. (mm)
    pub(super) fn length(&self, offset: &Vector) -> f64 {
        offset.norm() * self.true_millimetres
    }

    /// A motion of the head (mm) as one of the file's space.
    pub(super) fn motion(&self, head: &Isometry3<f64>) -> Isometry3<f64> {
        let to_head = self.to_head.isometry.rotation;
        let rotation = to_head.inverse() * head.rotation * to_head;
        // Where the file's origin goes.
        let origin = self.to_head * Point::origin();
        let shift = self.offset(&(head * origin - origin));
        Isometry3::from_parts(
            Translation3::from(shift),
            UnitQuaternion::new_normalize(rotation.into_inner()),
        )
    }
}

/// Polygons of one material.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Section {
    /// Name of the material.
    pub(super) name: String,
    /// Its index in [`Appearance::materials`].
    pub(super) material: usize,
    /// Polygons of the face, rising.
    pub(super) polygons: Vec<u32>,
}

/// A face at rest.
#[derive(Debug, Clone)]
pub(super) struct ExportFace {
    pub(super) name: String,
    pub(super) placement: Placement,
    /// In the file's unit.
    pub(super) positions: Vec<Point>,
    pub(super) polygons: Polygons,
    pub(super) uvs: Option<CornerUvs>,
    pub(super) sections: Vec<Section>,
    pub(super) appearance: Appearance,
    triangles: Vec<[u32; 3]>,
}

impl ExportFace {
    pub(super) fn new(
        name: &str,
        mesh: &Mesh,
        placement: Placement,
        appearance: Appearance,
    ) -> Self {
        let mut sections: Vec<Section> = appearance
            .materials
            .iter()
            .enumerate()
            .map(|(material, of)| Section {
                name: of.name.clone(),
                material,
                polygons: Vec::new(),
            })
            .collect();
        for (polygon, &material) in (0u32..).zip(&appearance.of_polygon) {
            sections[material as usize].polygons.push(polygon);
        }
        sections.retain(|section| !section.polygons.is_empty());
        Self {
            name: name.to_owned(),
            placement,
            positions: mesh
                .positions()
                .iter()
                .map(|p| placement.point(p))
                .collect(),
            polygons: mesh.polygons().clone(),
            uvs: mesh.uvs().cloned(),
            sections,
            appearance,
            triangles: mesh.triangles(),
        }
    }

    /// Unit normals with every vertex moved by an offset; those of no polygon look up.
    pub(super) fn normals(&self, positions: &[Point]) -> Vec<Vector> {
        let mut normals = vertex_normals(positions, &self.triangles);
        for normal in normals.iter_mut().filter(|n| **n == Vector::zeros()) {
            *normal = Vector::y();
        }
        normals
    }

    /// Vertices of the face displaced by a frame.
    ///
    /// - `with_head`: whether head motion moves them too
    pub(super) fn moved(&self, frame: &Frame, with_head: bool) -> Vec<Point> {
        let pairs = self.positions.iter().zip(&frame.offsets);
        pairs
            .map(|(p, offset)| {
                let moved = p + offset;
                if with_head { frame.head * moved } else { moved }
            })
            .collect()
    }
}

/// A shape: how vertices move at weight 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    pub(super) name: String,
    /// Vertices that move and their offsets, in the file's unit, rising.
    pub(super) offsets: Vec<(u32, Vector)>,
}

/// Shapes over time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WeightAnimation {
    pub(super) name: String,
    /// Rising from 0. (s)
    pub(super) times: Vec<f64>,
    /// Frames a second.
    pub(super) fps: f64,
    /// A weight for every shape, in their order, frame by frame.
    pub(super) weights: Vec<Vec<f32>>,
    /// Where the head is, in the file's space; empty where it stays.
    pub(super) heads: Vec<Isometry3<f64>>,
}

/// Vertices at one instant.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    /// From the first frame's. (s)
    pub(super) time: f64,
    /// From rest, without head motion, in the file's unit.
    pub(super) offsets: Vec<Vector>,
    /// Where the head is, in the file's space.
    pub(super) head: Isometry3<f64>,
}

/// Numbers as formats keep them.
pub(super) fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(scale: f64, unit: LengthUnit) -> Placement {
        let rotation = UnitQuaternion::from_euler_angles(0.3, -0.8, 0.1);
        let translation = Translation3::new(4.0, -7.0, 90.0);
        Placement::new(Similarity3::from_parts(translation, rotation, scale), unit)
    }

    #[test]
    fn the_unit_is_the_usual_one_nearby() {
        // A head of 1.04 true size in metres stays where it stands among its neighbours.
        let metres = placed(1040.0, LengthUnit::Metre);
        assert_eq!(metres.point(&Point::new(1.0, 2.0, 3.0)).y, 2.0);
        assert_eq!(metres.millimetres_per_unit, 1000.0);
        let inches = placed(25.0, LengthUnit::Centimetre);
        assert!((inches.point(&Point::new(1.0, 0.0, 0.0)).x - 2.54).abs() < 1e-12);
        let strange = placed(330.0, LengthUnit::Own);
        assert_eq!(strange.millimetres_per_unit, 330.0);
    }

    #[test]
    fn offsets_and_motions_are_those_of_the_head_frame() {
        let placement = placed(9.3, LengthUnit::Metre);
        let own = Point::new(1.5, -20.0, 3.0);
        let head = Isometry3::new(Vector::new(3.0, 1.0, -8.0), Vector::new(0.1, 0.4, -0.2));
        let moved = head * (placement.to_head * own);
        let want = placement.point(&(placement.to_head.inverse() * moved));
        let got = placement.motion(&head) * placement.point(&own);
        assert!((got - want).norm() < 1e-12, "{got} {want}");
        let delta = Vector::new(1.0, 2.0, -3.0);
        let nudged = placement.to_head.inverse() * (placement.to_head * own + delta);
        let offset = placement.point(&nudged) - placement.point(&own);
        assert!((placement.offset(&delta) - offset).norm() < 1e-12);
        assert!((placement.length(&offset) - delta.norm()).abs() < 1e-9);
    }
}
