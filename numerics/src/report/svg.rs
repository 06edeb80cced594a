//! Plots as SVG.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use super::html::escape;
use super::{Axis, Plot, Point, Scale, Style};

/// Why a plot was not drawn.
#[derive(Debug, thiserror::Error)]
#[error("plot {plot}: {problem}")]
pub struct PlotError {
    /// Which.
    plot: String,
    /// What went wrong.
    problem: String,
}

const SIZE: (u32, u32) = (1120, 600);
/// The legend's share of the width, to the right.
const LEGEND: u32 = 250;

/// Colours that people with any colour vision tell apart (Okabe and Ito).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(148, 103, 50),
];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Where points with a title lie, and their titles.
type Titles = Vec<((i32, i32), String)>;
type Drawn = Result<Titles, DrawingAreaErrorKind<std::io::Error>>;

impl Plot {
    /// The plot as a stand-alone SVG element, without a font: the viewer's own sans-serif is used.
    ///
    /// # Errors
    ///
    /// The plotting library gave up.
    pub fn svg(&self) -> Result<String, PlotError> {
        let mut text = String::new();
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        let x = extent(&self.x, self.finite().map(|p| p.x));
        let y = extent(&self.y, self.finite().map(|p| p.y));
        let drawn = match (self.x.scale, self.y.scale) {
            (Scale::Linear, Scale::Linear) => self.draw(&root, x.clone(), y.clone(), (x, y)),
            (Scale::Linear, Scale::Logarithmic) => {
                self.draw(&root, x.clone(), y.clone().log_scale(), (x, y))
            }
            (Scale::Logarithmic, Scale::Linear) => {
                self.draw(&root, x.clone().log_scale(), y.clone(), (x, y))
            }
            (Scale::Logarithmic, Scale::Logarithmic) => {
                self.draw(&root, x.clone().log_scale(), y.clone().log_scale(), (x, y))
            }
        };
        drop(root);
        let titles = drawn.map_err(|error| PlotError {
            plot: self.id.clone(),
            problem: error.to_string(),
        })?;
        // Nothing is seen of the discs but what viewers show when the pointer rests on them.
        if let Some(end) = text.rfind("</svg>") {
            let discs: String = titles
                .iter()
                .map(|((x, y), title)| {
                    let title = escape(title);
                    format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"7\" fill-opacity=\"0\"><title>{title}</title></circle>\n")
                })
                .collect();
            text.insert_str(end, &discs);
        }
        Ok(text)
    }

    fn finite(&self) -> impl Iterator<Item = &Point> {
        let all = self.series.iter().flat_map(|s| &s.points);
        all.filter(|p| p.x.is_finite() && p.y.is_finite())
    }

    fn draw<X, Y>(
        &self,
        root: &Area<'_>,
        x: X,
        y: Y,
        (across, up): (Range<f64>, Range<f64>),
    ) -> Drawn
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        root.fill(&WHITE)?;
        let has_legend = self.series.iter().any(|s| !s.name.is_empty());
        let width = if has_legend { SIZE.0 - LEGEND } else { SIZE.0 };
        let (area, legend) = root.split_horizontally(width);
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .margin_right(20)
            .x_label_area_size(44)
            .y_label_area_size(76)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .light_line_style(BLACK.mix(0.04))
            .bold_line_style(BLACK.mix(0.12))
            .x_desc(self.x.label.as_str())
            .y_desc(self.y.label.as_str())
            .x_label_formatter(&|v| tick(*v))
            .y_label_formatter(&|v| tick(*v))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .draw()?;
        let mut titles = Titles::new();
        for (i, series) in self.series.iter().enumerate() {
            let titled = series
                .points
                .iter()
                .filter(|p| !p.title.is_empty() && p.x.is_finite() && p.y.is_finite());
            titles.extend(titled.map(|p| {
                let at = (p.x.max(across.start), p.y.max(up.start));
                (chart.backend_coord(&at), p.title.clone())
            }));
            let colour = colour_of(i, series.style);
            let points: Vec<(f64, f64, &str)> = series
                .points
                .iter()
                .filter(|p| p.x.is_finite() && p.y.is_finite())
                .map(|p| {
                    let (x, y) = (p.x.max(across.start), p.y.max(up.start));
                    (x, y, p.label.as_str())
                })
                .collect();
            let line = || {
                LineSeries::new(
                    points.iter().map(|(x, y, _)| (*x, *y)),
                    colour.stroke_width(2),
                )
            };
            let discs = |size: i32, style: ShapeStyle| {
                points
                    .iter()
                    .map(move |(x, y, _)| Circle::new((*x, *y), size, style))
                    .collect::<Vec<_>>()
            };
            if series.style != Style::Dots {
                chart.draw_series(line())?;
            }
            match series.style {
                Style::Dots => drop(chart.draw_series(discs(4, colour.mix(0.8).filled()))?),
                Style::Line => {}
                Style::Front => drop(chart.draw_series(discs(8, colour.stroke_width(2)))?),
            }
            let font = ("sans-serif", 12).into_font();
            chart.draw_series(points.iter().filter(|p| !p.2.is_empty()).map(|(x, y, l)| {
                EmptyElement::at((*x, *y)) + Text::new((*l).to_owned(), (9, -14), font.clone())
            }))?;
        }
        let named = self.series.iter().enumerate();
        for (row, (i, series)) in named.filter(|(_, s)| !s.name.is_empty()).enumerate() {
            let colour = colour_of(i, series.style);
            let y = 24 + 22 * row as i32;
            match series.style {
                Style::Dots => legend.draw(&Circle::new((14, y), 4, colour.filled()))?,
                Style::Line => legend.draw(&PathElement::new(
                    vec![(4, y), (24, y)],
                    colour.stroke_width(2),
                ))?,
                Style::Front => legend.draw(&Circle::new((14, y), 7, colour.stroke_width(2)))?,
            }
            let font = ("sans-serif", 14).into_font();
            legend.draw(&Text::new(series.name.clone(), (32, y - 8), font))?;
        }
        root.present()?;
        Ok(titles)
    }
}

