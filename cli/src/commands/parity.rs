use std::collections::BTreeMap;
use std::time::Duration;

use hankel_codegen::Language;
use hankel_codegen::build::generate;
use hankel_codegen::spirv::words;
use hankel_codegen::translate::Options;
use hankel_host::device::VulkanDevice;
use hankel_host::parity::{Subject, Wgsl};

use crate::args::{Format, Parity};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::Session;

pub fn run(args: &Parity, quiet: bool) -> Result<Outcome> {
    if args.matrix {
        return super::matrix::run(args, quiet);
    }
    // Whether there is a driver shows before the long work starts.
    let mut vulkan = VulkanDevice::new()?;
    let session = Session::open(args.source.manifest_path.as_deref(), quiet)?;
    let targets = vec![Language::Spirv, Language::Wgsl];
    let request = session.request_for(args.kernels.clone(), targets, Options::default());
    let generated = generate(&request, &session.modules()?)?;

    let mut codes = BTreeMap::new();
    for (name, entry) in &generated.manifest.kernels {
        let text = |language: Language| {
            let there = entry.languages.get(&language);
            there
                .and_then(|l| Some((generated.files.get(&l.file)?, l.entry_point.as_str())))
                .ok_or_else(|| {
                    let why = entry.unsupported.get(&language).cloned();
                    why.unwrap_or_else(|| format!("there is no {language}"))
                })
        };
        let spirv = text(Language::Spirv)
            .and_then(|(bytes, _)| words(bytes, name).map_err(|failure| failure.to_string()));
        let wgsl = text(Language::Wgsl)
            .map(|(bytes, entry_point)| (String::from_utf8_lossy(bytes).into_owned(), entry_point));
        codes.insert(name.as_str(), (spirv, wgsl));
    }
    let krate = session.native(
        generated.manifest.kernels.keys(),
        Duration::from_secs(args.limit),
    )?;
    let subjects: Vec<Subject<'_>> = krate
        .entries
        .iter()
        .filter_map(|entry| {
            let (spirv, wgsl) = codes.get(entry.kernel.name.as_str())?;
            Some(Subject {
                entry,
                spirv: spirv.as_deref().map_err(Clone::clone),
                wgsl: match wgsl {
                    Ok((text, entry_point)) => Ok(Wgsl { text, entry_point }),
                    Err(why) => Err(why.clone()),
                },
            })
        })
        .collect();

    let progress = Progress::new(quiet);
    progress.begin(&format!("Comparing {} kernels", subjects.len()));
    let report = hankel_host::parity::run(&mut vulkan, &subjects, args.seed, &mut |kernel| {
        progress.detail(kernel);
    });
    drop(progress);
    if args.format == Format::Json {
        print::json(&report);
    } else {
        say!("{report}");
    }
    Ok(Outcome::of(report.passed))
}
