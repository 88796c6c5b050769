//! A resolution that is chosen by an accuracy keeps to it: the skin is so near to that of the finest
//! patches.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::ops::ControlFlow;

use fabrig_core::anatomy::Resolution;
use fabrig_core::motion::parse_keys;
use fabrig_core::pipeline::{PatchDetail, resolution_rows};
use fabrig_core::template::{demo_face, demo_take, human};

/// Blink, raised brows and a frown. (frames)
const FRAMES: usize = 120;

#[test]
fn patches_are_as_fine_as_the_accuracy_asks() {
    let clip = parse_keys(demo_take(), "the bundled take").unwrap();
    let go_on = &mut |_: &str| ControlFlow::Continue(());
    let rows = resolution_rows(&demo_face(), human(), &clip, FRAMES, go_on).unwrap();
    let finest = rows.last().unwrap();
    assert_eq!((finest.nodes, finest.rms), (200_320, [0.0; 2]));
    let of = |resolution: Resolution| {
        let names = [
            (Resolution::COARSE, "coarse"),
            (Resolution::STANDARD, "standard"),
            (Resolution::FINE, "fine"),
            (Resolution::FINEST, "finest"),
        ];
        let (_, name) = names
            .iter()
            .find(|(other, _)| *other == resolution)
            .unwrap();
        rows.iter().find(|row| row.name == *name).unwrap()
    };
    let mut nodes = Vec::new();
    for accuracy in [0.5, 0.12, 0.09, 0.05] {
        let row = of(PatchDetail::Within(accuracy).resolution());
        assert!(
            row.rms[1] <= accuracy,
            "{}: {} mm where {accuracy} mm were asked",
            row.name,
            row.rms[1]
        );
        nodes.push(row.nodes);
    }
    assert_eq!(nodes, [2_010, 19_380, 50_080, 200_320]);
}
