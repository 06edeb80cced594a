//! Valid files, damaged.

use std::path::PathBuf;
use std::time::Duration;

use bolero::TypeGenerator;

/// One thing that happens to a file.
#[derive(Clone, Debug, TypeGenerator)]
enum Edit {
    /// A byte changes.
    Byte { at: u32, to: u8 },
    /// A bit flips.
    Bit { at: u32, bit: u8 },
    /// Four bytes become a number that programs stumble over.
    Word { at: u32, which: u8 },
    /// A digit or a letter of text becomes another.
    Letter { at: u32, to: u8 },
    /// Some bytes go.
    Cut { at: u32, length: u16 },
    /// Some bytes come twice.
    Repeat { at: u32, length: u16 },
    /// Four bytes are swapped with four others.
    Swap { one: u32, other: u32 },
    /// The rest goes.
    End { at: u32 },
}

const WORDS: [u32; 10] = [
    0,
    1,
    2,
    0x7f,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
    0x7f80_0000,
];

const LETTERS: &[u8] = b"0123456789-+.eE\"'[]{},:=\\/#\n\0azAZ_*";

/// Which of the valid files, and what happens to it.
#[derive(Clone, Debug, TypeGenerator)]
pub struct Damage {
    file: u8,
    edits: Vec<Edit>,
}

impl Damage {
    /// The damaged file, and which one it was.
    pub fn of<'a, T: AsRef<[u8]>>(&self, files: &'a [T]) -> (&'a T, Vec<u8>) {
        let file = &files[usize::from(self.file) % files.len()];
        let mut bytes = file.as_ref().to_vec();
        // More edits than a few leave nothing to read.
        for edit in self.edits.iter().take(6) {
            edit.apply(&mut bytes);
        }
        (file, bytes)
    }
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let count = bytes.len();
        if count < 8 {
            return;
        }
        let place = |at: u32| at as usize % (count - 4);
        match *self {
            Self::Byte { at, to } => bytes[place(at)] = to,
            Self::Bit { at, bit } => bytes[place(at)] ^= 1 << (bit % 8),
            Self::Letter { at, to } => {
                bytes[place(at)] = LETTERS[usize::from(to) % LETTERS.len()];
            }
            Self::Word { at, which } => {
                let at = place(at) & !3;
                let word = WORDS[usize::from(which) % WORDS.len()];
                bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
            }
            Self::Cut { at, length } => {
                let at = place(at);
                bytes.drain(at..(at + usize::from(length % 64)).min(count));
            }
            Self::Repeat { at, length } => {
                let at = place(at);
                let part = bytes[at..(at + usize::from(length % 64)).min(count)].to_vec();
                bytes.splice(at..at, part);
            }
            Self::Swap { one, other } => {
                let (one, other) = (place(one) & !3, place(other) & !3);
                for k in 0..4 {
                    bytes.swap(one + k, other + k);
                }
            }
            Self::End { at } => bytes.truncate(place(at)),
        }
    }
}

/// How long each target runs.
pub fn time() -> Duration {
    let seconds = std::env::var("HANKEL_FUZZ_SECONDS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(1);
    Duration::from_secs(seconds)
}

/// Keeps an input for the case that it ends this process.
pub fn keep(name: &str, bytes: &[u8]) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{name}"));
    std::fs::write(&path, bytes).expect("the folder for tests can be written");
    path
}

/// An error says something, and nothing that steers a terminal by its length.
pub fn says(error: &impl ToString) {
    let text = error.to_string();
    assert!(!text.trim().is_empty(), "an error without words");
    assert!(text.len() < 100_000, "an error of {} bytes", text.len());
}
