//! Commands that are told to end.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Stdio;

use crate::desk::{Desk, Run, signal, until};

/// A compiler that has begun, says so, and never ends, nor does what it starts.
fn compiler(desk: &Desk) -> String {
    let path = desk.write(
        "bin/glslangValidator",
        "#!/bin/sh\ncase \"$*\" in *version*) echo Glslang 1; exit;; esac\n\
         sleep 600 &\necho $! > \"$DESK/sleep.part\"\nmv \"$DESK/sleep.part\" \"$DESK/sleep\"\nwait\n",
    );
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).expect("a mode");
    format!("{}:/usr/bin:/bin", desk.path("bin").display())
}

/// Whether a process runs: one that has ended but has nobody to tell counts as ended.
fn runs(id: &str) -> bool {
    let status = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    let state = status
        .rsplit(')')
        .next()
        .and_then(|rest| rest.split_whitespace().next());
    state.is_some_and(|state| state != "Z")
}

/// Whether this process, and so what it starts, ignores a signal.
fn is_ignored(number: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (number - 1) & 1 == 1)
}

#[test]
fn an_interrupted_matrix_leaves_no_programs_and_no_folders() {
    for (name, number) in [("INT", 2), ("TERM", 15), ("HUP", 1)] {
        // Of a shell's background, for example: then they stay ignored.
        if is_ignored(number) {
            continue;
        }
        let desk = Desk::new();
        fs::create_dir(desk.path("tmp")).expect("the desk");
        let path = compiler(&desk);
        let child = desk
            .command("parity --matrix --kernel vsm --column glsl --no-cache")
            .env("PATH", path)
            .env("DESK", desk.path("."))
            .env("TMPDIR", desk.path("tmp"))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        until("the compiler starts", || desk.path("sleep").is_file());
        signal(&child, name);
        let output = child.wait_with_output().expect("it ends");
        Run(output).ended_by(number);
        let sleep = desk.read("sleep").trim().to_owned();
        until("what the compiler started ends", || !runs(&sleep));
        let left: Vec<_> = fs::read_dir(desk.path("tmp")).expect("a folder").collect();
        assert!(left.is_empty(), "{name}: {left:?}");
    }
}

#[test]
fn an_interrupted_eval_leaves_no_file() {
    let desk = Desk::new();
    let rows = desk.fifo("rows");
    let child = desk
        .command("eval vsm --input rows --output out.csv")
        .stdout(Stdio::null())
        .spawn()
        .expect("it starts");
    let mut pipe = fs::File::options().write(true).open(rows).expect("a pipe");
    std::io::Write::write_all(&mut pipe, b"b1,b2,depth\n0.5,0.3,0.2\n").expect("a pipe");
    until("it begins its output", || desk.names().len() > 1);
    signal(&child, "TERM");
    let output = child.wait_with_output().expect("it ends");
    Run(output).ended_by(15);
    assert_eq!(desk.names(), ["rows"]);
}
