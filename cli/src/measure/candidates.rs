use std::io::Write;
use std::path::{Path, PathBuf};

use hankel_frames::scene::Scene;
use hankel_frames::truth::regions::regions;
use hankel_numerics::judge::{
    DepthFunction, Group, Point, Ranking, Region, Score, choices_of, evaluate, rank,
};
use hankel_numerics::report::{Axis, Cell, Column, Form, Plot, Report, Series, Style, Table};
use hankel_system::output::{self, Output, OutputError};

use super::args::BenchCandidates;
use super::{command_line, deliver, scene_files};
use crate::args::Format;
use crate::failure::{Failure, Outcome, Result};
use crate::progress::Progress;

/// Candidates that the page and the terminal have.
const BEST: usize = 25;
/// Of these, as many are evaluated to the end.
const EXACT: usize = 5;
/// Bars of the histogram.
const BARS: usize = 60;
/// The histogram ends where this share of the candidates is on its left.
const DRAWN: f64 = 0.99;
/// Every choice goes into this file.
const ALL: &str = "candidates-all.csv";

/// Candidates that techniques use.
const KNOWN: [(&str, &[&str]); 9] = [
    ("mean depth", &["z"]),
    ("exponential shadow maps", &["exp(4z)"]),
    ("variance shadow maps", &["z", "z^2"]),
    ("one trigonometric moment", &["cos(2pi*z)", "sin(2pi*z)"]),
    ("three power moments", &["z", "z^2", "z^3"]),
    ("four power moments", &["z", "z^2", "z^3", "z^4"]),
    (
        "two trigonometric moments",
        &["cos(2pi*z)", "sin(2pi*z)", "cos(4pi*z)", "sin(4pi*z)"],
    ),
    (
        "the same, with twice the frequencies",
        &["cos(4pi*z)", "sin(4pi*z)", "cos(8pi*z)", "sin(8pi*z)"],
    ),
    ("five power moments", &["z", "z^2", "z^3", "z^4", "z^5"]),
];

pub fn run(args: &BenchCandidates, quiet: bool) -> Result<Outcome> {
    output::folder(&args.out)?;
    let files = scene_files(&args.scene)?;
    let inputs: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let mut all = Output::create(&args.out.join(ALL), &inputs)?;
    let count = usize::from(args.functions);
    let progress = Progress::new(quiet || args.format == Format::Json);
    progress.begin("Looking for filter regions");
    let groups = groups(&files, args, &progress)?;
    progress.begin(&format!("Ranking {} candidates", choices_of(count)));
    let ranking = rank(count, &groups, &|done| {
        if done.is_multiple_of(50) {
            progress.detail(&format!("{done} of {}", choices_of(count)));
        }
    });
    drop(progress);

    let mut report = Report::new(
        format!("What a shadow map should hold: choices of {count} of 37 functions of depth"),
        command_line(),
    );
    report.fact("candidates", ranking.scores.len());
    let regions: usize = groups.iter().map(|g| g.regions.len()).sum();
    report.fact("filter regions", regions);
    report.notes.push(format!(
        "The error is the mean distance of the best lower bound to percentage-closer filtering with the same bias, as a \
         share of light. Over all scenes it is weighted by the number of surfaces behind a texel of each scene's map. \
         Linear programmes are solved with two refinements, as published. The column `exact` has the same error from \
         programmes that are refined to the end; its difference to `error` is due to the samples alone. {} of the \
         programmes were stopped after too many steps.",
        Cell::from(ranking.unfinished).spelled(Form::Percent(4))
    ));
    report.tables.push(best(&ranking, &groups));
    report.tables.push(known(&ranking, &groups, count));
    report.tables.push(scenes(&ranking, &groups));
    report.plots.push(histogram(&ranking, count));
    let table = every(&ranking, &groups);
    let bytes = table
        .csv()
        .map_err(|e| Failure::machine(format!("{ALL}: {e}"), None))?;
    all.write_all(&bytes)
        .map_err(|e| OutputError::write(all.path(), e))?;
    all.commit()?;
    deliver(
        &report,
        Some(&args.out),
        "candidates",
        &files,
        args.format,
        quiet,
    )?;
    Ok(Outcome::Fine)
}

