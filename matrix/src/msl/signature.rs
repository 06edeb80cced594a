//! What an entry point in MSL asks for and returns, read from its text: as much of the language as
//! a signature and the structures that it names.

/// An entry point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signature {
    /// `kernel`, `vertex` or `fragment`.
    pub stage: String,
    /// The parameters, in order.
    pub params: Vec<Param>,
    /// What is returned; none for `void`.
    pub returns: Option<Structure>,
    /// Whether the text has barriers, or operations of SIMD-groups: threads wait for one another.
    pub barriers: bool,
    /// Whether the text has derivatives, or samples, which may take them.
    pub derivatives: bool,
}

/// A parameter of an entry point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// What it is given.
    pub given: Given,
}

/// What a parameter is given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Given {
    /// `[[buffer(n)]]`.
    Buffer(u32),
    /// `[[texture(n)]]`.
    Texture(u32),
    /// `[[sampler(n)]]`.
    Sampler(u32),
    /// A reference to memory of the workgroup.
    Threadgroup,
    /// A position or index, by its attribute's name.
    Position(String),
    /// `[[stage_in]]`.
    StageIn(Structure),
}

/// A structure that goes into a stage or comes out of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Its name.
    pub name: String,
    /// Its members.
    pub members: Vec<Member>,
}

/// A member of a [`Structure`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name.
    pub name: String,
    /// `float`, `int` or `uint`.
    pub scalar: String,
    /// How many components.
    pub size: u32,
    /// What it is.
    pub part: Part,
}

/// What a member of a [`Structure`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// `[[attribute(n)]]`.
    Attribute(u32),
    /// `[[user(locn)]]`.
    User(u32),
    /// `[[color(n)]]`.
    Colour(u32),
    /// `[[position]]`.
    Position,
    /// `[[depth(any)]]`.
    Depth,
    /// `[[sample_mask]]`.
    Mask,
    /// `[[clip_distance]]`.
    ClipDistances,
    /// `[[color(0), index(1)]]`.
    SecondSource,
}

/// Positions and indices that an invocation can ask for.
const POSITIONS: [&str; 19] = [
    "thread_position_in_grid",
    "thread_position_in_threadgroup",
    "thread_index_in_threadgroup",
    "thread_index_in_simdgroup",
    "simdgroup_index_in_threadgroup",
    "threads_per_simdgroup",
    "simdgroups_per_threadgroup",
    "threadgroup_position_in_grid",
    "threads_per_threadgroup",
    "threadgroups_per_grid",
    "threads_per_grid",
    "vertex_id",
    "instance_id",
    "base_vertex",
    "position",
    "front_facing",
    "sample_id",
    "sample_mask",
    "primitive_id",
];

/// How a value is interpolated: of no interest to whoever gives it ready.
const INTERPOLATIONS: [&str; 7] = [
    "flat",
    "center_perspective",
    "center_no_perspective",
    "centroid_perspective",
    "centroid_no_perspective",
    "sample_perspective",
    "sample_no_perspective",
];

/// The signature of `entry_point` in `text`.
///
/// # Errors
/// A shape that is not understood, quoted.
pub fn parse(text: &str, entry_point: &str) -> Result<Signature, String> {
    let tokens = tokens(text)?;
    let at = find_entry(&tokens, entry_point)?;
    let close = matching(&tokens, at.open)?;
    let mut params = Vec::new();
    for param in split(&tokens[at.open + 1..close]) {
        params.push(parse_param(&tokens, param)?);
    }
    let returns = match at.returns {
        [t] if t == "void" => None,
        [name] => Some(structure(&tokens, name)?),
        other => {
            return Err(format!(
                "returns `{}`, which is not a structure",
                quote(other)
            ));
        }
    };
    Ok(Signature {
        stage: at.stage.clone(),
        params,
        returns,
        barriers: tokens
            .iter()
            .any(|t| t.ends_with("_barrier") || t.starts_with("simd_") || t.starts_with("quad_")),
        derivatives: ["dfdx", "dfdy", "fwidth", "sample", "sample_compare"]
            .iter()
            .any(|name| tokens.iter().any(|t| t == name)),
    })
}

/// Where an entry point is.
struct Entry<'a> {
    stage: &'a String,
    returns: &'a [String],
    /// The token that opens its parameters.
    open: usize,
}

