//! Records a wobbling ball with four patches under it: a recording with every topic and no
//! rig, for trying viewers and for testing readers.
//!
//! ```text
//! cargo run --release -p fabrig-core --example record_synthetic -- OUT.mcap [SECONDS] [RINGS]
//! ```

use std::error::Error;
use std::f32::consts::{PI, TAU};

use fabrig_core::recording::{
    Frame, LogEvent, LogLevel, McapRecorder, RecordingInfo, RecordingOptions, SurfaceInfo,
};
use nalgebra::{Isometry3, Point3, Vector3};

const FPS: f64 = 60.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let path = args
        .next()
        .ok_or("usage: record_synthetic OUT.mcap [SECONDS] [RINGS]")?;
    let secs: f64 = args.next().map_or(Ok(2.0), |text| text.parse())?;
    let rings: u32 = args.next().map_or(Ok(40), |text| text.parse())?;

    let (ball, triangles) = ball(rings);
    let grid = 21;
    let patch_names = [
        "frontalis_l",
        "frontalis_r",
        "zygomaticus_l",
        "zygomaticus_r",
    ];
    let surface = |name: &str, color, count, triangles: &[[u32; 3]]| SurfaceInfo {
        name: name.to_owned(),
        color,
        vertex_count: count,
        triangles: triangles.to_vec(),
        vertex_colors: Vec::new(),
    };
    let patch_triangles = grid_triangles(grid);
    let patches = patch_names.iter().enumerate().map(|(i, name)| {
        let color = [200, 60 + 30 * i as u8, 60, 255];
        surface(name, color, (grid * grid) as usize, &patch_triangles)
    });
    let info = RecordingInfo {
        face: String::new(),
        rig: "synthetic ball".to_owned(),
        template: "none".to_owned(),
        fps: FPS,
        seed: 0,
        skin: surface("skin", [224, 172, 147, 255], ball.len(), &triangles),
        patches: patches.collect(),
        parts: vec![surface(
            "eye_l",
            [240, 236, 230, 255],
            ball.len(),
            &triangles,
        )],
        colliders: None,
        weight_names: vec!["jawOpen".to_owned(), "mouthSmileLeft".to_owned()],
        plotted_weights: Vec::new(),
        stat_names: vec!["stretch_energy".to_owned(), "step_ms".to_owned()],
        extra: vec![("take".to_owned(), "wobble".to_owned())],
    };
    let mut recorder = McapRecorder::create(&path, info, RecordingOptions::default())?;
    for k in 0..(secs * FPS).round() as u64 {
        let t = (k as f64 / FPS) as f32;
        let wobble = |p: &Point3<f32>| {
            Point3::from(p.coords * (90.0 + 6.0 * (0.9 * t * TAU + 4.0 * p.y).sin()))
        };
        let skin: Vec<_> = ball.iter().map(wobble).collect();
        let eye: Vec<_> = ball
            .iter()
            .map(|p| Point3::from(p.coords * 12.0 + Vector3::new(32.0, 30.0, 85.0)))
            .collect();
        let patches: Vec<Vec<_>> = (0..patch_names.len())
            .map(|i| patch(grid, i as f32, t))
            .collect();
        let patches: Vec<&[_]> = patches.iter().map(Vec::as_slice).collect();
        let started = LogEvent {
            level: LogLevel::Info,
            message: "start".to_owned(),
        };
        recorder.record(&Frame {
            skin: &skin,
            patches: &patches,
            parts: &[&eye],
            contact: None,
            strains: &[],
            magnets: &[],
            head: Isometry3::rotation(Vector3::y() * 0.3 * f64::from((t * TAU * 0.4).sin())),
            weights: &[
                0.5 - 0.5 * (t * TAU).cos(),
                0.5 + 0.5 * (t * TAU * 0.5).sin(),
            ],
            stats: &[f64::from(t * 3.0).sin().abs() * 1e-3, 4.0],
            events: if k == 0 {
                std::slice::from_ref(&started)
            } else {
                &[]
            },
        })?;
    }
    recorder.finish()?;
    Ok(())
}

/// A ball of radius 1 with poles up and down.
fn ball(rings: u32) -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
    let columns = 2 * rings;
    let mut points = vec![Point3::new(0.0, 1.0, 0.0)];
    for ring in 1..rings {
        let a = PI * ring as f32 / rings as f32;
        for column in 0..columns {
            let b = TAU * column as f32 / columns as f32;
            points.push(Point3::new(a.sin() * b.sin(), a.cos(), a.sin() * b.cos()));
        }
    }
    points.push(Point3::new(0.0, -1.0, 0.0));
    let last = points.len() as u32 - 1;
    let at = |ring: u32, column: u32| 1 + (ring - 1) * columns + column % columns;
    let mut triangles = Vec::new();
    for c in 0..columns {
        triangles.push([0, at(1, c), at(1, c + 1)]);
        for ring in 1..rings - 1 {
            let [p, q, r, s] = [
                at(ring, c),
                at(ring + 1, c),
                at(ring + 1, c + 1),
                at(ring, c + 1),
            ];
            triangles.extend([[p, q, r], [p, r, s]]);
        }
        triangles.push([at(rings - 1, c), last, at(rings - 1, c + 1)]);
    }
    (points, triangles)
}

fn grid_triangles(side: u32) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for v in 0..side - 1 {
        for u in 0..side - 1 {
            let p = v * side + u;
            triangles.extend([[p, p + 1, p + side + 1], [p, p + side + 1, p + side]]);
        }
    }
    triangles
}

/// A strip in front of the ball's centre that bulges with time. (mm)
fn patch(side: u32, index: f32, t: f32) -> Vec<Point3<f32>> {
    let mut points = Vec::new();
    for v in 0..side {
        for u in 0..side {
            let (x, y) = (u as f32 / (side - 1) as f32, v as f32 / (side - 1) as f32);
            let bulge = 5.0 * (x * PI).sin() * (1.0 + (t * TAU + index).sin());
            points.push(Point3::new(
                -45.0 + 90.0 * x,
                -60.0 + 35.0 * index + 25.0 * y,
                50.0 + bulge,
            ));
        }
    }
    points
}
