//! Standard streams that are closed or full.

use std::fs::File;
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::process::Stdio;

use crate::desk::{Desk, Run};

const SIGPIPE: i32 = 13;

/// Commands that print, without the long work of some.
const PRINT: [&str; 8] = [
    "list",
    "list --format json",
    "build --out s --kernel vsm",
    "new crate-of-mine",
    "completions bash",
    "toolchain status",
    "parity --kernel vsm",
    "--help",
];

/// One that is asked for a table on the standard output stream.
const EVAL: &str = "-q eval vsm --input rows.csv --output /dev/stdout";

#[test]
fn a_reader_that_is_gone_ends_a_command_without_a_word() {
    for line in PRINT.into_iter().chain([EVAL]) {
        let desk = Desk::new();
        desk.write("rows.csv", "b1,b2,depth\n0.5,0.3,0.2\n");
        let mut command = desk.command(line);
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output = command.stdout(writer).stderr(Stdio::piped()).output();
        let run = Run(output.expect("it starts"));
        run.ended_by(SIGPIPE);
        // What goes on is told while it goes on; a driver's layer has words of its own.
        let words = run.err().replace("Running 2 kernels in 5 columns", "");
        let words = words.replace(
            "error: XDG_RUNTIME_DIR is invalid or not set in the environment.",
            "",
        );
        assert_eq!(words.trim(), "", "{line}");
    }
}

/// A file that a shell opened, and that others write to as well.
#[test]
fn the_standard_output_stream_is_written_where_it_is() {
    let desk = Desk::new();
    desk.write("rows.csv", "b1,b2,depth\n0.5,0.3,0.2\n");
    let file = desk.path("all.txt");
    let mut shared = File::create(&file).expect("a file");
    writeln!(shared, "before").expect("it is written");
    let mut command = desk.command(EVAL);
    let own = shared.try_clone().expect("the same place in the file");
    let output = command.stdout(own).stderr(Stdio::piped()).output();
    Run(output.expect("it starts")).code(0);
    writeln!(shared, "after").expect("it is written");
    let lines = desk.read("all.txt");
    let lines: Vec<&str> = lines.lines().collect();
    assert_eq!(
        (lines[0], lines[1], lines[3]),
        ("before", "shadow", "after"),
        "{lines:?}"
    );
}

/// What reads a message finds whole paths in it.
#[test]
fn messages_are_not_wrapped_in_a_pipe() {
    let desk = Desk::new();
    let long = "a-folder-with-a-long-name-".repeat(8);
    let run = desk.hankel(&format!("list --manifest-path {long}/Cargo.toml"));
    let words = format!("{long}/Cargo.toml");
    let said = String::from_utf8_lossy(&run.0.stderr);
    assert!(said.lines().any(|line| line.contains(&words)), "{said}");
}

#[test]
fn a_full_disk_is_told() {
    for line in PRINT {
        let desk = Desk::new();
        let mut command = desk.command(line);
        let full = File::options()
            .write(true)
            .open("/dev/full")
            .expect("a device");
        let output = command.stdout(full).stderr(Stdio::piped()).output();
        Run(output.expect("it starts")).fails(3, &["standard output", "No space left"]);
    }
}

/// What is told beside a result changes it as little.
#[test]
fn pictures_differ_where_the_error_stream_is_full() {
    let desk = Desk::new();
    desk.write(
        "scene.toml",
        "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\ntarget = [0.0, 0.5, 0.0]\n\
         [light]\ndirection = [-1.0, -2.0, -0.5]\n[output]\nwidth = 64\nheight = 36\n",
    );
    let full = File::options()
        .write(true)
        .open("/dev/full")
        .expect("a device");
    let status = desk
        .command("render scene.toml --out p.png --compare --limit 0")
        .stderr(full)
        .stdout(Stdio::null())
        .status();
    let status = status.expect("it starts");
    assert_eq!((status.code(), status.signal()), (Some(1), None));
}

#[test]
fn an_error_stream_that_is_closed_or_full_changes_nothing() {
    for line in ["list --kernel nosuch", "frobnicate", "check nowhere"] {
        let desk = Desk::new();
        let (reader, closed) = std::io::pipe().expect("a pipe");
        drop(reader);
        let full = File::options()
            .write(true)
            .open("/dev/full")
            .expect("a device");
        for stderr in [Stdio::from(closed), Stdio::from(full)] {
            let status = desk
                .command(line)
                .stderr(stderr)
                .stdout(Stdio::null())
                .status();
            let status = status.expect("it starts");
            assert_eq!((status.code(), status.signal()), (Some(2), None), "{line}");
        }
    }
}
