//! Python bindings of fabrig; `python/fabrig/__init__.py` is what users import.
//!
//! One file per module of the core. Arrays are checked in `arrays` alone, errors mapped in
//! `errors` alone. Long calls run detached from the interpreter and attach for progress.

mod arrays;
mod cloth;
mod errors;
mod export;
mod mesh;
mod motion;
mod pipeline;
mod progress;
mod rig;
mod simulation;
mod template;

use pyo3::prelude::*;

#[pymodule]
fn _fabrig(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::register(m)?;
    m.add_class::<cloth::PyCloth>()?;
    m.add_class::<mesh::PyMesh>()?;
    m.add_class::<rig::PyRig>()?;
    m.add_class::<motion::PyClip>()?;
    m.add_class::<simulation::PySimulation>()?;
    m.add_class::<template::PyTemplate>()?;
    m.add_function(wrap_pyfunction!(template::template_pack, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::read_mesh, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::read_shapes, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::demo_face, m)?)?;
    m.add_function(wrap_pyfunction!(motion::read_motion, m)?)?;
    m.add_function(wrap_pyfunction!(motion::demo_take, m)?)?;
    m.add_function(wrap_pyfunction!(pipeline::rig, m)?)?;
    m.add_function(wrap_pyfunction!(pipeline::animate, m)?)?;
    m.add_function(wrap_pyfunction!(export::convert, m)?)?;
    Ok(())
}
