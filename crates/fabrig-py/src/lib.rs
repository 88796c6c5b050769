//! Python bindings of fabrig; `python/fabrig/__init__.py` is what users import.
//!
//! One file per module of the core. Arrays are checked in `arrays` alone, errors mapped in
//! `errors` alone. Long calls run detached from the interpreter; `progress` attaches to report
//! and to look for Ctrl-C.

mod arrays;
mod batch;
mod bench;
mod cloth;
mod edits;
mod errors;
mod export;
mod facs;
mod mesh;
mod motion;
mod pipeline;
mod pose;
mod progress;
mod recording;
mod registration;
mod render;
mod retarget;
mod rig;
mod simulation;
mod template;

use fabrig_core::facs::ARKIT_SHAPES;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

#[pymodule]
fn _fabrig(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("ARKIT_SHAPES", PyTuple::new(m.py(), ARKIT_SHAPES)?)?;
    errors::register(m)?;
    m.add_class::<batch::PyBatchPlan>()?;
    m.add_class::<cloth::PyCloth>()?;
    m.add_class::<edits::PyEdits>()?;
    m.add_class::<mesh::PyMesh>()?;
    m.add_class::<motion::PyClip>()?;
    m.add_class::<recording::PyRecordedFrame>()?;
    m.add_class::<recording::PyRecording>()?;
    m.add_class::<registration::PyRegistration>()?;
    m.add_class::<rig::PyRig>()?;
    m.add_class::<simulation::PySimulation>()?;
    m.add_class::<template::PyTemplate>()?;
    m.add_function(wrap_pyfunction!(batch::batch_job, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_chain, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_pareto, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_registration, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_registration_cost, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_runtime, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_stability, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench_table3, m)?)?;
    m.add_function(wrap_pyfunction!(export::convert, m)?)?;
    m.add_function(wrap_pyfunction!(facs::action_units, m)?)?;
    m.add_function(wrap_pyfunction!(facs::weights_of_units, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::demo_face, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::read_mesh, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::read_shapes, m)?)?;
    m.add_function(wrap_pyfunction!(motion::demo_take, m)?)?;
    m.add_function(wrap_pyfunction!(motion::parse_motion, m)?)?;
    m.add_function(wrap_pyfunction!(motion::read_motion, m)?)?;
    m.add_function(wrap_pyfunction!(pipeline::animate, m)?)?;
    m.add_function(wrap_pyfunction!(pipeline::animate_scene, m)?)?;
    m.add_function(wrap_pyfunction!(pipeline::rig, m)?)?;
    m.add_function(wrap_pyfunction!(registration::register_face, m)?)?;
    m.add_function(wrap_pyfunction!(render::write_gif, m)?)?;
    m.add_function(wrap_pyfunction!(render::write_png, m)?)?;
    m.add_function(wrap_pyfunction!(retarget::retarget, m)?)?;
    m.add_function(wrap_pyfunction!(simulation::demo_scene, m)?)?;
    m.add_function(wrap_pyfunction!(simulation::read_scene, m)?)?;
    m.add_function(wrap_pyfunction!(template::template_pack, m)?)?;
    // What is public is said by the package; the stub has no list of its own.
    m.delattr("__all__")
}
