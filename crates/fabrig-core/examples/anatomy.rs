//! Draws the anatomy of the default template as an atlas plate: muscles from the front, from
//! three quarters and from the side, and the fat pads, each in its colour with its name.
//!
//! ```text
//! cargo run --release -p fabrig-core --features render --example anatomy -- docs
//! ```
//!
//! Patches lie under the skin; parallel rays and a shift towards the viewer let them show over
//! it where they are, deeper ones under shallower ones.

use std::error::Error;
use std::path::PathBuf;

use fabrig_core::anatomy::{Patch, PatchKind, Resolution, Side, charts, lay_patches};
use fabrig_core::mesh::Surface;
use fabrig_core::render::{FaceLook, Label, Picture, Rgb, View, patch_layer, template_layers};
use fabrig_core::template::{Template, human};
use fabrig_core::{Point, Vector};

/// More than the deepest patch, less than what would bring hidden patches to light. (mm)
const SHIFT: f64 = 20.0;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: anatomy FOLDER")?);
    let template = human();
    let charts = charts(template, Resolution::STANDARD)?;
    let patches = lay_patches(template, &charts, template.skin.positions())?;
    let views = [
        ("front", View::Front),
        ("three_quarter", View::ThreeQuarter),
        ("side", View::Side),
    ];
    for (name, view) in views {
        let muscles = |p: &&Patch| p.chart.kind != PatchKind::FatPad;
        plate(template, patches.iter().filter(muscles), view)?
            .render()?
            .save_png(folder.join(format!("anatomy_{name}.png")))?;
    }
    let fat_pads = patches.iter().filter(|p| p.chart.kind == PatchKind::FatPad);
    plate(template, fat_pads, View::ThreeQuarter)?
        .render()?
        .save_png(folder.join("anatomy_fat_pads.png"))?;
    Ok(())
}

fn plate<'a>(
    template: &Template,
    patches: impl Iterator<Item = &'a Patch>,
    view: View,
) -> Result<Picture, Box<dyn Error>> {
    let look = FaceLook {
        skin: [224, 210, 200],
        ..FaceLook::default()
    };
    let towards = view.direction();
    let surface = Surface::new(template.skin.positions(), &template.skin.triangles())?;
    let mut picture = Picture::new(1400, 1200)
        .with_view(view)
        .with_parallel_rays()
        .with_margins(0.22, 0.03)
        .with_focus(template.skin.positions().iter().copied())
        .with_layers(template_layers(template, &look)?);
    for patch in patches {
        let shifted: Vec<Point> = patch.neutral.iter().map(|p| p + towards * SHIFT).collect();
        if patch.chart.side != Side::Right
            && let Some(anchor) = seen_node(&surface, patch, &towards)
        {
            picture = picture.with_labels([Label {
                anchor: anchor + towards * SHIFT,
                text: patch.chart.name.trim_end_matches("_l").replace('_', " "),
                color: Rgb::from_srgb(patch.chart.color),
            }]);
        }
        // Moved off the skin, patches would cast shadows that are not there.
        let layer = patch_layer(&patch.chart, shifted)?.with_light_of_its_own();
        picture = picture.with_layer(layer);
    }
    Ok(picture)
}

/// A node on the middle row with nothing but the skin right over it between it and the viewer.
fn seen_node(surface: &Surface, patch: &Patch, towards: &Vector) -> Option<Point> {
    let grid = patch.chart.grid;
    let v = if grid.is_periodic {
        grid.v_count - 3
    } else {
        grid.v_count / 2
    };
    // From the middle outwards.
    let mut columns: Vec<u32> = (0..grid.u_count).collect();
    columns.sort_by_key(|u| u.abs_diff(grid.u_count / 2));
    columns
        .into_iter()
        .map(|u| patch.neutral[grid.index(u, v)])
        .find(|p| {
            surface
                .cast_ray(&(p + towards * SHIFT), towards, 400.0)
                .is_none()
        })
}
