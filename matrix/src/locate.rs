//! Which line of a generated text something is about.

use hankel_dsl::native::describe::Kernel;
use hankel_host::device::slots;

use crate::report::Line;
use crate::subject::Code;

/// The line that a compiler's message names: the first number between colons, or after one.
#[must_use]
pub fn of_message(text: &str, message: &str) -> Option<Line> {
    let lines: Vec<&str> = text.lines().collect();
    let lower = message.to_ascii_lowercase();
    // Warnings may come before the error.
    let from = message
        .lines()
        .zip(lower.lines())
        .skip_while(|(_, l)| !l.contains("error"))
        .map(|(line, _)| line)
        .find_map(number)
        .or_else(|| message.lines().find_map(number))?;
    let found = lines.get(from.checked_sub(1)?)?;
    Some(Line {
        number: from,
        text: found.trim().into(),
    })
}

/// The first `:N:`, `:N ` or `:N` at the end.
fn number(line: &str) -> Option<usize> {
    line.match_indices(':').find_map(|(at, _)| {
        let rest = &line[at + 1..];
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        let ends = matches!(rest.as_bytes().get(digits), None | Some(b':' | b' ' | b','));
        (digits > 0 && ends).then(|| rest[..digits].parse().ok())?
    })
}

/// The line that writes the output that the number `value` belongs to; none where several do.
#[must_use]
pub fn of_output(text: &str, kernel: &Kernel, code: &Code, value: &str) -> Option<Line> {
    let slots = slots::slots(kernel);
    let slot = slots
        .iter()
        .filter(|s| s.role.is_written() && value.starts_with(&s.name))
        .max_by_key(|s| s.name.len())?;
    let place = slot.binding.and_then(|b| code.places.get(&b));
    let writes = |line: &str| match place.and_then(|p| p.name.as_deref()) {
        Some(name) => {
            let stands = line.match_indices(name).any(|(at, _)| {
                let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
                !line[..at].ends_with(is_name) && !line[at + name.len()..].starts_with(is_name)
            });
            let writes = ["=", "tore", "write", "atomic", "Interlocked"];
            stands && writes.iter().any(|word| line.contains(word))
        }
        // A stage returns it.
        None => line.trim_start().starts_with("return ") || line.contains("gl_Position ="),
    };
    let mut lines = text.lines().enumerate().filter(|(_, l)| writes(l));
    let (number, found) = lines.next()?;
    lines.next().is_none().then(|| Line {
        number: number + 1,
        text: found.trim().into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "one\ntwo\nthree\nfour";

    fn line(message: &str) -> Option<(usize, String)> {
        of_message(TEXT, message).map(|l| (l.number, l.text))
    }

    #[test]
    fn the_words_of_every_compiler_name_a_line() {
        for message in [
            "ERROR: vsm.glsl:3: 'x' : undeclared identifier",
            "vsm.hlsl:1:2: warning: odd\nvsm.hlsl:3:9: error: undeclared",
            "dxc: vsm.hlsl:3:9: error: undeclared",
            ":3:14 error: unresolved value 'x'",
            "0:3(11): error: x\nvsm:3: error",
        ] {
            assert_eq!(line(message), Some((3, "three".into())), "{message}");
        }
        assert_eq!(line("it broke"), None);
        assert_eq!(line("error: a:99: beyond"), None);
    }
}
