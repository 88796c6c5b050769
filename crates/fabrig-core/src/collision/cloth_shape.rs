//! Cloth against shapes of the world: the one place here that speaks parry.
//!
//! A shape answers two questions in its own coordinates: where its surface is nearest to a
//! point, and on which side of it the point lies. Shapes with flat faces also have a mesh,
//! whose vertices, edges and triangles collide with those of the cloth, so that a corner
//! cannot slip between two nodes.

use parry3d::math::Vector as ParryVector;
use parry3d::shape::{
    Ball, Capsule, ConvexPolyhedron, Cuboid, HalfSpace, Shape, TriMesh, TriMeshFlags,
};

use super::{ColliderShape, CollisionError, StarSurface};
use crate::{Point, Vector};

/// Divisions around the mesh of a round shape.
const AROUND: u32 = 20;

/// What answers.
enum Solid {
    Parry(Box<dyn Shape>),
    Star(StarSurface),
}

/// A shape with its mesh.
pub(crate) struct WorldShape {
    solid: Solid,
    /// Whether its surface is smooth, so that nodes are held out of it one by one.
    pub(crate) is_round: bool,
    /// Vertices and triangles: its surface, for a round one inside it; empty for a plane.
    pub(crate) mesh: (Vec<Point>, Vec<[u32; 3]>),
    /// Radius about its origin; infinite for a plane. (mm)
    pub(crate) radius: f64,
}

impl std::fmt::Debug for WorldShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WorldShape")
            .field("triangle_count", &self.mesh.1.len())
            .field("radius", &self.radius)
            .finish_non_exhaustive()
    }
}

/// The nearest place on the surface of a shape.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfacePlace {
    /// Distance to the surface, negative inside. (mm)
    pub(crate) distance: f64,
    /// Outward unit direction; none where the point lies on the surface.
    pub(crate) normal: Option<Vector>,
}

impl WorldShape {
    /// Makes parry's shape of a description that has been checked.
    ///
    /// # Errors
    ///
    /// [`CollisionError::Collider`] where points span no volume or a mesh is not closed.
    pub(crate) fn new(
        description: &ColliderShape,
        index: usize,
        name: &str,
    ) -> Result<Self, CollisionError> {
        let refuse = |reason: String| CollisionError::Collider {
            index,
            name: name.to_owned(),
            reason,
        };
        let mut mesh = (Vec::new(), Vec::new());
        let (shape, radius): (Box<dyn Shape>, f64) = match description {
            ColliderShape::Ball { radius } => {
                let shape = Ball::new(*radius as f32);
                mesh = from_parry(shape.to_trimesh(AROUND, AROUND / 2));
                (Box::new(shape), *radius)
            }
            ColliderShape::Capsule {
                half_length,
                radius,
            } => {
                let end = ParryVector::new(0.0, *half_length as f32, 0.0);
                let shape = Capsule::new(-end, end, *radius as f32);
                mesh = from_parry(shape.to_trimesh(AROUND, AROUND / 2));
                (Box::new(shape), half_length + radius)
            }
            ColliderShape::Cuboid { half_extents } => {
                let shape = Cuboid::new(to_parry(half_extents));
                mesh = from_parry(shape.to_trimesh());
                (Box::new(shape), half_extents.norm())
            }
            ColliderShape::ConvexHull { points } => {
                let points: Vec<ParryVector> = points.iter().map(|p| to_parry(&p.coords)).collect();
                let flat =
                    || refuse("its points span no volume; give four or more that do".to_owned());
                let shape = ConvexPolyhedron::from_convex_hull(&points).ok_or_else(flat)?;
                mesh = from_parry(shape.to_trimesh());
                let radius = radius_of(&mesh.0);
                if volume_of(&mesh) < 1e-6 * radius.powi(3) {
                    return Err(flat());
                }
                (Box::new(shape), radius)
            }
            ColliderShape::TriangleMesh {
                vertices,
                triangles,
            } => {
                if let Some(edge) = open_edge(triangles) {
                    return Err(refuse(format!(
                        "its mesh is not closed and oriented: the edge from vertex {} to {} \
                         has no partner; close it or give a convex hull",
                        edge[0], edge[1]
                    )));
                }
                let points = vertices.iter().map(|p| to_parry(&p.coords)).collect();
                let shape = TriMesh::with_flags(points, triangles.clone(), TriMeshFlags::ORIENTED)
                    .map_err(|e| refuse(e.to_string()))?;
                mesh = (vertices.clone(), triangles.clone());
                let radius = radius_of(vertices);
                (Box::new(shape), radius)
            }
            ColliderShape::Plane {} => (Box::new(HalfSpace::new(ParryVector::Y)), f64::INFINITY),
        };
        let is_round = matches!(
            description,
            ColliderShape::Ball { .. } | ColliderShape::Capsule { .. } | ColliderShape::Plane {}
        );
        Ok(Self {
            solid: Solid::Parry(shape),
            is_round,
            mesh,
            radius,
        })
    }

