//! The cloth as a network of oscillators: every mass, spring and damper of small motion about
//! rest, for telling how a cloth must hang and ring.
//!
//! It shares the materials' meaning with the solver and nothing of its method: forces are
//! linear in displacement and velocity, statics is one system of equations, and motion goes by
//! explicit steps far below the shortest period, in double precision.
//!
//! # Limitations
//!
//! Small displacements: edges do not turn, folds do not deepen. Targets and anchors stand still.
//!
//! # Source
//!
//! Van der Vorst 1992, *Bi-CGSTAB*, for the statics, as pressure pushes pads and not what lies
//! under them; central differences with velocities at half steps for the motion.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::assembly::{floor_under, pair_stiffness};
use super::constraints::grid_lists::GridLists;
use super::error::ClothError;
use super::input::{ClothAttachment, ClothPatch, NodeVariation};
use super::validate;

/// Displacements (mm) or velocities (mm/s) of the nodes of every patch.
pub type NodeVectors = Vec<Vec<Vector3<f64>>>;

/// A step is this part of what explicit steps can bear.
const STEP_SHARE: f64 = 0.3;
/// Statics is solved to this part of the load.
const RESIDUAL: f64 = 1e-8;
const MOST_ITERATIONS: usize = 2_000;

/// A spring along a line between two nodes.
#[derive(Debug, Clone, Copy)]
struct Spring {
    nodes: [u32; 2],
    /// From the second to the first, of length 1.
    along: Vector3<f64>,
    /// [mass/s^2]
    stiffness: f64,
    /// [mass/s]
    damping: f64,
}

/// What resists bending at three nodes in a row.
#[derive(Debug, Clone, Copy)]
struct Hinge {
    nodes: [u32; 3],
    /// [mass/s^2]
    stiffness: f64,
}

/// The volume of a pad.
#[derive(Debug, Clone)]
struct Volume {
    /// [mass/(s^2 mm^4)]
    stiffness: f64,
    /// By the pad's nodes. [mm^2]
    gradient: Vec<Vector3<f64>>,
    /// By the nodes of its floor: patch, node, gradient. [mm^2]
    floor: Vec<(usize, u32, Vector3<f64>)>,
}

#[derive(Debug, Clone)]
struct LinearPatch {
    mass: f64,
    /// Of every node: magnet and anchors. [mass/s^2]
    held: Vec<f64>,
    /// [mass/s]
    damping: f64,
    springs: Vec<Spring>,
    hinges: Vec<Hinge>,
    volume: Option<Volume>,
}

/// A stitch of two nodes.
#[derive(Debug, Clone, Copy)]
struct Stitch {
    ends: [(usize, u32); 2],
    /// [mass/s^2]
    stiffness: f64,
}

/// A cloth that moves little.
#[derive(Debug, Clone)]
pub struct LinearCloth {
    patches: Vec<LinearPatch>,
    stitches: Vec<Stitch>,
}

impl LinearCloth {
    /// The network of a cloth at rest.
    ///
    /// # Errors
    ///
    /// As [`super::Cloth::new`].
    pub fn new(patches: &[ClothPatch]) -> Result<Self, ClothError> {
        validate::patches(patches)?;
        let mut stitches = Vec::new();
        for (a, patch) in patches.iter().enumerate() {
            for attachment in &patch.attachments {
                let ClothAttachment::Patch {
                    patch: b,
                    pairs,
                    strength,
                } = attachment
                else {
                    continue;
                };
                let b = *b as usize;
                let stiffness = pair_stiffness(patches, [a, b], *strength);
                stitches.extend(pairs.iter().map(|&(node, other)| Stitch {
                    ends: [(a, node), (b, other)],
                    stiffness,
                }));
            }
        }
        Ok(Self {
            patches: patches
                .iter()
                .map(|patch| LinearPatch::new(patches, patch))
                .collect(),
            stitches,
        })
    }

