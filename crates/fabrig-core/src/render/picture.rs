//! The picture: what it shows, from where, and the loop over its pixels.

use rayon::prelude::*;

use super::annotation::{draw_labels, draw_legend, label_margin};
use super::image_buffer::check_size;
use super::layer::Paint;
use super::light::{Exposure, Lights, expose};
use super::tracer::{Hit, Tracer};
use super::{Camera, Image, Label, Layer, Legend, Material, Points, RenderError, Rgb, View};
use crate::{Point, Vector};

/// Rays per side of a pixel that differs from its neighbours.
const REFINED_SIDE: u32 = 3;
/// Encoded difference of neighbours above which a pixel is refined.
const REFINE_CONTRAST: f32 = 0.045;
/// Translucent surfaces that one ray passes at most.
const VEIL_LIMIT: usize = 32;

/// What lies behind everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// One sRGB colour.
    Solid([u8; 3]),
    /// Top and bottom sRGB colours, blended.
    Gradient([u8; 3], [u8; 3]),
}

impl Default for Background {
    fn default() -> Self {
        Self::Gradient([236, 238, 241], [198, 203, 210])
    }
}

/// Where to look from.
#[derive(Debug, Clone, Default)]
pub enum Shot {
    /// A named view that frames everything (or [`Picture::with_focus`]).
    #[default]
    Front,
    /// Any view that frames everything (or [`Picture::with_focus`]).
    View(View),
    /// A camera placed by hand.
    Camera(Camera),
}

/// A picture to be made.
#[derive(Debug, Clone)]
pub struct Picture {
    width: u32,
    height: u32,
    shot: Shot,
    focus: Vec<Point>,
    margins: (f64, f64),
    is_orthographic: bool,
    background: Background,
    layers: Vec<Layer>,
    points: Vec<Points>,
    labels: Vec<Label>,
    legend: Option<Legend>,
}

/// What the pixel loop needs to know of one layer.
struct Prepared<'a> {
    layer: &'a Layer,
    normals: Vec<Vector>,
    exposures: Vec<Exposure>,
    /// First primitive of this layer.
    start: u32,
}

/// All that one ray needs.
struct Stage<'a> {
    picture: &'a Picture,
    camera: Camera,
    tracer: Tracer,
    lights: Lights,
    layers: Vec<Prepared<'a>>,
    /// Layer of each triangle, then set of each ball.
    owners: Vec<u32>,
    triangle_count: usize,
    ball_centers: Vec<Point>,
}

