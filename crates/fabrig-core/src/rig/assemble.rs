//! From a face on the template to a rig.

use crate::Point;
use crate::anatomy::{self, Resolution};
use crate::mesh::{Mesh, SurfacePoint};
use crate::registration::{Registration, RegistrationReport, RigidComponent};
use crate::rig::close_lids::close_lids;
use crate::rig::parts::name_parts;
use crate::rig::put_on_face::{FaceSide, ShapesOnFace};
use crate::rig::sockets::{fit_eyes, fit_hinge};
use crate::rig::template_side::TemplateSide;
use crate::rig::tongue::give_shapes;
use crate::rig::{Rig, RigError, RigJaw, RigPatch};
use crate::skin::{FitOptions, SkinBinding, SmoothInterpolation};
use crate::template::{JawHinge, RegionId, Template};
use crate::transfer::{AlphaMode, Example, EyeShapes, JawMode, JawShapes, OffsetMode};
use nalgebra::Similarity3;

/// How a rig is built.
#[derive(Debug, Clone, PartialEq)]
pub struct RigOptions {
    /// How many nodes the patches have.
    pub resolution: Resolution,
    /// Shapes that move no node of a patch by this much are left out of it. (mm)
    pub threshold: f64,
    /// How patches follow the jaw.
    pub jaw_mode: JawMode,
    /// How displacements are put on a face.
    pub offsets: OffsetMode,
    /// What examples of the face's own expressions are fitted by.
    pub alpha: AlphaMode,
    /// How skin weights are fitted.
    pub fit: FitOptions,
}

impl Default for RigOptions {
    fn default() -> Self {
        Self {
            resolution: Resolution::default(),
            threshold: 0.05,
            jaw_mode: JawMode::default(),
            offsets: OffsetMode::default(),
            alpha: AlphaMode::default(),
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
    /// Expressions of this face, in the template's topology, to fit amplitudes to; none where
    /// their size must do.
    pub examples: &'a [Example],
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
        let stored = RegistrationReport {
            // Equal faces give equal rigs, however long it took.
            times: Vec::new(),
            ..registration.report.clone()
        };
        let report = serde_json::to_string(&stored).map_err(|e| RigError::Content {
            reason: e.to_string(),
        })?;
        Ok(Self {
            face,
            to_head: registration.to_head,
            positions: &registration.positions,
            places: &registration.face_points,
            rigid: &registration.rigid_components,
            examples: &[],
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
        examples,
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
    let side = TemplateSide::of(template, options)?;
    let patches = anatomy::lay_patches(template, &side.charts, positions)?;

    let (hinge, jaw_scale) = fit_hinge(template, positions);
    let mut eyes = fit_eyes(template, positions);
    let in_head: Vec<Point> = face.positions().iter().map(|p| to_head * p).collect();
    let mut parts = name_parts(rigid, &in_head, &mut eyes);
    give_shapes(template, positions, &in_head, &mut parts);

    let jaw_shapes = JawShapes::of(template);
    let put = ShapesOnFace::new(
        FaceSide {
            template,
            template_patches: &side.patches,
            patches: &patches,
            positions,
            hinge: &hinge,
            eyes: &eyes,
        },
        &side.shapes,
        options.offsets,
        options.threshold,
    )?;
    let (transfers, open_angle) = put.fitted(examples, options.alpha)?;
    let hinge = JawHinge {
        open_angle,
        ..hinge
    };
    let is_rigid = rigid_mask(face.vertex_count(), &parts);
    let skin_places: Vec<Option<SurfacePoint>> = places
        .iter()
        .zip(&is_rigid)
        .map(|(place, rigid)| (!rigid).then_some(*place))
        .collect();
    let node_counts = patches.iter().map(|p| p.neutral.len() as u32).collect();
    let binding = SkinBinding::bind(
        &side.weights,
        &SmoothInterpolation::new(template),
        &skin_places,
        node_counts,
    )?;

    let mut rig = Rig {
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
        region_names: template
            .regions
            .regions
            .iter()
            .map(|region| region.name.clone())
            .collect(),
        regions: skin_regions(template, &skin_places),
        materials: template.materials.clone(),
        registration_report: report.clone(),
        appearance: None,
        variations: Vec::new(),
    };
    close_lids(&mut rig, template);
    Ok(rig)
}

/// The region of each place: that of the nearest corner of its triangle.
fn skin_regions(template: &Template, places: &[Option<SurfacePoint>]) -> Vec<Option<RegionId>> {
    let triangles = template.skin.triangles();
    let region_of = |place: &SurfacePoint| {
        let corners = triangles[place.triangle as usize];
        let most = (0..3).max_by(|&a, &b| place.barycentric[a].total_cmp(&place.barycentric[b]));
        template.regions.vertex_regions[corners[most.unwrap_or(0)] as usize]
    };
    let places = places.iter();
    places.map(|place| place.as_ref().map(region_of)).collect()
}

/// The rig of a template's own skin: nothing is registered.
///
/// # Errors
///
/// As [`build`].
pub fn rig_of_template(template: &Template, options: &RigOptions) -> Result<Rig, RigError> {
    let places = places_of_self(template);
    let face = FaceOnTemplate {
        face: &template.skin,
        to_head: Similarity3::identity(),
        positions: template.skin.positions(),
        places: &places,
        rigid: &[],
        examples: &[],
        report: String::new(),
    };
    build(&face, template, options)
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

fn rigid_mask(vertex_count: usize, parts: &[crate::rig::RigPart]) -> Vec<bool> {
    let mut mask = vec![false; vertex_count];
    for part in parts {
        for &v in &part.vertices {
            mask[v as usize] = true;
        }
    }
    mask
}
