//! `fabrig render`: pictures of meshes, rigs and recordings.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use fabrig_core::Point;
use fabrig_core::mesh::Polygons;
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::pipeline::RigFaceOptions;
use fabrig_core::recording::RecordingReader;
use fabrig_core::render::{
    Edges, FaceLook, Image, Label, Layer, Picture, RecordingContent, Rgb, Sheet, View, mesh_layers,
    patch_layer, recording_layers, template_layers, write_gif,
};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};
use fabrig_core::template;

use super::animate::load_rig;
use super::pose::{EXPRESSIONS, parse_pose};
use super::{Outcome, check_output, rig};
use crate::cli::RenderArgs;
use crate::console::Console;

/// What is in one picture before it is looked at from somewhere.
struct Subject {
    caption: String,
    layers: Vec<Layer>,
    labels: Vec<Label>,
}

pub(crate) fn run(console: &Console, args: &RenderArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    let views: Vec<View> = args
        .view
        .iter()
        .map(|view| view.parse().context("see `fabrig render --help`"))
        .collect::<Result<_>>()?;
    let extension = |path: &Path| path.extension().map(|e| e.to_ascii_lowercase());
    let is_gif = extension(&args.output).is_some_and(|e| e == "gif");
    let name = args.input.to_string_lossy();
    let look = FaceLook::default();
    match (
        name.as_ref(),
        extension(&args.input).as_deref().and_then(|e| e.to_str()),
    ) {
        (_, Some("mcap")) => render_recording(console, args, &views, is_gif),
        _ if is_gif => bail!(
            "{}: a GIF is made from a recording (.mcap)",
            args.output.display()
        ),
        ("demo", _) => {
            let rigged = rig::rig(console, &template::demo_face(), &RigFaceOptions::default())?;
            compose(
                console,
                args,
                &views,
                rig_subjects(console, rigged.rig, args)?,
            )
        }
        (_, Some("fabrig")) => {
            let rig = load_rig(&args.input)?;
            compose(console, args, &views, rig_subjects(console, rig, args)?)
        }
        ("template", _) => {
            let layers = template_layers(template::human(), &look)?;
            compose(
                console,
                args,
                &views,
                vec![Subject::plain("template", layers)],
            )
        }
        _ => {
            ensure!(
                args.pose.is_empty() && !args.expressions && !args.patches,
                "{}: only a rig has poses and patches; make one with `fabrig rig`",
                args.input.display()
            );
            let layers = mesh_layers(&read_mesh(&args.input)?, &look)?;
            compose(console, args, &views, vec![Subject::plain("", layers)])
        }
    }
}

impl Subject {
    fn plain(caption: &str, layers: Vec<Layer>) -> Self {
        Self {
            caption: caption.to_owned(),
            layers,
            labels: Vec::new(),
        }
    }
}

/// One picture per subject and view, in a grid, to a PNG.
fn compose(
    console: &Console,
    args: &RenderArgs,
    views: &[View],
    subjects: Vec<Subject>,
) -> Result<Outcome> {
    // Every picture is framed as the first, so that poses can be compared.
    let focus = subjects
        .first()
        .map(|s| points(&s.layers))
        .unwrap_or_default();
    let columns = if views.len() > 1 || subjects.len() < 4 {
        views.len().max(1)
    } else {
        (subjects.len() as f64).sqrt().ceil() as usize
    };
    let mut sheet = Sheet::new();
    let total = (subjects.len() * views.len()) as u64;
    let mut done = 0;
    for subject in subjects {
        for (view, name) in views.iter().zip(&args.view) {
            let caption = match (subject.caption.as_str(), views.len()) {
                ("", _) => name.clone(),
                (caption, 1) => caption.to_owned(),
                (caption, _) => format!("{caption}, {name}"),
            };
            sheet.push(picture(args, *view, &subject, &focus)?, caption);
            done += 1;
            if console.show("render", done, total, "").is_break() {
                bail!("stopped; nothing was written");
            }
        }
    }
    console.clear();
    sheet.compose(columns as u32)?.save_png(&args.output)?;
    console.result(&args.output.display().to_string());
    Ok(Outcome::Done)
}

fn points(layers: &[Layer]) -> Vec<Point> {
    let all = layers.iter().flat_map(|layer| layer.positions());
    all.copied().collect()
}

fn picture(args: &RenderArgs, view: View, subject: &Subject, focus: &[Point]) -> Result<Image> {
    let layers = subject.layers.iter().cloned();
    let layers = layers.map(|layer| {
        if args.edges {
            layer.with_edges(Edges::default())
        } else {
            layer
        }
    });
    // Names stand beside what they name.
    let width = if subject.labels.is_empty() {
        args.size
    } else {
        args.size * 8 / 5
    };
    let mut picture = Picture::new(width, args.size)
        .with_view(view)
        .with_focus(focus.iter().copied())
        .with_layers(layers);
    if !subject.labels.is_empty() {
        picture = picture
            .with_margins(0.05, 0.04)
            .with_labels(subject.labels.iter().cloned());
    }
    Ok(picture.render()?)
}

