use hankel_matrix::tools::{Status, Tool};

use crate::args::{Doctor, Format};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};

pub fn run(args: &Doctor) -> Result<Outcome> {
    let tools = super::parity::tools();
    let all = tools.statuses(&Tool::ALL);
    if args.format == Format::Json {
        print::json(&all);
    } else {
        for status in &all {
            print(status);
        }
    }
    Ok(Outcome::of(all.iter().all(Status::is_there)))
}

fn print(status: &Status) {
    let found = match (&status.path, &status.problem) {
        (Some(path), None) => format!(
            "{} ({})",
            status.version.as_deref().unwrap_or("of unknown version"),
            path.display()
        ),
        (_, Some(problem)) => format!("cannot be used: {problem}"),
        (None, None) => "not installed".into(),
    };
    say!("{}: {found}", status.name);
    let text = status.licence_file.as_ref();
    let text = text.map_or(String::new(), |file| format!(" ({})", file.display()));
    say!("    {}; licence: {}{text}", status.purpose, status.licence);
    if !status.is_there() {
        say!("    {}", status.install);
    }
}