    /// How far every node hangs under an even acceleration, at rest.
    ///
    /// - `acceleration`: (mm/s^2)
    ///
    /// Returns `None` where nothing holds the cloth.
    pub fn hang(&self, acceleration: Vector3<f64>) -> Option<NodeVectors> {
        let load = self.each(|patch, out| out.fill(acceleration * patch.mass));
        let pull = |x: &NodeVectors| {
            let mut force = self.still();
            self.forces(x, None, &mut force);
            map(&force, |f| -f)
        };
        // Jacobi's preconditioner takes out what masses and magnets differ by.
        let weights = self.stiffness_bounds();
        let scaled = |r: &NodeVectors| -> NodeVectors {
            let rows = r.iter().zip(&weights);
            rows.map(|(r, w)| r.iter().zip(w).map(|(r, w)| r / *w).collect())
                .collect()
        };
        let mut x = self.still();
        let mut residual = load.clone();
        let shadow = load.clone();
        let goal = RESIDUAL * dot(&load, &load).sqrt();
        let mut direction = residual.clone();
        let mut rho = dot(&shadow, &residual);
        for _ in 0..MOST_ITERATIONS {
            let toward = scaled(&direction);
            let pulled = pull(&toward);
            let alpha = rho / dot(&shadow, &pulled);
            let half = sum(&residual, -alpha, &pulled);
            let onward = scaled(&half);
            let pulled_on = pull(&onward);
            let omega = dot(&pulled_on, &half) / dot(&pulled_on, &pulled_on).max(f64::MIN_POSITIVE);
            x = sum(&sum(&x, alpha, &toward), omega, &onward);
            residual = sum(&half, -omega, &pulled_on);
            if !(rho.is_finite() && alpha.is_finite()) {
                return None;
            }
            if dot(&residual, &residual).sqrt() <= goal {
                return Some(x);
            }
            let next = dot(&shadow, &residual);
            let beta = next / rho * alpha / omega;
            rho = next;
            direction = sum(&residual, beta, &sum(&direction, -omega, &pulled));
        }
        None
    }

    /// Lets the cloth go at rest in `start`, and shows it every `dt` seconds, `count` times.
    pub fn release(
        &self,
        start: &NodeVectors,
        dt: f64,
        count: u32,
        mut watch: impl FnMut(&NodeVectors),
    ) {
        let longest = self.longest_step();
        let steps = (dt / longest).ceil().max(1.0);
        let h = dt / steps;
        let mut x = start.clone();
        let mut v = self.still();
        let mut force = self.still();
        for _ in 0..count {
            for _ in 0..steps as u64 {
                self.forces(&x, Some(&v), &mut force);
                for (patch, ((x, v), force)) in self
                    .patches
                    .iter()
                    .zip(x.iter_mut().zip(&mut v).zip(&force))
                {
                    for ((x, v), force) in x.iter_mut().zip(v).zip(force) {
                        // Damping of the node itself is taken at the end of the step.
                        let kick = *v + force * (h / patch.mass);
                        *v = kick / (1.0 + h * patch.damping / patch.mass);
                        *x += *v * h;
                    }
                }
            }
            watch(&x);
        }
    }

    fn still(&self) -> NodeVectors {
        self.each(|_, out| out.fill(Vector3::zeros()))
    }

    fn each(&self, fill: impl Fn(&LinearPatch, &mut [Vector3<f64>])) -> NodeVectors {
        let patches = self.patches.iter();
        patches
            .map(|patch| {
                let mut nodes = vec![Vector3::zeros(); patch.held.len()];
                fill(patch, &mut nodes);
                nodes
            })
            .collect()
    }

    /// Forces on every node, but for the damping of nodes. [mass mm/s^2]
    ///
    /// - `x` (mm), `v`: (mm/s), or none for springs alone
    fn forces(&self, x: &NodeVectors, v: Option<&NodeVectors>, out: &mut NodeVectors) {
        out.par_iter_mut()
            .zip(&self.patches)
            .enumerate()
            .for_each(|(index, (out, patch))| {
                patch.forces(index, x, v.map(|v| v[index].as_slice()), out);
            });
        for stitch in &self.stitches {
            let [(a, i), (b, j)] = stitch.ends.map(|(patch, node)| (patch, node as usize));
            let pull = (x[b][j] - x[a][i]) * stitch.stiffness;
            out[a][i] += pull;
            out[b][j] -= pull;
        }
    }

