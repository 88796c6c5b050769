//! What a scene says reaches the face.

use std::sync::{Arc, LazyLock};

use nalgebra::{Point3, Vector3};

use super::*;
use crate::anatomy::Resolution;
use crate::edit::Edits;
use crate::motion::{ReadOptions, parse};
use crate::rig::{Rig, RigOptions, rig_of_template};
use crate::template::human;

static RIG: LazyLock<Arc<Rig>> = LazyLock::new(|| {
    let options = RigOptions {
        resolution: Resolution::COARSE,
        fit: crate::skin::FitOptions {
            candidate_limit: 4,
            smoothing_rounds: 0,
            ..Default::default()
        },
        ..RigOptions::default()
    };
    Arc::new(rig_of_template(human(), &options).unwrap())
});

/// The template's own face with few nodes.
pub(crate) fn coarse_rig() -> Arc<Rig> {
    Arc::clone(&RIG)
}

const DT: f64 = 1.0 / 60.0;

fn simulation(text: &str) -> Simulation {
    let scene = Scene::from_toml(text).unwrap().without_economy();
    Simulation::new(Arc::clone(&RIG), scene, None).unwrap()
}

/// All nodes after so many frames.
fn after(simulation: &mut Simulation, frames: usize) -> Vec<Point3<f32>> {
    for _ in 0..frames {
        simulation.advance(DT).unwrap();
    }
    let patches = 0..RIG.patches.len();
    patches
        .flat_map(|p| simulation.patch_positions(p).to_vec())
        .collect()
}

fn largest_gap(a: &[Point3<f32>], b: &[Point3<f32>]) -> f32 {
    let gaps = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    gaps.fold(0.0, f32::max)
}

#[test]
fn keyed_gravity_ends_where_the_still_load_does() {
    // Half-way down: coarse patches of a face that lies down wholly may fold in more than one way,
    // and which it is depends on how it got there.
    let keyed = "gravity = { join = \"smooth\", keys = [{ time = 0.2, value = [0, -9810, 0] }, \
                 { time = 0.8, value = [0, -6900, -6900] }] }";
    let mut turning = simulation(keyed);
    let upright = after(&mut turning, 12);
    let rest = after(&mut simulation("dynamics = \"none\""), 1);
    assert!(
        largest_gap(&upright, &rest) < 1e-3,
        "standing gravity bends nothing"
    );
    let half_way = after(&mut turning, 18);
    let lying = after(&mut turning, 210);
    let still = after(&mut simulation("gravity = [0, -6900, -6900]"), 240);
    let sag = largest_gap(&still, &rest);
    assert!(sag > 1.0, "{sag}");
    assert!(largest_gap(&lying, &still) < 0.01 * sag);
    assert!(largest_gap(&half_way, &still) > 0.1 * sag);
}

#[test]
fn a_lone_pad_sags_as_far_as_its_magnet_and_the_load_say() {
    // Nothing but the magnet holds it: u = dg / w^2.
    let text = "gravity = [0, -9810, -3000]\n[simulate]\nonly = [\"malar_fat_l\"]\n\
                [materials.fat]\nstretch_resistance = 0\ncompression_resistance = 0\n\
                shear_resistance = 0\nbend_resistance = 0\npressure = 0\n";
    let mut simulation = simulation(text);
    after(&mut simulation, 360);
    let names = RIG.patches.iter();
    let names: Vec<&str> = names.map(|p| p.patch.chart.name.as_str()).collect();
    let pad = names
        .iter()
        .position(|name| *name == "malar_fat_l")
        .unwrap();
    let expected = 3000.0 / (std::f64::consts::TAU * 7.0).powi(2);
    let mut free = 0;
    for (patch, name) in names.iter().enumerate() {
        let now = simulation.patch_positions(patch);
        let wanted = simulation.patch_targets(patch);
        if patch != pad {
            assert_eq!(now, wanted, "{name} is no cloth");
            continue;
        }
        for (now, wanted) in now.iter().zip(wanted) {
            let sag = f64::from(wanted.z - now.z);
            assert!(sag < 1.01 * expected, "{sag} of {expected}");
            free += usize::from(sag > 0.99 * expected);
        }
    }
    assert!(
        free * 2 > simulation.patch_positions(pad).len(),
        "{free} nodes are free"
    );
}

#[test]
fn a_face_on_its_back_feels_what_an_upright_one_does_under_turned_gravity() {
    let place = "[place]\nposition = [500, 20, -80]\nturn = [-1.5707963267948966, 0, 0]\n";
    let mut lying = simulation(place);
    let a = after(&mut lying, 60);
    let b = after(&mut simulation("gravity = [0, 0, -9810]"), 60);
    assert!(largest_gap(&a, &b) < 1e-3);
    let up = lying.head() * Point3::new(0.0, 0.0, 100.0);
    assert!(
        (up - Point3::new(500.0, 120.0, -80.0)).norm() < 1e-9,
        "{up}"
    );
}

