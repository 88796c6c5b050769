//! Edits on a rig.

use std::collections::BTreeMap;
use std::path::Path;

use super::preset::apply_to_depth;
use super::thickness::thicken;
use super::{EditError, Edits, MaterialEdit, PatchEdit, ShapeEdit, WrinkleMap, apply_wrinkle_map};
use crate::Error;
use crate::anatomy::PatchKind;
use crate::cloth::Materials;
use crate::facs::nearest_name;
use crate::rig::{Rig, is_called};
use crate::transfer::PatchTransfer;

/// Amplitudes beyond this are mistyped.
const ALPHA_LIMITS: [f64; 2] = [0.0, 10.0];
/// Pads are no thicker or thinner than this against what they were. (mm)
const THICKNESSES: [f64; 2] = [-10.0, 20.0];

impl Edits {
    /// Applies the edits to a rig as it is built or loaded (not to one that has them already).
    ///
    /// # Errors
    ///
    /// [`EditError`] with the name; the rig is then unchanged.
    pub fn apply(&self, rig: &mut Rig) -> Result<(), EditError> {
        self.apply_at(rig, 0)
    }

    /// As [`Self::apply`], within `depth` presets.
    pub(super) fn apply_at(&self, rig: &mut Rig, depth: u32) -> Result<(), EditError> {
        let mut edited = rig.clone();
        for name in &self.preset {
            apply_to_depth(&mut edited, name, depth)?;
        }
        edit_materials(&mut edited, self)?;
        edit_patches(&mut edited, &self.patches)?;
        for (name, edit) in &self.shapes {
            edit_shape(&mut edited, name, edit)?;
        }
        for (name, edit) in &self.wrinkles {
            let map = match &edit.map {
                Some(path) => Some(WrinkleMap::read(&self.folder.join(path))?),
                None => None,
            };
            apply_wrinkle_map(&mut edited, name, map.as_ref(), edit)?;
        }
        *rig = edited;
        Ok(())
    }
}

/// Loads a rig with the edits that stand beside it, if any do.
///
/// # Errors
///
/// [`Error::Rig`] and [`Error::Edit`].
pub fn load_edited_rig(path: impl AsRef<Path>) -> Result<Rig, Error> {
    let path = path.as_ref();
    let mut rig = Rig::load(path)?;
    if let Some(edits) = Edits::beside(path)? {
        edits.apply(&mut rig)?;
    }
    Ok(rig)
}

/// Patch and place of a muscle shape by its name.
pub(super) fn find_shape(rig: &Rig, name: &str) -> Result<(usize, usize), EditError> {
    for (patch, p) in rig.patches.iter().enumerate() {
        if let Some(place) = p.transfer.shapes.iter().position(|s| s.name == name) {
            return Ok((patch, place));
        }
    }
    let names = rig.patches.iter().flat_map(|p| &p.transfer.shapes);
    Err(EditError::UnknownName {
        what: "muscle shape",
        found: name.to_owned(),
        nearest: nearest_name(name, names.map(|s| s.name.as_str()))
            .unwrap_or_default()
            .to_owned(),
    })
}

fn in_range(
    name: &str,
    what: &'static str,
    value: f64,
    range: [f64; 2],
    condition: &'static str,
) -> Result<f64, EditError> {
    if (range[0]..=range[1]).contains(&value) {
        return Ok(value);
    }
    Err(EditError::OutOfRange {
        name: name.to_owned(),
        what,
        value,
        condition,
    })
}

fn edit_patches(rig: &mut Rig, edits: &BTreeMap<String, PatchEdit>) -> Result<(), EditError> {
    let mut pads = Vec::new();
    for (name, edit) in edits {
        let patches = rig.patches.iter().enumerate();
        let places: Vec<usize> = patches
            .filter(|(_, p)| is_called(&p.patch.chart.name, name))
            .map(|(place, _)| place)
            .collect();
        if places.is_empty() {
            let names = rig.patches.iter().map(|p| p.patch.chart.name.as_str());
            return Err(EditError::UnknownName {
                what: "patch",
                found: name.to_owned(),
                nearest: nearest_name(name, names).unwrap_or_default().to_owned(),
            });
        }
        for place in places {
            edit_patch(rig, place, name, edit)?;
            if let Some(thickness) = edit.thickness {
                if rig.patches[place].patch.chart.kind != PatchKind::FatPad {
                    return Err(EditError::NoPad {
                        name: name.to_owned(),
                    });
                }
                let condition = "from -10 to 20 mm";
                let thickness = in_range(name, "thickness", thickness, THICKNESSES, condition)?;
                pads.push((place, thickness));
            }
        }
    }
    if pads.is_empty() {
        return Ok(());
    }
    thicken(rig, &pads)
}

