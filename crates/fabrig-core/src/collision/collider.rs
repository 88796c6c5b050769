//! Things of the world that a face can touch, as plain data.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::CollisionError;
use crate::{Point, Vector};

/// A shape about its own origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum ColliderShape {
    /// A ball.
    Ball {
        /// Radius. (mm)
        radius: f64,
    },
    /// A finger: a rounded rod along its own y axis.
    Capsule {
        /// Half the length of the straight part. (mm)
        half_length: f64,
        /// Radius. (mm)
        radius: f64,
    },
    /// A box.
    Cuboid {
        /// Half the size along its own axes. (mm)
        half_extents: Vector3<f64>,
    },
    /// The convex hull of points.
    ConvexHull {
        /// The points. (mm)
        points: Vec<Point>,
    },
    /// A closed surface, counter-clockwise seen from outside.
    TriangleMesh {
        /// Vertices. (mm)
        vertices: Vec<Point>,
        /// Indices into them.
        triangles: Vec<[u32; 3]>,
    },
    /// Everything below the plane through the origin whose normal is its own +y.
    Plane {},
}

/// What a collider's poses are given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColliderFrame {
    /// The world: the head moves away from it.
    #[default]
    World,
    /// The head: it moves with the skull.
    Head,
}

/// Where a collider is at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColliderKey {
    /// Time on the take's axis. (s)
    pub time: f64,
    /// Position of its origin. (mm)
    pub position: Vector3<f64>,
    /// Turn about an axis through its origin: the axis times the angle. (rad)
    #[serde(default = "Vector3::zeros")]
    pub rotation: Vector3<f64>,
}

impl ColliderKey {
    fn pose(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.position),
            UnitQuaternion::from_scaled_axis(self.rotation),
        )
    }
}

/// A rigid thing that moves as it is told and pushes the face; nothing pushes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Its name, one of its kind in a scene.
    pub name: String,
    /// Its shape.
    pub shape: ColliderShape,
    /// What its poses are given in.
    #[serde(default)]
    pub frame: ColliderFrame,
    /// Coulomb's friction coefficient.
    #[serde(default = "default_friction")]
    pub friction: f64,
    /// Where it is when, rising in time: straight from key to key, and still before the first
    /// and after the last. Code may set poses instead.
    pub keys: Vec<ColliderKey>,
}

fn default_friction() -> f64 {
    0.4
}

impl Collider {
    /// A collider that stands still until code moves it.
    pub fn at(name: &str, shape: ColliderShape, position: Vector) -> Self {
        Self {
            name: name.to_owned(),
            shape,
            frame: ColliderFrame::World,
            friction: default_friction(),
            keys: vec![ColliderKey {
                time: 0.0,
                position,
                rotation: Vector3::zeros(),
            }],
        }
    }

    /// Its pose in its frame at a time. (s)
    pub fn pose_at(&self, time: f64) -> Isometry3<f64> {
        let after = self.keys.partition_point(|k| k.time <= time);
        match (
            after.checked_sub(1).map(|i| &self.keys[i]),
            self.keys.get(after),
        ) {
            (Some(a), Some(b)) => {
                let s = (time - a.time) / (b.time - a.time);
                between(&a.pose(), &b.pose(), s)
            }
            (Some(key), None) | (None, Some(key)) => key.pose(),
            (None, None) => Isometry3::identity(),
        }
    }

