//! The one place where errors become Python exceptions.

use fabrig_core::Error;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

/// One exception a line: name, what it derives from, what it says.
macro_rules! exceptions {
    ($($name:ident($base:ty): $text:literal)*) => {
        $(create_exception!(fabrig, $name, $base, $text);)*

        pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
            let py = m.py();
            $(m.add(stringify!($name), py.get_type::<$name>())?;)*
            Ok(())
        }
    };
}

exceptions! {
    FabrigError(PyException): "Anything that fabrig refuses."
    InputError(FabrigError): "An argument has the wrong shape or value."
    MeshError(FabrigError): "A mesh or mesh file is not valid."
    TemplateError(FabrigError): "A template is not valid."
    RegistrationError(FabrigError): "A face could not be registered."
    LandmarkError(RegistrationError): "Landmarks could not be read."
    RigError(FabrigError): "A rig could not be built, saved or loaded."
    EditError(RigError): "Edits could not be read or applied."
    CheckError(RigError): "A rig could not be checked."
    MotionError(FabrigError): "A take is not valid."
    RetargetError(FabrigError): "A motion could not be fitted."
    SceneError(FabrigError): "A scene could not be set up or stepped."
    ClothError(SceneError): "Cloth could not be set up or stepped."
    RecordingError(FabrigError): "A recording could not be written or read."
    ExportError(FabrigError): "A face could not be written for another program."
    BatchError(FabrigError): "A batch could not be read or planned."
    RenderError(FabrigError): "A picture could not be drawn."
}

/// An argument that cannot be used, named first: `vertices: expected shape (N, 3), ...`.
pub(crate) fn input(message: impl Into<String>) -> PyErr {
    InputError::new_err(message.into())
}

/// Any error of the core as the exception of its module, with its causes.
pub(crate) fn to_py(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let mut message = error.to_string();
    let mut cause = std::error::Error::source(&error);
    while let Some(source) = cause {
        let text = source.to_string();
        if !message.ends_with(&text) {
            message = format!("{message}: {text}");
        }
        cause = source.source();
    }
    match error {
        Error::Mesh(_) | Error::MeshIo(_) | Error::OwnShapes(_) => MeshError::new_err(message),
        Error::Template(_) => TemplateError::new_err(message),
        Error::Registration(_) => RegistrationError::new_err(message),
        Error::LandmarkFile(_) => LandmarkError::new_err(message),
        Error::Edit(_) => EditError::new_err(message),
        Error::Check(_) | Error::Evaluation(_) => CheckError::new_err(message),
        Error::Rig(_) | Error::Anatomy(_) | Error::Transfer(_) | Error::Skin(_) => {
            RigError::new_err(message)
        }
        Error::Motion(_) | Error::Facs(_) => MotionError::new_err(message),
        Error::Retarget(_) => RetargetError::new_err(message),
        Error::Cloth(_) => ClothError::new_err(message),
        Error::Scene(_) => SceneError::new_err(message),
        Error::Export(_) => ExportError::new_err(message),
        Error::Recording(_) => RecordingError::new_err(message),
        Error::Batch(_) => BatchError::new_err(message),
        Error::Render(_) => RenderError::new_err(message),
        // The core may gain variants.
        _ => FabrigError::new_err(message),
    }
}
