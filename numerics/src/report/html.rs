//! One page with everything in it.

use std::fmt::Write;

use super::{Column, Form, Report, Table};

const STYLE: &str = "\
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; color: #1a1a1a; background: #fff; }
h1 { font-size: 1.5rem; }
code { background: #f2f2f2; padding: .1em .3em; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; }
dt { color: #666; }
dd { margin: 0; }
figure { margin: 2rem 0; overflow-x: auto; }
figcaption { margin-bottom: .5rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid #ddd; white-space: nowrap; text-align: right; }
th.text, td.text { text-align: left; white-space: normal; }
svg { max-width: 100%; height: auto; }
.gallery { display: grid; grid-template-columns: repeat(auto-fill, minmax(20rem, 1fr)); gap: 1rem; }
.gallery figure { margin: 0; }
img { width: 100%; image-rendering: pixelated; border: 1px solid #ddd; }
";

/// A page; `drawn` are the report's plots as SVG.
pub(super) fn page(report: &Report, drawn: &[String]) -> String {
    let mut page = String::new();
    let title = escape(&report.title);
    page.push_str("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    page.push_str("<meta name=\"viewport\" content=\"width=device-width\">\n");
    let mut line = |text: std::fmt::Arguments<'_>| {
        // Writing to a string does not fail.
        let _ = writeln!(page, "{text}");
    };
    line(format_args!("<title>{title}</title>"));
    line(format_args!("<style>\n{STYLE}</style>\n</head>\n<body>"));
    line(format_args!("<h1>{title}</h1>"));
    if !report.command.is_empty() {
        line(format_args!(
            "<p>Made by <code>{}</code></p>",
            escape(&report.command)
        ));
    }
    line(format_args!("<dl>"));
    for (name, value) in &report.facts {
        line(format_args!(
            "<dt>{}</dt><dd>{}</dd>",
            escape(name),
            escape(value)
        ));
    }
    line(format_args!("</dl>"));
    for (plot, svg) in report.plots.iter().zip(drawn) {
        line(format_args!(
            "<figure id=\"{}\">\n<figcaption>{}</figcaption>\n{svg}</figure>",
            escape(&plot.id),
            escape(&plot.caption)
        ));
    }
    for gallery in &report.galleries {
        line(format_args!(
            "<figure>\n<figcaption>{}</figcaption>\n<div class=\"gallery\">",
            escape(&gallery.caption)
        ));
        for (what, file) in &gallery.pictures {
            let (what, file) = (escape(what), escape(file));
            line(format_args!(
                "<figure><img src=\"{file}\" alt=\"{what}\" loading=\"lazy\"><figcaption>{what}</figcaption></figure>"
            ));
        }
        line(format_args!("</div>\n</figure>"));
    }
    for table in &report.tables {
        line(format_args!("{}", figure(table)));
    }
    if !report.notes.is_empty() {
        line(format_args!("<h2>Notes</h2>\n<ul>"));
        for note in &report.notes {
            line(format_args!("<li>{}</li>", escape(note)));
        }
        line(format_args!("</ul>"));
    }
    line(format_args!("</body>\n</html>"));
    page
}

fn figure(table: &Table) -> String {
    let row = |tag: &str, cells: &[String]| {
        let cells: String = cells
            .iter()
            .zip(&table.columns)
            .map(|(cell, column)| {
                let class = match column.form {
                    Form::Text => " class=\"text\"",
                    _ => "",
                };
                format!("<{tag}{class}>{}</{tag}>", escape(cell))
            })
            .collect();
        format!("<tr>{cells}</tr>\n")
    };
    let headings: Vec<String> = table.columns.iter().map(Column::heading).collect();
    let rows: String = table.spelled().map(|cells| row("td", &cells)).collect();
    format!(
        "<figure id=\"{}\">\n<figcaption>{}</figcaption>\n<table>\n<thead>\n{}</thead>\n<tbody>\n{rows}</tbody>\n</table>\n</figure>",
        escape(&table.id),
        escape(&table.caption),
        row("th", &headings)
    )
}

pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}