    /// Checks everything that a text could have wrong.
    ///
    /// # Errors
    ///
    /// [`CollisionError::Collider`] with the collider and what is wrong.
    pub fn check(&self, index: usize) -> Result<(), CollisionError> {
        let refuse = |reason: String| {
            Err(CollisionError::Collider {
                index,
                name: self.name.clone(),
                reason,
            })
        };
        let is_size = |x: f64| x.is_finite() && x > 0.0 && x < 1e5;
        let is_near = |p: &Vector| p.iter().all(|c| c.is_finite() && c.abs() < 1e6);
        let sizes: Vec<f64> = match &self.shape {
            ColliderShape::Ball { radius } => vec![*radius],
            ColliderShape::Capsule {
                half_length,
                radius,
            } => vec![*half_length, *radius],
            ColliderShape::Cuboid { half_extents } => half_extents.iter().copied().collect(),
            ColliderShape::ConvexHull { points } => {
                if !points.iter().all(|p| is_near(&p.coords)) {
                    return refuse("a point of the hull is not a finite number".to_owned());
                }
                Vec::new()
            }
            ColliderShape::TriangleMesh {
                vertices,
                triangles,
            } => {
                if !vertices.iter().all(|p| is_near(&p.coords)) {
                    return refuse("a vertex is not a finite number".to_owned());
                }
                let count = vertices.len();
                if let Some(v) = triangles.iter().flatten().find(|&&v| v as usize >= count) {
                    return refuse(format!("a triangle references vertex {v} of {count}"));
                }
                Vec::new()
            }
            ColliderShape::Plane {} => Vec::new(),
        };
        if let Some(bad) = sizes.iter().find(|&&s| !is_size(s)) {
            return refuse(format!(
                "sizes must be positive, finite and under 100 m, got {bad}"
            ));
        }
        if !(0.0..=10.0).contains(&self.friction) {
            return refuse(format!(
                "friction must be from 0 to 10, got {}",
                self.friction
            ));
        }
        if self.keys.is_empty() {
            return refuse("it needs at least one key to stand somewhere".to_owned());
        }
        for (k, key) in self.keys.iter().enumerate() {
            if !(key.time.is_finite() && is_near(&key.position) && is_near(&key.rotation)) {
                return refuse(format!(
                    "key {k} has a number that is not finite or too large"
                ));
            }
            if k > 0 && key.time <= self.keys[k - 1].time {
                return refuse(format!(
                    "the time of key {k} does not come after the one before"
                ));
            }
        }
        Ok(())
    }
}

/// Reads a text of `[[colliders]]` tables (TOML) and checks each.
///
/// # Errors
///
/// [`CollisionError::Text`] with line and column, [`CollisionError::Collider`].
pub fn read_colliders(text: &str) -> Result<Vec<Collider>, CollisionError> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Text {
        colliders: Vec<Collider>,
    }
    let text: Text = toml::from_str(text).map_err(|e| CollisionError::Text {
        reason: e.to_string(),
    })?;
    for (index, collider) in text.colliders.iter().enumerate() {
        collider.check(index)?;
    }
    Ok(text.colliders)
}

/// The pose at `s` from 0 to 1 on the way from `a` to `b`.
pub(crate) fn between(a: &Isometry3<f64>, b: &Isometry3<f64>, s: f64) -> Isometry3<f64> {
    let turn = (b.rotation * a.rotation.inverse()).scaled_axis() * s;
    let shift = a.translation.vector.lerp(&b.translation.vector, s);
    Isometry3::from_parts(
        Translation3::from(shift),
        UnitQuaternion::from_scaled_axis(turn) * a.rotation,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_joined_straight_and_held_at_the_ends() {
        let mut c = Collider::at("ball", ColliderShape::Ball { radius: 5.0 }, Vector::zeros());
        c.keys.push(ColliderKey {
            time: 2.0,
            position: Vector::new(4.0, 0.0, 0.0),
            rotation: Vector::new(0.0, 0.6, 0.0),
        });
        assert!(c.check(0).is_ok());
        let middle = c.pose_at(1.0);
        assert!((middle.translation.vector.x - 2.0).abs() < 1e-12);
        assert!((middle.rotation.angle() - 0.3).abs() < 1e-12);
        assert_eq!(c.pose_at(-1.0), c.keys[0].pose());
        assert_eq!(c.pose_at(9.0), c.keys[1].pose());
    }

    #[test]
    fn colliders_are_read_from_text() {
        let text = "[[colliders]]\nname = \"finger\"\n\
                    shape = { type = \"capsule\", half_length = 20.0, radius = 7.0 }\n\
                    keys = [{ time = 0.0, position = [60.0, -20.0, 90.0] }]\n";
        let read = read_colliders(text).unwrap_or_default();
        assert_eq!(read.len(), 1);
        assert_eq!(read[0].frame, ColliderFrame::World);
        assert!(read_colliders("[[colliders]]\nname = 3").is_err());
    }

    #[test]
    fn bad_colliders_are_refused_with_their_index() {
        let good = Collider::at("ball", ColliderShape::Ball { radius: 5.0 }, Vector::zeros());
        let mut cases = vec![good.clone(); 4];
        cases[0].shape = ColliderShape::Ball { radius: -1.0 };
        cases[1].friction = f64::NAN;
        cases[2].keys.clear();
        let same = cases[3].keys[0];
        cases[3].keys.push(same);
        for bad in cases {
            let text = bad
                .check(3)
                .map_or_else(|e| e.to_string(), |()| String::new());
            assert!(text.starts_with("collider 3 (`ball`)"), "{text}");
        }
    }
}
