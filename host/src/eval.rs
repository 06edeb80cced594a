//! A map kernel on the rows of a table: columns are the fields of its element parameters, the
//! columns of the result those of its output.
//!
//! Rows stream through in pieces, so that a table may be larger than memory. The result appears
//! under its name only when it is whole: after an error there is none.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};

use hankel_dsl::native::CallError;
use hankel_dsl::native::call::Ending;
use hankel_dsl::native::describe::{Kernel, Output, Param, Precision, Range, Role, Scalar, Stage};
use hankel_system::input::InputError;
use hankel_system::output::{self, OutputError};
use hankel_system::table::{CellError, ColumnsError, Table as Rows, TableError};

use crate::crates::{KernelCrate, KernelEntry};
use crate::device::{Bind, Device, DeviceError, Shader};
use crate::flat::{self, Leaf, Number};

/// Rows that are run at once.
const ROWS: usize = 1 << 16;

/// Why a table was not evaluated.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// The kernel is no map over rows.
    #[error("kernel `{kernel}` cannot be run on rows: {why}")]
    NotAMap {
        /// Its name.
        kernel: String,
        /// Why not.
        why: String,
    },
    /// No kernel of that name, or not in that precision.
    #[error("`{crate_name}` has no kernel `{name}`{precision}; maps over rows are: {known}")]
    NoKernel {
        /// The crate.
        crate_name: String,
        /// What was asked for.
        name: String,
        /// The precision that was asked for, in words.
        precision: String,
        /// What there is.
        known: String,
    },
    /// The kernel that is named as its compensated form does not stand for it.
    #[error("`{kernel}` has `compensated = {compensated}`: {problem}")]
    Compensated {
        /// The plain kernel.
        kernel: String,
        /// The other one's function.
        compensated: String,
        /// Why not.
        problem: String,
    },
    /// A setting that the kernel does not have, or that was given twice.
    #[error("--set {given}: {problem}")]
    Setting {
        /// What was given.
        given: String,
        /// What is wrong, and what may be set.
        problem: String,
    },
    /// The input cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The output cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Columns that do not fit the kernel.
    #[error(transparent)]
    Columns(#[from] ColumnsError),
    /// A row or a cell that cannot be used.
    #[error(transparent)]
    Cell(#[from] CellError),
    /// A row that the kernel does not come back from.
    #[error("{}: row {row}: kernel `{kernel}`: its process {how}, at {inputs}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Row, from 1, without the header.
        row: u64,
        /// The kernel.
        kernel: String,
        /// How its process ended.
        how: Ending,
        /// The row's values by name.
        inputs: String,
    },
    /// The device's words.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

impl From<TableError> for EvalError {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Input(error) => Self::Input(error),
            TableError::Cell(error) => Self::Cell(error),
        }
    }
}

/// A number that may be given by name: a field of a uniform, or a specialisation constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Its name; the parameter's name in front where fields of two parameters share a name.
    pub name: String,
    /// The name with the parameter's in front, which is accepted too.
    pub full: String,
    /// Its type.
    pub scalar: Scalar,
    /// What it is unless given.
    pub default: Number,
    /// Its documentation.
    pub summary: String,
    place: Place,
}

/// Where a setting goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// The slot's index among the arguments, and bytes from its start.
    Uniform(usize, usize),
    /// The constant's index.
    Constant(usize),
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.name, self.default)
    }
}

/// A column of the input or the output.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Its type.
    pub scalar: Scalar,
    /// The documentation of the field.
    pub summary: String,
    /// Which of the buffers, and bytes from the element's start.
    place: (usize, usize),
}

/// A kernel as a map over rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Columns that the input must have.
    pub inputs: Vec<Column>,
    /// Columns of the result.
    pub outputs: Vec<Column>,
    /// What may be set.
    pub settings: Vec<Setting>,
    /// Bytes of an element or a uniform, one for each argument but the output.
    arguments: Vec<(bool, usize)>,
    output_bytes: usize,
}

