//! What is exported is the rig: morph targets at weight 1 give its skin, names and order are
//! ARKit's on every primitive, vertices keep their numbers, frames are those of the simulation;
//! equal inputs give equal files, and a stopped or refused export leaves nothing.
//!
//! glTF is read by the `gltf` crate, which validates it; other formats by Python, in the tests of
//! the package.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::ops::ControlFlow::{Break, Continue};
use std::path::Path;
use std::sync::Arc;

use fabrig_core::Point;
use fabrig_core::export::{
    ConvertOptions, ExportError, ExportOptions, ExportReport, ShapeSource, convert, export,
};
use fabrig_core::facs::ARKIT_SHAPES;
use fabrig_core::mesh::CornerUvs;
use fabrig_core::mesh::appearance::AppearanceError;
use fabrig_core::mesh::io::{read_mesh, read_mesh_with_shapes, write_obj};
use fabrig_core::motion::{Clip, parse_keys};
use fabrig_core::pipeline::{AnimateOptions, animate, read_own_shapes};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{Scene, Simulation, hold_pose};
use fabrig_core::template;

/// The demo face with texture coordinates from the front, cut along a line of x so that there
/// are seams.
fn textured() -> Arc<Rig> {
    let rig = &faces::demo().rig;
    let mut coordinates = Vec::new();
    for side in [0.0, 2.0] {
        coordinates.extend(rig.face.positions().iter().map(|p| {
            let q = rig.to_head * p;
            [
                (q.x as f32) * 0.004 + 0.5 + side,
                (q.y as f32) * 0.004 + 0.5,
            ]
        }));
    }
    let count = rig.face.vertex_count() as u32;
    let polygons = rig.face.polygons().iter();
    let corners = polygons.flat_map(|corners| {
        let middle: f64 = corners
            .iter()
            .map(|&v| (rig.to_head * rig.face.positions()[v as usize]).x)
            .sum();
        let side = if middle > 0.0 { count } else { 0 };
        corners.iter().map(move |v| v + side).collect::<Vec<_>>()
    });
    let uvs = CornerUvs {
        corners: corners.collect(),
        coordinates,
    };
    let mut textured = Rig::clone(rig);
    textured.face = rig.face.clone().with_uvs(uvs).unwrap();
    Arc::new(textured)
}

fn quick() -> ExportOptions {
    ExportOptions {
        shapes: ShapeSource::Targets,
        check_sum: false,
        ..ExportOptions::default()
    }
}

/// Half a second in which jaw, smile and head move.
fn take() -> Clip {
    let text = "fabrig-keys 1\n0 jawOpen=0 mouthSmile=0\n0.2 jawOpen=0.7 head.yaw=10\n\
                0.5 jawOpen=0.1 mouthSmile=0.9 head.yaw=-5\n";
    parse_keys(text, "take").unwrap()
}

fn written(rig: &Arc<Rig>, path: &Path, options: &ExportOptions) -> ExportReport {
    export(rig, path, options, &mut |_| Continue(())).unwrap()
}

/// The skin that the rig holds with these shapes at weight 1, in the user's units.
fn held(simulation: &mut Simulation, shapes: &[(&str, f32)]) -> Vec<Point> {
    let pose = faces::pose(&Arc::clone(simulation.rig()), shapes);
    hold_pose(simulation, &pose).unwrap();
    simulation.skin_in_own_units()
}

/// Positions and morph targets of the one mesh of a glTF file, read by the `gltf` crate; every
/// primitive must name the same ones.
struct Gltf {
    positions: Vec<Point>,
    normals: Vec<[f32; 3]>,
    targets: Vec<Vec<[f32; 3]>>,
    primitives: usize,
}

