//! A painted map lets the skin fold where it is painted and nowhere else, whether it is an image
//! or numbers at vertices; maps that do not fit are refused with what to do.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::path::Path;
use std::sync::Arc;

use fabrig_core::edit::Edits;
use fabrig_core::mesh::CornerUvs;
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};

/// Half the width and height of the square that the texture coordinates span. (mm)
const HALF: f64 = 130.0;

/// The template's face with texture coordinates as seen from the front.
fn mapped_rig() -> Rig {
    let mut rig = faces::template_rig();
    let face = &rig.face;
    let coordinates = face
        .positions()
        .iter()
        .map(|p| [p.x, p.y].map(|c| ((c + HALF) / (2.0 * HALF)) as f32))
        .collect();
    let corners = face.polygons().corners().to_vec();
    rig.face = face
        .clone()
        .with_uvs(CornerUvs {
            coordinates,
            corners,
        })
        .unwrap();
    rig
}

/// White on the character's left half of the face (+X, the right of the image).
fn left_half_image(path: &Path) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, 256, 256);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    let pixels: Vec<u8> = (0..256 * 256)
        .map(|i| if i % 256 < 136 { 0 } else { 255 })
        .collect();
    writer.write_image_data(&pixels).unwrap();
}

fn left_half_numbers(rig: &Rig, path: &Path) {
    let values = rig.face.positions().iter().map(|p| {
        let pixel = (p.x + HALF) / (2.0 * HALF) * 256.0;
        if pixel < 136.0 { "0\n" } else { "1\n" }
    });
    std::fs::write(path, values.collect::<String>()).unwrap();
}

fn edited(rig: &Rig, folder: &Path, map: &str) -> Result<Rig, fabrig_core::edit::EditError> {
    let path = folder.join("face.edits.toml");
    let text = format!(
        "[wrinkles.brow]\nmap = \"{map}\"\npatches = [\"frontalis_l\", \"frontalis_r\"]\n\
         stretch = 4.0\nbend = 0.5\n"
    );
    std::fs::write(&path, text).unwrap();
    let mut rig = rig.clone();
    Edits::load(&path)?.apply(&mut rig)?;
    Ok(rig)
}

/// Brows raised and held: root mean square distance from the muscle shapes of the left and the
/// right frontalis, and of the skin from where it goes without a map on either side. (mm)
fn folds(
    rig: &Rig,
    plain: &[nalgebra::Point3<f32>],
) -> ([f64; 2], [f64; 2], Vec<nalgebra::Point3<f32>>) {
    let mut pose = FacePose::neutral(rig.shape_names.len());
    for name in ["browInnerUp", "browOuterUpLeft", "browOuterUpRight"] {
        pose.weights[rig.shape_index(name).unwrap()] = 1.0;
    }
    let mut simulation = Simulation::new(Arc::new(rig.clone()), Scene::default(), None).unwrap();
    hold_pose(&mut simulation, &pose).unwrap();
    let mut shapes =
        Simulation::new(Arc::new(rig.clone()), Scene::without_dynamics(), None).unwrap();
    shapes.reset(pose).unwrap();
    let depth = |name: &str| {
        let mut patches = rig.patches.iter();
        let patch = patches.position(|p| p.patch.chart.name == name).unwrap();
        let nodes = simulation.patch_positions(patch);
        let nodes = nodes.iter().zip(shapes.patch_positions(patch));
        let squares: Vec<f64> = nodes
            .map(|(x, target)| f64::from((x - target).norm_squared()))
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let skin = simulation.skin().to_vec();
    let side = |sign: f32| {
        skin.iter()
            .zip(plain)
            .zip(rig.skin_at_rest())
            .filter(|(_, rest)| sign * rest.x > 15.0)
            .map(|((now, plain), _)| f64::from((now - plain).norm()))
            .fold(0.0, f64::max)
    };
    let moved = if plain.is_empty() {
        [0.0; 2]
    } else {
        [side(1.0), side(-1.0)]
    };
    ([depth("frontalis_l"), depth("frontalis_r")], moved, skin)
}

#[test]
fn skin_folds_where_the_map_is_white() {
    let folder = tempfile::tempdir().unwrap();
    let plain = mapped_rig();
    left_half_image(&folder.path().join("half.png"));
    left_half_numbers(&plain, &folder.path().join("half.txt"));
    let ([left, right], _, skin) = folds(&plain, &[]);
    let by_image = edited(&plain, folder.path(), "half.png").unwrap();
    let ([loose, firm], [here, there], folded) = folds(&by_image, &skin);
    assert!(
        loose > 3.0 * left && (firm - right).abs() < 0.05 * right,
        "{left} -> {loose}, {right} -> {firm}"
    );
    assert!(
        here > 0.2 && there < 0.1 * here,
        "the skin: {here} and {there} mm"
    );
    // Numbers at vertices say the same, but for the border between two of them.
    let by_numbers = edited(&plain, folder.path(), "half.txt").unwrap();
    let ([numbers, _], _, other) = folds(&by_numbers, &skin);
    assert!((numbers / loose - 1.0).abs() < 0.1, "{loose} {numbers}");
    assert_eq!(folded.len(), other.len());
    // Edits outlive the rig's file.
    let path = folder.path().join("face.fabrig");
    by_image.save(&path).unwrap();
    assert_eq!(Rig::load(&path).unwrap(), by_image);
}

#[test]
fn maps_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plain = faces::template_rig();
    let no_uvs = plain.face.uvs().is_none();
    std::fs::write(folder.path().join("few.txt"), "0 1 0.5").unwrap();
    left_half_image(&folder.path().join("half.png"));
    let said = |rig: &Rig, map: &str| edited(rig, folder.path(), map).unwrap_err().to_string();
    let error = said(&plain, "few.txt");
    assert!(error.contains("3 values"), "{error}");
    assert!(error.contains("few.txt"), "{error}");
    if no_uvs {
        let error = said(&plain, "half.png");
        assert!(error.contains("texture coordinates"), "{error}");
    }
    let error = said(&plain, "none.png");
    assert!(error.contains("none.png"), "{error}");
    let mut rig = plain.clone();
    let text = "[wrinkles.a]\nmap = \"few.txt\"\nbend = 0.0\n";
    let mut edits = Edits::parse(text).unwrap();
    edits.folder = folder.path().to_owned();
    let error = edits.apply(&mut rig).unwrap_err().to_string();
    assert!(
        error.contains("wrinkles.a") && error.contains("bend"),
        "{error}"
    );
    assert!(
        Edits::parse("[wrinkles.a]\nstretch = 1.0\n").is_err(),
        "no map"
    );
}
