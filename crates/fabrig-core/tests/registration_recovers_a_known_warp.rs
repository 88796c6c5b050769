//! A face whose true correspondence to the template is known: the template itself, warped
//! smoothly, given another topology, another unit and a random pose. Registration sees nothing
//! but that mesh; its result is compared with the truth vertex by vertex, which also shows what
//! surface distances hide: sliding along the surface.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use fabrig_core::mesh::{Mesh, Polygons};
use fabrig_core::registration::{
    OpeningState, Registration, RegistrationError, RegistrationOptions, RegistrationReport,
    register,
};
use fabrig_core::template::{self, RigidBody};
use fabrig_core::{Point, Vector};
use nalgebra::Similarity3;

/// A smooth, asymmetric change of proportions: some millimetres, several on nose and jaw.
fn warp(p: &Point) -> Point {
    let bump = |center: [f64; 3], radius: f64, by: [f64; 3]| {
        let d = p - Point::from(center);
        Vector::from(by) * (-d.norm_squared() / (radius * radius)).exp()
    };
    let q = Point::new(
        p.x * (1.05 + 0.0004 * p.y),
        p.y * 0.96,
        p.z * 1.03 + 0.0006 * p.y * p.y / 2.0,
    );
    q + bump([0.0, -10.0, 40.0], 25.0, [0.5, -2.0, 4.0])
        + bump([0.0, -80.0, 20.0], 40.0, [2.0, -4.0, 3.0])
        + bump([45.0, 0.0, 10.0], 35.0, [3.0, 1.0, -1.0])
}

/// Vertices at the middles of the edges only: triangles become smaller triangles, vertices
/// become polygons. No vertex of the original is left.
fn remesh(positions: &[Point], triangles: &[[u32; 3]]) -> Mesh {
    let mut number = BTreeMap::new();
    let mut points = Vec::new();
    let mut middle = |a: u32, b: u32| {
        *number.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push(nalgebra::center(
                &positions[a as usize],
                &positions[b as usize],
            ));
            points.len() as u32 - 1
        })
    };
    let mut faces: Vec<Vec<u32>> = Vec::new();
    // For each vertex: edge middle -> next edge middle, counter-clockwise around it.
    let mut around: Vec<BTreeMap<u32, u32>> = vec![BTreeMap::new(); positions.len()];
    for t in triangles {
        let m = [0, 1, 2].map(|k| middle(t[k], t[(k + 1) % 3]));
        faces.push(m.to_vec());
        for k in 0..3 {
            around[t[k] as usize].insert(m[k], m[(k + 2) % 3]);
        }
    }
    for ring in around {
        let Some((&first, _)) = ring.first_key_value() else {
            continue;
        };
        let mut polygon = vec![first];
        while let Some(&next) = ring.get(&polygon[polygon.len() - 1]) {
            if next == first || polygon.len() > ring.len() {
                break;
            }
            polygon.push(next);
        }
        let closes = ring.get(&polygon[polygon.len() - 1]) == Some(&first);
        if closes && polygon.len() == ring.len() {
            faces.push(polygon);
        }
    }
    Mesh::new(points, Polygons::from_faces(faces)).expect("a mesh")
}

fn run(face: &Mesh) -> Registration {
    register(
        face,
        template::human(),
        &RegistrationOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    )
    .expect("registers")
}

fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

/// Whether a vertex belongs to the face proper, not to what is hidden, hair, ears or neck.
fn is_face(vertex: usize) -> bool {
    let regions = &template::human().regions;
    let name = &regions.regions[regions.vertex_regions[vertex].0 as usize].name;
    ![
        "mouth_interior",
        "socket",
        "nostril",
        "neck",
        "scalp",
        "ear",
    ]
    .iter()
    .any(|n| name.starts_with(n))
}

/// Mouth, left eye, right eye.
fn states(report: &RegistrationReport) -> [OpeningState; 3] {
    let o = &report.openings;
    [o.mouth, o.eyes[0], o.eyes[1]].map(|m| m.state)
}

fn check_against_truth(pose: &Similarity3<f64>) {
    let template = template::human();
    let warped: Vec<Point> = template.skin.positions().iter().map(warp).collect();
    let face = remesh(&warped, &template.skin.triangles());
    let posed = face
        .with_positions(
            face.positions()
                .iter()
                .map(|p| pose.transform_point(p))
                .collect(),
        )
        .expect("posed");
    let found = run(&posed);
    let mut errors: Vec<f64> = (0..warped.len())
        .filter(|&v| is_face(v))
        .map(|v| {
            let truth = found
                .to_head
                .transform_point(&pose.transform_point(&warped[v]));
            (found.positions[v] - truth).norm()
        })
        .collect();
    let (median, p95) = (percentile(&mut errors, 0.5), percentile(&mut errors, 0.95));
    let report = &found.report;
    assert!(median < 0.6 && p95 < 1.8, "median {median}, 95 % {p95}");
    assert!(report.template_to_face.median < 0.2 && report.template_to_face.p95 < 0.8);
    assert_eq!(report.folded_triangles, 0);
    assert!(report.coverage > 0.97, "{}", report.coverage);
    assert_eq!(states(report), [OpeningState::Open; 3]);
}

