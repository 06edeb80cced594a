//! Scene files and models as users write them, good and bad.

use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine;
use hankel_dsl::glam::Vec3;
use hankel_frames::scattering::Scattering;
use hankel_frames::scene::{
    Area, AreaShape, DepthRange, Fit, Geometry, Light, MAX_TRIANGLES, MAX_VERTICES, Medium, Mesh,
    Procedural, Scene, SceneError, Shadow, Source,
};
use hankel_frames::techniques::{DepthBias, Technique};

const LEAST: &str = r#"
[geometry]
procedural = "box"
[camera]
eye = [3, 4, 5]
target = [0, 0, 0]
[light]
direction = [-1, -2, -1]
"#;

fn parse(text: &str) -> Result<Scene, SceneError> {
    Scene::parse(text, Path::new("folder/scene.toml"))
}

fn refused(text: &str) -> String {
    match parse(text) {
        Ok(scene) => panic!("accepted:\n{text}\n{scene:?}"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn the_least_scene_has_the_documented_defaults() {
    let scene = parse(LEAST).unwrap();
    assert_eq!(scene.geometry, Geometry::Procedural(Procedural::Box));
    assert_eq!(scene.camera.up, Vec3::Y);
    assert_eq!(scene.camera.fov, 40.0);
    let [light] = scene.lights[..] else {
        panic!("{:?}", scene.lights);
    };
    assert!((light.direction().length() - 1.0).abs() < 1e-6);
    assert_eq!(light, Light::new(light.source));
    assert_eq!((scene.width, scene.height), (960, 540));
    assert_eq!(scene.shadow, Shadow::default());
    assert_eq!(scene.medium, None);
    let medium = parse(&format!("{LEAST}[medium]\nextinction = 0.1")).unwrap();
    assert_eq!(medium.medium, Some(Medium::default()));
    assert_eq!(scene.shadow.moment_bias, 6e-5);
    let pcf = parse(&format!("{LEAST}[shadow]\ntechnique = 'pcf'")).unwrap();
    assert_eq!(pcf.shadow.depth_bias, DepthBias::COMPARED);
    let hausdorff = parse(&format!("{LEAST}[shadow]\ntechnique = 'hausdorff'")).unwrap();
    assert_eq!(hausdorff.shadow.depth_bias, DepthBias::NONE);
    assert_eq!(hausdorff.shadow.moment_bias, 5.7e-5);
    let unit = parse(&format!("{LEAST}[shadow]\ndepth_range = 'unit'")).unwrap();
    assert_eq!(unit.shadow.moment_bias, 3e-5);
    let float = parse(&format!("{LEAST}[shadow]\nformat = 'rgba32float'")).unwrap();
    assert_eq!(float.shadow.moment_bias, 5e-7);
}

#[test]
fn every_field_is_read() {
    let scene = parse(
        r#"
        [geometry]
        model = "models/a.glb"
        ground = 2.5
        [camera]
        eye = [1.0, 2.0, 3.0]
        target = [0.0, 0.5, 0.0]
        up = [0.0, 0.0, 2.0]
        fov = 55.5
        [light]
        direction = [0.0, -3.0, 0.0]
        strength = 2.5
        colour = [1.0, 0.5, 0.0]
        radius = 0.05
        shape = "square"
        [medium]
        extinction = 0.5
        scattering = 0.25
        anisotropy = -0.3
        technique = "ray-marching"
        steps = 20
        [shadow]
        technique = "hausdorff"
        size = 512
        multisampling = 1
        depth_range = "unit"
        format = "rgba16unorm"
        filter = 9
        fit = "camera"
        samples = [16, 24]
        moment_bias = 1e-4
        depth_bias = 0.001
        leak_cut = 0.1
        mips = true
        anisotropy = 8
        [output]
        width = 320
        height = 200
        "#,
    )
    .unwrap();
    let file = PathBuf::from("folder/models/a.glb");
    let opacity = 1.0;
    assert_eq!(
        scene.geometry,
        Geometry::Model {
            file,
            ground: 2.5,
            opacity
        }
    );
    assert_eq!(scene.camera.up, Vec3::Z);
    let (radius, shape) = (0.05, AreaShape::Square);
    let light = Light {
        source: Source::Directional {
            direction: Vec3::NEG_Y,
        },
        area: Area { radius, shape },
        strength: 2.5,
        colour: Vec3::new(1.0, 0.5, 0.0),
    };
    assert_eq!(scene.lights, [light]);
    assert_eq!(
        scene.medium,
        Some(Medium {
            extinction: 0.5,
            scattering: 0.25,
            anisotropy: -0.3,
            technique: Scattering::named("ray-marching").unwrap(),
            steps: 20,
        })
    );
    let map = Technique::named("hausdorff").unwrap().maps[1];
    let stored = (map.format.name(), map.depth_range);
    assert_eq!(stored, ("rgba16unorm", DepthRange::Unit));
    assert_eq!(
        scene.shadow,
        Shadow {
            technique: Technique::named("hausdorff").unwrap(),
            size: 512,
            multisampling: 1,
            map,
            filter: 9,
            fit: Fit::Camera,
            samples: [16, 24],
            moment_bias: 1e-4,
            depth_bias: DepthBias::Share(0.001),
            leak_cut: 0.1,
            mips: true,
            anisotropy: 8,
        }
    );
    assert_eq!((scene.width, scene.height), (320, 200));
}

/// Another technique changes nothing of what a scene says but biases, and the scene's own nothing at all.
#[test]
fn another_technique_keeps_what_belongs_to_none() {
    let own = parse(&format!(
        "{LEAST}[shadow]\ntechnique = 'hamburger'\nformat = 'rgba32float'\nsize = 512\nmultisampling = 1\n\
         filter = 9\nfit = 'camera'\nsamples = [16, 24]\nmoment_bias = 1e-4\ndepth_bias = 0.001\nleak_cut = 0.1\n\
         mips = true\nanisotropy = 8"
    ))
    .unwrap()
    .shadow;
    assert_eq!(own.by(own.technique, own.map), own);
    assert_eq!(own.by_technique(own.technique), own);
    let pcss = Technique::named("pcss").unwrap();
    let other = own.by_technique(pcss);
    let wanted = Shadow {
        technique: pcss,
        map: pcss.maps[0],
        moment_bias: pcss.maps[0].moment_bias,
        depth_bias: pcss.depth_bias,
        ..own
    };
    assert_eq!(other, wanted);
    assert_eq!((other.samples, other.leak_cut), ([16, 24], 0.1));
    // The bias of moments is for the format that they are in.
    let map = own.technique.maps[0];
    let wanted = Shadow {
        map,
        moment_bias: map.moment_bias,
        ..own
    };
    assert_eq!(own.by(own.technique, map), wanted);
}

#[test]
fn errors_name_the_place_the_field_and_what_is_allowed() {
    let with = |more: &str| format!("{LEAST}{more}");
    let cases: &[(String, &[&str])] = &[
        (
            with("[shadow]\nsize = 0"),
            &["scene.toml:10:8", "`shadow.size` is 0", "16 to 4096"],
        ),
        (with("[shadow]\nsize = -5"), &["`shadow.size` is -5"]),
        (
            with("[shadow]\nsize = 99999999999"),
            &["`shadow.size` is 99999999999"],
        ),
        (
            with("[shadow]\nsize = 'big'"),
            &["scene.toml:10:8", "shadow.size", "string"],
        ),
        (
            with("[shadow]\nfilter = 4"),
            &["`shadow.filter` is 4", "odd"],
        ),
        (
            with("[shadow]\nfilter = 33"),
            &["`shadow.filter` is 33", "1 to 31"],
        ),
        (
            with("[medium]\nextinction = 0"),
            &[
                "scene.toml:10:14",
                "`medium.extinction` is 0",
                "0.000001 to 1000000",
            ],
        ),
        (
            with("[medium]\nscattering = 0.1"),
            &["scene.toml:9:1", "extinction"],
        ),
        (
            with("[medium]\nextinction = 0.2\nscattering = 0.3"),
            &[
                "scene.toml:11:14",
                "`medium.scattering` is 0.3",
                "0 to `medium.extinction`",
                "0.2",
            ],
        ),
        (
            with("[medium]\nextinction = 0.2\nanisotropy = 1.0"),
            &["`medium.anisotropy` is 1", "-0.9 to 0.9"],
        ),
        (
            with("[medium]\nextinction = 0.2\ntechnique = 'fog'"),
            &[
                "`medium.technique` is `fog`",
                "`prefiltered`",
                "`ray-marching`",
            ],
        ),
        (
            with("[medium]\nextinction = 0.2\nsteps = 0"),
            &["`medium.steps` is 0", "1 to 4096"],
        ),
        (
            with("[shadow]\nsamples = [32, 0]"),
            &["scene.toml:10:16", "`shadow.samples` is 0", "1 to 512"],
        ),
        (
            with("[shadow]\nsamples = [32]"),
            &[
                "scene.toml:10:11",
                "`shadow.samples`",
                "2 numbers are wanted, not 1",
            ],
        ),
        (
            with("[shadow]\nsamples = [1, 2, 3, 4]"),
            &[
                "scene.toml:10:11",
                "`shadow.samples`",
                "2 numbers are wanted, not 4",
            ],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\nradius = -0.1"),
            &["`light.radius` is -0.1", "0 to 1"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\nshape = 'star'"),
            &["light.shape", "star", "disc", "square"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\nstrength = -2"),
            &["`light.strength` is -2", "0 to 1000000"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\ncolour = [1, 1, 1.5]"),
            &["`light.colour`", "1.5", "0 to 1", "light.strength"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\nangle = 30"),
            &["`light.angle` is 30", "`position`"],
        ),
        (
            LEAST.replace(
                "[-1, -2, -1]",
                "[-1, -2, -1]\nposition = [0, 2, 0]\nangle = 170",
            ),
            &["`light.angle` is 170", "1 to 150"],
        ),
        (
            LEAST.replace(
                "[-1, -2, -1]",
                "[-1, -2, -1]\nposition = [0, 2, 0]\ninner = 60",
            ),
            &["`light.inner` is 60", "`light.angle`, which is 60"],
        ),
        (
            LEAST.replace(
                "[-1, -2, -1]",
                "[-1, -2, -1]\nposition = [0, 2, 0]\nradius = -0.1",
            ),
            &["`light.radius` is -0.1", "0 to"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\nposition = [0, inf, 0]"),
            &["`light.position`", "finite"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1]\nposition = [0, 2, 0]")
                + "[medium]\nextinction = 0.1\ntechnique = 'prefiltered'",
            &[
                "scene.toml:12:13",
                "`medium.technique` is `prefiltered`",
                "`ray-marching`",
                "`position`",
            ],
        ),
        (
            LEAST.replace("[light]", "[[light]]") + "[[light]]\ndirection = [0, 0, 0]",
            &["scene.toml:10:13", "`light.direction`", "all three"],
        ),
        (
            LEAST.replace("[light]", "[[light]]") + "[[light]]\nbrightness = 3",
            &["light", "brightness"],
        ),
        (
            LEAST.replace("[light]", "[[light]]")
                + &"[[light]]\ndirection = [0, 1, 0]\n".repeat(16),
            &["`light` is 17", "1 to 16"],
        ),
        (
            with("[shadow]\nmoment_bias = nan"),
            &["`shadow.moment_bias` is NaN", "0 to 0.1"],
        ),
        (
            with("[shadow]\ndepth_bias = inf"),
            &["`shadow.depth_bias` is inf"],
        ),
        (
            with("[shadow]\nleak_cut = 1.0"),
            &["`shadow.leak_cut` is 1", "0 to 0.9"],
        ),
        (
            with("[shadow]\nmips = true\nanisotropy = 17"),
            &["`shadow.anisotropy` is 17", "1 to 16"],
        ),
        (
            with("[shadow]\nanisotropy = 4"),
            &["`shadow.anisotropy` is 4", "`mips = true`"],
        ),
        (
            with("[shadow]\ntechnique = 'magic'"),
            &[
                "shadow.technique",
                "`magic`",
                "hamburger",
                "hausdorff",
                "vsm",
                "pcf",
            ],
        ),
        (
            with("[shadow]\nformat = 'rgba8unorm'"),
            &["rgba16unorm", "rgba32float"],
        ),
        (
            with("[shadow]\nformat = 'rgba32float'\ndepth_range = 'unit'"),
            &[
                "scene.toml:11:15",
                "`shadow.depth_range` is `unit`",
                "`symmetric`, for `hamburger` in rgba32float",
            ],
        ),
        (
            with("[shadow]\ntechnique = 'esm'\nformat = 'rgba32float'"),
            &[
                "scene.toml:11:10",
                "`shadow.format` is `rgba32float`",
                "must be `r32float`, for `esm`",
            ],
        ),
        (
            with("[shadow]\ntechnique = 'tmsm'\ndepth_range = 'symmetric'"),
            &["`shadow.depth_range` is `symmetric`", "`unit`, for `tmsm`"],
        ),
        (
            with("[shadow]\nsise = 3"),
            &["scene.toml:10:1", "sise", "size", "filter"],
        ),
        (with("[shade]"), &["shade", "shadow"]),
        (
            with("[output]\nwidth = 0"),
            &["`output.width` is 0", "1 to 4096"],
        ),
        (
            with("[output]\nheight = 10000"),
            &["`output.height` is 10000"],
        ),
        (
            LEAST.replace("[3, 4, 5]", "[0, 0, 0]"),
            &["`camera.target`", "another point"],
        ),
        (
            LEAST.replace("[3, 4, 5]", "[0, 9, 0]"),
            &["`camera.up`", "not along the view"],
        ),
        (
            LEAST.replace("[3, 4, 5]", "[nan, 4, 5]"),
            &["scene.toml:5:7", "`camera.eye`", "finite"],
        ),
        (
            LEAST.replace("[3, 4, 5]", "[3, 4]"),
            &[
                "scene.toml:5:7",
                "`camera.eye`",
                "3 numbers are wanted, not 2",
            ],
        ),
        (
            LEAST.replace("[3, 4, 5]", "3"),
            &["scene.toml:5:7", "`camera.eye`", "3 numbers"],
        ),
        (
            LEAST.replace("[3, 4, 5]", "[3, 4, 1e30]"),
            &["`camera.eye`", "1000000"],
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[0, 0, 0]"),
            &["`light.direction`", "zero"],
        ),
        (
            LEAST.replace("\"box\"", "\"castle\""),
            &["castle", "yard", "box"],
        ),
        (
            LEAST.replace("procedural = \"box\"", ""),
            &["`geometry` is neither", "model"],
        ),
        (
            LEAST.replace("\"box\"", "\"box\"\nmodel = 'a.glb'"),
            &["`geometry` is both"],
        ),
        (
            LEAST.replace("\"box\"", "\"box\"\nground = 2"),
            &["`geometry.ground`", "left out"],
        ),
        (
            LEAST.replace("eye = [3, 4, 5]", "fov = 0.5\neye = [3, 4, 5]"),
            &["`camera.fov` is 0.5"],
        ),
        (
            format!("{LEAST}[shadow]\nmultisampling = 2\n"),
            &["`shadow.multisampling` is 2", "4 or 1"],
        ),
        (LEAST.replace("[light]", ""), &["direction"]),
        ("geometry = ".into(), &["scene.toml:1"]),
        (String::new(), &["geometry"]),
    ];
    for (text, parts) in cases {
        let message = refused(text);
        for part in *parts {
            assert!(
                message.contains(part),
                "`{part}` is not in `{message}`, from\n{text}"
            );
        }
    }
}

#[test]
fn a_table_is_no_array() {
    let camera = "[camera]\neye = [3, 4, 5]\ntarget = [0, 0, 0]\n";
    for (text, table) in [
        (format!("output = [640, 480]\n{LEAST}"), "output"),
        (format!("shadow = [\"pcf\"]\n{LEAST}"), "shadow"),
        (format!("medium = [0.1]\n{LEAST}"), "medium"),
        (
            format!(
                "camera = [[3, 4, 5], [0, 0, 0]]\n{}",
                LEAST.replace(camera, "")
            ),
            "camera",
        ),
    ] {
        let message = refused(&text);
        let words = format!("scene.toml:1:{}: `{table}`: ", table.len() + 4);
        assert!(message.contains(&words), "{message}");
        assert!(message.contains("expected a table"), "{message}");
    }
}

#[test]
fn numbers_beyond_those_that_are_wanted_are_refused() {
    let light = |field: &str| {
        let more = format!("[-1, -2, -1]\n{field} = [1, 1, 1, 1]");
        LEAST.replace("[-1, -2, -1]", &more)
    };
    let cases = [
        (
            LEAST.replace("[3, 4, 5]", "[3, 4, 5, 6, 7]"),
            "scene.toml:5:7: `camera.eye`: 3 numbers are wanted, not 5",
        ),
        (
            LEAST.replace("[3, 4, 5]", "[\n3,\n4,\n5,\n6,\n]"),
            "scene.toml:5:7: `camera.eye`: 3 numbers are wanted, not 4",
        ),
        (
            LEAST.replace("[0, 0, 0]", "[0, 0, 0, 0]"),
            "scene.toml:6:10: `camera.target`: 3 numbers are wanted, not 4",
        ),
        (
            LEAST.replace("[0, 0, 0]", "[0, 0, 0]\nup = [0, 1, 0, 0]"),
            "scene.toml:7:6: `camera.up`: 3 numbers are wanted, not 4",
        ),
        (
            LEAST.replace("[-1, -2, -1]", "[-1, -2, -1, 0]"),
            "scene.toml:8:13: `light.direction`: 3 numbers are wanted, not 4",
        ),
        (
            light("position"),
            "scene.toml:9:12: `light.position`: 3 numbers are wanted, not 4",
        ),
        (
            light("colour"),
            "scene.toml:9:10: `light.colour`: 3 numbers are wanted, not 4",
        ),
        (
            format!("{LEAST}[shadow]\nsamples = [1, 2, 3]"),
            "scene.toml:10:11: `shadow.samples`: 2 numbers are wanted, not 3",
        ),
    ];
    for (text, message) in cases {
        assert_eq!(refused(&text), format!("folder/{message}"), "from\n{text}");
    }
}

#[test]
fn a_missing_file_is_named() {
    let e = Scene::read(Path::new("nowhere/s.toml"))
        .unwrap_err()
        .to_string();
    assert!(e.contains("nowhere/s.toml"), "{e}");
    let scene = parse(&LEAST.replace("procedural = \"box\"", "model = 'none.glb'")).unwrap();
    let e = scene.mesh().unwrap_err().to_string();
    assert!(e.contains("folder/none.glb"), "{e}");
}

/// A glTF document with one buffer of positions and 16-bit indices; `edit` may spoil it.
struct Model {
    folder: tempfile::TempDir,
    json: serde_json::Value,
    buffer: Vec<u8>,
}

impl Model {
    fn new() -> Self {
        let points: [[f32; 3]; 4] = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let indices: [u16; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
        let mut buffer: Vec<u8> = points
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        buffer.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
        let json = serde_json::json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0, 1] }],
            "nodes": [
                { "mesh": 0, "translation": [10.0, 0.0, 0.0] },
                { "children": [2], "scale": [2.0, 2.0, 2.0] },
                { "mesh": 0, "scale": [-1.0, 1.0, 1.0] },
            ],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
            "accessors": [
                {
                    "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                    "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0],
                },
                { "bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR" },
            ],
            "bufferViews": [
                { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
                { "buffer": 0, "byteOffset": 48, "byteLength": 24 },
            ],
            "buffers": [{ "byteLength": 72, "uri": "data%20file.bin" }],
        });
        Self {
            folder: tempfile::tempdir().unwrap(),
            json,
            buffer,
        }
    }

    fn load(&self) -> Result<Mesh, SceneError> {
        fs::write(self.folder.path().join("data file.bin"), &self.buffer).unwrap();
        self.load_bytes(self.json.to_string().as_bytes())
    }

    fn load_bytes(&self, bytes: &[u8]) -> Result<Mesh, SceneError> {
        self.load_on(bytes, 0.0, 1.0)
    }

    /// The same on a ground, and as translucent.
    fn load_on(&self, bytes: &[u8], ground: f32, opacity: f32) -> Result<Mesh, SceneError> {
        let file = self.folder.path().join("m.gltf");
        fs::write(&file, bytes).unwrap();
        let mut scene = parse(LEAST).unwrap();
        scene.geometry = Geometry::Model {
            file,
            ground,
            opacity,
        };
        scene.mesh()
    }

    fn refused(&self) -> String {
        self.load().unwrap_err().to_string()
    }

    fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"][0].as_object_mut().unwrap().remove("uri");
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.buffer.len();
        let word = |n: usize| (n as u32).to_le_bytes();
        [
            b"glTF".as_slice(),
            &word(2),
            &word(length),
            &word(text.len()),
            b"JSON",
            &text,
            &word(self.buffer.len()),
            b"BIN\0",
            &self.buffer,
        ]
        .concat()
    }
}

#[test]
fn a_model_comes_with_its_transforms_and_normals() {
    let model = Model::new();
    let mesh = model.load().unwrap();
    assert_eq!(mesh.triangles.len(), 8);
    let bounds = mesh.bounds().unwrap();
    assert_eq!(bounds.low, Vec3::new(-2.0, 0.0, 0.0));
    assert_eq!(bounds.high, Vec3::new(11.0, 2.0, 2.0));
    // Both tetrahedra face outwards, also the one that a mirror moved.
    for t in 0..8 {
        let [a, b, c] = mesh.corners(t);
        let inside = if a.x >= 5.0 {
            Vec3::new(10.2, 0.2, 0.2)
        } else {
            Vec3::new(-0.4, 0.4, 0.4)
        };
        assert!((b - a).cross(c - a).dot(a - inside) > 0.0, "triangle {t}");
    }
    for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
        let inside = if p.x >= 5.0 {
            Vec3::new(10.2, 0.2, 0.2)
        } else {
            Vec3::new(-0.4, 0.4, 0.4)
        };
        assert!((n.length() - 1.0).abs() < 1e-5 && n.dot(*p - inside) > 0.0);
    }
    assert_eq!(model.load_bytes(&model.glb()).unwrap(), mesh);
    let mut inline = Model::new();
    let text = base64::engine::general_purpose::STANDARD.encode(&model.buffer);
    inline.json["buffers"][0]["uri"] =
        format!("data:application/octet-stream;base64,{text}").into();
    assert_eq!(inline.load().unwrap(), mesh);
}

#[test]
fn bad_models_are_refused_with_the_place() {
    let case = |spoil: &dyn Fn(&mut Model), parts: &[&str]| {
        let mut model = Model::new();
        spoil(&mut model);
        let message = model.refused();
        for part in parts.iter().chain(&["m.gltf"]) {
            assert!(message.contains(part), "`{part}` is not in `{message}`");
        }
    };
    case(
        &|m| m.json["buffers"][0]["uri"] = "gone.bin".into(),
        &["buffer 0", "gone.bin"],
    );
    case(
        &|m| m.json["buffers"][0]["uri"] = "data:;base64,!!".into(),
        &["buffer 0", "base64"],
    );
    case(
        &|m| m.json["buffers"][0]["uri"] = "http://x.org/b".into(),
        &["buffer 0", "only files"],
    );
    case(
        &|m| m.buffer.truncate(50),
        &["buffer 0 has 50 bytes, 72 were announced"],
    );
    case(
        &|m| m.buffer[48] = 200,
        &[
            "mesh 0, primitive 0",
            "index 200 is out of range",
            "4 vertices",
        ],
    );
    case(
        &|m| m.buffer[..4].copy_from_slice(&f32::NAN.to_le_bytes()),
        &["element 0 is not finite"],
    );
    case(
        &|m| m.json["accessors"][0]["count"] = 5.into(),
        &["positions", "buffer view 0"],
    );
    case(
        &|m| m.json["accessors"][0]["byteOffset"] = (u64::MAX / 2).into(),
        &["positions", "buffer view 0"],
    );
    case(
        &|m| m.json["bufferViews"][0]["byteOffset"] = 4000.into(),
        &["buffer view 0"],
    );
    case(
        &|m| m.json["accessors"][1]["count"] = 11.into(),
        &["11 indices"],
    );
    case(
        &|m| m.json["accessors"][0]["type"] = "VEC4".into(),
        &["three 32-bit floats"],
    );
    case(
        &|m| m.json["nodes"][2]["children"] = serde_json::json!([1]),
        &["reached twice"],
    );
    case(
        &|m| m.json["nodes"][0]["mesh"] = 7.into(),
        &["no valid glTF"],
    );
    case(
        &|m| m.json["accessors"] = serde_json::json!([]),
        &["mesh 0", "accessor is missing"],
    );
    case(&|m| m.json["scenes"] = serde_json::json!([]), &["glTF"]);
    case(
        &|m| m.json["scenes"][0]["nodes"] = serde_json::json!([]),
        &["no triangles"],
    );
    case(&|m| m.buffer[..48].fill(0), &["no triangles"]);
    case(
        &|m| m.json["nodes"][0]["scale"] = serde_json::json!([1e8, 1.0, 1.0]),
        &["scale it"],
    );
    case(
        // Too large for f32: the JSON reader refuses it, or reads an infinity that the model refuses.
        &|m| m.json["nodes"][0]["translation"] = serde_json::json!([1e39, 0.0, 0.0]),
        &[],
    );
}

/// A model whose one mesh has 100 000 vertices and four triangles, in so many nodes.
fn of_many_vertices(nodes: usize) -> Model {
    let mut model = Model::new();
    let bytes = 100_000 * 12;
    let points = model.buffer[..48].to_vec();
    model.buffer.extend(points);
    model.buffer.resize(72 + bytes, 0);
    model.json["buffers"][0]["byteLength"] = (72 + bytes).into();
    model.json["bufferViews"][0]["byteOffset"] = 72.into();
    model.json["bufferViews"][0]["byteLength"] = bytes.into();
    model.json["accessors"][0]["count"] = 100_000.into();
    model.json["nodes"] = vec![serde_json::json!({ "mesh": 0 }); nodes].into();
    model.json["scenes"][0]["nodes"] = (0..nodes).collect();
    model
}

#[test]
fn vertices_and_triangles_are_counted_over_all_nodes() {
    let mesh = of_many_vertices(2).load().unwrap();
    assert_eq!(mesh.positions.len(), 200_000);
    assert_eq!(mesh.triangles.len(), 8);
    let mut model = of_many_vertices(3000);
    // The last vertex is bad: it would be found if the mesh was read.
    let end = model.buffer.len();
    model.buffer[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    let message = model.refused();
    for part in [
        "m.gltf",
        "mesh 0 of node",
        &format!("more than {MAX_VERTICES} vertices"),
        "leave nodes out",
    ] {
        assert!(message.contains(part), "`{part}` is not in `{message}`");
    }
    // Two nodes with half of the triangles and one each: neither alone has too many.
    let mut model = Model::new();
    model.json["accessors"][1]["count"] = (3 * (MAX_TRIANGLES / 2 + 1)).into();
    let message = model.refused();
    let part = format!("more than {MAX_TRIANGLES} triangles");
    assert!(message.contains(&part), "{message}");
}

#[test]
fn colours_of_materials_are_from_0_to_1() {
    let load = |factor: serde_json::Value| {
        let mut model = Model::new();
        model.json["materials"] = serde_json::json!([
            {},
            { "pbrMetallicRoughness": { "baseColorFactor": factor } },
        ]);
        model.json["meshes"][0]["primitives"][0]["material"] = 1.into();
        model.load().map_err(|e| e.to_string())
    };
    let mesh = load(serde_json::json!([0.0, 0.25, 1.0, 0.5])).unwrap();
    assert_eq!(mesh.colours[0], Vec3::new(0.0, 0.25, 1.0));
    for (factor, value) in [
        (
            serde_json::json!([-5, 2, 1e30, 1]),
            "[-5.0, 2.0, 1e30, 1.0]",
        ),
        (serde_json::json!([1, 1, 1, 1.5]), "[1.0, 1.0, 1.0, 1.5]"),
    ] {
        let message = load(factor).unwrap_err();
        let of = format!("mesh 0, primitive 0, material 1: its baseColorFactor is {value}");
        for part in ["m.gltf", &of, "from 0 to 1"] {
            assert!(message.contains(part), "`{part}` is not in `{message}`");
        }
    }
    // No 32-bit float: refused by the JSON reader, or as infinite, by how serde_json is built.
    let message = load(serde_json::json!([1e39, 1, 1, 1])).unwrap_err();
    assert!(message.contains("m.gltf"), "{message}");
}

/// The modes of alpha as glTF has them, without textures: opaque materials ignore it, blended ones have it as their
/// opacity, and masked ones are there or not.
#[test]
fn alpha_of_materials_is_opacity() {
    let load = |materials: [serde_json::Value; 2], ground, opacity| {
        let mut model = Model::new();
        model.json["materials"] = materials.into_iter().collect();
        let primitive = model.json["meshes"][0]["primitives"][0].clone();
        let with = |material: u32| {
            let mut primitive = primitive.clone();
            primitive["material"] = material.into();
            primitive
        };
        model.json["meshes"][0]["primitives"] = serde_json::json!([with(0), with(1)]);
        model.json["nodes"] = serde_json::json!([{ "mesh": 0 }]);
        model.json["scenes"][0]["nodes"] = serde_json::json!([0]);
        fs::write(model.folder.path().join("data file.bin"), &model.buffer).unwrap();
        let text = model.json.to_string();
        model.load_on(text.as_bytes(), ground, opacity)
    };
    let material = |alpha: f32, mode: &str, cutoff: Option<f32>| {
        let mut material = serde_json::json!({
            "alphaMode": mode,
            "pbrMetallicRoughness": { "baseColorFactor": [1.0, 1.0, 1.0, alpha] },
        });
        if let Some(cutoff) = cutoff {
            material["alphaCutoff"] = cutoff.into();
        }
        material
    };
    let opaque = || material(0.25, "OPAQUE", None);
    let blended = || material(0.25, "BLEND", None);
    // Four vertices and four triangles each, and two triangles of ground.
    let mesh = load([opaque(), blended()], 0.0, 1.0).unwrap();
    assert_eq!(mesh.all_opacities(), [[1.0; 4], [0.25; 4]].concat());
    assert_eq!((mesh.opaque().len(), mesh.translucent().len()), (4, 4));
    let mesh = load([blended(), opaque()], 2.0, 0.5).unwrap();
    let wanted = [[0.125; 4], [0.5; 4], [1.0; 4]].concat();
    assert_eq!(mesh.all_opacities(), wanted);
    assert_eq!((mesh.opaque().len(), mesh.translucent().len()), (2, 8));
    // A blended material of alpha 1 is as an opaque one.
    let mesh = load([material(1.0, "BLEND", None), opaque()], 0.0, 1.0).unwrap();
    assert!(mesh.translucent().is_empty());
    for (masked, count) in [
        (material(0.5, "MASK", None), 8),
        (material(0.49, "MASK", None), 4),
        (material(0.49, "MASK", Some(0.3)), 8),
        (material(1.0, "MASK", Some(1.1)), 4),
    ] {
        let mesh = load([opaque(), masked], 0.0, 1.0).unwrap();
        assert_eq!(mesh.opaque().len(), count);
        assert!(mesh.translucent().is_empty());
    }
    // With nothing opaque there is nothing to see a shadow on.
    let message = load([blended(), blended()], 0.0, 1.0).unwrap_err();
    let message = message.to_string();
    assert!(
        message.contains("m.gltf") && message.contains("`ground`"),
        "{message}"
    );
    assert!(load([blended(), blended()], 2.0, 1.0).is_ok());
    let hidden = || material(0.1, "MASK", None);
    assert!(load([hidden(), hidden()], 0.0, 1.0).is_err());
}

#[test]
fn a_truncated_model_is_refused_wherever_it_ends() {
    let model = Model::new();
    let whole = model.glb();
    assert!(model.load_bytes(&whole).is_ok());
    for length in (0..whole.len()).step_by(7).chain([4, 8, 11, 12, 20]) {
        assert!(
            model.load_bytes(&whole[..length]).is_err(),
            "{length} bytes"
        );
    }
    for at in 0..whole.len() {
        let mut spoilt = whole.clone();
        spoilt[at] ^= 0x55;
        // Some bytes may change without harm; none may end the program.
        let _ = model.load_bytes(&spoilt);
    }
}
