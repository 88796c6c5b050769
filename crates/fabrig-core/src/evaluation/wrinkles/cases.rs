//! Places of a face that wrinkle, and how they are measured.

use std::sync::Arc;

use nalgebra::Point3;
use serde::Serialize;

use super::WrinkleError;
use super::profile::{WrinkleFigures, figures_of_lines};
use super::winkler::{Winkler, winkler};
use crate::cloth::NodeVariation;
use crate::mesh::{Surface, SurfacePoint, vertex_normals};
use crate::rig::Rig;
use crate::scene::{FacePose, Scene, Simulation, cloth_patches, hold_pose};
use crate::{Point, Vector};

/// Samples of the skin between two nodes of a line.
const FINER: usize = 4;

/// A part of a patch's grid, crossed by lines along its fibres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Site {
    /// The patch.
    pub patch: &'static str,
    /// Part of the way along the fibres; of rings it may run over the seam at 1.
    pub along: [f64; 2],
    /// Part of the way across them.
    pub across: [f64; 2],
}

/// A face that should wrinkle somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WrinkleCase {
    /// What is seen.
    pub name: &'static str,
    /// Shapes and their weights.
    pub shapes: &'static [(&'static str, f32)],
    /// Where it is measured.
    pub site: Site,
}

/// The cases of the report.
pub const WRINKLE_CASES: [WrinkleCase; 2] = [
    WrinkleCase {
        name: "forehead lines",
        shapes: &[
            ("browInnerUp", 1.0),
            ("browOuterUpLeft", 1.0),
            ("browOuterUpRight", 1.0),
        ],
        site: Site {
            // The skin hangs on the fat over the frontalis.
            patch: "forehead_fat",
            along: [0.0, 0.6],
            across: [0.1, 0.9],
        },
    },
    WrinkleCase {
        name: "crow's feet",
        shapes: &[
            ("eyeSquintLeft", 1.0),
            ("eyeSquintRight", 1.0),
            ("cheekSquintLeft", 1.0),
            ("cheekSquintRight", 1.0),
            ("mouthSmileLeft", 1.0),
            ("mouthSmileRight", 1.0),
        ],
        site: Site {
            patch: "orbicularis_oculi_l",
            along: [0.36, 0.64],
            across: [0.6, 1.0],
        },
    },
];

/// What one case measured with one seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WrinkleMeasure {
    /// On the patch.
    pub patch: WrinkleFigures,
    /// On the skin over it, where the patch lies under skin at all.
    pub skin: WrinkleFigures,
    /// What part of the depth the skin should keep by the width of its kernel.
    pub kept_predicted: f64,
    /// Mean strain of the lines in the muscle shapes, negative where they are drawn together.
    pub strain: f64,
    /// The strongest strain of an edge of the lines, the same way.
    pub strain_peak: f64,
    /// What theory says of the lines.
    pub winkler: Option<Winkler>,
}

