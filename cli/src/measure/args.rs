//! The arguments of the commands that measure.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::args::{Backend, Format, Precision};

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Compute the exact bounds of each row of a table, by a linear programme.
    Judge(Judge),
    /// Measure how fast kernels are.
    Bench(Bench),
    /// Measure how large the errors of bounds are, on every kind of input, and how much bias moments need.
    Stress(Stress),
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel judge --functions z,z^2,z^3,z^4 --input questions.csv --output exact.csv
  hankel judge --functions z,z^2,z^3,z^4 --range line --input questions.csv --output exact.csv
  hankel judge --functions 'z,exp(2z),sin(2pi*z)' --range 0,1 --input questions.csv --output exact.csv

The table's columns are m0 (the total weight), m1, m2 and so on (the sums of weight times each
function) and z. Written are the least weight strictly below z, the greatest at or below z, over all
distributions with these moments, the margin within which both are exact, and the residual: how far
the moments of the distributions found are from the given ones, relative to m0. Where the residual is 0,
the margin is proved. Elsewhere it is an estimate, and may be too small: where few distributions have
nearly these moments.

Functions: z to z^16; z^(1/2), z^(1/3), z^(1/4); 1/(z+1) to 1/(z+1)^4; exp(z) to exp(4z);
log(z+1) to log(z+4); sin(2pi*z), cos(2pi*z) and 4pi, 6pi, 8pi; cosh(z), sinh(z), asin(z),
asin(2z-1), atan(z), exp(-z^2)")]
pub struct Judge {
    /// Functions of depth whose means the moments are, with commas between.
    #[arg(long, value_name = "FUNCTIONS", value_delimiter = ',', required = true)]
    pub functions: Vec<String>,
    /// The depths that there may be: two numbers with a comma between, or `line` for any.
    #[arg(
        long,
        value_name = "LOW,HIGH",
        default_value = "0,1",
        allow_hyphen_values = true
    )]
    pub range: String,
    /// Table to read: CSV with a header.
    #[arg(long, value_name = "FILE")]
    pub input: PathBuf,
    /// Table to write.
    #[arg(long, value_name = "FILE")]
    pub output: PathBuf,
}

#[derive(Debug, Args)]
pub struct Bench {
    #[command(subcommand)]
    pub command: BenchCommand,
}

#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// Bounds and their derivatives: run time, error, and how near the machine's limits they are.
    Bounds(BenchBounds),
    /// Frames: run time against the error of their shadows, in every configuration.
    #[cfg(feature = "frames")]
    Frames(BenchFrames),
    /// What a shadow map should hold: all choices of functions of depth, ranked by the error of their bounds on
    /// shadow maps of scenes.
    #[cfg(feature = "frames")]
    Candidates(BenchCandidates),
    /// Measure for another process, which asks on the standard input stream.
    #[command(hide = true)]
    Worker,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel bench bounds --quick
  hankel bench bounds --out report --against diffmoments --python venv/bin/python
  hankel bench bounds --n 2,3 --samples 200000

OUT gets bounds.html, bounds.json, and a CSV file for each table. diffmoments is a Python package:
  python3 -m pip install diffmoments numpy

Environment:
  HANKEL_PYTHON  the Python that has diffmoments, unless --python says
  HANKEL_SIMD    the instruction set of the lanes; the others are measured, too")]
pub struct BenchBounds {
    /// Only these orders; several with commas between, or repeated [default: 1 to 6].
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=6))]
    pub n: Vec<u8>,
    /// Rows of each call [default: 1000000; with --quick 20000].
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = rows)]
    pub samples: Option<usize>,
    /// Rounds in which everything has its turn [default: 5; with --quick 3].
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = rounds)]
    pub rounds: Option<usize>,
    /// Seed of the rows.
    #[arg(
        long,
        value_name = "NUMBER",
        allow_negative_numbers = true,
        default_value_t = 1
    )]
    pub seed: u64,
    /// Measure this implementation in turns with the kernels.
    #[arg(long, value_enum)]
    pub against: Option<Rival>,
    /// The Python that has it [default: HANKEL_PYTHON, or python3].
    #[arg(long, value_name = "PROGRAM", requires = "against")]
    pub python: Option<PathBuf>,
    /// Folder for the report; without it, tables are only printed.
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// A first look that takes seconds: fewer rows and rounds.
    #[arg(long)]
    pub quick: bool,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[cfg(feature = "frames")]
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel bench frames --out report
  hankel bench frames --scene scenes/fence.toml --technique hamburger,pcf --size 512 --out report
  hankel bench frames --output 160x90,320x180,640x360 --backend vulkan --out report
  hankel bench frames --output 320x180 --error 0.1,0.05 --out report

Every technique in every format, with every map size, filter and fit, with four samples of depth in a texel and
with one, on every scene in every size of the picture. OUT gets frames.html, frames.json, a CSV file for each
table, pictures, and measured.jsonl, to which each finished measurement is added at once: the same command in the
same folder goes on where it was ended.

Exit code 1: with --error, a plan's error is larger than that, or its time is more than 1.15 times the least.")]
pub struct BenchFrames {
    /// Scene file (TOML); may be repeated [default: all in the folder scenes].
    #[arg(long, value_name = "FILE")]
    pub scene: Vec<PathBuf>,
    #[command(flatten)]
    pub choose: crate::args::Choose,
    /// Pixels of the picture; several with commas between [default: each scene's].
    #[arg(long, value_name = "WIDTHxHEIGHT", value_delimiter = ',', value_parser = pixels)]
    pub output: Vec<[u32; 2]>,
    /// Rounds in which every configuration has its turn.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = rounds, default_value_t = 5)]
    pub rounds: usize,
    /// Where frames are drawn.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// Also plan each scene within this error, and compare with the fastest configuration that was
    /// measured; several with commas between.
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true, value_delimiter = ',', value_parser = crate::args::budget)]
    pub error: Vec<f64>,
    /// Folder for the report.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[cfg(feature = "frames")]
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel bench candidates --functions 2 --out report
  hankel bench candidates --functions 4 --regions 100 --out report
  hankel bench candidates --functions 3 --scene scenes/fence.toml --scene scenes/room.toml --out report

