//! `fabrig info`: what is in a file.

use std::path::Path;

use anyhow::Result;
use fabrig_core::mesh::Mesh;
use fabrig_core::mesh::appearance::Appearance;
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::motion::{self, Clip, ReadOptions};
use fabrig_core::recording::RecordingReader;
use fabrig_core::rig::Rig;
use serde_json::{Map, Value, json};

use super::Outcome;
use super::animate::load_rig;
use crate::cli::InfoArgs;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &InfoArgs) -> Result<Outcome> {
    let facts = facts(&args.file)?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&facts)?);
    } else if let Value::Object(facts) = &facts {
        print(console, facts);
    }
    Ok(Outcome::Done)
}

fn print(console: &Console, facts: &Map<String, Value>) {
    for (name, value) in facts {
        let text = match value {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        console.result(&format!("{:<20}{text}", name.replace('_', " ")));
    }
}

fn facts(path: &Path) -> Result<Value> {
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    Ok(match extension.as_deref().and_then(|e| e.to_str()) {
        Some("fabrig") => rig_facts(&load_rig(path)?),
        Some("mcap") => recording_facts(path)?,
        Some("obj" | "ply" | "stl" | "gltf" | "glb") => mesh_facts(&read_mesh(path)?),
        _ => clip_facts(&motion::read(path, &ReadOptions::default())?),
    })
}

fn mesh_facts(mesh: &Mesh) -> Value {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in mesh.positions() {
        for axis in 0..3 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let quads = mesh.polygons().iter().filter(|f| f.len() == 4).count();
    let groups: Vec<&str> = mesh.groups().iter().map(|g| g.name.as_str()).collect();
    json!({
        "kind": "mesh",
        "vertices": mesh.vertex_count(),
        "polygons": mesh.face_count(),
        "quads": quads,
        "lowest": low,
        "highest": high,
        "has_uvs": mesh.uvs().is_some(),
        "groups": groups,
    })
}

fn rig_facts(rig: &Rig) -> Value {
    let nodes: usize = rig.patches.iter().map(|p| p.patch.neutral.len()).sum();
    let shapes: usize = rig.patches.iter().map(|p| p.transfer.shapes.len()).sum();
    let parts: Vec<&str> = rig.parts.iter().map(|p| p.name.as_str()).collect();
    let look = rig.appearance.as_ref();
    let pictures: Vec<Value> = look.map_or_else(Vec::new, |look| {
        let list = look.pictures.iter();
        list.map(|p| json!({"name": p.name, "type": p.mime, "bytes": p.bytes.len()}))
            .collect()
    });
    json!({
        "kind": "rig",
        "template": rig.template,
        "vertices": rig.face.vertex_count(),
        "polygons": rig.face.face_count(),
        "millimetres_per_unit": rig.to_head.scaling(),
        "patches": rig.patches.len(),
        "nodes": nodes,
        "muscle_shapes": shapes,
        "shapes": rig.shape_names.len(),
        "parts": parts,
        "has_uvs": rig.face.uvs().is_some(),
        "materials": look.map_or_else(Vec::new, Appearance::names),
        "pictures": pictures,
    })
}

fn clip_facts(clip: &Clip) -> Value {
    json!({
        "kind": "take",
        "frames": clip.frame_count(),
        "seconds": clip.duration(),
        "frames_per_second": clip.frame_rate(),
        "shapes": clip.channels(),
        "has_head": !clip.tracks().head.is_empty(),
        "has_eyes": !clip.tracks().eyes.is_empty(),
        "has_wind": !clip.tracks().wind.is_empty(),
        "notes": clip.notes(),
    })
}

fn recording_facts(path: &Path) -> Result<Value> {
    let mut readers = RecordingReader::open_all(path)?;
    let metadata = readers.first().map(|reader| reader.metadata().clone());
    let (mut frames, mut seconds) = (0usize, 0.0);
    let mut surfaces = Map::new();
    for (face, reader) in readers.iter_mut().enumerate() {
        let name = reader.face().to_owned();
        let is_first = face == 0;
        while let Some(frame) = reader.next_frame()? {
            if !is_first || frames == 0 {
                for surface in frame.skin.iter().chain(&frame.parts).chain(&frame.patches) {
                    let name = match name.as_str() {
                        "" => surface.info.name.clone(),
                        face => format!("{face}/{}", surface.info.name),
                    };
                    surfaces.insert(name, surface.positions.len().into());
                }
            }
            if !is_first {
                break;
            }
            frames += 1;
            seconds = frame.time_secs;
        }
    }
    Ok(json!({
        "kind": "recording",
        "metadata": metadata,
        "frames_with_meshes": frames,
        "seconds": seconds,
        "vertices_of_surfaces": surfaces,
    }))
}
