//! The report as tables for people: in a terminal, and in Markdown.

use std::fmt::{self, Display};

use comfy_table::{Table, presets};
use hankel_host::parity::numbers::Found;

use crate::column::Column;
use crate::report::{Cell, Outcome, Report};

/// How wide the kernels' names may be in a terminal, in characters.
const NAMES: usize = 40;

/// How many lines of a tool's words are shown, and how many characters of a line.
const LINES: usize = 8;
const LINE: usize = 200;

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for column in &self.columns {
            write!(f, "{}: {}", column.column, plain(&column.how))?;
            if let Some(device) = &column.device {
                write!(f, " ({})", plain(device))?;
            }
            writeln!(f)?;
        }
        for tool in self.tools.iter().filter(|t| t.is_there()) {
            let version = tool.version.as_deref().unwrap_or("of unknown version");
            writeln!(f, "{}: {}", plain(&tool.name), plain(version))?;
        }
        let mut table = Table::new();
        table.load_preset(presets::ASCII_MARKDOWN);
        table.set_header(head(self));
        for row in merged(self) {
            let mut line = vec![wrapped(&row.kernels)];
            line.extend(row.cells);
            table.add_row(line);
        }
        writeln!(f, "\n{table}\n")?;
        for row in &self.kernels {
            for (i, (column, cell)) in row.cells.iter().enumerate() {
                // What is wrong natively is the same in all columns.
                if let Outcome::NoReference { problem } = &cell.outcome {
                    if i == 0 {
                        let [name, problem] = [&row.kernel, problem].map(|t| plain(t));
                        writeln!(f, "{name}: the native scalar run fails\n    {problem}\n")?;
                    }
                } else if cell.outcome.fails() {
                    failure(f, &format!("{}, {column}", plain(&row.kernel)), cell)?;
                }
            }
        }
        notes_in_words(f, self)?;
        section(f, "Complaints", self.complaints.iter().map(|c| plain(c)))?;
        writeln!(f, "{}", tally(self))?;
        let [kernels, columns] = [
            (self.kernels.len(), "kernel"),
            (self.columns.len(), "column"),
        ]
        .map(|(n, what)| count(n, what));
        writeln!(
            f,
            "{kernels} in {columns}: {}; {} from the cache; {:.1} s",
            verdict(self),
            self.cached,
            self.seconds
        )
    }
}

impl Report {
    /// The matrix alone, as Markdown: kernels whose cells all read the same share a row. Cells are
    /// not padded, so that one more kernel changes one line.
    #[must_use]
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|c| c.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let head = head(self);
        let mut text = line(&head) + &format!("|{}\n", " --- |".repeat(head.len()));
        for row in merged(self) {
            let code = |name: &String| format!("`{}`", name.replace('`', "'"));
            let names: Vec<String> = row.kernels.iter().map(code).collect();
            let in_f64 = row.kernels.iter().all(|name| name.ends_with("_f64"));
            let mut cells = vec![if in_f64 && names.len() > FEW {
                format!("{} kernels in f64", names.len())
            } else {
                names.join(", ")
            }];
            cells.extend(row.cells);
            text += &line(&cells);
        }
        text
    }
}

/// More kernels than these in f64 are counted in Markdown, not named.
const FEW: usize = 4;

/// Kernels whose cells all read the same.
struct Merged {
    kernels: Vec<String>,
    cells: Vec<String>,
}

fn head(report: &Report) -> Vec<String> {
    let columns = report.columns.iter().map(|c| c.column.to_string());
    std::iter::once("kernel".into()).chain(columns).collect()
}

/// The rows, each where the first of its kernels stands.
fn merged(report: &Report) -> Vec<Merged> {
    let mut all: Vec<Merged> = Vec::new();
    for row in &report.kernels {
        let text = |c: Column| row.cells.get(&c).map_or_else(String::new, brief);
        let cells: Vec<String> = report.columns.iter().map(|c| text(c.column)).collect();
        let name = plain(&row.kernel);
        match all.iter_mut().find(|m| m.cells == cells) {
            Some(same) => same.kernels.push(name),
            None => all.push(Merged {
                kernels: vec![name],
                cells,
            }),
        }
    }
    all
}