    /// No less than the stiffness of each node against the others standing still. [mass/s^2]
    fn stiffness_bounds(&self) -> Vec<Vec<f64>> {
        let mut bounds: Vec<Vec<f64>> = self.patches.iter().map(LinearPatch::bounds).collect();
        for stitch in &self.stitches {
            for (patch, node) in stitch.ends {
                bounds[patch][node as usize] += stitch.stiffness;
            }
        }
        bounds
    }

    /// The longest explicit step, by Gershgorin's circles. (s)
    fn longest_step(&self) -> f64 {
        let rows = self.stiffness_bounds().into_iter().zip(&self.patches);
        let fastest = rows
            .map(|(bounds, patch)| {
                // Off the diagonal a row sums to no more than on it; a bend's to thrice it.
                let most = bounds.iter().fold(0.0, |most: f64, b| most.max(*b));
                let drag: f64 = patch
                    .springs
                    .iter()
                    .map(|s| s.damping / s.stiffness.max(1e-12))
                    .fold(0.0, f64::max);
                let rate = (2.0 * most / patch.mass).sqrt();
                rate.max(0.5 * drag * rate * rate)
            })
            .fold(1.0, f64::max);
        STEP_SHARE * 2.0 / fastest
    }
}

impl LinearPatch {
    fn new(all: &[ClothPatch], patch: &ClothPatch) -> Self {
        let material = &patch.material;
        let lists = GridLists::new(patch.shape);
        let place = |i: u32| patch.rest[i as usize].coords.cast::<f64>();
        let mean = |nodes: &[u32], factor: fn(&NodeVariation) -> f32| -> f64 {
            if patch.variations.is_empty() {
                return 1.0;
            }
            let factors = nodes
                .iter()
                .map(|&i| f64::from(factor(&patch.variations[i as usize])));
            factors.sum::<f64>() / nodes.len() as f64
        };
        let mut held = vec![material.magnet_stiffness(); patch.rest.len()];
        for (nodes, strength) in patch.anchor_sets() {
            for &node in nodes {
                held[node as usize] += strength * material.stretch_stiffness();
            }
        }
        let stretch = 0.5 * (material.stretch_stiffness() + material.compression_stiffness());
        let spring = |nodes: [u32; 2], stiffness: f64, damping_time: f64| {
            let stiffness = stiffness * mean(&nodes, |v| v.stretch);
            let along = place(nodes[0]) - place(nodes[1]);
            Spring {
                nodes,
                along: along.try_normalize(f64::MIN_POSITIVE).unwrap_or_default(),
                stiffness,
                damping: stiffness * damping_time,
            }
        };
        let edges = lists.edges.iter();
        let edges = edges.map(|&e| spring(e, stretch, material.stretch_damping_time()));
        let diagonals = lists.diagonals.iter();
        let diagonals = diagonals.map(|&d| spring(d, material.shear_stiffness(), 0.0));
        let bend = material.bend_stiffness() * (1.0 - material.bend_angle_dropoff);
        Self {
            mass: material.mass,
            damping: material.mass * (material.damping + material.magnet_damping()),
            springs: edges.chain(diagonals).collect(),
            hinges: lists
                .triples
                .iter()
                .map(|&nodes| Hinge {
                    nodes,
                    stiffness: bend * mean(&nodes, |v| v.bend),
                })
                .collect(),
            volume: (material.pressure > 0.0).then(|| Volume::new(all, patch, &lists.cells)),
            held,
        }
    }

