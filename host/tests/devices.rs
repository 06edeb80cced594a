//! Both devices do the same with the same kernels, and refuse the same mistakes. Without a Vulkan
//! driver these tests fail, with the message that says how to get one.

mod common;

use common::*;
use hankel_dsl::native::describe::*;
use hankel_dsl::native::{Address, Filter, Sampler};
use hankel_host::device::{
    Bind, Blend, Colour, Cull, Depth, DepthTest, Device, DeviceError, Draw, NativeDevice, Pass,
    Program, Shader, TextureShape, Topology, VulkanDevice,
};

const NEAREST: Sampler = Sampler::new(Filter::Nearest, Address::ClampToEdge);

fn bytes<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

fn f32s(bytes: &[u8]) -> Vec<f32> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// Runs `affine` over `pairs`.
fn affine_on(device: &mut dyn Device, program: &Program<'_>, pairs: &[f32]) -> Vec<f32> {
    let input = device.buffer_from("pairs", &bytes(pairs)).unwrap();
    let out = device.buffer("out", pairs.len() / 2 * 4).unwrap();
    let settings = bytes(&[3.0f32, -0.1]);
    device
        .dispatch(
            program,
            &[
                Bind::Bytes(&settings),
                Bind::Buffer(input),
                Bind::Buffer(out),
            ],
        )
        .unwrap();
    let result = f32s(&device.read_buffer(out).unwrap());
    device.free_buffer(input).unwrap();
    device.free_buffer(out).unwrap();
    result
}

/// Draws are what lavapipe's timestamps are right for.
#[test]
fn draws_are_timed_by_timestamps() {
    let mut gpu = vulkan();
    let shape = TextureShape::d2(512, 512, TexelFormat::Rgba8Unorm);
    let target = gpu.texture("target", &shape).unwrap();
    let colours = [Colour {
        texture: target,
        resolve: None,
        clear: Some([1.0; 4]),
        blend: Blend::Off,
    }];
    let pass = Pass {
        label: "clear",
        colours: &colours,
        depth: None,
        draws: &[],
    };
    assert!(!NativeDevice::new().begin_clock().unwrap());
    gpu.time_by_timestamps();
    if !gpu.has_timestamps() {
        assert!(!gpu.begin_clock().unwrap());
        return;
    }
    gpu.draw(&pass).unwrap();
    assert_eq!(gpu.laps(), 0, "no clock runs");
    for passes in [0, 1, 3] {
        let start = std::time::Instant::now();
        assert!(gpu.begin_clock().unwrap());
        for _ in 0..passes {
            gpu.draw(&pass).unwrap();
        }
        assert_eq!(gpu.laps(), passes);
        let times = gpu.end_clock().unwrap();
        let wall = start.elapsed().as_secs_f64();
        assert_eq!(times.len(), passes);
        assert!(times.iter().all(|it| *it > 0.0), "{times:?}");
        assert!(times.iter().sum::<f64>() <= wall, "{times:?} in {wall} s");
    }
    // More than there is room for: the rest has no time, and nothing fails.
    assert!(gpu.begin_clock().unwrap());
    for _ in 0..3000 {
        gpu.draw(&pass).unwrap();
    }
    assert!((1000..3000).contains(&gpu.laps()));
    assert_eq!(gpu.laps(), gpu.end_clock().unwrap().len());
}

#[test]
fn a_map_gives_the_same_bits_every_way() {
    let kernel = affine();
    let pairs: Vec<f32> = (0..2000)
        .map(|i| (i as f32 * 0.37).sin() * 1e3 + 1.5)
        .collect();
    let expected = affine_on(&mut NativeDevice::new(), &kernel.program(Way::Wgsl), &pairs);
    assert_eq!(expected[3], (pairs[6] * 3.0 - 0.1) / pairs[7]);
    let mut gpu = vulkan();
    for way in WAYS {
        let got = affine_on(&mut gpu, &kernel.program(way), &pairs);
        let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&got), bits(&expected), "{way:?}");
    }
}

#[test]
fn doubles_run_on_both() {
    let kernel = double();
    let x: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.1).collect();
    let table = bytes(&[1e-9f64, 2.0, -3.5]);
    let mut results = Vec::new();
    let run = |device: &mut dyn Device, way: Way| {
        let out = device.buffer("out", 800).unwrap();
        device
            .dispatch(
                &kernel.program(way),
                &[
                    Bind::Bytes(&bytes(&x)),
                    Bind::Bytes(&table),
                    Bind::Buffer(out),
                ],
            )
            .unwrap();
        device.read_buffer(out).unwrap()
    };
    results.push(run(&mut NativeDevice::new(), Way::Wgsl));
    let mut gpu = vulkan();
    results.extend(WAYS.map(|way| run(&mut gpu, way)));
    assert!(results.iter().all(|r| *r == results[0]));
    assert_eq!(
        bytemuck::pod_collect_to_vec::<u8, f64>(&results[0])[4],
        0.4f64.sqrt() + 2.0
    );
}

