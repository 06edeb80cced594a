use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use hankel_codegen::files::sha256;
use hankel_frames::measure::growth::growth;
use hankel_frames::measure::{
    Ask, Choices, Configuration, Measurement, Pictures, Session, Status, Subject, median, sample,
};
use hankel_frames::plan::{Wanted, plan};
use hankel_frames::scene::{Fit, Scene};
use hankel_frames::{FrameError, Picture};
use hankel_host::device::Device;
use hankel_numerics::report::{
    Axis, Cell, Column, Gallery, Plot, Point, Report, Series, Style, Table, pareto_front,
};
use hankel_system::output::{self, Output};

use super::args::BenchFrames;
use super::{command_line, deliver, scene_files};
use crate::args::Format;
use crate::commands::plan::{choices, open};
use crate::failure::{Failure, Outcome, Result};
use crate::print::note;
use crate::progress::Progress;
use crate::session::{Words, this_program};

/// What is measured is kept here.
const KEPT: &str = "measured.jsonl";
/// How many times the least time a plan may take.
const MARGIN: f64 = 1.15;
/// Rounds in which a plan is timed beside the fastest configurations.
const BESIDE: usize = 9;
/// So many of the fastest.
const RIVALS: usize = 3;
/// How often progress is told where no terminal shows it.
const EVERY: Duration = Duration::from_secs(30);

/// What things are measured with.
struct Bench<'a> {
    device: Box<dyn Device>,
    shaders: Words,
    choices: Choices,
    args: &'a BenchFrames,
}

pub fn run(args: &BenchFrames, quiet: bool) -> Result<Outcome> {
    output::folder(&args.out)?;
    let subjects = subjects(args)?;
    let has_medium = subjects.iter().any(|it| it.scene.medium.is_some());
    let choices = choices(&args.choose, has_medium)?;
    let (device, shaders) = open(args.backend, quiet)?;
    let mut bench = Bench {
        device,
        shaders,
        choices,
        args,
    };
    // Other kernels or other code take other times.
    let program = this_program()?;
    let program = std::fs::read(&program)
        .map_err(|e| Failure::machine(format!("{}: {e}", program.display()), None))?;
    let conditions = [
        ("the program", sha256(&program)),
        ("device", bench.device.name().to_owned()),
    ];
    let session = Session::open(&args.out.join(KEPT), &conditions);
    let mut session = session.map_err(FrameError::from)?;
    let ask = Ask {
        configurations: bench.choices.configurations(),
        rounds: args.rounds,
    };
    session.expect(&subjects, &ask);
    let quiet = quiet || args.format == Format::Json;
    let mut teller = Teller::new(quiet);
    let mut all = Vec::new();
    for subject in &subjects {
        let (device, shaders) = (&mut *bench.device, &bench.shaders);
        let tell = &mut |status: &Status| teller.tell(status);
        all.push(session.measure(device, shaders, subject, &ask, tell)?);
    }
    drop(teller);

    let mut report = Report::new(
        "Run time of frames against the error of their shadows",
        command_line(),
    );
    report.fact("device", bench.device.name());
    report.fact("rounds", args.rounds);
    let most = all.iter().map(Vec::len).max().unwrap_or(0);
    report.fact("configurations of a scene, at most", most);
    report.notes.push(
        "Times are medians of interleaved rounds, each after runs of the same frame. The error is the \
         root mean square difference from ray-traced light, with 256 rays through each pixel, over all pixels. Light \
         is 1 minus the shadow, and 0 where a surface faces away from the light. In a scene with a medium it is the \
         light that comes through the medium, plus the light that the medium scatters, without phase function and \
         absorption, so that it is from 0 to 1."
            .into(),
    );
    let mut fine = true;
    if !args.error.is_empty() {
        let (table, kept) = bench.plans(&subjects, &all, quiet)?;
        fine = kept;
        report.tables.push(table);
    }
    report.tables.push(fronts(&all));
    if all.iter().flatten().any(|m| m.scattered.is_some()) {
        report.tables.push(scattered(&all));
    }
    report.tables.push(gain_of_fit(&all));
    report.tables.push(gain_of_one_sample(&all));
    report.tables.push(doubling(&all));
    report.tables.push(growths(&all));
    report.tables.push(configurations(&all));
    report.tables.push(passes(&all));
    for (subject, of_subject) in subjects.iter().zip(&all) {
        report.plots.push(pareto_plot(subject, of_subject));
        report
            .galleries
            .push(bench.gallery(&session, subject, of_subject)?);
    }
    let mut inputs = scene_files(&args.scene)?;
    inputs.extend(subjects.iter().flat_map(|it| it.scene.files()));
    deliver(
        &report,
        Some(&args.out),
        "frames",
        &inputs,
        args.format,
        quiet,
    )?;
    Ok(Outcome::of(fine))
}

