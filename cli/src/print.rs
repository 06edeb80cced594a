//! The standard streams. A reader that is gone ends the command without a word, as it ends other
//! tools; a disk that is full is an error. What others wrote is shown without effect on the
//! terminal.

use std::fmt;
use std::io::{self, ErrorKind, IsTerminal, Write};

use hankel_system::signals;
use hankel_system::text::visible;
use serde::Serialize;

/// Exit code of what is the machine's fault: a full disk, a name that is not text.
const MACHINE: i32 = 3;

/// A line of the result, on the standard output stream.
macro_rules! say {
    ($($arg:tt)*) => { $crate::print::line(format_args!($($arg)*)) };
}
pub(crate) use say;

/// See [`say`].
pub fn line(text: fmt::Arguments<'_>) {
    let text = text.to_string();
    raw(format!("{}\n", visible(&text)).as_bytes());
}

/// A result in JSON.
pub fn json(value: &impl Serialize) {
    match serde_json::to_string_pretty(value) {
        // JSON itself leaves some characters that steer a terminal.
        Ok(text) => raw(format!("{}\n", steered(&text)).as_bytes()),
        // The path of something that the machine has, of the cache for example.
        Err(error) => {
            note(format_args!(
                "Error: the report cannot be written as JSON: {error}; leave out --format json"
            ));
            signals::exit(MACHINE)
        }
    }
}

/// Paths of a report in JSON. What is not UTF-8 in them comes out as `\u{fffd}`, as on a terminal.
#[cfg(feature = "frames")]
pub fn paths<S: serde::Serializer>(all: &[std::path::PathBuf], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(all.iter().map(|path| path.to_string_lossy()))
}

/// The same JSON, with characters that steer a terminal in JSON's own spelling.
fn steered(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for c in json.chars() {
        let mut buffer = [0; 4];
        if visible(c.encode_utf8(&mut buffer)).len() == c.len_utf8() {
            text.push(c);
        } else {
            // None of them lies beyond the first 65 536.
            text.push_str(&format!("\\u{:04x}", u32::from(c)));
        }
    }
    text
}

/// Bytes as they are, on the standard output stream.
pub fn raw(bytes: &[u8]) {
    if let Err(error) = io::stdout().lock().write_all(bytes) {
        lost(&error);
    }
}

/// Hands over what is still in memory: to be called last.
pub fn finish() {
    if let Err(error) = io::stdout().lock().flush() {
        lost(&error);
    }
}

/// A line on the standard error stream. Who closed that does not want to be told.
pub fn note(text: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Has errors written without line breaks of their own where no terminal shows them: a tool that reads
/// them finds whole lines, and whole paths. To be called once.
pub fn unwrapped_in_pipes() {
    let wraps = io::stderr().is_terminal();
    let handler = move |_: &(dyn miette::Diagnostic + 'static)| -> Box<dyn miette::ReportHandler> {
        let options = miette::MietteHandlerOpts::new();
        Box::new(options.wrap_lines(wraps).break_words(false).build())
    };
    // It is the only one.
    let _ = miette::set_hook(Box::new(handler));
}

fn lost(error: &io::Error) -> ! {
    if error.kind() == ErrorKind::BrokenPipe {
        signals::end_of_pipe();
    }
    note(format_args!(
        "Error: cannot write to the standard output stream: {error}"
    ));
    signals::exit(MACHINE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_stays_json() {
        let text = "a\u{1b}[2J\u{9b}b\u{202e}ü\n".to_string();
        let json = steered(&serde_json::to_string(&text).unwrap());
        assert!(
            json.chars()
                .all(|c| visible(&c.to_string()).len() == c.len_utf8()),
            "{json}"
        );
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), text);
    }
}
