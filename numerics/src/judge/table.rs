//! The judge on the rows of a table.

use std::path::{Path, PathBuf};

use hankel_system::input::{self, InputError};
use hankel_system::output::{Output, OutputError};
use rayon::prelude::*;

use super::{Judge, JudgeError, Judged};

/// Rows that are judged at once.
const ROWS: usize = 1024;

/// Why a table was not judged.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The input cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The output cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Columns other than the moments and the query.
    #[error("{}: {problem}; the columns must be: {wanted}", path.display())]
    Columns {
        /// The file.
        path: PathBuf,
        /// Which is wrong, and how.
        problem: String,
        /// The columns that there must be, in any order.
        wanted: String,
    },
    /// A row or a cell that cannot be used.
    #[error("{}: row {row} (line {line}){}: {problem}", path.display(), column.as_ref().map_or_else(String::new, |c| format!(", column `{c}`")))]
    Cell {
        /// The file.
        path: PathBuf,
        /// Row, from 1, without the header.
        row: u64,
        /// Line of the file, from 1; empty lines before the row count as its own.
        line: u64,
        /// The column; none for the row as a whole.
        column: Option<String>,
        /// What is wrong.
        problem: String,
    },
}

/// A row as numbers.
struct Row {
    line: u64,
    moments: Vec<f64>,
    z: f64,
}

/// Judges each row of a CSV table with columns `m0`, `m1`, … (as many as the judge has functions,
/// and one) and `z`, in any order, and writes a table with the columns `lower`, `upper`, `margin` and
/// `residual`; gives the number of rows. `progress` gets the number of rows done so far, now and then.
///
/// # Errors
/// [`TableError`], which names the row for moments that no distribution has. Then no output is
/// written, and one that was there before stays.
pub fn table(
    judge: &Judge,
    input: &Path,
    output: &Path,
    progress: &mut dyn FnMut(u64),
) -> Result<u64, TableError> {
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(input::open_table(input)?);
    let unreadable = |e: csv::Error| InputError::Io {
        path: input.into(),
        source: e.into(),
    };
    let header = reader.headers().map_err(unreadable)?.clone();
    let places = places(judge, input, &header)?;

    let unwritable = |e: csv::Error| OutputError::write(output, e);
    let mut writer = csv::Writer::from_writer(Output::create(output, &[input])?);
    writer
        .write_record(["lower", "upper", "margin", "residual"])
        .map_err(unwritable)?;

    let mut done = 0;
    let mut records = reader.into_records();
    loop {
        let mut rows = Vec::new();
        while rows.len() < ROWS
            && let Some(record) = records.next()
        {
            let number = done + 1 + rows.len() as u64;
            rows.push(read(judge, &places, &header, record, input, number)?);
        }
        if rows.is_empty() {
            break;
        }
        let judged: Vec<Result<Judged, JudgeError>> = rows
            .par_iter()
            .map(|row| judge.bounds(&row.moments, row.z))
            .collect();
        for (row, result) in rows.iter().zip(judged) {
            done += 1;
            let judged = result.map_err(|error| TableError::Cell {
                path: input.into(),
                row: done,
                line: row.line,
                column: None,
                problem: error.to_string(),
            })?;
            writer
                .write_record(
                    [judged.lower, judged.upper, judged.margin, judged.residual]
                        .map(|x| x.to_string()),
                )
                .map_err(unwritable)?;
        }
        progress(done);
    }
    writer
        .into_inner()
        .map_err(|e| OutputError::write(output, e.into_error()))?
        .commit()?;
    Ok(done)
}

/// For each column of the file the moment that it holds; the query comes after the last.
fn places(
    judge: &Judge,
    path: &Path,
    header: &csv::StringRecord,
) -> Result<Vec<usize>, TableError> {
    let mut names: Vec<String> = (0..judge.count).map(|k| format!("m{k}")).collect();
    names.push("z".into());
    let bad = |problem: String| TableError::Columns {
        path: path.into(),
        problem,
        wanted: names.join(", "),
    };
    if header.iter().all(str::is_empty) {
        return Err(bad("it has no header".into()));
    }
    let mut places = Vec::new();
    for (i, name) in header.iter().enumerate() {
        let Some(place) = names.iter().position(|n| n == name) else {
            return Err(bad(format!(
                "column {} is `{name}`, which is not read",
                i + 1
            )));
        };
        if places.contains(&place) {
            return Err(bad(format!("there are two columns `{name}`")));
        }
        places.push(place);
    }
    if let Some(missing) = (0..names.len()).find(|p| !places.contains(p)) {
        return Err(bad(format!("column `{}` is missing", names[missing])));
    }
    Ok(places)
}

/// The numbers of a record.
fn read(
    judge: &Judge,
    places: &[usize],
    header: &csv::StringRecord,
    record: csv::Result<csv::StringRecord>,
    path: &Path,
    row: u64,
) -> Result<Row, TableError> {
    let bad = |line: u64, column: Option<&str>, problem: String| TableError::Cell {
        path: path.into(),
        row,
        line,
        column: column.map(Into::into),
        problem,
    };
    let record = record.map_err(|e| {
        let problem = match e.kind() {
            csv::ErrorKind::Utf8 { .. } => "it is not UTF-8 text".to_string(),
            _ => e.to_string(),
        };
        bad(e.position().map_or(0, csv::Position::line), None, problem)
    })?;
    let line = record.position().map_or(0, csv::Position::line);
    if record.len() != header.len() {
        let problem = format!("it has {} cells, the header {}", record.len(), header.len());
        return Err(bad(line, None, problem));
    }
    let mut numbers = vec![0.0; judge.count + 1];
    for ((cell, &place), name) in record.iter().zip(places).zip(header) {
        let problem = match cell.parse::<f64>() {
            Ok(x) if x.is_finite() => {
                numbers[place] = x;
                continue;
            }
            Ok(_) => format!("`{cell}` is not finite"),
            Err(_) if cell.is_empty() => "it is empty".into(),
            Err(_) => format!("`{cell}` is not a number"),
        };
        return Err(bad(line, Some(name), problem));
    }
    let z = numbers.pop().unwrap_or_default();
    Ok(Row {
        line,
        moments: numbers,
        z,
    })
}
