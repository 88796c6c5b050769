//! Where the eye is: named views, framing, and the ray of every pixel.

use std::str::FromStr;

use super::RenderError;
use crate::{Point, Vector};

/// A direction to look from. Angles turn about the subject's centre: yaw towards the
/// character's left (+X), pitch upwards.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum View {
    /// Straight on, from +Z.
    #[default]
    Front,
    /// From 38 degrees to the character's left.
    ThreeQuarter,
    /// From 38 degrees to the character's right.
    ThreeQuarterRight,
    /// The profile seen from the character's left, +X.
    Side,
    /// The profile seen from the character's right, -X.
    SideRight,
    /// From behind.
    Back,
    /// From above.
    Top,
    /// From below the chin.
    Below,
    /// Any other. (degrees)
    Angles {
        /// Turn towards the character's left.
        yaw: f64,
        /// Turn upwards.
        pitch: f64,
    },
}

impl View {
    /// (yaw, pitch). (rad)
    fn angles(self) -> (f64, f64) {
        let (yaw, pitch) = match self {
            Self::Front => (0.0, 0.0),
            Self::ThreeQuarter => (38.0, 3.0),
            Self::ThreeQuarterRight => (-38.0, 3.0),
            Self::Side => (90.0, 0.0),
            Self::SideRight => (-90.0, 0.0),
            Self::Back => (180.0, 0.0),
            Self::Top => (0.0, 89.0),
            Self::Below => (0.0, -50.0),
            Self::Angles { yaw, pitch } => (yaw, pitch.clamp(-89.0, 89.0)),
        };
        (yaw.to_radians(), pitch.to_radians())
    }

    /// Unit vector from the subject towards the eye.
    pub fn direction(self) -> Vector {
        let (yaw, pitch) = self.angles();
        Vector::new(
            yaw.sin() * pitch.cos(),
            pitch.sin(),
            yaw.cos() * pitch.cos(),
        )
    }
}

impl FromStr for View {
    type Err = RenderError;

    /// The variants in snake case (`-` serves as `_`), or `YAW,PITCH` in degrees.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let unknown = || RenderError::UnknownView {
            name: text.to_owned(),
        };
        Ok(
            match text.trim().to_lowercase().replace('-', "_").as_str() {
                "front" => Self::Front,
                "three_quarter" | "34" => Self::ThreeQuarter,
                "three_quarter_right" => Self::ThreeQuarterRight,
                "side" => Self::Side,
                "side_right" => Self::SideRight,
                "back" => Self::Back,
                "top" => Self::Top,
                "below" => Self::Below,
                _ => {
                    let (yaw, pitch) = text.split_once(',').ok_or_else(unknown)?;
                    let number = |t: &str| match t.trim().parse::<f64>() {
                        Ok(value) if value.is_finite() => Ok(value),
                        _ => Err(unknown()),
                    };
                    Self::Angles {
                        yaw: number(yaw)?,
                        pitch: number(pitch)?,
                    }
                }
            },
        )
    }
}

/// How depth shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Parallel rays; the number is the height of the picture in world units.
    Orthographic(f64),
    /// Rays through one point; the number is the vertical field of view. (rad)
    Perspective(f64),
}

/// The field of view of a portrait lens. (rad)
const PORTRAIT_FIELD: f64 = 0.33;

/// A placed camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where the eye is (for parallel rays: any point of the plane they start from).
    pub eye: Point,
    /// Unit vector of looking.
    pub forward: Vector,
    /// Unit vector to the right of the picture.
    pub right: Vector,
    /// Unit vector up the picture.
    pub up: Vector,
    /// Perspective or parallel.
    pub projection: Projection,
}

impl Camera {
    /// Looks from `eye` at `target`; `up` only needs to differ from the line of sight.
    pub fn look_at(eye: Point, target: Point, up: Vector, projection: Projection) -> Self {
        let forward = (target - eye)
            .try_normalize(0.0)
            .unwrap_or_else(|| -Vector::z());
        let right = forward
            .cross(&up)
            .try_normalize(1e-9 * up.norm())
            .unwrap_or_else(Vector::x);
        Self {
            eye,
            forward,
            right,
            up: right.cross(&forward),
            projection,
        }
    }

    /// The camera of a view that just holds `points` inside the middle part of the picture.
    ///
    /// - `aspect`: width / height
    /// - `margins`: (across, down), the share of the picture left free on each side
    /// - `orthographic`: parallel rays in place of a portrait lens
    pub fn framing(
        view: View,
        points: impl Iterator<Item = Point> + Clone,
        aspect: f64,
        margins: (f64, f64),
        orthographic: bool,
    ) -> Self {
        let direction = view.direction();
        let start = Self::look_at(
            Point::from(direction),
            Point::origin(),
            Vector::y(),
            Projection::Orthographic(1.0),
        );
        let mut low = Vector::repeat(f64::INFINITY);
        let mut high = Vector::repeat(f64::NEG_INFINITY);
        for p in points.clone() {
            let q = start.in_frame(&p.coords);
            low = low.inf(&q);
            high = high.sup(&q);
        }
        let middle = (low + high) / 2.0;
        let center =
            Point::from(start.right * middle.x + start.up * middle.y + start.forward * middle.z);
        let (inner_x, inner_y) = (1.0 - 2.0 * margins.0, 1.0 - 2.0 * margins.1);
        let half = (high - low) / 2.0;
        let tiny = f64::MIN_POSITIVE.sqrt();
        if orthographic {
            let height = (2.0 * half.y / inner_y).max(2.0 * half.x / (inner_x * aspect));
            let eye = center + direction * (half.norm() * 2.0 + tiny);
            let projection = Projection::Orthographic(height.max(tiny));
            return Self {
                eye,
                projection,
                ..start
            };
        }
        let slope_y = (PORTRAIT_FIELD / 2.0).tan() * inner_y;
        let slope_x = (PORTRAIT_FIELD / 2.0).tan() * inner_x * aspect;
        let distance = points
            .map(|p| {
                let q = start.in_frame(&(p - center));
                (q.x.abs() / slope_x).max(q.y.abs() / slope_y) - q.z
            })
            .fold(tiny, f64::max);
        Self {
            eye: center + direction * distance,
            projection: Projection::Perspective(PORTRAIT_FIELD),
            ..start
        }
    }

