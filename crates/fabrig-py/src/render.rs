//! Pictures, as arrays.

use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::Point;
use fabrig_core::mesh::Mesh;
use fabrig_core::recording::RecordedFrame;
use fabrig_core::render::{
    Edges, FaceLook, Framing, Image, Label, Layer, Picture, RecordingContent, RenderError, View,
    mesh_layers, posed_template_layers, recording_layers, simulation_labels, simulation_layers,
    simulation_patch_layers, write_gif as write_frames,
};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};
use fabrig_core::template::{Template, human};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::{input, to_py};
use crate::pipeline::one_of;
use crate::progress::interruptible;

const FRAMINGS: [(&str, Framing); 5] = [
    ("all", Framing::All),
    ("face", Framing::Face),
    ("mouth", Framing::Mouth),
    ("eyes", Framing::Eyes),
    ("eye", Framing::Eye),
];

/// How a picture is taken, whatever of.
#[derive(Clone, Copy)]
pub(crate) struct Shot {
    view: View,
    size: u32,
    has_edges: bool,
    framing: Framing,
}

impl Shot {
    pub(crate) fn new(view: &str, size: u32, edges: bool) -> PyResult<Self> {
        if !(16..=8192).contains(&size) {
            return Err(input(format!(
                "size: {size} is not a number of pixels from 16 to 8192"
            )));
        }
        let view = view.parse().map_err(|e: RenderError| to_py(e))?;
        Ok(Self {
            view,
            size,
            has_edges: edges,
            framing: Framing::All,
        })
    }

    pub(crate) fn framed(self, zoom: &str) -> PyResult<Self> {
        Ok(Self {
            framing: one_of("zoom", zoom, &FRAMINGS)?,
            ..self
        })
    }

    fn draw(
        self,
        layers: Vec<Layer>,
        labels: Vec<Label>,
        focus: Vec<Point>,
    ) -> Result<Image, RenderError> {
        let layers = layers.into_iter().map(|layer| {
            if self.has_edges {
                layer.with_edges(Edges::default())
            } else {
                layer
            }
        });
        // Names stand beside what they name.
        let width = if labels.is_empty() {
            self.size
        } else {
            self.size * 8 / 5
        };
        let mut picture = Picture::new(width, self.size)
            .with_view(self.view)
            .with_layers(layers);
        if !labels.is_empty() {
            picture = picture.with_margins(0.05, 0.04).with_labels(labels);
        }
        if !focus.is_empty() {
            picture = picture.with_focus(focus);
        }
        picture.render()
    }
}

/// A fresh (height, width, 3) array of bytes.
fn to_array<'py>(py: Python<'py>, image: &Image) -> PyResult<Bound<'py, PyAny>> {
    let size = (image.height() as usize, image.width() as usize, 3);
    let array = Array3::from_shape_vec(size, image.bytes().to_vec())
        .map_err(|e| input(format!("picture: {e}")))?;
    Ok(array.into_pyarray(py).into_any())
}

pub(crate) fn draw_mesh<'py>(
    py: Python<'py>,
    mesh: Mesh,
    shot: Shot,
) -> PyResult<Bound<'py, PyAny>> {
    let image = interruptible(py, move || {
        shot.draw(
            mesh_layers(&mesh, &FaceLook::default())?,
            Vec::new(),
            Vec::new(),
        )
    })?;
    to_array(py, &image.map_err(to_py)?)
}

/// What of a face is shown.
#[derive(Clone, Copy)]
pub(crate) struct Content {
    pub(crate) patches: bool,
    pub(crate) names: bool,
}

fn simulated(
    simulation: &Simulation,
    shot: Shot,
    content: Content,
) -> Result<Image, fabrig_core::Error> {
    let layers = if content.patches {
        simulation_patch_layers(simulation)?
    } else {
        simulation_layers(simulation, &FaceLook::default())?
    };
    let labels = if content.names {
        simulation_labels(simulation)
    } else {
        Vec::new()
    };
    let rig = simulation.rig();
    let focus = shot.framing.points(human(), &rig.positions, &rig.jaw.hinge);
    Ok(shot.draw(layers, labels, focus)?)
}

pub(crate) fn draw_simulation<'py>(
    py: Python<'py>,
    simulation: &Simulation,
    shot: Shot,
    content: Content,
) -> PyResult<Bound<'py, PyAny>> {
    let image = py.detach(|| simulated(simulation, shot, content));
    to_array(py, &image.map_err(to_py)?)
}

