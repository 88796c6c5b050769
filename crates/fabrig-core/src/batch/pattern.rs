//! Names in outputs (`{face}/{take}.mcap`) and wildcards in inputs (`faces/*.obj`).

use std::io;
use std::path::{Component, Path, PathBuf};

/// What a pattern may hold in braces.
pub(super) const FIELDS: [&str; 4] = ["face", "take", "scene", "format"];

/// Names that go into a pattern; empty ones must not be asked for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Names<'a> {
    pub(super) face: &'a str,
    pub(super) take: &'a str,
    pub(super) scene: &'a str,
    pub(super) format: &'a str,
}

/// Whether a pattern has a field.
pub(super) fn has(pattern: &str, field: &str) -> bool {
    pattern.contains(&format!("{{{field}}}"))
}

/// The pattern with its fields replaced.
pub(super) fn fill(pattern: &str, names: Names<'_>) -> String {
    let values = [names.face, names.take, names.scene, names.format];
    let mut text = pattern.to_owned();
    for (field, value) in FIELDS.iter().zip(values) {
        text = text.replace(&format!("{{{field}}}"), value);
    }
    text
}

/// What is wrong with the pattern of an output, if anything.
pub(super) fn problem_of_output(pattern: &str) -> Option<String> {
    let mut rest = pattern;
    while let Some(start) = rest.find(['{', '}']) {
        let inside = &rest[start + 1..];
        let field = inside.split('}').next().unwrap_or_default();
        if rest[start..].starts_with('}') || field.len() == inside.len() {
            return Some(format!("'{pattern}' has a brace without its partner"));
        }
        if !FIELDS.contains(&field) {
            return Some(format!(
                "'{pattern}' asks for {{{field}}}; known are {{face}}, {{take}}, {{scene}} and \
                 {{format}}"
            ));
        }
        rest = &inside[field.len() + 1..];
    }
    let path = Path::new(pattern);
    let is_plain = path.components().all(|c| matches!(c, Component::Normal(_)));
    let is_hidden = path.components().next() == Some(Component::Normal(STATE_FOLDER.as_ref()));
    if pattern.is_empty() || !is_plain || pattern.contains('\\') {
        return Some(format!(
            "'{pattern}' must be a path below the output folder, without '..' and with '/' between \
             folders"
        ));
    }
    is_hidden.then(|| format!("'{STATE_FOLDER}' is where the batch keeps its own state"))
}

/// Where the state of a batch is kept in its output folder.
pub(super) const STATE_FOLDER: &str = ".fabrig";

/// What is wrong with a name that goes into outputs, if anything.
pub(super) fn problem_of_name(name: &str) -> Option<String> {
    let is_bad = |c: char| c.is_control() || "/\\{}*?".contains(c);
    if name.is_empty() || name.starts_with('.') || name.contains(is_bad) {
        return Some(format!(
            "'{name}' cannot be a name: it goes into file names, so it must not be empty, begin with \
             a dot, or hold any of / \\ {{ }} * ?"
        ));
    }
    None
}

/// Whether a text has wildcards.
pub(super) fn is_wild(text: &str) -> bool {
    text.contains(['*', '?'])
}

/// Whether `text` is what `pattern` describes: `*` any letters, `?` one; everything for `*`.
pub(super) fn matches(pattern: &str, text: &str) -> bool {
    let (pattern, text): (Vec<char>, Vec<char>) =
        (pattern.chars().collect(), text.chars().collect());
    // Where to go on when letters after the last star do not fit.
    let (mut p, mut t) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while t < text.len() {
        if p < pattern.len() && (pattern[p] == '?' || pattern[p] == text[t]) && pattern[p] != '*' {
            (p, t) = (p + 1, t + 1);
        } else if pattern.get(p) == Some(&'*') {
            star = Some((p, t));
            p += 1;
        } else if let Some((at, begun)) = star {
            star = Some((at, begun + 1));
            (p, t) = (at + 1, begun + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

/// The files that a path with wildcards means, in the order of their names; hidden ones are left
/// out. A path without wildcards is itself, there or not.
///
/// # Errors
///
/// What the system says of a folder that cannot be read.
pub(super) fn expand(path: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = vec![PathBuf::new()];
    for component in path.components() {
        let text = component.as_os_str().to_string_lossy();
        if !matches!(component, Component::Normal(_)) || !is_wild(&text) {
            found.iter_mut().for_each(|path| path.push(component));
            continue;
        }
        let mut next = Vec::new();
        for folder in found {
            let folder_or_here = if folder.as_os_str().is_empty() {
                Path::new(".")
            } else {
                &folder
            };
            let mut names = Vec::new();
            if folder_or_here.is_dir() {
                for entry in std::fs::read_dir(folder_or_here)? {
                    names.push(entry?.file_name());
                }
            }
            names.sort();
            let fitting = names.into_iter().filter(|name| {
                let name = name.to_string_lossy();
                !name.starts_with('.') && matches(&text, &name)
            });
            next.extend(fitting.map(|name| folder.join(name)));
        }
        // What follows a wildcard must be there: `*/face.obj` passes over folders without one.
        found = next;
    }
    if is_wild(&path.to_string_lossy()) {
        found.retain(|path| path.exists());
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_letters() {
        for (pattern, text, expected) in [
            ("*", "", true),
            ("*", "ann", true),
            ("a*n", "ann", true),
            ("a*n", "anna", false),
            ("a*n*", "anna", true),
            ("?nn", "ann", true),
            ("?nn", "nn", false),
            ("*.obj", "a.obj.obj", true),
            ("*ab*ab", "abab", true),
            ("*abc", "ababc", true),
            ("", "a", false),
            ("a", "", false),
        ] {
            assert_eq!(matches(pattern, text), expected, "{pattern} {text}");
        }
    }

    #[test]
    fn outputs_stay_below_their_folder() {
        for good in ["{face}/{take}.mcap", "a.npz", "x/{scene}-{format}"] {
            assert_eq!(problem_of_output(good), None, "{good}");
        }
        for bad in [
            "",
            "/a",
            "../a",
            "a/../b",
            "{fase}",
            "{face",
            "face}",
            "a\\b",
            ".fabrig/a",
            "./a/..",
        ] {
            assert!(problem_of_output(bad).is_some(), "{bad}");
        }
    }

    #[test]
    fn wildcards_find_files_in_order() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b/face.obj", "a/face.obj", "c/other.obj", "a/.hidden.obj"] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found = expand(&folder.path().join("*/face.obj")).unwrap();
        let expected = ["a/face.obj", "b/face.obj"].map(|name| folder.path().join(name));
        assert_eq!(found, expected);
        let all = expand(&folder.path().join("?/*.obj")).unwrap();
        assert_eq!(all.len(), 3);
        let plain = folder.path().join("no/such.obj");
        assert_eq!(expand(&plain).unwrap(), [plain]);
    }
}
