//! How times grow with what is chosen.

use serde::Serialize;

use super::{Measurement, median};

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// Texels of the map: the square of its edge.
    Texels,
    /// Taps of the filter along an axis.
    Taps,
    /// Pixels of the picture.
    Pixels,
}

impl Against {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Texels => "map texels",
            Self::Taps => "taps along an axis",
            Self::Pixels => "output pixels",
        }
    }

    fn of(self, m: &Measurement) -> f64 {
        match self {
            Self::Texels => f64::from(m.configuration.size).powi(2),
            Self::Taps => f64::from(m.configuration.filter),
            Self::Pixels => f64::from(m.output[0]) * f64::from(m.output[1]),
        }
    }
}

/// How the time of a pass grows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// The technique and its map, and how a medium's light is made.
    pub method: String,
    /// The pass.
    pub pass: String,
    /// What is varied; all else is kept.
    pub against: Against,
    /// The power of it that fits best, by least squares of logarithms: 0 for a time that does not
    /// depend on it, 1 for one in proportion to it.
    pub exponent: f64,
    /// What is varied, and the time in seconds: the geometric mean over all that is kept.
    pub points: Vec<(f64, f64)>,
}

impl Growth {
    /// The nearest simple law.
    #[must_use]
    pub fn law(&self) -> &'static str {
        match self.exponent {
            e if e < 0.15 => "independent",
            e if e < 0.85 => "less than linear",
            e if e < 1.15 => "linear",
            e if e < 1.85 => "more than linear",
            e if e < 2.15 => "quadratic",
            _ => "more than quadratic",
        }
    }
}

