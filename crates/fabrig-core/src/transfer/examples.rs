//! A face's own expressions, to which its rig is fitted.

use super::TransferError;
use crate::Vector;

/// An expression of a face in the template's topology.
#[derive(Debug, Clone, PartialEq)]
pub struct Example {
    /// Name, for reports.
    pub name: String,
    /// Weights of the template's shapes that make it.
    pub weights: Vec<f32>,
    /// Displacement of every vertex from the neutral face. (mm, head frame)
    pub deltas: Vec<Vector>,
    /// Whether the displacement of a vertex is known.
    pub is_seen: Vec<bool>,
}

impl Example {
    /// The one shape that it is at weight 1, if it is.
    pub fn shape(&self) -> Option<usize> {
        let mut active = self.weights.iter().enumerate().filter(|(_, w)| **w != 0.0);
        match (active.next(), active.next()) {
            (Some((shape, &1.0)), None) => Some(shape),
            _ => None,
        }
    }
}

/// Checks that examples fit the template.
///
/// # Errors
///
/// [`TransferError::Example`].
pub fn check_examples(
    examples: &[Example],
    shape_count: usize,
    vertex_count: usize,
) -> Result<(), TransferError> {
    for example in examples {
        let wrong = |reason: String| TransferError::Example {
            name: example.name.clone(),
            reason,
        };
        if example.weights.len() != shape_count {
            return Err(wrong(format!(
                "it has {} weights, the template {shape_count} shapes",
                example.weights.len()
            )));
        }
        for found in [example.deltas.len(), example.is_seen.len()] {
            if found != vertex_count {
                return Err(wrong(format!(
                    "it has {found} vertices, the template {vertex_count}"
                )));
            }
        }
        let is_finite = example.weights.iter().all(|w| w.is_finite())
            && example
                .deltas
                .iter()
                .flat_map(|d| d.iter())
                .all(|c| c.is_finite());
        if !is_finite {
            return Err(wrong("it has numbers that are not finite".to_owned()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_that_do_not_fit_are_named() {
        let example = Example {
            name: "jawOpen".to_owned(),
            weights: vec![1.0],
            deltas: vec![Vector::new(f64::NAN, 0.0, 0.0)],
            is_seen: vec![true],
        };
        for (shapes, vertices) in [(2, 1), (1, 2), (1, 1)] {
            let error = check_examples(std::slice::from_ref(&example), shapes, vertices);
            assert!(error.unwrap_err().to_string().contains("jawOpen"));
        }
    }
}
