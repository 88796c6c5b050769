//! What makes a viewer show a recording well: Foxglove's layout, Rerun's blueprint.
//!
//! Foxglove and Lichtblick hide scene topics until a layout turns them on. Rerun shows the
//! points at once and needs a blueprint for the shaded meshes and the plots; a blueprint is
//! bound to the name of a recording, so a small Python script makes and sends it.
//!
//! Source of the panels' settings: the types `PlotConfig` and `RendererConfig` of Lichtblick.

use serde_json::{Map, Value, json};

use super::encode::FrameNames;
use super::frame::{field_name, topics};
use super::{RecordingInfo, RecordingOptions};

/// Lines in one plot; more cannot be told apart, and the viewer's legend turns them on.
const PLOTTED: usize = 12;

/// A Python script that opens a recording in Rerun with its blueprint: it needs the packages
/// `rerun-sdk` and `mcap`, and says how to use it with `--help`.
pub const RERUN_SCRIPT: &str = include_str!("../../viewers/open_in_rerun.py");

/// Units of the statistics by the end of their names, and what a plot of them is called.
const UNITS: [(&str, &str); 4] = [
    ("_mm", "Distances (mm)"),
    ("_energy", "Energies"),
    ("_ms", "Times (ms)"),
    ("_newton", "Forces (N)"),
];
/// What a plot of all other statistics is called.
const COUNTS: &str = "Counts";

/// The Foxglove layout of a recording as JSON: skin and patches side by side (and the strain
/// where it is recorded), all faces in each; for every face a plot of the weights and one of the
/// statistics of each unit; the log.
pub fn foxglove_layout(faces: &[&RecordingInfo], options: &RecordingOptions) -> String {
    let mut panels = Map::new();
    let mut add = |id: String, panel: Value| {
        panels.insert(id.clone(), panel);
        Value::from(id)
    };
    let mut scenes = vec![
        ("skin", "Skin", topics::SKIN, options.skin_hz),
        (
            "patches",
            "Muscles and fat",
            topics::PATCHES,
            options.patches_hz,
        ),
        ("strain", "Strain", topics::STRAIN, options.strain_hz),
        ("magnets", "Magnets", topics::MAGNETS, options.magnets_hz),
    ];
    scenes.retain(|(.., hz)| *hz > 0.0);
    if scenes.is_empty() {
        scenes.push(("points", "Points", topics::SKIN_POINTS, options.points_hz));
    }
    let scenes = scenes.into_iter().map(|(id, title, topic, _)| {
        // Arrows stand on the patches, and would be hidden by the skin.
        let mut visible = vec![topic, topics::PARTS, topics::COLLIDERS];
        if topic == topics::PATCHES {
            visible.push(topics::CONTACTS);
        }
        if topic == topics::SKIN_POINTS {
            visible.push(topics::PATCH_POINTS);
        }
        let panel = scene_panel(title, &visible, faces);
        add(format!("3D!{id}"), panel)
    });
    let scenes: Vec<Value> = scenes.collect();

    // With the face's name at its end where there are several.
    let named = |text: &str, info: &RecordingInfo| match info.face.as_str() {
        "" => text.to_owned(),
        face => format!("{text} {face}"),
    };
    let weights = faces.iter().filter(|_| options.weights).map(|info| {
        let panel = plot_panel(
            &named("Weights", info),
            &info.topic(topics::WEIGHTS),
            &info.weight_names,
            &plotted_weights(info),
            "left",
        );
        add(named("Plot!weights", info), panel)
    });
    let weights: Vec<Value> = weights.collect();
    let mut below = Vec::new();
    for info in faces {
        let units = UNITS.iter().map(|unit| unit.1).chain([COUNTS]);
        for (index, title) in units.enumerate() {
            let is_in = |name: &&String| stat_title(name) == title;
            let names: Vec<String> = info.stat_names.iter().filter(is_in).cloned().collect();
            if !names.is_empty() {
                let topic = info.topic(topics::STATS);
                let panel = plot_panel(&named(title, info), &topic, &names, &names, "floating");
                below.push(add(named(&format!("Plot!stats{index}"), info), panel));
            }
        }
    }
    let log = faces
        .first()
        .map_or_else(String::new, |info| info.topic(topics::LOG));
    let log = json!({ "searchTerms": [], "minLogLevel": 1, "topicToRender": log });
    below.push(add("RosOut!log".to_owned(), log));
    let half = below.len().div_ceil(2);
    let second = below.split_off(half);
    let mut columns = vec![split("row", below)];
    if !second.is_empty() {
        columns.push(split("row", second));
    }
    let plots = split("column", columns);
    let lower = if weights.is_empty() {
        plots
    } else {
        json!({
            "direction": "row",
            "splitPercentage": 42,
            "first": split("column", weights),
            "second": plots,
        })
    };
    let layout = json!({
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": { "speed": 1 },
        "layout": {
            "direction": "column",
            "splitPercentage": 60,
            "first": split("row", scenes),
            "second": lower,
        },
    });
    format!("{layout:#}\n")
}

