//! The page of `fabrig bench table3`: every pose of every face, coloured by its error.

use std::fmt;

use anyhow::{Result, bail};
use fabrig_core::Point;
use fabrig_core::evaluation::{Drive, FaceResult, METHODS, OwnFace, POSES, Pose, Table3};
use fabrig_core::render::{ColorMap, FaceLook, Image, Layer, Legend, Paint, Picture, Rgb};

use crate::commands::html::{Figures, escape, page_of, table};
use crate::console::Console;

/// The paper's way.
pub(super) const FITTED: &str = "global, patch, all";
/// Methods that are drawn, and looked at beside the yardstick.
const DRAWN: [&str; 6] = [
    "delta",
    "global, size",
    FITTED,
    "global, shape, all",
    "global, map, all",
    "own shapes",
];
/// The colours end here. (mm)
const WORST_SHOWN_MM: f64 = 3.0;
/// Size of a picture. (px)
const SIZE: u32 = 190;
/// Regions that add less than this to a mean are not named. (mm)
const NAMED: f64 = 0.01;

/// How and where a method is further from a pose than the yardstick.
pub(super) struct Loss {
    mean: f64,
    yardstick: f64,
    short: [f64; 2],
    beside: [f64; 2],
    places: Vec<(String, f64)>,
}

impl Loss {
    /// `None` where it is not, or where the face lacks the pose.
    pub(super) fn of(face: &FaceResult, method: &str, pose: &str) -> Option<Self> {
        let yardstick = METHODS[0].name;
        let own = face.error(method, pose, Drive::Units)?;
        let other = face.error(yardstick, pose, Drive::Units)?;
        if own.mean <= other.mean {
            return None;
        }
        let mut places = face.losses(method, yardstick, pose);
        places.retain(|(_, by)| *by >= NAMED);
        places.truncate(3);
        Some(Self {
            mean: own.mean,
            yardstick: other.mean,
            short: [own.short, other.short],
            beside: [own.beside, other.beside],
            places,
        })
    }
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let way = |short: f64| {
            let word = if short < 0.0 { "too far" } else { "short" };
            format!("{:.2} mm {word}", short.abs())
        };
        write!(
            f,
            "{:.2} against {:.2} mm; {} (delta {}), {:.2} mm beside (delta {:.2})",
            self.mean,
            self.yardstick,
            way(self.short[0]),
            way(self.short[1]),
            self.beside[0],
            self.beside[1]
        )?;
        for (k, (region, by)) in self.places.iter().enumerate() {
            let start = if k == 0 { "; most in" } else { "," };
            write!(f, "{start} {region} +{by:.2}")?;
        }
        Ok(())
    }
}

/// The whole page.
pub(super) fn page(console: &Console, faces: &[OwnFace], table3: &Table3) -> Result<String> {
    let synthetic = table3.faces.iter().filter(|f| f.is_synthetic).count();
    let mut body = format!(
        "<p>{} faces, {synthetic} of them synthetic. Distance from the face's own pose, in \
         millimetres at true head size, over the vertices that the pose moves; mean and standard \
         deviation. Examples are the face's other shapes, with <em>all</em> the poses' own too; \
         pictures are coloured from 0 to {WORST_SHOWN_MM} mm.</p>\n",
        table3.faces.len()
    );
    for (drive, words) in [
        (Drive::Units, "Weights of the pose"),
        (Drive::BestFit, "Weights that fit best"),
    ] {
        body += &format!("<h2>{words}: over faces</h2>\n");
        body += &over_faces(table3, drive);
    }
    for result in &table3.faces {
        let Some(face) = faces.iter().find(|face| face.name == result.face) else {
            continue;
        };
        body += &section(console, face, result)?;
    }
    for (face, reason) in &table3.refused {
        body += &format!("<p>{}: {}</p>\n", escape(face), escape(reason));
    }
    console.clear();
    Ok(page_of("Table 3: a face's own poses", &body))
}

fn pose_heads<const N: usize>(first: &str, last: &str) -> [String; N] {
    std::array::from_fn(|k| match k {
        0 => first.to_owned(),
        _ if k <= POSES.len() => POSES[k - 1].name.to_owned(),
        _ => last.to_owned(),
    })
}