#[test]
fn constants_reach_every_kind_of_code_but_wgsl() {
    let kernel = mixed();
    let settings = bytes(&[0.0f64, 1.0]);
    let mut row = bytes(&[6.0f64]);
    row.extend(bytes(&[2u32, 0]));
    let run = |device: &mut dyn Device, way: Way, constants: &[u32]| {
        let out = device.buffer("out", 24)?;
        let program = Program {
            constants,
            ..kernel.program(way)
        };
        let args = [Bind::Bytes(&settings), Bind::Bytes(&row), Bind::Buffer(out)];
        device.dispatch(&program, &args)?;
        let bytes = device.read_buffer(out)?;
        Ok::<f64, DeviceError>(bytemuck::pod_read_unaligned(&bytes[..8]))
    };
    let mut gpu = vulkan();
    for (constants, expected) in [(&[][..], 3.0), (&[0], 3.0), (&[1], 2.0), (&[10], 0.5)] {
        assert_eq!(
            run(&mut NativeDevice::new(), Way::Wgsl, constants).unwrap(),
            expected
        );
        for way in [Way::Passthrough, Way::Naga] {
            assert_eq!(run(&mut gpu, way, constants).unwrap(), expected, "{way:?}");
        }
    }
    assert_eq!(run(&mut gpu, Way::Wgsl, &[0]).unwrap(), 3.0);
    let text = run(&mut gpu, Way::Wgsl, &[1]).unwrap_err().to_string();
    assert!(
        text.contains("`mixed_f64`") && text.contains("part of its WGSL"),
        "{text}"
    );
}

#[test]
fn atomics_and_workgroups_run_on_both() {
    let values: Vec<u32> = (0..1000u32)
        .map(|i| i.wrapping_mul(2_654_435_761) >> 7)
        .collect();
    let (bins, sums) = (histogram(), sums());
    let mut results = Vec::new();
    let mut run = |device: &mut dyn Device, way: Way| {
        let input = device.buffer_from("values", &bytes(&values)).unwrap();
        let counts = device.buffer_from("counts", &bytes(&[5u32; 16])).unwrap();
        let out = device.buffer("out", 1000usize.div_ceil(64) * 4).unwrap();
        device
            .dispatch(
                &bins.program(way),
                &[Bind::Buffer(input), Bind::Buffer(counts)],
            )
            .unwrap();
        device
            .dispatch(
                &sums.program(way),
                &[Bind::Buffer(input), Bind::Buffer(out)],
            )
            .unwrap();
        results.push((
            device.read_buffer(counts).unwrap(),
            device.read_buffer(out).unwrap(),
        ));
    };
    run(&mut NativeDevice::new(), Way::Wgsl);
    let mut gpu = vulkan();
    for way in WAYS {
        run(&mut gpu, way);
    }
    assert!(results.iter().all(|r| *r == results[0]));
    let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&results[0].0);
    assert_eq!(counts.iter().sum::<u32>(), 1000 + 16 * 5);
}

#[test]
fn textures_run_on_both() {
    let kernel = image();
    let samples: Vec<f32> = (0..12 * 9 * 4).map(|i| i as f32 / 450.0).collect();
    let volume: Vec<u8> = (0..32).map(|i| i * 8 + 3).collect();
    let mut results = Vec::new();
    let mut run = |device: &mut dyn Device, way: Way| {
        let shape = TextureShape::d2(12, 9, TexelFormat::R32Float).multisampled(4);
        let ms = device
            .texture_from("samples", &shape, &bytes(&samples))
            .unwrap();
        assert_eq!(device.read_texture(ms).unwrap(), bytes(&samples));
        let shape = TextureShape::d3([2, 2, 2], TexelFormat::Rgba8Unorm);
        let cube = device.texture_from("volume", &shape, &volume).unwrap();
        assert_eq!(device.read_texture(cube).unwrap(), volume);
        let out = device
            .texture("out", &TextureShape::d2(12, 9, TexelFormat::Rgba16Unorm))
            .unwrap();
        let args = [
            Bind::Texture(ms),
            Bind::Texture(cube),
            Bind::Sampler(NEAREST),
            Bind::Texture(out),
        ];
        device.dispatch(&kernel.program(way), &args).unwrap();
        results.push(device.read_texture(out).unwrap());
    };
    run(&mut NativeDevice::new(), Way::Wgsl);
    let mut gpu = vulkan();
    for way in WAYS {
        run(&mut gpu, way);
    }
    assert!(results.iter().all(|r| *r == results[0]));
    assert!(results[0].iter().any(|&b| b != 0));
}