/// Names in lines that are no longer than they have to be.
fn wrapped(names: &[String]) -> String {
    let mut text = String::new();
    let mut width = 0;
    for (i, name) in names.iter().enumerate() {
        let comma = usize::from(i + 1 < names.len());
        let more = name.chars().count() + comma;
        if width > 0 && width + 1 + more > NAMES {
            text.push('\n');
            width = 0;
        } else if width > 0 {
            text.push(' ');
            width += 1;
        }
        text += name;
        text += &",".repeat(comma);
        width += more;
    }
    text
}

/// A cell in a few characters.
pub(crate) fn brief(cell: &Cell) -> String {
    match (sort(cell), &cell.found) {
        ("near", Some(found)) => absolute(found),
        (word, _) => word.into(),
    }
}

/// How a cell ended, in a word: as [`Outcome::word`], but a pass is `same`, or `near` where numbers
/// differ by no more than they may.
pub(crate) fn sort(cell: &Cell) -> &'static str {
    match (&cell.outcome, &cell.found) {
        (Outcome::Passed, Some(found)) if found.largest_ulp > 0 => "near",
        (Outcome::Passed, _) => "same",
        (outcome, _) => outcome.word(),
    }
}

/// The largest difference.
pub(crate) fn absolute(found: &Found) -> String {
    found
        .largest_absolute
        .map_or_else(|| "inf".into(), |x| format!("{x:.1e}"))
}

/// How far apart, in units in the last place: a number and a NaN are the most that there is.
pub(crate) fn ulp(n: u64) -> String {
    match n {
        u64::MAX => "one is NaN".into(),
        0..1_000_000 => format!("{n} ulp"),
        _ => format!("{n:.1e} ulp"),
    }
}

/// What a comparison found, in a sentence.
pub(crate) fn sentence(found: &Found) -> String {
    let mut text = match found.beyond {
        0 => format!("all of {} numbers are within what is allowed", found.values),
        n => format!(
            "{n} of {} numbers {} beyond what is allowed",
            found.values,
            if n == 1 { "is" } else { "are" }
        ),
    };
    match found.largest_ulp {
        0 => {}
        u64::MAX => text += "; of some pairs one is NaN",
        n => {
            let [ulp, absolute] = [ulp(n), absolute(found)];
            text += &format!("; the largest differences are {ulp} and {absolute} absolute");
        }
    }
    text
}

/// How many cells fail, and how many complaints there are.
pub(crate) fn verdict(report: &Report) -> String {
    let cells = || report.kernels.iter().flat_map(|r| r.cells.values());
    let failing = cells().filter(|c| c.outcome.fails()).count();
    let missing = cells()
        .filter(|c| matches!(c.outcome, Outcome::NotInstalled { .. }))
        .count();
    let verb = if failing == 1 { "fails" } else { "fail" };
    let mut parts = match failing {
        0 if missing == 0 && report.complaints.is_empty() => return "all pass".into(),
        0 => vec!["no cell fails".to_owned()],
        n => vec![format!("{} {verb}", count(n, "cell"))],
    };
    if missing > 0 {
        parts.push(format!("{} not installed", count(missing, "cell")));
    }
    if !report.complaints.is_empty() {
        parts.push(count(report.complaints.len(), "complaint"));
    }
    parts.join(", ")
}

/// How the cells ended: "all pass" says nothing of those that did not run.
pub(crate) fn tally(report: &Report) -> String {
    let cells = || report.kernels.iter().flat_map(|r| r.cells.values());
    let parts = [
        ("the same", &["same"][..]),
        ("within what is allowed", &["near"]),
        ("known to fail", &["known"]),
        ("not run", &["lacks", "-", "missing"]),
        (
            "failing",
            &[
                "FAIL", "INFINITE", "NATIVE", "REFUSED", "CRASHED", "TIMEOUT",
            ],
        ),
    ];
    let parts: Vec<String> = parts
        .into_iter()
        .map(|(name, words)| (name, cells().filter(|c| words.contains(&sort(c))).count()))
        .filter(|(_, n)| *n > 0)
        .map(|(name, n)| format!("{n} {name}"))
        .collect();
    format!("{}: {}", count(cells().count(), "cell"), parts.join(", "))
}