/// Holds a pose by muscle shapes and by cloth, and measures the difference.
///
/// - `scene`: with the seed of the rest imperfection
///
/// # Errors
///
/// [`WrinkleError::Missing`] where the rig lacks the patch or a shape; errors of the simulation.
pub fn measure_wrinkles(
    rig: &Arc<Rig>,
    scene: &Scene,
    case: &WrinkleCase,
) -> Result<WrinkleMeasure, WrinkleError> {
    let mut pose = FacePose::neutral(rig.shape_names.len());
    for (name, weight) in case.shapes {
        let shape = rig
            .shape_index(name)
            .ok_or_else(|| missing("shape", name))?;
        pose.weights[shape] = *weight;
    }
    let mut charts = rig.patches.iter();
    let patch = charts
        .position(|p| p.patch.chart.name == case.site.patch)
        .ok_or_else(|| missing("patch", case.site.patch))?;
    let mut shapes = Simulation::new(Arc::clone(rig), Scene::without_dynamics(), None)?;
    shapes.reset(pose.clone())?;
    let mut cloth = Simulation::new(Arc::clone(rig), scene.clone(), None)?;
    hold_pose(&mut cloth, &pose)?;

    let lines = site_lines(rig, patch, &case.site);
    let wide = |points: &[Point3<f32>]| -> Vec<Point> { points.iter().map(|p| p.cast()).collect() };
    let targets = wide(shapes.patch_positions(patch));
    let nodes = wide(cloth.patch_positions(patch));
    let grid = rig.patches[patch].patch.chart.grid;
    let quads = grid.quads();
    let triangles: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    let normals = vertex_normals(&targets, &triangles);
    let height = |n: usize| (nodes[n] - targets[n]).dot(&normals[n]);
    let on_patch: Vec<Vec<(f64, f64)>> = lines
        .iter()
        .map(|line| {
            let places: Vec<Point> = line.iter().map(|&n| targets[n]).collect();
            let heights = line.iter().map(|&n| height(n));
            arc_lengths(&places).into_iter().zip(heights).collect()
        })
        .collect();

    let skin = SkinHeights::new(rig, &wide(shapes.skin()), &wide(cloth.skin()))?;
    let on_skin = skin.along(&lines, &rig.patches[patch].patch.neutral);

    let figures = figures_of_lines(&on_patch);
    let neutral = &rig.patches[patch].patch.neutral;
    let kept_predicted = skin.kept(rig, &lines, neutral, figures.wavelength);
    // Length and strain of every edge of the lines.
    let edges: Vec<(f64, f64)> = lines
        .iter()
        .flat_map(|line| line.windows(2))
        .map(|pair| {
            let of = |points: &[Point]| (points[pair[1]] - points[pair[0]]).norm();
            (of(&targets), of(&targets) / of(neutral).max(1e-9) - 1.0)
        })
        .collect();
    let material = cloth_patches(rig)?[patch].material;
    let middle = lines.get(lines.len() / 2).and_then(|l| l.get(l.len() / 2));
    let variation = middle.and_then(|&node| rig.variations.get(patch)?.get(node));
    let predicted = |edge: f64| winkler(&material, variation.unwrap_or(&NodeVariation::NONE), edge);
    // Only what is drawn together enough folds, and edges are short there.
    let critical = predicted(1.0).map_or(0.0, |w| w.critical_strain);
    let folding = mean(edges.iter().filter(|e| e.1 < -critical).map(|e| e.0));
    let edge = folding.or(mean(edges.iter().map(|e| e.0)));
    Ok(WrinkleMeasure {
        patch: figures,
        skin: figures_of_lines(&on_skin),
        kept_predicted,
        strain: mean(edges.iter().map(|e| e.1)).unwrap_or(0.0),
        strain_peak: edges.iter().map(|e| e.1).fold(0.0, f64::min),
        winkler: edge.and_then(predicted),
    })
}