fn read_gltf(path: &Path) -> Gltf {
    let file = gltf::Gltf::open(path).unwrap();
    let folder = path.parent();
    let buffers = gltf::import_buffers(&file.document, folder, file.blob.clone()).unwrap();
    assert_eq!(file.meshes().count(), 1);
    let mesh = file.meshes().next().unwrap();
    let mut accessors = Vec::new();
    for primitive in mesh.primitives() {
        let index = |a: Option<gltf::Accessor<'_>>| a.unwrap().index();
        let targets = primitive.morph_targets();
        let targets = targets.map(|t| (index(t.positions()), index(t.normals())));
        accessors.push((
            index(primitive.get(&gltf::Semantic::Positions)),
            targets.collect::<Vec<_>>(),
        ));
    }
    assert!(accessors.windows(2).all(|w| w[0] == w[1]), "{accessors:?}");
    let first = mesh.primitives().next().unwrap();
    let reader = first.reader(|buffer| Some(&buffers[buffer.index()].0[..]));
    Gltf {
        positions: reader
            .read_positions()
            .unwrap()
            .map(|p| Point::from(p.map(f64::from)))
            .collect(),
        normals: reader.read_normals().unwrap().collect(),
        targets: reader
            .read_morph_targets()
            .map(|(positions, ..)| positions.unwrap().collect())
            .collect(),
        primitives: mesh.primitives().len(),
    }
}

fn summed(file: &Gltf, weights: &[(usize, f64)]) -> Vec<Point> {
    let mut positions = file.positions.clone();
    for &(target, weight) in weights {
        for (p, d) in positions.iter_mut().zip(&file.targets[target]) {
            *p += fabrig_core::Vector::from(d.map(f64::from)) * weight;
        }
    }
    positions
}

fn size(points: &[Point]) -> f64 {
    let far = |p: &Point| (p - points[0]).norm();
    points.iter().map(far).fold(0.0, f64::max)
}

fn shape(name: &str) -> usize {
    ARKIT_SHAPES.iter().position(|s| *s == name).unwrap()
}

#[test]
fn morph_targets_at_weight_one_are_the_settled_skin() {
    let rig = textured();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("face.glb");
    // Fewer substeps than usual, on either side: a pose that is held stands where it stands.
    let mut scene = Scene::default();
    scene.cloth.substeps = 3;
    let options = ExportOptions {
        shapes: ShapeSource::Settled,
        scene: scene.clone(),
        ..quick()
    };
    let report = written(&rig, &path, &options);
    assert_eq!(report.shapes, ARKIT_SHAPES);
    assert!(report.still_shapes.is_empty(), "{:?}", report.still_shapes);
    let file = read_gltf(&path);
    let count = rig.face.vertex_count();
    assert_eq!(file.targets.len(), 52);
    assert!(file.primitives >= 4, "skin, eyes, teeth, tongue");
    assert!(report.written_vertices > count && report.written_vertices < count + 2000);
    assert_eq!(file.positions.len(), report.written_vertices);
    let units = file.normals.iter().map(|n| {
        let n = n.map(f64::from);
        (n.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.0).abs()
    });
    assert!(units.fold(0.0, f64::max) < 1e-5);

    let tolerance = 1e-4 * size(&file.positions);
    let mut simulation = Simulation::new(Arc::clone(&rig), scene, None).unwrap();
    // The demo face is in metres, as glTF is.
    let mut worst = 0.0f64;
    for (p, own) in file.positions.iter().zip(rig.face.positions()) {
        worst = worst.max((p - own).norm());
    }
    assert!(worst < 1e-6, "rest is off by {worst} m");
    let both: &[&str] = &["jawOpen", "mouthClose"];
    for names in [
        &["jawOpen"][..],
        &["mouthSmileLeft"],
        &["eyeBlinkRight"],
        &["eyeLookInLeft"],
        &["browInnerUp"],
        &["tongueOut"],
        both,
    ] {
        let weights: Vec<(&str, f32)> = names.iter().map(|name| (*name, 1.0)).collect();
        let want = held(&mut simulation, &weights);
        let targets: Vec<(usize, f64)> = names.iter().map(|name| (shape(name), 1.0)).collect();
        let got = summed(&file, &targets);
        let apart = got.iter().zip(&want).map(|(p, q)| (p - q).norm());
        let apart = apart.fold(0.0, f64::max);
        assert!(
            apart < tolerance,
            "{names:?} is off by {apart} m of {tolerance}"
        );
    }

    // Seams follow the vertex that they split.
    let split = &file.targets[shape("jawOpen")][count..];
    assert!(
        split.iter().any(|d| d[1] < -0.005),
        "no seam moves with the jaw"
    );
    // It is read back as the face's own shapes, in ARKit's order.
    let own = read_mesh_with_shapes(&path).unwrap();
    let names: Vec<&str> = own.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ARKIT_SHAPES);
    assert_eq!(own.mesh.face_count(), rig.face.triangles().len());
    let found = read_own_shapes(&path, &read_mesh(&path).unwrap(), template::human()).unwrap();
    assert_eq!(found.expressions.len(), 52);
}