#[test]
fn levels_layers_and_depths_come_back_as_they_were_written() {
    let shapes = [
        TextureShape::d1(19, TexelFormat::R32Float),
        TextureShape::d2(12, 9, TexelFormat::R32Float).with_levels(4),
        TextureShape::d2(7, 7, TexelFormat::R32Float)
            .with_levels(3)
            .with_layers(6),
        TextureShape::d3([6, 5, 4], TexelFormat::R32Float).with_levels(2),
        TextureShape::depth(6, 5).with_levels(2).with_layers(3),
    ];
    for device in [&mut NativeDevice::new() as &mut dyn Device, &mut vulkan()] {
        for shape in &shapes {
            let count = shape.bytes() / 4;
            let texels: Vec<f32> = (0..count).map(|i| i as f32 / count as f32).collect();
            let id = device.texture_from("t", shape, &bytes(&texels)).unwrap();
            assert_eq!(
                device.read_texture(id).unwrap(),
                bytes(&texels),
                "{shape:?}"
            );
        }
    }
    let refused = |shape: TextureShape, words: &str| {
        for text in refusals(|d| d.texture("t", &shape).map(|_| ())) {
            assert!(text.contains(words), "{text}");
        }
    };
    let flat = TextureShape::d2(12, 9, TexelFormat::R32Float);
    refused(flat.with_levels(5), "its size has 1 to 4");
    refused(flat.with_layers(0), "0 layers");
    refused(flat.multisampled(4).with_levels(2), "several samples and");
    let volume = TextureShape::d3([2, 2, 2], TexelFormat::R32Float);
    refused(volume.with_layers(6), "6 layers in 3 dimensions");
    let mut gpu = vulkan();
    let depth = gpu.texture("d", &TextureShape::depth(1, 1)).unwrap();
    let error = gpu.write_texture(depth, &bytes(&[1.5_f32])).unwrap_err();
    assert!(error.to_string().contains("between 0 and 1"), "{error}");
}

/// A triangle over the whole target, and one over its left half, in front.
fn draw_two(gpu: &mut dyn Device, way: Way, samples: u32) -> (Vec<f32>, Vec<f32>) {
    let (place, tint) = (place(), tint());
    let corner = |x: f32, z: f32| [-1.0, -1.0, z, x, -1.0, z, -1.0, x, z];
    let back = gpu.buffer_from("back", &bytes(&corner(3.0, 0.75))).unwrap();
    let front = gpu
        .buffer_from("front", &bytes(&corner(1.0, 0.25)))
        .unwrap();
    let red = gpu
        .buffer_from("red", &bytes(&[1.0f32, 0.0, 0.0, 1.0].repeat(3)))
        .unwrap();
    let blue = gpu
        .buffer_from("blue", &bytes(&[0.0f32, 0.0, 1.0, 1.0].repeat(3)))
        .unwrap();
    let indices = gpu.buffer_from("indices", &bytes(&[0u32, 1, 2])).unwrap();
    let flat = TextureShape::d2(8, 8, TexelFormat::Rgba32Float);
    let single = gpu.texture("single", &flat).unwrap();
    let many = gpu
        .texture(
            "colour",
            &TextureShape::d2(8, 8, TexelFormat::Rgba16Float).multisampled(samples),
        )
        .unwrap();
    let resolved = gpu
        .texture(
            "resolved",
            &TextureShape::d2(8, 8, TexelFormat::Rgba16Float),
        )
        .unwrap();
    let depth = gpu
        .texture("depth", &TextureShape::depth(8, 8).multisampled(samples))
        .unwrap();
    let (zero, half) = (bytes(&[0.0f32]), bytes(&[0.5f32]));
    let draw = |position, colour, indices| {
        [
            Bind::Bytes(&zero),
            Bind::Buffer(position),
            Bind::Buffer(colour),
        ]
        .map(|b| (b, indices))
    };
    let front_args = draw(front, blue, ()).map(|(b, ())| b);
    let back_args = draw(back, red, ()).map(|(b, ())| b);
    let fragment_args = [Bind::Bytes(&half)];
    let call = |vertex_args, indices| Draw {
        vertex: place.program(way),
        vertex_args,
        fragment: Some(tint.program(way)),
        fragment_args: &fragment_args,
        indices,
        count: 3,
        topology: Topology::Triangles,
        cull: Cull::Back,
    };
    // The nearer triangle is drawn first: only the depth buffer keeps it.
    let draws = [
        call(&front_args[..], None),
        call(&back_args[..], Some(indices)),
    ];
    let colour = if samples == 1 {
        Colour {
            texture: single,
            resolve: None,
            clear: Some([0.0; 4]),
            blend: Blend::Off,
        }
    } else {
        Colour {
            texture: many,
            resolve: Some(resolved),
            clear: Some([0.0; 4]),
            blend: Blend::Off,
        }
    };
    gpu.draw(&Pass {
        label: "two triangles",
        colours: &[colour],
        depth: Some(Depth {
            texture: depth,
            clear: Some(1.0),
            test: DepthTest::Less,
            write: true,
        }),
        draws: &draws,
    })
    .unwrap();
    let texels = if samples == 1 {
        f32s(&gpu.read_texture(single).unwrap())
    } else {
        let bytes = gpu.read_texture(resolved).unwrap();
        bytes
            .chunks(8)
            .flat_map(|t| TexelFormat::Rgba16Float.load(t).to_array())
            .collect()
    };
    (texels, f32s(&gpu.read_texture(depth).unwrap()))
}