/// The entry point for a function's or an entry point's name: in `precision`, or else in the
/// first that there is.
///
/// # Errors
/// [`EvalError::NoKernel`], with the names of the kernels that are maps over rows.
pub fn select<'a>(
    kernels: &'a KernelCrate,
    name: &str,
    precision: Option<Precision>,
) -> Result<&'a KernelEntry, EvalError> {
    let fits = |k: &Kernel| precision.is_none() || k.precision == precision;
    // A kernel written for f32 as it stands has no precision of its own.
    let fits = |k: &Kernel| fits(k) || (precision == Some(Precision::F32) && k.precision.is_none());
    let named = kernels.entries.iter().filter(|e| e.kernel.name == name);
    let of_function = kernels.entries.iter().filter(|e| e.kernel.function == name);
    named
        .chain(of_function)
        .find(|e| fits(&e.kernel))
        .ok_or_else(|| {
            let mut known: Vec<&str> = kernels
                .entries
                .iter()
                .filter(|e| Table::new(&e.kernel).is_ok())
                .map(|e| e.kernel.name.as_str())
                .collect();
            known.dedup();
            EvalError::NoKernel {
                crate_name: kernels.name.clone(),
                name: name.into(),
                precision: match precision {
                    None => String::new(),
                    Some(Precision::F32) => " in f32".into(),
                    Some(Precision::F64) => " in f64".into(),
                },
                known: known.join(", "),
            }
        })
}

/// The kernel that computes the same as `entry` in about twice the digits; `entry` where it names none.
///
/// # Errors
/// [`EvalError::Compensated`].
pub fn compensated<'a>(
    kernels: &'a KernelCrate,
    entry: &'a KernelEntry,
) -> Result<&'a KernelEntry, EvalError> {
    let plain = &entry.kernel;
    let Some(function) = &plain.compensated else {
        return Ok(entry);
    };
    let fail = |problem: &str| EvalError::Compensated {
        kernel: plain.name.clone(),
        compensated: function.clone(),
        problem: problem.into(),
    };
    let found = kernels
        .entries
        .iter()
        .find(|it| it.kernel.function == *function && it.kernel.precision == plain.precision);
    let found = found.ok_or_else(|| fail("it is not in `kernels!`, or not in this precision"))?;
    if found.kernel.params != plain.params || found.kernel.outputs != plain.outputs {
        return Err(fail("it has other parameters or results"));
    }
    Ok(found)
}

/// A plain value's name stands for the whole; a field's stands alone where no other has it.
fn short_names<'a>(all: impl Iterator<Item = (&'a str, &'a Leaf)> + Clone) -> Vec<String> {
    let short = |(param, leaf): (&str, &Leaf)| {
        if leaf.path.is_empty() || leaf.path.starts_with(['.', '[']) {
            flat::join(param, &leaf.path)
        } else {
            leaf.path.clone()
        }
    };
    let mut count = HashMap::<String, usize>::new();
    for item in all.clone() {
        *count.entry(short(item)).or_default() += 1;
    }
    all.map(|item| {
        let name = short(item);
        if count[&name] > 1 {
            flat::join(item.0, &item.1.path)
        } else {
            name
        }
    })
    .collect()
}

fn from_f64(scalar: Scalar, x: f64) -> Number {
    match scalar {
        Scalar::F32 => Number::F32(x as f32),
        Scalar::F64 => Number::F64(x),
        // `as` saturates.
        Scalar::U32 => Number::U32(x as u32),
        Scalar::I32 => Number::I32(x as i32),
        Scalar::U64 => Number::U64(x as u64),
        Scalar::I64 => Number::I64(x as i64),
        Scalar::Bool => Number::U32(u32::from(x != 0.0)),
        Scalar::F16 => Number::half(x),
    }
}