#[test]
fn a_take_animates_the_weights_and_baked_frames_keep_to_their_tolerance() {
    let rig = textured();
    let folder = tempfile::tempdir().unwrap();
    let options = ExportOptions {
        motion: Some(take()),
        fps: Some(30.0),
        check_sum: true,
        ..quick()
    };
    let path = folder.path().join("take.gltf");
    let report = written(&rig, &path, &options);
    assert_eq!((report.frames, report.files), (16, 2));
    let linear = report.linear.unwrap();
    assert!(
        linear.rms_mm > 0.0 && linear.rms_mm < 0.25 * linear.motion_rms_mm,
        "{linear:?}"
    );
    let file = gltf::Gltf::open(&path).unwrap();
    let buffers = gltf::import_buffers(&file.document, path.parent(), None).unwrap();
    let animation = file.animations().next().unwrap();
    let (mut weights, mut turns) = (Vec::new(), 0);
    for channel in animation.channels() {
        let reader = channel.reader(|buffer| Some(&buffers[buffer.index()].0[..]));
        let times: Vec<f32> = reader.read_inputs().unwrap().collect();
        assert_eq!((times[0], times[15]), (0.0, 0.5));
        match reader.read_outputs().unwrap() {
            gltf::animation::util::ReadOutputs::MorphTargetWeights(of) => {
                weights = of.into_f32().collect();
            }
            gltf::animation::util::ReadOutputs::Rotations(of) => turns = of.into_f32().len(),
            _ => {}
        }
    }
    assert_eq!((weights.len(), turns), (16 * 52, 16));
    assert!((weights[6 * 52 + shape("jawOpen")] - 0.7).abs() < 1e-3);

    let path = folder.path().join("baked.glb");
    let baked = ExportOptions {
        baked: true,
        still_head: true,
        ..options
    };
    let report = written(&rig, &path, &baked);
    let basis = report.basis.unwrap();
    assert!(
        basis.worst_frame_rms_mm <= baked.basis_tolerance,
        "{basis:?}"
    );
    assert!((2..=16).contains(&basis.components), "{basis:?}");
    let file = read_gltf(&path);
    let gltf_file = gltf::Gltf::open(&path).unwrap();
    let blob = gltf_file.blob.clone().unwrap();
    let animation = gltf_file.animations().next().unwrap();
    assert_eq!(animation.channels().count(), 1, "the head stays");
    let channel = animation.channels().next().unwrap();
    let reader = channel.reader(|_| Some(&blob[..]));
    let weights: Vec<f32> = match reader.read_outputs().unwrap() {
        gltf::animation::util::ReadOutputs::MorphTargetWeights(of) => of.into_f32().collect(),
        _ => panic!("weights alone"),
    };
    assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)));
    let scene = Scene::default();
    let mut simulation = Simulation::new(Arc::clone(&rig), scene, Some(take())).unwrap();
    for _ in 0..9 {
        simulation.advance(1.0 / 30.0).unwrap();
    }
    let of_frame = &weights[9 * basis.components..10 * basis.components];
    let weights: Vec<(usize, f64)> = of_frame.iter().map(|w| f64::from(*w)).enumerate().collect();
    let got = summed(&file, &weights);
    let want = simulation.skin_in_own_units();
    let millimetres = rig.to_head.scaling();
    let apart = got
        .iter()
        .zip(&want)
        .map(|(p, q)| (p - q).norm() * millimetres);
    let apart = apart.fold(0.0, f64::max);
    assert!(apart <= basis.max_mm + 1e-3, "{apart} mm of {basis:?}");
}

