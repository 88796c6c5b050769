//! Whether an opening of the face can open: two sides with something behind them, or one
//! surface across the seam.
//!
//! Both kinds look alike from the front where lips and lids are shut. They differ in the way
//! along the surface from one side to the other between the corners, over the seam: on a fused
//! face it dips into a crease and comes out again; where there is an inside it runs through
//! the whole mouth bag or socket; where the mesh ends behind the lips there is none at all.
//! The way is looked for inside a slab about a column of the parting, so that it cannot go
//! round a corner of the mouth, however short that would be.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::openings::{Parting, PartingColumn};
use super::report::{DistanceStatistics, OpeningMeasure, OpeningMeasures, OpeningState};
use super::target::Target;
use crate::Point;
use crate::mesh::Topology;

/// The way is measured from this far above the parting to this far below it, each in turn: the
/// shut lids of a scan may part some millimetres from the crease that is seen best. (mm)
const BESIDE_MM: [f64; 3] = [2.0, 4.0, 6.0];
/// Half the slab's thickness over the width of the opening.
const SLAB_SHARE: f64 = 0.2;
/// Surface behind the seam, over the width of the opening, that lets the sides part without
/// stretching: a mouth opens about as high as it is wide, a lid less.
const INSIDE_SHARE: f64 = 0.45;
/// Sides whose seen edges are this close touch. (mm)
const TOUCHING_MM: f64 = 0.5;
/// Ways are searched for up to this many widths of the opening.
const SEARCHED_WIDTHS: f64 = 8.0;
/// Columns of the middle that are asked.
const MIDDLE: f64 = 0.15;

