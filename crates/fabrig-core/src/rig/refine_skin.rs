//! A user's mesh made finer where wrinkles live, before it is bound.
//!
//! A wrinkle needs at least four edges of skin. Skin over the patches that fold is refined until
//! its edges are short enough; every new vertex gets its own place on the template, so it is
//! bound as if the user had drawn it.

use crate::Point;
use crate::anatomy::{PatchKind, charts};
use crate::mesh::{Mesh, RefinedMesh, Surface, SurfacePoint, refine};
use crate::rig::{FaceOnTemplate, RigError, RigOptions};
use crate::template::Template;

/// Patches under skin that folds, without their sides.
pub const FOLDING_PATCHES: [&str; 5] = [
    "frontalis",
    "forehead_fat",
    "procerus",
    "depressor_supercilii",
    "orbicularis_oculi",
];

/// Skin of rings folds beyond this share of the way from the opening outwards; what is nearer
/// are lids and lips.
pub(crate) const RING_SHARE: f64 = 0.35;
/// A polygon is parted no more often than this.
const LEVEL_LIMIT: u32 = 4;

/// Where and how far skin is refined.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinRefinement {
    /// Edges over the patches are no longer than this. (mm)
    pub edge_length: f64,
    /// Patches, with or without their side.
    pub patches: Vec<String>,
}

impl SkinRefinement {
    /// Over the patches that fold.
    pub fn to(edge_length: f64) -> Self {
        Self {
            edge_length,
            patches: FOLDING_PATCHES.map(str::to_owned).to_vec(),
        }
    }
}

/// Whether a patch is meant by a name, with or without its side.
pub(crate) fn is_called(patch: &str, name: &str) -> bool {
    let stem = patch.strip_suffix("_l").or(patch.strip_suffix("_r"));
    patch == name || stem == Some(name)
}

/// Refines a face that is on the template. Returns the finer mesh and the places of its
/// vertices, old ones first.
///
/// # Errors
///
/// [`RigError::Refinement`] for an edge length that is none or a patch that there is not.
pub fn refine_on_template(
    on_template: &FaceOnTemplate<'_>,
    template: &Template,
    options: &RigOptions,
    refinement: &SkinRefinement,
) -> Result<(RefinedMesh, Vec<SurfacePoint>), RigError> {
    let length = refinement.edge_length;
    if !(length.is_finite() && length >= 0.1) {
        return Err(RigError::Refinement {
            problem: format!("edges of {length} mm are not possible; give at least 0.1"),
        });
    }
    let FaceOnTemplate {
        face,
        to_head,
        positions,
        places,
        rigid,
        ..
    } = *on_template;
    let triangles = template.skin.triangles();
    let is_folding = folding_vertices(template, &triangles, options, refinement)?;
    let mut is_marked: Vec<bool> = places
        .iter()
        .map(|place| {
            let corners = triangles[place.triangle as usize];
            corners.iter().any(|&v| is_folding[v as usize])
        })
        .collect();
    for &vertex in rigid.iter().flat_map(|piece| &piece.vertices) {
        is_marked[vertex as usize] = false;
    }
    let own_length = length / to_head.scaling();
    let refined = refine(face, &is_marked, own_length, LEVEL_LIMIT)?;
    let surface = Surface::new(positions, &triangles)?;
    let on = |p: &Point| surface.closest(&(to_head * p));
    let new = refined.mesh.positions()[face.vertex_count()..].iter();
    let places = places.iter().copied().chain(new.map(on)).collect();
    Ok((refined, places))
}

/// Whether each vertex of the template's skin lies over one of the patches.
fn folding_vertices(
    template: &Template,
    triangles: &[[u32; 3]],
    options: &RigOptions,
    refinement: &SkinRefinement,
) -> Result<Vec<bool>, RigError> {
    let charts = charts(template, options.resolution)?;
    let mut is_folding = vec![false; template.skin.vertex_count()];
    for name in &refinement.patches {
        let mut is_known = false;
        for chart in charts.iter().filter(|chart| is_called(&chart.name, name)) {
            is_known = true;
            let grid = chart.grid;
            let first = match chart.kind {
                PatchKind::Sphincter => (RING_SHARE * f64::from(grid.v_count)) as usize,
                PatchKind::LinearMuscle | PatchKind::FatPad => 0,
            };
            for node in &chart.nodes[first * grid.u_count as usize..] {
                for v in triangles[node.triangle as usize] {
                    is_folding[v as usize] = true;
                }
            }
        }
        if !is_known {
            let names = charts.iter().map(|chart| chart.name.as_str());
            let nearest = crate::facs::nearest_name(name, names).unwrap_or_default();
            return Err(RigError::Refinement {
                problem: format!("there is no patch '{name}' (nearest: '{nearest}')"),
            });
        }
    }
    Ok(is_folding)
}

/// The face as it is refined, for [`crate::rig::build`].
pub fn refined_face<'a>(
    on_template: &FaceOnTemplate<'a>,
    mesh: &'a Mesh,
    places: &'a [SurfacePoint],
) -> FaceOnTemplate<'a> {
    FaceOnTemplate {
        face: mesh,
        places,
        ..on_template.clone()
    }
}