/// A number of things.
pub(crate) fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Why cells did not run, or may fail: the same for many of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Note<'a> {
    /// The outcome's word.
    pub word: &'static str,
    /// What differs, lacks, is missing or cannot be said.
    pub what: &'a str,
    /// Why it differs, or the command that installs it.
    pub more: Option<&'a str>,
    /// The issue of whoever is to mend it.
    pub upstream: Option<&'a str>,
}

/// The note that a cell has.
pub(crate) fn note(outcome: &Outcome) -> Option<Note<'_>> {
    let (what, more, upstream) = match outcome {
        Outcome::Known {
            what,
            why,
            upstream,
            ..
        } => (what, Some(why), upstream.as_deref()),
        Outcome::Inexpressible { reason } => (reason, None, None),
        Outcome::Lacking { what } => (what, None, None),
        Outcome::NotInstalled { what, install } => (what, Some(install), None),
        Outcome::Passed
        | Outcome::Differs
        | Outcome::NotFinite { .. }
        | Outcome::NoReference { .. }
        | Outcome::Foreign { .. } => return None,
    };
    Some(Note {
        word: outcome.word(),
        what,
        more: more.map(String::as_str),
        upstream,
    })
}

/// A note with the cells that have it: kernels by their place, and columns.
pub(crate) type Noted<'a> = (Note<'a>, Vec<(usize, Column)>);

/// Every note once.
pub(crate) fn notes(report: &Report) -> Vec<Noted<'_>> {
    let mut all: Vec<Noted<'_>> = Vec::new();
    for (i, row) in report.kernels.iter().enumerate() {
        for (column, cell) in &row.cells {
            let Some(note) = note(&cell.outcome) else {
                continue;
            };
            match all.iter_mut().find(|(n, _)| *n == note) {
                Some((_, cells)) => cells.push((i, *column)),
                None => all.push((note, vec![(i, *column)])),
            }
        }
    }
    all
}

/// How many cells, of which columns.
pub(crate) fn places(cells: &[(usize, Column)]) -> String {
    let mut columns: Vec<Column> = cells.iter().map(|(_, c)| *c).collect();
    columns.sort();
    columns.dedup();
    let columns: Vec<&str> = columns.iter().map(|c| c.id()).collect();
    format!("{}: {}", count(cells.len(), "cell"), columns.join(", "))
}

fn notes_in_words(f: &mut fmt::Formatter<'_>, report: &Report) -> fmt::Result {
    let all = notes(report);
    for (word, title) in [
        ("known", "Known differences"),
        ("lacks", "What devices lack"),
        ("-", "What languages cannot express"),
        ("missing", "Not installed"),
    ] {
        let of_word = all.iter().filter(|(note, _)| note.word == word);
        let lines = of_word.map(|(note, cells)| {
            let mut text = format!("{} ({})", plain(note.what), places(cells));
            if let Some(more) = note.more {
                text += &format!("\n    {}", plain(more));
            }
            if let Some(upstream) = note.upstream {
                text += &format!("\n    {}", plain(upstream));
            }
            text
        });
        section(f, title, lines)?;
    }
    Ok(())
}

fn section(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    lines: impl Iterator<Item = String>,
) -> fmt::Result {
    let mut lines = lines.peekable();
    if lines.peek().is_none() {
        return Ok(());
    }
    writeln!(f, "{title}:")?;
    for line in lines {
        writeln!(f, "  {line}")?;
    }
    writeln!(f)
}

/// What is said of results that are not finite.
pub(crate) fn not_finite(numbers: u64) -> String {
    let numbers = usize::try_from(numbers).unwrap_or(usize::MAX);
    format!(
        "{} of the native results not finite, though all inputs are; if that is meant, the kernel declares it: `parity(non_finite, why = \"…\")`",
        count(numbers, "number")
    )
}

