//! Rigs that several tests share: the template as a user's face, and the demo face.
#![allow(dead_code)]

use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

use fabrig_core::mesh::Mesh;
use fabrig_core::registration::{Registration, RegistrationOptions, register};
use fabrig_core::rig::{FaceOnTemplate, Rig, RigOptions, build, places_of_self};
use fabrig_core::scene::FacePose;
use fabrig_core::template;

/// The template's own skin, registered exactly.
pub(crate) fn template_rig() -> Rig {
    let template = template::human();
    let places = places_of_self(template);
    let face = FaceOnTemplate {
        face: &template.skin,
        to_head: nalgebra::Similarity3::identity(),
        positions: template.skin.positions(),
        places: &places,
        rigid: &[],
        report: String::new(),
    };
    build(&face, template, &RigOptions::default()).expect("the template can be rigged")
}

/// The demo face with its registration.
pub(crate) struct DemoFace {
    pub(crate) mesh: Mesh,
    pub(crate) registration: Registration,
    pub(crate) rig: Arc<Rig>,
}

static DEMO: LazyLock<DemoFace> = LazyLock::new(|| {
    let template = template::human();
    let mesh = template::demo_face();
    let registration = register(
        &mesh,
        template,
        &RegistrationOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    )
    .expect("the demo face registers");
    let face = FaceOnTemplate::from_registration(&mesh, &registration).expect("a report");
    let rig = build(&face, template, &RigOptions::default()).expect("the demo face can be rigged");
    DemoFace {
        rig: Arc::new(rig),
        registration,
        mesh,
    }
});

/// The demo face, registered and rigged once per test binary.
pub(crate) fn demo() -> &'static DemoFace {
    &DEMO
}

/// A pose with some shapes on, by name.
pub(crate) fn pose(rig: &Rig, shapes: &[(&str, f32)]) -> FacePose {
    let mut pose = FacePose::neutral(rig.shape_names.len());
    for (name, weight) in shapes {
        let index = rig.shape_index(name).expect("a shape of the template");
        pose.weights[index] = *weight;
    }
    pose
}
