//! From a manifest's text to files with names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::BatchError;
use super::entry::DEFAULT_TOPOLOGY;
use super::entry::{Content, FaceEntry, OutputEntry, PairEntry, SceneEntry, TakeEntry, is_a};
use super::manifest::{DEFAULT_RIGS, Manifest, ManifestText, Pair};
use super::pattern::{
    Names, expand, fill, has, is_wild, matches, problem_of_name, problem_of_output,
};
use crate::export::ExportFormat;
use crate::facs::nearest_name;

/// What has a file and a name.
trait Named: Clone {
    /// The list it stands in: `[[faces]]`.
    const LIST: &'static str;
    /// Its plural: `faces`.
    const WHAT: &'static str;
    fn file(&mut self) -> &mut PathBuf;
    fn name(&mut self) -> &mut String;
    fn name_of(&self) -> &str;
}

macro_rules! named {
    ($entry:ty, $list:literal, $what:literal) => {
        impl Named for $entry {
            const LIST: &'static str = $list;
            const WHAT: &'static str = $what;
            fn file(&mut self) -> &mut PathBuf {
                &mut self.file
            }
            fn name(&mut self) -> &mut String {
                &mut self.name
            }
            fn name_of(&self) -> &str {
                &self.name
            }
        }
    };
}

named!(FaceEntry, "[[faces]]", "faces");
named!(TakeEntry, "[[takes]]", "takes");
named!(SceneEntry, "[[scenes]]", "scenes");

/// Where a manifest is, for messages and paths.
struct Place<'a> {
    path: &'a Path,
}

pub(super) fn resolve(text: ManifestText, path: &Path) -> Result<Manifest, BatchError> {
    let place = Place { path };
    let faces = place.faces(text.faces)?;
    let takes = place.named(text.takes)?;
    let scenes = place.scenes(text.scenes)?;
    let outputs = place.outputs(text.outputs, !takes.is_empty())?;
    let pairs = place.pairs(&text.pairs, &faces, &takes, &scenes, outputs.len())?;
    let rigs = text.rigs.unwrap_or_else(|| DEFAULT_RIGS.to_owned());
    place.check_rigs(&rigs)?;
    Ok(Manifest {
        path: path.to_owned(),
        rigs,
        faces,
        takes,
        scenes,
        outputs,
        pairs,
    })
}

/// Faces, takes and scenes as a table names them, one by one.
pub(super) fn resolve_listed(
    faces: Vec<FaceEntry>,
    takes: Vec<TakeEntry>,
    scenes: Vec<SceneEntry>,
    outputs: Vec<OutputEntry>,
    pairs: Vec<Pair>,
    path: &Path,
) -> Result<Manifest, BatchError> {
    let place = Place { path };
    Ok(Manifest {
        path: path.to_owned(),
        rigs: DEFAULT_RIGS.to_owned(),
        faces: place.faces(faces)?,
        takes: place.named(takes)?,
        scenes: place.scenes(scenes)?,
        outputs: place.outputs(outputs, true)?,
        pairs,
    })
}

