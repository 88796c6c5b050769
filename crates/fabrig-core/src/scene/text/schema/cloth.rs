//! What patches are made of, how they are solved, what they touch.

use super::{Key, Kind, NAMES, SEED, from_to, positive, vector};

pub(super) const CLOTH: &[Key] = &[
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

pub(super) const CONTACT: &[Key] = &[
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
    Key::new(
        "every",
        Kind::Integer { low: 1, high: 64 },
        "substeps from one pass of contact to the next, at most",
    ),
    Key::optional(
        "sticky_lips",
        Kind::Table(STICKY),
        "lips that stick; they do not where left out",
        "{ gap = 0.5, break_gap = 6.0, strength = 0.0022, rows = 3 }",
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
        "0.0022",
    ),
    Key::optional(
        "rows",
        Kind::Integer { low: 0, high: 1000 },
        "of the lips that can stick, from the margin outwards",
        "3",
    ),
];

const RESISTANCE: Kind = from_to(0.0, 1e12);

pub(in crate::scene::text) const MATERIAL: &[Key] = &[
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

pub(super) const WRINKLES: &[Key] = &[
    Key::optional(
        "map",
        Kind::Path,
        "a PNG in texture coordinates, or a text of one number in [0, 1] a vertex; white without",
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
    Key::optional(
        "along",
        Kind::List(&from_to(0.0, 1.0)),
        "part of the fibres' way that it is for, from and to",
        "[0.0, 1.0]",
    ),
    Key::optional(
        "narrow",
        from_to(0.0, 1.0),
        "how far skin there hangs on these patches alone, so that it shows each fold",
        "1.0",
    ),
];
