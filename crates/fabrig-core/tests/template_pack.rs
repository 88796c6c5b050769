//! The embedded template is a plausible, exactly symmetric face whose shapes do what their
//! names say; damaged packs are refused with what is wrong.

use fabrig_core::template::{PackFiles, Template, TemplateError, demo_face, demo_take, human};
use fabrig_core::{Point, Vector};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../templates/human");

fn at(name: &str) -> Point {
    human()
        .landmark(name)
        .unwrap_or_else(|| panic!("landmark {name}"))
}

/// Movement of a landmark under a shape at weight 1. (mm)
fn moved(shape: &str, landmark: &str) -> Vector {
    let template = human();
    let vertex = template.landmarks[landmark];
    let index = template
        .shape_index(shape)
        .unwrap_or_else(|| panic!("shape {shape}"));
    template.shapes[index]
        .deltas
        .iter()
        .find(|(v, _)| *v == vertex)
        .map_or_else(Vector::zeros, |(_, d)| *d)
}

fn amplitude(shape: &str) -> f64 {
    let template = human();
    let index = template.shape_index(shape).unwrap_or(usize::MAX);
    template.shapes[index]
        .deltas
        .iter()
        .map(|(_, d)| d.norm())
        .fold(0.0, f64::max)
}

#[test]
fn the_head_has_true_size_and_place() {
    let template = human();
    assert_eq!(template.skin.vertex_count(), 4242);
    assert_eq!(template.shapes.len(), 52);
    let [left, right] = template.eyes;
    let between = (left.center - right.center).norm();
    assert!((between - 63.0).abs() < 0.5, "eyes {between} mm apart");
    let height = at("head_top").y - at("menton").y;
    assert!(
        (215.0..235.0).contains(&height),
        "chin to crown {height} mm"
    );
    let origin = (at("tragion_l").coords + at("tragion_r").coords) / 2.0;
    assert!(origin.norm() < 1e-3, "origin off the tragi by {origin}");
    assert!(template.rigid_parts.len() == 5 && template.landmarks.len() > 150);
}

#[test]
fn left_and_right_are_bitwise_mirrors() {
    let template = human();
    let bits = |v: Vector| [v.x, v.y, v.z].map(f64::to_bits);
    let image = |v: Vector| bits(Vector::new(0.0 - v.x, v.y, v.z));
    let p = template.skin.positions();
    for (v, &m) in template.mirror.iter().enumerate() {
        assert_eq!(template.mirror[m as usize] as usize, v);
        assert_eq!(bits(p[m as usize].coords), image(p[v].coords), "vertex {v}");
    }
    let mut triangles = template.skin.triangles();
    let rotate = |mut t: [u32; 3]| {
        let least = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
        t.rotate_left(least);
        t
    };
    let mut mirrored: Vec<_> = triangles
        .iter()
        .map(|t| rotate([t[0], t[2], t[1]].map(|v| template.mirror[v as usize])))
        .collect();
    triangles = triangles.into_iter().map(rotate).collect();
    triangles.sort_unstable();
    mirrored.sort_unstable();
    assert_eq!(triangles, mirrored);
    for shape in &template.shapes {
        let other = match shape.name.strip_suffix("Left") {
            Some(stem) => format!("{stem}Right"),
            None if shape.name.ends_with("Right") => continue,
            None => shape.name.clone(),
        };
        let other = template.shape_index(&other).map(|i| &template.shapes[i]);
        let mut expected: Vec<_> = shape
            .deltas
            .iter()
            .map(|(v, d)| (template.mirror[*v as usize], image(*d)))
            .collect();
        expected.sort_unstable();
        let found: Option<Vec<_>> =
            other.map(|o| o.deltas.iter().map(|(v, d)| (*v, bits(*d))).collect());
        assert_eq!(found, Some(expected), "{}", shape.name);
    }
    for (name, &v) in &template.landmarks {
        match name.strip_suffix("_l") {
            Some(stem) => {
                assert_eq!(
                    template.landmarks[&format!("{stem}_r")],
                    template.mirror[v as usize]
                );
                assert!(p[v as usize].x > 0.0, "{name} is not on the left");
            }
            None if name.ends_with("_r") => {}
            None => assert_eq!(p[v as usize].x, 0.0, "{name} is not on the mid plane"),
        }
    }
}