impl Table {
    /// How a kernel is run on rows.
    ///
    /// # Errors
    /// [`EvalError::NotAMap`] for kernels of other stages or dimensions, or with textures,
    /// counters or buffers that are read anywhere.
    pub fn new(kernel: &Kernel) -> Result<Self, EvalError> {
        let not = |why: &str| EvalError::NotAMap {
            kernel: kernel.name.clone(),
            why: why.into(),
        };
        match &kernel.stage {
            Stage::Compute {
                dimensions: 1,
                cooperative: false,
                range: Range::Outputs,
                ..
            } => {}
            Stage::Compute {
                dimensions: 1,
                cooperative: false,
                ..
            } => return Err(not("its range is not that of its rows")),
            Stage::Compute { dimensions: 1, .. } => return Err(not("its rows share memory")),
            Stage::Compute { .. } => return Err(not("it runs over texels")),
            Stage::Vertex => return Err(not("it is a vertex stage")),
            Stage::Fragment => return Err(not("it is a fragment stage")),
        }
        let [Output::Buffer { layout: output, .. }] = &kernel.outputs[..] else {
            return Err(not("it does not return one element for each row"));
        };
        let mut arguments = Vec::new();
        let mut elements: Vec<(&str, usize, Leaf)> = Vec::new();
        let mut uniforms: Vec<(&Param, usize, Leaf)> = Vec::new();
        let mut constants: Vec<(&str, Scalar, u32)> = Vec::new();
        for param in &kernel.params {
            let (layout, is_element) = match &param.role {
                Role::Element { layout, .. } => (layout, true),
                Role::Uniform { layout, .. } => (layout, false),
                Role::Constant {
                    default, scalar, ..
                } => {
                    constants.push((&param.name, *scalar, *default));
                    continue;
                }
                Role::Index => continue,
                _ => {
                    return Err(not(&format!(
                        "`{}` is neither a column nor a setting",
                        param.name
                    )));
                }
            };
            let index = arguments.len();
            for leaf in flat::leaves(layout) {
                if is_element {
                    elements.push((param.name.as_str(), index, leaf));
                } else {
                    uniforms.push((param, index, leaf));
                }
            }
            arguments.push((is_element, layout.size as usize));
        }
        if elements.is_empty() {
            return Err(not("it reads no columns"));
        }
        let names = short_names(elements.iter().map(|(p, _, l)| (*p, l)));
        let inputs = elements
            .iter()
            .zip(names)
            .map(|((_, index, leaf), name)| Column {
                name,
                scalar: leaf.scalar,
                summary: leaf.summary.clone(),
                place: (*index, leaf.offset),
            })
            .collect();
        let outputs = flat::leaves(output)
            .into_iter()
            .map(|leaf| Column {
                name: if leaf.path.is_empty() || leaf.path.starts_with(['.', '[']) {
                    flat::join("output", &leaf.path)
                } else {
                    leaf.path
                },
                scalar: leaf.scalar,
                summary: leaf.summary,
                place: (0, leaf.offset),
            })
            .collect();
        let names = short_names(uniforms.iter().map(|(p, _, l)| (p.name.as_str(), l)));
        let mut settings: Vec<Setting> = uniforms
            .iter()
            .zip(names)
            .map(|((param, index, leaf), name)| Setting {
                name,
                full: flat::join(&param.name, &leaf.path),
                scalar: leaf.scalar,
                default: from_f64(
                    leaf.scalar,
                    leaf.inputs.within(&param.inputs).default.unwrap_or(0.0),
                ),
                summary: leaf.summary.clone(),
                place: Place::Uniform(*index, leaf.offset),
            })
            .collect();
        for (i, (name, scalar, default)) in constants.into_iter().enumerate() {
            settings.push(Setting {
                name: name.into(),
                full: name.into(),
                scalar,
                default: Number::read(scalar, &default.to_le_bytes()),
                summary: String::new(),
                place: Place::Constant(i),
            });
        }
        Ok(Self {
            inputs,
            outputs,
            settings,
            arguments,
            output_bytes: output.size as usize,
        })
    }