/// The scenes, each in every size of the picture.
fn subjects(args: &BenchFrames) -> Result<Vec<Subject>> {
    let files = scene_files(&args.scene)?;
    let mut subjects: Vec<Subject> = Vec::new();
    for file in &files {
        let scene = Scene::read(file)?;
        let mesh = scene.mesh()?;
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        let own = [[scene.width, scene.height]];
        let outputs = if args.output.is_empty() {
            &own[..]
        } else {
            &args.output
        };
        for [width, height] in outputs {
            let subject = Subject {
                name: name.clone().into_owned(),
                scene: Scene {
                    width: *width,
                    height: *height,
                    ..scene.clone()
                },
                mesh: mesh.clone(),
            };
            if subjects.iter().any(|s| s.key() == subject.key()) {
                return Err(Failure::input(
                    format!("{} is asked for twice", subject.key()),
                    "Scenes are identified by the names of their files and the size of the picture.",
                ));
            }
            subjects.push(subject);
        }
    }
    Ok(subjects)
}

/// Tells how far a session is: on a terminal after each step, elsewhere from time to time.
struct Teller {
    progress: Progress,
    told: Instant,
    quiet: bool,
}

impl Teller {
    fn new(quiet: bool) -> Self {
        let progress = Progress::new(quiet);
        progress.begin("Measuring frames");
        Self {
            progress,
            told: Instant::now(),
            quiet,
        }
    }

    fn tell(&mut self, status: &Status) {
        let left = status.remaining.map_or_else(String::new, |left| {
            let seconds = left.as_secs();
            format!(", {}:{:02} left", seconds / 60, seconds % 60)
        });
        let line = format!("{}/{}{left}: {}", status.done, status.steps, status.what);
        self.progress.detail(&line);
        if !self.quiet && !self.progress.is_seen() && self.told.elapsed() >= EVERY {
            note(format_args!("{line}"));
            self.told = Instant::now();
        }
    }
}

/// Indices of what nothing is both faster and nearer than, from the fastest.
fn front(of_subject: &[Measurement]) -> Vec<usize> {
    let points: Vec<(f64, f64)> = of_subject
        .iter()
        .map(|m| (m.seconds(), m.errors.rms))
        .collect();
    pareto_front(&points)
}

fn output_of(m: &Measurement) -> String {
    format!("{}x{}", m.output[0], m.output[1])
}

const fn millis(seconds: f64) -> f64 {
    seconds * 1e3
}

/// Columns that say which measurement it is.
fn identity() -> Vec<Column> {
    vec![
        Column::text("scene"),
        Column::text("picture"),
        Column::text("method"),
        Column::count("size"),
        Column::count("taps"),
        Column::text("map holds"),
        Column::text("scattering"),
    ]
}

fn identified(m: &Measurement) -> Vec<Cell> {
    let c = &m.configuration;
    vec![
        m.scene.as_str().into(),
        output_of(m).as_str().into(),
        c.method().as_str().into(),
        (c.size as usize).into(),
        (c.filter as usize).into(),
        c.fit.name().into(),
        scattering_of(c).as_str().into(),
    ]
}

/// How a medium's light is made; nothing without one.
fn scattering_of(c: &Configuration) -> String {
    c.scattering.map_or_else(String::new, |s| s.to_string())
}