    /// Forces on the nodes of the patch; pads look at their floors in `x`.
    fn forces(
        &self,
        index: usize,
        x: &NodeVectors,
        v: Option<&[Vector3<f64>]>,
        out: &mut [Vector3<f64>],
    ) {
        let own = &x[index];
        for ((out, u), held) in out.iter_mut().zip(own).zip(&self.held) {
            *out = u * -*held;
        }
        for spring in &self.springs {
            let [i, j] = spring.nodes.map(|n| n as usize);
            let mut pull = spring.stiffness * spring.along.dot(&(own[j] - own[i]));
            if let Some(v) = v {
                pull += spring.damping * spring.along.dot(&(v[j] - v[i]));
            }
            let pull = spring.along * pull;
            out[i] += pull;
            out[j] -= pull;
        }
        for hinge in &self.hinges {
            let [i, j, k] = hinge.nodes.map(|n| n as usize);
            let pull = (own[j] * 2.0 - own[i] - own[k]) * hinge.stiffness;
            out[i] += pull;
            out[j] -= pull * 2.0;
            out[k] += pull;
        }
        if let Some(volume) = &self.volume {
            let gained: f64 = volume.gradient.iter().zip(own).map(|(g, u)| g.dot(u)).sum();
            let under = volume.floor.iter();
            let under: f64 = under.map(|&(p, node, g)| g.dot(&x[p][node as usize])).sum();
            let push = -volume.stiffness * (gained + under);
            for (out, g) in out.iter_mut().zip(&volume.gradient) {
                *out += g * push;
            }
        }
    }

    fn bounds(&self) -> Vec<f64> {
        let mut bounds = self.held.clone();
        for spring in &self.springs {
            for node in spring.nodes {
                bounds[node as usize] += spring.stiffness;
            }
        }
        for hinge in &self.hinges {
            for (node, share) in hinge.nodes.into_iter().zip([2.0, 8.0, 2.0]) {
                bounds[node as usize] += share * hinge.stiffness;
            }
        }
        if let Some(volume) = &self.volume {
            let whole: f64 = volume.gradient.iter().map(|g| g.norm()).sum();
            let under: f64 = volume.floor.iter().map(|(_, _, g)| g.norm()).sum();
            for (bound, g) in bounds.iter_mut().zip(&volume.gradient) {
                *bound += 0.5 * volume.stiffness * g.norm() * (whole + under);
            }
        }
        bounds
    }
}

impl Volume {
    fn new(all: &[ClothPatch], pad: &ClothPatch, cells: &[[u32; 4]]) -> Self {
        let place = |i: u32| pad.rest[i as usize].coords.cast::<f64>();
        let mut heights = vec![Vector3::zeros(); pad.rest.len()];
        let floor = floor_under(pad);
        for under in &floor {
            let below = all[under.patch].rest[under.patch_node as usize];
            heights[under.node as usize] = place(under.over) - below.coords.cast::<f64>();
        }
        // By its nodes, `lift + turn`; by the floor's, `turn - lift`.
        let mut lifts = vec![Vector3::zeros(); pad.rest.len()];
        let mut turns = lifts.clone();
        for &[a, b, c, d] in cells {
            let middle = |i: u32| place(i) - heights[i as usize] * 0.5;
            let (first, second) = (middle(c) - middle(a), middle(d) - middle(b));
            let height = [a, b, c, d]
                .map(|i| heights[i as usize])
                .iter()
                .sum::<Vector3<f64>>()
                / 4.0;
            let lift = first.cross(&second) / 8.0;
            let (of_first, of_second) = (second.cross(&height) / 4.0, height.cross(&first) / 4.0);
            for (node, turn) in [
                (a, -of_first),
                (b, -of_second),
                (c, of_first),
                (d, of_second),
            ] {
                lifts[node as usize] += lift;
                turns[node as usize] += turn;
            }
        }
        let pairs = || lifts.iter().zip(&turns);
        Self {
            stiffness: pad.material.pressure_stiffness(pad.rest.len(), pad.area()),
            gradient: pairs().map(|(lift, turn)| lift + turn).collect(),
            floor: floor
                .iter()
                .map(|under| {
                    let (lift, turn) = (lifts[under.node as usize], turns[under.node as usize]);
                    (under.patch, under.patch_node, turn - lift)
                })
                .collect(),
        }
    }
}

