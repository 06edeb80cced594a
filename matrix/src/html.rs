//! The report as one page for people: nothing outside it is needed, and no script.

use crate::column::Column;
use crate::report::{Cell, Outcome, Report, Row};
use crate::table::{
    Note, absolute, count, note, notes, places, sentence, sort, tally, ulp, verdict,
};

const STYLE: &str = "\
:root { color-scheme: light dark; --text: #1a1a1a; --page: #fff; --faint: #5c5c5c; --line: #d4d4d4; --code: #f3f3f3; --link: #0b57a4;
  --same: #e7f5e9; --near: #d3ecf5; --known: #fff0c7; --lacks: #ece6f5; --none: #f3f3f3; --missing: #e3e3e3; --fail: #b3261e; --on-fail: #fff; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e6e6e6; --page: #161616; --faint: #a3a3a3; --line: #3d3d3d; --code: #242424; --link: #8ab8f0;
    --same: #17301c; --near: #133240; --known: #453605; --lacks: #332848; --none: #202020; --missing: #343434; --fail: #f2a49c; --on-fail: #2a0400; }
}
body { font: 15px/1.5 system-ui, sans-serif; margin: 1.5rem auto; max-width: 84rem; padding: 0 1rem; color: var(--text); background: var(--page); }
h1 { font-size: 1.5rem; margin: 0 0 .3rem; }
h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .2rem; overflow-wrap: anywhere; }
p { margin: .3rem 0; max-width: 60rem; }
a { color: var(--link); }
code, pre { font-family: ui-monospace, monospace; font-size: .87em; background: var(--code); }
code { padding: .1em .3em; overflow-wrap: anywhere; }
pre { padding: .5rem .7rem; margin: .3rem 0; max-height: 24rem; overflow: auto; white-space: pre-wrap; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; margin: .3rem 0; }
dt { color: var(--faint); }
dd { margin: 0; overflow-wrap: anywhere; }
.verdict { font-size: 1.1rem; font-weight: 600; }
.verdict.bad, .complaints { border-left: .3rem solid var(--fail); padding-left: .7rem; }
ul.complaints { padding-left: 2rem; margin: .3rem 0; }
table { border-collapse: separate; border-spacing: 0; font-size: .87rem; }
th[scope=row], .legend th { white-space: nowrap; }
th, td { padding: .2rem .5rem; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
.wide { overflow: auto; border: 1px solid var(--line); }
.matrix { max-height: 85vh; max-width: max-content; }
.matrix table { font-size: .78rem; line-height: 1.3; }
.matrix th, .matrix td { padding: .2rem .35rem; border-right: 1px solid var(--line); background: var(--page); }
.matrix td { text-align: center; vertical-align: middle; white-space: nowrap; }
.matrix thead th { position: sticky; top: 0; z-index: 1; vertical-align: bottom; }
.matrix tr > :first-child { position: sticky; left: 0; z-index: 1; white-space: nowrap; font-weight: 500; vertical-align: middle; }
.matrix thead tr > :first-child { z-index: 2; }
td a { color: inherit; text-decoration: underline dotted; }
small { display: block; font-size: .9em; }
.matrix .same, .legend .same { background: var(--same); }
.matrix .near, .legend .near { background: var(--near); }
.matrix .known, .legend .known { background: var(--known); }
.matrix .lacks, .legend .lacks { background: var(--lacks); }
.matrix .none, .legend .none { background: var(--none); color: var(--faint); }
.matrix .missing, .legend .missing { background: var(--missing); }
.matrix .fail, .legend .fail { background: var(--fail); color: var(--on-fail); font-weight: 700; }
.legend td:first-child { text-align: center; white-space: nowrap; }
details { border: 1px solid var(--line); margin: .4rem 0; padding: .3rem .7rem; }
summary { cursor: pointer; overflow-wrap: anywhere; }
.body { scroll-margin-top: 3rem; }
.body:target, h3:target { outline: .15rem solid var(--link); outline-offset: .2rem; }
@page { size: landscape; margin: 1cm; }
@media print {
  body { max-width: none; margin: 0; padding: 0; font-size: 9pt; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  .wide, .matrix, pre { max-height: none; overflow: visible; border: 0; }
  .matrix table { font-size: 6.5pt; }
  .matrix thead th, .matrix tr > :first-child { position: static; }
  tr, summary { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
}
";

/// What cells read (as [`sort`] says it), and what that means.
const LEGEND: [(&str, &str); 13] = [
    (
        "same",
        "ran, and gave the same bits as the native scalar run; zeros of either sign are equal, and so \
         are NaNs, and subnormal numbers and zeros where they may be flushed; of hostile inputs, a \
         kernel with a tolerance need only keep finite results finite",
    ),
    (
        "near",
        "ran, and is within what the kernel may differ by: the largest absolute difference, and the \
         largest in units in the last place",
    ),
    ("known", "fails, as the list of known differences says"),
    (
        "lacks",
        "the device that is there lacks a feature that the kernel needs",
    ),
    ("-", "the language cannot express the kernel"),
    (
        "missing",
        "something that the column takes is not installed",
    ),
    ("FAIL", "ran, and gave other numbers than it may"),
    (
        "INFINITE",
        "finite inputs give infinities or NaN natively, and the kernel does not declare it",
    ),
    (
        "NATIVE",
        "the native run itself failed: there is nothing to compare with",
    ),
    ("REFUSED", "a compiler or driver refused it"),
    (
        "CRASHED",
        "a compiler, driver or browser ended without an answer",
    ),
    (
        "TIMEOUT",
        "a compiler, driver or browser gave no answer in time",
    ),
    ("", "not run"),
];

/// The page.
#[must_use]
pub fn page(report: &Report) -> String {
    let title = format!("Parity matrix of Hankel {}", escape(&report.hankel));
    let sections = [
        summary(report),
        complaints(report),
        matrix(report),
        legend(report),
        failures(report),
        reasons(report),
        near(report),
        columns(report),
        tools(report),
        kernels(report),
    ]
    .concat();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{sections}</body>\n</html>\n"
    )
}

fn summary(report: &Report) -> String {
    let class = if report.passed { "good" } else { "bad" };
    format!(
        "<p class=\"verdict {class}\">{} in {}: {}.</p>\n<p>{}.</p>\n{}",
        count(report.kernels.len(), "kernel"),
        count(report.columns.len(), "column"),
        verdict(report),
        tally(report),
        facts(&[
            ("Took", format!("{:.1} s", report.seconds)),
            ("From the cache", count(report.cached, "cell")),
            ("Seed of the inputs", report.seed.to_string()),
        ])
    )
}

fn complaints(report: &Report) -> String {
    if report.complaints.is_empty() {
        return String::new();
    }
    let items: String = report
        .complaints
        .iter()
        .map(|c| format!("<li>{}</li>\n", escape(c)))
        .collect();
    format!("<h2>Complaints</h2>\n<ul class=\"complaints\">\n{items}</ul>\n")
}

fn matrix(report: &Report) -> String {
    let noted: Vec<Note<'_>> = notes(report).into_iter().map(|(note, _)| note).collect();
    let mut rows = String::new();
    for (i, row) in report.kernels.iter().enumerate() {
        rows += &format!("<tr><th scope=\"row\">{}</th>", escape(&row.kernel));
        for column in &report.columns {
            rows += &match row.cells.get(&column.column) {
                Some(cell) => {
                    let text = match target(&noted, i, column.column, cell) {
                        Some(id) => format!("<a href=\"#{id}\">{}</a>", brief(cell)),
                        None => brief(cell),
                    };
                    format!("<td class=\"{}\">{text}</td>", class(sort(cell)))
                }
                None => "<td></td>".into(),
            };
        }
        rows += "</tr>\n";
    }
    let names = report.columns.iter().map(|c| c.column.to_string());
    let head = heads(std::iter::once("kernel".into()).chain(names));
    format!(
        "<h2>Matrix</h2>\n<div class=\"wide matrix\" tabindex=\"0\" role=\"region\" aria-label=\"Matrix\">\n\
         <table>\n<thead>\n{head}</thead>\n<tbody>\n{rows}</tbody>\n</table>\n</div>\n"
    )
}

/// Where a cell's details are.
fn target(noted: &[Note<'_>], row: usize, column: Column, cell: &Cell) -> Option<String> {
    match note(&cell.outcome) {
        Some(note) if note.word != "known" => {
            Some(format!("n{}", noted.iter().position(|n| *n == note)?))
        }
        None if sort(cell) == "same" => None,
        _ => Some(place(row, column)),
    }
}

fn place(row: usize, column: Column) -> String {
    format!("d{row}-{column}")
}

fn brief(cell: &Cell) -> String {
    match (sort(cell), &cell.found) {
        ("near", Some(found)) => {
            let ulp = ulp(found.largest_ulp);
            format!("{}<small>{ulp}</small>", absolute(found))
        }
        (word, _) => word.into(),
    }
}

fn class(word: &str) -> &str {
    match word {
        "FAIL" | "INFINITE" | "NATIVE" | "REFUSED" | "CRASHED" | "TIMEOUT" => "fail",
        "-" => "none",
        other => other,
    }
}

fn legend(report: &Report) -> String {
    let cells = || {
        report
            .kernels
            .iter()
            .flat_map(|r| report.columns.iter().map(|c| r.cells.get(&c.column)))
    };
    let rows: String = LEGEND
        .iter()
        .map(|(word, meaning)| {
            let n = cells().filter(|c| c.map_or("", sort) == *word).count();
            if word.is_empty() && n == 0 {
                return String::new();
            }
            let sample = match *word {
                "near" => "1.2e-7<small>3 ulp</small>",
                word => word,
            };
            let class = class(word);
            format!(
                "<tr><td class=\"{class}\">{sample}</td><td class=\"number\">{n}</td><td>{meaning}</td></tr>\n"
            )
        })
        .collect();
    let head = heads(
        ["cell", "how many", "meaning"]
            .map(String::from)
            .into_iter(),
    );
    format!(
        "<h2>Legend</h2>\n<table class=\"legend\">\n<thead>\n{head}</thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    )
}

fn failures(report: &Report) -> String {
    let all = blocks(report, true, |cell| cell.outcome.fails());
    if all.is_empty() {
        return all;
    }
    format!("<h2>Failures</h2>\n{all}")
}

fn near(report: &Report) -> String {
    let all = blocks(report, false, |cell| sort(cell) == "near");
    if all.is_empty() {
        return all;
    }
    format!("<h2>Within what is allowed, but not the same bits</h2>\n{all}")
}

fn blocks(report: &Report, open: bool, which: impl Fn(&Cell) -> bool) -> String {
    report
        .kernels
        .iter()
        .enumerate()
        .flat_map(|(i, row)| row.cells.iter().map(move |(c, cell)| (i, row, *c, cell)))
        .filter(|(.., cell)| which(cell))
        .map(|(i, row, column, cell)| block(i, row, column, cell, open))
        .collect()
}

/// A cell's details. What links to them stands below the summary: browsers open `details` for a
/// target in them, not for themselves.
fn block(i: usize, row: &Row, column: Column, cell: &Cell, open: bool) -> String {
    let outcome = match &cell.outcome {
        Outcome::Known { how, .. } => how,
        other => other,
    };
    let found = cell.found.as_ref();
    let mut body = String::new();
    let mut known = Vec::new();
    if let Some(d) = found.and_then(|f| f.first.as_ref()) {
        known.extend([
            ("Number", code(&d.value)),
            ("Got", code(&d.got)),
            ("Expected", code(&d.expected)),
            ("Apart", ulp(d.ulp)),
            (
                "Inputs",
                format!(
                    "{}, invocation {}",
                    escape(&d.class.to_string()),
                    d.invocation
                ),
            ),
        ]);
        let inputs: Vec<String> = d
            .inputs
            .iter()
            .map(|(name, value)| code(&format!("{name} = {value}")))
            .collect();
        if !inputs.is_empty() {
            known.push(("Read", inputs.join(" ")));
        }
    }
    // What did not run differs by nothing.
    if let Some(rules) = cell.rules.as_ref().filter(|_| found.is_some()) {
        let t = &rules.tolerance;
        let mut allowed = format!("{} or {:e} absolute: ", ulp(t.ulp.into()), t.absolute);
        allowed += &escape(&t.why);
        if rules.flushes {
            allowed += "; subnormal numbers may be taken for zero";
        }
        if rules.rounds_products {
            allowed += "; samplers round products of weights";
        }
        if !rules.hostile {
            allowed += "; of hostile inputs, finite results need only stay finite";
        }
        known.push(("Allowed", allowed));
    }
    body += &facts(&known);
    if let Outcome::Foreign { failure } = outcome {
        body += &format!("<pre>{}</pre>\n", escape(&failure.to_string()));
    }
    if let Outcome::NotFinite { count } = outcome {
        body += &format!("<p>{}.</p>\n", escape(&crate::table::not_finite(*count)));
    }
    if let Outcome::NoReference { problem } = outcome {
        body += &format!("<pre>{}</pre>\n", escape(problem));
    }
    if let Some(line) = &cell.line {
        let [number, text] = [line.number.to_string(), escape(&line.text)];
        body += &format!("<p>Line {number} of the generated text:</p>\n<pre>{text}</pre>\n");
    }
    let what = match (sort(cell), found) {
        ("near", Some(found)) => format!(": {}", sentence(found)),
        (_, Some(found)) => format!(": {}; {}", outcome.word(), sentence(found)),
        (_, None) => format!(": {}", outcome.word()),
    };
    let open = if open { " open" } else { "" };
    format!(
        "<details{open}>\n<summary><b>{}, {column}</b>{what}</summary>\n<div class=\"body\" id=\"{}\">\n{body}</div>\n</details>\n",
        escape(&row.kernel),
        place(i, column)
    )
}

/// Known differences, and why cells did not run: each once.
fn reasons(report: &Report) -> String {
    let all = notes(report);
    let mut text = String::new();
    for (word, title) in [
        ("known", "Known differences"),
        ("lacks", "What devices lack"),
        ("-", "What languages cannot express"),
        ("missing", "What is not installed"),
    ] {
        let of_word: String = all
            .iter()
            .enumerate()
            .filter(|(_, (note, _))| note.word == word)
            .map(|(i, (note, cells))| reason(report, i, note, cells))
            .collect();
        if !of_word.is_empty() {
            text += &format!("<h2>{title}</h2>\n{of_word}");
        }
    }
    text
}

fn reason(report: &Report, i: usize, note: &Note<'_>, cells: &[(usize, Column)]) -> String {
    let mut text = format!("<h3 id=\"n{i}\">{}</h3>\n", escape(note.what));
    if let Some(more) = note.more {
        text += &match note.word {
            "missing" => format!("<pre>{}</pre>\n", escape(more)),
            _ => format!("<p>{}</p>\n", escape(more)),
        };
    }
    if let Some(upstream) = note.upstream {
        text += &format!("<p>Upstream: {}</p>\n", link(upstream));
    }
    if note.word == "known" {
        text += &format!("<p>{}</p>\n", places(cells));
        for (row, column) in cells {
            let kernel = &report.kernels[*row];
            text += &block(*row, kernel, *column, &kernel.cells[column], false);
        }
        return text;
    }
    let mut kernels: Vec<String> = Vec::new();
    for row in &report.columns {
        let names = cells.iter().filter(|(_, c)| *c == row.column);
        let names: Vec<String> = names
            .map(|(k, _)| escape(&report.kernels[*k].kernel))
            .collect();
        if !names.is_empty() {
            kernels.push(format!("<p>{}: {}</p>\n", row.column, names.join(", ")));
        }
    }
    let places = places(cells);
    text + &format!(
        "<details>\n<summary>{places}</summary>\n{}</details>\n",
        kernels.concat()
    )
}

fn columns(report: &Report) -> String {
    let occurs = |word: &str| {
        let mut cells = report.kernels.iter().flat_map(|r| r.cells.values());
        cells.any(|c| sort(c) == word)
    };
    let words: Vec<&str> = LEGEND
        .iter()
        .map(|(word, _)| *word)
        .filter(|word| occurs(word))
        .collect();
    let mut rows = String::new();
    for column in &report.columns {
        rows += &format!(
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td>",
            column.column,
            escape(&column.how),
            escape(column.device.as_deref().unwrap_or("-"))
        );
        for word in &words {
            let cells = report
                .kernels
                .iter()
                .filter_map(|r| r.cells.get(&column.column));
            let text = match cells.filter(|c| sort(c) == *word).count() {
                0 => String::new(),
                n => n.to_string(),
            };
            rows += &format!("<td class=\"number\">{text}</td>");
        }
        rows += "</tr>\n";
    }
    let fixed = ["column", "how its kernels run", "device"].into_iter();
    table("Columns", fixed.chain(words.iter().copied()), &rows)
}

fn tools(report: &Report) -> String {
    let mut rows = String::new();
    for tool in &report.tools {
        let place = match (&tool.path, &tool.problem) {
            (Some(path), None) => code(&path.to_string_lossy()),
            (_, problem) => format!(
                "{}: {}",
                escape(problem.as_deref().unwrap_or("not installed")),
                code(&tool.install)
            ),
        };
        rows += &format!(
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{place}</td><td>{}</td></tr>\n",
            escape(&tool.name),
            escape(tool.version.as_deref().unwrap_or("-")),
            escape(&tool.purpose),
            escape(&tool.licence)
        );
    }
    let head = ["tool", "version", "purpose", "where it is", "licence"];
    table("Tools", head.into_iter(), &rows)
}

fn kernels(report: &Report) -> String {
    let mut rows = String::new();
    for row in &report.kernels {
        rows += &format!(
            "<tr><th scope=\"row\">{}</th><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td></tr>\n",
            escape(&row.kernel),
            escape(&row.stage),
            row.invocations,
            row.non_finite
        );
    }
    let head = [
        "kernel",
        "stage",
        "invocations",
        "results of the reference that are not finite",
    ];
    table("Kernels", head.into_iter(), &rows)
}

fn table<'a>(title: &str, head: impl Iterator<Item = &'a str>, rows: &str) -> String {
    let head = heads(head.map(String::from));
    format!(
        "<h2>{title}</h2>\n<div class=\"wide\">\n<table>\n<thead>\n{head}</thead>\n<tbody>\n{rows}</tbody>\n</table>\n</div>\n"
    )
}

fn heads(names: impl Iterator<Item = String>) -> String {
    let cells: String = names
        .map(|name| format!("<th scope=\"col\">{name}</th>"))
        .collect();
    format!("<tr>{cells}</tr>\n")
}

/// Names, and values that are HTML already.
fn facts(all: &[(&str, String)]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let items: String = all
        .iter()
        .map(|(name, value)| format!("<dt>{name}</dt><dd>{value}</dd>\n"))
        .collect();
    format!("<dl>\n{items}</dl>\n")
}

fn code(text: &str) -> String {
    format!("<code>{}</code>", escape(text))
}

/// An address as a link, anything else (a folder) as it is.
fn link(text: &str) -> String {
    let address = !text.contains(char::is_whitespace);
    if address && text.starts_with("https://") {
        let text = escape(text);
        format!("<a href=\"{text}\">{text}</a>")
    } else {
        code(text)
    }
}

/// Text of others as HTML, without the control characters that it forbids.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            '\r' => {}
            c if c.is_control() => out.push(char::REPLACEMENT_CHARACTER),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::table::tests::everything;

    /// The tags of a page in their order, `/` before the closing ones.
    fn tags(page: &str) -> Vec<&str> {
        let inner = page.split('<').skip(1).filter_map(|s| s.split_once('>'));
        inner
            .map(|(tag, _)| tag.split_whitespace().next().unwrap_or(""))
            .collect()
    }

    /// What stands between `before` and the next quotation mark, everywhere.
    fn attributes<'a>(page: &'a str, before: &str) -> Vec<&'a str> {
        let found = page.split(before).skip(1);
        found.filter_map(|s| s.split('"').next()).collect()
    }

    #[test]
    fn words_of_others_stay_words() {
        let evil = "<script>alert('\u{1b}')</script>\"&\0";
        let page = page(&everything(evil));
        assert!(!page.contains("<script"), "{page}");
        assert!(!page.contains("alert('"), "{page}");
        assert!(!page.contains(['\0', '\u{1b}']));
        let shown = page.matches("&lt;script&gt;").count();
        assert!(shown > 60, "{shown}");
        assert!(tags(&page) == tags(&super::page(&everything("x"))));
    }

    #[test]
    fn tags_are_closed_and_links_lead_somewhere() {
        let page = page(&everything(""));
        let mut open = Vec::new();
        for tag in tags(&page) {
            match tag.strip_prefix('/') {
                Some(closed) => assert_eq!(open.pop(), Some(closed), "{page}"),
                None if ["!DOCTYPE", "meta"].contains(&tag) => {}
                None => open.push(tag),
            }
        }
        assert!(open.is_empty(), "{open:?}");
        let ids = attributes(&page, " id=\"");
        let unique: BTreeSet<&str> = ids.iter().copied().collect();
        assert_eq!(unique.len(), ids.len(), "{ids:?}");
        let links = attributes(&page, "href=\"#");
        assert_eq!(links.len(), 10, "{links:?}");
        for link in links {
            assert!(unique.contains(link), "{link}");
        }
    }

    #[test]
    fn every_outcome_is_told() {
        let page = page(&everything(""));
        for words in [
            "<title>Parity matrix of Hankel 0.1.0</title>",
            "<p class=\"verdict bad\">4 kernels in 11 columns: 4 cells fail, 1 cell not installed, 1 complaint.</p>",
            "<dd>1.2 s</dd>",
            "<dd>3 cells</dd>",
            "<li>take it off the list</li>",
            "<td class=\"same\">same</td>",
            "<td class=\"near\"><a href=\"#d1-native-simd\">1.2e-7<small>3 ulp</small></a></td>",
            "<td class=\"fail\"><a href=\"#d1-wgsl\">REFUSED</a></td>",
            "<td class=\"known\"><a href=\"#d1-essl310\">known</a></td>",
            "<td class=\"missing\"><a href=\"#n3\">missing</a></td>",
            "FAIL; 2 of 40 numbers are beyond what is allowed",
            "<dd><code>moments.x = 0.5</code></dd>",
            "<dt>Expected</dt><dd><code>1.0</code></dd>",
            "<pre>float y = x;</pre>",
            "<pre>node crashed: signal 11\na word\n",
            "<p>it is old</p>",
            "<a href=\"https://example.org/1?a=1&amp;b=2\">",
            "<pre>apt-get install chromium</pre>",
            "too old: <code>apt-get install chromium</code>",
        ] {
            assert!(page.contains(words), "{words:?} is not in\n{page}");
        }
        // All of a tool's words, once for each of the four cells that have them.
        assert_eq!(page.matches("a word\n").count(), 4 * 12);
    }
}