#[test]
fn equal_inputs_give_equal_files_for_any_number_of_threads() {
    let rig = textured();
    let folder = tempfile::tempdir().unwrap();
    let options = ExportOptions {
        motion: Some(take()),
        fps: Some(30.0),
        baked: true,
        ..quick()
    };
    for extension in ["glb", "usda", "npz", "pc2", "mdd"] {
        let bytes = [1, 2].map(|threads| {
            let path = folder.path().join(format!("{threads}.{extension}"));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| written(&rig, &path, &options));
            std::fs::read(path).unwrap()
        });
        assert!(bytes[0] == bytes[1], "{extension}");
    }
}

#[test]
fn a_folder_of_shapes_is_what_a_rig_takes_and_a_recording_converts() {
    let rig = textured();
    let folder = tempfile::tempdir().unwrap();
    let shapes = folder.path().join("shapes");
    let report = written(&rig, &shapes, &quick());
    assert_eq!(report.files, 53);
    let neutral = read_mesh(shapes.join("neutral.obj")).unwrap();
    assert_eq!(neutral.polygons(), rig.face.polygons());
    assert!(neutral.uvs().is_some());
    let own = read_own_shapes(&shapes, &neutral, template::human()).unwrap();
    assert_eq!((own.expressions.len(), own.skipped.len()), (52, 0));

    let recording = folder.path().join("take.mcap");
    let options = AnimateOptions {
        fps: Some(60.0),
        ..AnimateOptions::default()
    };
    let scene = Scene::default();
    animate(
        Arc::clone(&rig),
        take(),
        scene,
        &recording,
        &options,
        &mut |_| Continue(()),
    )
    .unwrap();
    let with_rig = ConvertOptions {
        rig: Some(Arc::clone(&rig)),
        export: ExportOptions {
            still_head: true,
            ..ExportOptions::default()
        },
    };
    let path = folder.path().join("take.pc2");
    let report = convert(&recording, &path, &with_rig, &mut |_| Continue(())).unwrap();
    assert_eq!((report.frames, report.fps), (16, Some(30.0)));
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(bytes.len() as u64, report.bytes);
    let last = &bytes[32 + 15 * 12 * rig.face.vertex_count()..];
    let mut simulation = Simulation::new(Arc::clone(&rig), Scene::default(), Some(take())).unwrap();
    for _ in 0..30 {
        simulation.advance(1.0 / 60.0).unwrap();
    }
    let numbers = last
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let numbers: Vec<f64> = numbers.map(f64::from).collect();
    let apart = numbers.chunks_exact(3).zip(simulation.skin_in_own_units());
    let apart = apart.map(|(p, q)| (Point::new(p[0], p[1], p[2]) - q).norm());
    // A recording is rounded to an eighth of a thousandth of its unit, and single precision.
    let apart = apart.fold(0.0, f64::max) * rig.to_head.scaling();
    assert!(apart < 0.02, "{apart} mm");
    let plain = ConvertOptions::default();
    let path = folder.path().join("take.glb");
    let report = convert(&recording, &path, &plain, &mut |_| Continue(())).unwrap();
    assert!(report.materials.len() >= 4, "{:?}", report.materials);
    assert_eq!(
        read_gltf(&path).targets.len(),
        report.basis.unwrap().components
    );
}

