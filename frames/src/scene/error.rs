//! What can be wrong with a scene.

use std::fmt;
use std::path::PathBuf;

use hankel_system::input::InputError;

/// A place in a scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file as it was named.
    pub file: PathBuf,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A file that cannot be read.
    #[error(transparent)]
    Read(#[from] InputError),
    /// Text that is no scene: bad TOML, an unknown field, a value of the wrong type.
    #[error("{place}: {problem}")]
    Syntax {
        /// Where.
        place: Place,
        /// What is wrong, with what would be right where that is known.
        problem: String,
    },
    /// A value out of its range.
    #[error("{place}: `{field}` is {value}, but must be {allowed}")]
    Value {
        /// Where.
        place: Place,
        /// The field with its table: `shadow.size`.
        field: String,
        /// What it is.
        value: String,
        /// What it may be.
        allowed: String,
    },
    /// A model that cannot be used.
    #[error("{}: {problem}", file.display())]
    Model {
        /// The model's file.
        file: PathBuf,
        /// What is wrong, and where in it.
        problem: String,
    },
    /// Geometry without a triangle that could be seen.
    #[error("{what} has no triangles of more than zero area")]
    Empty {
        /// Where the geometry came from.
        what: String,
    },
}

/// [`Result`](std::result::Result) of this module.
pub type Result<T> = std::result::Result<T, SceneError>;