/// How the passes of every method grow with everything that was varied. Filters of one tap are left out
/// where there are three others or more: they need no blur.
#[must_use]
pub fn growth(measurements: &[Measurement]) -> Vec<Growth> {
    let mut all = Vec::new();
    let mut methods: Vec<String> = Vec::new();
    for m in measurements {
        let method = m.configuration.way();
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    for method in methods {
        let of_method: Vec<&Measurement> = measurements
            .iter()
            .filter(|m| m.configuration.way() == method)
            .collect();
        let mut passes: Vec<&str> = Vec::new();
        for m in &of_method {
            for timing in m.rounds.iter().flatten() {
                if !passes.contains(&timing.name.as_str()) {
                    passes.push(&timing.name);
                }
            }
        }
        for pass in passes {
            for against in [Against::Texels, Against::Taps, Against::Pixels] {
                let points = points(&of_method, pass, against);
                if let Some(exponent) = slope(&points) {
                    all.push(Growth {
                        method: method.clone(),
                        pass: pass.to_owned(),
                        against,
                        exponent,
                        points,
                    });
                }
            }
        }
    }
    all
}

/// What is varied and the geometric mean of the times, over those settings of the rest for which all
/// values were measured.
fn points(of_method: &[&Measurement], pass: &str, against: Against) -> Vec<(f64, f64)> {
    let time = |m: &Measurement| {
        let of_pass = |round: &Vec<_>| {
            let mut of_pass = round.iter().filter(|t: &&crate::Timing| t.name == pass);
            of_pass.next().map(|t| t.seconds)
        };
        let times: Vec<f64> = m.rounds.iter().filter_map(of_pass).collect();
        (!times.is_empty())
            .then(|| median(times))
            .filter(|t| *t > 0.0)
    };
    let mut values: Vec<f64> = of_method.iter().map(|m| against.of(m)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    // A filter of one tap is none, and its passes are others.
    if against == Against::Taps && values.len() > 2 {
        values.retain(|v| *v > 1.0);
    }
    // All else by what it is: a sum of logarithms for each value.
    let mut sums = vec![0.0; values.len()];
    let mut count = 0;
    let rest = |m: &Measurement| {
        let c = &m.configuration;
        let size = (against != Against::Texels).then_some(c.size);
        let filter = (against != Against::Taps).then_some(c.filter);
        let output = (against != Against::Pixels).then_some(m.output);
        (m.scene.clone(), size, filter, output, c.fit)
    };
    let first = values.first().copied();
    for base in of_method.iter().filter(|m| Some(against.of(m)) == first) {
        let times: Vec<f64> = values
            .iter()
            .filter_map(|value| {
                let same = |m: &&&Measurement| against.of(m) == *value && rest(m) == rest(base);
                time(of_method.iter().find(same)?)
            })
            .collect();
        if times.len() == values.len() {
            count += 1;
            for (sum, time) in sums.iter_mut().zip(times) {
                *sum += time.ln();
            }
        }
    }
    if count == 0 {
        return Vec::new();
    }
    let means = sums.iter().map(|sum| (sum / f64::from(count)).exp());
    values.into_iter().zip(means).collect()
}

/// The slope of the line through logarithms; `None` for fewer than two values.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let [x, y] = [
        logs.iter().map(|p| p.0).sum::<f64>() / n,
        logs.iter().map(|p| p.1).sum::<f64>() / n,
    ];
    let across: f64 = logs.iter().map(|p| (p.0 - x).powi(2)).sum();
    let up: f64 = logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    (points.len() > 1 && across > 0.0).then(|| up / across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Timing;
    use crate::measure::Choices;
    use crate::scene::Fit;
    use crate::techniques;
    use crate::truth::Errors;
    use crate::visibility::SAMPLES;

    /// Times by known laws.
    #[test]
    fn known_laws_are_found() {
        let choices = Choices {
            techniques: vec![techniques::ALL[0]],
            sizes: vec![128, 256, 512],
            filters: vec![1, 3, 5, 9],
            fits: vec![Fit::Scene],
            multisampling: vec![SAMPLES],
            scatterings: Vec::new(),
            steps: Vec::new(),
        };
        let mut all = Vec::new();
        for output in [[64, 32], [128, 64]] {
            for configuration in choices.configurations() {
                let (s, f) = (
                    f64::from(configuration.size),
                    f64::from(configuration.filter),
                );
                let pixels = f64::from(output[0] * output[1]);
                let timing = |name: &str, seconds| Timing {
                    name: name.into(),
                    seconds,
                };
                let mut passes = vec![timing("resolve", 1e-9 * s * s)];
                if configuration.filter > 1 {
                    passes.push(timing("blur", 1e-9 * s * s * f));
                }
                passes.push(timing("shade", 1e-8 * pixels));
                // The second round is the middle one.
                let slow = passes
                    .iter()
                    .map(|t| timing(&t.name, t.seconds * 7.0))
                    .collect();
                let fast = passes
                    .iter()
                    .map(|t| timing(&t.name, t.seconds / 7.0))
                    .collect();
                all.push(Measurement {
                    scene: "x".into(),
                    output,
                    configuration,
                    errors: Errors {
                        rms: 0.0,
                        percentile_99: 0.0,
                        worst: 0.0,
                        wrongly_lit: 0.0,
                        wrongly_dark: 0.0,
                    },
                    scattered: None,
                    bytes: 0,
                    rounds: vec![slow, passes, fast],
                });
            }
        }
        let found = growth(&all);
        let exponent = |pass: &str, against| {
            let mut of = found
                .iter()
                .filter(|g| g.pass == pass && g.against == against);
            of.next().map(|g| (g.exponent * 1e6).round() / 1e6)
        };
        assert_eq!(exponent("resolve", Against::Texels), Some(1.0));
        assert_eq!(exponent("resolve", Against::Taps), Some(0.0));
        assert_eq!(exponent("blur", Against::Taps), Some(1.0));
        assert_eq!(exponent("blur", Against::Texels), Some(1.0));
        assert_eq!(exponent("shade", Against::Texels), Some(0.0));
        assert_eq!(exponent("shade", Against::Pixels), Some(1.0));
        let shade = found
            .iter()
            .find(|g| g.pass == "shade" && g.against == Against::Pixels);
        assert_eq!(shade.map(Growth::law), Some("linear"));
    }
}
