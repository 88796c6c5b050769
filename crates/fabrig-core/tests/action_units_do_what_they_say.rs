//! Each unit of the bundled FACS table does at full intensity, on the demo face and on a goblin
//! (and on ict_neutral, where the folder of shared data is given by `FABRIG_SHARED`), what the
//! manual describes, in millimetres on named points of the face's own skin; units that have
//! sides keep to the side that they are given on.
//!
//! Source: Ekman, Friesen & Hager, *Facial Action Coding System*, 2002, for what units do.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::collections::BTreeSet;

use fabrig_core::Vector;
use fabrig_core::facs::{ActionUnitMap, ActionUnitTable, UnitIntensity};
use faces::RiggedFace;
use faces::stage::{Claims, Posed, SIDES, Stage, rig_has_tongue};

/// Least motion of a landmark on the side of the intensity: x away from the middle. (mm)
type Motion = (&'static str, [f64; 3]);

/// Units that move one landmark above all, and how: each coordinate that is not zero is the
/// least motion in its direction. (mm)
const MOTIONS: [(&str, Motion); 17] = [
    ("AU1", ("brow_inner", [0.0, 2.0, 0.0])),
    ("AU2", ("brow_outer", [0.0, 1.0, 0.0])),
    ("AU4", ("brow_inner", [0.0, -2.0, 0.0])),
    ("AU5", ("upper_lid_mid", [0.0, 0.5, 0.0])),
    ("AU6", ("malar", [0.0, 1.0, 0.0])),
    ("AU7", ("lower_lid_mid", [0.0, 0.5, 0.0])),
    ("AU9", ("alar", [0.0, 1.0, 0.0])),
    ("AU10", ("upper_lip_side", [0.0, 1.5, 0.0])),
    ("AU11", ("upper_lip_side", [0.0, 0.5, 0.0])),
    ("AU12", ("lip_corner", [2.0, 4.0, -1.0])),
    ("AU13", ("lip_corner", [0.0, 1.5, 0.0])),
    ("AU14", ("lip_corner", [0.0, 0.0, -1.0])),
    ("AU15", ("lip_corner", [0.0, -2.0, 0.0])),
    ("AU16", ("lower_lip_bottom_side", [0.0, -1.5, 0.0])),
    ("AU20", ("lip_corner", [2.0, 0.0, 0.0])),
    ("AU33", ("cheek", [1.0, 0.0, 0.0])),
    ("AU34", ("cheek", [2.0, 0.0, 0.0])),
];

/// Units of the middle of the face: landmark and least motion. (mm)
const OF_THE_MIDDLE: [(&str, Motion); 5] = [
    ("AU17", ("lower_lip_mid", [0.0, 1.0, 0.0])),
    ("AU26", ("pogonion", [0.0, -6.0, 0.0])),
    ("AU27", ("pogonion", [0.0, -18.0, 0.0])),
    ("AU28", ("lower_lip_mid", [0.0, 0.0, -1.0])),
    ("AU29", ("pogonion", [0.0, 0.0, 4.0])),
];

/// Units told by the distance of two landmarks, `#` standing for the side, and its least change
/// (mm, negative for nearer).
const DISTANCES: [(&str, [&str; 2], f64); 6] = [
    ("AU18", ["lip_corner_l", "lip_corner_r"], -5.0),
    ("AU22", ["upper_lip_bottom", "lower_lip_top"], 2.0),
    (
        "AU23",
        ["upper_lip_side_#", "lower_lip_bottom_side_#"],
        -0.2,
    ),
    (
        "AU24",
        ["upper_lip_side_#", "lower_lip_bottom_side_#"],
        -0.5,
    ),
    ("AU25", ["upper_lip_bottom", "lower_lip_top"], 1.0),
    ("AU19", ["upper_lip_bottom", "lower_lip_top"], 3.0),
];

/// Units that close the eye on their side.
const CLOSING: [&str; 3] = ["AU43", "AU45", "AU46"];

/// Units that turn the eyes: axis of the gaze, and its sign.
const GAZES: [(&str, usize, f64); 4] = [
    ("AU61", 0, 1.0),
    ("AU62", 0, -1.0),
    ("AU63", 1, 1.0),
    ("AU64", 1, -1.0),
];

/// A face that action units move.
struct Units {
    stage: Stage,
    table: ActionUnitTable,
    map: ActionUnitMap,
}

impl Units {
    fn on(face: &'static RiggedFace) -> Self {
        let table = ActionUnitTable::bundled().unwrap();
        let names: Vec<&str> = face.rig.shape_names.iter().map(String::as_str).collect();
        Self {
            stage: Stage::new(face),
            map: ActionUnitMap::new(&table, &names).unwrap(),
            table,
        }
    }

    fn pose(&mut self, unit: &str, intensity: UnitIntensity) -> Posed {
        let mut intensities = vec![UnitIntensity::default(); self.table.units().len()];
        intensities[self.table.unit_index(unit).unwrap()] = intensity;
        let weights = self.map.weights(&intensities).unwrap();
        self.stage.weighted(&weights)
    }
}

fn one_side(side: usize) -> UnitIntensity {
    UnitIntensity {
        left: if side == 0 { 1.0 } else { 0.0 },
        right: if side == 1 { 1.0 } else { 0.0 },
    }
}

fn claim_motion(claims: &mut Claims, unit: &str, moved: Vector, least: [f64; 3]) {
    for (axis, least) in least.into_iter().enumerate().filter(|(_, l)| *l != 0.0) {
        let claim = format!("{unit} moves its landmark along {}", ["x", "y", "z"][axis]);
        claims.more(claim, moved[axis] * least.signum(), least.abs());
    }
}

#[test]
fn every_unit_of_the_table_has_its_claim() {
    let claimed: BTreeSet<&str> = MOTIONS
        .iter()
        .chain(&OF_THE_MIDDLE)
        .map(|m| m.0)
        .chain(DISTANCES.iter().map(|d| d.0))
        .chain(CLOSING)
        .chain(GAZES.iter().map(|g| g.0))
        .chain(["AU30"])
        .collect();
    let table = ActionUnitTable::bundled().unwrap();
    let units: BTreeSet<&str> = table.units().iter().map(|u| u.code.as_str()).collect();
    assert_eq!(claimed, units);
}

#[test]
fn units_move_their_landmarks() {
    faces::all_subjects().for_each(|face| {
        let mut units = Units::on(face);
        let mut claims = Claims::about(face);
        for (unit, (mark, least)) in MOTIONS {
            for (side, (_, s, out)) in SIDES.into_iter().enumerate() {
                let is_sided = !matches!(unit, "AU1" | "AU33" | "AU34");
                let intensity = if is_sided {
                    one_side(side)
                } else {
                    UnitIntensity::both(1.0)
                };
                let posed = units.pose(unit, intensity);
                let moved = posed.motion(&format!("{mark}_{s}"));
                let moved = Vector::new(out * moved.x, moved.y, moved.z);
                claim_motion(&mut claims, &format!("{unit} {s}"), moved, least);
                if is_sided {
                    let other = SIDES[1 - side].1;
                    let leak = posed.motion(&format!("{mark}_{other}")).norm();
                    let most = (0.15 * moved.norm()).max(0.3);
                    claims.less(
                        format!("{unit} {s} leaves the other side still"),
                        leak,
                        most,
                    );
                }
            }
        }
        for (unit, (mark, least)) in OF_THE_MIDDLE {
            let moved = units.pose(unit, UnitIntensity::both(1.0)).motion(mark);
            claim_motion(&mut claims, unit, moved, least);
        }
        for (side, (_, s, out)) in SIDES.into_iter().enumerate() {
            let moved = units.pose("AU30", one_side(side)).motion("pogonion");
            claims.more(format!("AU30 {s} moves the jaw there"), out * moved.x, 4.0);
        }
        claims.settle();
    });
}

#[test]
fn units_change_distances_close_eyes_and_turn_them() {
    faces::all_subjects().for_each(|face| {
        let mut units = Units::on(face);
        let mut claims = Claims::about(face);
        for (unit, marks, least) in DISTANCES {
            let posed = units.pose(unit, UnitIntensity::both(1.0));
            for (_, s, _) in SIDES {
                let [a, b] = marks.map(|mark| mark.replace('#', s));
                let (now, rest) = posed.distances(&a, &b);
                let change = (now - rest) * least.signum();
                claims.more(format!("{unit} changes {a} to {b}"), change, least.abs());
            }
            if unit == "AU19" && rig_has_tongue(face) {
                claims.more("AU19 shows the tongue", posed.largest().1, 10.0);
            }
        }
        for unit in CLOSING {
            for (side, (_, s, _)) in SIDES.into_iter().enumerate() {
                let posed = units.pose(unit, one_side(side));
                let (share, columns) = posed.open_share(s);
                claims.more(
                    format!("{unit} {s} has an eye to close"),
                    columns as f64,
                    15.0,
                );
                claims.less(format!("{unit} {s} closes it, share left"), share, 0.15);
                let (share, _) = posed.open_share(SIDES[1 - side].1);
                claims.more(format!("{unit} {s} leaves the other open"), share, 0.9);
            }
        }
        for (unit, axis, sign) in GAZES {
            let posed = units.pose(unit, UnitIntensity::both(1.0));
            for (eye, (_, s, _)) in SIDES.into_iter().enumerate() {
                claims.more(
                    format!("{unit} turns eye {s}"),
                    sign * posed.gazes[eye][axis],
                    0.3,
                );
            }
        }
        claims.settle();
    });
}
