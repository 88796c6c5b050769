//! With loose skin the forehead and the corners of the eyes wrinkle as the muscles under them are
//! drawn together: as finely as a beam on springs, as deep whatever the seed, and on the skin as deep
//! as the kernel that moves it lets it be.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::sync::Arc;

use fabrig_core::edit::{Edits, apply_preset};
use fabrig_core::evaluation::{WRINKLE_CASES, WrinkleMeasure, measure_wrinkles};
use fabrig_core::rig::{
    FaceOnTemplate, Rig, RigOptions, SkinRefinement, build, places_of_self, refine_on_template,
    refined_face,
};
use fabrig_core::scene::Scene;
use fabrig_core::template;

/// The template's own face, with edges over what folds no longer than `edge_length` (mm).
fn face(edge_length: Option<f64>) -> Rig {
    let template = template::human();
    let places = places_of_self(template);
    let options = RigOptions::default();
    let on_template = FaceOnTemplate {
        face: &template.skin,
        to_head: nalgebra::Similarity3::identity(),
        positions: template.skin.positions(),
        places: &places,
        rigid: &[],
        examples: &[],
        report: String::new(),
    };
    let Some(length) = edge_length else {
        return build(&on_template, template, &options).unwrap();
    };
    let wanted = SkinRefinement::to(length);
    let (finer, places) = refine_on_template(&on_template, template, &options, &wanted).unwrap();
    let finer_face = refined_face(&on_template, &finer.mesh, &places);
    let rig = build(&finer_face, template, &options).unwrap();
    let count = template.skin.vertex_count();
    assert_eq!(&rig.face.positions()[..count], template.skin.positions());
    rig
}

fn measured(rig: &Arc<Rig>, case: usize, seed: u64) -> WrinkleMeasure {
    let mut scene = Scene::default();
    scene.cloth.seed = seed;
    measure_wrinkles(rig, &scene, &WRINKLE_CASES[case]).unwrap()
}

#[test]
fn loose_skin_wrinkles_and_firm_skin_does_not() {
    let firm = Arc::new(face(Some(1.6)));
    let loose = |rig: &Rig| {
        let mut rig = rig.clone();
        apply_preset(&mut rig, "looser_skin").unwrap();
        Arc::new(rig)
    };
    let fine = loose(&firm);
    let coarse = loose(&face(None));
    for (case, name) in WRINKLE_CASES.iter().map(|c| c.name).enumerate() {
        let still = measured(&firm, case, 0);
        let seeds: Vec<WrinkleMeasure> = (0..3).map(|seed| measured(&fine, case, seed)).collect();
        assert_eq!(measured(&fine, case, 0), seeds[0], "{name}: the same seed");
        for m in &seeds {
            assert!(m.strain < -0.01, "{name}: muscles shorten: {m:?}");
            assert!(m.patch.depth_rms > 0.1, "{name}: the patch folds: {m:?}");
            assert!(
                m.patch.depth_rms > 4.0 * still.patch.depth_rms,
                "{name}: {still:?}"
            );
            let kept = m.skin.depth_rms / m.patch.depth_rms;
            assert!(
                (kept - m.kept_predicted).abs() < 0.2,
                "{name}: the skin shows what its kernel lets it: {kept} {m:?}"
            );
            let ratio = m.patch.wavelength / m.winkler.unwrap().wavelength;
            assert!(
                (0.6..1.6).contains(&ratio),
                "{name}: as fine as a beam: {ratio}"
            );
            let depth = m.patch.depth_rms / seeds[0].patch.depth_rms;
            assert!(
                (depth - 1.0).abs() < 0.3,
                "{name}: as deep whatever the seed: {depth}"
            );
        }
        // But not in the same places.
        let others = seeds[1..].iter();
        let changes = others.map(|m| (m.patch.depth_rms / seeds[0].patch.depth_rms - 1.0).abs());
        assert!(changes.fold(0.0, f64::max) > 0.005, "{name}: {seeds:?}");
        // A coarse mesh cannot show all of it.
        let lost = measured(&coarse, case, 0);
        assert!(
            lost.skin.depth_rms < 1.05 * seeds[0].skin.depth_rms,
            "{name}: {lost:?}"
        );
    }
}

#[test]
fn presets_that_are_not_there_are_named() {
    let mut rig = face(None);
    let before = rig.clone();
    let error = apply_preset(&mut rig, "loser_skin")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("looser_skin") && error.contains("more_fat"),
        "{error}"
    );
    for (text, expected) in [
        ("[patches.frontalis]\nthickness = 2\n", "only fat pads"),
        ("[patches.malar_fat]\nthickness = 99\n", "from -10 to 20"),
        ("[patches.molar_fat]\nthickness = 2\n", "malar_fat"),
        (
            "[wrinkles.a]\npatches = [\"frontalis\"]\nalong = [0.7, 0.2]\n",
            "along",
        ),
    ] {
        let error = Edits::parse(text).unwrap().apply(&mut rig).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
    assert!(Edits::parse("[wrinkles.a]\nrest_blend = 0\n").is_err());
    assert_eq!(rig, before);
}

/// Presets change the neutral face where there is fat, both sides alike, and nowhere else.
#[test]
fn more_fat_is_fuller_and_less_fat_leaner() {
    let plain = face(None);
    let change = |preset: &str| -> Vec<f64> {
        let mut rig = plain.clone();
        apply_preset(&mut rig, preset).unwrap();
        let normals =
            fabrig_core::mesh::vertex_normals(plain.face.positions(), &plain.face.triangles());
        let pairs = rig.face.positions().iter().zip(plain.face.positions());
        pairs
            .zip(normals)
            .map(|((a, b), n)| (a - b).dot(&n))
            .collect()
    };
    let (more, less) = (change("more_fat"), change("less_fat"));
    let most = more.iter().copied().fold(0.0, f64::max);
    let least = less.iter().copied().fold(0.0, f64::min);
    assert!((3.0..8.0).contains(&most), "{most}");
    assert!((-4.0..-1.0).contains(&least), "{least}");
    assert!(more.iter().all(|&d| d >= 0.0) && less.iter().all(|&d| d <= 0.0));
    let template = template::human();
    // Cells of a grid are parted along one diagonal, so mirror images differ by a little.
    for (v, &mirror) in template.mirror.iter().enumerate() {
        let apart = (more[v] - more[mirror as usize]).abs();
        assert!(apart < 0.2, "{v}: {apart}");
    }
    let still = ["forehead_mid", "nose_tip", "hairline_mid"];
    for name in still {
        assert_eq!(more[template.landmarks[name] as usize], 0.0, "{name}");
    }
}
