//! What a picture shows: layers of triangles with their paint, and points.

use super::{RenderError, Rgb};
use crate::mesh::{Mesh, Polygons};
use crate::{Point, Vector};

/// Where a surface's colour comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Paint {
    /// One colour.
    Uniform(Rgb),
    /// One per vertex, blended over the triangles.
    Vertex(Vec<Rgb>),
    /// One per triangle.
    Triangle(Vec<Rgb>),
    /// An eyeball: white with an iris and a pupil around the line of sight.
    Eye {
        /// Centre of the eyeball.
        center: Point,
        /// Where it looks; unit vector.
        gaze: Vector,
        /// Colour of the iris.
        iris: Rgb,
    },
}

/// How a surface takes light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Width of the highlight, 0 = mirror, 1 = none to speak of.
    pub roughness: f32,
    /// Strength of the highlight, seen head on.
    pub specular: f32,
    /// How far light bleeds around the terminator per channel: skin is red there.
    pub wrap: [f32; 3],
}

impl Material {
    /// Dry and plain, for patches and diagrams.
    pub const MATTE: Self = Self {
        roughness: 0.6,
        specular: 0.03,
        wrap: [0.12; 3],
    };
    /// Living skin.
    pub const SKIN: Self = Self {
        roughness: 0.5,
        specular: 0.028,
        wrap: [0.42, 0.22, 0.16],
    };
    /// Wet and hard: eyes, teeth.
    pub const WET: Self = Self {
        roughness: 0.14,
        specular: 0.05,
        wrap: [0.25; 3],
    };
}

/// Polygon edges drawn over a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edges {
    /// Colour of the lines.
    pub color: Rgb,
    /// Width. (pixels)
    pub width: f32,
    /// 1 hides the surface under the lines.
    pub opacity: f32,
}

impl Default for Edges {
    fn default() -> Self {
        Self {
            color: Rgb::BLACK,
            width: 1.0,
            opacity: 0.55,
        }
    }
}

/// Triangles that share a paint and a material.
#[derive(Debug, Clone)]
pub struct Layer {
    pub(super) positions: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Bit k: the side from corner k to corner k + 1 is an edge of a polygon.
    pub(super) polygon_edges: Vec<u8>,
    pub(super) paint: Paint,
    pub(super) material: Material,
    pub(super) opacity: f32,
    pub(super) is_smooth: bool,
    pub(super) edges: Option<Edges>,
    pub(super) is_lit_alone: bool,
}

impl Layer {
    /// From triangles; every side of a triangle counts as an edge.
    ///
    /// # Errors
    ///
    /// [`RenderError`] for an index out of range or a position that is not finite.
    pub fn new(positions: Vec<Point>, triangles: Vec<[u32; 3]>) -> Result<Self, RenderError> {
        let polygon_edges = vec![0b111; triangles.len()];
        Self::with_edge_bits(positions, triangles, polygon_edges)
    }

    /// From polygons; the diagonals that split them are not edges.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_polygons(positions: Vec<Point>, polygons: &Polygons) -> Result<Self, RenderError> {
        let mut polygon_edges = Vec::new();
        for face in polygons.iter() {
            let fans = face.len().saturating_sub(2);
            for k in 0..fans {
                let first = u8::from(k == 0);
                let last = u8::from(k + 1 == fans) << 2;
                polygon_edges.push(first | 0b010 | last);
            }
        }
        Self::with_edge_bits(positions, polygons.triangles(), polygon_edges)
    }

    /// A mesh at its own positions.
    ///
    /// # Errors
    ///
    /// As [`Self::new`]; a [`Mesh`] has been checked, so none is expected.
    pub fn from_mesh(mesh: &Mesh) -> Result<Self, RenderError> {
        Self::from_polygons(mesh.positions().to_vec(), mesh.polygons())
    }

    fn with_edge_bits(
        positions: Vec<Point>,
        triangles: Vec<[u32; 3]>,
        polygon_edges: Vec<u8>,
    ) -> Result<Self, RenderError> {
        if let Some(index) = positions
            .iter()
            .position(|p| !p.iter().all(|c| c.is_finite()))
        {
            return Err(RenderError::NotFinite {
                what: "vertex",
                index,
            });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= positions.len()) {
                return Err(RenderError::IndexOutOfRange {
                    triangle,
                    vertex,
                    vertex_count: positions.len(),
                });
            }
        }
        Ok(Self {
            positions,
            triangles,
            polygon_edges,
            paint: Paint::Uniform(Rgb::from_srgb([200, 200, 200])),
            material: Material::MATTE,
            opacity: 1.0,
            is_smooth: true,
            edges: None,
            is_lit_alone: false,
        })
    }

    /// Sets the colours.
    ///
    /// # Errors
    ///
    /// [`RenderError::ColorCount`] when a list does not fit.
    pub fn with_paint(mut self, paint: Paint) -> Result<Self, RenderError> {
        let (per, expected, found) = match &paint {
            Paint::Vertex(colors) => ("vertex", self.positions.len(), colors.len()),
            Paint::Triangle(colors) => ("triangle", self.triangles.len(), colors.len()),
            Paint::Uniform(_) | Paint::Eye { .. } => ("layer", 1, 1),
        };
        if expected != found {
            return Err(RenderError::ColorCount {
                per,
                expected,
                found,
            });
        }
        self.paint = paint;
        Ok(self)
    }

    /// One colour for all of it.
    pub fn with_color(mut self, color: Rgb) -> Self {
        self.paint = Paint::Uniform(color);
        self
    }

    /// How it takes light.
    pub fn with_material(mut self, material: Material) -> Self {
        self.material = material;
        self
    }

    /// 1 hides what lies behind, 0.3 is a veil; clamped to [0, 1]. Only the front of a
    /// translucent surface shows.
    pub fn with_opacity(mut self, opacity: f32) -> Self {
        self.opacity = opacity.clamp(0.0, 1.0);
        self
    }

    /// Draws the polygon edges over the surface.
    pub fn with_edges(mut self, edges: Edges) -> Self {
        self.edges = Some(edges);
        self
    }

    /// Shades each triangle flat instead of blending vertex normals.
    pub fn with_flat_shading(mut self) -> Self {
        self.is_smooth = false;
        self
    }

    /// Neither casts shadows nor receives them: for what is laid over a scene to be read, such
    /// as a diagram, rather than stands in it.
    pub fn with_light_of_its_own(mut self) -> Self {
        self.is_lit_alone = true;
        self
    }

    /// Whether it casts shadows and receives them.
    pub(super) fn has_shadows(&self) -> bool {
        self.opacity >= 1.0 && !self.is_lit_alone
    }

    /// Where its vertices are.
    pub fn positions(&self) -> &[Point] {
        &self.positions
    }

    /// Unit normals per vertex, weighted by triangle area; zero where no triangle gives one.
    pub(super) fn vertex_normals(&self) -> Vec<Vector> {
        let mut normals = vec![Vector::zeros(); self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            let n = (b - a).cross(&(c - a));
            for &v in t {
                normals[v as usize] += n;
            }
        }
        for n in &mut normals {
            *n = n.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        }
        normals
    }
}

/// Small balls, for landmarks and nodes.
#[derive(Debug, Clone)]
pub struct Points {
    /// Centres.
    pub centers: Vec<Point>,
    /// Radius of every ball, in the unit of the positions.
    pub radius: f64,
    /// Their colour.
    pub color: Rgb,
}
