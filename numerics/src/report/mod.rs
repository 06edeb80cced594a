//! What was measured, as tables and plots for people and programs.
//!
//! A [`Report`] is plain data. It is printed as text ([`Display`](std::fmt::Display)), written as
//! JSON, one CSV file for each table, one SVG file for each plot, and one HTML page that needs
//! nothing besides itself, but for pictures ([`Report::write`]).

mod html;
mod pareto;
mod svg;
mod table;
mod write;

pub use pareto::pareto_front;
pub use svg::PlotError;
pub use table::{Cell, Column, Form, Table};
pub use write::ReportError;

use std::fmt;

use serde::{Deserialize, Serialize};

/// Measured figures and what they are of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// What was measured, in a few words.
    pub title: String,
    /// The command that made it.
    pub command: String,
    /// Processor, number of rows and the like: a name and a value each.
    pub facts: Vec<(String, String)>,
    /// What a reader must know: what was left out and why.
    pub notes: Vec<String>,
    /// The figures.
    pub tables: Vec<Table>,
    /// Some of them drawn.
    pub plots: Vec<Plot>,
    /// Pictures in files beside the page.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub galleries: Vec<Gallery>,
}

/// Pictures to be looked at together. Their files are written by whoever makes the report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gallery {
    /// What they show.
    pub caption: String,
    /// What each shows, and its file, relative to the page.
    pub pictures: Vec<(String, String)>,
}

/// Points in a plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plot {
    /// Its name among the report's plots and its file's: lower case, digits and hyphens.
    pub id: String,
    /// What it shows.
    pub caption: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What is drawn, the first at the back.
    pub series: Vec<Series>,
}

/// An axis of a plot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// How values are spread over it.
    pub scale: Scale,
}

impl Axis {
    /// An axis on which differences count.
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            scale: Scale::Linear,
        }
    }

    /// An axis on which ratios count. A value of 0 or less is drawn at its lower end.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            scale: Scale::Logarithmic,
        }
    }
}

/// How values are spread over an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Their logarithms evenly.
    Logarithmic,
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Its name in the legend; empty leaves it out.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// Its points, in the order in which a line visits them.
    pub points: Vec<Point>,
}

impl Series {
    /// Points without labels.
    pub fn new(
        name: impl Into<String>,
        style: Style,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: name.into(),
            style,
            points: points
                .into_iter()
                .map(|(x, y)| Point {
                    x,
                    y,
                    label: String::new(),
                    title: String::new(),
                })
                .collect(),
        }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// Discs.
    Dots,
    /// A line from point to point.
    Line,
    /// A line and a ring around each of its points: a Pareto front.
    Front,
}

/// A point of a plot. What is not finite is left out of the drawing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// To the right.
    #[serde(with = "table::number")]
    pub x: f64,
    /// Upwards.
    #[serde(with = "table::number")]
    pub y: f64,
    /// Written next to it, if not empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub label: String,
    /// Shown while the pointer rests on it, if not empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub title: String,
}

impl Report {
    /// An empty report.
    pub fn new(title: impl Into<String>, command: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            command: command.into(),
            ..Self::default()
        }
    }

    /// Adds a fact.
    pub fn fact(&mut self, name: impl Into<String>, value: impl fmt::Display) {
        self.facts.push((name.into(), value.to_string()));
    }

    /// The table of an id.
    #[must_use]
    pub fn table(&self, id: &str) -> Option<&Table> {
        self.tables.iter().find(|t| t.id == id)
    }

    /// Appends another report's facts (those that are not there yet), notes, tables, plots and pictures.
    pub fn append(&mut self, other: Self) {
        for fact in other.facts {
            if !self.facts.contains(&fact) {
                self.facts.push(fact);
            }
        }
        self.notes.extend(other.notes);
        self.tables.extend(other.tables);
        self.plots.extend(other.plots);
        self.galleries.extend(other.galleries);
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        for (name, value) in &self.facts {
            writeln!(f, "  {name}: {value}")?;
        }
        for table in self.tables.iter().filter(|t| !t.is_detail) {
            writeln!(f, "\n{table}")?;
        }
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        Ok(())
    }
}
