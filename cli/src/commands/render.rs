use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hankel_host::device::Backend;
use hankel_host::frame::{Difference, Plan, Rendering, Timing, compare, render};
use hankel_host::scene::Scene;
use serde::Serialize;

use super::print_json;
use crate::args::{Format, Render};
use crate::failure::{Outcome, Result};
use crate::progress::Progress;
use crate::session::Session;

#[derive(Serialize)]
struct Report<'a> {
    pictures: Vec<PathBuf>,
    devices: Vec<&'a str>,
    triangles: usize,
    plan: &'a Plan,
    timings: Vec<&'a [Timing]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    difference: Option<&'a Difference>,
    /// Share of the pixels where rounding may decide what a sample sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    edges: Option<f64>,
}

pub fn run(args: &Render, quiet: bool) -> Result<Outcome> {
    let scene = Scene::read(&args.scene)?;
    let session = Session::open(None, quiet)?;
    let mut progress = Progress::new(quiet || args.format == Format::Json);
    if !args.compare {
        let backend = Backend::from(args.backend);
        let shaders = match backend {
            Backend::Native => BTreeMap::new(),
            Backend::Vulkan => session.all_words()?,
        };
        let rendering = render(&scene, backend, &shaders, &mut progress)?;
        drop(progress);
        rendering.picture.save(&args.out)?;
        print(args, quiet, vec![args.out.clone()], &[&rendering], None);
        return Ok(Outcome::Fine);
    }
    let shaders = session.all_words()?;
    let comparison = compare(&scene, &shaders, args.amplify, &mut progress)?;
    drop(progress);
    let (vulkan, difference) = (beside(&args.out, "vulkan"), beside(&args.out, "difference"));
    comparison.native.picture.save(&args.out)?;
    comparison.vulkan.picture.save(&vulkan)?;
    comparison.difference.picture.save(&difference)?;
    print(
        args,
        quiet,
        vec![args.out.clone(), vulkan, difference],
        &[&comparison.native, &comparison.vulkan],
        Some(&comparison.difference),
    );
    let limit = args
        .limit
        .map_or_else(|| comparison.limit(), |percent| percent / 100.0);
    let share = comparison.difference.over_1;
    if share > limit {
        eprintln!(
            "the pictures differ: {:.3} % of the pixels by more than 1/255, at most {:.3} % may",
            share * 100.0,
            limit * 100.0
        );
    }
    Ok(Outcome::of(share <= limit))
}

/// `scan.png` and `vulkan` to `scan-vulkan.png`.
fn beside(out: &Path, what: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let extension = out.extension().unwrap_or_default().to_string_lossy();
    let dot = if extension.is_empty() { "" } else { "." };
    out.with_file_name(format!("{stem}-{what}{dot}{extension}"))
}

fn print(
    args: &Render,
    quiet: bool,
    pictures: Vec<PathBuf>,
    renderings: &[&Rendering],
    difference: Option<&Difference>,
) {
    let first = renderings[0];
    if args.format == Format::Json {
        print_json(&Report {
            pictures,
            devices: renderings.iter().map(|r| r.device.as_str()).collect(),
            triangles: first.triangles,
            plan: &first.plan,
            timings: renderings.iter().map(|r| r.timings.as_slice()).collect(),
            difference,
            edges: first.edges,
        });
        return;
    }
    if quiet {
        return;
    }
    println!("{}", first.plan);
    for r in renderings {
        println!(
            "{}: {:.2} s, {} triangles",
            r.device,
            r.seconds(),
            r.triangles
        );
        for t in &r.timings {
            println!("  {:<16} {:>8.1} ms", t.name, t.seconds * 1e3);
        }
    }
    if let Some(difference) = difference {
        println!("difference: {difference}");
        if let Some(edges) = first.edges {
            println!(
                "{:.2} % of the pixels lie on edges, where rounding decides",
                edges * 100.0
            );
        }
    }
    for p in &pictures {
        println!("{}", p.display());
    }
}