/// Measures one opening; `parting` is `None` where no place stands out at which it could part.
pub(super) fn measure_opening(
    target: &Target,
    topology: &Topology,
    parting: Option<&Parting>,
) -> OpeningMeasure {
    let Some(parting) = parting else {
        return OpeningMeasure {
            state: OpeningState::Fused,
            gap_mm: 0.0,
            inside_mm: Some(0.0),
            seam: DistanceStatistics::default(),
        };
    };
    let middle: Vec<&PartingColumn> = parting
        .columns
        .iter()
        .filter(|c| (c.fraction - 0.5).abs() < MIDDLE)
        .collect();
    let mut gaps: Vec<f64> = middle
        .iter()
        .map(|c| (c.upper.point - c.lower.point).dot(&parting.up).abs())
        .collect();
    // No way at all counts as an endless one: half of the columns decide.
    let mut insides: Vec<f64> = middle
        .iter()
        .map(|c| {
            BESIDE_MM
                .iter()
                .map(|mm| way_behind(target, topology, parting, c, *mm).unwrap_or(f64::INFINITY))
                .fold(0.0, f64::max)
        })
        .collect();
    let gap_mm = median(&mut gaps).unwrap_or(0.0);
    let inside_mm = median(&mut insides).unwrap_or(0.0);
    let state = if inside_mm < INSIDE_SHARE * parting.width && !parting.is_through {
        OpeningState::Fused
    } else if parting.is_through || gap_mm > TOUCHING_MM {
        OpeningState::Open
    } else {
        OpeningState::Closed
    };
    OpeningMeasure {
        state,
        gap_mm,
        inside_mm: inside_mm.is_finite().then_some(inside_mm),
        seam: DistanceStatistics::default(),
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Length of surface behind the seam at a column: the way from the upper side to the lower one
/// less the straight line; `None` where the mesh joins them nowhere in the slab. (mm)
fn way_behind(
    target: &Target,
    topology: &Topology,
    parting: &Parting,
    column: &PartingColumn,
    beside_mm: f64,
) -> Option<f64> {
    let beside = parting.up * beside_mm;
    let above = nearest_vertex(target, &(column.upper.point + beside));
    let below = nearest_vertex(target, &(column.lower.point - beside));
    let place = |v: u32| target.positions[v as usize];
    let middle = nalgebra::center(&column.upper.point, &column.lower.point);
    let along = |p: &Point| (p - middle).dot(&parting.across);
    let half = SLAB_SHARE * parting.width;
    // A coarse mesh has no vertices to go by in a thin slab; an edge across its middle counts.
    let is_inside = |from: u32, to: u32| {
        let (a, b) = (along(&place(from)), along(&place(to)));
        b.abs() < half || a * b <= 0.0 || b.abs() < a.abs()
    };
    let limit = SEARCHED_WIDTHS * parting.width;
    let length = shortest_way(target, topology, [above, below], limit, is_inside)?;
    Some((length - (place(above) - place(below)).norm()).max(0.0))
}

fn nearest_vertex(target: &Target, point: &Point) -> u32 {
    let at = target.surface.closest(point);
    let corners = target.triangles[at.triangle as usize];
    let k = (0..3)
        .max_by(|&a, &b| at.barycentric[a].total_cmp(&at.barycentric[b]))
        .unwrap_or(0);
    corners[k]
}

/// Length of the shortest way along edges that `is_inside` lets pass, up to `limit`; a way of
/// that length where the surface goes on but the search does not.
fn shortest_way(
    target: &Target,
    topology: &Topology,
    [from, to]: [u32; 2],
    limit: f64,
    is_inside: impl Fn(u32, u32) -> bool,
) -> Option<f64> {
    let mut distance = std::collections::BTreeMap::from([(from, 0.0f64)]);
    let mut queue = BinaryHeap::from([Reverse((0u64, from))]);
    let mut was_limited = false;
    while let Some(Reverse((bits, v))) = queue.pop() {
        let d = f64::from_bits(bits);
        if v == to {
            return Some(d);
        }
        if distance.get(&v).is_some_and(|&known| d > known) {
            continue;
        }
        for &n in topology.neighbours(v).iter().filter(|&&n| is_inside(v, n)) {
            let step = d + (target.positions[n as usize] - target.positions[v as usize]).norm();
            was_limited |= step > limit;
            if step <= limit && distance.get(&n).is_none_or(|&known| step < known) {
                distance.insert(n, step);
                queue.push(Reverse((step.to_bits(), n)));
            }
        }
    }
    was_limited.then_some(limit)
}

/// How far the template's parting ended up from that of the face, at equal fractions from
/// corner to corner: both sides of every column that both have.
pub(super) fn seam_distances(own: Option<&Parting>, face: Option<&Parting>) -> DistanceStatistics {
    let (Some(own), Some(face)) = (own, face) else {
        return DistanceStatistics::default();
    };
    let distances = own
        .columns
        .iter()
        .filter_map(|c| {
            let mate = face.columns.iter().find(|m| m.fraction == c.fraction)?;
            Some([
                (c.upper.point - mate.upper.point).norm(),
                (c.lower.point - mate.lower.point).norm(),
            ])
        })
        .flatten()
        .collect();
    DistanceStatistics::from_distances(distances)
}

/// What a person should know of lips and lids, one sentence each.
pub(super) fn opening_warnings(openings: &OpeningMeasures) -> Vec<String> {
    let named = [
        ("the lips", openings.mouth),
        ("the lids of the left eye", openings.eyes[0]),
        ("the lids of the right eye", openings.eyes[1]),
    ];
    named
        .into_iter()
        .filter_map(|(name, opening)| match (opening.state, opening.inside_mm) {
            (OpeningState::Fused, _) => Some(format!(
                "{name} are one surface, fused across the seam: they stretch when they part; \
                 cut them (--cut-seams, `cut_seams`) to let them open"
            )),
            (OpeningState::Closed, Some(inside)) => Some(format!(
                "{name} are shut: one surface joins them, but {inside:.0} mm of it lie behind \
                 the seam, so they part without a cut"
            )),
            (OpeningState::Closed, None) => Some(format!(
                "{name} are shut, but no surface joins them: they part without a cut"
            )),
            (OpeningState::Open, _) => None,
        })
        .collect()
}