/// What a medium scatters, by each way to make it: whatever the technique of shadows is.
fn scattered(all: &[Vec<Measurement>]) -> Table {
    let mut table = Table::new(
        "scattering",
        "The light that media scatter, by each technique, against rays: the error of this light alone, and the \
         time of the fastest frame with it",
        [
            Column::text("scene"),
            Column::text("picture"),
            Column::text("scattering"),
            Column::count("size"),
            Column::count("taps"),
            Column::text("map holds"),
            Column::fixed("rms", 4),
            Column::fixed("99 %", 3),
            Column::fixed("worst", 3),
            Column::number("time").of("ms"),
            Column::text("with"),
        ],
    );
    for of_subject in all {
        let mut told: Vec<Configuration> = Vec::new();
        for m in of_subject {
            let Some(errors) = m.scattered else {
                continue;
            };
            let c = &m.configuration;
            let is_same = |other: &Configuration| {
                (other.scattering, other.size, other.filter, other.fit)
                    == (c.scattering, c.size, c.filter, c.fit)
            };
            if told.iter().any(is_same) {
                continue;
            }
            told.push(*c);
            let alike = of_subject.iter().filter(|m| is_same(&m.configuration));
            let fastest = alike.min_by(|a, b| a.seconds().total_cmp(&b.seconds()));
            let fastest = fastest.unwrap_or(m);
            table.push([
                m.scene.as_str().into(),
                output_of(m).as_str().into(),
                scattering_of(c).as_str().into(),
                (c.size as usize).into(),
                (c.filter as usize).into(),
                c.fit.name().into(),
                errors.rms.into(),
                errors.percentile_99.into(),
                errors.worst.into(),
                millis(fastest.seconds()).into(),
                fastest.configuration.method().as_str().into(),
            ]);
        }
    }
    table
}

fn figures() -> Vec<Column> {
    vec![
        Column::number("time").of("ms"),
        Column::fixed("rms", 4),
        Column::fixed("99 %", 3),
        Column::fixed("worst", 3),
        Column::fixed("wrongly lit", 4),
        Column::fixed("wrongly dark", 4),
        Column::fixed("memory", 1).of("MB"),
    ]
}

fn figured(m: &Measurement) -> Vec<Cell> {
    let e = &m.errors;
    vec![
        millis(m.seconds()).into(),
        e.rms.into(),
        e.percentile_99.into(),
        e.worst.into(),
        e.wrongly_lit.into(),
        e.wrongly_dark.into(),
        (m.bytes as f64 / 1e6).into(),
    ]
}

fn configurations(all: &[Vec<Measurement>]) -> Table {
    let columns = identity().into_iter().chain(figures());
    let columns = columns.chain([Column::text("on the front")]);
    let mut table = Table::new("configurations", "All configurations", columns).detail();
    for of_subject in all {
        let front = front(of_subject);
        for (i, m) in of_subject.iter().enumerate() {
            let is_on = if front.contains(&i) { "yes" } else { "" };
            let row = identified(m).into_iter().chain(figured(m));
            table.push(row.chain([is_on.into()]));
        }
    }
    table
}

fn passes(all: &[Vec<Measurement>]) -> Table {
    let columns = identity().into_iter();
    let columns = columns.chain([Column::text("pass"), Column::number("time").of("ms")]);
    let mut table = Table::new("passes", "The passes of all configurations", columns).detail();
    for m in all.iter().flatten() {
        for pass in m.passes() {
            let more = [pass.name.as_str().into(), millis(pass.seconds).into()];
            table.push(identified(m).into_iter().chain(more));
        }
    }
    table
}

fn fronts(all: &[Vec<Measurement>]) -> Table {
    let columns = identity().into_iter().chain(figures());
    let caption = "Pareto fronts: no configuration that was measured is both faster and closer to the \
                   rays than one of these";
    let mut table = Table::new("fronts", caption, columns);
    for of_subject in all {
        for i in front(of_subject) {
            let m = &of_subject[i];
            table.push(identified(m).into_iter().chain(figured(m)));
        }
    }
    table
}

