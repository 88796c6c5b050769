//! Looks at a mesh, the template (`template`) or a recording's first frame: renders a PNG.
//!
//! ```text
//! cargo run --release -p fabrig-core --features render --example look -- MESH.obj OUT.png \
//!     [--view front+three_quarter+side] [--size 640] [--edges] [--focus X,Y,Z,R]
//! ```
//!
//! Several views, separated by `+`, stand side by side. `--focus` frames a ball in place of
//! the whole mesh (the mesh's own units).

use std::error::Error;

use fabrig_core::Point;
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::recording::RecordingReader;
use fabrig_core::render::{
    Edges, FaceLook, Picture, RecordingContent, Sheet, View, mesh_layers, recording_layers,
    template_layers,
};
use fabrig_core::template::human;

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = Vec::new();
    let mut views = "front".to_owned();
    let mut size = 640u32;
    let mut has_edges = false;
    let mut focus = Vec::new();
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--view" => views = value()?,
            "--size" => size = value()?.parse()?,
            "--edges" => has_edges = true,
            "--focus" => {
                let text = value()?;
                let numbers: Vec<f64> =
                    text.split(',').map(str::parse).collect::<Result<_, _>>()?;
                let [x, y, z, r] = numbers[..] else {
                    return Err("--focus needs X,Y,Z,R".into());
                };
                for sign in [-1.0, 1.0] {
                    focus.push(Point::new(x + sign * r, y + sign * r, z));
                    focus.push(Point::new(x, y - sign * r, z + sign * r));
                }
            }
            _ => files.push(arg),
        }
    }
    let [input, output] = &files[..] else {
        return Err("usage: look MESH.obj OUT.png [--view a+b] [--size N] [--edges]".into());
    };
    let look = FaceLook::default();
    let mut layers = if input == "template" {
        template_layers(human(), &look)?
    } else if input.ends_with(".mcap") {
        let frame = RecordingReader::with_recovery(input)?.next_frame()?;
        let frame = frame.ok_or("the recording has no frame")?;
        recording_layers(&frame, &frame, RecordingContent::Both, &look)?
    } else {
        mesh_layers(&read_mesh(input)?, &look)?
    };
    if has_edges {
        layers = layers
            .into_iter()
            .map(|layer| layer.with_edges(Edges::default()))
            .collect();
    }
    let mut sheet = Sheet::new();
    let views: Vec<&str> = views.split('+').collect();
    for name in &views {
        let picture = Picture::new(size, size)
            .with_view(name.parse::<View>()?)
            .with_focus(focus.clone())
            .with_layers(layers.clone());
        sheet.push(picture.render()?, *name);
    }
    sheet.compose(views.len() as u32)?.save_png(output)?;
    Ok(())
}