fn find_entry<'a>(tokens: &'a [String], name: &str) -> Result<Entry<'a>, String> {
    let mut found = None;
    for (i, stage) in tokens.iter().enumerate() {
        if !["kernel", "vertex", "fragment"].contains(&stage.as_str()) {
            continue;
        }
        // `[[kernel]] void name(` means the same as `kernel void name(`.
        let mut from = i + 1;
        if tokens.get(from).is_some_and(|t| t == "]]") {
            from += 1;
        }
        let Some(open) = (from..tokens.len()).find(|&k| tokens[k] == "(") else {
            continue;
        };
        if open > from + 1 && tokens[open - 1] == name {
            let entry = Entry {
                stage,
                returns: &tokens[from..open - 1],
                open,
            };
            if found.replace(entry).is_some() {
                return Err(format!("two entry points named `{name}`"));
            }
        }
    }
    found.ok_or_else(|| format!("no entry point named `{name}`"))
}

fn parse_param(all: &[String], param: &[String]) -> Result<Param, String> {
    let shape = |why: &str| format!("parameter `{}`: {why}", quote(param));
    let begin = param.iter().position(|t| t == "[[").unwrap_or(param.len());
    let (declared, attributes) = param.split_at(begin);
    let attributes = attributes_of(attributes).map_err(|why| shape(&why))?;
    let (name, of) = declared
        .split_last()
        .ok_or_else(|| shape("nothing is declared"))?;
    if !is_name(name) || of.is_empty() {
        return Err(shape("no type and name"));
    }
    let number = |attribute: &Attribute<'_>| match attribute.argument {
        Some(n) => n
            .parse()
            .map_err(|_| shape("the attribute's number is none")),
        None => Err(shape("the attribute has no number")),
    };
    let is_memory = of.iter().any(|t| t == "&" || t == "*");
    let given = match &attributes[..] {
        [] if of[0] == "threadgroup" && of.last().is_some_and(|t| t == "&") => Given::Threadgroup,
        [one] => match one.name {
            "buffer" if is_memory => Given::Buffer(number(one)?),
            "texture" => Given::Texture(number(one)?),
            "sampler" => Given::Sampler(number(one)?),
            "stage_in" => match of {
                [name] => Given::StageIn(structure(all, name)?),
                _ => return Err(shape("its type is not a structure")),
            },
            name if POSITIONS.contains(&name) && !is_memory => Given::Position(name.into()),
            _ => return Err(shape("an attribute that is not known here")),
        },
        _ => return Err(shape("one attribute is expected")),
    };
    Ok(Param {
        name: name.clone(),
        given,
    })
}

/// The structure `name`, whose members are all parts of a stage.
fn structure(tokens: &[String], name: &str) -> Result<Structure, String> {
    let open = tokens
        .windows(3)
        .position(|w| w[0] == "struct" && w[1] == name && w[2] == "{")
        .ok_or_else(|| format!("no `struct {name}`"))?
        + 2;
    let close = matching(tokens, open)?;
    let mut members = Vec::new();
    for member in tokens[open + 1..close].split(|t| t == ";") {
        if member.is_empty() {
            continue;
        }
        members.push(
            parse_member(member)
                .map_err(|why| format!("member `{}` of `{name}`: {why}", quote(member)))?,
        );
    }
    Ok(Structure {
        name: name.into(),
        members,
    })
}

fn parse_member(member: &[String]) -> Result<Member, String> {
    let begin = member
        .iter()
        .position(|t| t == "[[")
        .unwrap_or(member.len());
    let (declared, attributes) = member.split_at(begin);
    // Behind the attributes of an array is its length.
    let (attributes, length) = match attributes {
        [attributes @ .., open, length, close] if open == "[" && close == "]" => (
            attributes,
            Some(length.parse::<u32>().map_err(|_| "no length")?),
        ),
        _ => (attributes, None),
    };
    let (value, name) = match declared {
        [value, name] => (value, name),
        [space, colons, value, name] if space == "metal" && colons == "::" => (value, name),
        _ => return Err("no type and name".into()),
    };
    let split = value
        .strip_suffix(['2', '3', '4'])
        .map_or((value.as_str(), 1), |scalar| {
            (scalar, value.as_bytes()[value.len() - 1] - b'0')
        });
    let (scalar, size) = split;
    if !["float", "int", "uint"].contains(&scalar) {
        return Err(format!("`{value}` is not taken in or out of a stage here"));
    }
    let mut part = None;
    for attribute in attributes_of(attributes)? {
        let this = match (attribute.name, attribute.argument) {
            ("attribute", Some(n)) => Part::Attribute(n.parse().map_err(|_| "no number")?),
            ("color", Some(n)) => Part::Colour(n.parse().map_err(|_| "no number")?),
            ("user", Some(n)) => Part::User(
                n.strip_prefix("loc")
                    .and_then(|n| n.parse().ok())
                    .ok_or("`user` of no location")?,
            ),
            ("position", None) => Part::Position,
            ("depth", Some("any")) => Part::Depth,
            ("sample_mask", None) => Part::Mask,
            ("clip_distance", None) => Part::ClipDistances,
            ("index", Some("0")) if part == Some(Part::Colour(0)) => continue,
            ("index", Some("1")) if part == Some(Part::Colour(0)) => {
                part = Some(Part::SecondSource);
                continue;
            }
            ("invariant", None) => continue,
            (other, None) if INTERPOLATIONS.contains(&other) => continue,
            (other, _) => return Err(format!("attribute `{other}` is not known here")),
        };
        if part.replace(this).is_some() {
            return Err("it is two things".into());
        }
    }
    Ok(Member {
        name: name.clone(),
        scalar: scalar.into(),
        size: length.unwrap_or(1) * u32::from(size),
        part: part.ok_or("no attribute says what it is")?,
    })
}

