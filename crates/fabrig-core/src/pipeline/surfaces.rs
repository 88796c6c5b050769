//! What of a rig a recording draws.

use nalgebra::Point3;

use crate::Vector;
use crate::recording::SurfaceInfo;
use crate::rig::Rig;

/// What of the rig is drawn: the skin, its loose parts, the patches.
pub(super) struct Surfaces {
    pub(super) skin: SurfaceInfo,
    pub(super) patches: Vec<SurfaceInfo>,
    pub(super) parts: Vec<SurfaceInfo>,
    /// Vertices of the user's mesh that each part has.
    pub(super) part_vertices: Vec<Vec<u32>>,
}

const SKIN_COLOR: [u8; 4] = [224, 172, 147, 255];
const PATCH_OPACITY: u8 = 255;

impl Surfaces {
    pub(super) fn new(rig: &Rig) -> Self {
        let vertex_count = rig.face.vertex_count();
        // Which part each vertex belongs to, and where in it.
        let mut owner = vec![None; vertex_count];
        for (part, piece) in rig.parts.iter().enumerate() {
            for (k, &vertex) in piece.vertices.iter().enumerate() {
                owner[vertex as usize] = Some((part, k as u32));
            }
        }
        let mut skin_triangles = Vec::new();
        let mut part_triangles = vec![Vec::new(); rig.parts.len()];
        for triangle in rig.face.triangles() {
            match triangle.map(|v| owner[v as usize]) {
                [Some((part, a)), Some((_, b)), Some((_, c))] => {
                    part_triangles[part].push([a, b, c]);
                }
                _ => skin_triangles.push(triangle),
            }
        }
        let parts = rig.parts.iter().zip(part_triangles);
        let rest = rig.skin_at_rest();
        Self {
            skin: SurfaceInfo {
                name: "skin".to_owned(),
                color: SKIN_COLOR,
                vertex_count,
                triangles: skin_triangles,
                vertex_colors: Vec::new(),
            },
            patches: rig
                .patches
                .iter()
                .map(|p| {
                    let chart = &p.patch.chart;
                    let [r, g, b] = chart.color;
                    let quads = chart.quads();
                    SurfaceInfo {
                        name: chart.name.clone(),
                        color: [r, g, b, PATCH_OPACITY],
                        vertex_count: chart.grid.node_count(),
                        triangles: quads
                            .iter()
                            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
                            .collect(),
                        vertex_colors: Vec::new(),
                    }
                })
                .collect(),
            parts: parts
                .map(|(part, triangles)| SurfaceInfo {
                    name: part.name.clone(),
                    color: part_color(&part.name),
                    vertex_count: part.vertices.len(),
                    triangles,
                    vertex_colors: if part.name.starts_with("eye") {
                        eye_colors(rig, &rest, &part.vertices)
                    } else {
                        Vec::new()
                    },
                })
                .collect(),
            part_vertices: rig.parts.iter().map(|p| p.vertices.clone()).collect(),
        }
    }
}

fn part_color(name: &str) -> [u8; 4] {
    if name.contains("eye") {
        [240, 238, 232, 255]
    } else if name.contains("teeth") {
        [236, 228, 210, 255]
    } else if name.contains("tongue") {
        [190, 96, 92, 255]
    } else {
        [150, 140, 132, 255]
    }
}

/// White, iris and pupil of an eyeball that looks straight ahead at rest. The iris of an adult
/// spans about 29 degrees to each side of the line of sight, the pupil about 10.
fn eye_colors(rig: &Rig, rest: &[Point3<f32>], vertices: &[u32]) -> Vec<[u8; 4]> {
    let rest = |v: &u32| rest[*v as usize].cast::<f64>();
    let mean = vertices.iter().map(|v| rest(v).coords).sum::<Vector>() / vertices.len() as f64;
    let [a, b] = rig.eyes.each_ref().map(|eye| eye.center);
    let is_first = (a.coords - mean).norm() < (b.coords - mean).norm();
    let center = if is_first { a } else { b };
    let color = |v: &u32| {
        let angle = (rest(v) - center).angle(&Vector::z()).to_degrees();
        match angle {
            ..10.0 => [14, 14, 16, 255],
            ..29.0 => [86, 116, 128, 255],
            _ => part_color("eye"),
        }
    };
    vertices.iter().map(color).collect()
}
