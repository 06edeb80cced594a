//! Text of others on a terminal.

use std::borrow::Cow;
use std::fmt::Write as _;

/// The text with all characters that steer a terminal, or turn its direction of writing, spelled
/// out as `\u{1b}`. Line breaks and tabs stay.
///
/// # Examples
/// ```
/// assert_eq!(hankel_system::text::visible("\u{1b}[2J red"), "\\u{1b}[2J red");
/// assert_eq!(hankel_system::text::visible("two\nlines"), "two\nlines");
/// ```
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.chars().any(steers) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if steers(c) {
            // Writing to a string does not fail.
            let _ = write!(shown, "{}", c.escape_default());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// Letters of a line of a message; a file that it quotes may have longer ones.
const LINE: usize = 16_000;

/// Text with the middle of very long lines left out.
pub fn shortened(text: &str) -> Cow<'_, str> {
    if text.lines().all(|line| line.chars().count() <= LINE) {
        return Cow::Borrowed(text);
    }
    let short = |line: &str| {
        let letters: Vec<char> = line.chars().collect();
        if letters.len() <= LINE {
            return line.to_owned();
        }
        let left = letters[..LINE / 2].iter();
        let right = letters[letters.len() - LINE / 4..].iter();
        left.chain(&[' ', '…', ' ']).chain(right).collect()
    };
    let lines: Vec<String> = text.lines().map(short).collect();
    Cow::Owned(lines.join("\n"))
}

/// Control characters, and those of Unicode that embed or override the direction of text.
fn steers(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_lose_their_middle() {
        let long = format!("a\n{}é{}\nb", "x".repeat(LINE), "y".repeat(LINE));
        let short = shortened(&long);
        assert!(short.starts_with("a\nxxx") && short.ends_with("yyy\nb"));
        assert!(short.chars().count() < LINE && short.contains(" … "));
        assert_eq!(shortened("a\nb\n"), "a\nb\n");
    }

    #[test]
    fn what_steers_a_terminal_is_spelled_out() {
        for (text, shown) in [
            ("plain", "plain"),
            ("a\tb\nc", "a\tb\nc"),
            ("\u{1b}]0;title\u{7}", "\\u{1b}]0;title\\u{7}"),
            ("over\rwritten", "over\\rwritten"),
            ("\u{9b}31m", "\\u{9b}31m"),
            ("a\u{202e}b", "a\\u{202e}b"),
            ("größer ≥ 1", "größer ≥ 1"),
        ] {
            assert_eq!(visible(text), shown);
        }
    }
}
