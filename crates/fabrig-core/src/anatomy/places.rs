//! Names of the layout resolved to places on the template's skin.

use std::collections::BTreeMap;

use super::error::{AnatomyError, nearest_name};
use super::expression::PointExpression;
use super::layout::Layout;
use super::skin_frame::SkinFrame;
use crate::mesh::SurfacePoint;
use crate::template::{RegionId, Template};
use crate::{Point, Vector};

/// How far from the skin an authored point may be. (mm)
pub(super) const SNAP_REACH: f64 = 25.0;

/// The template's skin, which of its triangles patches may lie on, and named places.
pub(super) struct Places<'a> {
    /// The template.
    pub(super) template: &'a Template,
    /// Triangles of the skin.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The skin.
    pub(super) skin: SkinFrame,
    /// Whether patches may lie on each triangle.
    is_open: Vec<bool>,
    /// Named places of the layout so far, on the skin.
    points: BTreeMap<String, Point>,
}

impl<'a> Places<'a> {
    /// Resolves the named points of a layout.
    pub(super) fn new(template: &'a Template, layout: &Layout) -> Result<Self, AnatomyError> {
        let triangles = template.skin.triangles();
        let mut places = Self {
            template,
            skin: SkinFrame::new(template.skin.positions(), &triangles)?,
            is_open: vec![true; triangles.len()],
            triangles,
            points: BTreeMap::new(),
        };
        let closed = places.regions("skin", "not_on", &layout.skin.not_on)?;
        places.is_open = places
            .triangles
            .iter()
            .map(|t| places.corners_in(t, &closed) == 0)
            .collect();
        for name in layout.points.keys() {
            places.resolve_named(layout, name, &mut Vec::new())?;
        }
        Ok(places)
    }

    /// Region ids by name.
    pub(super) fn regions(
        &self,
        patch: &str,
        key: &str,
        names: &[String],
    ) -> Result<Vec<RegionId>, AnatomyError> {
        let regions = &self.template.regions;
        names
            .iter()
            .map(|name| {
                regions
                    .find(name)
                    .ok_or_else(|| AnatomyError::UnknownRegion {
                        patch: patch.to_owned(),
                        key: key.to_owned(),
                        name: name.clone(),
                        nearest: nearest_name(
                            name,
                            regions.regions.iter().map(|r| r.name.as_str()),
                        ),
                    })
            })
            .collect()
    }

    /// How many corners of a triangle lie in one of the regions.
    fn corners_in(&self, triangle: &[u32; 3], regions: &[RegionId]) -> usize {
        let labels = &self.template.regions.vertex_regions;
        triangle
            .iter()
            .filter(|&&v| labels.get(v as usize).is_some_and(|r| regions.contains(r)))
            .count()
    }

    /// Triangles that patches may lie on and that are not for the most part in `closed`: at
    /// the corner of the mouth triangles of one lip have a corner that belongs to the other.
    pub(super) fn open_triangles(&self, closed: &[RegionId]) -> Vec<bool> {
        self.triangles
            .iter()
            .zip(&self.is_open)
            .map(|(t, open)| *open && self.corners_in(t, closed) < 2)
            .collect()
    }

    /// The place of an expression, on the skin.
    pub(super) fn place(
        &self,
        patch: &str,
        key: &str,
        text: &str,
    ) -> Result<SurfacePoint, AnatomyError> {
        let point = self.evaluate(patch, key, text, &|name| {
            self.points
                .get(name)
                .copied()
                .or_else(|| self.template.landmark(name))
        })?;
        self.snap(patch, &point)
    }

    /// The place on open skin closest to a point.
    pub(super) fn snap(&self, patch: &str, point: &Point) -> Result<SurfacePoint, AnatomyError> {
        self.skin
            .closest(point, SNAP_REACH, &|t| self.is_open[t as usize])
            .ok_or_else(|| off_skin(patch, point))
    }

    /// Smoothed normal at a place.
    pub(super) fn normal(&self, place: &SurfacePoint) -> Vector {
        self.skin.normal(place.triangle, place.barycentric)
    }

    fn evaluate(
        &self,
        patch: &str,
        key: &str,
        text: &str,
        find: &dyn Fn(&str) -> Option<Point>,
    ) -> Result<Point, AnatomyError> {
        let expression =
            PointExpression::parse(text).map_err(|reason| AnatomyError::BadExpression {
                patch: patch.to_owned(),
                key: key.to_owned(),
                text: text.to_owned(),
                reason,
            })?;
        let mut sum = Vector::from(expression.offset);
        for (weight, name) in &expression.terms {
            let point = find(name).ok_or_else(|| self.unknown_point(patch, key, name))?;
            sum += point.coords * *weight;
        }
        Ok(Point::from(sum))
    }

    fn unknown_point(&self, patch: &str, key: &str, name: &str) -> AnatomyError {
        let known = self
            .points
            .keys()
            .map(String::as_str)
            .chain(self.template.landmarks.keys().map(String::as_str));
        AnatomyError::UnknownPoint {
            patch: patch.to_owned(),
            key: key.to_owned(),
            name: name.to_owned(),
            nearest: nearest_name(name, known),
        }
    }

    /// Resolves a named point after those it is made of.
    fn resolve_named(
        &mut self,
        layout: &Layout,
        name: &str,
        path: &mut Vec<String>,
    ) -> Result<(), AnatomyError> {
        if self.points.contains_key(name) {
            return Ok(());
        }
        let text = &layout.points[name];
        let bad = |reason: String| AnatomyError::BadExpression {
            patch: "points".to_owned(),
            key: name.to_owned(),
            text: text.clone(),
            reason,
        };
        if path.iter().any(|p| p == name) {
            return Err(bad(format!("it is made of itself through {path:?}")));
        }
        path.push(name.to_owned());
        for (_, part) in PointExpression::parse(text).map_err(bad)?.terms {
            if layout.points.contains_key(&part) {
                self.resolve_named(layout, &part, path)?;
            }
        }
        path.pop();
        let place = self.place("points", name, text)?;
        self.points.insert(name.to_owned(), place.point);
        Ok(())
    }
}

/// [`AnatomyError::OffSkin`] at a point.
pub(super) fn off_skin(patch: &str, point: &Point) -> AnatomyError {
    AnatomyError::OffSkin {
        patch: patch.to_owned(),
        reach: SNAP_REACH,
        x: point.x,
        y: point.y,
        z: point.z,
    }
}
