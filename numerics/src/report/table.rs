//! Tables of typed cells.

use std::fmt;

use comfy_table::{CellAlignment, presets};
use serde::{Deserialize, Serialize};

/// Rows of cells under named columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// Its name among the report's tables and its file's: lower case, digits and hyphens.
    pub id: String,
    /// What the figures are, over how many samples, against which reference.
    pub caption: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows, each with a cell for every column.
    pub rows: Vec<Vec<Cell>>,
    /// Whether it is too long for a terminal: files have it nevertheless.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_detail: bool,
    /// How many of its rows a terminal gets, from the first: files have all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shown: Option<usize>,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its heading.
    pub name: String,
    /// Unit of its numbers; empty without one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// How its numbers are spelled for people. Programs get every digit.
    pub form: Form,
}

/// How the numbers of a column are spelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// As text, to the left. All others stand to the right.
    Text,
    /// So many digits that count, with an exponent where the number is large or small.
    Significant(usize),
    /// So many digits after the point.
    Fixed(usize),
    /// A share of 1 in percent, with so many digits after the point.
    Percent(usize),
}

impl Column {
    fn new(name: impl Into<String>, unit: &str, form: Form) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            form,
        }
    }

    /// Words.
    pub fn text(name: impl Into<String>) -> Self {
        Self::new(name, "", Form::Text)
    }

    /// Whole numbers.
    pub fn count(name: impl Into<String>) -> Self {
        Self::new(name, "", Form::Fixed(0))
    }

    /// Numbers of any size, three digits of them.
    pub fn number(name: impl Into<String>) -> Self {
        Self::new(name, "", Form::Significant(3))
    }

    /// Numbers of like size, with so many digits after the point.
    pub fn fixed(name: impl Into<String>, digits: usize) -> Self {
        Self::new(name, "", Form::Fixed(digits))
    }

    /// Shares of 1.
    pub fn percent(name: impl Into<String>, digits: usize) -> Self {
        Self::new(name, "", Form::Percent(digits))
    }

    /// The same with a unit.
    #[must_use]
    pub fn of(mut self, unit: &str) -> Self {
        self.unit = unit.into();
        self
    }

    /// Heading and unit.
    #[must_use]
    pub fn heading(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{} [{}]", self.name, self.unit)
        }
    }
}

/// What stands in a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Cell {
    /// Nothing: there is no such figure.
    #[default]
    Empty,
    /// Yes or no.
    Flag(bool),
    /// How many.
    Count(u64),
    /// How much. In JSON a number that is not finite is the text `NaN`, `inf` or `-inf`.
    Number(#[serde(with = "number")] f64),
    /// Words.
    Text(String),
}

/// JSON has no NaN and no infinity.
pub mod number {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(x: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if x.is_finite() {
            x.serialize(serializer)
        } else {
            x.to_string().serialize(serializer)
        }
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(deserializer: D) -> Result<f64, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Either {
            Number(f64),
            Text(String),
        }
        match Either::deserialize(deserializer)? {
            Either::Number(x) => Ok(x),
            Either::Text(text) if matches!(text.as_str(), "NaN" | "inf" | "-inf") => {
                text.parse().map_err(serde::de::Error::custom)
            }
            Either::Text(text) => Err(serde::de::Error::custom(format!(
                "`{text}` is not a number"
            ))),
        }
    }
}