/// A rig with `weights` held until it is still.
pub(crate) fn draw_rig<'py>(
    py: Python<'py>,
    rig: &Arc<Rig>,
    weights: Vec<f32>,
    scene: Scene,
    shot: Shot,
    content: Content,
) -> PyResult<Bound<'py, PyAny>> {
    let rig = Arc::clone(rig);
    let image = interruptible(py, move || {
        let mut simulation = Simulation::new(rig, scene, None)?;
        let mut pose = FacePose::neutral(weights.len());
        pose.weights = weights;
        hold_pose(&mut simulation, &pose)?;
        simulated(&simulation, shot, content)
    })?;
    to_array(py, &image.map_err(to_py)?)
}

pub(crate) fn draw_template<'py>(
    py: Python<'py>,
    template: &Arc<Template>,
    weights: Vec<f32>,
    shot: Shot,
) -> PyResult<Bound<'py, PyAny>> {
    let template = Arc::clone(template);
    let image = interruptible(py, move || {
        let layers = posed_template_layers(&template, &weights, &FaceLook::default())?;
        let skin = template.skin.positions();
        let focus = shot.framing.points(&template, skin, &template.jaw);
        shot.draw(layers, Vec::new(), focus)
    })?;
    to_array(py, &image.map_err(to_py)?)
}

pub(crate) fn draw_frame<'py>(
    py: Python<'py>,
    frame: &RecordedFrame,
    shot: Shot,
    patches: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let content = if patches {
        RecordingContent::Patches
    } else {
        RecordingContent::Face
    };
    let image = py.detach(|| {
        let layers = recording_layers(frame, frame, content, &FaceLook::default())?;
        shot.draw(layers, Vec::new(), Vec::new())
    });
    to_array(py, &image.map_err(to_py)?)
}

/// Pictures from arrays of bytes, shape (height, width, 3).
fn images(name: &str, pictures: &[PyReadonlyArray3<'_, u8>]) -> PyResult<Vec<Image>> {
    let each = pictures.iter().enumerate().map(|(index, picture)| {
        let shape = picture.shape();
        let side = |n: usize| u32::try_from(n).ok().filter(|n| *n > 0);
        let (Some(height), Some(width), 3) = (side(shape[0]), side(shape[1]), shape[2]) else {
            return Err(input(format!(
                "{name}: {index}: expected shape (height, width, 3), got {shape:?}"
            )));
        };
        let bytes = picture.as_array().iter().copied().collect();
        Image::from_bytes(width, height, bytes).map_err(to_py)
    });
    each.collect()
}

/// Writes pictures as a GIF that moves.
///
/// - `path`: the file
/// - `pictures`: arrays of bytes of one shape (height, width, 3), as `render` returns them
/// - `fps`: pictures a second
///
/// >>> mesh = fabrig.demo_face()
/// >>> fabrig.write_gif("turn.gif", [mesh.render(view=f"{yaw},0", size=64) for yaw in (0, 30)])
#[pyfunction]
#[pyo3(signature = (path, pictures, *, fps=15.0))]
pub(crate) fn write_gif(
    py: Python<'_>,
    path: PathBuf,
    pictures: Vec<PyReadonlyArray3<'_, u8>>,
    fps: f64,
) -> PyResult<()> {
    if !(fps.is_finite() && fps > 0.0) {
        return Err(input(format!("fps: {fps} is not a frame rate")));
    }
    let images = images("pictures", &pictures)?;
    py.detach(|| write_frames(path, &images, 1.0 / fps))
        .map_err(to_py)
}

/// Writes a picture as PNG.
///
/// - `path`: the file
/// - `picture`: bytes of shape (height, width, 3), as `render` returns them
///
/// >>> fabrig.write_png("face.png", fabrig.demo_face().render(size=64))
#[pyfunction]
pub(crate) fn write_png(
    py: Python<'_>,
    path: PathBuf,
    picture: PyReadonlyArray3<'_, u8>,
) -> PyResult<()> {
    let images = images("picture", std::slice::from_ref(&picture))?;
    py.detach(|| images.iter().try_for_each(|image| image.save_png(&path)))
        .map_err(to_py)
}