/// Pairs that differ in one thing: `other` gives the other one's configuration.
fn pairs<'m>(
    of_subject: &'m [Measurement],
    other: impl Fn(&Configuration) -> Option<Configuration>,
) -> Vec<(&'m Measurement, &'m Measurement)> {
    let found = |m: &'m Measurement| {
        let wanted = other(&m.configuration)?;
        let other = of_subject.iter().find(|o| o.configuration == wanted)?;
        Some((m, other))
    };
    of_subject.iter().filter_map(found).collect()
}

/// The geometric mean; 1 of none.
fn mean(ratios: &[f64]) -> f64 {
    let logarithms: Vec<f64> = ratios
        .iter()
        .map(|r| r.ln())
        .filter(|l| l.is_finite())
        .collect();
    (logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64).exp()
}

fn gain_of_fit(all: &[Vec<Measurement>]) -> Table {
    let fit = Fit::Camera;
    gain(
        "fit",
        "The effect of fitting the map to the camera's view, with everything else the same: geometric means over \
         all configurations of the error with a fitted map, divided by that of a map of the whole scene, and \
         of the times",
        all,
        |c| (c.fit != fit).then_some(Configuration { fit, ..*c }),
    )
}

fn gain_of_one_sample(all: &[Vec<Measurement>]) -> Table {
    let multisampling = 1;
    let with = |c: &Configuration| Configuration {
        multisampling,
        ..*c
    };
    gain(
        "one-sample",
        "The effect of one sample of depth in a texel, with everything else the same: geometric means over all \
         configurations of the error with one sample, divided by that with four, and of the times",
        all,
        |c| (c.multisampling != multisampling).then(|| with(c)),
    )
}

/// What another choice gives, all else alike.
fn gain(
    name: &'static str,
    what: &'static str,
    all: &[Vec<Measurement>],
    other: impl Fn(&Configuration) -> Option<Configuration>,
) -> Table {
    let mut table = Table::new(
        name,
        what,
        [
            Column::text("scene"),
            Column::text("picture"),
            Column::fixed("error", 3),
            Column::fixed("time", 3),
        ],
    );
    for of_subject in all {
        let pairs = pairs(of_subject, &other);
        let ratios = |of: fn(&Measurement) -> f64| -> Vec<f64> {
            pairs
                .iter()
                .map(|(one, other)| of(other) / of(one))
                .collect()
        };
        if let Some((m, _)) = pairs.first() {
            table.push([
                m.scene.as_str().into(),
                output_of(m).as_str().into(),
                mean(&ratios(|m| m.errors.rms)).into(),
                mean(&ratios(Measurement::seconds)).into(),
            ]);
        }
    }
    table
}

fn doubling(all: &[Vec<Measurement>]) -> Table {
    let mut table = Table::new(
        "doubling",
        "The factor by which a map of twice the size reduces the error: the mean and the maximum. A plan \
         assumes that the maximum is below the constant `plan::DOUBLING`",
        [
            Column::text("scene"),
            Column::text("picture"),
            Column::fixed("mean", 3),
            Column::fixed("most", 3),
            Column::text("whose"),
        ],
    );
    for of_subject in all {
        let pairs = pairs(of_subject, |c| {
            Some(Configuration {
                size: c.size * 2,
                ..*c
            })
        });
        let ratio = |(m, twice): &(&Measurement, &Measurement)| m.errors.rms / twice.errors.rms;
        let most = pairs.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        if let Some(most) = most {
            let ratios: Vec<f64> = pairs.iter().map(ratio).collect();
            table.push([
                most.0.scene.as_str().into(),
                output_of(most.0).as_str().into(),
                mean(&ratios).into(),
                ratio(most).into(),
                most.0.configuration.to_string().as_str().into(),
            ]);
        }
    }
    table
}