macro_rules! cells {
    ($($ty:ty => $variant:ident),*) => {$(
        impl From<$ty> for Cell {
            fn from(value: $ty) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}

cells!(bool => Flag, u8 => Count, u32 => Count, u64 => Count, f32 => Number, f64 => Number, &str => Text, String => Text);

impl From<usize> for Cell {
    fn from(value: usize) -> Self {
        Self::Count(value as u64)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

impl Cell {
    /// For people.
    #[must_use]
    pub fn spelled(&self, form: Form) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Flag(true) => "yes".into(),
            Self::Flag(false) => "no".into(),
            Self::Count(count) => match form {
                Form::Percent(_) => spell(*count as f64, form),
                _ => count.to_string(),
            },
            Self::Number(x) => spell(*x, form),
            Self::Text(text) => text.clone(),
        }
    }

    /// For programs that read text: every digit of a number.
    #[must_use]
    pub fn exact(&self) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Flag(flag) => flag.to_string(),
            Self::Count(count) => count.to_string(),
            Self::Number(x) if *x == 0.0 || (1e-4..1e9).contains(&x.abs()) => x.to_string(),
            Self::Number(x) if x.is_finite() => format!("{x:e}"),
            Self::Number(x) => x.to_string(),
            Self::Text(text) => text.clone(),
        }
    }
}

fn spell(x: f64, form: Form) -> String {
    if !x.is_finite() {
        return x.to_string();
    }
    match form {
        Form::Fixed(digits) => format!("{x:.digits$}"),
        Form::Percent(digits) => format!("{:.digits$} %", x * 100.0),
        Form::Text => x.to_string(),
        Form::Significant(_) if x == 0.0 => "0".into(),
        Form::Significant(digits) => {
            let digits = digits.max(1);
            // Rounded first: 999.7 has another exponent than its rounding to three digits.
            let scientific = format!("{x:.*e}", digits - 1);
            let exponent = scientific
                .rsplit_once('e')
                .and_then(|(_, e)| e.parse::<i32>().ok())
                .unwrap_or(0);
            if (-3..6).contains(&exponent) {
                let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
                format!("{x:.decimals$}")
            } else {
                scientific
            }
        }
    }
}

impl Table {
    /// A table without rows.
    pub fn new(
        id: impl Into<String>,
        caption: impl Into<String>,
        columns: impl IntoIterator<Item = Column>,
    ) -> Self {
        Self {
            id: id.into(),
            caption: caption.into(),
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
            is_detail: false,
            shown: None,
        }
    }

    /// The same, left out where a report is printed as text.
    #[must_use]
    pub fn detail(mut self) -> Self {
        self.is_detail = true;
        self
    }

    /// Adds a row.
    ///
    /// # Panics
    ///
    /// The row has not as many cells as the table has columns: a mistake in the calling code, not
    /// in anything measured.
    pub fn push(&mut self, row: impl IntoIterator<Item = Cell>) {
        let row: Vec<Cell> = row.into_iter().collect();
        assert_eq!(
            row.len(),
            self.columns.len(),
            "table {}: cells for columns",
            self.id
        );
        self.rows.push(row);
    }

    /// Index of the column with a heading.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c.name == name)
    }

    /// Cells as text, row by row, spelled for people.
    pub(super) fn spelled(&self) -> impl Iterator<Item = Vec<String>> {
        self.rows.iter().map(|row| {
            row.iter()
                .zip(&self.columns)
                .map(|(cell, column)| cell.spelled(column.form))
                .collect()
        })
    }

    /// Comma-separated values with a header, every digit of each number.
    ///
    /// # Errors
    ///
    /// None that memory does not make: what is written to is a vector.
    pub fn csv(&self) -> Result<Vec<u8>, csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.columns.iter().map(Column::heading))?;
        for row in &self.rows {
            writer.write_record(row.iter().map(Cell::exact))?;
        }
        writer
            .into_inner()
            .map_err(|error| csv::Error::from(error.into_error()))
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = comfy_table::Table::new();
        table.load_preset(presets::ASCII_MARKDOWN);
        table.set_header(self.columns.iter().map(Column::heading));
        for (i, column) in self.columns.iter().enumerate() {
            if column.form != Form::Text
                && let Some(column) = table.column_mut(i)
            {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let shown = self.shown.unwrap_or(usize::MAX);
        for row in self.spelled().take(shown) {
            table.add_row(row);
        }
        writeln!(f, "{}", self.caption)?;
        writeln!(f, "{table}")?;
        match self.rows.len().saturating_sub(shown) {
            0 => Ok(()),
            more => writeln!(f, "and {more} more rows (`--out` writes all)"),
        }
    }
}
