//! Contract: a damaged mesh file of any format gives a mesh or a typed error, never a panic
//! and never memory out of proportion to the file.
//!
//! Seeded: `FABRIG_FUZZ_ROUNDS` sets how many mutations each format gets (default 300).

use std::path::Path;

use fabrig_core::mesh::io::{MeshIoError, read_mesh_with_shapes};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn rounds() -> usize {
    std::env::var("FABRIG_FUZZ_ROUNDS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(300)
}

const OBJ: &str = "o head\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 1\ng skin\n\
    usemtl m\nf 1/1 2/2 3/1 4/2\nf -4 -3 -1\nf 1//1 2//1 \\\n 3//1\n";

const PLY_HEADER: &str = "ply\nformat FORMAT 1.0\ncomment x\nelement vertex 4\nproperty float x\n\
    property double y\nproperty float z\nelement face 2\n\
    property list uchar int vertex_indices\nend_header\n";

fn ply_text() -> Vec<u8> {
    let header = PLY_HEADER.replace("FORMAT", "ascii");
    format!("{header}0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n").into_bytes()
}

fn ply_binary() -> Vec<u8> {
    let mut bytes = PLY_HEADER
        .replace("FORMAT", "binary_little_endian")
        .into_bytes();
    for (x, y) in [(0f32, 0f64), (1., 0.), (1., 1.), (0., 1.)] {
        bytes.extend(x.to_le_bytes());
        bytes.extend(y.to_le_bytes());
        bytes.extend(0f32.to_le_bytes());
    }
    for face in [&[0i32, 1, 2, 3][..], &[0, 1, 2]] {
        bytes.push(face.len() as u8);
        bytes.extend(face.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

fn stl_binary() -> Vec<u8> {
    let mut bytes = vec![b'x'; 80];
    bytes.extend(2u32.to_le_bytes());
    for k in 0..2 {
        for c in 0..12 {
            bytes.extend(((c * 7 + k) as f32 * 0.25).to_le_bytes());
        }
        bytes.extend([0, 0]);
    }
    bytes
}

const STL: &str = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
    vertex 0 1 0\nendloop\nendfacet\nendsolid s\n";

fn gltf(nodes: &str) -> Vec<u8> {
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
      "nodes":[NODES],
      "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
      "accessors":[
        {"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
        {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
      "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
      "buffers":[{"byteLength":44}]}"#
        .replace("NODES", nodes);
    let mut data: Vec<u8> = [0f32, 0., 0., 1., 0., 0., 0., 1., 0.]
        .iter()
        .flat_map(|c| c.to_le_bytes())
        .collect();
    data.extend([0u16, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    data.extend([0, 0]);
    glb(json, &data)
}

/// A triangle with a dense and a sparse morph target on two primitives.
fn gltf_with_shapes() -> Vec<u8> {
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0,"scale":[1,2,1]}],
      "scenes":[{"nodes":[0]}],
      "meshes":[{"extras":{"targetNames":["jawOpen","hat"]},"primitives":[
        {"attributes":{"POSITION":0},"targets":[{"POSITION":1},{"POSITION":2}]},
        {"attributes":{"POSITION":1},"targets":[{"POSITION":2},{}]}]}],
      "accessors":[
        {"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
        {"bufferView":1,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
        {"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":2,
          "indices":{"bufferView":2,"componentType":5123},"values":{"bufferView":3}}}],
      "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":36},
        {"buffer":0,"byteOffset":72,"byteLength":4},{"buffer":0,"byteOffset":76,"byteLength":24}],
      "buffers":[{"byteLength":100}]}"#;
    let floats = |count: u32| (0..count).flat_map(|c| (c as f32 * 0.5).to_le_bytes());
    let mut data: Vec<u8> = floats(18).collect();
    data.extend([0, 0, 2, 0]);
    data.extend(floats(6));
    glb(json.to_owned(), &data)
}

fn glb(json: String, data: &[u8]) -> Vec<u8> {
    let mut text = json.into_bytes();
    while !text.len().is_multiple_of(4) {
        text.push(b' ');
    }
    let mut glb = b"glTF".to_vec();
    glb.extend(2u32.to_le_bytes());
    glb.extend((12 + 8 + text.len() as u32 + 8 + data.len() as u32).to_le_bytes());
    glb.extend((text.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(text);
    glb.extend((data.len() as u32).to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend_from_slice(data);
    glb
}

const ONE_NODE: &str = r#"{"mesh":0,"children":[1],"scale":[1,2,1]},{"mesh":0}"#;

/// Cuts, flips, doubles, swells numbers, and writes odd ones.
fn mutate(seed: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    const ODD: [&[u8]; 10] = [
        b"nan",
        b"-1",
        b"4294967295",
        b"1e999",
        b"0",
        b"\0\0\xc0\x7f",
        b"\xff\xff\xff\xff",
        b"inf",
        b"\n",
        b"999999999999",
    ];
    let mut bytes = seed.to_vec();
    for _ in 0..rng.random_range(1..4) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..6) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => bytes[at] = rng.random(),
            3 => {
                let end = (at + rng.random_range(1..40)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            4 => {
                let odd = ODD[rng.random_range(0..ODD.len())];
                let end = (at + rng.random_range(0..8)).min(bytes.len());
                bytes.splice(at..end, odd.iter().copied());
            }
            _ => {
                let end = (at + rng.random_range(1..20)).min(bytes.len());
                bytes.drain(at..end);
            }
        }
    }
    bytes
}

fn read(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), MeshIoError> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("written");
    let file = read_mesh_with_shapes(&path)?;
    // Bounded: no more than a file of this size can hold (buffers are the file's own).
    let displacements: usize = file.shapes.iter().map(|s| s.deltas.len()).sum();
    let largest = 2 * bytes.len();
    assert!(file.mesh.vertex_count() <= largest && file.mesh.face_count() <= largest);
    assert!(displacements <= largest);
    assert!(file.shapes.iter().all(|shape| {
        let positions = shape.positions(&file.mesh);
        positions.len() == file.mesh.vertex_count()
            && positions.iter().all(|p| p.iter().all(|c| c.is_finite()))
    }));
    Ok(())
}

#[test]
fn no_mutation_makes_a_reader_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    for (k, (name, seed)) in [
        ("a.obj", OBJ.as_bytes().to_vec()),
        ("a.ply", ply_text()),
        ("b.ply", ply_binary()),
        ("a.stl", stl_binary()),
        ("b.stl", STL.as_bytes().to_vec()),
        ("a.glb", gltf(ONE_NODE)),
        ("b.glb", gltf_with_shapes()),
    ]
    .into_iter()
    .enumerate()
    {
        read(folder.path(), name, &seed).expect("the file itself is whole");
        let mut rng = ChaCha8Rng::seed_from_u64(k as u64);
        let mut refused = 0;
        for _ in 0..rounds() {
            let bytes = mutate(&seed, &mut rng);
            refused += usize::from(read(folder.path(), name, &bytes).is_err());
        }
        assert!(
            refused > rounds() / 10,
            "{name}: only {refused} were refused"
        );
    }
}

#[test]
fn huge_counts_cycles_and_missing_faces_are_typed_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let replaced = |bytes: &[u8], from: &str, to: &str| -> Vec<u8> {
        let at = bytes
            .windows(from.len())
            .position(|w| w == from.as_bytes())
            .expect("there");
        let mut out = bytes.to_vec();
        out.splice(at..at + from.len(), to.bytes());
        out
    };
    let mut stl = stl_binary();
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let cases: Vec<(&str, Vec<u8>)> = vec![
        (
            "c.ply",
            replaced(&ply_text(), "vertex 4", "vertex 4000000000"),
        ),
        (
            "d.ply",
            replaced(&ply_binary(), "vertex 4", "vertex 4000000000000000"),
        ),
        ("e.ply", replaced(&ply_text(), "face 2", "face 0")),
        ("c.stl", stl),
        (
            "c.obj",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4000000000\n".to_vec(),
        ),
        // A node that is its own child, and two that are each other's.
        ("c.glb", gltf(r#"{"mesh":0,"children":[0]}"#)),
        (
            "d.glb",
            gltf(r#"{"mesh":0,"children":[1]},{"children":[0]}"#),
        ),
    ];
    for (name, bytes) in cases {
        let error = read(folder.path(), name, &bytes).expect_err(name);
        assert!(
            matches!(
                error,
                MeshIoError::Malformed { .. }
                    | MeshIoError::Invalid { .. }
                    | MeshIoError::Empty { .. }
                    | MeshIoError::Obj { .. }
            ),
            "{name}: {error}"
        );
    }
}
