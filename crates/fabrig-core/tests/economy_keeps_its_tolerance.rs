//! What the economical run leaves out it may: no frame differs from the full run's by more than
//! the tolerance, and none by more than the bound that it prints.
//!
//! The take of a real performance is asked for by `FABRIG_SHARED`, more random scenes by
//! `FABRIG_ECONOMY_SCENES`.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::motion::{Clip, ReadOptions, parse_keys, read};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{
    Economy, EconomyCase, FrameReport, Scene, Simulation, Tolerance, active_take, economy_case,
    random_economy_case,
};
use fabrig_core::template::demo_take;

/// Frames per second.
const FPS: f64 = 60.0;
/// Frames that are compared.
const FRAMES: usize = 620;
/// (mm)
const TOLERANCES: [f64; 3] = [0.05, 0.1, 0.2];
/// The whole of the bundled take.
const ALL_FRAMES: usize = 720;
/// What the little that is left of a difference may have grown to in a storm, whatever the
/// tolerance. (mm)
const GROWN: f64 = 0.1;

/// The lower half of the face is still.
const UPPER_HALF: &str = "fabrig-keys 1
0.5 browInnerUp=0 browOuterUp=0
1.0 browInnerUp=0.9 browOuterUp=0.5
2.0 browInnerUp=0.2
2.3 eyeBlink=0
2.4 eyeBlink=1
2.6 eyeBlink=0
3.0 browInnerUp=0.8 browOuterUp=0
";

fn rig() -> &'static Arc<Rig> {
    &faces::demo().rig
}

fn run(clip: &Clip, economy: Economy, from: f64, frames: usize) -> EconomyCase {
    let of = (&Scene::default(), clip);
    economy_case("a take", rig(), of, economy, [from, 1.0 / FPS], frames, 1).unwrap()
}

/// No bound is violated, and no frame is off by more than the tolerance. In a storm two runs that
/// ever differed in their last bits differ by what these grow to.
fn assert_kept(case: &EconomyCase) {
    for (k, frame) in case.frames.iter().enumerate() {
        let bound = frame.report.bound;
        let slack = 2e-4;
        assert!(
            frame.patch <= bound + slack,
            "{}, frame {k}: off by {}, bound {bound}",
            case.name,
            frame.patch
        );
        let most = if frame.report.is_storm {
            case.tolerance.max(GROWN)
        } else {
            case.tolerance
        };
        let off = frame.patch.max(frame.skin);
        assert!(
            off <= most + slack,
            "{}, frame {k}: off by {off}, tolerance {}",
            case.name,
            case.tolerance
        );
    }
}

#[test]
fn frames_keep_to_the_tolerance_and_to_their_bounds() {
    let clip = parse_keys(demo_take(), "the bundled take").unwrap();
    for tolerance in TOLERANCES {
        let case = run(&clip, Economy::within(tolerance), 0.0, ALL_FRAMES);
        assert_kept(&case);
        assert!(case.worst() > 0.0, "nothing was left out");
        // The take shakes the head and has a gust: that is foreseen, so the bound means something.
        let in_storm = case.frames.iter().filter(|frame| frame.report.is_storm);
        let (count, bound) = in_storm.fold((0, 0.0f64), |(count, bound), frame| {
            (count + 1, bound.max(frame.report.bound))
        });
        assert!(
            count > 50 && bound < 0.5,
            "{count} frames in a storm, bound {bound}"
        );
    }
}

#[test]
fn a_face_that_is_all_in_motion_keeps_to_the_tolerance() {
    let clip = active_take(&rig().shape_names, 3.0).unwrap();
    let case = run(&clip, Economy::within(TOLERANCES[0]), 0.0, 180);
    assert_kept(&case);
}

#[test]
fn what_nobody_foresees_keeps_to_its_bound() {
    // The same take, frame by frame from outside: nothing says that a storm comes.
    let clip = parse_keys(demo_take(), "the bundled take").unwrap();
    let of = |economy: Economy| {
        let scene = Scene {
            economy,
            ..Scene::default()
        };
        let mut simulation = Simulation::new(Arc::clone(rig()), scene, Some(clip.clone())).unwrap();
        simulation.start_at(8.5).unwrap();
        simulation
    };
    let (mut full, mut live) = (of(Economy::OFF), of(Economy::default()));
    let (mut storms, mut spared) = (0, 0);
    for frame in 0..150 {
        let pose = live.pose_at(live.time() + 1.0 / FPS);
        let report = live.advance_to(pose, 1.0 / FPS).unwrap().economy;
        full.advance(1.0 / FPS).unwrap();
        storms += u32::from(report.is_storm);
        spared += u32::from(!report.is_whole);
        for patch in 0..rig().patches.len() {
            let nodes = full
                .patch_positions(patch)
                .iter()
                .zip(live.patch_positions(patch));
            let sum: f64 = nodes.map(|(p, q)| f64::from((p - q).norm_squared())).sum();
            let off = (sum / full.patch_positions(patch).len() as f64).sqrt();
            assert!(off <= report.bound + 2e-4, "frame {frame}: off by {off}");
        }
    }
    assert!(storms > 20 && spared > 20, "{storms} {spared}");
}