/// `name` or `name(argument)`.
struct Attribute<'a> {
    name: &'a str,
    argument: Option<&'a str>,
}

/// Those of one or several `[[…, …]]`.
fn attributes_of(mut tokens: &[String]) -> Result<Vec<Attribute<'_>>, String> {
    let mut all = Vec::new();
    while let [open, rest @ ..] = tokens {
        let end = rest.iter().position(|t| t == "]]");
        let Some(end) = end.filter(|_| open == "[[") else {
            return Err(format!("`{}` is not an attribute", quote(tokens)));
        };
        for one in split(&rest[..end]) {
            let strings: Vec<&str> = one.iter().map(String::as_str).collect();
            let (name, argument) = match strings[..] {
                [name] => (name, None),
                [name, "(", argument, ")"] => (name, Some(argument)),
                _ => return Err(format!("`{}` is not an attribute", quote(one))),
            };
            all.push(Attribute { name, argument });
        }
        tokens = &rest[end + 1..];
    }
    Ok(all)
}

/// Parts between the commas that no bracket encloses.
fn split(tokens: &[String]) -> Vec<&[String]> {
    let mut depth = 0_i32;
    let mut parts = Vec::new();
    let mut from = 0;
    for (i, t) in tokens.iter().enumerate() {
        match t.as_str() {
            "(" | "[" | "{" | "<" | "[[" => depth += 1,
            ")" | "]" | "}" | ">" | "]]" => depth -= 1,
            "," if depth == 0 => {
                parts.push(&tokens[from..i]);
                from = i + 1;
            }
            _ => {}
        }
    }
    if from < tokens.len() {
        parts.push(&tokens[from..]);
    }
    parts
}

/// The token that closes the bracket at `open`.
fn matching(tokens: &[String], open: usize) -> Result<usize, String> {
    let mut depth = 0_i32;
    for (i, t) in tokens.iter().enumerate().skip(open) {
        match t.as_str() {
            "(" | "{" => depth += 1,
            ")" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Ok(i);
        }
    }
    Err(format!(
        "a bracket is not closed: `{}`",
        quote(&tokens[open..])
    ))
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
}

/// The beginning of `tokens` as text.
fn quote(tokens: &[String]) -> String {
    const SHOWN: usize = 24;
    let mut text = tokens[..tokens.len().min(SHOWN)].join(" ");
    if tokens.len() > SHOWN {
        text.push_str(" …");
    }
    text
}