/// The weights that plots show at first.
pub(super) fn plotted_weights(info: &RecordingInfo) -> Vec<String> {
    if info.plotted_weights.is_empty() {
        let step = info.weight_names.len().div_ceil(PLOTTED).max(1);
        return info.weight_names.iter().step_by(step).cloned().collect();
    }
    info.plotted_weights.iter().take(PLOTTED).cloned().collect()
}

/// The plot that a statistic belongs into: lines of one plot have one unit.
fn stat_title(name: &str) -> &'static str {
    let known = UNITS.iter().find(|(end, _)| name.ends_with(end));
    known.map_or(COUNTS, |(_, title)| title)
}

/// Panels side by side (`row`) or one above the other (`column`), of equal size.
fn split(direction: &str, mut panels: Vec<Value>) -> Value {
    let Some(last) = panels.pop() else {
        return Value::Null;
    };
    let count = panels.len() + 1;
    let panels = panels.into_iter().enumerate().rev();
    panels.fold(last, |second, (k, first)| {
        let share = 100.0 / (count - k) as f64;
        json!({ "direction": direction, "splitPercentage": share, "first": first, "second": second })
    })
}

fn scene_panel(title: &str, visible: &[&str], faces: &[&RecordingInfo]) -> Value {
    let all = [
        topics::SKIN,
        topics::PATCHES,
        topics::STRAIN,
        topics::PARTS,
        topics::COLLIDERS,
        topics::CONTACTS,
        topics::SKIN_POINTS,
        topics::PATCH_POINTS,
        topics::MAGNETS,
    ];
    let (mut topics, mut frames) = (Map::new(), Map::new());
    let hidden = json!({ "visible": false });
    frames.insert("frame:world".to_owned(), hidden.clone());
    for info in faces {
        for topic in all {
            let settings = json!({ "visible": visible.contains(&topic), "pointSize": 3 });
            topics.insert(info.topic(topic), settings);
        }
        let names = FrameNames::of(&info.face);
        for frame in [names.rig, names.head] {
            frames.insert(format!("frame:{frame}"), hidden.clone());
        }
    }
    json!({
        "foxglovePanelTitle": title,
        "lichtblickPanelTitle": title,
        "followTf": "world",
        "followMode": "follow-none",
        "cameraState": {
            "perspective": true,
            "distance": 8,
            "phi": 86,
            "thetaOffset": 0,
            "targetOffset": [0, 0, 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 30,
            "near": 0.1,
            "far": 1000,
        },
        "scene": { "backgroundColor": "#22262b", "labelScaleFactor": 0 },
        "transforms": frames,
        "topics": topics,
        "layers": {},
        "publish": {},
        "imageMode": {},
    })
}

fn plot_panel(
    title: &str,
    topic: &str,
    names: &[String],
    enabled: &[String],
    legend: &str,
) -> Value {
    let paths: Vec<Value> = names
        .iter()
        .map(|name| {
            json!({
                "value": format!("{topic}.{}", field_name(name)),
                "label": name,
                "enabled": enabled.contains(name),
                "timestampMethod": "receiveTime",
            })
        })
        .collect();
    json!({
        "foxglovePanelTitle": title,
        "lichtblickPanelTitle": title,
        "paths": paths,
        "isSynced": true,
        "showLegend": true,
        "legendDisplay": legend,
        "showXAxisLabels": true,
        "showYAxisLabels": true,
        "showPlotValuesInLegend": true,
        "xAxisVal": "timestamp",
        "sidebarDimension": 160,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::SurfaceInfo;

    fn info() -> RecordingInfo {
        let words = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        RecordingInfo {
            face: String::new(),
            rig: "ball".to_owned(),
            template: "none".to_owned(),
            fps: 60.0,
            seed: 0,
            skin: SurfaceInfo {
                name: "skin".to_owned(),
                color: [0; 4],
                vertex_count: 0,
                triangles: Vec::new(),
                vertex_colors: Vec::new(),
            },
            patches: Vec::new(),
            parts: Vec::new(),
            colliders: None,
            weight_names: (0..52).map(|k| format!("shape{k}")).collect(),
            plotted_weights: words(&["shape7", "shape40"]),
            stat_names: words(&["settle_mm", "bend_energy", "stretch_energy", "guards"]),
            extra: Vec::new(),
        }
    }

    fn layout(info: &RecordingInfo, strain_hz: f64) -> Value {
        let options = RecordingOptions {
            strain_hz,
            ..RecordingOptions::default()
        };
        serde_json::from_str(&foxglove_layout(&[info], &options)).expect("JSON")
    }

    /// Panels at the ends of the tree.
    fn leaves(node: &Value, found: &mut Vec<String>) {
        if let Some(id) = node.as_str() {
            return found.push(id.to_owned());
        }
        assert!(["row", "column"].contains(&node["direction"].as_str().expect("split")));
        let share = node["splitPercentage"].as_f64().expect("share");
        assert!(share > 5.0 && share < 95.0);
        leaves(&node["first"], found);
        leaves(&node["second"], found);
    }

    #[test]
    fn every_panel_stands_in_the_tree_once() {
        for strain_hz in [0.0, 15.0] {
            let layout = layout(&info(), strain_hz);
            let mut shown = Vec::new();
            leaves(&layout["layout"], &mut shown);
            shown.sort();
            let panels = layout["configById"].as_object().expect("panels");
            assert!(panels.keys().eq(&shown), "{shown:?}");
            assert_eq!(shown.contains(&"3D!strain".to_owned()), strain_hz > 0.0);
        }
    }

    #[test]
    fn faces_share_the_views_and_have_plots_of_their_own() {
        let [ann, bob] = ["ann", "bob"].map(|face| RecordingInfo {
            face: face.to_owned(),
            ..info()
        });
        let text = foxglove_layout(&[&ann, &bob], &RecordingOptions::default());
        let layout: Value = serde_json::from_str(&text).expect("JSON");
        let mut shown = Vec::new();
        leaves(&layout["layout"], &mut shown);
        shown.sort();
        let panels = layout["configById"].as_object().expect("panels");
        assert!(panels.keys().eq(&shown), "{shown:?}");
        let skin = &panels["3D!skin"]["topics"];
        assert_eq!(skin["/ann/rig/skin"]["visible"], true);
        assert_eq!(skin["/bob/rig/skin"]["visible"], true);
        let line = &panels["Plot!weights bob"]["paths"][0]["value"];
        assert_eq!(line, "/bob/weights.shape0");
    }

    #[test]
    fn a_plot_has_one_unit_and_the_weights_that_move() {
        let layout = layout(&info(), 0.0);
        let lines = |panel: &str, only_enabled: bool| -> Vec<String> {
            let paths = layout["configById"][panel]["paths"].as_array();
            let paths = paths.expect("a plot").iter();
            let shown = paths.filter(|p| !only_enabled || p["enabled"] == true);
            shown
                .filter_map(|p| p["value"].as_str().map(str::to_owned))
                .collect()
        };
        assert_eq!(lines("Plot!stats0", true), ["/stats.settle_mm"]);
        let energies = ["/stats.bend_energy", "/stats.stretch_energy"];
        assert_eq!(lines("Plot!stats1", true), energies);
        assert_eq!(lines("Plot!stats4", true), ["/stats.guards"]);
        assert_eq!(
            lines("Plot!weights", true),
            ["/weights.shape7", "/weights.shape40"]
        );
        assert_eq!(lines("Plot!weights", false).len(), 52);
    }

    #[test]
    fn without_a_choice_weights_come_from_all_over_the_list() {
        let info = RecordingInfo {
            plotted_weights: Vec::new(),
            ..info()
        };
        let plotted = plotted_weights(&info);
        assert!(plotted.len() > PLOTTED / 2 && plotted.len() <= PLOTTED);
        assert_eq!(plotted[1], "shape5");
    }
}
