//! What contact did over a take, and what a recording shows of it.

use nalgebra::Point3;
use serde::Serialize;

use crate::Error;
use crate::collision::collider_mesh;
use crate::recording::{ContactArrow, LogEvent, LogLevel, SurfaceInfo};
use crate::scene::{FrameReport, Scene, Simulation};

const COLLIDER_COLOR: [u8; 4] = [120, 150, 190, 255];

/// What contact did over a take.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ContactSummary {
    /// Median count of pairs near enough to be looked at.
    pub candidates_median: usize,
    /// Median and largest count of pairs that pushed each other at the end of a frame.
    pub contacts_median: usize,
    /// See `contacts_median`.
    pub contacts_max: usize,
    /// Most bonds between lips.
    pub bonds_max: usize,
    /// Bonds that broke.
    pub broken_bonds: usize,
    /// Hardest that a bond pulled. (N)
    pub bond_force_max: f64,
    /// Steps that were cut short so that nothing crossed.
    pub held: usize,
    /// Pairs that could not be kept apart, caught between colliders.
    pub pinched: usize,
    /// Nodes inside a collider at the start.
    pub started_inside: usize,
    /// How deep the deepest of them was. (mm)
    pub started_depth: f64,
    /// Deepest that skin stood in lips, eyeballs or colliders as the patches left it. (mm)
    pub skin_depth_before: f64,
    /// The same in the skin that was recorded. (mm)
    pub skin_depth: f64,
    /// For each collider its name and the largest force of the face on it.
    pub forces: Vec<ColliderForce>,
}

/// The largest force on a collider over a take.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ColliderForce {
    /// The collider's name.
    pub name: String,
    /// Force at the end of a frame, of a face whose patches weigh the cloth's areal density.
    /// (N)
    pub newtons: f64,
}

/// Contact of a take while it is recorded.
pub(super) struct ContactLog {
    summary: ContactSummary,
    candidates: Vec<usize>,
    contacts: Vec<usize>,
    /// Vertices of each collider about its origin. (mm)
    meshes: Vec<Vec<crate::Point>>,
    /// The same where they are now. [mm, head frame]
    pub(super) placed: Vec<Vec<Point3<f32>>>,
    pub(super) arrows: Vec<ContactArrow>,
    has_said_start: bool,
}

/// Colliders as a recording draws them.
///
/// # Errors
///
/// [`crate::collision::CollisionError`] for a collider that cannot be.
pub(super) fn collider_surfaces(scene: &Scene) -> Result<Vec<SurfaceInfo>, Error> {
    let colliders = scene.colliders.iter().enumerate();
    let surface = |(index, collider)| -> Result<SurfaceInfo, Error> {
        let collider: &crate::collision::Collider = collider;
        let (vertices, triangles) =
            collider_mesh(collider, index).map_err(crate::scene::SceneError::from)?;
        Ok(SurfaceInfo {
            name: collider.name.clone(),
            color: COLLIDER_COLOR,
            vertex_count: vertices.len(),
            triangles,
            vertex_colors: Vec::new(),
        })
    };
    colliders.map(surface).collect()
}

/// Names of the statistics that contact adds.
pub(super) fn stat_names(scene: &Scene) -> Vec<String> {
    let counts = [
        "contacts",
        "contact_candidates",
        "lip_bonds",
        "skin_depth_mm",
    ];
    let forces = scene.colliders.iter();
    let forces = forces.map(|collider| format!("{}_newton", collider.name));
    counts
        .map(str::to_owned)
        .into_iter()
        .chain(forces)
        .collect()
}

impl ContactLog {
    /// None where the simulation has no contact.
    pub(super) fn new(simulation: &Simulation) -> Option<Self> {
        simulation.contact_report()?;
        let colliders = &simulation.scene().colliders;
        // Checked when the simulation was made.
        let mesh = |(index, collider)| collider_mesh(collider, index).unwrap_or_default().0;
        let meshes: Vec<_> = colliders.iter().enumerate().map(mesh).collect();
        let forces = colliders.iter().map(|collider| ColliderForce {
            name: collider.name.clone(),
            newtons: 0.0,
        });
        Some(Self {
            summary: ContactSummary {
                forces: forces.collect(),
                ..ContactSummary::default()
            },
            candidates: Vec::new(),
            contacts: Vec::new(),
            placed: vec![Vec::new(); meshes.len()],
            meshes,
            arrows: Vec::new(),
            has_said_start: false,
        })
    }

    /// Takes what the last frame did. Returns the statistics of [`stat_names`].
    pub(super) fn take(&mut self, simulation: &Simulation, frame: &FrameReport) -> Vec<f64> {
        let Some(report) = simulation.contact_report() else {
            return Vec::new();
        };
        let poses = simulation.collider_poses();
        for ((placed, mesh), pose) in self.placed.iter_mut().zip(&self.meshes).zip(poses) {
            placed.clear();
            placed.extend(mesh.iter().map(|p| (pose * p).cast::<f32>()));
        }
        self.arrows.clear();
        let points = simulation.contact_points().iter();
        self.arrows.extend(points.map(|point| ContactArrow {
            position: point.position,
            normal: point.normal.cast(),
            force: point.force as f32,
            is_of_collider: point.collider.is_some(),
        }));
        self.candidates.push(report.candidates);
        self.contacts.push(report.contacts);
        let s = &mut self.summary;
        s.contacts_max = s.contacts_max.max(report.contacts);
        s.bonds_max = s.bonds_max.max(report.bonds);
        s.bond_force_max = s.bond_force_max.max(report.bond_force);
        s.broken_bonds += report.broken_bonds;
        s.held += report.held;
        s.pinched += report.pinched;
        s.started_inside = report.started_inside;
        s.started_depth = report.started_depth;
        let skin = &frame.skin_contact;
        s.skin_depth_before = s.skin_depth_before.max(skin.deepest_before);
        s.skin_depth = s.skin_depth.max(skin.deepest_after);
        for (largest, force) in s.forces.iter_mut().zip(&report.forces) {
            largest.newtons = largest.newtons.max(force.norm());
        }
        let mut stats = vec![
            report.contacts as f64,
            report.candidates as f64,
            report.bonds as f64,
            skin.deepest_after,
        ];
        stats.extend(report.forces.iter().map(|force| force.norm()));
        stats
    }

    /// What is to be said of the last frame: once, that the take began inside a collider.
    pub(super) fn event(&mut self) -> Option<LogEvent> {
        let s = &self.summary;
        if std::mem::replace(&mut self.has_said_start, true) || s.started_inside == 0 {
            return None;
        }
        Some(LogEvent {
            level: LogLevel::Warning,
            message: format!(
                "{} nodes started inside a collider, the deepest {:.2} mm; they were let out",
                s.started_inside, s.started_depth
            ),
        })
    }

    /// What contact did over the take.
    pub(super) fn finish(mut self) -> ContactSummary {
        let median = |counts: &mut Vec<usize>| {
            counts.sort_unstable();
            counts.get(counts.len() / 2).copied().unwrap_or(0)
        };
        self.summary.candidates_median = median(&mut self.candidates);
        self.summary.contacts_median = median(&mut self.contacts);
        self.summary
    }
}