fn growths(all: &[Vec<Measurement>]) -> Table {
    let mut table = Table::new(
        "growth",
        "How the time of each pass grows: the exponent that fits best, and the first and the last time. \
         Everything else is fixed; times are geometric means over the fixed choices",
        [
            Column::text("method"),
            Column::text("pass"),
            Column::text("with"),
            Column::fixed("power", 2),
            Column::text("law"),
            Column::number("from"),
            Column::number("time").of("ms"),
            Column::number("to"),
            Column::number("time then").of("ms"),
        ],
    )
    .detail();
    let measurements: Vec<Measurement> = all.iter().flatten().cloned().collect();
    for g in growth(&measurements) {
        let (Some(first), Some(last)) = (g.points.first(), g.points.last()) else {
            continue;
        };
        table.push([
            g.method.as_str().into(),
            g.pass.as_str().into(),
            g.against.name().into(),
            g.exponent.into(),
            g.law().into(),
            first.0.into(),
            millis(first.1).into(),
            last.0.into(),
            millis(last.1).into(),
        ]);
    }
    table
}

fn pareto_plot(subject: &Subject, of_subject: &[Measurement]) -> Plot {
    let point = |m: &Measurement| Point {
        x: millis(m.seconds()),
        y: m.errors.rms,
        label: String::new(),
        title: format!(
            "{}: {:.2} ms, error {:.4}",
            m.configuration,
            millis(m.seconds()),
            m.errors.rms
        ),
    };
    let mut techniques: BTreeMap<&str, Vec<Point>> = BTreeMap::new();
    for m in of_subject {
        let of = techniques
            .entry(m.configuration.technique.name)
            .or_default();
        of.push(point(m));
    }
    let mut series: Vec<Series> = techniques
        .into_iter()
        .map(|(name, points)| Series {
            name: name.to_owned(),
            style: Style::Dots,
            points,
        })
        .collect();
    series.push(Series {
        name: "Pareto front".into(),
        style: Style::Front,
        points: front(of_subject)
            .into_iter()
            .map(|i| point(&of_subject[i]))
            .collect(),
    });
    let key = subject.key();
    Plot {
        id: key
            .replace(|c: char| !c.is_ascii_alphanumeric(), "-")
            .to_lowercase(),
        caption: format!("{key}: time against error; a pointer on a dot shows its configuration"),
        x: Axis::logarithmic("time of a frame [ms]"),
        y: Axis::logarithmic("rms error of the light"),
        series,
    }
}