    /// The uniforms' bytes, one for each argument, and the constants.
    fn settings(&self, given: &[(String, String)]) -> Result<(Vec<Vec<u8>>, Vec<u32>), EvalError> {
        let mut bytes: Vec<Vec<u8>> = self.arguments.iter().map(|(_, n)| vec![0; *n]).collect();
        let mut constants = Vec::new();
        let mut values: Vec<Option<Number>> = vec![None; self.settings.len()];
        for (name, text) in given {
            let bad = |problem: String| EvalError::Setting {
                given: format!("{name}={text}"),
                problem,
            };
            let Some(i) = self
                .settings
                .iter()
                .position(|s| s.name == *name || s.full == *name)
            else {
                let known: Vec<String> = self.settings.iter().map(ToString::to_string).collect();
                return Err(bad(if known.is_empty() {
                    "the kernel has nothing to set".into()
                } else {
                    format!(
                        "the kernel has no `{name}`; it has, with defaults: {}",
                        known.join(", ")
                    )
                }));
            };
            if values[i].is_some() {
                return Err(bad(format!("`{name}` is given twice")));
            }
            values[i] = Some(parse(self.settings[i].scalar, text).map_err(bad)?);
        }
        for (setting, value) in self.settings.iter().zip(values) {
            let value = value.unwrap_or(setting.default);
            match (setting.place, value) {
                (Place::Uniform(argument, offset), _) => {
                    value.write(&mut bytes[argument][offset..]);
                }
                (Place::Constant(_), _) => {
                    let mut word = [0; 4];
                    value.write(&mut word);
                    constants.push(u32::from_le_bytes(word));
                }
            }
        }
        Ok((bytes, constants))
    }
}

/// Reads a finite number; the error says what is wrong with it.
fn parse(scalar: Scalar, text: &str) -> Result<Number, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err("it is empty".into());
    }
    // Not by way of f64, which does not hold all of them.
    match scalar {
        Scalar::U64 => {
            let number = text.parse().map(Number::U64);
            return number
                .map_err(|_| format!("`{text}` is not a whole number from 0 to {}", u64::MAX));
        }
        Scalar::I64 => {
            let number = text.parse().map(Number::I64);
            return number.map_err(|_| {
                format!(
                    "`{text}` is not a whole number from {} to {}",
                    i64::MIN,
                    i64::MAX
                )
            });
        }
        Scalar::Bool => {
            return match text {
                "0" | "false" => Ok(Number::U32(0)),
                "1" | "true" => Ok(Number::U32(1)),
                _ => Err(format!("`{text}` is neither 0 nor 1")),
            };
        }
        Scalar::F32 | Scalar::F64 | Scalar::U32 | Scalar::I32 | Scalar::F16 => {}
    }
    let Ok(wide) = text.parse::<f64>() else {
        return Err(format!("`{text}` is not a number"));
    };
    let spelled_out = text
        .trim_start_matches(['+', '-'])
        .starts_with(|c: char| c.is_alphabetic());
    if spelled_out {
        return Err(format!("`{text}` is not finite"));
    }
    let too_large = |ty: &str| format!("`{text}` is too large for {ty}");
    match scalar {
        Scalar::F64 if wide.is_finite() => Ok(Number::F64(wide)),
        Scalar::F64 => Err(too_large("f64")),
        // Not by way of f64, which would round twice.
        Scalar::F32 => match text.parse::<f32>() {
            Ok(x) if x.is_finite() => Ok(Number::F32(x)),
            _ => Err(too_large("f32")),
        },
        Scalar::F16 => match Number::half(wide) {
            half if half.to_f64().is_finite() => Ok(half),
            _ => Err(too_large("a half: at most 65504")),
        },
        _ => {
            let (name, least, most) = if scalar == Scalar::U32 {
                ("u32", 0.0, f64::from(u32::MAX))
            } else {
                ("i32", f64::from(i32::MIN), f64::from(i32::MAX))
            };
            if wide.fract() != 0.0 {
                return Err(format!("`{text}` is not a whole number"));
            }
            if !(least..=most).contains(&wide) {
                return Err(format!(
                    "`{text}` is not in the range of {name}, {least} to {most}"
                ));
            }
            Ok(from_f64(scalar, wide))
        }
    }
}

