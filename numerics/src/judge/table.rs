//! The judge on the rows of a table.

use std::path::Path;

use hankel_system::input::InputError;
use hankel_system::output::{Output, OutputError};
use hankel_system::table::{self, CellError, ColumnsError, Place, Table};
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
    #[error(transparent)]
    Columns(#[from] ColumnsError),
    /// A row or a cell that cannot be used.
    #[error(transparent)]
    Cell(#[from] CellError),
}

impl From<table::TableError> for TableError {
    fn from(error: table::TableError) -> Self {
        match error {
            table::TableError::Input(error) => Self::Input(error),
            table::TableError::Cell(error) => Self::Cell(error),
        }
    }
}

/// A row as numbers.
struct Row {
    place: Place,
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
    let mut table = Table::open(input)?;
    let mut names: Vec<String> = (0..judge.count).map(|k| format!("m{k}")).collect();
    // The query comes after the last moment.
    names.push("z".into());
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let columns = table.columns(&names)?;

    let unwritable = |e: csv::Error| OutputError::write(output, e);
    let mut writer = csv::Writer::from_writer(Output::create(output, &[input])?);
    writer
        .write_record(["lower", "upper", "margin", "residual"])
        .map_err(unwritable)?;

    let mut done = 0;
    let mut cells = csv::StringRecord::new();
    loop {
        let mut rows = Vec::new();
        while rows.len() < ROWS
            && let Some(place) = table.next(&mut cells)?
        {
            let mut numbers = numbers(&names, &columns, &cells)
                .map_err(|(column, problem)| table.wrong(&place, Some(column), problem))?;
            let z = numbers.pop().unwrap_or_default();
            let moments = numbers;
            rows.push(Row { place, moments, z });
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
            let judged = result.map_err(|e| table.wrong(&row.place, None, e.to_string()))?;
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

/// The numbers of a row by what its columns are; the error is a column, and what is wrong with its cell.
fn numbers<'a>(
    names: &[&'a str],
    columns: &[usize],
    cells: &csv::StringRecord,
) -> Result<Vec<f64>, (&'a str, String)> {
    let mut numbers = vec![0.0; names.len()];
    for (cell, &column) in cells.iter().zip(columns) {
        let problem = match cell.parse::<f64>() {
            Ok(x) if x.is_finite() => {
                numbers[column] = x;
                continue;
            }
            Ok(_) => format!("`{cell}` is not finite"),
            Err(_) if cell.is_empty() => "it is empty".into(),
            Err(_) => format!("`{cell}` is not a number"),
        };
        return Err((names[column], problem));
    }
    Ok(numbers)
}
