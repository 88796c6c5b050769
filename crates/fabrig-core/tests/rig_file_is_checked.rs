//! A rig file comes back as it was written; one that is cut, damaged, of another version or
//! something else is refused with an error that says so.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use fabrig_core::mesh::appearance::{Appearance, Material, Picture};
use fabrig_core::rig::{FORMAT_VERSION, OLDEST_VERSION, Rig, RigError};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A file with any content under a header that is right.
fn file_of(version: u32, content: &[u8]) -> Vec<u8> {
    let packed = zstd::bulk::compress(content, 1).unwrap();
    let mut bytes = b"FABRIG\r\n".to_vec();
    bytes.extend(version.to_le_bytes());
    bytes.extend((packed.len() as u64).to_le_bytes());
    bytes.extend(crc32fast::hash(&packed).to_le_bytes());
    bytes.extend(packed);
    bytes
}

/// A rig whose face has two materials and a picture.
fn painted(mut rig: Rig) -> Rig {
    let mut of_polygon = vec![0; rig.face.face_count()];
    of_polygon[3] = 1;
    rig.appearance = Some(Appearance {
        materials: vec![
            Material::new("skin", [1.0; 4], 0.5, 0.0, Some((0, 0))),
            Material::new("lips", [0.5, 0.1, 0.1, 1.0], 0.3, 0.0, None),
        ],
        pictures: vec![Picture {
            name: "pores".to_owned(),
            mime: "image/png".to_owned(),
            bytes: (0..=255).collect(),
        }],
        textures: vec![serde_json::json!({"source": 0})],
        of_polygon,
        ..Appearance::default()
    });
    rig
}

#[test]
fn the_version_before_reads_as_a_face_without_materials() {
    let rig = faces::template_rig();
    let plain = postcard::to_allocvec(&rig).unwrap();
    let before = &plain[..plain.len() - 2];
    assert!(Rig::from_bytes(&file_of(OLDEST_VERSION, before)).unwrap() == rig);
    // A newer file that lacks them is cut, not old.
    assert!(matches!(
        Rig::from_bytes(&file_of(FORMAT_VERSION, before)),
        Err(RigError::Content { .. })
    ));
    let rig = painted(rig);
    assert!(Rig::from_bytes(&rig.to_bytes().unwrap()).unwrap() == rig);
}

#[test]
fn damage_under_a_right_checksum_is_an_error_or_a_rig_that_holds_together() {
    let rig = painted(faces::template_rig());
    let plain = postcard::to_allocvec(&rig).unwrap();
    let look = postcard::to_allocvec(&rig.appearance).unwrap().len();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let (mut refused, mut read) = (0, 0);
    for round in 0..60 {
        let mut damaged = plain.clone();
        // Most of it in the few kilobytes of materials, which are checked beyond decoding.
        let from = if round % 4 == 0 {
            0
        } else {
            plain.len() - look
        };
        for _ in 0..rng.random_range(1..4) {
            let place = rng.random_range(from..plain.len());
            damaged[place] = rng.random();
        }
        if round % 5 == 0 {
            damaged.truncate(rng.random_range(from..plain.len()));
        }
        match Rig::from_bytes(&file_of(FORMAT_VERSION, &damaged)) {
            Err(RigError::Content { .. } | RigError::Appearance(_)) => refused += 1,
            Err(error) => panic!("{error}"),
            Ok(rig) => {
                read += 1;
                if let Some(look) = &rig.appearance {
                    look.check(rig.face.face_count()).unwrap();
                }
            }
        }
    }
    assert!(refused > 20 && read > 0, "{refused} refused, {read} read");
}

#[test]
fn a_rig_survives_its_file_and_damage_is_seen() {
    let rig = faces::template_rig();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("face.fabrig");
    rig.save(&path).unwrap();
    assert!(Rig::load(&path).unwrap() == rig);
    let bytes = std::fs::read(&path).unwrap();
    assert!(
        bytes == rig.to_bytes().unwrap(),
        "equal rigs give equal bytes"
    );

    for length in [8, 20, 24, bytes.len() / 2, bytes.len() - 1] {
        let error = Rig::from_bytes(&bytes[..length]).unwrap_err();
        assert!(
            matches!(error, RigError::Length { .. }),
            "cut at {length}: {error}"
        );
    }
    for place in [24, bytes.len() / 2, bytes.len() - 1] {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x40;
        let error = Rig::from_bytes(&damaged).unwrap_err();
        assert!(
            matches!(error, RigError::Checksum { .. }),
            "at {place}: {error}"
        );
    }
    let mut newer = bytes.clone();
    newer[8] += 1;
    assert!(matches!(
        Rig::from_bytes(&newer),
        Err(RigError::Version { found, .. }) if found == FORMAT_VERSION + 1
    ));
    assert!(matches!(
        Rig::from_bytes(b"v 0 0 0\n"),
        Err(RigError::NotARig)
    ));
    assert!(matches!(Rig::from_bytes(b""), Err(RigError::NotARig)));
    assert!(matches!(
        Rig::load(folder.path().join("missing.fabrig")),
        Err(RigError::Io { .. })
    ));
}
