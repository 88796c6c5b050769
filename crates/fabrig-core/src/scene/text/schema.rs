//! Every key that a scene's text may have: what it takes, what it means, and an example of those
//! that have no default.
//!
//! Tests hold this against the types that it describes and the ranges that other modules check.

/// A key of a table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Key {
    pub(super) name: &'static str,
    pub(super) kind: Kind,
    /// One line, with the unit.
    pub(super) about: &'static str,
    /// A value, as text, of a key that has no default.
    pub(super) example: &'static str,
    pub(super) is_required: bool,
}

impl Key {
    pub(super) const fn new(name: &'static str, kind: Kind, about: &'static str) -> Self {
        Self::optional(name, kind, about, "")
    }

    pub(super) const fn optional(
        name: &'static str,
        kind: Kind,
        about: &'static str,
        example: &'static str,
    ) -> Self {
        Self {
            name,
            kind,
            about,
            example,
            is_required: false,
        }
    }

    pub(super) const fn required(
        name: &'static str,
        kind: Kind,
        about: &'static str,
        example: &'static str,
    ) -> Self {
        Self {
            is_required: true,
            ..Self::optional(name, kind, about, example)
        }
    }
}

/// What a key takes.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    Flag,
    Number {
        low: f64,
        high: f64,
    },
    Integer {
        low: u64,
        high: u64,
    },
    Text,
    /// A file.
    Path,
    Word(&'static [&'static str]),
    /// Three numbers, each up to `limit` in size.
    Vector {
        limit: f64,
    },
    Table(&'static [Key]),
    /// Tables by names of the writer's own.
    Named(&'static [Key]),
    List(&'static Kind),
    /// Tables with a rising `time`, at least one.
    Keys(&'static [Key]),
    /// A value, or keys with `time` and `value`.
    OverTime(&'static Kind),
    /// Whether the take moves the head, or keys.
    Head(&'static [Key]),
    /// A table whose `type` says what other keys it has.
    Tagged(&'static [(&'static str, &'static [Key])]),
}

impl Kind {
    /// What is expected, in words.
    pub(super) fn in_words(&self) -> String {
        match self {
            Self::Flag => "true or false".to_owned(),
            Self::Number { low, high } if *low == f64::MIN_POSITIVE => {
                format!("a number above 0, at most {high}")
            }
            Self::Number { low, high } => format!("a number from {low} to {high}"),
            Self::Integer { low, high } => format!("a whole number from {low} to {high}"),
            Self::Text => "a text".to_owned(),
            Self::Path => "the path of a file, as text".to_owned(),
            Self::Word(words) => format!("one of {}", quoted(words.iter())),
            Self::Vector { .. } => "three numbers [x, y, z]".to_owned(),
            Self::Table(_) | Self::Named(_) => "a table".to_owned(),
            Self::List(inner) => format!("a list, each {}", inner.in_words()),
            Self::Keys(_) => "a list of at least one key, a table each".to_owned(),
            Self::OverTime(inner) => {
                format!(
                    "{}, or {{ join = \"straight\", keys = [{{ time = 0, value = ... }}, ...] }}",
                    inner.in_words()
                )
            }
            Self::Head(_) => "true, false, or { keys = [{ time = 0, position = [0, 0, 0], \
                              rotation = [0, 0, 0] }, ...] }"
                .to_owned(),
            Self::Tagged(variants) => {
                format!("one of {}", quoted(variants.iter().map(|(name, _)| name)))
            }
        }
    }
}

fn quoted<'a>(words: impl Iterator<Item = &'a &'a str>) -> String {
    let words: Vec<String> = words.map(|word| format!("'{word}'")).collect();
    words.join(", ")
}

const fn from_to(low: f64, high: f64) -> Kind {
    Kind::Number { low, high }
}

const fn positive(high: f64) -> Kind {
    Kind::Number {
        low: f64::MIN_POSITIVE,
        high,
    }
}

const fn vector(limit: f64) -> Kind {
    Kind::Vector { limit }
}

const SEED: Kind = Kind::Integer {
    low: 0,
    high: i64::MAX as u64,
};
const TIME: Kind = from_to(-1e6, 1e6);
const PLACE: Kind = vector(1e6);
const RATE: Kind = from_to(0.0, 1e6);
const FRAME: Kind = Kind::Word(&["world", "head"]);
const NAMES: Kind = Kind::List(&Kind::Text);

/// How keys are joined.
pub(super) const JOIN: Kind = Kind::Word(&["straight", "smooth"]);

/// A scene.
pub(super) const SCENE: &[Key] = &[
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

/// A key of [`Kind::Head`].
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

const PLACEMENT: &[Key] = &[
    Key::new("position", PLACE, "of the origin of the head frame (mm)"),
    Key::new(
        "turn",
        vector(1e3),
        "about it: an axis times an angle (rad); [-1.5708, 0, 0] lies the face on its back",
    ),
];

const CLOTH: &[Key] = &[
    Key::new(
        "substeps",
        Kind::Integer { low: 1, high: 4096 },
        "per 1/60 s",
    ),
    Key::new(
        "rest_blend",
        from_to(0.0, 1.0),
        "how far lengths follow the muscle shapes: 0 keeps them (wrinkles), 1 wholly",
    ),
    Key::new(
        "rest_imperfection",
        from_to(0.0, 1.0),
        "relative variation of that from edge to edge, which decides how skin buckles",
    ),
    Key::new("seed", SEED, "of that variation"),
    Key::new(
        "standing_gravity",
        vector(1e9),
        "under which the face was captured (mm/s^2, head frame)",
    ),
    Key::new(
        "areal_density",
        from_to(1e-9, 1e9),
        "mass of tissue against which wind works (g/mm^2)",
    ),
    Key::new("air_density", from_to(0.0, 1.0), "g/mm^3"),
    Key::new(
        "drag",
        from_to(0.0, 1e3),
        "drag coefficient of skin in wind",
    ),
    Key::new(
        "lift",
        from_to(0.0, 1e3),
        "lift coefficient of skin in wind",
    ),
    Key::new(
        "mode",
        Kind::Word(&["fast", "robust", "paper"]),
        "\"robust\": several times as dear, never gains energy; \"paper\": a baseline",
    ),
    Key::new("sweeps", Kind::Integer { low: 1, high: 64 }, "per substep"),
    Key::new(
        "integrator",
        Kind::Word(&["bdf2", "backward_euler"]),
        "order of the time steps",
    ),
    Key::new(
        "precision",
        Kind::Word(&["single", "single_scalar", "double"]),
        "arithmetic",
    ),
];

const CONTACT: &[Key] = &[
    Key::new(
        "pairs",
        Kind::Word(&["none", "sphincter", "all"]),
        "which patches collide: none, lips and lids, or all",
    ),
    Key::new(
        "thickness",
        from_to(1e-3, 2.0),
        "distance that patches keep (mm), or what they have at rest if that is less",
    ),
    Key::new("friction", from_to(0.0, 10.0), "Coulomb's, between patches"),
    Key::new("eye_friction", from_to(0.0, 10.0), "of lids on eyeballs"),
    Key::new(
        "bones",
        Kind::Flag,
        "whether eyeballs, teeth and gums hold patches out",
    ),
    Key::optional(
        "sticky_lips",
        Kind::Table(STICKY),
        "lips that stick; they do not where left out",
        "{ gap = 0.5, break_gap = 6.0, strength = 0.003, rows = 3 }",
    ),
];

const STICKY: &[Key] = &[
    Key::optional(
        "gap",
        from_to(0.0, 5.0),
        "bonds form under this gap (mm)",
        "0.5",
    ),
    Key::optional(
        "break_gap",
        from_to(0.0, 20.0),
        "and break when drawn this much longer (mm)",
        "6.0",
    ),
    Key::optional(
        "strength",
        from_to(0.0, 1e3),
        "or pull harder than this (N of one node)",
        "0.003",
    ),
    Key::optional(
        "rows",
        Kind::Integer { low: 0, high: 1000 },
        "of the lips that can stick, from the margin outwards",
        "3",
    ),
];

const TURBULENCE: &[Key] = &[
    Key::optional(
        "intensity",
        from_to(0.0, 1e6),
        "root mean square of each component (mm/s)",
        "1000.0",
    ),
    Key::optional(
        "length",
        from_to(0.1, 1e6),
        "over which gusts are alike (mm)",
        "150.0",
    ),
    Key::optional(
        "time",
        from_to(1e-4, 1e6),
        "over which they change (s)",
        "0.5",
    ),
    Key::optional(
        "seed",
        SEED,
        "another one is other weather of the same kind",
        "0",
    ),
];

const SHAKE: &[Key] = &[
    Key::optional(
        "intensity",
        from_to(0.0, 1e6),
        "root mean square of each component (mm/s^2)",
        "2000.0",
    ),
    Key::optional(
        "time",
        from_to(1e-4, 1e6),
        "over which it changes (s)",
        "0.05",
    ),
    Key::optional("seed", SEED, "another one is another road", "0"),
];

const SIMULATE: &[Key] = &[
    Key::new(
        "only",
        NAMES,
        "patches, `*` for any letters; all where none is named; the rest stand on their shapes",
    ),
    Key::new("except", NAMES, "and not these"),
];

const RECORDING: &[Key] = &[
    Key::optional(
        "record",
        Kind::List(&Kind::Word(&[
            "skin",
            "patches",
            "points",
            "magnets",
            "strain",
            "contacts",
            "colliders",
            "weights",
            "energies",
            "errors",
            "timings",
        ])),
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

const RESISTANCE: Kind = from_to(0.0, 1e12);

pub(super) const MATERIAL: &[Key] = &[
    Key::optional(
        "like",
        Kind::Text,
        "the material to start from; its own where there is one",
        "\"fat\"",
    ),
    Key::optional("mass", positive(1e12), "of a node", "1.0"),
    Key::optional(
        "stretch_resistance",
        RESISTANCE,
        "of edges that are too long",
        "8.0",
    ),
    Key::optional(
        "compression_resistance",
        RESISTANCE,
        "of edges that are too short",
        "8.0",
    ),
    Key::optional("shear_resistance", RESISTANCE, "of diagonals", "4.0"),
    Key::optional(
        "bend_resistance",
        RESISTANCE,
        "to bending more than the shapes do; less makes finer wrinkles",
        "3.0",
    ),
    Key::optional(
        "bend_angle_dropoff",
        from_to(0.0, 0.999),
        "0: all bends are resisted alike; towards 1: small ones less",
        "0.3",
    ),
    Key::optional(
        "damping",
        from_to(0.0, 1e6),
        "of velocity in the head frame (1/s)",
        "1.5",
    ),
    Key::optional(
        "stretch_damping",
        from_to(0.0, 1e6),
        "of changes of length",
        "0.2",
    ),
    Key::optional(
        "pressure",
        RESISTANCE,
        "to changes of the volume under a patch",
        "0.3",
    ),
    Key::optional(
        "magnet_frequency_hz",
        from_to(0.0, 1e6),
        "at which a lone node swings about its shape (Hz)",
        "7.0",
    ),
    Key::optional(
        "magnet_damping_ratio",
        from_to(0.0, 1e6),
        "of that swing, 1 = critical",
        "0.12",
    ),
];

const WRINKLES: &[Key] = &[
    Key::required(
        "map",
        Kind::Path,
        "a PNG in texture coordinates, or a text of one number in [0, 1] a vertex",
        "\"forehead.png\"",
    ),
    Key::optional(
        "patches",
        NAMES,
        "that it is for; all where none is named",
        "[\"frontalis_l\"]",
    ),
    Key::optional(
        "stretch",
        from_to(1e-3, 1e3),
        "factor of resistance to stretch where the map is 1",
        "1.0",
    ),
    Key::optional(
        "bend",
        from_to(1e-3, 1e3),
        "factor of resistance to bending",
        "1.0",
    ),
    Key::optional(
        "rest_blend",
        from_to(0.0, 1.0),
        "factor of `cloth.rest_blend`: 0 lets skin fold",
        "0.0",
    ),
];

const FORCE: &[Key] = &[
    Key::required("name", Kind::Text, "one of its kind", "\"fan\""),
    Key::optional("frame", FRAME, "what `center` is given in", "\"world\""),
    Key::required(
        "center",
        PLACE,
        "where it pushes from (mm)",
        "[150, 0, 100]",
    ),
    Key::required(
        "strength",
        Kind::OverTime(&from_to(-1e9, 1e9)),
        "acceleration at the centre (mm/s^2), negative pulls; or keys over time",
        "8000",
    ),
    Key::required(
        "reach",
        positive(1e6),
        "from here on there is none (mm)",
        "300",
    ),
    Key::optional(
        "falloff",
        Kind::Word(&["smooth", "linear", "none"]),
        "how it weakens up to there",
        "\"smooth\"",
    ),
    Key::optional(
        "flicker",
        from_to(0.0, 10.0),
        "random relative change of it",
        "0.0",
    ),
    Key::optional(
        "flicker_time",
        from_to(1e-4, 1e6),
        "over which that changes (s)",
        "0.1",
    ),
    Key::optional("seed", SEED, "of the flicker", "0"),
];

const SIZE: Kind = positive(1e5);

const COLLIDER: &[Key] = &[
    Key::required("name", Kind::Text, "one of its kind", "\"finger\""),
    Key::required(
        "shape",
        Kind::Tagged(&[
            ("ball", &[Key::required("radius", SIZE, "mm", "")]),
            (
                "capsule",
                &[
                    Key::required("half_length", SIZE, "of the straight part (mm)", ""),
                    Key::required("radius", SIZE, "mm", ""),
                ],
            ),
            (
                "cuboid",
                &[Key::required("half_extents", vector(1e5), "mm", "")],
            ),
            (
                "convex_hull",
                &[Key::required("points", Kind::List(&PLACE), "mm", "")],
            ),
            (
                "triangle_mesh",
                &[
                    Key::required("vertices", Kind::List(&PLACE), "mm", ""),
                    Key::required(
                        "triangles",
                        Kind::List(&Kind::List(&Kind::Integer {
                            low: 0,
                            high: u32::MAX as u64,
                        })),
                        "indices of vertices",
                        "",
                    ),
                ],
            ),
            ("plane", &[]),
        ]),
        "ball, capsule, cuboid, convex_hull, triangle_mesh or plane (mm)",
        "{ type = \"capsule\", half_length = 25, radius = 7 }",
    ),
    Key::optional("frame", FRAME, "what its keys are given in", "\"world\""),
    Key::optional("friction", from_to(0.0, 10.0), "Coulomb's", "0.4"),
    Key::required(
        "keys",
        Kind::Keys(&[
            Key::required("time", TIME, "s", ""),
            Key::required("position", PLACE, "mm", ""),
            Key::optional("rotation", PLACE, "an axis times an angle (rad)", ""),
        ]),
        "where it is when (s, mm), joined straight; `rotation` (rad) as well",
        "[{ time = 0, position = [100, -38, 147] }]",
    ),
];

const FACE: &[Key] = &[
    Key::optional(
        "name",
        Kind::Text,
        "one of its kind; that of the rig's file where left out",
        "\"ann\"",
    ),
    Key::required(
        "rig",
        Kind::Path,
        "as `fabrig rig` makes it",
        "\"face.fabrig\"",
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