impl Picture {
    /// An empty picture of some size in pixels, seen from the front.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            shot: Shot::Front,
            focus: Vec::new(),
            margins: (0.06, 0.06),
            is_orthographic: false,
            background: Background::default(),
            layers: Vec::new(),
            points: Vec::new(),
            labels: Vec::new(),
            legend: None,
        }
    }

    /// Looks from a named view.
    pub fn with_view(mut self, view: View) -> Self {
        self.shot = Shot::View(view);
        self
    }

    /// Looks through a camera placed by hand.
    pub fn with_camera(mut self, camera: Camera) -> Self {
        self.shot = Shot::Camera(camera);
        self
    }

    /// Parallel rays in place of a portrait lens, for named views.
    pub fn with_parallel_rays(mut self) -> Self {
        self.is_orthographic = true;
        self
    }

    /// Frames these points instead of everything, for named views: the same points in every
    /// frame keep the camera still.
    pub fn with_focus(mut self, points: impl IntoIterator<Item = Point>) -> Self {
        self.focus = points.into_iter().collect();
        self
    }

    /// Share of the picture left free (across, down) on each side, each below 0.5; labels take
    /// the room they need.
    pub fn with_margins(mut self, across: f64, down: f64) -> Self {
        self.margins = (across.clamp(0.0, 0.45), down.clamp(0.0, 0.45));
        self
    }

    /// Sets the background.
    pub fn with_background(mut self, background: Background) -> Self {
        self.background = background;
        self
    }

    /// Adds a layer.
    pub fn with_layer(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// Adds layers.
    pub fn with_layers(mut self, layers: impl IntoIterator<Item = Layer>) -> Self {
        self.layers.extend(layers);
        self
    }

    /// Adds small balls.
    pub fn with_points(mut self, points: Points) -> Self {
        self.points.push(points);
        self
    }

    /// Adds names with leader lines.
    pub fn with_labels(mut self, labels: impl IntoIterator<Item = Label>) -> Self {
        self.labels.extend(labels);
        self
    }

    /// Adds a colour bar.
    pub fn with_legend(mut self, legend: Legend) -> Self {
        self.legend = Some(legend);
        self
    }

    /// Makes the picture.
    ///
    /// # Errors
    ///
    /// [`RenderError::Size`], [`RenderError::Empty`] when nothing was added, and
    /// [`RenderError::NotFinite`] for points or labels that lie nowhere.
    pub fn render(&self) -> Result<Image, RenderError> {
        check_size(self.width, self.height)?;
        self.check_finite()?;
        let stage = Stage::new(self)?;
        let coarse = stage.coarse_pass();
        let pixels = stage.refine(&coarse);
        let mut image = Image::filled(self.width, self.height, [0; 3])?;
        for (i, color) in pixels.iter().enumerate() {
            let (x, y) = (i as u32 % self.width, i as u32 / self.width);
            image.set(x, y, color.to_srgb());
        }
        draw_labels(&mut image, &self.labels, &stage.camera);
        if let Some(legend) = &self.legend {
            draw_legend(&mut image, legend);
        }
        Ok(image)
    }

    fn check_finite(&self) -> Result<(), RenderError> {
        let is_bad = |p: &Point| !p.iter().all(|c| c.is_finite());
        for set in &self.points {
            if let Some(index) = set.centers.iter().position(is_bad) {
                return Err(RenderError::NotFinite {
                    what: "point",
                    index,
                });
            }
        }
        match self.labels.iter().position(|label| is_bad(&label.anchor)) {
            Some(index) => Err(RenderError::NotFinite {
                what: "label",
                index,
            }),
            None => Ok(()),
        }
    }

    /// The camera for what was added.
    fn camera(&self) -> Camera {
        let view = match &self.shot {
            Shot::Camera(camera) => return *camera,
            Shot::Front => View::Front,
            Shot::View(view) => *view,
        };
        let aspect = f64::from(self.width) / f64::from(self.height);
        let used = self.layers.iter().flat_map(|layer| {
            let corners = layer.triangles.iter().flatten();
            corners.map(|&v| layer.positions[v as usize])
        });
        let centers = self
            .points
            .iter()
            .flat_map(|set| set.centers.iter().copied());
        let all = used.chain(centers);
        let (across, down) = self.margins;
        let names = label_margin(&self.labels, self.width, self.height);
        let margins = (across.max(names).min(0.45), down);
        if self.focus.is_empty() {
            Camera::framing(view, all, aspect, margins, self.is_orthographic)
        } else {
            let focus = self.focus.iter().copied();
            Camera::framing(view, focus, aspect, margins, self.is_orthographic)
        }
    }
}

impl<'a> Stage<'a> {
    fn new(picture: &'a Picture) -> Result<Self, RenderError> {
        let mut corners = Vec::new();
        let mut owners = Vec::new();
        for (i, layer) in picture.layers.iter().enumerate() {
            for t in &layer.triangles {
                corners.push(t.map(|v| layer.positions[v as usize]));
                owners.push(i as u32);
            }
        }
        let mut balls = Vec::new();
        for (i, set) in picture.points.iter().enumerate() {
            for &center in &set.centers {
                balls.push((center, set.radius.abs()));
                owners.push(i as u32);
            }
        }
        if owners.is_empty() {
            return Err(RenderError::Empty);
        }
        let camera = picture.camera();
        let tracer = Tracer::new(&corners, &balls);
        let lights = Lights::about(&camera);
        let occludes = |primitive: u32| {
            (primitive as usize) < corners.len()
                && picture.layers[owners[primitive as usize] as usize].has_shadows()
        };
        let mut layers = Vec::new();
        let mut start = 0;
        for layer in &picture.layers {
            let normals = layer.vertex_normals();
            let exposures = if !layer.has_shadows() {
                vec![Exposure::FULL; normals.len()]
            } else {
                lights.bake(&layer.positions, &normals, &tracer, occludes)
            };
            layers.push(Prepared {
                layer,
                normals,
                exposures,
                start,
            });
            start += layer.triangles.len() as u32;
        }
        Ok(Self {
            picture,
            camera,
            tracer,
            lights,
            layers,
            triangle_count: corners.len(),
            owners,
            ball_centers: balls.into_iter().map(|(center, _)| center).collect(),
        })
    }

    /// One ray through the middle of every pixel: its colour, and the first layer it met.
    fn coarse_pass(&self) -> Vec<(Rgb, u32)> {
        let width = self.picture.width;
        (0..self.picture.height)
            .into_par_iter()
            .flat_map_iter(|y| {
                (0..width).map(move |x| self.sample(f64::from(x) + 0.5, f64::from(y) + 0.5))
            })
            .collect()
    }