    /// A body of the face: smooth, without a mesh.
    pub(crate) fn of_star(surface: StarSurface) -> Self {
        Self {
            is_round: true,
            mesh: (Vec::new(), Vec::new()),
            radius: surface.largest(),
            solid: Solid::Star(surface),
        }
    }

    /// The surface nearest to a point in the shape's own coordinates. (mm)
    pub(crate) fn nearest(&self, point: &Vector) -> SurfacePlace {
        let shape = match &self.solid {
            Solid::Parry(shape) => shape,
            Solid::Star(surface) => return surface.nearest(point),
        };
        let asked = to_parry(point);
        let found = shape.project_local_point(asked, false);
        let away = point
            - Vector::new(
                f64::from(found.point.x),
                f64::from(found.point.y),
                f64::from(found.point.z),
            );
        let distance = away.norm();
        let sign = if found.is_inside { -1.0 } else { 1.0 };
        SurfacePlace {
            distance: sign * distance,
            normal: (distance > 1e-9).then(|| away * (sign / distance)),
        }
    }

    /// A mesh to show or to judge by: of a round shape one that lies inside it, of a plane a
    /// square.
    pub(crate) fn shown_mesh(&self) -> (Vec<Point>, Vec<[u32; 3]>) {
        if !self.mesh.1.is_empty() {
            return self.mesh.clone();
        }
        let s = 200.0;
        let corners = [[-s, -s], [s, -s], [s, s], [-s, s]];
        (
            corners
                .iter()
                .map(|c| Point::new(c[0], 0.0, c[1]))
                .collect(),
            vec![[0, 2, 1], [0, 3, 2]],
        )
    }
}

fn to_parry(v: &Vector) -> ParryVector {
    ParryVector::new(v.x as f32, v.y as f32, v.z as f32)
}

fn from_parry(
    (vertices, triangles): (Vec<ParryVector>, Vec<[u32; 3]>),
) -> (Vec<Point>, Vec<[u32; 3]>) {
    let wide = |v: &ParryVector| Point::new(f64::from(v.x), f64::from(v.y), f64::from(v.z));
    (vertices.iter().map(wide).collect(), triangles)
}

fn radius_of(vertices: &[Point]) -> f64 {
    vertices.iter().map(|p| p.coords.norm()).fold(0.0, f64::max)
}

/// Volume inside a closed surface. [mm^3]
fn volume_of((vertices, triangles): &(Vec<Point>, Vec<[u32; 3]>)) -> f64 {
    let corner = |v: u32| vertices[v as usize].coords;
    let sum: f64 = triangles
        .iter()
        .map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))))
        .sum();
    sum.abs() / 6.0
}

/// An edge without its opposite, if the triangles do not close.
fn open_edge(triangles: &[[u32; 3]]) -> Option<[u32; 2]> {
    let directed = || {
        triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
    };
    let all: std::collections::BTreeSet<[u32; 2]> = directed().collect();
    directed().find(|&[a, b]| !all.contains(&[b, a]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(description: &ColliderShape) -> WorldShape {
        WorldShape::new(description, 0, "it").unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn distances_are_signed_and_normals_point_out() {
        let mesh = shape(&ColliderShape::Cuboid {
            half_extents: Vector::repeat(2.0),
        })
        .mesh;
        let shapes = [
            ColliderShape::Ball { radius: 2.0 },
            ColliderShape::Capsule {
                half_length: 3.0,
                radius: 2.0,
            },
            ColliderShape::Cuboid {
                half_extents: Vector::new(2.0, 3.0, 4.0),
            },
            ColliderShape::TriangleMesh {
                vertices: mesh.0.clone(),
                triangles: mesh.1,
            },
            ColliderShape::ConvexHull { points: mesh.0 },
        ];
        for description in shapes {
            let s = shape(&description);
            let out = s.nearest(&Vector::new(3.0, 0.0, 0.0));
            assert!((out.distance - 1.0).abs() < 1e-5, "{description:?}");
            let inside = s.nearest(&Vector::new(1.5, 0.0, 0.0));
            assert!((inside.distance + 0.5).abs() < 1e-5, "{description:?}");
            for place in [out, inside] {
                let n = place.normal.unwrap_or_default();
                assert!((n - Vector::x()).norm() < 1e-5, "{description:?}");
            }
        }
        let plane = shape(&ColliderShape::Plane {});
        assert!((plane.nearest(&Vector::new(5.0, -2.0, 1.0)).distance + 2.0).abs() < 1e-6);
    }

    #[test]
    fn open_meshes_and_flat_hulls_are_refused() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            .map(Point::from)
            .to_vec();
        let open = ColliderShape::TriangleMesh {
            vertices: points.clone(),
            triangles: vec![[0, 1, 2]],
        };
        let text = WorldShape::new(&open, 2, "sheet").map_err(|e| e.to_string());
        assert!(text.is_err_and(|t| t.contains("not closed")));
        let flat = ColliderShape::ConvexHull { points };
        assert!(WorldShape::new(&flat, 0, "flat").is_err());
    }
}