/// What to evaluate.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The kernel, with its native code.
    pub entry: &'a KernelEntry,
    /// Its shader, for a Vulkan device.
    pub shader: Option<Shader<'a>>,
    /// Names and values of settings.
    pub settings: &'a [(String, String)],
    /// The table to read: CSV with a header.
    pub input: &'a Path,
    /// The table to write.
    pub output: &'a Path,
}

/// Splits `NAME=VALUE`.
///
/// # Errors
/// [`EvalError::Setting`] for anything else.
pub fn parse_setting(text: &str) -> Result<(String, String), EvalError> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => {
            Ok((name.trim().into(), value.trim().into()))
        }
        _ => Err(EvalError::Setting {
            given: text.into(),
            problem: "write NAME=VALUE".into(),
        }),
    }
}

/// Runs a kernel on a table's rows, and writes the results; gives the number of rows.
/// `progress` gets the number of rows done so far, now and then.
///
/// # Errors
/// See [`EvalError`]; then no output is written, and one that was there before stays.
pub fn run(
    device: &mut dyn Device,
    job: &Job<'_>,
    progress: &mut dyn FnMut(u64),
) -> Result<u64, EvalError> {
    let table = Table::new(&job.entry.kernel)?;
    let (uniforms, constants) = table.settings(job.settings)?;
    let mut rows = Rows::open(job.input)?;
    let names: Vec<&str> = table.inputs.iter().map(|c| c.name.as_str()).collect();
    let columns = rows.columns(&names)?;

    let unwritable = |e: csv::Error| OutputError::write(job.output, e);
    let output = output::Output::create(job.output, &[job.input])?;
    let mut writer = csv::Writer::from_writer(output);
    writer
        .write_record(table.outputs.iter().map(|c| &c.name))
        .map_err(unwritable)?;

    let mut done = 0;
    let mut cells = csv::StringRecord::new();
    let mut chunk = uniforms;
    loop {
        for (bytes, _) in chunk
            .iter_mut()
            .zip(&table.arguments)
            .filter(|(_, (e, _))| *e)
        {
            bytes.clear();
        }
        let mut count = 0;
        while count < ROWS
            && let Some(place) = rows.next(&mut cells)?
        {
            append(&table, &columns, &cells, &mut chunk)
                .map_err(|(column, problem)| rows.wrong(&place, Some(column), problem))?;
            count += 1;
        }
        if count == 0 {
            break;
        }
        let results = run_chunk(device, job, &table, &chunk, &constants, count)
            .map_err(|error| of_row(error, job.input, done + 1))?;
        let mut text = String::new();
        for element in results.chunks_exact(table.output_bytes) {
            for column in &table.outputs {
                use fmt::Write as _;
                text.clear();
                let number = Number::read(column.scalar, &element[column.place.1..]);
                // Writing to a string does not fail.
                let _ = write!(text, "{number}");
                writer.write_field(&text).map_err(unwritable)?;
            }
            writer.write_record(None::<&[u8]>).map_err(unwritable)?;
        }
        done += count as u64;
        progress(done);
    }
    writer
        .into_inner()
        .map_err(|e| OutputError::write(job.output, e.into_error()))?
        .commit()?;
    Ok(done)
}

