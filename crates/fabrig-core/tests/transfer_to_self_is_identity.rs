//! The template rigged as a user's face gives back its own whole-face shapes: muscle shapes,
//! patches and skin weights lose little on the way, and skin that a shape leaves still stays.
//! `fabrig bench chain` prints the table.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::scene::{Scene, chain_loss};
use fabrig_core::template;

#[test]
fn every_shape_comes_back_through_patches_and_skin() {
    let rig = Arc::new(faces::template_rig());
    let template = template::human();
    let losses = chain_loss(&rig, template, &Scene::without_dynamics()).unwrap();
    assert_eq!(losses.len(), template.shapes.len());
    let mut failures = Vec::new();
    for loss in &losses {
        let (moved, contours, still) = (&loss.moved, &loss.contours, &loss.still);
        let is_lossy = moved.mean >= 0.3 || moved.percentile_95 >= 1.0 || contours.mean >= 0.5;
        let leaks = still.percentile_95 >= 0.1 || still.max >= 0.6;
        if is_lossy || leaks {
            failures.push(format!(
                "{}: mean {:.3}, 95 % {:.3}, contours {:.3}, still skin 95 % {:.3}, max {:.3} mm",
                loss.shape,
                moved.mean,
                moved.percentile_95,
                contours.mean,
                still.percentile_95,
                still.max
            ));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