#[test]
fn the_true_vertices_are_found_in_an_upright_head() {
    check_against_truth(&Similarity3::identity());
}

#[test]
fn the_true_vertices_are_found_upside_down_in_other_units_and_far_away() {
    check_against_truth(&Similarity3::new(
        Vector::new(130.0, -70.0, 900.0),
        Vector::new(2.6, 0.7, -1.1),
        0.0013,
    ));
    check_against_truth(&Similarity3::new(
        Vector::new(-4e4, 0.0, 1e5),
        Vector::new(-0.4, 2.2, 0.9),
        120.0,
    ));
}

/// The template's own eyes, teeth and tongue as further pieces of the same mesh.
fn with_parts(positions: &[Point]) -> (Mesh, Vec<(RigidBody, std::ops::Range<usize>)>) {
    let template = template::human();
    let mut points = positions.to_vec();
    let mut faces: Vec<Vec<u32>> = template
        .skin
        .polygons()
        .iter()
        .map(<[u32]>::to_vec)
        .collect();
    let mut bodies = Vec::new();
    for part in &template.rigid_parts {
        let first = points.len();
        points.extend_from_slice(part.mesh.positions());
        faces.extend(
            part.mesh
                .polygons()
                .iter()
                .map(|f| f.iter().map(|v| v + first as u32).collect()),
        );
        bodies.push((part.follows, first..points.len()));
    }
    let mesh = Mesh::new(points, Polygons::from_faces(faces)).expect("a mesh");
    (mesh, bodies)
}

#[test]
fn the_template_maps_to_itself_with_lips_and_lids_by_side_and_its_parts_by_body() {
    let template = template::human();
    let (face, bodies) = with_parts(template.skin.positions());
    let found = run(&face);

    let regions = &template.regions;
    let mut crossed = 0;
    for (v, &region) in regions.vertex_regions.iter().enumerate() {
        if regions.are_apart(region, found.face_regions[v]) {
            crossed += 1;
        }
    }
    assert_eq!(crossed, 0, "vertices on the wrong side of lips or lids");
    let mut off: Vec<f64> = (0..template.skin.vertex_count())
        .filter(|&v| is_face(v))
        .map(|v| found.face_points[v].distance)
        .collect();
    assert!(percentile(&mut off, 0.95) < 0.3);

    // Its eyeballs fix the size exactly.
    assert!((found.to_head.scaling() - 1.0).abs() < 1e-3);
    for (body, range) in bodies {
        let middle = range.start + range.len() / 2;
        let component = found
            .rigid_components
            .iter()
            .find(|c| c.vertices.contains(&(middle as u32)))
            .unwrap_or_else(|| panic!("nothing found for {body:?}"));
        assert_eq!(component.body, body);
    }
}

#[test]
fn the_demo_face_is_registered_within_a_millimetre() {
    let found = run(&template::demo_face());
    let report = &found.report;
    assert!(report.template_to_face.median < 0.2 && report.template_to_face.p95 < 0.8);
    assert_eq!(report.folded_triangles, 0);
    assert!(report.confidence > 0.4);
    assert_eq!(states(report), [OpeningState::Open; 3]);
}

#[test]
fn a_mesh_wound_inside_out_is_turned_and_said_to_be() {
    let template = template::human();
    let triangles: Vec<[u32; 3]> = template
        .skin
        .triangles()
        .iter()
        .map(|t| [t[0], t[2], t[1]])
        .collect();
    let face = Mesh::from_triangles(template.skin.positions().to_vec(), &triangles).expect("mesh");
    let report = run(&face).report;
    assert!(report.cleaning.was_inside_out);
    assert!(
        report.warnings.iter().any(|w| w.contains("inside out")),
        "{:?}",
        report.warnings
    );
    assert!(report.template_to_face.max < 1e-3);
}

