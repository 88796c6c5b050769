//! From a mesh to a rig.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use super::expression_scans::{ExpressionScan, ScanReport, examples_of_scans};
use crate::Error;
use crate::mesh::{Mesh, VertexOrigin};
use crate::registration::{
    CutSeams, Progress, RegistrationOptions, RegistrationReport, StageTime, cut_seams, register,
};
use crate::rig::{
    Expression, FaceOnTemplate, Rig, RigOptions, SkinRefinement, build, carry_expressions,
    refine_on_template, refined_face,
};
use crate::template::Template;

/// How a face is rigged.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RigFaceOptions {
    /// How it is registered to the template.
    pub registration: RegistrationOptions,
    /// Fused lips and lids to cut apart; nothing is cut that is not asked for.
    pub cut_seams: CutSeams,
    /// How the rig is built on it.
    pub rig: RigOptions,
    /// Expressions of this very face, to which amplitudes are fitted.
    pub expressions: Vec<Expression>,
    /// The file that the face came from: the rig keeps its materials and pictures.
    pub source: Option<PathBuf>,
    /// The mesh at rest that the expressions are on, where it is another mesh of the same face;
    /// it is registered by itself.
    pub expressions_on: Option<Mesh>,
    /// Expressions of this face on meshes of their own, in the units of the mesh that the other
    /// expressions are on.
    pub scans: Vec<ExpressionScan>,
    /// Where the mesh is made finer before it is bound; nowhere by default.
    pub refinement: Option<SkinRefinement>,
}

/// A face with its rig.
#[derive(Debug, Clone)]
pub struct RiggedFace {
    /// The rig.
    pub rig: Rig,
    /// The face in the template's topology, in the head frame. (mm)
    pub normalized: Mesh,
    /// Where the vertices and polygons of a cut mesh come from, if anything was cut.
    pub cut: Option<CutOrigins>,
    /// What came of the scans of expressions, one each.
    pub scans: Vec<ScanReport>,
    /// What registration measured; the time of building the rig is its last stage.
    pub report: RegistrationReport,
}

/// Where the vertices and polygons of a cut mesh come from.
#[derive(Debug, Clone, PartialEq)]
pub struct CutOrigins {
    /// How many vertices the user's mesh had; they kept their indices.
    pub original_vertex_count: usize,
    /// For each further vertex its place on the user's mesh, `None` for lining and eyeballs.
    pub vertices: Vec<Option<VertexOrigin>>,
    /// For each polygon that of the user's mesh, `None` for lining and eyeballs.
    pub faces: Vec<Option<u32>>,
}

/// Share of the work that registration is.
const REGISTRATION_SHARE: f64 = 0.7;