impl Bench<'_> {
    /// Pictures of the front's configurations, and of what is wrong with each.
    fn gallery(
        &mut self,
        session: &Session,
        subject: &Subject,
        of_subject: &[Measurement],
    ) -> Result<Gallery> {
        let key = subject.key();
        let mut gallery = Gallery {
            caption: format!(
                "{key}: light by rays, and by the configurations on the front; orange is too light, blue \
                 too dark"
            ),
            pictures: Vec::new(),
        };
        let Some(truth) = session.truth(subject) else {
            return Ok(gallery);
        };
        let stem = key.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let folder: &Path = &self.args.out;
        let mut add = |picture: &Picture, what: String, name: String| -> Result<()> {
            let path: PathBuf = folder.join(&name);
            picture.save(Output::create(&path, &[])?)?;
            gallery.pictures.push((what, name));
            Ok(())
        };
        add(
            &truth.picture(),
            "rays".into(),
            format!("frames-{stem}-rays.png"),
        )?;
        let mut pictures = Pictures::default();
        for (i, m) in front(of_subject).into_iter().enumerate() {
            let m = &of_subject[m];
            let (device, shaders) = (&mut *self.device, &self.shaders);
            let (scene, mesh) = (&subject.scene, &subject.mesh);
            let light = pictures.light(device, shaders, scene, mesh, &m.configuration)?;
            let (name, rms) = (m.configuration, m.errors.rms);
            add(
                &light.picture(),
                format!("{name}: {:.2} ms, error {rms:.4}", millis(m.seconds())),
                format!("frames-{stem}-{i}.png"),
            )?;
            add(
                &light.off(&truth)?,
                format!("{name}: its error"),
                format!("frames-{stem}-{i}-off.png"),
            )?;
        }
        Ok(gallery)
    }

    /// Plans every subject within every error, and compares with what is fastest of all that was
    /// measured.
    fn plans(
        &mut self,
        subjects: &[Subject],
        all: &[Vec<Measurement>],
        quiet: bool,
    ) -> Result<(Table, bool)> {
        let mut table = Table::new(
            "plans",
            format!(
                "Plans, and the fastest of all configurations, found by measuring all. Both are timed in turns; a \
                 plan may take at most {MARGIN} times the time of the fastest. `none`: no configuration has so \
                 small an error"
            ),
            [
                Column::text("scene"),
                Column::fixed("error wanted", 3),
                Column::text("plan"),
                Column::fixed("predicted", 4),
                Column::fixed("measured", 4),
                Column::number("time").of("ms"),
                Column::text("fastest"),
                Column::number("its time").of("ms"),
                Column::fixed("ratio", 3),
                Column::count("compared with rays"),
                Column::fixed("planned in", 1).of("s"),
                Column::text("verdict"),
            ],
        );
        let mut fine = true;
        for (subject, of_subject) in subjects.iter().zip(all) {
            for error in &self.args.error {
                let row = self.planned(subject, of_subject, *error, quiet)?;
                fine &= row.last() == Some(&Cell::from("within"));
                table.push(row);
            }
        }
        Ok((table, fine))
    }

    fn planned(
        &mut self,
        subject: &Subject,
        of_subject: &[Measurement],
        error: f64,
        quiet: bool,
    ) -> Result<Vec<Cell>> {
        let wanted = Wanted {
            error,
            seconds: None,
            bytes: None,
        };
        let (device, shaders) = (&mut *self.device, &self.shaders);
        let (scene, mesh) = (&subject.scene, &subject.mesh);
        let mut progress = Progress::new(quiet);
        let start = Instant::now();
        let found = plan(
            device,
            shaders,
            scene,
            mesh,
            &self.choices,
            wanted,
            &mut progress,
        )?;
        let took = start.elapsed().as_secs_f64();
        drop(progress);
        let mut meeting: Vec<&Measurement> = of_subject
            .iter()
            .filter(|m| m.errors.rms <= error)
            .collect();
        meeting.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
        let name: Cell = subject.key().as_str().into();
        let Ok(found) = found else {
            let verdict = if meeting.is_empty() {
                "within"
            } else {
                "missed"
            };
            let fastest = meeting.first().map(|m| m.configuration.to_string());
            let fastest = fastest.unwrap_or_else(|| "none".into());
            let mut row = vec![name, error.into(), "none".into()];
            row.extend([Cell::Empty, Cell::Empty, Cell::Empty]);
            row.push(fastest.as_str().into());
            row.extend([Cell::Empty, Cell::Empty, Cell::Empty]);
            row.extend([took.into(), verdict.into()]);
            return Ok(row);
        };
        let same = |m: &&Measurement| m.configuration == found.configuration;
        let measured = of_subject.iter().find(same).map(|m| m.errors.rms);
        // The plan and its rivals in turns.
        let mut rivals: Vec<Configuration> = vec![found.configuration];
        let others = meeting.iter().map(|m| m.configuration);
        rivals.extend(others.filter(|c| *c != found.configuration).take(RIVALS));
        let mut rounds = vec![Vec::new(); rivals.len()];
        for _ in 0..BESIDE {
            for (c, times) in rivals.iter().zip(&mut rounds) {
                let scene = c.on(scene);
                times.push(sample(&mut *self.device, &self.shaders, &scene, mesh)?.seconds());
            }
        }
        let times: Vec<f64> = rounds.into_iter().map(median).collect();
        let order = (0..times.len()).min_by(|&i, &j| times[i].total_cmp(&times[j]));
        let fastest = order.unwrap_or(0);
        let ratio = times[0] / times[fastest];
        let is_near = measured.is_some_and(|measured| measured <= error);
        let verdict = match (is_near, ratio <= MARGIN) {
            (true, true) => "within",
            (false, _) => "too far off",
            (true, false) => "too slow",
        };
        Ok(vec![
            name,
            error.into(),
            found.choice.as_str().into(),
            found.error.rms.into(),
            measured.map_or(Cell::Empty, Cell::from),
            millis(times[0]).into(),
            rivals[fastest].to_string().as_str().into(),
            millis(times[fastest]).into(),
            ratio.into(),
            found.probed.into(),
            took.into(),
            verdict.into(),
        ])
    }
}
