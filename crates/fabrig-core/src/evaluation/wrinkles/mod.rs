//! How deep skin wrinkles, and how finely: measured on patches and on the skin over them.
//!
//! A face is held in a pose, once with its muscle shapes alone and once by the cloth. What the
//! cloth does beyond the shapes, along their normals, is followed along the grid lines of a
//! [`Site`]: the same lines on the patch and on the skin above it. Each line, less its own
//! parabola (which is sag, not wrinkle), gives a root mean square, a height from trough to ridge,
//! and with all others a spectrum by arc length, whose peak is the wavelength.
//!
//! Beside it stands what a beam on a foundation of springs does when it is pressed together
//! (Winkler 1867, Hetényi 1946): it buckles at the wavelength where bending and foundation share
//! the work, `L = 2 pi (B/K)^(1/4)`; on a grid of edge l, where bending acts on second
//! differences, at `2 - 2 cos(2 pi l / L) = sqrt(K/B)`, once the strain passes
//! `2 sqrt(B K) / k`, with k the stiffness of an edge. And beside what the skin keeps of the depth
//! stands what the width of its kernel lets it keep, `exp(-2 pi^2 s^2 / L^2)`.

mod cases;
mod error;
mod profile;
mod spectrum;
mod winkler;

pub use cases::{Site, WRINKLE_CASES, WrinkleCase, WrinkleMeasure, measure_wrinkles};
pub use error::WrinkleError;
pub use profile::{WrinkleFigures, figures_of_lines};
pub use winkler::{Winkler, winkler};