#[test]
fn triangles_are_drawn_with_depth_samples_and_both_descriptor_sets() {
    let mut gpu = vulkan();
    for way in WAYS {
        let (texels, depth) = draw_two(&mut gpu, way, 1);
        // Bottom left is the nearer, blue; top right the farther, red. Row 0 is the top.
        let at = |x: usize, y: usize| &texels[(y * 8 + x) * 4..][..4];
        assert_eq!(at(0, 7), [0.0, 0.0, 1.0, 1.0], "{way:?}");
        assert_eq!(at(7, 0), [1.0, 0.0, 0.0, 1.0], "{way:?}");
        assert_eq!((depth[7 * 8], depth[7]), (0.25, 0.75), "{way:?}");
        let (texels, depth) = draw_two(&mut gpu, way, 4);
        assert_eq!(depth.len(), 8 * 8 * 4);
        // The edge runs through the pixels of the diagonal: a mean of the two.
        let edge = &texels[(3 * 8 + 3) * 4..][..4];
        assert!(
            edge[0] > 0.0 && edge[2] > 0.0 && edge[0] + edge[2] == 1.0,
            "{way:?} {edge:?}"
        );
    }
}

#[test]
fn stages_run_natively_over_arrays() {
    let mut cpu = NativeDevice::new();
    let (place, tint) = (place(), tint());
    let (at, varying) = (
        cpu.buffer("at", 32).unwrap(),
        cpu.buffer("varying", 32).unwrap(),
    );
    let positions = bytes(&[1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let colours = bytes(&[1.0f32; 8]);
    let shift = bytes(&[0.5f32]);
    cpu.dispatch(
        &place.program(Way::Wgsl),
        &[
            Bind::Bytes(&shift),
            Bind::Bytes(&positions),
            Bind::Bytes(&colours),
            Bind::Buffer(at),
            Bind::Buffer(varying),
        ],
    )
    .unwrap();
    let out = cpu.buffer("out", 32).unwrap();
    cpu.dispatch(
        &tint.program(Way::Wgsl),
        &[
            Bind::Bytes(&shift),
            Bind::Buffer(varying),
            Bind::Buffer(out),
        ],
    )
    .unwrap();
    assert_eq!(
        f32s(&cpu.read_buffer(at).unwrap()),
        [1.5, 2.0, 3.0, 1.0, 4.5, 5.0, 6.0, 1.0]
    );
    assert_eq!(f32s(&cpu.read_buffer(out).unwrap()), [1.0; 8]);
    let error = cpu.draw(&Pass {
        label: "none",
        colours: &[],
        depth: None,
        draws: &[],
    });
    assert!(error.unwrap_err().to_string().contains("no rasteriser"));
}

/// What both devices say to a call of `affine` with these arguments.
fn refusals(make: impl Fn(&mut dyn Device) -> Result<(), DeviceError>) -> Vec<String> {
    let devices: [Box<dyn Device>; 2] = [Box::new(NativeDevice::new()), Box::new(vulkan())];
    devices
        .into_iter()
        .map(|mut d| make(d.as_mut()).unwrap_err().to_string())
        .collect()
}

#[test]
fn wrong_arguments_are_named_before_anything_runs() {
    let kernel = affine();
    let program = kernel.program(Way::Wgsl);
    let settings = bytes(&[1.0f32, 2.0]);
    let pairs = bytes(&[1.0f32; 8]);
    let check = |words: &[&str], make: &dyn Fn(&mut dyn Device) -> Result<(), DeviceError>| {
        for text in refusals(make) {
            assert!(text.contains("`affine`"), "{text}");
            for word in words {
                assert!(text.contains(word), "{text} lacks {word}");
            }
        }
    };
    check(
        &["3 arguments (settings, pair, output)", "1 were given"],
        &|d| d.dispatch(&program, &[Bind::Bytes(&settings)]),
    );
    check(
        &["`settings` (binding 0)", "4 bytes", "`Settings` has 8"],
        &|d| {
            let out = d.buffer("out", 4)?;
            d.dispatch(
                &program,
                &[Bind::Bytes(&[0; 4]), Bind::Bytes(&pairs), Bind::Buffer(out)],
            )
        },
    );
    check(
        &["`pair` (binding 1)", "12 bytes are no whole number"],
        &|d| {
            let out = d.buffer("out", 4)?;
            d.dispatch(
                &program,
                &[
                    Bind::Bytes(&settings),
                    Bind::Bytes(&pairs[..12]),
                    Bind::Buffer(out),
                ],
            )
        },
    );
    check(
        &["`pair` (binding 1)", "4 elements, but 5 invocations"],
        &|d| {
            let out = d.buffer("out", 20)?;
            d.dispatch(
                &program,
                &[
                    Bind::Bytes(&settings),
                    Bind::Bytes(&pairs),
                    Bind::Buffer(out),
                ],
            )
        },
    );
    check(&["`output` (binding 2)", "must be a buffer"], &|d| {
        let args = [
            Bind::Bytes(&settings),
            Bind::Bytes(&pairs),
            Bind::Bytes(&[0; 4]),
        ];
        d.dispatch(&program, &args)
    });
    check(&["`pair` (binding 1)", "must be a buffer or bytes"], &|d| {
        let out = d.buffer("out", 4)?;
        let args = [
            Bind::Bytes(&settings),
            Bind::Sampler(NEAREST),
            Bind::Buffer(out),
        ];
        d.dispatch(&program, &args)
    });
    check(&["`output` (binding 2)", "also given as `pair`"], &|d| {
        let both = d.buffer("both", 16)?;
        let args = [
            Bind::Bytes(&settings),
            Bind::Buffer(both),
            Bind::Buffer(both),
        ];
        d.dispatch(&program, &args)
    });
    check(&["0 constants", "2 were given"], &|d| {
        let out = d.buffer("out", 4)?;
        let args = [
            Bind::Bytes(&settings),
            Bind::Bytes(&pairs),
            Bind::Buffer(out),
        ];
        d.dispatch(
            &Program {
                constants: &[1, 2],
                ..program
            },
            &args,
        )
    });
}

#[test]
fn textures_of_another_shape_are_refused() {
    let kernel = image();
    let program = kernel.program(Way::Wgsl);
    let try_with = |samples: u32, dimensions: u32, format: TexelFormat| {
        refusals(|d| {
            let shape = TextureShape::d2(4, 4, TexelFormat::R32Float).multisampled(samples);
            let ms = d.texture("ms", &shape)?;
            let shape = if dimensions == 3 {
                TextureShape::d3([2, 2, 2], TexelFormat::Rgba8Unorm)
            } else {
                TextureShape::d2(2, 2, TexelFormat::Rgba8Unorm)
            };
            let volume = d.texture("volume", &shape)?;
            let out = d.texture("out", &TextureShape::d2(4, 4, format))?;
            d.dispatch(
                &program,
                &[
                    Bind::Texture(ms),
                    Bind::Texture(volume),
                    Bind::Sampler(NEAREST),
                    Bind::Texture(out),
                ],
            )
        })
    };
    for (texts, words) in [
        (
            try_with(1, 3, TexelFormat::Rgba16Unorm),
            ["`samples` (binding 0)", "one sample"],
        ),
        (
            try_with(4, 2, TexelFormat::Rgba16Unorm),
            ["`volume` (binding 1)", "2 dimensions, not 3"],
        ),
        (
            try_with(4, 3, TexelFormat::Rgba32Float),
            [
                "`output` (binding 3)",
                "rgba32float, but the kernel writes rgba16unorm",
            ],
        ),
    ] {
        for text in texts {
            assert!(words.iter().all(|w| text.contains(w)), "{text}");
        }
    }
}

#[test]
fn stale_and_foreign_handles_are_refused() {
    for mut device in [
        Box::new(NativeDevice::new()) as Box<dyn Device>,
        Box::new(vulkan()),
    ] {
        let buffer = device.buffer("b", 16).unwrap();
        let foreign = NativeDevice::new().buffer("other", 16).unwrap();
        assert!(matches!(
            device.read_buffer(foreign),
            Err(DeviceError::Handle { .. })
        ));
        let long = device
            .write_buffer(buffer, &[0; 17])
            .unwrap_err()
            .to_string();
        assert!(
            long.contains("17 bytes were given, but it has 16"),
            "{long}"
        );
        device.free_buffer(buffer).unwrap();
        assert!(matches!(
            device.read_buffer(buffer),
            Err(DeviceError::Handle { .. })
        ));
        let shape = TextureShape::d2(4, 4, TexelFormat::R32Float).multisampled(3);
        assert!(
            device
                .texture("odd", &shape)
                .unwrap_err()
                .to_string()
                .contains("1 or 4")
        );
        let shape = TextureShape::d2(0, 4, TexelFormat::R32Float);
        assert!(device.texture("empty", &shape).is_err());
    }
}

#[test]
fn buffers_of_odd_sizes_come_back_whole() {
    for mut device in [
        Box::new(NativeDevice::new()) as Box<dyn Device>,
        Box::new(vulkan()),
    ] {
        for n in [0usize, 1, 3, 5, 17] {
            let content: Vec<u8> = (1..=n as u8).collect();
            let b = device.buffer_from("odd", &content).unwrap();
            assert_eq!(device.read_buffer(b).unwrap(), content);
        }
    }
}

#[test]
fn too_much_is_refused_with_the_limit() {
    let mut gpu = vulkan();
    let wide = TextureShape::d2(1 << 20, 1, TexelFormat::R32Float);
    let text = gpu.texture("wide", &wide).unwrap_err().to_string();
    assert!(
        text.contains("width of texture `wide`") && text.contains("1048576"),
        "{text}"
    );
    let kernel = affine();
    let most = gpu.max_storage_bytes();
    if let Ok(big) = usize::try_from(most + 8)
        && most <= 1 << 28
    {
        let input = gpu.buffer("big", big).unwrap();
        let out = gpu.buffer("out", 4).unwrap();
        let settings = bytes(&[1.0f32, 0.0]);
        let args = [
            Bind::Bytes(&settings),
            Bind::Buffer(input),
            Bind::Buffer(out),
        ];
        let error = gpu.dispatch(&kernel.program(Way::Wgsl), &args).unwrap_err();
        assert!(matches!(error, DeviceError::Limit { .. }), "{error}");
        let text = error.to_string();
        assert!(
            text.contains("`affine`") && text.contains("`pair` (binding 1)"),
            "{text}"
        );
    }
}

#[test]
fn bad_code_is_refused_with_the_kernels_name() {
    let kernel = affine();
    let mut gpu = vulkan();
    let settings = bytes(&[1.0f32, 0.0]);
    let pairs = bytes(&[1.0f32; 2]);
    let mut refuse = |shader: Option<Shader<'_>>| {
        let out = gpu.buffer("out", 4).unwrap();
        let program = Program {
            shader,
            ..kernel.program(Way::Wgsl)
        };
        let args = [
            Bind::Bytes(&settings),
            Bind::Bytes(&pairs),
            Bind::Buffer(out),
        ];
        let text = gpu.dispatch(&program, &args).unwrap_err().to_string();
        assert!(text.contains("`affine`"), "{text}");
        text
    };
    assert!(refuse(None).contains("without a shader"));
    let text = refuse(Some(Shader::Wgsl {
        text: "fn oops(",
        entry_point: "affine",
    }));
    assert!(text.contains("loading kernel"), "{text}");
    let text = refuse(Some(Shader::Wgsl {
        text: &kernel.wgsl,
        entry_point: "other",
    }));
    assert!(text.contains("other"), "{text}");
    // Another kernel's module under this one's name.
    let other = double();
    for shader in [
        Shader::SpirvPassthrough(&other.spirv),
        Shader::SpirvThroughNaga(&other.spirv),
    ] {
        assert!(refuse(Some(shader)).contains("affine"));
    }
    let cut = &kernel.spirv[..kernel.spirv.len() / 2 + 1];
    for words in [cut, &[][..], &[0x0723_0203, 1, 2, 3, 4, 0][..]] {
        refuse(Some(Shader::SpirvPassthrough(words)));
        refuse(Some(Shader::SpirvThroughNaga(words)));
    }
    // A binding that the description does not have.
    let moved = kernel.wgsl.replace("@binding(2)", "@binding(9)");
    let words = spirv(&moved);
    assert!(refuse(Some(Shader::SpirvPassthrough(&words))).contains("binds 9"));
    refuse(Some(Shader::SpirvThroughNaga(&words)));
    // The device still works.
    assert_eq!(
        affine_on(&mut gpu, &kernel.program(Way::Naga), &[2.0, 4.0]),
        [1.475]
    );
}

/// What naga writes lets a driver reorder.
#[test]
fn an_exact_kernel_runs_as_untouched_spirv_alone() {
    let mut kernel = affine();
    kernel.kernel.rounding = Rounding::Exact;
    let mut gpu = vulkan();
    let program = kernel.program(Way::Passthrough);
    assert_eq!(affine_on(&mut gpu, &program, &[2.0, 4.0]), [1.475]);
    for way in [Way::Naga, Way::Wgsl] {
        let out = gpu.buffer("out", 4).unwrap();
        let (settings, pairs) = (bytes(&[3.0f32, -0.1]), bytes(&[2.0f32, 4.0]));
        let args = [
            Bind::Bytes(&settings),
            Bind::Bytes(&pairs),
            Bind::Buffer(out),
        ];
        let error = gpu.dispatch(&kernel.program(way), &args).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("`affine`") && text.contains("only untouched SPIR-V"),
            "{text}"
        );
    }
}