#[test]
fn a_real_take_keeps_to_the_tolerance_on_every_frame() {
    let Ok(shared) = std::env::var("FABRIG_SHARED") else {
        return;
    };
    let path = format!("{shared}/mocap/livelinkface_rom.csv");
    let clip = read(path, &ReadOptions::default()).unwrap();
    for from in [5.0, 35.0] {
        for tolerance in TOLERANCES {
            let case = run(&clip, Economy::within(tolerance), from, FRAMES);
            assert_eq!(case.storm_frames(), 0);
            assert_kept(&case);
        }
    }
}

#[test]
fn bounds_hold_in_random_scenes() {
    let count = std::env::var("FABRIG_ECONOMY_SCENES").map_or(4, |n| n.parse().unwrap());
    for seed in 0..count {
        let case = random_economy_case(rig(), seed).unwrap();
        assert_eq!(case.broken_bounds(), 0, "{}", case.name);
    }
}

fn simulation(economy: Economy, take: &str) -> Simulation {
    let scene = Scene {
        economy,
        ..Scene::default()
    };
    let clip = parse_keys(take, "a take").unwrap();
    Simulation::new(Arc::clone(rig()), scene, Some(clip)).unwrap()
}

fn frames(simulation: &mut Simulation, count: usize) -> Vec<FrameReport> {
    let mut frame = || simulation.advance(1.0 / FPS).unwrap();
    (0..count).map(|_| frame()).collect()
}

#[test]
fn a_still_half_of_the_face_costs_next_to_nothing() {
    let clip = parse_keys(UPPER_HALF, "half of a face").unwrap();
    let case = run(&clip, Economy::default(), 0.0, 200);
    assert_kept(&case);
    let (mut taken, mut full, mut moved, mut skin) = (0, 0, 0, 0);
    for report in case.frames.iter().map(|frame| frame.report) {
        taken += report.substeps * (report.patches - report.sleeping);
        full += report.full_substeps * report.patches;
        moved += report.skin_moved;
        skin += report.skin_vertices;
    }
    assert!(4 * taken < full, "{taken} of {full} substeps of patches");
    assert!(2 * moved < skin, "{moved} of {skin} vertices");
}

#[test]
fn a_face_that_nothing_acts_on_is_culled() {
    let mut simulation = simulation(Economy::default(), "fabrig-keys 1\n0.5 jawOpen=0\n2 end\n");
    let reports = frames(&mut simulation, 40);
    let last = &reports[39].economy;
    assert_eq!((last.sleeping, last.substeps), (last.patches, 0));
    assert_eq!(u32::try_from(rig().patches.len()), Ok(last.still));
    for patch in 0..rig().patches.len() {
        assert_eq!(
            simulation.patch_positions(patch),
            simulation.patch_targets(patch)
        );
    }
    assert_eq!(simulation.skin(), simulation.rest_skin());
}

#[test]
fn parts_are_switched_one_by_one() {
    let all = Economy::default();
    let count = |economy: Economy, of: fn(&FrameReport) -> bool| {
        let mut simulation = simulation(economy, UPPER_HALF);
        let reports = frames(&mut simulation, 70);
        reports.iter().filter(|report| of(report)).count()
    };
    let sleeps = |r: &FrameReport| r.economy.sleeping > 0;
    let glides =
        |r: &FrameReport| r.economy.sleeping + 10 > r.economy.patches && r.economy.still < 34;
    let spares =
        |r: &FrameReport| r.economy.substeps > 0 && r.economy.substeps < r.economy.full_substeps;
    let leaves = |r: &FrameReport| r.economy.skin_moved < r.economy.skin_vertices;
    assert!(count(all, sleeps) > 20 && count(all, spares) > 5 && count(all, leaves) > 20);
    assert_eq!(
        count(
            Economy {
                sleep: false,
                ..all
            },
            sleeps
        ),
        0
    );
    let active = Economy {
        quasi_static: false,
        ..all
    };
    assert!(count(active, glides) <= count(all, glides));
    assert_eq!(
        count(
            Economy {
                substeps: false,
                ..all
            },
            spares
        ),
        0
    );
    assert_eq!(count(Economy { skin: false, ..all }, leaves), 0);
}

#[test]
fn skin_that_did_not_move_changes_no_bit() {
    let exact = Economy {
        skin: true,
        ..Economy::OFF
    };
    let (mut full, mut thrifty) = (
        simulation(Economy::OFF, UPPER_HALF),
        simulation(exact, UPPER_HALF),
    );
    for _ in 0..3 {
        frames(&mut full, 20);
        let reports = frames(&mut thrifty, 20);
        assert_eq!(full.skin(), thrifty.skin());
        assert!(reports[0].economy.skin_moved < reports[0].economy.skin_vertices);
    }
}

#[test]
fn bits_do_not_depend_on_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut simulation = simulation(Economy::default(), UPPER_HALF);
            let reports: Vec<_> = frames(&mut simulation, 80)
                .iter()
                .map(|report| report.economy)
                .collect();
            (reports, simulation.skin().to_vec())
        })
    };
    let one = run(1);
    assert!(one.0.iter().any(|report| report.sleeping > 0));
    assert_eq!(one, run(3));
}

#[test]
fn tolerances_out_of_range_are_refused() {
    for tolerance in [Tolerance::Millimetres(-1.0), Tolerance::Percent(f64::NAN)] {
        let scene = Scene {
            economy: Economy {
                tolerance,
                ..Economy::default()
            },
            ..Scene::default()
        };
        let error = Simulation::new(Arc::clone(rig()), scene, None)
            .err()
            .unwrap();
        assert!(error.to_string().contains("is no tolerance"), "{error}");
    }
}