/// Adds a row's numbers to the buffers; the error is a column, and what is wrong with its cell.
fn append<'a>(
    table: &'a Table,
    columns: &[usize],
    cells: &csv::StringRecord,
    chunk: &mut [Vec<u8>],
) -> Result<(), (&'a str, String)> {
    let mut starts = Vec::with_capacity(chunk.len());
    for (bytes, (is_element, size)) in chunk.iter_mut().zip(&table.arguments) {
        starts.push(bytes.len());
        if *is_element {
            bytes.resize(bytes.len() + size, 0);
        }
    }
    for (cell, &input) in cells.iter().zip(columns) {
        let column = &table.inputs[input];
        let number = parse(column.scalar, cell).map_err(|p| (column.name.as_str(), p))?;
        let (argument, offset) = column.place;
        number.write(&mut chunk[argument][starts[argument] + offset..]);
    }
    Ok(())
}

/// Names the row that a kernel does not come back from; `first` is that of the piece that ran.
fn of_row(error: EvalError, path: &Path, first: u64) -> EvalError {
    match error {
        EvalError::Device(DeviceError::Native {
            kernel,
            source:
                CallError::Ended {
                    how,
                    culprit: Some(culprit),
                },
        }) => EvalError::Row {
            path: path.into(),
            row: first + culprit.element as u64,
            kernel,
            how,
            inputs: culprit.inputs,
        },
        other => other,
    }
}

fn run_chunk(
    device: &mut dyn Device,
    job: &Job<'_>,
    table: &Table,
    chunk: &[Vec<u8>],
    constants: &[u32],
    count: usize,
) -> Result<Vec<u8>, EvalError> {
    let output = device.buffer("output", count * table.output_bytes)?;
    let mut args: Vec<Bind<'_>> = chunk.iter().map(|b| Bind::Bytes(b)).collect();
    args.push(Bind::Buffer(output));
    let result = device
        .dispatch(&job.entry.program(job.shader, constants), &args)
        .and_then(|()| device.read_buffer(output));
    device.free_buffer(output)?;
    Ok(result?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_finite_numbers_of_their_type() {
        assert_eq!(parse(Scalar::F32, " 0.1 "), Ok(Number::F32(0.1)));
        assert_eq!(parse(Scalar::F64, "-1e-320"), Ok(Number::F64(-1e-320)));
        assert_eq!(parse(Scalar::U32, "4294967295"), Ok(Number::U32(u32::MAX)));
        assert_eq!(parse(Scalar::F16, "-0.5"), Ok(Number::F16(0xb800)));
        assert_eq!(parse(Scalar::F16, "0.099975586"), Ok(Number::F16(0x2e66)));
        assert_eq!(parse(Scalar::I32, "-2147483648"), Ok(Number::I32(i32::MIN)));
        // Rounded once: by way of f64 it would be the float above.
        let text = "1.00000005960464477540";
        assert_eq!(
            parse(Scalar::F32, text),
            Ok(Number::F32(text.parse().unwrap()))
        );
        for (scalar, text, words) in [
            (Scalar::F32, "", "empty"),
            (Scalar::F32, "abc", "`abc` is not a number"),
            (Scalar::F32, "0x10", "not a number"),
            (Scalar::F32, "nan", "not finite"),
            (Scalar::F64, "-inf", "not finite"),
            (Scalar::F64, "+Infinity", "not finite"),
            (Scalar::F32, "1e39", "too large for f32"),
            (Scalar::F64, "1e309", "too large for f64"),
            (Scalar::F16, "70000", "too large for a half"),
            (Scalar::U32, "4294967296", "not in the range of u32"),
            (Scalar::U32, "-1", "not in the range of u32"),
            (Scalar::I32, "2147483648", "not in the range of i32"),
            (Scalar::U32, "1.5", "not a whole number"),
        ] {
            let error = parse(scalar, text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn settings_are_names_and_values() {
        assert_eq!(
            parse_setting("a = 1=2").unwrap(),
            ("a".to_string(), "1=2".to_string())
        );
        assert!(parse_setting("=1").is_err());
        assert!(
            parse_setting("a")
                .unwrap_err()
                .to_string()
                .contains("NAME=VALUE")
        );
    }
}
