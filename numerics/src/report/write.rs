//! Files that are there whole or not at all.

use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::{PlotError, Report, html};

/// Why a report was not written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file or folder that cannot be written.
    #[error("{path}: {source}; give a folder that can be written, with `--out`")]
    Io {
        /// Which.
        path: PathBuf,
        /// The system's words.
        source: std::io::Error,
    },
    /// A plot that cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A table that cannot be written as CSV.
    #[error("table {table}: {source}")]
    Csv {
        /// Which.
        table: String,
        /// The writer's words.
        source: csv::Error,
    },
    /// A report that JSON cannot hold.
    #[error("the report has no JSON form: {0}")]
    Json(#[from] serde_json::Error),
}

/// Writes a file by way of a sibling that takes its place once it is complete.
///
/// # Errors
///
/// The folder cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    sibling(path, bytes)?
        .persist(path)
        .map(drop)
        .map_err(|error| ReportError::Io {
            path: path.to_owned(),
            source: error.error,
        })
}

fn sibling(path: &Path, bytes: &[u8]) -> Result<NamedTempFile, ReportError> {
    let at = |source| ReportError::Io {
        path: path.to_owned(),
        source,
    };
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    // Readable as any other file would be; temporary ones are their owner's alone.
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666))
    };
    let mut file = builder.tempfile_in(folder).map_err(at)?;
    file.write_all(bytes).map_err(at)?;
    Ok(file)
}

impl Report {
    /// Writes `NAME.json`, `NAME.html`, `NAME-TABLE.csv` for each table and `NAME-PLOT.svg` for
    /// each plot into a folder, which is made; returns the paths, the page's first. Files take
    /// their places only when all are complete.
    ///
    /// # Errors
    ///
    /// The folder cannot be written, or a plot cannot be drawn.
    pub fn write(&self, folder: &Path, name: &str) -> Result<Vec<PathBuf>, ReportError> {
        let drawn: Vec<String> = self
            .plots
            .iter()
            .map(super::Plot::svg)
            .collect::<Result<_, _>>()?;
        let mut files = vec![
            (
                format!("{name}.html"),
                html::page(self, &drawn).into_bytes(),
            ),
            (format!("{name}.json"), serde_json::to_vec_pretty(self)?),
        ];
        for table in &self.tables {
            let bytes = table.csv().map_err(|source| ReportError::Csv {
                table: table.id.clone(),
                source,
            })?;
            files.push((format!("{name}-{}.csv", table.id), bytes));
        }
        for (plot, svg) in self.plots.iter().zip(drawn) {
            files.push((format!("{name}-{}.svg", plot.id), svg.into_bytes()));
        }
        std::fs::create_dir_all(folder).map_err(|source| ReportError::Io {
            path: folder.to_owned(),
            source,
        })?;
        let complete: Vec<(PathBuf, NamedTempFile)> = files
            .into_iter()
            .map(|(name, bytes)| {
                let path = folder.join(name);
                let file = sibling(&path, &bytes)?;
                Ok((path, file))
            })
            .collect::<Result<_, ReportError>>()?;
        complete
            .into_iter()
            .map(|(path, file)| match file.persist(&path) {
                Ok(_) => Ok(path),
                Err(error) => Err(ReportError::Io {
                    path,
                    source: error.error,
                }),
            })
            .collect()
    }
}