#[test]
fn shapes_do_what_their_names_say() {
    let down = |shape, landmark| moved(shape, landmark).y;
    assert!(down("jawOpen", "menton") < -20.0);
    assert!(down("jawOpen", "lower_lip_mid") < -25.0 && down("jawOpen", "upper_lip_mid") > -5.0);
    let smile = moved("mouthSmileLeft", "lip_corner_l");
    assert!(
        smile.x > 2.0 && smile.y > 3.0 && smile.z < -2.0,
        "smile {smile}"
    );
    assert!(down("mouthFrownLeft", "lip_corner_l") < -2.0);
    assert!(moved("mouthPucker", "lip_corner_l").x < -3.0);
    assert!(moved("mouthStretchLeft", "lip_corner_l").x > 2.0);
    assert!(moved("mouthDimpleLeft", "lip_corner_l").x > 1.0);
    assert!(moved("mouthLeft", "lip_corner_l").x > 2.0 && moved("mouthLeft", "philtrum").x > 1.0);
    assert!(down("browInnerUp", "brow_inner_l") > 2.0);
    assert!(down("browOuterUpLeft", "brow_mid_l") > 2.0);
    assert!(down("browOuterUpLeft", "brow_outer_l") > 1.0);
    assert!(down("browDownLeft", "brow_inner_l") < -2.0);
    assert!(down("noseSneerLeft", "alar_l") > 1.0);
    assert!(down("mouthUpperUpLeft", "upper_lip_bottom_side_l") > 2.0);
    assert!(down("mouthLowerDownLeft", "lower_lip_top_side_l") < -2.0);
    assert!(down("mouthShrugLower", "lower_lip_mid") > 1.0);
    assert!(down("eyeWideLeft", "upper_lid_mid_l") > 1.0);
    assert!(down("eyeSquintLeft", "lower_lid_mid_l") > 1.0);
    assert!(down("cheekSquintLeft", "cheekbone_l") > 0.5);
    assert!(moved("cheekPuff", "cheek_l").norm() > 3.0);
    assert!(moved("jawForward", "pogonion").z > 3.0);
    assert!(moved("jawLeft", "pogonion").x > 3.0);
    assert!(moved("mouthFunnel", "upper_lip_mid").z > 2.0);
    for (shape, far) in [
        ("eyeBlinkLeft", "lower_lid_mid_r"),
        ("browDownLeft", "brow_outer_r"),
        ("browOuterUpLeft", "brow_outer_r"),
        ("mouthSmileLeft", "lip_corner_r"),
        ("noseSneerLeft", "alar_r"),
        ("cheekSquintLeft", "cheekbone_r"),
    ] {
        assert!(moved(shape, far).norm() < 1.0, "{shape} moves {far}");
    }
    for shape in human().shapes.iter().filter(|s| s.name != "tongueOut") {
        let amplitude = amplitude(&shape.name);
        assert!(
            (0.9..45.0).contains(&amplitude),
            "{}: {amplitude} mm",
            shape.name
        );
    }
    assert!(
        human()
            .part_deltas
            .iter()
            .any(|(_, _, d)| d.iter().any(|v| v.norm() > 15.0))
    );
}

