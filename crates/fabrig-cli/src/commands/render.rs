//! `fabrig render`: pictures of meshes, rigs and recordings.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use fabrig_core::Point;
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::pipeline::RigFaceOptions;
use fabrig_core::recording::{RecordedFrame, RecordingReader};
use fabrig_core::render::{
    Edges, FaceLook, Framing, Image, Layer, Picture, RecordingContent, Sheet, View, mesh_layers,
    recording_layers, write_gif,
};
use fabrig_core::rig::Rig;
use fabrig_core::template::{self, Template};

use super::animate::{apply_presets, load_rig};
use super::subjects::{Subject, rig_subjects, template_subjects};
use super::{Outcome, check_output, rig};
use crate::cli::{RenderArgs, Zoom};
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &RenderArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    let views: Vec<View> = args
        .view
        .iter()
        .map(|view| view.parse().context("see `fabrig render --help`"))
        .collect::<Result<_>>()?;
    let extension = |path: &Path| path.extension().map(|e| e.to_ascii_lowercase());
    let is_gif = extension(&args.output).is_some_and(|e| e == "gif");
    let [input] = args.input.as_slice() else {
        return render_rigs(console, args, &views);
    };
    let name = input.to_string_lossy();
    let look = FaceLook::default();
    match (
        name.as_ref(),
        extension(input).as_deref().and_then(|e| e.to_str()),
    ) {
        (_, Some("mcap")) => render_recording(console, args, input, &views, is_gif),
        _ if is_gif => bail!(
            "{}: a GIF is made from a recording (.mcap)",
            args.output.display()
        ),
        ("demo", _) | (_, Some("fabrig")) => {
            let mut rig = rig_of(console, input)?;
            apply_presets(&mut rig, &args.preset)?;
            render_rig(console, args, &views, rig)
        }
        ("template", _) => render_template(console, args, &views, template::human()),
        _ if input.is_dir() => render_template(console, args, &views, &Template::load(input)?),
        _ => {
            ensure!(
                args.pose.is_empty()
                    && args.expressions.is_none()
                    && !args.all_shapes
                    && !args.patches
                    && args.zoom.is_none(),
                "{}: only a rig has poses, patches and parts to zoom in on; make one with \
                 `fabrig rig`",
                input.display()
            );
            let layers = mesh_layers(&read_mesh(input)?, &look)?;
            compose(
                console,
                args,
                &views,
                vec![Subject::plain("", layers)],
                Vec::new(),
            )
        }
    }
}

fn render_template(
    console: &Console,
    args: &RenderArgs,
    views: &[View],
    template: &Template,
) -> Result<Outcome> {
    ensure!(
        !args.patches,
        "a template alone has no patches; rig a face with `fabrig rig`"
    );
    let zoom = args.zoom.unwrap_or(default_zoom(args));
    let focus = Framing::from(zoom).points(template, template.skin.positions(), &template.jaw);
    let subjects = template_subjects(template, args)?;
    compose(console, args, views, subjects, focus)
}

/// Sheets of faces show the face, a single picture the whole head.
fn default_zoom(args: &RenderArgs) -> Zoom {
    if (args.expressions.is_some() || args.all_shapes) && !args.patches {
        Zoom::Face
    } else {
        Zoom::All
    }
}

/// A rig from its file, or that of the bundled face.
fn rig_of(console: &Console, input: &Path) -> Result<Rig> {
    if input.as_os_str() == "demo" {
        let options = RigFaceOptions::default();
        Ok(rig::rig(console, &template::demo_face(), &options)?.rig)
    } else {
        load_rig(input)
    }
}

/// What pictures of a rig hold; nothing for all of it.
fn rig_focus(rig: &Rig, args: &RenderArgs) -> Result<Vec<Point>> {
    let zoom = args.zoom.unwrap_or(default_zoom(args));
    let focus = Framing::from(zoom).points(template::human(), &rig.positions, &rig.jaw.hinge);
    ensure!(
        zoom == Zoom::All || !focus.is_empty(),
        "the rig was made with another template ({}): it cannot be zoomed in on",
        rig.template
    );
    Ok(focus)
}