fn failure(f: &mut fmt::Formatter<'_>, name: &str, cell: &Cell) -> fmt::Result {
    write!(f, "{name}: {}", cell.outcome.word())?;
    if let Some(found) = &cell.found {
        write!(f, ": {}", sentence(found))?;
    }
    writeln!(f)?;
    if let Outcome::NotFinite { count } = &cell.outcome {
        writeln!(f, "    {}", not_finite(*count))?;
    }
    if let Outcome::Foreign { failure } = &cell.outcome {
        let words = failure.to_string();
        let mut lines = words.lines().filter(|l| !l.trim().is_empty());
        for line in lines.by_ref().take(LINES) {
            writeln!(f, "    {}", clipped(line))?;
        }
        match lines.count() {
            0 => {}
            n => writeln!(
                f,
                "    ({} more in the JSON and HTML reports)",
                count(n, "line")
            )?,
        }
    }
    if let Some(d) = cell.found.as_ref().and_then(|found| found.first.as_ref()) {
        writeln!(
            f,
            "    {} inputs, invocation {}: {} is {}, expected {} ({})",
            d.class,
            d.invocation,
            plain(&d.value),
            plain(&d.got),
            plain(&d.expected),
            ulp(d.ulp)
        )?;
        let inputs: Vec<String> = d.inputs.iter().map(|(n, v)| format!("{n} = {v}")).collect();
        if !inputs.is_empty() {
            writeln!(f, "    {}", plain(&inputs.join(", ")))?;
        }
    }
    if let Some(line) = &cell.line {
        writeln!(f, "    line {}: {}", line.number, clipped(&line.text))?;
    }
    writeln!(f)
}