    /// Right, up and forward parts of a vector.
    fn in_frame(&self, v: &Vector) -> Vector {
        Vector::new(self.right.dot(v), self.up.dot(v), self.forward.dot(v))
    }

    /// Origin and unit direction of the ray through the place (x, y) of a picture, in pixels
    /// from its upper left corner.
    pub fn ray(&self, x: f64, y: f64, width: u32, height: u32) -> (Point, Vector) {
        let s = (x - f64::from(width) / 2.0) / f64::from(height);
        let t = 0.5 - y / f64::from(height);
        match self.projection {
            Projection::Orthographic(size) => (
                self.eye + self.right * (s * size) + self.up * (t * size),
                self.forward,
            ),
            Projection::Perspective(field) => {
                let size = 2.0 * (field / 2.0).tan();
                let direction = self.forward + self.right * (s * size) + self.up * (t * size);
                (self.eye, direction.normalize())
            }
        }
    }

    /// Where a point shows, in pixels from the upper left corner; `None` behind the eye.
    pub fn project(&self, point: &Point, width: u32, height: u32) -> Option<[f64; 2]> {
        let q = self.in_frame(&(point - self.eye));
        let size = match self.projection {
            Projection::Orthographic(size) => size,
            Projection::Perspective(field) if q.z > 0.0 => 2.0 * (field / 2.0).tan() * q.z,
            Projection::Perspective(_) => return None,
        };
        let h = f64::from(height);
        Some([
            f64::from(width) / 2.0 + q.x / size * h,
            h / 2.0 - q.y / size * h,
        ])
    }

    /// How wide a pixel is at some distance along a ray. [world units]
    pub(super) fn pixel_size(&self, distance: f64, height: u32) -> f64 {
        let size = match self.projection {
            Projection::Orthographic(size) => size,
            Projection::Perspective(field) => 2.0 * (field / 2.0).tan() * distance,
        };
        size / f64::from(height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Vec<Point> {
        (0..8)
            .map(|i| {
                Point::new(
                    f64::from(i & 1) * 40.0 - 7.0,
                    f64::from(i >> 1 & 1) * 60.0,
                    f64::from(i >> 2) * 20.0 + 90.0,
                )
            })
            .collect()
    }

    #[test]
    fn framing_holds_every_point_and_touches_the_margin() {
        for view in [View::Front, View::ThreeQuarter, View::Side, View::Top] {
            for orthographic in [false, true] {
                let camera =
                    Camera::framing(view, cube().into_iter(), 1.5, (0.1, 0.05), orthographic);
                let mut used = 0.0f64;
                for p in cube() {
                    let [x, y] = camera.project(&p, 300, 200).expect("in front");
                    used = used.max(((x - 150.0) / 120.0).abs().max(((y - 100.0) / 90.0).abs()));
                }
                assert!((used - 1.0).abs() < 1e-9, "{view:?} {orthographic} {used}");
            }
        }
    }

    #[test]
    fn rays_pass_through_what_they_project_to() {
        let camera = Camera::framing(
            View::ThreeQuarter,
            cube().into_iter(),
            1.0,
            (0.1, 0.1),
            false,
        );
        for p in cube() {
            let [x, y] = camera.project(&p, 200, 200).expect("in front");
            let (origin, direction) = camera.ray(x, y, 200, 200);
            let off = (p - origin) - direction * (p - origin).dot(&direction);
            assert!(off.norm() < 1e-6, "{off:?}");
        }
    }

    #[test]
    fn the_characters_left_is_on_the_right_of_a_front_view() {
        let camera = Camera::framing(View::Front, cube().into_iter(), 1.0, (0.1, 0.1), false);
        assert!(camera.right.x > 0.99);
        assert!(View::Side.direction().x > 0.99);
    }

    #[test]
    fn views_have_names_and_angles() {
        assert_eq!(
            "three-quarter".parse::<View>().ok(),
            Some(View::ThreeQuarter)
        );
        assert_eq!(
            "30,-10".parse::<View>().ok(),
            Some(View::Angles {
                yaw: 30.0,
                pitch: -10.0
            })
        );
        assert!("sideways".parse::<View>().is_err());
        assert!("1,nan".parse::<View>().is_err());
    }
}
