//! Tables as users write them, good and bad.

mod common;

use std::path::{Path, PathBuf};

use common::*;
use hankel_dsl::native::describe::Precision;
use hankel_host::crates::{KernelCrate, KernelEntry};
use hankel_host::device::{Device, NativeDevice, Shader};
use hankel_host::eval::{self, EvalError, Job, Table};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }
}

fn run(
    device: &mut dyn Device,
    sample: &Sample,
    input: &Path,
    output: &Path,
    set: &[&str],
) -> Result<u64, EvalError> {
    let entry = sample.entry();
    let settings = set
        .iter()
        .map(|s| eval::parse_setting(s))
        .collect::<Result<Vec<_>, _>>()?;
    let shader = Some(Shader::SpirvPassthrough(&sample.spirv));
    let job = Job {
        entry: &entry,
        shader,
        settings: &settings,
        input,
        output,
    };
    eval::run(device, &job, &mut |_| {})
}

fn devices() -> [Box<dyn Device>; 2] {
    [Box::new(NativeDevice::new()), Box::new(vulkan())]
}

#[test]
fn rows_come_back_exactly_on_both_devices() {
    let folder = Folder::new();
    // Columns in another order than the kernel's, spaces, a quoted cell, Windows line ends.
    let input = folder.write(
        "in.csv",
        "\u{feff}y, x\r\n3,1\r\n\"0.1\", 1e-7\r\n-2 ,4\r\n",
    );
    let mut texts = Vec::new();
    for mut device in devices() {
        let output = folder.path("out.csv");
        let set = ["scale=2", "settings.offset=0.5"];
        assert_eq!(
            run(device.as_mut(), &affine(), &input, &output, &set).unwrap(),
            3
        );
        texts.push(std::fs::read_to_string(&output).unwrap());
    }
    assert_eq!(texts[0], texts[1]);
    let expected = [(1.0f32, 3.0f32), (1e-7, 0.1), (4.0, -2.0)].map(|(x, y)| (x * 2.0 + 0.5) / y);
    let mut lines = texts[0].lines();
    assert_eq!(lines.next(), Some("output"));
    for (line, expected) in lines.zip(expected) {
        assert_eq!(line.parse::<f32>().unwrap().to_bits(), expected.to_bits());
    }
}

#[test]
fn every_type_of_number_and_defaults_and_constants() {
    let folder = Folder::new();
    let input = folder.write("in.csv", "a,n,m\n0.1,3,-2147483648\n1e300,4294967295,7\n");
    let output = folder.path("out.csv");
    let sample = mixed();
    for mut device in devices() {
        run(device.as_mut(), &sample, &input, &output, &[]).unwrap();
        let text = std::fs::read_to_string(&output).unwrap();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows[0], "q,v,s");
        assert_eq!(
            rows[1],
            format!("{:?},{:?},-2147483648", 0.1 / 3.0, 0.1 * 3.0)
        );
        assert_eq!(
            rows[2],
            format!("{:?},{:?},-7", 1e300 / f64::from(u32::MAX), 1e300 * 3.0)
        );
        run(
            device.as_mut(),
            &sample,
            &input,
            &output,
            &["shift=1", "bias=1", "gain=1"],
        )
        .unwrap();
        let text = std::fs::read_to_string(&output).unwrap();
        let expected = format!("{:?},1.1,-2147483648", 1.1 / 4.0);
        assert_eq!(text.lines().nth(1), Some(expected.as_str()));
    }
    let table = Table::new(&sample.kernel).unwrap();
    let names: Vec<String> = table.settings.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["bias = 0.0", "gain = 3.0", "shift = 0"]);
}

#[test]
fn more_rows_than_fit_in_one_piece() {
    let folder = Folder::new();
    let mut text = String::from("x,y\n");
    for i in 0..150_001 {
        text.push_str(&format!("{i},7\n"));
    }
    let input = folder.write("in.csv", text);
    let output = folder.path("out.csv");
    let mut seen = Vec::new();
    let entry = affine().entry();
    let settings = [("scale".to_string(), "1".to_string())];
    let job = Job {
        entry: &entry,
        shader: None,
        settings: &settings,
        input: &input,
        output: &output,
    };
    let rows = eval::run(&mut NativeDevice::new(), &job, &mut |n| seen.push(n)).unwrap();
    assert_eq!(
        (rows, seen.last(), seen.len()),
        (150_001, Some(&150_001), 3)
    );
    let text = std::fs::read_to_string(&output).unwrap();
    assert_eq!(text.lines().count(), 150_002);
    assert_eq!(
        text.lines().last().unwrap().parse::<f32>().unwrap(),
        150_000.0 / 7.0
    );
}

#[test]
fn no_rows_are_no_rows() {
    let folder = Folder::new();
    let input = folder.write("in.csv", "x,y\n");
    let output = folder.path("out.csv");
    assert_eq!(
        run(&mut NativeDevice::new(), &affine(), &input, &output, &[]).unwrap(),
        0
    );
    assert_eq!(std::fs::read_to_string(&output).unwrap(), "output\n");
}