/// Words of others in one line, without what a terminal would act on.
fn plain(text: &str) -> String {
    let text = text.trim();
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

/// The same, cut where it is too long.
fn clipped(text: &str) -> String {
    let text = plain(text);
    match text.char_indices().nth(LINE) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::collections::BTreeMap;

    use hankel_dsl::native::describe::Tolerance;
    use hankel_host::inputs::Class;
    use hankel_host::parity::numbers::{Difference, Rules};

    use super::*;
    use crate::process::Failure;
    use crate::report::{ColumnReport, Line, Row};
    use crate::tools::{Status, Tool};

    /// A report with every outcome, with `words` after everything that is a text.
    pub(crate) fn everything(words: &str) -> Report {
        let say = |text: &str| format!("{text}{words}");
        let first = Difference {
            class: Class::Edge,
            invocation: 7,
            value: say("out.x"),
            expected: say("1.0"),
            got: say("NaN"),
            ulp: u64::MAX,
            inputs: vec![(say("moments.x"), say("0.5"))],
        };
        let found = |largest_ulp, largest_absolute, beyond| {
            Some(Found {
                cases: 10,
                values: 40,
                largest_ulp,
                largest_absolute,
                beyond,
                first: (largest_ulp > 0).then(|| first.clone()),
            })
        };
        let line = Some(Line {
            number: 12,
            text: say("float y = x;"),
        });
        let ran = |outcome, found| Cell {
            outcome,
            found,
            rules: Some(Rules {
                tolerance: Tolerance {
                    ulp: 4,
                    absolute: 1e-6,
                    non_finite: false,
                    why: say("a square root"),
                },
                flushes: true,
                rounds_products: false,
                hostile: false,
            }),
            line: line.clone(),
            seconds: 0.5,
        };
        let foreign = |failure| Outcome::Foreign { failure };
        let log = say(&"a word\n".repeat(12));
        let refused = foreign(Failure::refused(&log));
        let outcomes = [
            ran(Outcome::Passed, found(0, Some(0.0), 0)),
            ran(Outcome::Passed, found(3, Some(1.2e-7), 0)),
            ran(Outcome::Passed, found(3, None, 0)),
            ran(Outcome::Differs, found(u64::MAX, None, 2)),
            ran(refused.clone(), None),
            ran(
                foreign(Failure::Crashed {
                    program: say("node"),
                    how: say("signal 11"),
                    log: log.clone(),
                }),
                None,
            ),
            ran(
                foreign(Failure::TimedOut {
                    program: say("node"),
                    seconds: 60,
                    log: log.clone(),
                }),
                None,
            ),
            ran(
                Outcome::Known {
                    what: say("no doubles"),
                    why: say("it is old"),
                    upstream: Some(say("https://example.org/1?a=1&b=2")),
                    how: Box::new(refused),
                },
                None,
            ),
            Cell::unrun(Outcome::Inexpressible {
                reason: say("no stores"),
            }),
            Cell::unrun(Outcome::Lacking {
                what: say("shaderFloat64"),
            }),
            Cell::unrun(Outcome::NotInstalled {
                what: say("Chromium"),
                install: say("apt-get install chromium"),
            }),
        ];
        let columns = &Column::ALL[..outcomes.len()];
        let row = |name: &str, cells| Row {
            kernel: say(name),
            stage: say("compute"),
            invocations: 10,
            non_finite: 1,
            cells,
        };
        let all: BTreeMap<Column, Cell> = columns.iter().copied().zip(outcomes).collect();
        let same = all[&Column::Native].clone();
        let passes: BTreeMap<Column, Cell> = columns.iter().map(|c| (*c, same.clone())).collect();
        let status = |there: bool| Status {
            tool: Tool::Chromium,
            name: say("Chromium"),
            purpose: say("runs WGSL"),
            licence: say("BSD"),
            licence_file: None,
            path: there.then(|| say("/usr/bin/chromium").into()),
            version: there.then(|| say("1.2")),
            files: Vec::new(),
            problem: (!there).then(|| say("too old")),
            install: say("apt-get install chromium"),
        };
        Report {
            hankel: say("0.1.0"),
            seed: 1,
            columns: columns
                .iter()
                .map(|column| ColumnReport {
                    column: *column,
                    how: say(column.how()),
                    device: Some(say("llvmpipe")),
                })
                .collect(),
            tools: vec![status(true), status(false)],
            kernels: vec![
                row("vsm", passes.clone()),
                row("blur", all),
                row("moment_bound_compensated_n2", passes.clone()),
                row("moment_bound_compensated_n3", passes),
            ],
            complaints: vec![say("take it off the list")],
            seconds: 1.25,
            cached: 3,
            passed: false,
        }
    }

    #[test]
    fn kernels_that_read_the_same_share_a_row_of_markdown() {
        let text = everything("").markdown();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(lines[1].starts_with("| --- | --- |"), "{text}");
        assert_eq!(
            lines[2].split(" | ").next().unwrap(),
            "| `vsm`, `moment_bound_compensated_n2`, `moment_bound_compensated_n3`"
        );
        assert_eq!(
            lines[3],
            "| `blur` | same | 1.2e-7 | inf | FAIL | REFUSED | CRASHED | TIMEOUT | known | - | lacks | missing |"
        );
        let foreign = everything(" |\n").markdown();
        assert_eq!(foreign.lines().count(), 4, "{foreign}");
        assert!(foreign.contains("| `blur \\|` |"), "{foreign}");
    }

    #[test]
    fn a_terminal_gets_every_failure_and_every_reason_once() {
        let text = everything("").to_string();
        for words in [
            "| vsm, moment_bound_compensated_n2,",
            "| moment_bound_compensated_n3 ",
            "FAIL: 2 of 40 numbers are beyond what is allowed",
            "edge inputs, invocation 7: out.x is NaN, expected 1.0 (one is NaN)",
            "moments.x = 0.5",
            "line 12: float y = x;",
            "CRASHED\n    node crashed: signal 11\n    a word",
            "(5 lines more in the JSON and HTML reports)",
            "no doubles (1 cell: essl310)\n    it is old\n    https://example.org/1?a=1&b=2\n",
            "shaderFloat64 (1 cell: hlsl-dxc)",
            "no stores (1 cell: essl300)",
            "Chromium (1 cell: hlsl-glslang)\n    apt-get install chromium\n",
            "Complaints:\n  take it off the list\n",
            "\n44 cells: 34 the same, 2 within what is allowed, 1 known to fail, 3 not run, 4 failing\n",
            "\n4 kernels in 11 columns: 4 cells fail, 1 cell not installed, 1 complaint; 3 from the cache; 1.2 s\n",
        ] {
            assert!(text.contains(words), "{words:?} is not in\n{text}");
        }
        assert!(!everything("\x1b[2J").to_string().contains('\x1b'));
    }

    #[test]
    fn a_run_without_failures_says_so() {
        let mut report = everything("");
        report.kernels.truncate(1);
        report.complaints.clear();
        let text = report.to_string();
        assert!(
            text.contains("\n1 kernel in 11 columns: all pass; 3 "),
            "{text}"
        );
        report.complaints.push("rotten".into());
        assert_eq!(verdict(&report), "no cell fails, 1 complaint");
    }
}
