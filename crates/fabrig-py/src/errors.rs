//! The one place where errors become Python exceptions.

use fabrig_core::Error;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    fabrig,
    FabrigError,
    PyException,
    "Anything that fabrig refuses."
);
create_exception!(
    fabrig,
    InputError,
    FabrigError,
    "An argument has the wrong shape or value."
);
create_exception!(
    fabrig,
    MeshError,
    FabrigError,
    "A mesh or mesh file is not valid."
);
create_exception!(
    fabrig,
    TemplateError,
    FabrigError,
    "A template is not valid."
);
create_exception!(
    fabrig,
    RegistrationError,
    FabrigError,
    "A face could not be registered."
);
create_exception!(
    fabrig,
    RigError,
    FabrigError,
    "A rig could not be built, saved or loaded."
);
create_exception!(fabrig, MotionError, FabrigError, "A take is not valid.");
create_exception!(
    fabrig,
    SceneError,
    FabrigError,
    "A scene could not be set up or stepped."
);
create_exception!(
    fabrig,
    RecordingError,
    FabrigError,
    "A recording could not be written."
);

create_exception!(
    fabrig,
    ExportError,
    FabrigError,
    "A face could not be written for another program."
);

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = m.py();
    m.add("FabrigError", py.get_type::<FabrigError>())?;
    m.add("InputError", py.get_type::<InputError>())?;
    m.add("MeshError", py.get_type::<MeshError>())?;
    m.add("TemplateError", py.get_type::<TemplateError>())?;
    m.add("RegistrationError", py.get_type::<RegistrationError>())?;
    m.add("RigError", py.get_type::<RigError>())?;
    m.add("MotionError", py.get_type::<MotionError>())?;
    m.add("SceneError", py.get_type::<SceneError>())?;
    m.add("ExportError", py.get_type::<ExportError>())?;
    m.add("RecordingError", py.get_type::<RecordingError>())
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
        Error::Mesh(_) | Error::MeshIo(_) => MeshError::new_err(message),
        Error::Template(_) => TemplateError::new_err(message),
        Error::Registration(_) => RegistrationError::new_err(message),
        Error::Rig(_)
        | Error::Check(_)
        | Error::Edit(_)
        | Error::Anatomy(_)
        | Error::Transfer(_)
        | Error::Skin(_) => RigError::new_err(message),
        Error::Motion(_) | Error::Facs(_) => MotionError::new_err(message),
        Error::Scene(_) | Error::Cloth(_) => SceneError::new_err(message),
        Error::Export(_) => ExportError::new_err(message),
        Error::Recording(_) => RecordingError::new_err(message),
        // The core may gain variants.
        _ => FabrigError::new_err(message),
    }
}