#[test]
fn bad_tables_name_the_place_and_leave_no_output() {
    let folder = Folder::new();
    let output = folder.path("out.csv");
    for (text, words) in [
        ("", &["no header", "x, y"][..]),
        ("x,z\n1,2\n", &["column 2 is `z`", "x, y"]),
        ("x\n1\n", &["column `y` is missing"]),
        ("x,y,x\n1,2,3\n", &["two columns `x`"]),
        (
            "x,y\n1,2\n3,four\n",
            &["row 2 (line 3)", "column `y`", "`four` is not a number"],
        ),
        ("x,y\n1,\n", &["row 1 (line 2)", "column `y`", "empty"]),
        (
            "x,y\n1,2\n\n\nNaN,2\n",
            &["row 2 (line 5)", "column `x`", "not finite"],
        ),
        ("x,y\n-inf,2\n", &["column `x`", "not finite"]),
        ("x,y\n1e99,2\n", &["column `x`", "too large for f32"]),
        (
            "x,y\n1,2\n3\n",
            &["row 2 (line 3)", "1 cells, the header has 2"],
        ),
        (
            "x,y\n1,2,3\n",
            &["row 1 (line 2)", "3 cells, the header has 2"],
        ),
    ] {
        let input = folder.write("in.csv", text);
        let error = run(&mut NativeDevice::new(), &affine(), &input, &output, &[]).unwrap_err();
        let error = error.to_string();
        assert!(error.contains("in.csv"), "{error}");
        assert!(words.iter().all(|w| error.contains(w)), "{text:?}: {error}");
        assert!(!output.exists());
    }
    let input = folder.write("in.csv", b"x,y\n1,\xff\xfe\n");
    let error = run(&mut NativeDevice::new(), &affine(), &input, &output, &[]).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("row 1 (line 2): it is not UTF-8"),
        "{error}"
    );
    let input = folder.write("in.csv", "a,n,m\n1,5000000000,1\n");
    let error = run(&mut NativeDevice::new(), &mixed(), &input, &output, &[]).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("column `n`: `5000000000` is not in the range"),
        "{error}"
    );
    assert_eq!(
        std::fs::read_dir(folder.0.path()).unwrap().count(),
        1,
        "temporary files stay"
    );
}

#[test]
fn an_output_that_was_there_survives_an_error() {
    let folder = Folder::new();
    let input = folder.write("in.csv", "x,y\n1,2\nbad,3\n");
    let output = folder.write("out.csv", "before");
    run(&mut NativeDevice::new(), &affine(), &input, &output, &[]).unwrap_err();
    assert_eq!(std::fs::read_to_string(&output).unwrap(), "before");
}

#[test]
fn bad_paths_and_settings_are_named() {
    let folder = Folder::new();
    let input = folder.write("in.csv", "x,y\n1,2\n");
    let output = folder.path("out.csv");
    let refuse = |input: &Path, output: &Path, set: &[&str]| {
        run(&mut NativeDevice::new(), &affine(), input, output, set)
            .unwrap_err()
            .to_string()
    };
    let text = refuse(&folder.path("none.csv"), &output, &[]);
    assert!(
        text.contains("none.csv") && text.contains("No such file"),
        "{text}"
    );
    assert!(refuse(folder.0.path(), &output, &[]).contains("folder"));
    assert!(refuse(&input, folder.0.path(), &[]).contains("it is a folder"));
    let text = refuse(&input, &folder.path("no/such/out.csv"), &[]);
    assert!(text.contains("out.csv"), "{text}");
    let text = refuse(&input, &output, &["scael=1"]);
    assert!(
        text.contains("no `scael`") && text.contains("scale = 0.0, offset = 0.0"),
        "{text}"
    );
    assert!(refuse(&input, &output, &["scale=1", "settings.scale=2"]).contains("twice"));
    assert!(refuse(&input, &output, &["scale=NaN"]).contains("not finite"));
    assert!(refuse(&input, &output, &["scale=big"]).contains("not a number"));
    assert!(refuse(&input, &output, &["scale"]).contains("NAME=VALUE"));
    assert!(!output.exists());
}

#[test]
fn kernels_that_are_no_maps_and_unknown_ones_are_named() {
    for (sample, words) in [
        (double(), "`table` is neither a column nor a setting"),
        (histogram(), "does not return one element"),
        (sums(), "its rows share memory"),
        (image(), "runs over texels"),
        (place(), "is a vertex stage"),
        (tint(), "is a fragment stage"),
    ] {
        let error = Table::new(&sample.kernel).unwrap_err().to_string();
        assert!(
            error.contains(words) && error.contains(&sample.kernel.name),
            "{error}"
        );
    }
    let entries: Vec<KernelEntry> = [affine(), mixed(), tint()]
        .iter()
        .map(Sample::entry)
        .collect();
    let kernels = KernelCrate {
        name: "samples".into(),
        entries,
    };
    let select = |name: &str, p: Option<Precision>| eval::select(&kernels, name, p);
    assert_eq!(select("mixed", None).unwrap().kernel.name, "mixed_f64");
    assert_eq!(
        select("affine", Some(Precision::F32)).unwrap().kernel.name,
        "affine"
    );
    let text = select("mixed", Some(Precision::F32))
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("`mixed` in f32") && text.contains("affine, mixed_f64"),
        "{text}"
    );
    assert!(!text.contains("tint"), "{text}");
}

#[test]
fn fields_of_two_parameters_that_share_a_name_take_the_parameters() {
    let mut sample = affine();
    let pair = structure("Pair", &[("x", F32), ("z", F32)]);
    sample
        .kernel
        .params
        .insert(2, param("other", element(3, pair)));
    let table = Table::new(&sample.kernel).unwrap();
    let names: Vec<&str> = table.inputs.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["pair.x", "y", "other.x", "z"]);
}