#[test]
fn keyed_head_motion_accelerates_as_its_curve_does() {
    let text = "neck_pivot = [0, 0, 0]\n[head_motion]\nkeys = [{ time = 0 }, { time = 1, \
                position = [100, 0, 0], rotation = [0, 0.8, 0] }]";
    let mut simulation = simulation(text);
    for t in [0.1, 0.25, 0.6, 0.9] {
        // x = 100 s and angle = 0.8 s with s = 3 t^2 - 2 t^3.
        let motion = simulation.pose_at(t).head_motion;
        let (s, rate, change) = (
            3.0 * t * t - 2.0 * t * t * t,
            6.0 * t * (1.0 - t),
            6.0 - 12.0 * t,
        );
        let (sin, cos) = (0.8 * s).sin_cos();
        let linear = Vector3::new(cos, 0.0, sin) * (100.0 * change);
        let gap = (motion.linear_acceleration.cast::<f64>() - linear).norm();
        assert!(
            gap < 0.01 * linear.norm() + 0.1,
            "{motion:?} at {t}, not {linear}"
        );
        assert!((f64::from(motion.angular_velocity.y) - 0.8 * rate).abs() < 1e-2);
        assert!((f64::from(motion.angular_acceleration.y) - 0.8 * change).abs() < 1e-2);
    }
    // And the cloth feels it: it lags behind a head that is accelerated.
    let rest = after(&mut self::simulation("dynamics = \"none\""), 1);
    let pushed = after(&mut simulation, 8);
    let mean = pushed
        .iter()
        .zip(&rest)
        .map(|(a, b)| a.x - b.x)
        .sum::<f32>();
    assert!(mean / (pushed.len() as f32) < -0.01, "{mean}");
}

#[test]
fn wind_and_pushes_reach_the_cloth_without_a_take() {
    let rest = after(&mut simulation("dynamics = \"none\""), 1);
    let mean_x = |text: &str| {
        let now = after(&mut simulation(text), 40);
        let sum: f32 = now.iter().zip(&rest).map(|(a, b)| a.x - b.x).sum();
        sum / now.len() as f32
    };
    let wind = mean_x("wind = [20000, 0, 0]");
    assert!(wind > 0.002, "{wind}");
    let gusts = mean_x("wind = [20000, 0, 0]\n[turbulence]\nintensity = 6000");
    assert!((gusts - wind).abs() > 0.02 * wind, "{gusts} {wind}");
    let push = "[[forces]]\nname = \"fan\"\ncenter = [-200, 0, 60]\nstrength = 5000\nreach = 900\n";
    let push = mean_x(push);
    assert!(push > 0.02, "{push}");
}

#[test]
fn materials_of_a_scene_are_edits_of_the_rig() {
    let text = "gravity = [0, 0, -9810]\n[materials.fat]\nmagnet_frequency_hz = 4\n";
    let mut of_scene = simulation(text);
    let mut rig = Rig::clone(&RIG);
    let edits = Edits::parse("[materials.fat]\nmagnet_frequency_hz = 4\n").unwrap();
    edits.apply(&mut rig).unwrap();
    let scene = Scene::from_toml("gravity = [0, 0, -9810]").unwrap();
    let mut of_rig = Simulation::new(Arc::new(rig), scene, None).unwrap();
    assert_eq!(after(&mut of_scene, 20), after(&mut of_rig, 20));
}

#[test]
fn what_a_rig_lacks_is_told_with_its_place() {
    let fails = |text: &str, parts: &[&str]| {
        let scene = Scene::from_toml(text).unwrap();
        let Err(error) = Simulation::new(Arc::clone(&RIG), scene, None) else {
            panic!("{text}");
        };
        let mut message = error.to_string();
        let mut cause = std::error::Error::source(&error);
        while let Some(inner) = cause {
            message = format!("{message}: {inner}");
            cause = inner.source();
        }
        for part in parts {
            assert!(message.contains(part), "no '{part}' in: {message}");
        }
    };
    fails(
        "[simulate]\nonly = [\"frontalis_l\",\n \"malar_fat_k\"]",
        &["line 3, column 2", "`simulate.only[1]`", "mean `malar_fat_"],
    );
    fails(
        "[materials.fatt]\nmass = 2",
        &["line 1", "`materials.fatt`", "'fat'"],
    );
    fails(
        "\n[wrinkles.brow]\nmap = \"no_such.png\"",
        &["line 2", "`wrinkles.brow`", "no_such.png"],
    );
    fails("[[faces]]\nrig = \"a.fabrig\"", &["1 faces of its own"]);
}

#[test]
fn takes_start_when_and_play_as_fast_as_they_are_told() {
    let text = "fabrig-keys 1\n0 jawOpen=0\n1 jawOpen=0.8\n2 jawOpen=0.2\n";
    let clip = parse(text, "jaw", &ReadOptions::default()).unwrap();
    let slow = clip.retimed(0.5, 0.5).unwrap();
    assert_eq!((slow.times()[0], slow.duration()), (0.5, 4.0));
    for t in [0.0, 0.3, 1.0, 1.7] {
        let (own, later) = (clip.sample(t), slow.sample(0.5 + 2.0 * t));
        assert!((own.weights[0] - later.weights[0]).abs() < 1e-6);
        assert!((own.rates[0] - 2.0 * later.rates[0]).abs() < 1e-5);
    }
    assert!(clip.retimed(0.0, 0.0).is_err() && clip.retimed(f64::NAN, 1.0).is_err());
    // Before it starts the face holds still.
    let mut waiting = Simulation::new(Arc::clone(&RIG), Scene::default(), Some(slow)).unwrap();
    waiting.start_at(0.0).unwrap();
    assert_eq!(waiting.time(), 0.0);
    let before = after(&mut waiting, 20);
    let (rms, largest) = waiting.settle_error();
    assert!(rms < 1e-4 && largest < 1e-3, "{rms} {largest}");
    assert!(largest_gap(&before, &after(&mut waiting, 60)) > 1.0);
}