/// The regions of each scene.
fn groups(files: &[PathBuf], args: &BenchCandidates, progress: &Progress) -> Result<Vec<Group>> {
    let mut groups: Vec<Group> = Vec::new();
    for file in files {
        let name = file
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        progress.detail(&name);
        groups.push(group(file, name, args)?);
    }
    for (i, group) in groups.iter().enumerate() {
        if groups[..i].iter().any(|other| other.name == group.name) {
            return Err(Failure::input(
                format!("there are two scenes `{}`", group.name),
                "Scenes are identified by the names of their files: rename one.",
            ));
        }
    }
    Ok(groups)
}

fn group(file: &Path, name: String, args: &BenchCandidates) -> Result<Group> {
    let mut scene = Scene::read(file)?;
    scene.shadow.size = args.size.unwrap_or(scene.shadow.size);
    scene.shadow.filter = args.filter.unwrap_or(scene.shadow.filter);
    let found = regions(&scene, &scene.mesh()?, args.regions as usize);
    if found.regions.is_empty() {
        return Err(Failure::input(
            format!("{}: the light sees no opaque surface", file.display()),
            "Leave this scene out.",
        ));
    }
    let point = |[depth, weight]: [f64; 2]| Point { depth, weight };
    let region = |it: hankel_frames::truth::regions::Region| Region {
        depths: it.depths.into_iter().map(point).collect(),
        receiver: it.receiver,
    };
    Ok(Group {
        name,
        regions: found.regions.into_iter().map(region).collect(),
        weight: found.layers,
    })
}

fn names(functions: &[DepthFunction]) -> String {
    let names: Vec<String> = functions.iter().map(ToString::to_string).collect();
    names.join(", ")
}

/// The error by programmes that are refined to the end: of all groups, by their weights.
fn exact(functions: &[DepthFunction], groups: &[Group]) -> Cell {
    let of_group = |group: &Group| {
        let evaluation = evaluate(functions, &group.regions).ok()?;
        Some(group.weight * evaluation.mean)
    };
    let weight: f64 = groups.iter().map(|g| g.weight).sum();
    let sum: Option<f64> = groups.iter().map(of_group).sum();
    sum.map_or(Cell::Empty, |sum| (sum / weight).into())
}

fn best(ranking: &Ranking, groups: &[Group]) -> Table {
    let mut table = Table::new(
        "best",
        format!("The best {BEST} candidates"),
        [
            Column::count("rank"),
            Column::text("functions"),
            Column::percent("error", 2),
            Column::percent("exact", 2),
        ],
    );
    for (i, score) in ranking.scores.iter().take(BEST).enumerate() {
        let exact = if i < EXACT {
            exact(&score.functions, groups)
        } else {
            Cell::Empty
        };
        table.push([
            (i + 1).into(),
            names(&score.functions).into(),
            score.mean.into(),
            exact,
        ]);
    }
    table
}

/// What techniques of that many functions are.
fn of_count(count: usize) -> impl Iterator<Item = (&'static str, Vec<DepthFunction>)> {
    KNOWN.into_iter().filter_map(move |(what, names)| {
        let functions: Vec<DepthFunction> = names.iter().filter_map(|n| n.parse().ok()).collect();
        (functions.len() == count).then_some((what, functions))
    })
}