    /// Replaces pixels that differ from their neighbours by the mean of a grid of rays.
    fn refine(&self, coarse: &[(Rgb, u32)]) -> Vec<Rgb> {
        let (width, height) = (self.picture.width, self.picture.height);
        let at = |x: u32, y: u32| &coarse[(y * width + x) as usize];
        // Lines are thinner than pixels, so contrast between pixels does not find them all.
        let has_lines = self.picture.layers.iter().any(|l| l.edges.is_some());
        (0..height)
            .into_par_iter()
            .flat_map_iter(|y| {
                (0..width).map(move |x| {
                    let &(color, id) = at(x, y);
                    let mut near = (y.saturating_sub(1)..=(y + 1).min(height - 1)).flat_map(|j| {
                        (x.saturating_sub(1)..=(x + 1).min(width - 1)).map(move |i| at(i, j))
                    });
                    let differs = (has_lines && id != 0)
                        || near.any(|&(c, i)| i != id || c.contrast(color) > REFINE_CONTRAST);
                    if !differs {
                        return color;
                    }
                    let mut sum = Rgb::BLACK;
                    for k in 0..REFINED_SIDE * REFINED_SIDE {
                        let (i, j) = (k % REFINED_SIDE, k / REFINED_SIDE);
                        let place = |at: u32, k: u32| {
                            f64::from(at) + (f64::from(k) + 0.5) / f64::from(REFINED_SIDE)
                        };
                        sum += self.sample(place(x, i), place(y, j)).0;
                    }
                    sum * (1.0 / (REFINED_SIDE * REFINED_SIDE) as f32)
                })
            })
            .collect()
    }

    /// Colour seen through a place of the picture, and 1 + the first layer met (0 for none).
    fn sample(&self, x: f64, y: f64) -> (Rgb, u32) {
        let (width, height) = (self.picture.width, self.picture.height);
        let (origin, direction) = self.camera.ray(x, y, width, height);
        let mut light = Rgb::BLACK;
        let mut through = 1.0f32;
        let mut from = 0.0;
        let mut first = 0;
        for _ in 0..VEIL_LIMIT {
            let hit = self
                .tracer
                .cast(&origin, &direction, from, f64::INFINITY, |i, front| {
                    front || !self.is_veil(i)
                });
            let Some(hit) = hit else { break };
            let (color, opacity) = self.shade(&hit, &origin, &direction);
            if first == 0 {
                first = 1 + self.owners[hit.primitive as usize];
            }
            light += color * (through * opacity);
            through *= 1.0 - opacity;
            if through < 0.004 {
                return (expose(light), first);
            }
            from = hit.distance + self.tracer.radius * 1e-6;
        }
        let ground = match self.picture.background {
            Background::Solid(color) => Rgb::from_srgb(color),
            Background::Gradient(top, bottom) => {
                Rgb::from_srgb(top).mix(Rgb::from_srgb(bottom), (y / f64::from(height)) as f32)
            }
        };
        // The background is already what the eye should see, so it is not exposed again.
        (expose(light) + ground * through, first)
    }

    fn is_veil(&self, primitive: u32) -> bool {
        (primitive as usize) < self.triangle_count
            && self.picture.layers[self.owners[primitive as usize] as usize].opacity < 1.0
    }