/// The poses asked for, or the neutral face.
fn rig_subjects(console: &Console, rig: Rig, args: &RenderArgs) -> Result<Vec<Subject>> {
    let poses: Vec<(String, Vec<f32>)> = if args.expressions {
        EXPRESSIONS
            .iter()
            .map(|(name, text)| Ok(((*name).to_owned(), parse_pose(text, &rig.shape_names)?)))
            .collect::<Result<_>>()?
    } else if args.pose.is_empty() {
        vec![(String::new(), vec![0.0; rig.shape_names.len()])]
    } else {
        args.pose
            .iter()
            .map(|text| Ok((text.clone(), parse_pose(text, &rig.shape_names)?)))
            .collect::<Result<_>>()?
    };
    let mut simulation = Simulation::new(Arc::new(rig), Scene::default(), None)?;
    let count = poses.len() as u64;
    let mut subjects = Vec::with_capacity(poses.len());
    for (index, (caption, weights)) in poses.into_iter().enumerate() {
        let mut pose = FacePose::neutral(weights.len());
        pose.weights = weights;
        hold_pose(&mut simulation, &pose)?;
        let layers = if args.patches {
            patch_layers_now(&simulation)?
        } else {
            face_layers(&simulation)?
        };
        let labels = if args.names {
            patch_labels(&simulation)
        } else {
            Vec::new()
        };
        subjects.push(Subject {
            caption,
            layers,
            labels,
        });
        if console
            .show("settle", index as u64 + 1, count, "")
            .is_break()
        {
            bail!("stopped; nothing was written");
        }
    }
    Ok(subjects)
}

/// Skin and loose parts of a simulated face.
fn face_layers(simulation: &Simulation) -> Result<Vec<Layer>> {
    let look = FaceLook::default();
    let rig = simulation.rig();
    let skin: Vec<Point> = simulation.skin().iter().map(|p| p.cast()).collect();
    let mut owner = vec![None; skin.len()];
    for (part, piece) in rig.parts.iter().enumerate() {
        for (k, &vertex) in piece.vertices.iter().enumerate() {
            owner[vertex as usize] = Some((part, k as u32));
        }
    }
    let mut skin_polygons = Polygons::new();
    let mut part_polygons = vec![Polygons::new(); rig.parts.len()];
    for face in rig.face.polygons().iter() {
        let places: Option<Vec<(usize, u32)>> = face.iter().map(|&v| owner[v as usize]).collect();
        match places {
            Some(places) => {
                let corners: Vec<u32> = places.iter().map(|p| p.1).collect();
                part_polygons[places[0].0].push(&corners);
            }
            None => skin_polygons.push(face),
        }
    }
    let mut layers = vec![look.skin(skin.clone(), &skin_polygons)?];
    for ((part, polygons), pose) in rig.parts.iter().zip(&part_polygons).zip(simulation.parts()) {
        if polygons.is_empty() {
            continue;
        }
        let positions = part.vertices.iter().map(|&v| skin[v as usize]).collect();
        let gaze = pose.motion.rotation * fabrig_core::Vector::z();
        layers.push(look.part(&part.name, positions, polygons, gaze)?);
    }
    Ok(layers)
}

fn patch_layers_now(simulation: &Simulation) -> Result<Vec<Layer>> {
    let patches = simulation.rig().patches.iter().enumerate();
    patches
        .map(|(index, patch)| {
            let nodes = simulation.patch_positions(index);
            let nodes = nodes.iter().map(|p| p.cast()).collect();
            Ok(patch_layer(&patch.patch.chart, nodes)?)
        })
        .collect()
}

fn patch_labels(simulation: &Simulation) -> Vec<Label> {
    let patches = simulation.rig().patches.iter().enumerate();
    patches
        .map(|(index, patch)| {
            let chart = &patch.patch.chart;
            let middle = chart
                .grid
                .index(chart.grid.u_count / 2, chart.grid.v_count / 2);
            Label {
                anchor: simulation.patch_positions(index)[middle].cast(),
                text: chart.name.replace('_', " "),
                color: Rgb::from_srgb(chart.color),
            }
        })
        .collect()
}

/// One frame of a recording to a PNG, or all of it to a GIF.
fn render_recording(
    console: &Console,
    args: &RenderArgs,
    views: &[View],
    is_gif: bool,
) -> Result<Outcome> {
    ensure!(
        args.fps.is_finite() && args.fps > 0.0,
        "{} frames per second is not a frame rate",
        args.fps
    );
    let content = if args.patches {
        RecordingContent::Patches
    } else {
        RecordingContent::Face
    };
    let look = FaceLook::default();
    let mut reader = RecordingReader::open(&args.input)?;
    let wanted = args.time.unwrap_or(0.0);
    let mut first = None;
    let mut focus = Vec::new();
    let mut images = Vec::new();
    let mut last_subject = None;
    while let Some(frame) = reader.next_frame()? {
        let first = first.get_or_insert_with(|| frame.clone());
        let is_due = if is_gif {
            frame.time_secs + 1e-6 >= images.len() as f64 / args.fps
        } else {
            frame.time_secs <= wanted + 1e-6
        };
        if !is_due {
            if is_gif {
                continue;
            }
            break;
        }
        let layers = recording_layers(&frame, first, content, &look)?;
        if focus.is_empty() {
            focus = points(&layers);
        }
        let subject = Subject::plain(&format!("{:.2} s", frame.time_secs), layers);
        if is_gif {
            let mut sheet = Sheet::new();
            for view in views {
                sheet.push(picture(args, *view, &subject, &focus)?, "");
            }
            images.push(sheet.compose(views.len() as u32)?);
            let detail = format!("{} frames", images.len());
            if console
                .show("render", images.len() as u64, images.len() as u64, &detail)
                .is_break()
            {
                break;
            }
        } else {
            last_subject = Some(subject);
        }
    }
    console.clear();
    if is_gif {
        write_gif(&args.output, &images, 1.0 / args.fps)?;
        console.result(&args.output.display().to_string());
        return Ok(if console.is_stopped() {
            Outcome::Partial
        } else {
            Outcome::Done
        });
    }
    let subject = last_subject
        .with_context(|| format!("{} has no frame with a mesh", args.input.display()))?;
    compose(console, args, views, vec![subject])
}
