//! Patches, poses and measures that the cases share.

use nalgebra::{Point3, Vector3};

use crate::cloth::{
    Cloth, ClothOptions, ClothPatch, FrameInput, GridShape, Material, PatchMotion, StepReport,
};

/// (s)
pub(crate) const DT: f64 = 1.0 / 60.0;

/// A domed patch of 2 mm edges, to the right of the middle if `sign` is -1.
pub(crate) fn dome(u_count: u32, v_count: u32, sign: f32, material: Material) -> ClothPatch {
    dome_at(u_count, v_count, 10.0, sign, material)
}

/// The same with its first column at `offset` (mm) from the middle.
pub(crate) fn dome_at(
    u_count: u32,
    v_count: u32,
    offset: f32,
    sign: f32,
    material: Material,
) -> ClothPatch {
    let mut rest = Vec::new();
    for v in 0..v_count {
        for u in 0..u_count {
            let (x, y) = (u as f32 * 2.0 + offset, v as f32 * 2.0 - 20.0);
            let z = 80.0 - 0.012 * (x - 30.0) * (x - 30.0) - 0.01 * y * y;
            rest.push(Point3::new(sign * x, y, z));
        }
    }
    ClothPatch {
        shape: GridShape {
            u_count,
            v_count,
            is_periodic: false,
        },
        rest,
        material,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}

/// The patch contracted towards its first node by a share and lifted in the middle. (mm)
pub(crate) fn contracted(patch: &ClothPatch, share: f32, lift: f32) -> Vec<Point3<f32>> {
    let first = patch.rest[0].x;
    patch
        .rest
        .iter()
        .map(|p| {
            let bump = ((p.x - first).abs() / 40.0 * std::f32::consts::PI).sin();
            Point3::new(
                p.x - share * (p.x - first),
                p.y + 0.3 * lift * bump,
                p.z + lift * bump,
            )
        })
        .collect()
}

/// Every position moved alike.
pub(crate) fn shifted(points: &[Point3<f32>], by: Vector3<f32>) -> Vec<Point3<f32>> {
    points.iter().map(|p| p + by).collect()
}

/// A cloth of these patches.
///
/// # Panics
///
/// If the case is not well made.
pub(crate) fn cloth(patches: &[ClothPatch], options: &ClothOptions) -> Cloth {
    Cloth::new(patches, options).expect("the case is well made")
}

/// One frame.
///
/// # Panics
///
/// If the case is not well made.
pub(crate) fn step(cloth: &mut Cloth, dt: f64, targets: &[PatchMotion]) -> StepReport {
    cloth
        .step(&FrameInput::new(dt, targets))
        .expect("the frame is well made")
}

/// Frames on fixed targets; the last report, with the guards of all.
pub(crate) fn hold(cloth: &mut Cloth, poses: &[&[Point3<f32>]], frames: usize) -> StepReport {
    let targets: Vec<PatchMotion> = poses.iter().map(|p| PatchMotion::still(p)).collect();
    let mut last = StepReport::default();
    for _ in 0..frames {
        let counters = last.counters;
        last = step(cloth, DT, &targets);
        last.counters += counters;
    }
    last
}

/// RMS distance of a patch to positions, infinite where one is no number. (mm)
pub(crate) fn rms(cloth: &Cloth, patch: usize, to: &[Point3<f32>]) -> f64 {
    let positions = cloth.positions(patch);
    let sum: f64 = positions
        .iter()
        .zip(to)
        .map(|(a, b)| f64::from((a - b).norm_squared()))
        .sum();
    let rms = (sum / to.len().max(1) as f64).sqrt();
    if rms.is_finite() { rms } else { f64::INFINITY }
}

/// Largest distance of two sets of positions. (mm)
pub(crate) fn farthest(a: &[Point3<f32>], b: &[Point3<f32>]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(p, q)| f64::from((p - q).norm()))
        .fold(0.0, |most, d| if d <= most { most } else { d })
}
