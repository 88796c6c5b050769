//! What is around a face: gusts, shaking, pushes, things to touch.

use super::{FRAME, Key, Kind, PLACE, SEED, TIME, from_to, positive, vector};

pub(super) const TURBULENCE: &[Key] = &[
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

pub(super) const SHAKE: &[Key] = &[
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

pub(super) const FORCE: &[Key] = &[
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

pub(super) const COLLIDER: &[Key] = &[
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
