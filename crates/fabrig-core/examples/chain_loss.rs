//! Prints what the chain loses, shape by shape, with the template as a user's face.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Instant;

use fabrig_core::rig::{FaceOnTemplate, RigOptions, build};
use fabrig_core::scene::{contour_vertices, shape_loss};
use fabrig_core::skin::SkinDeformer;
use fabrig_core::template;
use fabrig_core::transfer::ShapeWeights;

fn main() -> Result<(), Box<dyn Error>> {
    let loaded = template::Template::load(std::path::Path::new("templates/human"))?;
    let template = &loaded;
    let places = fabrig_core::rig::places_of_self(template);
    let mut options = RigOptions::default();
    let args: Vec<String> = std::env::args().skip(1).collect();
    for a in &args {
        let (k, v) = a.split_once('=').unwrap_or((a, ""));
        match k {
            "reach" => options.fit.reach = v.parse()?,
            "patches" => options.fit.patch_limit = v.parse()?,
            "nodes" => options.fit.node_limit = v.parse()?,
            "rings" => options.fit.rings = v.parse()?,
            "ridge" => options.fit.ridge = v.parse()?,
            "rounds" => options.fit.smoothing_rounds = v.parse()?,
            _ => {}
        }
    }
    let clock = Instant::now();
    let face = FaceOnTemplate {
        face: &template.skin,
        to_head: nalgebra::Similarity3::identity(),
        positions: template.skin.positions(),
        places: &places,
        rigid: &[],
        report: String::new(),
    };
    let rig = build(&face, template, &options)?;
    println!("built in {:.2} s", clock.elapsed().as_secs_f64());
    let rest = rig.skin_at_rest();
    let mut deformer = SkinDeformer::new(&rig.binding, rig.neutral_nodes(), rest.clone())?;
    let mut targets = vec![(Vec::new(), Vec::new()); rig.patches.len()];
    let contours = contour_vertices(template);
    println!("{} contour vertices, {:.1} entries a vertex", contours.len(), rig.binding.nodes.len() as f64 / rest.len() as f64);
    println!("{:<22}{:>7} | {:>6}{:>7}{:>7}{:>7} | {:>4}{:>7}{:>7}{:>7} | {:>6}", "shape", "ampl", "n", "mean", "95%", "max", "n", "mean", "95%", "max", "still");
    let mut out = rest.clone();
    let mut losses = Vec::new();
    let mut errors = vec![0f32; rest.len()];
    for shape in 0..template.shapes.len() {
        let mut weights = vec![0.0; template.shapes.len()];
        weights[shape] = 1.0;
        rig.targets(ShapeWeights { weights: &weights, rates: None }, &mut targets)?;
        let nodes: Vec<_> = targets.iter().map(|t| t.0.as_slice()).collect();
        deformer.deform(&rig.binding, &nodes, rig.mandible(&weights), &mut out)?;
        let loss = shape_loss(template, &contours, shape, &rest, &out);
        let mut wanted = vec![nalgebra::Vector3::<f32>::zeros(); rest.len()];
        for &(v, d) in &template.shapes[shape].deltas { wanted[v as usize] = d.cast(); }
        for v in 0..rest.len() { errors[v] = errors[v].max((out[v] - rest[v] - wanted[v]).norm()); }
        let (m, c) = (loss.moved, loss.contours);
        println!("{:<22}{:>7.2} | {:>6}{:>7.3}{:>7.3}{:>7.2} | {:>4}{:>7.3}{:>7.3}{:>7.2} | {:>6.3}", loss.shape, loss.amplitude, m.count, m.mean, m.percentile_95, m.max, c.count, c.mean, c.percentile_95, c.max, loss.still.max);
        losses.push(loss.clone());
        if args.iter().any(|a| a == "worst") {
            let mut w: Vec<usize> = (0..rest.len()).collect();
            w.sort_by(|&a, &b| {
                let e = |v: usize| (out[v] - rest[v] - wanted[v]).norm();
                e(b).total_cmp(&e(a))
            });
            for &v in w.iter().take(4) {
                let r = template.regions.vertex_regions[v];
                println!("      v{v} {} at {:?} want {:?} got {:?}", template.regions.regions[r.0 as usize].name, rest[v].coords.as_slice(), wanted[v].as_slice(), (out[v] - rest[v]).as_slice());
            }
        }
    }
    let mut worst = (0.0f64, 0.0f64, 0.0f64);
    for l in &losses { worst.0 = worst.0.max(l.moved.mean); worst.1 = worst.1.max(l.moved.percentile_95); worst.2 = worst.2.max(l.contours.mean); }
    let n = losses.len() as f64;
    println!("WORST mean {:.3} 95% {:.3} contour {:.3}; AVERAGE mean {:.3} 95% {:.3} contour {:.3}", worst.0, worst.1, worst.2, losses.iter().map(|l| l.moved.mean).sum::<f64>() / n, losses.iter().map(|l| l.moved.percentile_95).sum::<f64>() / n, losses.iter().map(|l| l.contours.mean).sum::<f64>() / n);
    // per region mean of the worst error
    for (r, region) in template.regions.regions.iter().enumerate() {
        let e: Vec<f32> = (0..rest.len()).filter(|&v| template.regions.vertex_regions[v].0 as usize == r).map(|v| errors[v]).collect();
        let mean = e.iter().sum::<f32>() / e.len() as f32;
        println!("{:<24} n {:>4} worst-shape error mean {:.3} max {:.2}", region.name, e.len(), mean, e.iter().copied().fold(0.0, f32::max));
    }
    Ok(())
}
