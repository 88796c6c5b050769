//! Pages with pictures in them: one HTML file, nothing beside it.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result};
use fabrig_core::atomic_file::write_atomically;
use fabrig_core::render::Image;
use tempfile::TempDir;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:1100px;\
padding:0 1em;color:#222;background:#fafbfc}h1{font-size:1.3em}h2{font-size:1.1em;margin-top:2em}\
.pictures{display:grid;gap:8px}figure{margin:0}img{width:100%}\
figcaption{font-size:.85em;color:#555}.bad,figcaption.bad{color:#b3261e;font-weight:600}\
table{border-collapse:collapse;margin-top:1.5em}th,td{text-align:left;\
padding:.25em .9em .25em 0;border-bottom:1px solid #ddd;vertical-align:top}\
td.n,th.n{text-align:right}th{white-space:nowrap;font-weight:600}.wide{overflow-x:auto}\
.wide table{font-size:.85em}";

/// A whole page.
///
/// - `body`: HTML
pub(in crate::commands) fn page_of(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n\
         <style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n{body}</body></html>\n",
        title = escape(title)
    )
}

/// Writes a page, whole or not at all.
pub(in crate::commands) fn write_page(path: &Path, page: &str) -> Result<()> {
    write_atomically(path, |out| out.write_all(page.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Pictures with captions.
pub(in crate::commands) struct Figures {
    folder: TempDir,
    html: String,
}

impl Figures {
    pub(in crate::commands) fn new() -> Result<Self> {
        Ok(Self {
            folder: tempfile::tempdir().context("cannot make a temporary folder")?,
            html: String::new(),
        })
    }

    /// Adds a picture.
    pub(in crate::commands) fn push(&mut self, image: &Image, caption: &str) -> Result<()> {
        self.push_as(image, caption, "")
    }

    /// Adds a picture with a caption of some class.
    pub(in crate::commands) fn push_as(
        &mut self,
        image: &Image,
        caption: &str,
        class: &str,
    ) -> Result<()> {
        let file = self.folder.path().join("picture.png");
        image.save_png(&file)?;
        let bytes = std::fs::read(&file).context("cannot read a picture back")?;
        // Writing to a string cannot fail.
        let _ = writeln!(
            self.html,
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption \
             class=\"{class}\">{0}</figcaption></figure>",
            escape(caption),
            base64(&bytes)
        );
        Ok(())
    }

    /// All of them, so many in a row.
    pub(in crate::commands) fn grid(&self, columns: usize) -> String {
        format!(
            "<div class=\"pictures\" style=\"grid-template-columns:repeat({columns},1fr)\">\n{}\
             </div>\n",
            self.html
        )
    }
}

/// A table, or nothing where it has no rows; `is_bad` rows stand out.
pub(in crate::commands) fn table<const N: usize>(
    heads: &[&str; N],
    rows: impl Iterator<Item = [String; N]>,
    is_bad: impl Fn(&[String; N]) -> bool,
) -> String {
    let mut lines = String::new();
    for row in rows {
        let class = if is_bad(&row) { " class=\"bad\"" } else { "" };
        let cells: Vec<String> = row
            .iter()
            .map(|cell| format!("<td>{}</td>", escape(cell)))
            .collect();
        let _ = writeln!(lines, "<tr{class}>{}</tr>", cells.concat());
    }
    if lines.is_empty() {
        return lines;
    }
    let heads = heads.map(|head| format!("<th>{}</th>", escape(head)));
    format!("<table>\n<tr>{}</tr>\n{lines}</table>\n", heads.concat())
}

/// Text as HTML.
pub(in crate::commands) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let at = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for k in 0..4 {
            if k <= chunk.len() {
                let digit = bits >> (18 - 6 * k) & 63;
                text.push(char::from(DIGITS[digit as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_pads_as_the_standard_says() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
