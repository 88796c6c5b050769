//! Rigs that several tests share: the template as a user's face, and the demo face.
#![allow(dead_code)]

use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

use fabrig_core::mesh::Mesh;
use fabrig_core::mesh::io::read_mesh;
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

/// A user's face with its registration.
pub(crate) struct RiggedFace {
    pub(crate) name: &'static str,
    pub(crate) mesh: Mesh,
    pub(crate) registration: Registration,
    pub(crate) rig: Arc<Rig>,
}

impl RiggedFace {
    fn new(name: &'static str, mesh: Mesh) -> Self {
        let template = template::human();
        let registration = register(
            &mesh,
            template,
            &RegistrationOptions::default(),
            &mut |_| ControlFlow::Continue(()),
        )
        .expect("the face registers");
        let face = FaceOnTemplate::from_registration(&mesh, &registration).expect("a report");
        let rig = build(&face, template, &RigOptions::default()).expect("the face can be rigged");
        Self {
            name,
            rig: Arc::new(rig),
            registration,
            mesh,
        }
    }
}

static DEMO: LazyLock<RiggedFace> =
    LazyLock::new(|| RiggedFace::new("demo", template::demo_face()));

/// A face that shares nothing with the template's sources, from the folder of shared data that
/// `FABRIG_SHARED` names.
static ICT: LazyLock<Option<RiggedFace>> = LazyLock::new(|| {
    let shared = std::env::var_os("FABRIG_SHARED")?;
    let path = std::path::Path::new(&shared).join("faces/ict_neutral.obj");
    let mesh = read_mesh(&path).expect("FABRIG_SHARED has faces/ict_neutral.obj");
    Some(RiggedFace::new("ict_neutral", mesh))
});

/// The demo face, registered and rigged once per test binary.
pub(crate) fn demo() -> &'static RiggedFace {
    &DEMO
}

/// The demo face, and ict_neutral where `FABRIG_SHARED` is set.
pub(crate) fn subjects() -> impl Iterator<Item = &'static RiggedFace> {
    std::iter::once(demo()).chain(ICT.as_ref())
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
