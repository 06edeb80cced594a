//! What a shader's text says of its inputs and outputs.

/// An input or output of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Variable {
    /// How it is interpolated and how precise it is.
    pub(super) qualifiers: String,
    /// Its type.
    pub(super) kind: String,
    /// Its name.
    pub(super) name: String,
    /// Its location: that of its layout, else the number at its name's end.
    pub(super) location: Option<u32>,
}

/// Qualifiers that the stage before must repeat.
const REPEATED: [&str; 8] = [
    "flat",
    "smooth",
    "noperspective",
    "centroid",
    "sample",
    "highp",
    "mediump",
    "lowp",
];

/// The line with the version, which all stages of a program must share.
pub(super) fn version(text: &str) -> &str {
    let first = text.lines().next().unwrap_or_default();
    if first.starts_with("#version") {
        first
    } else {
        ""
    }
}

/// The inputs (`in`) or outputs (`out`) that are declared.
pub(super) fn variables(text: &str, direction: &str) -> Vec<Variable> {
    statements(text)
        .iter()
        .filter_map(|it| variable(it, direction))
        .collect()
}

/// The words of the layout of the variable `name`; none if it has none.
pub(super) fn layout(text: &str, name: &str) -> Vec<String> {
    let declares = |statement: &String| {
        statement.trim_start().starts_with("layout")
            && statement.split_whitespace().last() == Some(name)
    };
    let declaration = statements(text).into_iter().find(declares);
    declaration
        .as_deref()
        .and_then(|it| it.split_once('(')?.1.split_once(')'))
        .map_or("", |(inside, _)| inside)
        .split(',')
        .map(|word| word.trim().to_owned())
        .collect()
}

fn variable(statement: &str, direction: &str) -> Option<Variable> {
    let mut rest = statement.trim();
    let mut location = None;
    if let Some(layout) = rest.strip_prefix("layout") {
        let (inside, after) = layout.trim_start().strip_prefix('(')?.split_once(')')?;
        rest = after;
        for part in inside.split(',') {
            if let Some((key, value)) = part.split_once('=')
                && key.trim() == "location"
            {
                location = value.trim().parse().ok();
            }
        }
    }
    let words: Vec<&str> = rest.split_whitespace().collect();
    let [qualifiers @ .., kind, name] = &words[..] else {
        return None;
    };
    if !qualifiers.contains(&direction) {
        return None;
    }
    let number = name.rsplit(|c: char| !c.is_ascii_digit()).next();
    Some(Variable {
        qualifiers: qualifiers
            .iter()
            .copied()
            .filter(|it| REPEATED.contains(it))
            .collect::<Vec<_>>()
            .join(" "),
        kind: (*kind).to_owned(),
        name: (*name).to_owned(),
        location: location.or_else(|| number?.parse().ok()),
    })
}

/// The text's statements outside of all braces, without comments and directives.
fn statements(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut statement = String::new();
    let mut depth = 0usize;
    for line in plain(text).lines() {
        if line.trim_start().starts_with('#') {
            continue;
        }
        for c in line.chars() {
            match c {
                '{' => depth += 1,
                '}' => {
                    depth = depth.saturating_sub(1);
                    statement.clear();
                }
                ';' if depth == 0 => all.push(std::mem::take(&mut statement)),
                _ if depth == 0 => statement.push(c),
                _ => {}
            }
        }
        statement.push(' ');
    }
    all
}

/// The text without its comments.
fn plain(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("//").into_iter().chain(rest.find("/*")).min() {
        out.push_str(&rest[..at]);
        let comment = &rest[at..];
        let end = if comment.starts_with("//") {
            comment.find('\n')
        } else {
            comment.find("*/").map(|end| end + 2)
        };
        rest = &comment[end.unwrap_or(comment.len())..];
    }
    out.push_str(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "#version 310 es
// in vec4 commented;
layout(local_size_x = 8) in;
struct S { vec4 in_struct; };
layout(std140, binding = 0) uniform Block { S u_s; };
layout(location = 2) flat in highp uvec3 seen; /* in
vec2 hidden; */ smooth in vec3 _vs2fs_location11;
layout(location = 0) out vec4 colour;
void main() { vec4 out_of_it = vec4(0.0); colour = out_of_it; }
";

    #[test]
    fn declarations_are_found() {
        assert_eq!(version(TEXT), "#version 310 es");
        let ins = variables(TEXT, "in");
        assert_eq!(ins.len(), 2, "{ins:?}");
        assert_eq!(ins[0].qualifiers, "flat highp");
        assert_eq!(ins[0].kind, "uvec3");
        assert_eq!(ins[0].location, Some(2));
        assert_eq!(ins[1].name, "_vs2fs_location11");
        assert_eq!(ins[1].location, Some(11));
        let outs = variables(TEXT, "out");
        assert_eq!(outs.len(), 1, "{outs:?}");
        assert_eq!(outs[0].name, "colour");
    }
}