#[test]
fn a_lost_device_says_so() {
    let mut gpu = vulkan();
    let buffer = gpu.buffer("b", 16).unwrap();
    gpu.destroy();
    let error = gpu.read_buffer(buffer).unwrap_err();
    assert!(matches!(error, DeviceError::Lost { .. }), "{error}");
    assert!(matches!(gpu.buffer("c", 16), Err(DeviceError::Lost { .. })));
}

/// Set in the child process of the test below.
const WITHOUT_DRIVER: &str = "HANKEL_TEST_WITHOUT_DRIVER";

#[test]
fn without_a_driver_one_message_says_how_to_get_one() {
    if std::env::var_os(WITHOUT_DRIVER).is_some() {
        let error = VulkanDevice::new().unwrap_err();
        assert!(matches!(error, DeviceError::NoDriver { .. }), "{error}");
        println!("{error}");
        return;
    }
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            "without_a_driver_one_message_says_how_to_get_one",
            "--nocapture",
        ])
        .env(WITHOUT_DRIVER, "1")
        .env("VK_DRIVER_FILES", "none.json")
        .env("VK_ICD_FILENAMES", "none.json")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    assert!(
        text.contains("apt-get install mesa-vulkan-drivers libvulkan1"),
        "{text}"
    );
}

#[test]
fn passes_whose_parts_do_not_fit_are_refused() {
    let mut gpu = vulkan();
    let (place, tint) = (place(), tint());
    let positions = bytes(&[0.0f32; 9]);
    let colours = bytes(&[0.0f32; 12]);
    let factor = bytes(&[1.0f32]);
    let a = gpu
        .texture("a", &TextureShape::d2(8, 8, TexelFormat::Rgba32Float))
        .unwrap();
    let uint = gpu
        .texture("uint", &TextureShape::d2(8, 8, TexelFormat::Rgba32Uint))
        .unwrap();
    let deep = gpu.texture("deep", &TextureShape::depth(4, 4)).unwrap();
    let vertex_args = [
        Bind::Bytes(&factor),
        Bind::Bytes(&positions),
        Bind::Bytes(&colours),
    ];
    let fragment_args = [Bind::Bytes(&factor)];
    let draw = Draw {
        vertex: place.program(Way::Naga),
        vertex_args: &vertex_args,
        fragment: Some(tint.program(Way::Naga)),
        fragment_args: &fragment_args,
        indices: None,
        count: 3,
        topology: Topology::Triangles,
        cull: Cull::None,
    };
    let target = |texture| Colour {
        texture,
        resolve: None,
        clear: Some([0.0; 4]),
        blend: Blend::Off,
    };
    let mut refuse = |colours: &[Colour], depth, draw: Draw<'_>| {
        gpu.draw(&Pass {
            label: "odd",
            colours,
            depth,
            draws: &[draw],
        })
        .unwrap_err()
        .to_string()
    };
    let text = refuse(&[], None, draw);
    assert!(text.contains("neither"), "{text}");
    let text = refuse(&[target(uint)], None, draw);
    assert!(
        text.contains("rgba32uint, but kernel `tint` writes floats"),
        "{text}"
    );
    let text = refuse(&[target(a), target(uint)], None, draw);
    assert!(text.contains("2 colour targets"), "{text}");
    let depth = Depth {
        texture: deep,
        clear: None,
        test: DepthTest::Always,
        write: false,
    };
    let text = refuse(&[target(a)], Some(depth), draw);
    assert!(text.contains("the depth buffer is 4x4"), "{text}");
    let text = refuse(&[target(a)], None, Draw { count: 4, ..draw });
    assert!(
        text.contains("`position`") && text.contains("4 vertices"),
        "{text}"
    );
    let text = refuse(
        &[target(a)],
        None,
        Draw {
            vertex: tint.program(Way::Naga),
            ..draw
        },
    );
    assert!(text.contains("`tint` is a fragment kernel"), "{text}");
    let text = refuse(
        &[target(a)],
        None,
        Draw {
            fragment: None,
            fragment_args: &[],
            ..draw
        },
    );
    assert!(text.contains("without a fragment kernel"), "{text}");
    let mut other = common::tint();
    other.kernel.params[1] = param(
        "colour",
        Role::Varying {
            location: 3,
            ty: vector(Scalar::F32, 4),
            interpolation: Interpolation::Perspective,
        },
    );
    let text = refuse(
        &[target(a)],
        None,
        Draw {
            fragment: Some(other.program(Way::Naga)),
            ..draw
        },
    );
    assert!(
        text.contains("location 3") && text.contains("does not make"),
        "{text}"
    );
}

