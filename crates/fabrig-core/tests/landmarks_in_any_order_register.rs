//! Contract: points in iBUG's or MediaPipe's order register a face as our own names do.

use std::ops::ControlFlow;
use std::path::Path;

use fabrig_core::registration::{
    LandmarkOrder, RegistrationOptions, RegistrationReport, parse_landmarks, register,
};
use fabrig_core::{Point, mesh::Mesh, template};

fn run(face: &Mesh, points: &[Point]) -> RegistrationReport {
    let rows: Vec<[f64; 3]> = points.iter().map(|p| [p.x, p.y, p.z]).collect();
    let text = serde_json::to_string(&rows).expect("JSON");
    let options = RegistrationOptions {
        landmarks: parse_landmarks(&text, Path::new("points.json"), None).expect("landmarks"),
        ..RegistrationOptions::default()
    };
    register(face, template::human(), &options, &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("registered")
    .report
}

#[test]
fn a_synthetic_detector_of_either_order_registers_the_template() {
    let template = template::human();
    for (order, count) in [(LandmarkOrder::Ibug68, 68), (LandmarkOrder::MediaPipe, 478)] {
        let mut points = vec![Point::origin(); count];
        for (name, &k) in order.points() {
            points[k] = template.landmark(name).expect("a landmark");
        }
        let report = run(&template.skin, &points);
        assert!(report.used_landmarks);
        let landmarks = report.landmarks.expect("measured");
        assert_eq!(landmarks.count, order.points().len());
        assert!(landmarks.p95 < 0.8, "{landmarks:?}");
        assert!(report.template_to_face.p95 < 0.3);
    }
}

/// The vertices of MediaPipe's own model as its landmarks. The file at hand has them in an
/// order of its own; these are the numbers there of the landmarks that are used.
#[test]
fn the_model_of_mediapipe_registers_by_its_own_landmarks() {
    const VERTICES: [(usize, usize); 20] = [
        (33, 4),
        (263, 9),
        (133, 2),
        (362, 8),
        (159, 239),
        (386, 238),
        (145, 366),
        (374, 364),
        (4, 182),
        (2, 451),
        (168, 253),
        (61, 143),
        (291, 142),
        (0, 27),
        (37, 29),
        (267, 26),
        (17, 135),
        (13, 453),
        (14, 415),
        (152, 61),
    ];
    let Some(shared) = std::env::var_os("FABRIG_SHARED") else {
        return;
    };
    let path = Path::new(&shared).join("faces/mediapipe_canonical.obj");
    let face = fabrig_core::mesh::io::read_mesh(path).expect("a mesh");
    let mut points = vec![Point::origin(); 468];
    for (landmark, vertex) in VERTICES {
        points[landmark] = face.positions()[vertex];
    }
    let report = run(&face, &points);
    assert!(
        report.landmarks.expect("measured").median < 2.0,
        "{report:?}"
    );
    assert!(report.template_to_face.median < 0.4, "{report:?}");
}