fn map(a: &NodeVectors, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> NodeVectors {
    a.iter().map(|a| a.iter().map(&f).collect()).collect()
}

/// `a + s b`.
fn sum(a: &NodeVectors, s: f64, b: &NodeVectors) -> NodeVectors {
    let rows = a.iter().zip(b);
    rows.map(|(a, b)| a.iter().zip(b).map(|(a, b)| a + b * s).collect())
        .collect()
}

fn dot(a: &NodeVectors, b: &NodeVectors) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth::{GridShape, Material};
    use nalgebra::Point3;
    use std::f64::consts::TAU;

    fn sheet(count: u32, material: Material) -> ClothPatch {
        let shape = GridShape {
            u_count: count,
            v_count: count,
            is_periodic: false,
        };
        let rest = (0..count * count)
            .map(|i| Point3::new((i % count) as f32 * 2.0, (i / count) as f32 * 2.0, 0.0))
            .collect();
        ClothPatch {
            shape,
            rest,
            material,
            attachments: vec![],
            variations: vec![],
        }
    }

    #[test]
    fn a_sheet_on_magnets_hangs_and_swings_as_one_node_does() {
        let material = Material {
            pressure: 0.0,
            ..Material::FAT
        };
        let cloth = LinearCloth::new(&[sheet(6, material)]).unwrap();
        let load = Vector3::new(300.0, 0.0, -9000.0);
        let hung = cloth.hang(load).unwrap();
        let rate = (material.magnet_stiffness() / material.mass).sqrt();
        for u in &hung[0] {
            assert!((u - load / (rate * rate)).norm() < 1e-6, "{u}");
        }
        let damping = 0.5 * (material.damping + material.magnet_damping());
        let damped = (rate * rate - damping * damping).sqrt();
        let mut time = 0.0;
        cloth.release(&hung, 1.0 / 240.0, 120, |x| {
            time += 1.0 / 240.0;
            let swing = (damped * time).cos() + damping / damped * (damped * time).sin();
            let expected = hung[0][0].z * (-damping * time).exp() * swing;
            let off = (x[0][7].z - expected) / hung[0][0].z;
            assert!(off.abs() < 0.02, "{time} s: {off}");
        });
    }

    #[test]
    fn stitched_nodes_hang_between_their_magnets() {
        let soft = Material {
            magnet_frequency_hz: 4.0,
            ..Material::LINEAR_MUSCLE
        };
        let mut above = sheet(1, soft);
        above.attachments.push(ClothAttachment::Patch {
            patch: 1,
            pairs: vec![(0, 0)],
            strength: 0.3,
        });
        let below = sheet(1, Material::LINEAR_MUSCLE);
        let stitch = 0.3 * soft.stretch_stiffness();
        let cloth = LinearCloth::new(&[above, below]).unwrap();
        let hung = cloth.hang(Vector3::new(0.0, 1000.0, 0.0)).unwrap();
        let [a, b] = [4.0, 12.0].map(|hz: f64| (TAU * hz).powi(2));
        let (x, y) = (hung[0][0].y, hung[1][0].y);
        assert!((a * x + stitch * (x - y) - 1000.0).abs() < 1e-3);
        assert!((b * y + stitch * (y - x) - 1000.0).abs() < 1e-3);
        let loose = Material {
            magnet_frequency_hz: 0.0,
            ..soft
        };
        let free = LinearCloth::new(&[sheet(3, loose)]).unwrap();
        assert_eq!(free.hang(Vector3::new(0.0, 1.0, 0.0)), None);
    }

    #[test]
    fn a_pad_keeps_its_volume_over_what_it_lies_on() {
        let mut pad = sheet(8, Material::FAT);
        for p in &mut pad.rest {
            p.z = 3.0;
        }
        pad.attachments.push(ClothAttachment::Patch {
            patch: 1,
            pairs: (0..64).map(|i| (i, i)).collect(),
            strength: 0.01,
        });
        let ground = sheet(8, Material::LINEAR_MUSCLE);
        let apart = |pad: &ClothPatch| {
            let cloth = LinearCloth::new(&[pad.clone(), ground.clone()]).unwrap();
            let hung = cloth.hang(Vector3::new(0.0, 0.0, 9810.0)).unwrap();
            let mean = |p: usize| hung[p].iter().map(|u| u.z).sum::<f64>() / 64.0;
            mean(0) - mean(1)
        };
        let held = apart(&pad);
        pad.material.pressure = 0.0;
        let free = apart(&pad);
        // Nodes at the rim bear less of the volume and hang further than those inside.
        assert!(free > 2.0 && held.abs() < 0.2 * free, "{free} {held}");
    }
}
