//! Prints what the chain loses, shape by shape, with the template as a user's face.
//!
//! ```text
//! cargo run --release -p fabrig-core --example chain_loss [registered] [cloth]
//! ```
//!
//! `registered` goes through registration; `cloth` lets the patches settle as cloth.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use fabrig_core::registration::{RegistrationOptions, register};
use fabrig_core::rig::{FaceOnTemplate, RigOptions, build, places_of_self};
use fabrig_core::scene::{Scene, chain_loss};
use fabrig_core::template;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let asked = |what: &str| arguments.iter().any(|a| a == what);
    let template = template::human();
    let clock = Instant::now();
    let registration;
    let places;
    let on_template = if asked("registered") {
        registration = register(
            &template.skin,
            template,
            &RegistrationOptions::default(),
            &mut |_| ControlFlow::Continue(()),
        )?;
        FaceOnTemplate::from_registration(&template.skin, &registration)?
    } else {
        places = places_of_self(template);
        FaceOnTemplate {
            face: &template.skin,
            to_head: nalgebra::Similarity3::identity(),
            positions: template.skin.positions(),
            places: &places,
            rigid: &[],
            report: String::new(),
        }
    };
    println!("registered in {:.2} s", clock.elapsed().as_secs_f64());
    let clock = Instant::now();
    let rig = Arc::new(build(&on_template, template, &RigOptions::default())?);
    println!("rigged in {:.2} s", clock.elapsed().as_secs_f64());
    let scene = if asked("cloth") {
        Scene::default()
    } else {
        Scene::without_dynamics()
    };
    let clock = Instant::now();
    let losses = chain_loss(&rig, template, &scene)?;
    println!("posed in {:.2} s", clock.elapsed().as_secs_f64());
    println!(
        "{:<20}{:>7}{:>6}{:>8}{:>8}{:>8}{:>9}{:>8}{:>8}{:>8}",
        "shape [mm]", "peak", "moved", "mean", "95 %", "max", "contour", "95 %", "leak", "settle"
    );
    for loss in &losses {
        println!(
            "{:<20}{:>7.2}{:>6}{:>8.3}{:>8.3}{:>8.2}{:>9.3}{:>8.3}{:>8.3}{:>8.3}",
            loss.shape,
            loss.amplitude,
            loss.moved.count,
            loss.moved.mean,
            loss.moved.percentile_95,
            loss.moved.max,
            loss.contours.mean,
            loss.contours.percentile_95,
            loss.still.max,
            loss.settle_rms,
        );
    }
    Ok(())
}