#[test]
fn lids_close_and_stay_outside_the_eyeball() {
    let template = human();
    let lids = ["upper_lid_l", "lower_lid_l"].map(|n| template.regions.find(n));
    let eye = template.eyes[0];
    for name in [
        "eyeBlinkLeft",
        "eyeSquintLeft",
        "cheekSquintLeft",
        "eyeLookDownLeft",
        "eyeWideLeft",
    ] {
        let shape = template.shape_index(name).map(|i| &template.shapes[i]);
        let mut positions = template.skin.positions().to_vec();
        for (v, d) in shape.iter().flat_map(|s| &s.deltas) {
            positions[*v as usize] += d;
        }
        let inside = template
            .regions
            .vertex_regions
            .iter()
            .zip(&positions)
            .filter(|(r, p)| lids.contains(&Some(**r)) && (*p - eye.center).norm() < eye.radius)
            .count();
        assert_eq!(inside, 0, "{name}: lid vertices inside the eyeball");
        let gap = |p: &[Point]| {
            let at = |n: &str| p[template.landmarks[n] as usize].y;
            at("upper_lid_mid_l") - at("lower_lid_mid_l")
        };
        let share = gap(&positions) / gap(template.skin.positions());
        if name == "eyeBlinkLeft" {
            assert!(
                (0.0..0.05).contains(&share),
                "a blink leaves {share} of the aperture"
            );
        } else {
            assert!(share > 0.2, "{name} leaves {share} of the aperture");
        }
    }
}

#[test]
fn damaged_packs_are_refused() -> Result<(), Box<dyn std::error::Error>> {
    let text = |name: &str| std::fs::read_to_string(format!("{FOLDER}/{name}"));
    let geometry = std::fs::read(format!("{FOLDER}/geometry.bin"))?;
    let description = text("template.toml")?;
    let load = |description: &str, geometry: &[u8]| {
        Template::from_files(&PackFiles {
            description,
            geometry,
            identity: &[],
            patch_layout: "",
            action_units: "",
            materials: "",
            skin_weights: &[],
        })
    };
    assert!(load(&description, &geometry).is_ok());
    for length in [0, 7, 23, 24, geometry.len() / 2, geometry.len() - 1] {
        let result = load(&description, &geometry[..length]);
        let is_told = matches!(
            result,
            Err(TemplateError::Truncated { .. } | TemplateError::WrongMagic { .. })
        );
        assert!(is_told, "{length} bytes: {result:?}");
    }
    let flipped = |at: usize| {
        let mut bytes = geometry.clone();
        bytes[at] ^= 0x10;
        load(&description, &bytes)
    };
    assert!(matches!(flipped(0), Err(TemplateError::WrongMagic { .. })));
    assert!(matches!(
        flipped(8),
        Err(TemplateError::WrongVersion { .. })
    ));
    assert!(matches!(flipped(1000), Err(TemplateError::Checksum { .. })));
    let out = description.replace("nose_tip = { vertex = 1431", "nose_tip = { vertex = 99999");
    let result = load(&out, &geometry);
    assert!(
        matches!(&result, Err(TemplateError::OutOfRange { found: 99999, .. })),
        "{result:?}"
    );
    let off = description.replace("nose_tip = { vertex = 1431", "nose_tip = { vertex = 2431");
    assert!(matches!(
        load(&off, &geometry),
        Err(TemplateError::Mirror { .. })
    ));
    assert!(matches!(
        load("name = 1", &geometry),
        Err(TemplateError::Text { .. })
    ));
    let nowhere = Template::load(std::path::Path::new("no/such/folder"));
    assert!(matches!(nowhere, Err(TemplateError::Read { .. })));
    Ok(())
}

#[test]
fn the_demo_face_is_a_stranger_to_the_template() -> Result<(), Box<dyn std::error::Error>> {
    let face = demo_face();
    assert!((10_000..16_000).contains(&face.vertex_count()));
    assert!(face.polygons().iter().all(|f| f.len() == 3));
    let names: Vec<&str> = face.groups().iter().map(|g| g.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "skin",
            "eye_l",
            "eye_r",
            "upper_teeth",
            "lower_teeth",
            "tongue"
        ]
    );
    let height = |p: &Point| p.y;
    let top = face.positions().iter().map(height).fold(f64::MIN, f64::max);
    let bottom = face.positions().iter().map(height).fold(f64::MAX, f64::min);
    assert!((0.2..0.35).contains(&(top - bottom)), "height in metres");
    let clip = fabrig_core::motion::parse_keys(demo_take(), "the demo's take")?;
    assert!(clip.duration() >= 8.0);
    Ok(())
}
