//! Contract: a face whose lips and lids are one surface is reported as fused, with a sentence
//! for each; a face whose lips and lids are shut in front of a mouth bag and sockets is not.

#[path = "faces/sewn.rs"]
mod sewn;

use std::ops::ControlFlow;

use fabrig_core::mesh::Mesh;
use fabrig_core::registration::{
    OpeningState, Registration, RegistrationOptions, RegistrationReport, register,
};
use fabrig_core::template;

fn run(face: &Mesh) -> Registration {
    register(
        face,
        template::human(),
        &RegistrationOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    )
    .expect("the face registers")
}

fn states(report: &RegistrationReport) -> [OpeningState; 3] {
    let o = &report.openings;
    [o.mouth, o.eyes[0], o.eyes[1]].map(|m| m.state)
}

#[test]
fn the_template_sewn_shut_is_fused_at_mouth_and_eyes() {
    let report = run(&sewn::template()).report;
    assert_eq!(
        states(&report),
        [OpeningState::Fused; 3],
        "{:?}",
        report.openings
    );
    for name in ["the lips", "left eye", "right eye"] {
        let told = report.warnings.iter().filter(|w| w.contains(name));
        assert_eq!(told.count(), 1, "{name}: {:?}", report.warnings);
    }
    assert!(report.fused_mouth() && report.fused_eyes() == [true; 2]);
}

#[test]
fn the_demo_face_is_open_and_fused_once_it_is_sewn_shut() {
    let face = template::demo_face();
    let found = run(&face);
    assert_eq!(states(&found.report), [OpeningState::Open; 3]);
    let shut = sewn::registered(&face, &found, template::human());
    let report = run(&shut).report;
    assert_eq!(
        states(&report),
        [OpeningState::Fused; 3],
        "{:?}",
        report.openings
    );
}

#[test]
fn closed_lids_before_sockets_are_no_fused_lids() {
    let template = template::human();
    let mut positions = template.skin.positions().to_vec();
    for shape in template
        .shapes
        .iter()
        .filter(|s| s.name.starts_with("eyeBlink"))
    {
        for (v, delta) in &shape.deltas {
            positions[*v as usize] += delta.cast();
        }
    }
    let face = template.skin.with_positions(positions).expect("finite");
    let report = run(&face).report;
    for state in states(&report) {
        assert_ne!(state, OpeningState::Fused, "{:?}", report.openings);
    }
}
