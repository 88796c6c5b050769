//! The scene itself: its faces, where they stand, what of them is modelled and recorded.

use super::cloth::{CLOTH, CONTACT, MATERIAL, WRINKLES};
use super::world::{COLLIDER, FORCE, SHAKE, TURBULENCE};
use super::{Key, Kind, NAMES, PLACE, RATE, TIME, from_to, positive, vector};
use crate::recording::RecordedKind;
use crate::scene::Tolerance;

pub(in crate::scene::text) const SCENE: &[Key] = &[
    Key::new(
        "dynamics",
        Kind::Word(&["cloth", "none"]),
        "\"none\": patches stand where the muscle shapes want them",
    ),
    Key::new(
        "gravity",
        Kind::OverTime(&vector(1e9)),
        "mm/s^2, world, +Y up; or keys over time",
    ),
    Key::new(
        "wind",
        Kind::OverTime(&vector(1e7)),
        "velocity of the air (mm/s), world, added to the take's own; or keys over time",
    ),
    Key::new(
        "head_motion",
        Kind::Head(HEAD_KEY),
        "true: from the take; false: none; or keys: { keys = [{ time = 0, rotation = [0, 0, 0] }] }",
    ),
    Key::new(
        "neck_pivot",
        PLACE,
        "what the head turns about (mm, head frame)",
    ),
    Key::new(
        "eyes",
        Kind::Word(&["shapes", "tracked"]),
        "\"tracked\": turned by the take's eye rotations, where it has them",
    ),
    Key::new(
        "skin_smoothing",
        from_to(0.0, 50.0),
        "width over which skin averages what patches do beyond their muscle shapes (mm)",
    ),
    Key::optional(
        "fps",
        positive(1e4),
        "frames a second; the (first) take's own where left out",
        "60",
    ),
    Key::optional(
        "duration",
        positive(1e6),
        "how long is simulated (s); until the (last) take ends where left out",
        "2.5",
    ),
    Key::new(
        "place",
        Kind::Table(PLACEMENT),
        "where the face stands in the world",
    ),
    Key::new("cloth", Kind::Table(CLOTH), "how the cloth is solved"),
    Key::new(
        "contact",
        Kind::Table(CONTACT),
        "what touches what, and how",
    ),
    Key::optional(
        "turbulence",
        Kind::Table(TURBULENCE),
        "gusts in the wind, carried along by it",
        "{}",
    ),
    Key::optional(
        "shake",
        Kind::Table(SHAKE),
        "a random acceleration of everything, as in a car",
        "{}",
    ),
    Key::new("simulate", Kind::Table(SIMULATE), "which patches are cloth"),
    Key::new(
        "economy",
        Kind::Table(ECONOMY),
        "what may be left out, and how far the result may then be off",
    ),
    Key::new("recording", Kind::Table(RECORDING), "what is recorded"),
    Key::new(
        "materials",
        Kind::Named(MATERIAL),
        "changes to the rig's materials by name (linear, sphincter, fat), or new ones",
    ),
    Key::new(
        "wrinkles",
        Kind::Named(WRINKLES),
        "wrinkle maps, by names of your own",
    ),
    Key::new(
        "forces",
        Kind::List(&Kind::Table(FORCE)),
        "pushes away from points",
    ),
    Key::new(
        "colliders",
        Kind::List(&Kind::Table(COLLIDER)),
        "things that the face can touch",
    ),
    Key::new(
        "faces",
        Kind::List(&Kind::Table(FACE)),
        "faces with their takes; none where rig and take are given otherwise",
    ),
];

const HEAD_KEY: &[Key] = &[
    Key::required("time", TIME, "s", "0"),
    Key::optional("position", PLACE, "from rest (mm)", "[0, 0, 0]"),
    Key::optional(
        "rotation",
        vector(1e3),
        "about the neck's pivot: an axis times an angle (rad)",
        "[0, 0.3, 0]",
    ),
];