/// Mean of some numbers, if there are any.
fn mean(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = numbers.fold((0.0, 0u32), |(sum, count), x| (sum + x, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn missing(what: &'static str, name: &str) -> WrinkleError {
    WrinkleError::Missing {
        what,
        name: name.to_owned(),
    }
}

/// Nodes of the grid lines that cross a site, along the fibres.
fn site_lines(rig: &Rig, patch: usize, site: &Site) -> Vec<Vec<usize>> {
    let grid = rig.patches[patch].patch.chart.grid;
    let place = |share: f64, count: u32| (share * f64::from(count)).round() as u32;
    let around = grid.u_count - u32::from(!grid.is_periodic);
    let [first, last] = site.along.map(|share| place(share, around));
    let [low, high] = site.across.map(|share| place(share, grid.v_count - 1));
    (low..=high)
        .map(|v| {
            (first..=last)
                .map(|u| grid.index(u % grid.u_count, v))
                .collect()
        })
        .collect()
}

fn arc_lengths(places: &[Point]) -> Vec<f64> {
    let mut length = 0.0;
    let mut before = places.first().copied().unwrap_or_default();
    places
        .iter()
        .map(|&p| {
            length += (p - before).norm();
            before = p;
            length
        })
        .collect()
}

/// What the cloth does to the skin, along the normals that the muscle shapes give it.
struct SkinHeights {
    /// Skin at rest.
    surface: Surface,
    triangles: Vec<[u32; 3]>,
    heights: Vec<f64>,
    by_shapes: Vec<Point>,
}

impl SkinHeights {
    fn new(rig: &Rig, by_shapes: &[Point], by_cloth: &[Point]) -> Result<Self, WrinkleError> {
        let rest: Vec<Point> = rig.skin_at_rest().iter().map(|p| p.cast()).collect();
        let is_skin = |v: &u32| rig.regions.get(*v as usize).is_some_and(Option::is_some);
        let triangles: Vec<[u32; 3]> = rig
            .face
            .triangles()
            .into_iter()
            .filter(|t| t.iter().all(is_skin))
            .collect();
        let normals = vertex_normals(by_shapes, &triangles);
        let pairs = by_cloth.iter().zip(by_shapes).zip(&normals);
        Ok(Self {
            surface: Surface::new(&rest, &triangles)?,
            triangles,
            heights: pairs.map(|((a, b), n)| (a - b).dot(n)).collect(),
            by_shapes: by_shapes.to_vec(),
        })
    }

    /// Heights along lines of nodes, at the skin nearest to them at rest.
    fn along(&self, lines: &[Vec<usize>], rest_nodes: &[Point]) -> Vec<Vec<(f64, f64)>> {
        let blend = |at: &SurfacePoint| -> (Point, f64) {
            let corners = self.triangles[at.triangle as usize].map(|v| v as usize);
            let mut place = Vector::zeros();
            let mut height = 0.0;
            for (v, share) in corners.into_iter().zip(at.barycentric) {
                place += self.by_shapes[v].coords * share;
                height += self.heights[v] * share;
            }
            (place.into(), height)
        };
        lines
            .iter()
            .map(|line| {
                let mut samples = Vec::new();
                for pair in line.windows(2) {
                    let (a, b) = (rest_nodes[pair[0]], rest_nodes[pair[1]]);
                    for k in 0..FINER {
                        let p = a + (b - a) * (k as f64 / FINER as f64);
                        samples.push(blend(&self.surface.closest(&p)));
                    }
                }
                let places: Vec<Point> = samples.iter().map(|s| s.0).collect();
                let heights = samples.iter().map(|s| s.1);
                arc_lengths(&places).into_iter().zip(heights).collect()
            })
            .collect()
    }

    /// The part of a wave that skin keeps: `exp(-2 pi^2 s^2 / L^2)` in the mean over the samples,
    /// with s the width along the line of the kernel that moves the skin there: the weights of
    /// its triangle's corners, each spread over its own row of nodes.
    ///
    /// - `wavelength`: L (mm)
    fn kept(&self, rig: &Rig, lines: &[Vec<usize>], rest_nodes: &[Point], wavelength: f64) -> f64 {
        let nodes: Vec<Point> = rig
            .neutral_nodes()
            .into_iter()
            .flat_map(|(_, nodes)| nodes.into_iter().map(|p| p.cast()))
            .collect();
        let (mut sum, mut count) = (0.0, 0u32);
        for pair in lines.iter().flat_map(|line| line.windows(2)) {
            let (a, b) = (rest_nodes[pair[0]], rest_nodes[pair[1]]);
            let Some(along) = (b - a).try_normalize(f64::EPSILON) else {
                continue;
            };
            for k in 0..FINER {
                let p = a + (b - a) * (k as f64 / FINER as f64);
                let place = self.surface.closest(&p);
                let corners = self.triangles[place.triangle as usize];
                let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
                for (v, share) in corners.into_iter().zip(place.barycentric) {
                    for (node, w) in rig.binding.row(v as usize) {
                        // The mandible comes after the nodes.
                        let Some(node) = nodes.get(node as usize) else {
                            continue;
                        };
                        let (w, t) = (share * f64::from(w), (node - p).dot(&along));
                        weight += w;
                        first += w * t;
                        second += w * t * t;
                    }
                }
                if weight > 0.0 {
                    // Rows that interpolate by cubics have a width of nothing, or a little less.
                    let squared = (second / weight - (first / weight).powi(2)).max(0.0);
                    let turns = std::f64::consts::TAU / wavelength.max(f64::MIN_POSITIVE);
                    sum += weight * (-0.5 * turns * turns * squared).exp();
                }
                count += 1;
            }
        }
        sum / f64::from(count.max(1))
    }
}
