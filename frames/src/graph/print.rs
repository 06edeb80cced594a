//! What a graph says of itself.

use std::fmt;

use serde::Serialize;

use super::{Graph, Omission, Pass, Shape, Target, Work};

/// A pass for reports.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PassSummary {
    /// Its name.
    pub pass: String,
    /// The kernels that it runs, vertex before fragment; none for one that only clears or copies.
    pub kernels: Vec<String>,
    /// What it does without a kernel.
    #[serde(skip)]
    does: &'static str,
    /// What it writes: sizes, samples and format, or bytes.
    pub writes: Vec<String>,
    /// What else there is to know.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// A graph for reports: the passes that run, and what was left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// What is done, in order.
    pub passes: Vec<PassSummary>,
    /// What is not.
    pub omitted: Vec<Omission>,
}

impl fmt::Display for PassSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.pass)?;
        let kernels = match self.kernels.as_slice() {
            [] => self.does.into(),
            names => names.join(" and "),
        };
        f.write_str(&kernels)?;
        for text in self.writes.iter().chain(&self.note) {
            write!(f, ", {text}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Summary {
    /// One line for each pass, then one for each omission.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, pass) in self.passes.iter().enumerate() {
            writeln!(f, "{}. {pass}", i + 1)?;
        }
        for o in &self.omitted {
            writeln!(f, "no {}: {}", o.what, o.why)?;
        }
        Ok(())
    }
}

fn shape(shape: &Shape, samples: u32) -> String {
    match shape {
        Shape::Buffer { bytes, layout } => {
            let elements = bytes / (layout.size as usize).max(1);
            format!("{elements} of {}", layout.name)
        }
        Shape::Texture(t) => {
            let [width, height, depth] = t.size;
            let mut text = format!("{width}x{height}");
            if t.dimensions == 3 {
                text.push_str(&format!("x{depth}"));
            }
            if samples > 1 {
                text.push_str(&format!(", {samples} samples"));
            }
            format!("{text}, {}", t.format.name())
        }
    }
}

impl Graph {
    /// What it does.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let needed = self.needed();
        let passes = self.passes.iter().zip(needed).filter(|(_, needed)| *needed);
        Summary {
            passes: passes.map(|(pass, _)| self.pass_summary(pass)).collect(),
            omitted: self.omitted.clone(),
        }
    }

    fn pass_summary(&self, pass: &Pass) -> PassSummary {
        let samples = match pass.work {
            Work::Draw {
                target: Target::Colour { samples, .. },
                ..
            } => Some(samples),
            _ => None,
        };
        let written = pass.writes.iter().map(|handle| {
            let written = &self.values[handle.at()].shape;
            let own = match written {
                Shape::Texture(t) => t.samples,
                Shape::Buffer { .. } => 1,
            };
            shape(written, samples.unwrap_or(own))
        });
        PassSummary {
            pass: pass.label.to_string(),
            kernels: Self::calls(pass)
                .map(|call| self.kernels[call.kernel].kernel.name.clone())
                .collect(),
            does: match pass.work {
                Work::Clear(_) => "zeros",
                Work::Levels(_) => "copies",
                Work::Compute(_) | Work::FullScreen { .. } | Work::Draw { .. } => "",
            },
            writes: written.collect(),
            note: pass.note.clone(),
        }
    }
}
