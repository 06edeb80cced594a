//! What is wrong with an author's source, at its place: `path:line:column`, with what to write
//! instead.
//!
//! It comes from two sides. [`source`] looks through the crate's own items before anything is
//! compiled, for what Rust accepts and shaders do not have. [`rust_gpu`] takes the compiler's
//! messages, whose places are often in `core`, back to the author's line.

pub mod rust_gpu;
pub mod source;

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Nothing is made of it.
    Error,
    /// It is made, and probably not what is meant.
    Warning,
}

/// A place in a source file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Place {
    /// The path as it can be opened: from the present folder where the file lies below it.
    pub file: String,
    /// From 1.
    pub line: u32,
    /// From 1, in letters.
    pub column: u32,
    /// Letters that are meant, on that line; 1 if not known.
    pub length: u32,
}

/// One message.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Diagnostic {
    /// Where; none where nobody says so.
    pub place: Option<Place>,
    /// How bad.
    pub level: Level,
    /// What is wrong, in one line.
    pub message: String,
    /// What to do about it, and what else is known.
    pub help: Vec<String>,
}

impl Diagnostic {
    /// The message as cargo gives rustc's, on one line, for editors.
    #[must_use]
    pub fn to_cargo_message(&self) -> String {
        let spans: Vec<Value> = self
            .place
            .iter()
            .map(|place| {
                json!({
                    "file_name": place.file,
                    "line_start": place.line,
                    "line_end": place.line,
                    "column_start": place.column,
                    "column_end": place.column + place.length,
                    "byte_start": 0,
                    "byte_end": 0,
                    "is_primary": true,
                    "label": null,
                    "suggested_replacement": null,
                    "suggestion_applicability": null,
                    "expansion": null,
                    "text": [],
                })
            })
            .collect();
        let children: Vec<Value> = self
            .help
            .iter()
            .map(|help| {
                json!({
                    "message": help, "code": null, "level": "help",
                    "spans": [], "children": [], "rendered": null,
                })
            })
            .collect();
        json!({
            "reason": "compiler-message",
            "message": {
                "$message_type": "diagnostic",
                "message": self.message,
                "code": null,
                "level": self.level,
                "spans": spans,
                "children": children,
                "rendered": format!("{self}\n"),
            },
        })
        .to_string()
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            write!(f, "{}:{}:{}: ", place.file, place.line, place.column)?;
        }
        let level = match self.level {
            Level::Error => "error",
            Level::Warning => "warning",
        };
        write!(f, "{level}: {}", self.message)?;
        for help in &self.help {
            write!(f, "\n    {help}")?;
        }
        Ok(())
    }
}

/// A path as a user would type it: from the present folder, where the file lies below it.
pub(crate) fn shown(path: &std::path::Path) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    path.strip_prefix(&here)
        .unwrap_or(path)
        .to_string_lossy()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one() -> Diagnostic {
        Diagnostic {
            place: Some(Place {
                file: "src/lib.rs".into(),
                line: 7,
                column: 5,
                length: 3,
            }),
            level: Level::Error,
            message: "`sum` calls itself".into(),
            help: vec!["write a loop".into()],
        }
    }

    #[test]
    fn a_place_can_be_clicked() {
        assert_eq!(
            one().to_string(),
            "src/lib.rs:7:5: error: `sum` calls itself\n    write a loop"
        );
        let nowhere = Diagnostic {
            place: None,
            ..one()
        };
        assert!(nowhere.to_string().starts_with("error: "));
    }

    #[test]
    fn editors_get_what_rustc_would_say() {
        let text = one().to_cargo_message();
        assert!(!text.contains('\n'));
        let value: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["reason"], "compiler-message");
        assert_eq!(value["message"]["spans"][0]["line_start"], 7);
        assert_eq!(value["message"]["spans"][0]["column_end"], 8);
        assert_eq!(value["message"]["level"], "error");
    }
}