All choices of that many of 37 functions of depth (`hankel judge --help` lists them; z^9 to z^16 are not among
them): 37, 666, 7770, 66045 and 435897 choices for 1 to 5 functions. The error of a choice is how far the best lower bound that its means allow is from
percentage-closer filtering, on average, as a share of light. Four functions with
100 regions of each scene take about an hour of processor time. OUT gets candidates.html, candidates.json, a CSV
file for each table, and candidates-all.csv with every choice.")]
pub struct BenchCandidates {
    /// How many functions a map holds the means of.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=5))]
    pub functions: u8,
    /// Scene file (TOML) whose shadow map is taken; may be repeated [default: all in the folder scenes].
    #[arg(long, value_name = "FILE")]
    pub scene: Vec<PathBuf>,
    /// Filter regions of each scene.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, default_value_t = 100, value_parser = clap::value_parser!(u32).range(10..=100_000))]
    pub regions: u32,
    /// Texels of the maps along an edge [default: each scene's].
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(16..=8192))]
    pub size: Option<u32>,
    /// Taps of the Gaussian along an axis, an odd number [default: each scene's].
    #[arg(long, value_name = "TAPS", value_parser = crate::args::taps)]
    pub filter: Option<u32>,
    /// Folder for the report.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel stress
  hankel stress --family silhouettes,self --n 2,3 --samples 100000
  hankel stress --backend vulkan --precision f32
  hankel stress --against diffmoments --python venv/bin/python --out report
  hankel stress --singularities --samples 5000
  hankel stress --shadows
  hankel stress --biases

Exit code 1: a result was NaN, infinite or outside of 0 to m_0, or the SIMD lanes gave other bits
than the scalar run. OUT gets stress.html, stress.json, and a CSV file for each table.
diffmoments is a Python package:
  python3 -m pip install diffmoments numpy

Environment:
  HANKEL_PYTHON  the Python that has diffmoments, unless --python says
  HANKEL_SIMD    the instruction set of the lanes")]
pub struct Stress {
    /// Only these orders; several with commas between, or repeated [default: 1 to 6].
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=6))]
    pub n: Vec<u8>,
    /// Only these families of rows; several with commas between, or repeated.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub family: Vec<String>,
    /// Rows of each family, order and precision; moment vectors for --singularities; rows of each
    /// family for --shadows; regions for each strength for --biases [default: 10000; 400; 1000; 4000000].
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(16..=MOST_SAMPLES))]
    pub samples: Option<u64>,
    /// Only this precision.
    #[arg(long, value_enum)]
    pub precision: Option<Precision>,
    /// Where kernels are run besides the scalar run that all others are compared with.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// Measure this implementation on the same rows.
    #[arg(long, value_enum)]
    pub against: Option<Rival>,
    /// The Python that has it [default: HANKEL_PYTHON, or python3].
    #[arg(long, value_name = "PROGRAM", requires = "against")]
    pub python: Option<PathBuf>,
    /// Only bounds and derivatives at singularities and next to them.
    #[arg(long, conflicts_with_all = ["family", "biases"])]
    pub singularities: bool,
    /// Instead, bounds by trigonometric moments and by four power moments of depths in a range.
    #[arg(long, conflicts_with_all = ["n", "family", "backend", "against", "singularities", "biases"])]
    pub shadows: bool,
    /// Instead, search the least biases that keep stored moments valid (minutes).
    #[arg(long, conflicts_with_all = ["n", "family", "precision", "against"])]
    pub biases: bool,
    /// Seed of the rows.
    #[arg(
        long,
        value_name = "NUMBER",
        allow_negative_numbers = true,
        default_value_t = 1
    )]
    pub seed: u64,
    /// Folder for the report; without it, tables are only printed.
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Most samples that are drawn: results of all are kept in memory, some hundred bytes each.
const MOST_SAMPLES: u64 = 10_000_000;

/// Most rounds of a measurement.
const MOST_ROUNDS: usize = 1000;

fn within(least: usize, most: usize, text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(number) if (least..=most).contains(&number) => Ok(number),
        Ok(_) => Err(format!("from {least} to {most}")),
        Err(error) => Err(error.to_string()),
    }
}

/// `320x180`, each from 1 to the most that a scene may have.
#[cfg(feature = "frames")]
fn pixels(text: &str) -> Result<[u32; 2], String> {
    let most = hankel_frames::scene::Scene::MAX_OUTPUT;
    let number = |text: &str| text.parse::<u32>().ok().filter(|n| (1..=most).contains(n));
    let both = text.split_once('x');
    let both = both.and_then(|(width, height)| Some([number(width)?, number(height)?]));
    both.ok_or_else(|| {
        format!("write two numbers from 1 to {most} with an x between, as in 320x180")
    })
}

fn rounds(text: &str) -> Result<usize, String> {
    within(1, MOST_ROUNDS, text)
}

fn rows(text: &str) -> Result<usize, String> {
    within(
        hankel_numerics::speed::LEAST_ROWS,
        MOST_SAMPLES as usize,
        text,
    )
}

/// An implementation to compare with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Rival {
    /// The 2025 paper's own code, a Python package.
    Diffmoments,
}