/// The colour of series number `i`.
fn colour_of(i: usize, style: Style) -> RGBColor {
    match style {
        Style::Front => BLACK,
        _ => COLOURS[i % COLOURS.len()],
    }
}

/// A number beside an axis.
fn tick(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".into()
    } else if (1e-3..1e5).contains(&size) {
        // Sums of steps: the twelfth digit is rounding.
        let text = format!("{x:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        let text = format!("{x:.2e}");
        text.replace(".00e", "e")
    }
}

/// What an axis spans: all values and a little more. Never empty.
fn extent(axis: &Axis, values: impl Iterator<Item = f64>) -> Range<f64> {
    let logarithmic = axis.scale == Scale::Logarithmic;
    let (mut low, mut high, mut floored) = (f64::INFINITY, f64::NEG_INFINITY, false);
    for x in values {
        if logarithmic && x < f64::MIN_POSITIVE {
            floored = true;
        } else {
            low = low.min(x);
            high = high.max(x);
        }
    }
    if low > high {
        (low, high) = if logarithmic { (0.1, 1.0) } else { (0.0, 1.0) };
    }
    if logarithmic {
        // Room below for what is at the lower end because it is 0.
        let below = if floored { 10.0 } else { 1.5 };
        return (low / below).max(f64::MIN_POSITIVE)..(high * 1.5).min(f64::MAX / 2.0);
    }
    let margin = match (high - low) * 0.04 {
        m if m > 0.0 && m.is_finite() => m,
        _ => high.abs().max(1.0) * 0.5,
    };
    (low - margin).max(-f64::MAX / 4.0)..(high + margin).min(f64::MAX / 4.0)
}