fn edit_patch(rig: &mut Rig, place: usize, name: &str, edit: &PatchEdit) -> Result<(), EditError> {
    let materials = Materials::parse(&rig.materials)?;
    let patch = &mut rig.patches[place];
    if let Some(alpha) = edit.alpha {
        let alpha = in_range(name, "alpha", alpha, ALPHA_LIMITS, "from 0 to 10")?;
        let ratio = alpha / patch.transfer.alpha;
        if let Some(lids) = &mut patch.transfer.lids {
            let changes = lids.nodes.iter_mut().flat_map(|n| &mut n.radius_changes);
            changes.for_each(|change| *change *= ratio as f32);
        }
        patch.transfer.alpha = alpha;
    }
    if let Some(material) = &edit.material {
        if materials.iter().all(|(known, _)| known != material) {
            let known = materials.iter().map(|(name, _)| name);
            return Err(EditError::UnknownName {
                what: "material",
                found: material.clone(),
                nearest: nearest_name(material, known).unwrap_or_default().to_owned(),
            });
        }
        patch.patch.chart.material.clone_from(material);
    }
    Ok(())
}

fn edit_shape(rig: &mut Rig, name: &str, edit: &ShapeEdit) -> Result<(), EditError> {
    let (patch, place) = find_shape(rig, name)?;
    let jaw_shapes = rig.jaw.shapes;
    let eyes = rig.eyes;
    let neutral = rig.patches[patch].patch.neutral.clone();
    let transfer = &mut rig.patches[patch].transfer;
    let shape = transfer.shapes[place].shape;
    let hinged = match Some(shape) {
        s if s == jaw_shapes.open => Some(Hinged::Open),
        s if s == jaw_shapes.close => Some(Hinged::Close),
        _ => None,
    };
    for (node, by) in &edit.moved {
        let node_count = neutral.len();
        let index = node.parse::<usize>().ok().filter(|&n| n < node_count);
        let index = index.ok_or_else(|| EditError::NodeOutOfRange {
            name: name.to_owned(),
            node: node.clone(),
            node_count,
        })?;
        if !by.iter().all(|c| c.is_finite()) {
            return Err(EditError::OutOfRange {
                name: name.to_owned(),
                what: "a displacement",
                value: f64::NAN,
                condition: "finite",
            });
        }
        let by = crate::Vector::from(*by);
        let scaled = (by / transfer.alpha.max(1e-6)).cast::<f32>();
        transfer.shapes[place].deltas[index] += scaled;
        match (&mut transfer.jaw, hinged) {
            (Some(jaw), Some(Hinged::Open)) => jaw.open_residual[index] += scaled,
            (Some(jaw), Some(Hinged::Close)) => jaw.close_residual[index] += scaled,
            _ => {}
        }
        if let Some(lids) = &mut transfer.lids {
            // A lid's distance from the eye's centre goes its own way: it changes as moved.
            for lid in lids.nodes.iter_mut().filter(|n| n.node as usize == index) {
                let outwards = neutral[index] - eyes[lid.eye as usize].center;
                let change = by.dot(&outwards) / outwards.norm().max(1e-6);
                lid.radius_changes[place] += change as f32;
            }
        }
    }
    if let Some(strength) = edit.strength {
        let strength = in_range(name, "strength", strength, [0.0, 10.0], "from 0 to 10")?;
        scale(transfer, place, hinged, strength as f32);
    }
    if let Some(weight) = edit.weight {
        let weight = in_range(name, "weight", weight, [0.0, 1.0], "from 0 to 1")?;
        transfer.held.retain(|(held, _)| *held != shape);
        transfer.held.push((shape, weight as f32));
    }
    Ok(())
}

/// The shapes whose patches turn with the jaw instead of adding displacements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hinged {
    Open,
    Close,
}

fn scale(transfer: &mut PatchTransfer, place: usize, hinged: Option<Hinged>, strength: f32) {
    for delta in &mut transfer.shapes[place].deltas {
        *delta *= strength;
    }
    if let Some(lids) = &mut transfer.lids {
        for lid in &mut lids.nodes {
            lid.radius_changes[place] *= strength;
        }
    }
    let (Some(jaw), Some(hinged)) = (&mut transfer.jaw, hinged) else {
        return;
    };
    let (turn, residual) = match hinged {
        Hinged::Open => (&mut jaw.open, &mut jaw.open_residual),
        Hinged::Close => (&mut jaw.close, &mut jaw.close_residual),
    };
    turn.iter_mut().for_each(|share| *share *= strength);
    residual.iter_mut().for_each(|d| *d *= strength);
    jaw.pair.iter_mut().for_each(|d| *d *= strength);
}

fn edit_materials(rig: &mut Rig, edits: &Edits) -> Result<(), EditError> {
    if edits.materials.is_empty() {
        return Ok(());
    }
    let syntax = |message: String| EditError::Syntax { message };
    let mut table: toml::Table = rig
        .materials
        .parse()
        .map_err(|error: toml::de::Error| syntax(error.to_string()))?;
    for (name, edit) in &edits.materials {
        let MaterialEdit { like, numbers } = edit;
        let from = like.as_ref().unwrap_or(name);
        let Some(base) = table.get(from).and_then(toml::Value::as_table).cloned() else {
            let known = table.keys().map(String::as_str);
            return Err(EditError::UnknownName {
                what: "material",
                found: from.clone(),
                nearest: nearest_name(from, known).unwrap_or_default().to_owned(),
            });
        };
        let mut material = base;
        for (key, &value) in numbers {
            material.insert(key.clone(), toml::Value::Float(value));
        }
        table.insert(name.clone(), toml::Value::Table(material));
    }
    let text = toml::to_string(&table).map_err(|error| syntax(error.to_string()))?;
    Materials::parse(&text)?;
    rig.materials = text;
    Ok(())
}