/// Whether there are enough elements cannot be known where a buffer says how many invocations run.
#[test]
fn a_range_in_a_buffer_is_refused_beside_elements() {
    let mut kernel = affine();
    let Stage::Compute { range, .. } = &mut kernel.kernel.stage else {
        panic!("it is a compute kernel");
    };
    *range = Range::Uniform {
        param: "settings".into(),
        offset: 0,
    };
    for device in [&mut NativeDevice::new() as &mut dyn Device, &mut vulkan()] {
        let settings = device.buffer_from("settings", &bytes(&[3_u32, 0])).unwrap();
        let pairs = device.buffer_from("pairs", &bytes(&[1.0_f32; 6])).unwrap();
        let out = device.buffer("out", 12).unwrap();
        let args = [settings, pairs, out].map(Bind::Buffer);
        let error = device.dispatch(&kernel.program(Way::Wgsl), &args);
        let text = error.unwrap_err().to_string();
        assert!(text.contains("`settings`"), "{text}");
        assert!(
            text.contains("how many invocations run, and `pair` has one element for each"),
            "{text}"
        );
    }
}

/// Textures become levels of another one, and only such as fit.
#[test]
fn textures_are_copied_into_levels() {
    for device in [&mut NativeDevice::new() as &mut dyn Device, &mut vulkan()] {
        let format = TexelFormat::R32Float;
        let whole = TextureShape::d2(5, 3, format).with_levels(3);
        let whole = device.texture("whole", &whole).unwrap();
        let mut all = Vec::new();
        for (level, [width, height]) in (0..).zip([[5, 3], [2, 1], [1, 1]]) {
            let shape = TextureShape::d2(width, height, format);
            let texels: Vec<f32> = (0..width * height)
                .map(|i| (10 * level + i) as f32)
                .collect();
            let part = device
                .texture_from("part", &shape, &bytes(&texels))
                .unwrap();
            device.copy_to_level(part, whole, level).unwrap();
            all.extend(texels);
            let text = device.copy_to_level(part, whole, 3 - level).unwrap_err();
            assert!(text.to_string().contains("level"), "{text}");
        }
        assert_eq!(f32s(&device.read_texture(whole).unwrap()), all);
        let other = TextureShape::d2(5, 3, TexelFormat::R32Uint);
        let other = device.texture("other", &other).unwrap();
        let text = device.copy_to_level(other, whole, 0).unwrap_err();
        assert!(text.to_string().contains("r32uint"), "{text}");
    }
}