#[test]
fn landmarks_fix_the_pose_and_wrong_ones_are_refused_by_name() {
    let template = template::human();
    let pose = Similarity3::new(Vector::new(5.0, 1.0, 2.0), Vector::new(0.3, 2.0, 1.0), 0.04);
    let warped: Vec<Point> = template.skin.positions().iter().map(warp).collect();
    let points = warped.iter().map(|p| pose.transform_point(p)).collect();
    let face = template.skin.with_positions(points).expect("posed");
    let mut options = RegistrationOptions::default();
    for name in [
        "eye_outer_l",
        "eye_outer_r",
        "nose_tip",
        "pogonion",
        "lip_corner_l",
    ] {
        let v = template.landmarks[name] as usize;
        options
            .landmarks
            .insert(name.to_owned(), face.positions()[v]);
    }
    let go = |options: &RegistrationOptions| {
        register(&face, template, options, &mut |_| ControlFlow::Continue(()))
    };
    let found = go(&options).expect("registers");
    assert!(found.report.used_landmarks);
    let landmarks = found.report.landmarks.expect("distances");
    assert!(landmarks.count == 5 && landmarks.max < 1.0, "{landmarks:?}");

    let mut wrong = options.clone();
    wrong
        .landmarks
        .insert("noseTip".to_owned(), Point::origin());
    match go(&wrong) {
        Err(RegistrationError::UnknownLandmark { name, nearest }) => {
            assert_eq!(name, "noseTip");
            assert_eq!(nearest[0], "nose_tip");
        }
        other => panic!("{other:?}"),
    }
    let mut few = options.clone();
    few.landmarks.retain(|name, _| name.starts_with("eye"));
    assert!(matches!(
        go(&few),
        Err(RegistrationError::TooFewLandmarks {
            found: 2,
            expected: 4,
            ..
        })
    ));
    let mut swapped = options;
    let (l, r) = (
        swapped.landmarks["eye_outer_l"],
        swapped.landmarks["eye_outer_r"],
    );
    let corner = template.landmarks["lip_corner_r"] as usize;
    swapped.landmarks.insert("eye_outer_l".to_owned(), r);
    swapped.landmarks.insert("eye_outer_r".to_owned(), l);
    swapped
        .landmarks
        .insert("lip_corner_l".to_owned(), face.positions()[corner]);
    assert!(matches!(
        go(&swapped),
        Err(RegistrationError::LandmarksMirrored { .. })
    ));
}

#[test]
fn a_shape_that_is_no_face_is_refused_with_the_landmarks_to_give() {
    // A smooth egg.
    let (rows, columns) = (40u32, 60u32);
    let mut points = Vec::new();
    let mut faces: Vec<[u32; 4]> = Vec::new();
    for r in 0..=rows {
        for c in 0..columns {
            let a = (0.01 + 0.98 * f64::from(r) / f64::from(rows)) * std::f64::consts::PI;
            let b = f64::from(c) / f64::from(columns) * std::f64::consts::TAU;
            points.push(Point::new(
                70.0 * a.sin() * b.cos(),
                110.0 * a.cos(),
                80.0 * a.sin() * b.sin(),
            ));
            if r < rows {
                let next = (c + 1) % columns;
                faces.push([
                    r * columns + c,
                    r * columns + next,
                    (r + 1) * columns + next,
                    (r + 1) * columns + c,
                ]);
            }
        }
    }
    let egg = Mesh::new(points, Polygons::from_faces(faces)).expect("mesh");
    let result = register(
        &egg,
        template::human(),
        &RegistrationOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    );
    match result {
        Err(RegistrationError::AlignmentUncertain { landmarks, .. }) => {
            assert!(landmarks.contains(&"nose_tip".to_owned()));
        }
        other => panic!("{:?}", other.map(|r| r.report)),
    }
}

#[test]
fn the_result_is_the_same_for_any_number_of_threads_and_a_run_can_be_cancelled() {
    let face = template::demo_face();
    let with_threads = |count: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .expect("pool")
            .install(|| run(&face))
    };
    let (one, three) = (with_threads(1), with_threads(3));
    assert_eq!(one.positions, three.positions);
    assert_eq!(one.face_points, three.face_points);
    assert_eq!(one.to_head, three.to_head);

    let stopped = register(
        &face,
        template::human(),
        &RegistrationOptions::default(),
        &mut |p| {
            if p.fraction > 0.4 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    );
    assert_eq!(
        stopped.map(|r| r.report),
        Err(RegistrationError::Cancelled { stage: "deform" })
    );
}

/// With `FABRIG_SHARED` set to a folder that has `faces/`, real faces are registered too.
#[test]
fn real_faces_are_registered_where_they_are_at_hand() {
    let Some(folder) = std::env::var_os("FABRIG_SHARED") else {
        return;
    };
    for (name, p95, state) in [
        ("ict_neutral", 0.8, OpeningState::Open),
        // Shut, with a whole mouth bag and sockets behind the seams.
        ("lee_perry_smith", 1.2, OpeningState::Closed),
        // A disc without a hole.
        ("mediapipe_canonical", 1.2, OpeningState::Fused),
    ] {
        let path = std::path::Path::new(&folder)
            .join("faces")
            .join(format!("{name}.obj"));
        let face = fabrig_core::mesh::io::read_mesh(&path).expect("a mesh");
        let report = run(&face).report;
        assert!(report.template_to_face.median < 0.2, "{name}: {report:?}");
        assert!(report.template_to_face.p95 < p95, "{name}: {report:?}");
        assert!(report.confidence > 0.3, "{name}");
        assert!(report.folded_triangles <= 2, "{name}");
        assert_eq!(states(&report), [state; 3], "{name}");
        let told = report
            .warnings
            .iter()
            .filter(|w| w.starts_with("the li"))
            .count();
        assert_eq!(
            told,
            if state == OpeningState::Open { 0 } else { 3 },
            "{name}"
        );
    }
}
