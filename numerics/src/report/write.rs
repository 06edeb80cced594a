//! A report as a folder of files.

use std::io::Write;
use std::path::{Path, PathBuf};

use hankel_system::output::{self, OutputError};

use super::{PlotError, Report, html};

/// Why a report was not written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file or folder that cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
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

impl Report {
    /// Writes `NAME.json`, `NAME.html`, `NAME-TABLE.csv` for each table and `NAME-PLOT.svg` for
    /// each plot into a folder, which is made; returns the paths, the page's first. Files take
    /// their places only when all are complete. `inputs` are the files that the report was made from.
    ///
    /// # Errors
    ///
    /// The folder cannot be written, a file in it is one of the inputs, or a plot cannot be drawn.
    pub fn write(
        &self,
        folder: &Path,
        name: &str,
        inputs: &[&Path],
    ) -> Result<Vec<PathBuf>, ReportError> {
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
        output::folder(folder)?;
        let paths: Vec<PathBuf> = files.iter().map(|(name, _)| folder.join(name)).collect();
        let places: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        let mut outputs = output::create_all(&places, inputs)?;
        for (output, (_, bytes)) in outputs.iter_mut().zip(&files) {
            output
                .write_all(bytes)
                .map_err(|e| OutputError::write(output.path(), e))?;
        }
        for output in outputs {
            output.commit()?;
        }
        Ok(paths)
    }
}