impl Place<'_> {
    fn entry(&self, entry: String, problem: impl Into<String>) -> BatchError {
        BatchError::Entry {
            path: self.path.to_owned(),
            entry,
            problem: problem.into(),
        }
    }

    /// A path of the manifest, from where the program is.
    fn below_manifest(&self, path: &Path) -> PathBuf {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        folder.join(path)
    }

    /// One entry for every file, each with its name.
    fn named<T: Named>(&self, entries: Vec<T>) -> Result<Vec<T>, BatchError> {
        let mut found: Vec<T> = Vec::new();
        let mut by_name: HashMap<String, usize> = HashMap::new();
        for (index, mut entry) in entries.into_iter().enumerate() {
            let shown = entry.file().display().to_string();
            let what = format!("{} {} ({shown})", T::LIST, index + 1);
            if entry.file().as_os_str().is_empty() {
                return Err(self.entry(what, "`file` is missing"));
            }
            let wild = is_wild(&shown);
            if wild && !entry.name().is_empty() {
                let problem = "`name` is one name, and `file` may be many: leave one of them out";
                return Err(self.entry(what, problem));
            }
            let whole = self.below_manifest(entry.file());
            let files = expand(&whole).map_err(|e| self.entry(what.clone(), e.to_string()))?;
            if files.is_empty() {
                return Err(self.entry(what, "no file is called like that"));
            }
            for file in files {
                let mut one = entry.clone();
                if one.name().is_empty() {
                    *one.name() = file_name(&file);
                }
                if let Some(problem) = problem_of_name(one.name_of()) {
                    return Err(self.entry(what, problem));
                }
                *one.file() = file;
                if let Some(other) = by_name.insert(one.name_of().to_owned(), found.len()) {
                    return Err(BatchError::SameName {
                        what: T::WHAT,
                        name: one.name_of().to_owned(),
                        first: found[other].file().clone(),
                        second: one.file().clone(),
                    });
                }
                found.push(one);
            }
        }
        Ok(found)
    }

    fn faces(&self, entries: Vec<FaceEntry>) -> Result<Vec<FaceEntry>, BatchError> {
        let mut faces = self.named(entries)?;
        if faces.is_empty() {
            return Err(self.entry("[[faces]]".to_owned(), "there is none"));
        }
        for face in &mut faces {
            let names = Names {
                face: &face.name,
                ..Names::default()
            };
            let mut paths = [
                &mut face.landmarks,
                &mut face.edits,
                &mut face.shapes,
                &mut face.template,
            ];
            for path in paths.iter_mut().filter_map(|path| path.as_mut()) {
                *path = self.below_manifest(Path::new(&fill(&path.to_string_lossy(), names)));
            }
            let is_for_meshes = face.landmarks.is_some()
                || face.shapes.is_some()
                || face.template.is_some()
                || face.unit.is_some()
                || !face.cut_seams.is_empty();
            if face.is_rig() && (is_for_meshes || face.edits.is_some()) {
                let problem = "it is a rig already: landmarks, shapes, template, unit and cut_seams \
                               are for meshes, and edits stand beside the rig";
                return Err(self.entry(format!("face {}", face.name), problem));
            }
        }
        Ok(faces)
    }

    fn scenes(&self, entries: Vec<SceneEntry>) -> Result<Vec<SceneEntry>, BatchError> {
        let mut scenes: Vec<SceneEntry> = Vec::new();
        for mut entry in entries {
            let more = if entry.has_file() {
                self.named(vec![entry])?
            } else {
                if entry.name.is_empty() {
                    "default".clone_into(&mut entry.name);
                }
                if let Some(problem) = problem_of_name(&entry.name) {
                    return Err(self.entry("[[scenes]]".to_owned(), problem));
                }
                vec![entry]
            };
            for scene in more {
                if let Some(other) = scenes.iter().find(|other| other.name == scene.name) {
                    return Err(BatchError::SameName {
                        what: "scenes",
                        name: scene.name,
                        first: other.file.clone(),
                        second: scene.file,
                    });
                }
                scenes.push(scene);
            }
        }
        if scenes.is_empty() {
            scenes.push(SceneEntry {
                name: "default".to_owned(),
                ..SceneEntry::default()
            });
        }
        for scene in &scenes {
            let what = || format!("scene {}", scene.name);
            if scene.fps.is_some_and(|fps| !(fps > 0.0 && fps <= 1000.0)) {
                return Err(self.entry(what(), "`fps` must be above 0 and at most 1000"));
            }
            if scene.substeps.is_some_and(|n| !(1..=1024).contains(&n)) {
                return Err(self.entry(what(), "`substeps` must be from 1 to 1024"));
            }
        }
        Ok(scenes)
    }

    fn outputs(
        &self,
        entries: Vec<OutputEntry>,
        has_takes: bool,
    ) -> Result<Vec<OutputEntry>, BatchError> {
        let mut found = Vec::new();
        for (index, entry) in entries.into_iter().enumerate() {
            let what = format!("[[outputs]] {} ({})", index + 1, entry.path);
            let fail = |problem: &str| Err(self.entry(what.clone(), problem));
            for pattern in [&entry.path, &entry.topology] {
                let problem = (!pattern.is_empty()).then(|| problem_of_output(pattern));
                if let Some(problem) = problem.flatten() {
                    return fail(&problem);
                }
            }
            if entry.path.is_empty() {
                return fail("`path` is missing");
            }
            if has(&entry.path, "format") == entry.formats.is_empty() {
                return fail(
                    "`formats` says what {format} in `path` stands for: give both or none",
                );
            }
            let formats = if entry.formats.is_empty() {
                vec![String::new()]
            } else {
                entry.formats.clone()
            };
            for format in formats {
                let mut one = entry.clone();
                one.path = one.path.replace("{format}", &format);
                if one.content() == Content::Dataset && one.topology.is_empty() {
                    one.topology = beside(&one.path, DEFAULT_TOPOLOGY);
                }
                if let Some(problem) = problem_of_content(&one, has_takes) {
                    return fail(&problem);
                }
                found.push(one);
            }
        }
        Ok(found)
    }

    fn check_rigs(&self, rigs: &str) -> Result<(), BatchError> {
        let fail = |problem: String| Err(self.entry(format!("rigs = \"{rigs}\""), problem));
        if let Some(problem) = problem_of_output(rigs) {
            return fail(problem);
        }
        if !is_a(Path::new(rigs), "fabrig") {
            return fail("the extension of rigs is .fabrig".to_owned());
        }
        let other = ["take", "scene", "format"].iter().find(|f| has(rigs, f));
        match other {
            Some(field) => fail(format!(
                "a rig is a face's alone: {{{field}}} cannot be in it"
            )),
            None => Ok(()),
        }
    }

    fn pairs(
        &self,
        entries: &[PairEntry],
        faces: &[FaceEntry],
        takes: &[TakeEntry],
        scenes: &[SceneEntry],
        output_count: usize,
    ) -> Result<Vec<Pair>, BatchError> {
        let everything = [PairEntry::default()];
        let entries = if entries.is_empty() {
            &everything
        } else {
            entries
        };
        let mut pairs: Vec<Pair> = Vec::new();
        for (index, entry) in entries.iter().enumerate() {
            let what = format!("[[pairs]] {}", index + 1);
            let chosen_faces = self.chosen(&what, &entry.faces, faces)?;
            let chosen_takes = self.chosen(&what, &entry.takes, takes)?;
            let chosen_scenes = self.chosen(&what, &entry.scenes, scenes)?;
            for &face in &chosen_faces {
                for &take in &chosen_takes {
                    for &scene in &chosen_scenes {
                        pairs.push(Pair {
                            face,
                            take,
                            scene,
                            outputs: (0..output_count).collect(),
                        });
                    }
                }
            }
        }
        pairs.sort_by_key(|pair| (pair.face, pair.take, pair.scene));
        // Entries may overlap; a pair is done once.
        pairs.dedup();
        Ok(pairs)
    }

    /// Indices of what the patterns fit, each pattern something.
    fn chosen<T: Named>(
        &self,
        what: &str,
        patterns: &[String],
        entries: &[T],
    ) -> Result<Vec<usize>, BatchError> {
        if patterns.is_empty() {
            return Ok((0..entries.len()).collect());
        }
        let fits = |pattern: &str| -> Vec<usize> {
            let found = entries.iter().enumerate();
            let found = found.filter(|(_, e)| matches(pattern, e.name_of()));
            found.map(|(index, _)| index).collect()
        };
        let mut chosen = Vec::new();
        for pattern in patterns {
            let found = fits(pattern);
            if found.is_empty() {
                let names = entries.iter().map(Named::name_of);
                let nearest = nearest_name(pattern, names).unwrap_or_default();
                let problem = format!(
                    "no {} is called '{pattern}' (nearest: '{nearest}')",
                    T::WHAT
                );
                return Err(self.entry(what.to_owned(), problem));
            }
            chosen.extend(found);
        }
        chosen.sort_unstable();
        chosen.dedup();
        Ok(chosen)
    }
}