/// Registers `face` to `template` and builds its rig.
///
/// - `progress`: called between steps; `ControlFlow::Break` cancels
///
/// # Errors
///
/// [`Error::Registration`] and [`Error::Rig`].
pub fn rig_face(
    face: &Mesh,
    template: &Template,
    options: &RigFaceOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<RiggedFace, Error> {
    let registration = register(face, template, &options.registration, &mut |step| {
        progress(Progress {
            fraction: REGISTRATION_SHARE * step.fraction,
            ..step
        })
    })?;
    let is_cancelled = progress(Progress {
        stage: "build",
        fraction: REGISTRATION_SHARE,
    });
    if is_cancelled.is_break() {
        return Err(crate::registration::RegistrationError::Cancelled { stage: "build" }.into());
    }
    let clock = Instant::now();
    let own_registration = match &options.expressions_on {
        None => None,
        Some(other) => {
            let automatic = RegistrationOptions::default();
            Some(register(other, template, &automatic, &mut |step| {
                progress(Progress {
                    fraction: REGISTRATION_SHARE,
                    ..step
                })
            })?)
        }
    };
    let shown_on = options.expressions_on.as_ref().unwrap_or(face);
    let shown_by = own_registration.as_ref().unwrap_or(&registration);
    let mut examples = carry_expressions(shown_on, shown_by, template, &options.expressions)?;
    let (scanned, scans) = examples_of_scans(
        &options.scans,
        shown_by,
        template,
        &options.rig,
        &mut |step| {
            let share = 1.0 - REGISTRATION_SHARE;
            progress(Progress {
                fraction: REGISTRATION_SHARE + share * step.fraction,
                ..step
            })
        },
    )?;
    examples.extend(scanned);
    let mut registration = registration;
    let mut cut_mesh = None;
    let mut origins = None;
    if !options.cut_seams.is_none() {
        let cut = cut_seams(face, template, &registration, options.cut_seams)?;
        registration = cut.registration;
        origins = Some(CutOrigins {
            original_vertex_count: cut.original_vertex_count,
            vertices: cut.vertex_origins,
            faces: cut.face_origins,
        });
        cut_mesh = Some(cut.mesh);
    }
    let face = cut_mesh.as_ref().unwrap_or(face);
    let normalized = template
        .skin
        .with_positions(registration.positions.clone())?;
    let mut on_template = FaceOnTemplate::from_registration(face, &registration)?;
    on_template.examples = &examples;
    let (mut rig, face_origins) = match &options.refinement {
        None => (build(&on_template, template, &options.rig)?, None),
        Some(wanted) => {
            let (finer, places) = refine_on_template(&on_template, template, &options.rig, wanted)?;
            let finer_face = refined_face(&on_template, &finer.mesh, &places);
            let rig = build(&finer_face, template, &options.rig)?;
            (rig, Some(finer.face_origins))
        }
    };
    name_parts_by_groups(&mut rig);
    let mut report = registration.report;
    if let Some(file) = &options.source {
        let notes = match face_origins {
            None => rig.keep_appearance(file)?,
            Some(origins) => rig.keep_appearance_of(face, &origins, file)?,
        };
        report.warnings.extend(notes);
    }
    for shape in rig.dead_shapes() {
        report.warnings.push(match shape {
            "tongueOut" => "the mesh has no tongue: tongueOut moves nothing".to_owned(),
            other => format!("{other} moves nothing on this face"),
        });
    }
    for scan in &scans {
        if let Some(problem) = &scan.problem {
            let path = scan.path.display();
            report
                .warnings
                .push(format!("{path} is not used: {problem}"));
        }
    }
    report.times.push(StageTime {
        stage: "build".to_owned(),
        seconds: clock.elapsed().as_secs_f64(),
    });
    Ok(RiggedFace {
        rig,
        normalized,
        cut: origins,
        scans,
        report,
    })
}

/// Loose pieces that registration could only tell to move with skull or jaw take the name that
/// the file gives them (`upper_teeth`, `tongue`), where one group holds the whole piece.
fn name_parts_by_groups(rig: &mut Rig) {
    let mut owner = vec![None; rig.face.vertex_count()];
    for (part, piece) in rig.parts.iter().enumerate() {
        for &vertex in &piece.vertices {
            owner[vertex as usize] = Some(part);
        }
    }
    // For each part the one group that its faces are in, `Err` once there are several.
    let mut groups: Vec<Option<Result<usize, ()>>> = vec![None; rig.parts.len()];
    for (index, group) in rig.face.groups().iter().enumerate() {
        for face in group.faces.clone() {
            let Some(part) = owner[rig.face.polygons().face(face)[0] as usize] else {
                continue;
            };
            groups[part] = match groups[part] {
                None => Some(Ok(index)),
                Some(Ok(same)) if same == index => Some(Ok(index)),
                _ => Some(Err(())),
            };
        }
    }
    for part in 0..rig.parts.len() {
        let Some(Ok(group)) = groups[part] else {
            continue;
        };
        let name = rig.face.groups()[group].name.clone();
        let is_taken = rig.parts.iter().any(|other| other.name == name);
        if rig.parts[part].name.contains("rigid") && !is_taken {
            rig.parts[part].name = name;
        }
    }
}
