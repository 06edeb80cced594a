//! Comments of generated texts.

/// A line of text that can end a comment: a backslash at its end, or C's older spelling of one, would make the next line
/// part of it.
pub fn line(text: &str) -> String {
    let text = text.trim_end();
    if text.ends_with('\\') || text.ends_with("??/") {
        format!("{text} .")
    } else {
        text.to_owned()
    }
}

/// What says under which licence a text is, as tools look for it; nothing where none is known.
pub fn licence(licence: &str) -> Option<String> {
    (!licence.is_empty()).then(|| format!("SPDX-License-Identifier: {licence}"))
}

#[cfg(test)]
mod tests {
    use super::line;

    #[test]
    fn no_comment_takes_the_next_line() {
        for text in ["C:\\", "C:\\  ", "what??/"] {
            let line = line(text);
            assert!(line.ends_with('.'), "{line}");
        }
        assert_eq!(line("a \\ b"), "a \\ b");
    }
}