/// The pattern of a file in the same folder as another's, as far as that is the face's own.
fn beside(pattern: &str, name: &str) -> String {
    let folders: Vec<&str> = pattern.split('/').collect();
    let own = folders[..folders.len() - 1].iter();
    let own = own.take_while(|f| !has(f, "take") && !has(f, "scene"));
    own.copied().chain([name]).collect::<Vec<_>>().join("/")
}

/// The name of a file without its last extension; ARKit's own takes have dots in theirs.
fn file_name(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}

fn problem_of_content(output: &OutputEntry, has_takes: bool) -> Option<String> {
    let path = Path::new(&output.path);
    let has_take = has(&output.path, "take");
    if !has_takes && has_take {
        return Some("{take} is asked for, but there are no [[takes]]".to_owned());
    }
    match output.content() {
        Content::Recording if !is_a(path, "mcap") => {
            Some("a recording is an .mcap file".to_owned())
        }
        Content::Dataset if !is_a(path, "npz") => Some("a dataset is of .npz files".to_owned()),
        Content::Dataset if ["take", "scene"].iter().any(|f| has(&output.topology, f)) => {
            Some("topology is a face's alone: {take} and {scene} cannot be in it".to_owned())
        }
        Content::Export => match ExportFormat::of(path) {
            Ok(format) if !has_take && (output.baked || format.is_point_cache()) => Some(format!(
                "{} holds a take here: {{take}} must be in `path`",
                format.name()
            )),
            Ok(_) => None,
            Err(error) => Some(error.to_string()),
        },
        Content::Recording | Content::Dataset if !has_take => {
            Some("{take} must be in `path`".to_owned())
        }
        _ => None,
    }
}