#[test]
fn materials_come_from_the_face_that_was_rigged() {
    let rig = textured();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_obj(at("plain.obj"), &rig.face).unwrap();
    // Two materials over the groups that the face has, one with a picture that is there.
    let text = std::fs::read_to_string(at("plain.obj")).unwrap();
    let mut groups = 0;
    let mut obj = String::from("mtllib face.mtl\n");
    for line in text.lines() {
        if line.starts_with("g ") {
            groups += 1;
            obj += if groups == 1 {
                "usemtl skin tone\n"
            } else {
                "usemtl rest\n"
            };
        }
        obj += &format!("{line}\n");
    }
    std::fs::write(at("face.obj"), obj).unwrap();
    let mtl = "newmtl skin tone\nKd 0.8 0.5 0.4\nmap_Kd skin.png\nnewmtl rest\nKd 0.1 0.2 0.3\n\
               map_Kd missing.png\n";
    std::fs::write(at("face.mtl"), mtl).unwrap();
    let png = b"\x89PNG\r\n\x1a\n, as far as it matters here";
    std::fs::write(at("skin.png"), png).unwrap();
    let options = ExportOptions {
        source: Some(at("face.obj")),
        ..quick()
    };
    let report = written(&rig, &at("a.glb"), &options);
    assert_eq!(report.materials, ["skin tone", "rest"]);
    assert!(
        report.notes.iter().any(|n| n.contains("missing.png")),
        "{:?}",
        report.notes
    );
    let file = gltf::Gltf::open(at("a.glb")).unwrap();
    let image = file.images().next().unwrap();
    let gltf::image::Source::View { view, mime_type } = image.source() else {
        panic!("the picture is in the file");
    };
    let blob = file.blob.as_ref().unwrap();
    let bytes = &blob[view.offset()..view.offset() + view.length()];
    assert_eq!((bytes, mime_type), (&png[..], "image/png"));
    let colors: Vec<[f32; 4]> = file
        .materials()
        .map(|m| m.pbr_metallic_roughness().base_color_factor())
        .collect();
    assert_eq!(colors, [[1.0; 4], [0.1, 0.2, 0.3, 1.0]]);
    // A rig that keeps them needs no file any more, after it was saved and loaded either.
    let mut keeping = Rig::clone(&rig);
    let notes = keeping.keep_appearance(&at("face.obj")).unwrap();
    assert!(notes.iter().any(|n| n.contains("missing.png")), "{notes:?}");
    let keeping = Arc::new(Rig::from_bytes(&keeping.to_bytes().unwrap()).unwrap());
    written(&keeping, &at("kept.glb"), &quick());
    assert!(std::fs::read(at("kept.glb")).unwrap() == std::fs::read(at("a.glb")).unwrap());
    let usda = written(&rig, &at("a.usda"), &options);
    assert_eq!(usda.files, 2);
    let other = ExportOptions {
        source: Some(at("other.obj")),
        ..quick()
    };
    std::fs::write(at("other.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let error = export(&rig, &at("b.glb"), &other, &mut |_| Continue(())).unwrap_err();
    assert!(
        matches!(
            error,
            ExportError::Appearance(AppearanceError::OtherMesh { .. })
        ),
        "{error}"
    );
    assert!(!at("b.glb").exists());
}

#[test]
fn a_stopped_or_refused_export_leaves_nothing() {
    let rig = &faces::demo().rig;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let moving = ExportOptions {
        motion: Some(take()),
        baked: true,
        ..quick()
    };
    for (name, options) in [
        ("a.glb", &quick()),
        ("b.glb", &moving),
        ("b.usda", &moving),
        ("b.npz", &moving),
        ("b.pc2", &moving),
        ("shapes", &moving),
    ] {
        let mut calls = 0;
        let stop = &mut |_| {
            calls += 1;
            if calls > 3 { Break(()) } else { Continue(()) }
        };
        let error = export(rig, &at(name), options, stop).unwrap_err();
        assert!(matches!(error, ExportError::Stopped), "{name}: {error}");
    }
    let go = &mut |_| Continue(());
    let error = export(rig, &at("c.pc2"), &quick(), go).unwrap_err();
    assert!(matches!(error, ExportError::NoMotion { .. }), "{error}");
    let error = export(rig, &at("c.fbx"), &quick(), go).unwrap_err();
    assert!(
        matches!(error, ExportError::UnknownFormat { .. }),
        "{error}"
    );
    let error = export(rig, &at("no/c.glb"), &quick(), go).unwrap_err();
    assert!(matches!(error, ExportError::Io { .. }), "{error}");
    for fps in [0.0, f64::NAN] {
        let fps = Some(fps);
        let error = export(
            rig,
            &at("c.glb"),
            &ExportOptions {
                fps,
                ..moving.clone()
            },
            go,
        );
        assert!(matches!(
            error,
            Err(ExportError::Option { name: "fps", .. })
        ));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