/// Names, numbers and marks, without comments and lines of the preprocessor. `::`, `[[` and `]]`
/// are one token each; `]]` only where `[[` is open, since two indices may end together.
fn tokens(text: &str) -> Result<Vec<String>, String> {
    let mut all: Vec<String> = Vec::new();
    let mut rest = text;
    let mut line_begins = true;
    let mut in_attribute = false;
    while let Some(c) = rest.chars().next() {
        if c.is_whitespace() {
            line_begins |= c == '\n';
            rest = &rest[c.len_utf8()..];
            continue;
        }
        if c == '#' && line_begins {
            let mut end = rest.find('\n').unwrap_or(rest.len());
            while rest[..end].ends_with('\\') {
                end += 1 + rest[end + 1..].find('\n').unwrap_or(rest.len() - end - 1);
            }
            rest = &rest[end..];
            continue;
        }
        line_begins = false;
        if rest.starts_with("//") {
            rest = &rest[rest.find('\n').unwrap_or(rest.len())..];
            continue;
        }
        if let Some(comment) = rest.strip_prefix("/*") {
            let end = comment.find("*/").ok_or("a comment is not closed")?;
            rest = &comment[end + 2..];
            continue;
        }
        let length = if c.is_ascii_alphanumeric() || c == '_' {
            rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
                .unwrap_or(rest.len())
        } else if rest.starts_with("::")
            || rest.starts_with("[[")
            || (in_attribute && rest.starts_with("]]"))
        {
            2
        } else {
            c.len_utf8()
        };
        let token = &rest[..length];
        match token {
            "[[" => in_attribute = true,
            "]]" => in_attribute = false,
            _ => {}
        }
        all.push(token.into());
        rest = &rest[length..];
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPUTE: &str = "
// kernel void fake(
#include <metal_stdlib>
#define TWO_LINES kernel \\
  void fake()
/* kernel void fake( */
[[max_total_threads_per_threadgroup(64)]] kernel void scan(
  metal::uint3 id [[thread_position_in_grid]]
, uint local [[thread_index_in_threadgroup]]
, device U32Buffer const& x [[buffer(0)]]
, constant float* y [[ buffer(12) ]]
, metal::texture2d<float, metal::access::write> out [[texture(1)]]
, metal::sampler s [[sampler(0)]]
, threadgroup type_3& sums
) { metal::threadgroup_barrier(metal::mem_flags::mem_threadgroup); a[b[0]]; }
kernel void other() {}
";

    fn param(name: &str, given: Given) -> Param {
        Param {
            name: name.into(),
            given,
        }
    }

    #[test]
    fn a_kernel_with_everything() {
        let signature = parse(COMPUTE, "scan").unwrap();
        assert_eq!(signature.stage, "kernel");
        assert_eq!(signature.returns, None);
        assert!(signature.barriers);
        assert_eq!(
            signature.params,
            [
                param("id", Given::Position("thread_position_in_grid".into())),
                param(
                    "local",
                    Given::Position("thread_index_in_threadgroup".into())
                ),
                param("x", Given::Buffer(0)),
                param("y", Given::Buffer(12)),
                param("out", Given::Texture(1)),
                param("s", Given::Sampler(0)),
                param("sums", Given::Threadgroup),
            ]
        );
        assert_eq!(parse(COMPUTE, "other").unwrap().params, []);
        assert!(parse(COMPUTE, "fake").unwrap_err().contains("`fake`"));
    }

    const VERTEX: &str = "
struct In { metal::float3 p [[attribute(0)]]; uint n [[attribute(3)]]; };
struct Out { float4 position [[position]]; int2 v [[user(loc1), flat]]; };
vertex Out corner(In in [[stage_in]], uint i [[vertex_id]], constant Map& map [[buffer(0)]]) {}
[[fragment]] Out tint(In in [[stage_in]]) {}
";

    #[test]
    fn a_stage_with_structures() {
        let signature = parse(VERTEX, "corner").unwrap();
        let member = |name: &str, scalar: &str, size, part| Member {
            name: name.into(),
            scalar: scalar.into(),
            size,
            part,
        };
        assert_eq!(
            signature.params[0].given,
            Given::StageIn(Structure {
                name: "In".into(),
                members: vec![
                    member("p", "float", 3, Part::Attribute(0)),
                    member("n", "uint", 1, Part::Attribute(3)),
                ],
            })
        );
        assert_eq!(
            signature.returns,
            Some(Structure {
                name: "Out".into(),
                members: vec![
                    member("position", "float", 4, Part::Position),
                    member("v", "int", 2, Part::User(1)),
                ],
            })
        );
        assert!(!signature.barriers);
        assert_eq!(parse(VERTEX, "tint").unwrap().stage, "fragment");
    }

    #[test]
    fn what_is_not_understood_is_quoted() {
        for (text, entry_point, quoted) in [
            ("kernel void f(uint i) {}", "f", "uint i"),
            (
                "kernel void f(uint i [[amplification_id]]) {}",
                "f",
                "amplification_id",
            ),
            ("kernel void f(uint i [[buffer(0)]]) {}", "f", "uint i"),
            (
                "kernel void f(device X& i [[buffer(n)]]) {}",
                "f",
                "buffer ( n )",
            ),
            (
                "kernel void f(device X& i [[buffer(0)]] [[raster_order_group(0)]]) {}",
                "f",
                "raster",
            ),
            (
                "kernel void f(threadgroup float* x [[threadgroup(0)]]) {}",
                "f",
                "float * x",
            ),
            ("kernel void f(S s [[stage_in]]) {}", "f", "struct S"),
            (
                "struct S { half x [[attribute(0)]]; }; vertex S f() {}",
                "f",
                "half x",
            ),
            ("struct S { float x; }; vertex S f() {}", "f", "float x"),
            (
                "struct S { float x[2] [[user(loc0)]]; }; vertex S f() {}",
                "f",
                "x [ 2 ]",
            ),
            (
                "struct S { float x [[stencil]]; }; fragment S f() {}",
                "f",
                "stencil",
            ),
            ("fragment metal::float4 f() {}", "f", "metal :: float4"),
            ("kernel void f() {} kernel void f() {}", "f", "two"),
            ("kernel void f(", "f", "not closed"),
            ("/* ", "f", "comment"),
            ("", "f", "`f`"),
        ] {
            let problem = parse(text, entry_point).unwrap_err();
            assert!(problem.contains(quoted), "{text}: {problem}");
        }
    }
}
