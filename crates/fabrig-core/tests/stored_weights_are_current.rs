//! The skin weights that the default pack brings are those that a fit gives: rigs do not
//! depend on whether weights were stored. After a change of shapes, patches or the fit,
//! `fabrig template fit` stores them anew.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use fabrig_core::rig::{RigOptions, fit_template_weights, stored_template_weights};
use fabrig_core::skin::TemplateWeights;
use fabrig_core::template;

#[test]
fn stored_weights_are_what_the_fit_gives() {
    let (template, options) = (template::human(), RigOptions::default());
    let stored = stored_template_weights(template, &options)
        .unwrap()
        .expect("skin_weights.bin was fitted from something else: run `fabrig template fit`");
    let fitted = fit_template_weights(template, &options).unwrap();
    assert_eq!(stored.by_vertex.len(), fitted.by_vertex.len());
    for (v, (a, b)) in stored.by_vertex.iter().zip(&fitted.by_vertex).enumerate() {
        // Other processors may round the sine of the jaw's turn otherwise.
        let sum = |row: &[(u32, f32)]| -> f32 { row.iter().map(|e| e.1.abs()).sum() };
        let shared: f32 = a
            .iter()
            .filter_map(|&(node, w)| {
                let i = b.binary_search_by_key(&node, |e| e.0).ok()?;
                Some(w.abs().min(b[i].1.abs()))
            })
            .sum();
        let apart = sum(a) + sum(b) - 2.0 * shared;
        assert!(apart < 0.02, "vertex {v}: weights differ by {apart}");
    }
}

#[test]
fn weights_of_other_options_or_damaged_ones_are_not_taken() {
    let mut template = template::human().clone();
    let mut options = RigOptions::default();
    options.fit.ridge *= 2.0;
    let other = stored_template_weights(&template, &options).unwrap();
    assert_eq!(other, None);
    let length = template.skin_weights.len();
    template.skin_weights.truncate(length / 2);
    let cut = stored_template_weights(&template, &RigOptions::default()).unwrap();
    assert_eq!(cut, None);
}

#[test]
fn weights_come_back_from_their_bytes_bit_for_bit() {
    let (template, options) = (template::human(), RigOptions::default());
    let stored = stored_template_weights(template, &options)
        .unwrap()
        .unwrap();
    let charts = fabrig_core::anatomy::charts(template, options.resolution).unwrap();
    let bytes = stored.to_bytes(template, 7).unwrap();
    let again = TemplateWeights::from_bytes(&bytes, template, &charts, 7).unwrap();
    assert_eq!(again, stored);
    assert_eq!(
        TemplateWeights::from_bytes(&bytes, template, &charts, 8),
        None
    );
}