fn render_rig(console: &Console, args: &RenderArgs, views: &[View], rig: Rig) -> Result<Outcome> {
    let focus = rig_focus(&rig, args)?;
    compose(
        console,
        args,
        views,
        rig_subjects(console, rig, args)?,
        focus,
    )
}

/// Several rigs in the same poses, one a row, each framed by itself.
fn render_rigs(console: &Console, args: &RenderArgs, views: &[View]) -> Result<Outcome> {
    ensure!(
        views.len() == 1,
        "several rigs are drawn from one view; give one `--view`"
    );
    let mut subjects = Vec::new();
    let mut columns = 1;
    for input in &args.input {
        ensure!(
            input.as_os_str() == "demo" || input.extension().is_some_and(|e| e == "fabrig"),
            "{}: only rigs (.fabrig, or `demo`) are drawn side by side",
            input.display()
        );
        let name = super::stem(input);
        let mut rig = rig_of(console, input)?;
        apply_presets(&mut rig, &args.preset)?;
        let mut held = rig_focus(&rig, args)?;
        let own = rig_subjects(console, rig, args)?;
        columns = own.len().max(1);
        for mut subject in own {
            if held.is_empty() {
                held = points(&subject.layers);
            }
            subject.caption = match subject.caption.as_str() {
                "" => name.clone(),
                pose => format!("{name}: {pose}"),
            };
            subject.focus.clone_from(&held);
            subjects.push(subject);
        }
    }
    compose_in(console, args, views, subjects, Vec::new(), Some(columns))
}

/// As [`compose_in`], in a grid that is about square.
fn compose(
    console: &Console,
    args: &RenderArgs,
    views: &[View],
    subjects: Vec<Subject>,
    focus: Vec<Point>,
) -> Result<Outcome> {
    compose_in(console, args, views, subjects, focus, None)
}

/// One picture per subject and view, in a grid, to a PNG. Pictures hold the points of `focus`,
/// or all of the first subject where there are none, unless a subject says otherwise.
fn compose_in(
    console: &Console,
    args: &RenderArgs,
    views: &[View],
    subjects: Vec<Subject>,
    mut focus: Vec<Point>,
    columns: Option<usize>,
) -> Result<Outcome> {
    // Every picture is framed as the first, so that poses can be compared.
    if focus.is_empty()
        && let Some(first) = subjects.first()
    {
        focus = points(&first.layers);
    }
    let columns = columns.unwrap_or(if views.len() > 1 || subjects.len() < 4 {
        views.len().max(1)
    } else {
        (subjects.len() as f64).sqrt().ceil() as usize
    });
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
            let held = if subject.focus.is_empty() {
                &focus
            } else {
                &subject.focus
            };
            sheet.push(picture(args, *view, &subject, held)?, caption);
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

/// One frame of a recording to a PNG, or all of it to a GIF.
fn render_recording(
    console: &Console,
    args: &RenderArgs,
    input: &Path,
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
    let mut readers = RecordingReader::open_all(input)?;
    let wanted = args.time.unwrap_or(0.0);
    let mut first: Option<Vec<RecordedFrame>> = None;
    let mut focus = Vec::new();
    let mut images = Vec::new();
    let mut last_subject = None;
    loop {
        // One of each face, all of one time.
        let frames = readers.iter_mut().map(RecordingReader::next_frame);
        let frames: Option<Vec<RecordedFrame>> = frames.collect::<Result<_, _>>()?;
        let Some(frames) = frames else {
            break;
        };
        let first = first.get_or_insert_with(|| frames.clone());
        let time = frames.first().map_or(0.0, |frame| frame.time_secs);
        let is_due = if is_gif {
            time + 1e-6 >= images.len() as f64 / args.fps
        } else {
            time <= wanted + 1e-6
        };
        if !is_due {
            if is_gif {
                continue;
            }
            break;
        }
        let mut layers = Vec::new();
        for (frame, first) in frames.iter().zip(first.iter()) {
            layers.extend(recording_layers(frame, first, content, &look)?);
        }
        if focus.is_empty() {
            focus = points(&layers);
        }
        let subject = Subject::plain(&format!("{time:.2} s"), layers);
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
    let subject =
        last_subject.with_context(|| format!("{} has no frame with a mesh", input.display()))?;
    compose(console, args, views, vec![subject], Vec::new())
}
