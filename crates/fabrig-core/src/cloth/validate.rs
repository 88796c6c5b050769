//! Checks of everything a cloth is given, so that stepping cannot fail.

use nalgebra::Vector3;

use super::assembly::PatchLayout;
use super::error::ClothError;
use super::input::{ClothAttachment, ClothOptions, ClothPatch, FrameInput, PatchMotion};
use crate::machine::vectorized;

/// Largest coordinate. (mm)
const FARTHEST: f32 = 1e6;
/// Largest velocity. (mm/s)
const FASTEST: f32 = 1e9;
/// Largest acceleration. (mm/s^2)
const HARDEST: f32 = 1e9;
/// Largest angular velocity or acceleration. [rad/s, rad/s^2]
const FASTEST_TURN: f32 = 1e5;
/// Longest frame. (s)
const LONGEST_FRAME: f64 = 10.0;

/// Checks options.
pub(crate) fn options(o: &ClothOptions) -> Result<(), ClothError> {
    let ranges = [
        ("sweeps", f64::from(o.sweeps), 1.0, 64.0),
        ("rest_blend", o.rest_blend, 0.0, 1.0),
        ("rest_imperfection", o.rest_imperfection, 0.0, 1.0),
        ("areal_density", o.areal_density, 1e-9, 1e9),
        ("air_density", o.air_density, 0.0, 1.0),
        ("drag", o.drag, 0.0, 1e3),
        ("lift", o.lift, 0.0, 1e3),
    ];
    for (name, value, low, high) in ranges {
        within(name, value, low, high)?;
    }
    substeps(o.substeps)?;
    field("standing gravity", &o.standing_gravity, HARDEST)
}

fn substeps(count: u32) -> Result<(), ClothError> {
    within("substeps", f64::from(count), 1.0, 4096.0)
}

fn within(name: &'static str, value: f64, low: f64, high: f64) -> Result<(), ClothError> {
    // Written so that NaN is out of range.
    if value >= low && value <= high {
        return Ok(());
    }
    Err(ClothError::Option {
        name,
        value,
        low,
        high,
    })
}

/// Checks patches and their attachments.
pub(crate) fn patches(patches: &[ClothPatch]) -> Result<(), ClothError> {
    for (index, patch) in patches.iter().enumerate() {
        let shape = patch.shape;
        let (kind, expected) = if shape.is_periodic {
            ("periodic", 3)
        } else {
            ("plain", 1)
        };
        if shape.u_count < expected || shape.v_count < 1 {
            return Err(ClothError::GridTooSmall {
                patch: index,
                kind,
                expected,
                u_count: shape.u_count,
                v_count: shape.v_count,
            });
        }
        if patch.rest.len() != shape.node_count() {
            return Err(ClothError::NodeCount {
                patch: index,
                u_count: shape.u_count,
                v_count: shape.v_count,
                expected: shape.node_count(),
                actual: patch.rest.len(),
            });
        }
        let rest = patch.rest.iter().map(|p| p.coords.into());
        values("rest positions", index, rest, FARTHEST)?;
        patch
            .material
            .validate()
            .map_err(|source| ClothError::Material {
                patch: index,
                source,
            })?;
        variations(index, patch)?;
        for attachment in 0..patch.attachments.len() {
            self::attachment(patches, index, attachment)?;
        }
    }
    Ok(())
}

fn variations(index: usize, patch: &ClothPatch) -> Result<(), ClothError> {
    let (given, expected) = (&patch.variations, patch.rest.len());
    let wrong = |node: usize, condition| ClothError::Variation {
        patch: index,
        node,
        value: given.get(node).copied(),
        condition,
    };
    if !given.is_empty() && given.len() != expected {
        let node = given.len().min(expected);
        return Err(wrong(
            node,
            "there must be one for each node, or none at all",
        ));
    }
    let factor = 0.001..=1000.0;
    for (node, v) in given.iter().enumerate() {
        if !(factor.contains(&v.stretch) && factor.contains(&v.bend)) {
            return Err(wrong(
                node,
                "stretch and bend must be between 0.001 and 1000",
            ));
        }
        if !(0.0..=1.0).contains(&v.rest_blend) {
            return Err(wrong(node, "rest_blend must be between 0 and 1"));
        }
    }
    Ok(())
}

fn attachment(patches: &[ClothPatch], patch: usize, attachment: usize) -> Result<(), ClothError> {
    let own = patches[patch].rest.len();
    let check = |what, index: u32, count: usize| {
        if (index as usize) < count {
            Ok(())
        } else {
            Err(ClothError::AttachmentIndex {
                patch,
                attachment,
                what,
                index,
                count,
            })
        }
    };
    let strength = match &patches[patch].attachments[attachment] {
        ClothAttachment::Anchors { nodes, strength } => {
            for &node in nodes {
                check("node", node, own)?;
            }
            *strength
        }
        ClothAttachment::Patch {
            patch: other,
            pairs,
            strength,
        } => {
            check("patch", *other, patches.len())?;
            if *other as usize == patch {
                return Err(ClothError::SelfAttachment { patch, attachment });
            }
            for &(a, b) in pairs {
                check("node", a, own)?;
                check("other node", b, patches[*other as usize].rest.len())?;
            }
            *strength
        }
    };
    if !(0.0..=1e6).contains(&strength) {
        return Err(ClothError::AttachmentStrength {
            patch,
            attachment,
            strength,
        });
    }
    Ok(())
}

