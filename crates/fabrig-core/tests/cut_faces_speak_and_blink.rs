//! Contract: a fused face is cut only on request; then its lips and lids part, its own vertices
//! keep index and place, and every new one says where it comes from.

#[path = "faces/sewn.rs"]
mod sewn;

use std::ops::ControlFlow;
use std::sync::Arc;

use fabrig_core::mesh::Mesh;
use fabrig_core::pipeline::{RigFaceOptions, RiggedFace, rig_face};
use fabrig_core::registration::CutSeams;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};
use fabrig_core::template;

fn rig(face: &Mesh, cut_seams: CutSeams) -> RiggedFace {
    let options = RigFaceOptions {
        cut_seams,
        ..RigFaceOptions::default()
    };
    rig_face(face, template::human(), &options, &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("a rig")
}

/// Largest distance that a shape puts between both sides of a cut. (mm)
fn parting(rigged: &RiggedFace, cut: usize, shape: &str) -> f32 {
    let rig = &rigged.rig;
    let cuts = &rigged.report.cuts;
    let first = cuts[cut].first_new_vertex;
    let seam = first..first + cuts[cut].seam_vertices;
    let mut simulation =
        Simulation::new(Arc::new(rig.clone()), Scene::default(), None).expect("a scene");
    let mut pose = FacePose::neutral(rig.shape_names.len());
    pose.weights[rig.shape_index(shape).expect("a shape")] = 1.0;
    hold_pose(&mut simulation, &pose).expect("held");
    let rest = rig.face.positions();
    let now = simulation.skin();
    let mut largest = 0.0f32;
    // Both sides of the cut lie at the same place at rest.
    for a in seam.clone() {
        for b in (0..rig.face.vertex_count()).filter(|&b| b != a && b < seam.end) {
            if (rest[a] - rest[b]).norm() < 1e-9 {
                largest = largest.max((now[a] - now[b]).norm());
            }
        }
    }
    largest
}

#[test]
fn a_face_sewn_shut_speaks_and_opens_its_eyes_once_it_is_cut() {
    let face = sewn::template();
    let whole = rig(&face, CutSeams::default());
    assert!(whole.cut.is_none() && whole.report.cuts.is_empty());
    assert_eq!(whole.rig.face.vertex_count(), face.vertex_count());

    let both = CutSeams {
        mouth: true,
        eyes: true,
    };
    let cut = rig(&face, both);
    let report = &cut.report;
    let names: Vec<&str> = report.cuts.iter().map(|c| c.opening.as_str()).collect();
    assert_eq!(names, ["mouth", "left_eye", "right_eye"]);
    assert!(report.cuts[0].length_mm > 35.0 && report.cuts[1].length_mm > 18.0);
    let told = report
        .warnings
        .iter()
        .filter(|w| w.contains("cut apart, as asked"));
    assert_eq!(told.count(), 3);

    let n = face.vertex_count();
    let positions = cut.rig.face.positions();
    assert_eq!(&positions[..n], face.positions());
    let origins = cut.cut.as_ref().expect("origins");
    assert_eq!(origins.original_vertex_count, n);
    assert_eq!(origins.vertices.len(), cut.rig.face.vertex_count() - n);
    assert_eq!(origins.faces.len(), cut.rig.face.face_count());
    for (k, origin) in origins.vertices.iter().enumerate() {
        if let Some(origin) = origin {
            let [a, b] = origin.vertices.map(|v| positions[v as usize]);
            assert!((a + (b - a) * origin.share - positions[n + k]).norm() < 1e-9);
        }
    }
    // Every polygon of the mesh is still there, whole or in parts.
    let mut seen = vec![false; face.face_count()];
    for f in origins.faces.iter().flatten() {
        seen[*f as usize] = true;
    }
    assert!(seen.into_iter().all(|s| s));

    let mouth = parting(&cut, 0, "jawOpen");
    assert!(mouth > 15.0, "the lips part by {mouth} mm");
    let eye = parting(&cut, 1, "eyeWideLeft");
    assert!(eye > 0.5, "the lids part by {eye} mm");
}

#[test]
fn what_is_open_already_is_left_alone_and_said_so() {
    let face = template::demo_face();
    let mouth = CutSeams {
        mouth: true,
        eyes: false,
    };
    let rigged = rig(&face, mouth);
    assert!(rigged.report.cuts.is_empty());
    assert_eq!(rigged.rig.face, face);
    assert!(
        rigged
            .report
            .warnings
            .iter()
            .any(|w| w.contains("was not cut"))
    );
}

#[test]
fn real_scans_are_cut_where_they_are_at_hand() {
    let Some(shared) = std::env::var_os("FABRIG_SHARED") else {
        return;
    };
    let path = std::path::Path::new(&shared).join("faces/mediapipe_canonical.obj");
    let face = fabrig_core::mesh::io::read_mesh(path).expect("a mesh");
    let cut = rig(
        &face,
        CutSeams {
            mouth: true,
            eyes: true,
        },
    );
    assert_eq!(cut.report.cuts.len(), 3);
    assert!(parting(&cut, 0, "jawOpen") > 15.0);
}