pub(super) const PLACEMENT: &[Key] = &[
    Key::new("position", PLACE, "of the origin of the head frame (mm)"),
    Key::new(
        "turn",
        vector(1e3),
        "about it: an axis times an angle (rad); [-1.5708, 0, 0] lies the face on its back",
    ),
];

pub(super) const ECONOMY: &[Key] = &[
    Key::new(
        "tolerance",
        Kind::Tolerance(Tolerance::MOST),
        "rms over any patch against the full model (mm, or \"0.05 %\" of the face's height); \"off\" models \
         everything",
    ),
    Key::new(
        "sleep",
        Kind::Flag,
        "patches sleep while nothing acts on them",
    ),
    Key::new(
        "quasi_static",
        Kind::Flag,
        "they sleep while their muscle shapes move, too, where these alone say where they are",
    ),
    Key::new(
        "substeps",
        Kind::Flag,
        "frames take as few substeps as the motion allows",
    ),
    Key::new("skin", Kind::Flag, "skin moves only where its patches do"),
];

pub(super) const SIMULATE: &[Key] = &[
    Key::new(
        "only",
        NAMES,
        "patches, `*` for any letters; all where none is named; the rest stand on their shapes",
    ),
    Key::new("except", NAMES, "and not these"),
];

/// Names of what can be recorded.
const RECORDED: [&str; RecordedKind::NAMED.len()] = {
    let mut names = [""; RecordedKind::NAMED.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = RecordedKind::NAMED[i].0;
        i += 1;
    }
    names
};

pub(super) const RECORDING: &[Key] = &[
    Key::optional(
        "record",
        Kind::List(&Kind::Word(&RECORDED)),
        "only these; all but magnets, strain and timings where left out",
        "[\"skin\", \"weights\"]",
    ),
    Key::optional("skin_hz", RATE, "skin meshes a second, 0 for none", "30.0"),
    Key::optional("patches_hz", RATE, "patch meshes a second", "30.0"),
    Key::optional("points_hz", RATE, "point clouds a second", "10.0"),
    Key::optional(
        "strain_hz",
        RATE,
        "patches coloured by their stretch, a second",
        "0.0",
    ),
];

pub(super) const FACE: &[Key] = &[
    Key::optional(
        "name",
        Kind::Text,
        "one of its kind; that of the rig's file where left out",
        "\"ann\"",
    ),
    Key::required(
        "rig",
        Kind::Path,
        "as `fabrig rig` makes it, or a mesh, which is rigged first",
        "\"face.fabrig\"",
    ),
    Key::optional(
        "resolution",
        Kind::Text,
        "patches of a mesh: coarse, standard, fine, finest, an accuracy (0.3mm) or view size (900px)",
        "\"standard\"",
    ),
    Key::optional(
        "motion",
        Kind::Path,
        "its take; at rest where left out",
        "\"take.csv\"",
    ),
    Key::optional(
        "edits",
        Kind::Path,
        "of the rig; those beside it where left out",
        "\"face.edits.toml\"",
    ),
    Key::optional(
        "position",
        PLACE,
        "of its head frame in the world (mm)",
        "[0, 0, 0]",
    ),
    Key::optional(
        "turn",
        vector(1e3),
        "about that: an axis times an angle (rad)",
        "[0, 0, 0]",
    ),
    Key::optional("start", TIME, "when its take begins (s)", "0.0"),
    Key::optional(
        "speed",
        from_to(0.01, 100.0),
        "0.5 takes twice as long",
        "1.0",
    ),
    Key::optional(
        "head_motion",
        Kind::Head(HEAD_KEY),
        "the scene's where left out",
        "true",
    ),
    Key::optional(
        "simulate",
        Kind::Table(SIMULATE),
        "the scene's where left out",
        "{ except = [\"*_fat_*\"] }",
    ),
    Key::optional(
        "materials",
        Kind::Named(MATERIAL),
        "changes after the scene's",
        "{ fat = { stretch_resistance = 4 } }",
    ),
    Key::optional(
        "wrinkles",
        Kind::Named(WRINKLES),
        "besides the scene's",
        "{}",
    ),
];
