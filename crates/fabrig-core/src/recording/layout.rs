//! What makes a viewer show a recording well: Foxglove's layout, Rerun's blueprint.
//!
//! Foxglove and Lichtblick hide scene topics until a layout turns them on. Rerun shows the
//! points at once and needs a blueprint for the shaded meshes and the plots; a blueprint is
//! bound to the name of a recording, so a small Python script makes and sends it.

use serde_json::{Map, Value, json};

use super::RecordingInfo;
use super::frame::{field_name, topics};

/// Lines in one plot; more cannot be told apart, and the viewer's legend turns them on.
const PLOTTED: usize = 12;

/// A Python script that opens a recording in Rerun with its blueprint: it needs the packages
/// `rerun-sdk` and `mcap`, and says how to use it with `--help`.
pub const RERUN_SCRIPT: &str = include_str!("../../viewers/open_in_rerun.py");

/// The Foxglove layout of a recording as JSON: skin and patches side by side, plots of the
/// weights and statistics, the log.
pub fn foxglove_layout(info: &RecordingInfo) -> String {
    let skin = [topics::SKIN, topics::PARTS];
    let patches = [topics::PATCHES, topics::PARTS];
    let layout = json!({
        "configById": {
            "3D!skin": scene_panel("Skin", &skin),
            "3D!patches": scene_panel("Muscles and fat", &patches),
            "Plot!weights": plot_panel("Weights", topics::WEIGHTS, &info.weight_names),
            "Plot!stats": plot_panel("Statistics", topics::STATS, &info.stat_names),
            "RosOut!log": { "searchTerms": [], "minLogLevel": 1, "topicToRender": topics::LOG },
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": { "speed": 1 },
        "layout": {
            "direction": "column",
            "splitPercentage": 66,
            "first": {
                "direction": "row",
                "splitPercentage": 50,
                "first": "3D!skin",
                "second": "3D!patches",
            },
            "second": {
                "direction": "row",
                "splitPercentage": 40,
                "first": "Plot!weights",
                "second": {
                    "direction": "row",
                    "splitPercentage": 60,
                    "first": "Plot!stats",
                    "second": "RosOut!log",
                },
            },
        },
    });
    format!("{layout:#}\n")
}

fn scene_panel(title: &str, visible: &[&str]) -> Value {
    let all = [
        topics::SKIN,
        topics::PATCHES,
        topics::PARTS,
        topics::SKIN_POINTS,
        topics::PATCH_POINTS,
    ];
    let topics: Map<String, Value> = all
        .iter()
        .map(|topic| {
            let settings = json!({ "visible": visible.contains(topic), "pointSize": 3 });
            ((*topic).to_owned(), settings)
        })
        .collect();
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
        "transforms": {
            "frame:world": { "visible": false },
            "frame:rig": { "visible": false },
            "frame:head": { "visible": false },
        },
        "topics": topics,
        "layers": {},
        "publish": {},
        "imageMode": {},
    })
}

fn plot_panel(title: &str, topic: &str, names: &[String]) -> Value {
    let paths: Vec<Value> = names
        .iter()
        .enumerate()
        .map(|(i, name)| {
            json!({
                "value": format!("{topic}.{}", field_name(name)),
                "label": name,
                "enabled": i < PLOTTED,
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
        "legendDisplay": "left",
        "showXAxisLabels": true,
        "showYAxisLabels": true,
        "showPlotValuesInLegend": true,
        "xAxisVal": "timestamp",
        "sidebarDimension": 160,
    })
}
