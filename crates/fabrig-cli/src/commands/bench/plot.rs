//! One page with plots of time beside error: HTML with inline SVG, nothing loaded from outside.

use std::fmt::Write;

use fabrig_core::cloth::bench::{Pareto, ParetoPoint};

/// Size of a plot and its margins, in pixels.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 440.0;
const MARGIN: f64 = 60.0;

/// Colours of the lines, told apart by most eyes.
const COLOURS: [&str; 8] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999",
];

/// A logarithmic axis over whole decades.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let logs: Vec<f64> = values
            .filter(|v| v.is_finite() && *v > 0.0)
            .map(f64::log10)
            .collect();
        let low = logs.iter().copied().fold(0.0, f64::min).floor();
        let high = logs.iter().copied().fold(low + 1.0, f64::max).ceil();
        Self {
            low,
            high,
            from,
            to,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value.log10().clamp(self.low, self.high) - self.low) / (self.high - self.low);
        self.from + share * (self.to - self.from)
    }

    fn decades(&self) -> impl Iterator<Item = f64> {
        (self.low as i32..=self.high as i32).map(|d| 10.0_f64.powi(d))
    }
}

/// The page.
pub(super) fn page(results: &[Pareto]) -> String {
    let mut out = String::from(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>fabrig: time beside error\
         </title><style>body{font:15px/1.5 system-ui,sans-serif;max-width:860px;margin:2em auto;\
         padding:0 1em;color:#222}table{border-collapse:collapse;font-size:13px}td,th{padding:2px \
         9px;text-align:right;border-bottom:1px solid #ddd}td:first-child,th:first-child{text-align:\
         left}svg text{font:12px system-ui,sans-serif}</style><h1>Time beside error of the cloth</h1>\
         <p>Error: the largest RMS difference over the frames to a converged reference in double \
         precision, over the largest RMS displacement. Time: the median of the frames. Down and to \
         the left is better; both axes are logarithmic. The dashed line is 1 %, dotted lines are \
         the reference's difference to itself with half the substeps and what a micrometre in the \
         neutral shape changes.</p>",
    );
    for result in results {
        section(&mut out, result);
    }
    out.push_str("</html>\n");
    out
}

fn section(out: &mut String, result: &Pareto) {
    let _ = write!(
        out,
        "<h2>{}</h2><p>{} nodes, {} frames of 1/60 s, {} threads; reference: {} substeps, differs \
         from {} by {:.1e}; a micrometre changes {:.1e}; floor {:.3} ns per constraint.</p>",
        escape(&result.scene),
        result.node_count,
        result.frame_count,
        result.thread_count,
        result.reference_substeps,
        result.reference_substeps / 2,
        result.reference_difference.relative,
        result.micrometre.relative,
        result.floor.ns_per_constraint
    );
    plot(out, result);
    out.push_str(
        "<details><summary>Table</summary><table><tr><th>mode<th>substeps<th>median ms<th>95 %\
         <th>RMS mm<th>max mm<th>relative<th>guards</tr>",
    );
    for p in &result.points {
        let _ = write!(
            out,
            "<tr><td>{}<td>{}<td>{:.3}<td>{:.3}<td>{:.4}<td>{:.4}<td>{:.2e}<td>{}</tr>",
            p.setting.family(),
            p.setting.substeps,
            p.median_ms,
            p.p95_ms,
            p.error.rms,
            p.error.max,
            p.error.relative,
            p.counters.total()
        );
    }
    out.push_str("</table></details>");
}

fn plot(out: &mut String, result: &Pareto) {
    let marks = [
        result.reference_difference.relative,
        result.micrometre.relative,
    ];
    let errors = result.points.iter().map(|p| p.error.relative);
    let x = Axis::new(
        result.points.iter().map(|p| p.median_ms),
        MARGIN,
        WIDTH - 190.0,
    );
    let y = Axis::new(errors.chain(marks).chain([0.01]), HEIGHT - MARGIN, 20.0);
    let _ = write!(
        out,
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"time beside error\">"
    );
    for value in x.decades() {
        let at = x.at(value);
        line(out, [at, y.from, at, y.to], "#e4e4e4", "");
        text(out, at, y.from + 18.0, "middle", &number(value));
    }
    for value in y.decades() {
        let at = y.at(value);
        line(out, [x.from, at, x.to, at], "#e4e4e4", "");
        text(out, x.from - 8.0, at + 4.0, "end", &number(value));
    }
    text(
        out,
        (x.from + x.to) / 2.0,
        HEIGHT - 14.0,
        "middle",
        "ms per frame",
    );
    text(out, x.from, 14.0, "start", "relative error");
    line(out, [x.from, y.at(0.01), x.to, y.at(0.01)], "#555", "6 4");
    for mark in marks.into_iter().filter(|m| *m > 0.0) {
        line(out, [x.from, y.at(mark), x.to, y.at(mark)], "#555", "2 3");
    }
    let mut families: Vec<(String, Vec<&ParetoPoint>)> = Vec::new();
    for point in &result.points {
        let name = point.setting.family();
        match families.iter_mut().find(|(known, _)| *known == name) {
            Some((_, points)) => points.push(point),
            None => families.push((name, vec![point])),
        }
    }
    for (index, (name, points)) in families.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let path: Vec<String> = points
            .iter()
            .map(|p| format!("{:.1},{:.1}", x.at(p.median_ms), y.at(p.error.relative)))
            .collect();
        let _ = write!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
            path.join(" ")
        );
        for p in points {
            let _ = write!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"{colour}\"><title>{name}, {} \
                 substeps: {:.3} ms, {:.2e}</title></circle>",
                x.at(p.median_ms),
                y.at(p.error.relative),
                p.setting.substeps,
                p.median_ms,
                p.error.relative
            );
        }
        let row = 30.0 + 18.0 * index as f64;
        line(out, [x.to + 16.0, row, x.to + 36.0, row], colour, "");
        text(out, x.to + 42.0, row + 4.0, "start", name);
    }
    out.push_str("</svg>");
}

fn line(out: &mut String, [x1, y1, x2, y2]: [f64; 4], colour: &str, dashes: &str) {
    let _ = write!(
        out,
        "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\" \
         stroke-dasharray=\"{dashes}\"/>"
    );
}

fn text(out: &mut String, x: f64, y: f64, anchor: &str, words: &str) {
    let _ = write!(
        out,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>",
        escape(words)
    );
}

/// A power of ten in few letters.
fn number(value: f64) -> String {
    if (0.001..10_000.0).contains(&value) {
        format!("{value}")
    } else {
        format!("{value:.0e}")
    }
}

fn escape(words: &str) -> String {
    words
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