/// Checks one frame.
pub(crate) fn frame(layout: &[PatchLayout], input: &FrameInput<'_>) -> Result<(), ClothError> {
    if !(input.dt > 0.0 && input.dt <= LONGEST_FRAME) {
        return Err(ClothError::TimeStep {
            dt: input.dt,
            limit: LONGEST_FRAME,
        });
    }
    if let Some(gravity) = &input.gravity {
        field("gravity", gravity, HARDEST)?;
    }
    if !input.held.is_empty() {
        count("held flags", layout.len(), input.held.len())?;
    }
    if let Some(substeps) = input.substeps {
        self::substeps(substeps)?;
    }
    field("wind", &input.wind, 1e7)?;
    let head = &input.head;
    field(
        "linear acceleration of the head",
        &head.linear_acceleration,
        HARDEST,
    )?;
    field(
        "angular velocity of the head",
        &head.angular_velocity,
        FASTEST_TURN,
    )?;
    field(
        "angular acceleration of the head",
        &head.angular_acceleration,
        FASTEST_TURN,
    )?;
    motions(layout, input.targets, input.anchors)
}

/// Checks the motion of targets and anchors.
pub(crate) fn motions(
    layout: &[PatchLayout],
    targets: &[PatchMotion],
    anchors: &[PatchMotion],
) -> Result<(), ClothError> {
    count("targets", layout.len(), targets.len())?;
    for (patch, (at, motion)) in layout.iter().zip(targets).enumerate() {
        let names = ["target positions", "target velocities"];
        self::motion(names, patch, at.node_count, motion)?;
    }
    if anchors.is_empty() {
        return Ok(());
    }
    count("anchors", layout.len(), anchors.len())?;
    for (patch, (at, motion)) in layout.iter().zip(anchors).enumerate() {
        let names = ["anchor positions", "anchor velocities"];
        self::motion(names, patch, at.anchor_count, motion)?;
    }
    Ok(())
}

fn count(what: &'static str, expected: usize, actual: usize) -> Result<(), ClothError> {
    if expected == actual {
        return Ok(());
    }
    Err(ClothError::PatchCount {
        what,
        expected,
        actual,
    })
}

fn motion(
    names: [&'static str; 2],
    patch: usize,
    expected: usize,
    motion: &PatchMotion,
) -> Result<(), ClothError> {
    let length = |what, actual| {
        if actual == expected {
            return Ok(());
        }
        Err(ClothError::MotionLength {
            what,
            patch,
            expected,
            actual,
        })
    };
    length(names[0], motion.positions.len())?;
    if !motion.velocities.is_empty() {
        length(names[1], motion.velocities.len())?;
    }
    let (positions, velocities) = (&motion.positions, &motion.velocities);
    // All in one go, without branches; only where something is wrong it is looked for.
    let farthest = largest_bits(bytemuck::cast_slice(positions));
    let fastest = largest_bits(bytemuck::cast_slice(velocities));
    if farthest <= FARTHEST.to_bits() && fastest <= FASTEST.to_bits() {
        return Ok(());
    }
    values(
        names[0],
        patch,
        positions.iter().map(|p| p.coords.into()),
        FARTHEST,
    )?;
    values(
        names[1],
        patch,
        velocities.iter().map(|&v| v.into()),
        FASTEST,
    )
}

/// Bits of the largest size of any number: ordered as sizes are, NaN beyond all of them.
fn largest_bits(numbers: &[f32]) -> u32 {
    vectorized(LargestBits(numbers))
}

struct LargestBits<'a>(&'a [f32]);

impl pulp::NullaryFnOnce for LargestBits<'_> {
    type Output = u32;

    #[inline(always)]
    fn call(self) -> u32 {
        let sizes = self.0.iter().map(|x| x.abs().to_bits());
        sizes.fold(0, u32::max)
    }
}

fn values(
    what: &'static str,
    patch: usize,
    values: impl Iterator<Item = [f32; 3]>,
    limit: f32,
) -> Result<(), ClothError> {
    for (node, value) in values.enumerate() {
        if !value.iter().all(|x| x.abs() <= limit) {
            return Err(ClothError::MotionValue {
                what,
                patch,
                node,
                value,
                limit,
            });
        }
    }
    Ok(())
}

fn field(what: &'static str, value: &Vector3<f32>, limit: f32) -> Result<(), ClothError> {
    if value.iter().all(|x| x.abs() <= limit) {
        return Ok(());
    }
    Err(ClothError::FieldValue {
        what,
        value: (*value).into(),
        limit,
    })
}