fn known(ranking: &Ranking, groups: &[Group], count: usize) -> Table {
    let mut table = Table::new(
        "known",
        "Candidates that techniques use, the median and the worst",
        [
            Column::text("candidate"),
            Column::text("functions"),
            Column::count("rank"),
            Column::percent("better than", 1),
            Column::percent("error", 2),
            Column::percent("exact", 2),
        ],
    );
    let number = ranking.scores.len();
    let mut row = |what: &str, place: usize, exact: Cell| {
        let score = &ranking.scores[place - 1];
        table.push([
            what.into(),
            names(&score.functions).into(),
            place.into(),
            ((number - place) as f64 / number as f64).into(),
            score.mean.into(),
            exact,
        ]);
    };
    for (what, functions) in of_count(count) {
        if let Some(place) = ranking.place(&functions) {
            row(what, place, exact(&functions, groups));
        }
    }
    row("the median", number.div_ceil(2), Cell::Empty);
    row("the worst", number, Cell::Empty);
    table
}

/// Whether the ranking is the scenes' or the functions': the best of each scene among all.
fn scenes(ranking: &Ranking, groups: &[Group]) -> Table {
    let mut table = Table::new(
        "scenes",
        "The best candidate of each scene, and the error there of the best of all",
        [
            Column::text("scene"),
            Column::count("regions"),
            Column::fixed("surfaces behind a texel", 2),
            Column::text("functions"),
            Column::percent("error", 2),
            Column::count("rank of all"),
            Column::percent("of the best of all", 2),
        ],
    );
    for (g, group) in groups.iter().enumerate() {
        let least = ranking
            .scores
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| a.groups[g].total_cmp(&b.groups[g]));
        if let Some((place, score)) = least {
            table.push([
                group.name.as_str().into(),
                group.regions.len().into(),
                group.weight.into(),
                names(&score.functions).into(),
                score.groups[g].into(),
                (place + 1).into(),
                ranking.scores[0].groups[g].into(),
            ]);
        }
    }
    table
}

fn every(ranking: &Ranking, groups: &[Group]) -> Table {
    let mut columns = vec![
        Column::count("rank"),
        Column::text("functions"),
        Column::number("error"),
    ];
    columns.extend(
        groups
            .iter()
            .map(|group| Column::number(group.name.as_str())),
    );
    let mut table = Table::new("all", "All candidates", columns);
    for (i, score) in ranking.scores.iter().enumerate() {
        let Score {
            functions,
            mean,
            groups,
        } = score;
        let first: [Cell; 3] = [(i + 1).into(), names(functions).into(), (*mean).into()];
        table.push(first.into_iter().chain(groups.iter().map(|e| (*e).into())));
    }
    table
}

/// How many candidates have which error (\[MSM\], Figure 4), and where known ones are.
fn histogram(ranking: &Ranking, count: usize) -> Plot {
    let scores = &ranking.scores;
    let last = ((scores.len() as f64 * DRAWN) as usize).min(scores.len() - 1);
    let (low, high) = (scores[0].mean, scores[last].mean);
    let width = ((high - low) / BARS as f64).max(f64::MIN_POSITIVE);
    let mut bars = [0_usize; BARS];
    for score in &scores[..=last] {
        bars[(((score.mean - low) / width) as usize).min(BARS - 1)] += 1;
    }
    let tallest = bars.iter().copied().max().unwrap_or(0) as f64;
    let outline = bars.iter().enumerate().flat_map(|(i, bar)| {
        let left = (i as f64).mul_add(width, low);
        [
            (100.0 * left, *bar as f64),
            (100.0 * (left + width), *bar as f64),
        ]
    });
    let mut series = vec![Series::new("all candidates", Style::Line, outline)];
    for (what, functions) in of_count(count) {
        if let Some(place) = ranking.place(&functions).filter(|place| *place <= last + 1) {
            let x = 100.0 * scores[place - 1].mean;
            series.push(Series::new(what, Style::Line, [(x, 0.0), (x, tallest)]));
        }
    }
    Plot {
        id: "histogram".into(),
        caption: format!(
            "How many candidates have which error; the {} % with the largest are beyond the right edge",
            (100.0 * (1.0 - DRAWN)).round()
        ),
        x: Axis::linear("mean error [%]"),
        y: Axis::linear("candidates"),
        series,
    }
}
