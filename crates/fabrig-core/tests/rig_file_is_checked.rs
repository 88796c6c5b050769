//! A rig file comes back as it was written; one that is cut, damaged, of another version or
//! something else is refused with an error that says so.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use fabrig_core::rig::{FORMAT_VERSION, Rig, RigError};

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
