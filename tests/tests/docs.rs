//! The documentation is current: tables between `<!-- NAME -->` and `<!-- /NAME -->` are what the
//! code gives now, and links lead to files. `INSTA_UPDATE=always` writes the tables anew.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hankel_codegen::cost::of_spirv;
use hankel_dsl::native::describe::{Precision, Stage};
use hankel_tests::{Crate, lean, root};

/// The pages that people read.
fn pages() -> Vec<PathBuf> {
    let mut pages: Vec<PathBuf> = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"]
        .map(|name| root().join(name))
        .into();
    for entry in std::fs::read_dir(root().join("docs")).expect("docs/ can be listed") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|e| e == "md") {
            pages.push(path);
        }
    }
    pages.sort();
    pages
}

/// Compares what stands between the marks of `name` with `table`, or writes it.
fn current(page: &str, name: &str, table: &str) {
    let path = root().join(page);
    let text = std::fs::read_to_string(&path).expect("the page can be read");
    let (start, end) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->"));
    let (before, rest) = text.split_once(&start).expect("the table's first mark");
    let (stands, after) = rest.split_once(&end).expect("the table's last mark");
    if stands == table {
        return;
    }
    if std::env::var("INSTA_UPDATE").is_ok_and(|v| v == "always") {
        let text = format!("{before}{start}{table}{end}{after}");
        std::fs::write(&path, text).expect("the page can be written");
        return;
    }
    let (old, new): (Vec<_>, Vec<_>) = (stands.lines().collect(), table.lines().collect());
    let mut differences = String::new();
    for line in new.iter().filter(|line| !old.contains(line)) {
        let _ = writeln!(differences, "+ {line}");
    }
    for line in old.iter().filter(|line| !new.contains(line)) {
        let _ = writeln!(differences, "- {line}");
    }
    panic!(
        "{page}: the table `{name}` is not current; \
         INSTA_UPDATE=always cargo test --release -p hankel-tests --test docs writes it:\n{differences}"
    );
}

/// Documentation outside of rustdoc: a link to an item is the item's name, and a bracket is a bracket.
fn without_links(text: &str) -> String {
    let mut parts = text.split("[`");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once("`]") {
            Some((path, rest)) => {
                let name = path.rsplit("::").next().unwrap_or(path);
                let _ = write!(plain, "`{name}`{rest}");
            }
            None => plain += part,
        }
    }
    plain.replace("\\[", "[").replace("\\]", "]")
}

#[test]
fn the_table_of_kernels_is_current() {
    let shadows = Crate::shadows();
    let mut table = String::from(
        "| kernel | stage | operations | branches | what |\n| --- | --- | --- | --- | --- |\n",
    );
    let kernels: BTreeMap<_, _> = shadows
        .entries
        .iter()
        .map(|e| (&e.kernel.name, &e.kernel))
        .collect();
    for entry in &shadows.entries {
        let kernel = &entry.kernel;
        // One line stands for both precisions.
        if kernel.precision == Some(Precision::F64) {
            continue;
        }
        let cost = |name: &str| {
            let module = &shadows.bundle.modules[name];
            of_spirv(module, name).unwrap_or_else(|e| panic!("{e}"))
        };
        let mut costs = vec![cost(&kernel.name)];
        let double = format!("{}_f64", kernel.name);
        let mut name = format!("`{}`", kernel.name);
        if kernels.contains_key(&double) {
            costs.push(cost(&double));
            name += ", `_f64`";
        }
        let stage = match &kernel.stage {
            Stage::Vertex => "vertex".to_owned(),
            Stage::Fragment => "fragment".to_owned(),
            Stage::Compute { dimensions, .. } => format!("compute {dimensions}-D"),
        };
        let numbers = |of: &dyn Fn(&hankel_codegen::cost::Cost) -> u32| {
            let mut all: Vec<u32> = costs.iter().map(of).collect();
            all.dedup();
            all.iter()
                .map(u32::to_string)
                .collect::<Vec<_>>()
                .join(", ")
        };
        let summary = kernel
            .summary
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        let first = summary
            .split_once(". ")
            .map_or(summary.trim_end_matches('.'), |(s, _)| s);
        let _ = writeln!(
            table,
            "| {name} | {stage} | {} | {} | {} |",
            numbers(&|c| c.operations),
            numbers(&|c| c.branches),
            without_links(first).replace('|', "\\|"),
        );
    }
    current("docs/catalogue.md", "kernels", &table);
}

#[test]
fn the_table_of_lean_kernels_is_current() {
    let mut table = String::from(
        "| | by hand | the same as a kernel | the robust kernel |\n| --- | --- | --- | --- |\n",
    );
    for (name, title) in [("hamburger", "Hamburger"), ("hausdorff", "Hausdorff")] {
        let lean = lean::compare(name);
        let _ = writeln!(
            table,
            "| {title} | {} operations, {} branches | {}, {} | {}, {} |",
            lean.by_hand.operations,
            lean.by_hand.branches,
            lean.kernel.operations,
            lean.kernel.branches,
            lean.robust.operations,
            lean.robust.branches,
        );
    }
    current("docs/catalogue.md", "lean", &table);
}

/// `./check` has just run the matrix, and names the table that it gave.
#[test]
fn the_table_of_the_matrix_is_current() {
    let Some(file) = std::env::var_os("HANKEL_MATRIX_TABLE") else {
        eprintln!("the table of the matrix is not looked at: HANKEL_MATRIX_TABLE names none");
        return;
    };
    let file = root().join(file);
    let table =
        std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    current("docs/parity.md", "matrix", &table);
}

#[test]
fn links_lead_somewhere() {
    let mut broken = Vec::new();
    for page in pages() {
        let text = std::fs::read_to_string(&page).expect("the page can be read");
        for (i, line) in text.lines().enumerate() {
            for link in links(line) {
                let problem = problem_of(&page, link);
                broken
                    .extend(problem.map(|p| format!("{}:{}: {link}: {p}", page.display(), i + 1)));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// What is in round brackets behind square ones.
fn links(line: &str) -> impl Iterator<Item = &str> {
    line.split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')').map(|(link, _)| link))
}

fn problem_of(page: &Path, link: &str) -> Option<String> {
    if link.contains("://") {
        return None;
    }
    let (file, anchor) = match link.split_once('#') {
        Some((file, anchor)) => (file, Some(anchor)),
        None => (link, None),
    };
    let target = match file {
        "" => page.to_owned(),
        file => page.parent().expect("a page lies in a folder").join(file),
    };
    if !target.exists() {
        return Some("there is no such file".into());
    }
    let anchor = anchor?;
    let text = std::fs::read_to_string(&target).ok()?;
    let headings = text
        .lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| {
            let words = line.trim_start_matches('#').trim().to_lowercase();
            let kept = words
                .chars()
                .filter(|c| c.is_alphanumeric() || "- _".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c })
                .collect::<String>()
        });
    let known: Vec<String> = headings.collect();
    (!known.iter().any(|heading| heading == anchor)).then(|| "there is no such heading".into())
}
