//! Scene files and models.

use std::path::Path;
use std::time::{Duration, Instant};

use bolero::check;
use hankel_frames::scene::{Geometry, Scene};

use crate::damage::{Damage, keep, says, time};

const SCENES: [&str; 2] = [
    include_str!("../../../scenes/scan.toml"),
    include_str!("../../../scenes/hard.toml"),
];

/// A triangle and a strip, with everything that the reader looks at.
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
"nodes":[{"mesh":0,"translation":[1,2,3],"rotation":[0,0,0,1],"scale":[1,1,2]},
{"mesh":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}],
"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1]}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1},"indices":2,"material":0}]},
{"primitives":[{"attributes":{"POSITION":0},"mode":5}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
"buffers":[{"byteLength":42BUFFER}]}"#;

/// 42 bytes: three points and three indices.
fn buffer() -> Vec<u8> {
    let points = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]];
    let mut bytes: Vec<u8> = points
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    bytes.extend([0, 0, 1, 0, 2, 0]);
    bytes
}

fn glb() -> Vec<u8> {
    let mut json = GLTF.replace("BUFFER", "").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut data = buffer();
    data.resize(data.len().next_multiple_of(4), 0);
    let length = (12 + 8 + json.len() + 8 + data.len()) as u32;
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend(length.to_le_bytes());
    for (kind, part) in [(b"JSON", &json), (b"BIN\0", &data)] {
        bytes.extend((part.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(part);
    }
    bytes
}

#[test]
fn scenes() {
    check!()
        .with_type::<Damage>()
        .with_test_time(time())
        .for_each(|damage| {
            let (_, bytes) = damage.of(&SCENES);
            keep("scene", &bytes);
            let Ok(text) = std::str::from_utf8(&bytes) else {
                return;
            };
            if let Err(error) = Scene::parse(text, Path::new("scene.toml")) {
                assert!(error.to_string().starts_with("scene.toml:"), "{error}");
                says(&error);
            }
        });
}

#[test]
fn models() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("b.bin"), buffer()).expect("the folder can be written");
    let files = [
        GLTF.replace("BUFFER", r#","uri":"b.bin""#).into_bytes(),
        glb(),
    ];
    let scene = Scene::parse(SCENES[1], &folder.path().join("scene.toml")).expect("a scene");
    let file = folder.path().join("model");
    for whole in &files {
        std::fs::write(&file, whole).expect("the folder can be written");
        let geometry = Geometry::Model {
            file: file.clone(),
            ground: 1.0,
            opacity: 1.0,
        };
        Scene {
            geometry,
            ..scene.clone()
        }
        .mesh()
        .unwrap_or_else(|e| panic!("{e}"));
    }
    check!()
        .with_type::<Damage>()
        .with_test_time(time())
        .for_each(|damage| {
            let (_, bytes) = damage.of(&files);
            keep("model", &bytes);
            std::fs::write(&file, &bytes).expect("the folder can be written");
            let geometry = Geometry::Model {
                file: file.clone(),
                ground: 1.0,
                opacity: 1.0,
            };
            let began = Instant::now();
            if let Err(error) = (Scene {
                geometry,
                ..scene.clone()
            })
            .mesh()
            {
                says(&error);
            }
            assert!(
                began.elapsed() < Duration::from_secs(5),
                "{:?}",
                began.elapsed()
            );
        });
}