/// A texture is filled with a value as its format holds it, drawn into or not.
#[test]
fn textures_and_buffers_are_cleared() {
    use hankel_dsl::glam::Vec4;
    let value = Vec4::new(0.25, 1.0, 0.4, 0.125);
    for device in [&mut NativeDevice::new() as &mut dyn Device, &mut vulkan()] {
        for format in [
            TexelFormat::Rgba16Unorm,
            TexelFormat::Rgba32Float,
            TexelFormat::Rgba8Unorm,
        ] {
            for shape in [
                TextureShape::d2(7, 5, format),
                TextureShape::d3([3, 4, 2], format),
            ] {
                let texture = device.texture("filled", &shape).unwrap();
                device.clear_texture(texture, value).unwrap();
                let read = device.read_texture(texture).unwrap();
                let mut texel = vec![0; format.bytes()];
                format.store(&mut texel, value);
                assert_eq!(read, texel.repeat(read.len() / texel.len()), "{shape:?}");
            }
        }
        let shape = TextureShape::d2(4, 4, TexelFormat::R32Uint);
        let numbers = device
            .texture_from("numbers", &shape, &bytes(&[7_u32; 16]))
            .unwrap();
        let text = device.clear_texture(numbers, value).unwrap_err();
        assert!(text.to_string().contains("integers"), "{text}");
        device.clear_texture(numbers, Vec4::ZERO).unwrap();
        assert_eq!(device.read_texture(numbers).unwrap(), vec![0; 64]);
        let words = device.buffer_from("words", &bytes(&[7_u32; 9])).unwrap();
        device.clear_buffer(words).unwrap();
        assert_eq!(device.read_buffer(words).unwrap(), vec![0; 36]);
    }
}