fn over_faces(table3: &Table3, drive: Drive) -> String {
    let [delta, _] = table3.over_faces(METHODS[0].name, None, drive);
    let rows = METHODS.iter().map(|method| {
        let cell = |pose: Option<&str>| {
            let [mean, deviation] = table3.over_faces(method.name, pose, drive);
            format!("{mean:.3} ± {deviation:.3}")
        };
        let [mean, _] = table3.over_faces(method.name, None, drive);
        let poses = POSES.map(|pose| cell(Some(pose.name)));
        let [a, b, c, d] = poses;
        let share = format!("{:+.0} %", 100.0 * (mean / delta - 1.0));
        [method.name.to_owned(), a, b, c, d, cell(None), share]
    });
    let mut heads: [String; 7] = pose_heads("method", "all");
    "to delta".clone_into(&mut heads[6]);
    table(&heads.each_ref().map(String::as_str), rows, |_| false)
}

/// One face: its table, where it loses, its pictures.
fn section(console: &Console, face: &OwnFace, result: &FaceResult) -> Result<String> {
    let kind = if face.is_synthetic {
        " (synthetic)"
    } else {
        ""
    };
    let mut body = format!(
        "<h2>{}{kind}</h2>\n<p>{} vertices, registered to {:.2} mm in the median.</p>\n",
        escape(&face.name),
        result.vertex_count,
        result.registration_median
    );
    let rows = METHODS.iter().map(|method| {
        let poses = POSES.map(|pose| {
            let error = result.error(method.name, pose.name, Drive::Units);
            error.map_or_else(
                || "-".to_owned(),
                |e| format!("{:.2} ± {:.2}", e.mean, e.deviation),
            )
        });
        let [a, b, c, d] = poses;
        [method.name.to_owned(), a, b, c, d]
    });
    let heads: [String; 5] = pose_heads("method", "");
    body += &table(&heads.each_ref().map(String::as_str), rows, |_| false);
    let losses = DRAWN.iter().skip(1).flat_map(|method| {
        let of_pose = |pose: &Pose| {
            let loss = Loss::of(result, method, pose.name)?;
            Some([(*method).to_owned(), pose.name.to_owned(), loss.to_string()])
        };
        POSES.iter().filter_map(of_pose).collect::<Vec<_>>()
    });
    let heads = ["loses to delta", "pose", "how and where"];
    body += &table(&heads, losses, |_| false);
    let mut figures = Figures::new()?;
    for pose in POSES {
        let Some(posed) = own_pose(face, result, &pose) else {
            continue;
        };
        if console.show(&face.name, 0, 1, pose.name).is_break() {
            bail!("stopped; nothing was written");
        }
        let look = FaceLook::default();
        let plain = look.skin(posed.clone(), face.neutral.polygons())?;
        figures.push(&picture(plain, false)?, &format!("{}: its own", pose.name))?;
        for method in DRAWN {
            let Some(error) = result.error(method, pose.name, Drive::Units) else {
                continue;
            };
            let map = ColorMap::sequential(0.0, WORST_SHOWN_MM);
            let still = Rgb::from_srgb([214, 214, 214]);
            let color = |d: &f32| {
                if d.is_nan() {
                    still
                } else {
                    map.color(f64::from(*d))
                }
            };
            let colors = error.distances.iter().map(color).collect();
            let layer = Layer::from_polygons(posed.clone(), face.neutral.polygons())?;
            let image = picture(layer.with_paint(Paint::Vertex(colors))?, true)?;
            figures.push(&image, &format!("{method}: {:.2} mm", error.mean))?;
        }
    }
    body += &figures.grid(1 + DRAWN.len());
    Ok(body)
}

/// The face's own pose in the head frame; `None` where it lacks a shape. (mm)
fn own_pose(face: &OwnFace, result: &FaceResult, pose: &Pose) -> Option<Vec<Point>> {
    let mut posed = face.neutral.positions().to_vec();
    for name in pose.shapes {
        let own = face.expressions.iter().find(|e| e.name == *name)?;
        let rest = face.neutral.positions().iter();
        for ((p, q), rest) in posed.iter_mut().zip(&own.positions).zip(rest) {
            *p += q - rest;
        }
    }
    Some(posed.iter().map(|p| result.to_head * p).collect())
}

fn picture(layer: Layer, has_legend: bool) -> Result<Image> {
    let mut picture = Picture::new(SIZE, SIZE).with_layer(layer);
    if has_legend {
        picture = picture.with_legend(Legend {
            map: ColorMap::sequential(0.0, WORST_SHOWN_MM),
            title: "mm".to_owned(),
        });
    }
    Ok(picture.render()?)
}
