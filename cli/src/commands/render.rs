use std::collections::BTreeMap;
use std::path::PathBuf;

use hankel_frames::graph::Summary;
use hankel_frames::scene::Scene;
use hankel_frames::truth::{Measured, measure};
use hankel_frames::{Difference, Memory, Rendering, Timing, compare, render};
use hankel_host::device::Backend;
use serde::Serialize;

use crate::args::{Format, Render};
use crate::commands::scene::{Asked, beside, files, is_exr, places, save};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::Session;

#[derive(Serialize)]
struct Report<'a> {
    #[serde(serialize_with = "print::paths")]
    pictures: Vec<PathBuf>,
    devices: Vec<&'a str>,
    triangles: usize,
    plan: &'a Summary,
    memory: Vec<Memory>,
    timings: Vec<&'a [Timing]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    difference: Option<&'a Difference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    errors: Option<&'a Measured>,
    /// Share of the pixels where rounding may decide what a sample sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    edges: Option<f64>,
}

pub fn run(args: &Render, quiet: bool) -> Result<Outcome> {
    let asked = Asked {
        technique: args.technique.as_deref(),
        error: args.error,
        maps: &args.maps,
        backend: args.backend,
        image_passes: args.image_passes,
    };
    let scene = asked.read(&args.scene)?;
    let is_linear = is_exr(&args.out);
    if is_linear && args.compare {
        return Err(Failure::input(
            format!("{}: --compare writes PNG files", args.out.display()),
            "Name a file .png, or leave out --compare.",
        ));
    }
    let pictures = if args.compare {
        let (vulkan, difference) = (beside(&args.out, "vulkan"), beside(&args.out, "difference"));
        vec![args.out.clone(), vulkan, difference]
    } else {
        vec![args.out.clone()]
    };
    let inputs = files(&args.scene, &scene);
    // Whether they can be written shows before the long work starts.
    let outputs = places(&pictures, &inputs)?;
    let session = Session::linked(quiet);
    let Some(scene) = asked.planned(scene, quiet || args.format == Format::Json)? else {
        return Ok(Outcome::CheckFailed);
    };
    let mut progress = Progress::new(quiet || args.format == Format::Json);
    if !args.compare {
        let backend = Backend::from(args.backend);
        let shaders = match backend {
            Backend::Native => BTreeMap::new(),
            Backend::Vulkan => session.all_words()?,
        };
        let rendering = render(&scene, backend, &shaders, &mut progress)?;
        let errors = errors(args, &scene, &mut progress)?;
        drop(progress);
        if is_linear {
            for output in outputs {
                rendering.linear.save(output)?;
            }
        } else {
            save([&rendering.picture], outputs)?;
        }
        let told = Told {
            pictures,
            renderings: &[&rendering],
            difference: None,
            errors,
        };
        print(args, quiet, told);
        return Ok(Outcome::Fine);
    }
    let shaders = session.all_words()?;
    let comparison = compare(&scene, &shaders, args.amplify, &mut progress)?;
    let errors = errors(args, &scene, &mut progress)?;
    drop(progress);
    let made = [
        &comparison.native.picture,
        &comparison.vulkan.picture,
        &comparison.difference.picture,
    ];
    save(made, outputs)?;
    let told = Told {
        pictures,
        renderings: &[&comparison.native, &comparison.vulkan],
        difference: Some(&comparison.difference),
        errors,
    };
    print(args, quiet, told);
    let limit = args
        .limit
        .map_or_else(|| comparison.limit(), |percent| percent / 100.0);
    let share = comparison.difference.over_1;
    if share > limit {
        print::note(format_args!(
            "the pictures differ: {:.3} % of the pixels by more than 1/255, at most {:.3} % are allowed",
            share * 100.0,
            limit * 100.0
        ));
    }
    Ok(Outcome::of(share <= limit))
}

fn errors(args: &Render, scene: &Scene, progress: &mut Progress) -> Result<Option<Measured>> {
    if !args.errors {
        return Ok(None);
    }
    Ok(Some(measure(scene, &scene.mesh()?, progress)?))
}

/// What there is to tell.
struct Told<'a> {
    pictures: Vec<PathBuf>,
    renderings: &'a [&'a Rendering],
    difference: Option<&'a Difference>,
    errors: Option<Measured>,
}

fn print(args: &Render, quiet: bool, told: Told<'_>) {
    let Told {
        pictures,
        renderings,
        difference,
        errors,
    } = told;
    let first = renderings[0];
    if args.format == Format::Json {
        print::json(&Report {
            pictures,
            devices: renderings.iter().map(|r| r.device.as_str()).collect(),
            triangles: first.triangles,
            plan: &first.plan,
            memory: renderings.iter().map(|r| r.memory).collect(),
            timings: renderings.iter().map(|r| r.timings.as_slice()).collect(),
            difference,
            errors: errors.as_ref(),
            edges: first.edges,
        });
        return;
    }
    if !quiet {
        tell(first, renderings);
    }
    if let Some(difference) = difference {
        say!("difference: {difference}");
        if let Some(edges) = first.edges.filter(|_| !quiet) {
            say!(
                "{:.2} % of the pixels lie on edges, where rounding decides",
                edges * 100.0
            );
        }
    }
    if let Some(Measured {
        rays,
        filtered,
        scattered,
    }) = errors
    {
        say!("light against rays: {rays}");
        if let Some(filtered) = filtered {
            say!("light against all samples, filtered: {filtered}");
        }
        if let Some(scattered) = scattered {
            for errors in &scattered.errors {
                say!("scattered light against rays: {errors}");
            }
            say!(
                "reference rays: {} steps; with half as many, the light differs by {:.5}",
                scattered.steps,
                scattered.change
            );
        }
    }
    if !quiet {
        for p in &pictures {
            say!("{}", p.display());
        }
    }
}

/// What the frames are made of, and what they took.
fn tell(first: &Rendering, renderings: &[&Rendering]) {
    say!("{}", first.plan);
    for r in renderings {
        say!(
            "{}: {:.2} s, {} triangles, {:.1} MB ({:.1} MB if passes shared no memory)",
            r.device,
            r.seconds(),
            r.triangles,
            r.memory.bytes as f64 / 1e6,
            r.memory.unshared as f64 / 1e6
        );
        for t in &r.timings {
            say!("  {:<16} {:>8.1} ms", t.name, t.seconds * 1e3);
        }
    }
}
