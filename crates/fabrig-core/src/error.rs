//! One error over all modules, for callers who do not care which step failed.

/// Any error of the crate; each shows as the module's own.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum Error {
    #[error(transparent)]
    Mesh(#[from] crate::mesh::MeshError),
    #[error(transparent)]
    MeshIo(#[from] crate::mesh::io::MeshIoError),
    #[error(transparent)]
    Template(#[from] crate::template::TemplateError),
    #[error(transparent)]
    Registration(#[from] crate::registration::RegistrationError),
    #[error(transparent)]
    LandmarkFile(#[from] crate::registration::LandmarkFileError),
    #[error(transparent)]
    Anatomy(#[from] crate::anatomy::AnatomyError),
    #[error(transparent)]
    Transfer(#[from] crate::transfer::TransferError),
    #[error(transparent)]
    Skin(#[from] crate::skin::SkinError),
    #[error(transparent)]
    Rig(#[from] crate::rig::RigError),
    #[error(transparent)]
    OwnShapes(#[from] crate::pipeline::OwnShapesError),
    #[error(transparent)]
    Check(#[from] crate::evaluation::CheckError),
    #[error(transparent)]
    Evaluation(#[from] crate::evaluation::Table3Error),
    #[error(transparent)]
    Edit(#[from] crate::edit::EditError),
    #[error(transparent)]
    Facs(#[from] crate::facs::FacsError),
    #[error(transparent)]
    Motion(#[from] crate::motion::MotionError),
    #[error(transparent)]
    Retarget(#[from] crate::retarget::RetargetError),
    #[error(transparent)]
    Cloth(#[from] crate::cloth::ClothError),
    #[error(transparent)]
    Scene(#[from] crate::scene::SceneError),
    #[error(transparent)]
    Export(#[from] crate::export::ExportError),
    #[cfg(feature = "render")]
    #[error(transparent)]
    Render(#[from] crate::render::RenderError),
    #[error(transparent)]
    Batch(#[from] crate::batch::BatchError),
    #[error(transparent)]
    Recording(#[from] crate::recording::RecordingError),
}