    /// Light from a hit towards the eye, and how much of it hides what is behind.
    fn shade(&self, hit: &Hit, origin: &Point, direction: &Vector) -> (Rgb, f32) {
        let point = origin + direction * hit.distance;
        let to_eye = -direction;
        let owner = self.owners[hit.primitive as usize] as usize;
        if hit.primitive as usize >= self.triangle_count {
            let center = self.ball_centers[hit.primitive as usize - self.triangle_count];
            let normal = (point - center).try_normalize(0.0).unwrap_or(to_eye);
            let color = self.picture.points[owner].color;
            let material = Material::MATTE;
            let light = self
                .lights
                .shade(color, &material, &normal, &to_eye, Exposure::FULL);
            return (light, 1.0);
        }
        let Prepared {
            layer,
            normals,
            exposures,
            start,
        } = &self.layers[owner];
        let triangle = (hit.primitive - start) as usize;
        let corners = layer.triangles[triangle].map(|v| v as usize);
        let w = hit.barycentric;
        let [a, b, c] = corners.map(|v| layer.positions[v]);
        let flat = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or(to_eye);
        let mut normal = flat;
        if layer.is_smooth {
            let sum = (0..3).fold(Vector::zeros(), |sum, k| {
                sum + normals[corners[k]] * f64::from(w[k])
            });
            normal = sum.try_normalize(1e-9).unwrap_or(flat);
        }
        // Both sides of a sheet are lit; the back of a closed surface is only seen where open.
        if flat.dot(&to_eye) < 0.0 {
            normal = -normal;
        }
        let blend = |value: fn(&Exposure) -> f32| -> f32 {
            (0..3).map(|k| value(&exposures[corners[k]]) * w[k]).sum()
        };
        let exposure = Exposure {
            ambient: blend(|e| e.ambient),
            key: blend(|e| e.key),
        };
        let color = match &layer.paint {
            Paint::Uniform(color) => *color,
            Paint::Triangle(colors) => colors[triangle],
            Paint::Vertex(colors) => {
                (0..3).fold(Rgb::BLACK, |sum, k| sum + colors[corners[k]] * w[k])
            }
            Paint::Eye { center, gaze, iris } => {
                super::face::eye_color(&point, center, gaze, *iris)
            }
        };
        let mut light = self
            .lights
            .shade(color, &layer.material, &normal, &to_eye, exposure);
        let mut opacity = layer.opacity;
        if opacity < 1.0 {
            // A veil is denser where it is seen edge on.
            let cos = normal.dot(&to_eye).abs().max(0.12) as f32;
            opacity = 1.0 - (1.0 - opacity).powf(1.0 / cos);
        }
        if let Some(edges) = &layer.edges {
            let pixel = self.camera.pixel_size(hit.distance, self.picture.height);
            let reach = f64::from(edges.width) / 2.0 * pixel;
            let sides = [(a, b), (b, c), (c, a)];
            let is_on_line = (0..3).any(|k| {
                let (p, q) = sides[k];
                let side = q - p;
                layer.polygon_edges[triangle] >> k & 1 == 1
                    && side.cross(&(point - p)).norm() < reach * side.norm()
            });
            if is_on_line {
                light = light.mix(edges.color, edges.opacity);
                opacity = opacity.max(edges.opacity);
            }
        }
        (light, opacity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64, half: f64) -> Layer {
        let positions = [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| Point::new(x, y, z))
            .to_vec();
        Layer::new(positions, vec![[0, 1, 2], [0, 2, 3]]).expect("valid")
    }

    fn color(name: &str) -> Rgb {
        Rgb::from_srgb(match name {
            "red" => [200, 20, 20],
            _ => [20, 20, 200],
        })
    }

    #[test]
    fn the_nearer_layer_hides_the_farther_and_a_veil_does_not() {
        let back = square(0.0, 10.0).with_color(color("red"));
        let front = square(5.0, 4.0).with_color(color("blue"));
        let picture = |front: Layer| {
            let picture = Picture::new(64, 64).with_layers([back.clone(), front]);
            picture
                .render()
                .expect("rendered")
                .pixel(32, 32)
                .expect("inside")
        };
        let [r, _, b] = picture(front.clone());
        assert!(b > 2 * r, "{r} {b}");
        let [r, _, b] = picture(front.with_opacity(0.5));
        assert!(r > 60 && b > 60, "{r} {b}");
    }

    #[test]
    fn edges_of_a_quad_do_not_show_its_diagonal() {
        let polygons = crate::mesh::Polygons::from_faces([[0u32, 1, 2, 3]]);
        let positions = square(0.0, 10.0).positions.clone();
        let layer = Layer::from_polygons(positions, &polygons).expect("valid");
        let edges = Edges {
            opacity: 1.0,
            width: 3.0,
            ..Edges::default()
        };
        let image = Picture::new(65, 65)
            .with_margins(0.1, 0.1)
            .with_layer(layer.with_color(Rgb::WHITE).with_edges(edges))
            .render()
            .expect("rendered");
        let [middle, ..] = image.pixel(32, 32).expect("inside");
        assert!(middle > 150, "{middle}");
        let darkest = (0..16)
            .filter_map(|x| image.pixel(x, 32))
            .map(|p| p[0])
            .min();
        assert!(darkest.is_some_and(|d| d < 40), "{darkest:?}");
    }

    use crate::render::Edges;

    #[test]
    fn thread_count_does_not_change_a_pixel() {
        let picture = Picture::new(80, 60).with_layers([
            square(0.0, 10.0).with_color(color("red")),
            square(3.0, 5.0).with_opacity(0.4),
        ]);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("pool")
                .install(|| picture.render().expect("rendered"))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn bad_input_is_refused() {
        assert!(matches!(
            Picture::new(10, 10).render(),
            Err(RenderError::Empty)
        ));
        assert!(matches!(
            Picture::new(0, 10).with_layer(square(0.0, 1.0)).render(),
            Err(RenderError::Size { .. })
        ));
        assert!(matches!(
            Layer::new(vec![Point::origin()], vec![[0, 0, 1]]),
            Err(RenderError::IndexOutOfRange { vertex: 1, .. })
        ));
        let lost = Points {
            centers: vec![Point::new(f64::NAN, 0.0, 0.0)],
            radius: 1.0,
            color: Rgb::WHITE,
        };
        assert!(matches!(
            Picture::new(8, 8).with_points(lost).render(),
            Err(RenderError::NotFinite { what: "point", .. })
        ));
    }
}
