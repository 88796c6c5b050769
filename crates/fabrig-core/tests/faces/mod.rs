//! Rigs that several tests share: the template as a user's face, and the demo face.
#![allow(dead_code)]

pub(crate) mod stage;

use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

use fabrig_core::mesh::Mesh;
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::registration::bench::Specimen;
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
        examples: &[],
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

impl RiggedFace {
    /// Whether a vertex belongs to an eyeball, teeth or tongue.
    pub(crate) fn is_part(&self, vertex: u32) -> bool {
        let mut parts = self.rig.parts.iter();
        parts.any(|p| p.vertices.binary_search(&vertex).is_ok())
    }

    /// Whether the left and right of the registered face are mirror images to half a
    /// millimetre, all but a hundredth of it.
    pub(crate) fn is_symmetric(&self) -> bool {
        let template = template::human();
        let positions = &self.registration.positions;
        let apart = positions.iter().enumerate().filter(|(v, p)| {
            let q = positions[template.mirror[*v] as usize];
            let image = fabrig_core::Point::new(-q.x, q.y, q.z);
            (image - **p).norm() > 0.5
        });
        apart.count() * 100 < positions.len()
    }
}

static TEMPLATE: LazyLock<RiggedFace> =
    LazyLock::new(|| RiggedFace::new("template", template::human().skin.clone()));

/// The template's own skin as a user's face, through registration.
pub(crate) fn template_face() -> &'static RiggedFace {
    &TEMPLATE
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

/// A face that is no man's: long nose and chin, heavy brow, remeshed so that it shares no vertex
/// with the template.
static GOBLIN: LazyLock<RiggedFace> = LazyLock::new(|| {
    let template = template::human();
    let goblin = template::people().iter().find(|p| p.name == "goblin");
    let specimen = Specimen::person(template, goblin.expect("there is a goblin")).remeshed();
    RiggedFace::new("goblin", specimen.mesh().expect("a mesh"))
});

/// A face that is not human, registered and rigged once per test binary.
pub(crate) fn goblin() -> &'static RiggedFace {
    &GOBLIN
}

/// [`subjects`], and the goblin.
pub(crate) fn all_subjects() -> impl Iterator<Item = &'static RiggedFace> {
    subjects().chain([goblin()])
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
