//! What the lint must find, and what it must not.

mod support;

use hankel_codegen::finish;
use hankel_codegen::lint::{Construct, Finding, of_module};
use hankel_codegen::translate::Ir;

/// Findings in a kernel with this body, over a uniform `n`, constants and a buffer.
fn findings(body: &str) -> Vec<Finding> {
    let source = format!(
        "struct Row {{ a: array<f32, 4>, v: vec4<f32> }}\n\
         @group(0) @binding(0) var<uniform> n: u32;\n\
         @group(0) @binding(1) var<storage, read_write> rows: array<Row>;\n\
         var<workgroup> shared_: array<f32, 64>;\n\
         const TABLE = array<f32, 3>(1.0, 2.0, 3.0);\n\
         const FOUR = 4u;\n\
         @id(0) override taps: u32 = 9u;\n\
         fn part(p: ptr<function, array<f32, 3>>, i: u32) -> f32 {{ {} }}\n\
         @compute @workgroup_size(64)\n\
         fn kernel(@builtin(global_invocation_id) id: vec3<u32>) {{\n{body}\n}}\n",
        if body.contains("part(") {
            "return (*p)[i];"
        } else {
            "return (*p)[1];"
        },
    );
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
    of_module(&module, Some(&source))
}

#[test]
fn loops_with_a_constant_number_of_turns_are_fine() {
    for body in [
        "for (var i = 0u; i < 4u; i++) { rows[id.x].v.x += 1.0; }",
        "for (var i = 0; i <= 6; i += 2) { rows[id.x].v.x += f32(i); }",
        "for (var i = 8; i > 0; i--) { rows[id.x].v.x += 1.0; }",
        "for (var i = 0u; 4u > i; i = i + 1u) { rows[id.x].v.x += 1.0; }",
        "for (var i = 0u; i < FOUR * 2u; i++) { rows[id.x].v.x += 1.0; }",
        // Known when the pipeline is made.
        "for (var i = 0u; i < taps; i++) { rows[id.x].v.x += 1.0; }",
        "var i = 0u; while (i < 4u) { rows[id.x].v.x += 1.0; i++; }",
        // Counts before it asks.
        "var i = 0u; loop { i++; if i >= 4u { break; } rows[id.x].v.x += 1.0; }",
        "var i = 0u; loop { rows[id.x].v.x += 1.0; continuing { i += 1u; break if i == 4u; } }",
        // Signed from unsigned, as rust-gpu compares.
        "for (var i = 0u; bitcast<i32>(i) < 4; i++) { rows[id.x].v.x += 1.0; }",
        // Not every turn does everything, but every turn counts.
        "for (var i = 0u; i < 4u; i++) { if id.y > i { continue; } rows[id.x].v.x += 1.0; }",
        // In a `switch`, `break` stays in the loop.
        "for (var i = 0u; i < 4u; i++) { switch id.y { case 1u: { break; } default: {} } }",
        // Both counters start anew from constants.
        "for (var i = 0u; i < 3u; i++) { for (var j = 0u; j < 3u; j++) { rows[i].v.x += 1.0; } }",
    ] {
        assert_eq!(findings(body), [], "{body}");
    }
}

#[test]
fn other_loops_are_found_with_the_reason() {
    for (body, why) in [
        (
            "for (var i = 0u; i < n; i++) { rows[id.x].v.x += 1.0; }",
            "its counter is not compared with a constant",
        ),
        (
            "for (var i = n; i < 4u; i++) { rows[id.x].v.x += 1.0; }",
            "its counter does not start from a constant",
        ),
        (
            "var i = 0u; if id.y > 3u { i = 1u; } while (i < 4u) { rows[id.x].v.x += 1.0; i++; }",
            "its counter does not start from a constant",
        ),
        (
            "for (var i = 0u; i < 4u; i += n) { rows[id.x].v.x += 1.0; }",
            "its counter does not change by a constant",
        ),
        (
            "var i = 1u; while (i < 64u) { i *= 3u; }",
            "its counter does not change by a constant",
        ),
        (
            "var i = 0u; while (i < 4u) { i += 0u; }",
            "its counter does not change by a constant",
        ),
        (
            "for (var i = 0u; i < 9u; i++) { if rows[i].v.x > 0.0 { i++; } }",
            "its counter does not change exactly once in each iteration",
        ),
        (
            "var i = 0u; while (i < 9u) { if rows[i].v.x > 0.0 { continue; } i++; }",
            "its counter does not change exactly once in each iteration",
        ),
        (
            "for (var i = 0u; i < 4u; i++) { if rows[i].v.x > 0.0 { break; } }",
            "it is left in several places",
        ),
        (
            "for (var i = 0u; i < 4u; i++) { if rows[i].v.x > 0.0 { return; } }",
            "it is left in several places",
        ),
        (
            "var i = 0u; loop { i++; if n > 2u { if i > 3u { break; } } }",
            "it is left at a place that not every iteration reaches",
        ),
        (
            "var x = 1.0; while (x < 4.0) { x += 1.0; }",
            "the loop does not end by comparing a counter",
        ),
        (
            "while (rows[id.x].v.x < 4.0) { rows[id.x].v.x += 1.0; }",
            "the loop does not end by comparing a counter",
        ),
        (
            "for (var i = 0u; i < 4u && rows[i].v.x > 0.0; i++) { rows[i].v.x -= 1.0; }",
            "the loop does not end by comparing a counter",
        ),
        ("loop { rows[id.x].v.x += 1.0; }", "it is never left"),
    ] {
        let found = findings(body);
        let loops: Vec<_> = found
            .iter()
            .filter(|it| it.construct == Construct::Loop)
            .collect();
        assert_eq!(loops.len(), 1, "{body}: {found:?}");
        assert_eq!(loops[0].message, why, "{body}");
        assert_eq!(loops[0].function, "kernel");
    }
    // The inner loop goes on where the outer one's last turn left it.
    let found = findings(
        "var j = 0u; for (var i = 0u; i < 3u; i++) { while (j < 3u) { rows[i].v.x += 1.0; j++; } }",
    );
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].message.contains("does not start"), "{found:?}");
}

#[test]
fn dynamic_indices_into_what_is_not_memory_are_found() {
    for (body, what) in [
        (
            "var a = array<f32, 3>(); rows[id.x].v.x = a[id.y];",
            "`a` has an index",
        ),
        (
            "var a = array<f32, 3>(); a[id.y] = 1.0; rows[id.x].v.x = a[1];",
            "`a` has an index",
        ),
        (
            "var m = mat3x3<f32>(); rows[id.x].v.x = m[1][id.y];",
            "`m` has an index",
        ),
        (
            "let row = rows[id.x]; rows[id.y].v.x = row.a[n];",
            "`rows` has an index",
        ),
        (
            "var a = array<f32, 3>(); rows[id.x].v.x = part(&a, n);",
            "`p` has an index",
        ),
        ("rows[id.x].v.x = TABLE[id.y];", "has an index"),
        ("rows[id.x].v.x = f32(id[n]);", "`id` has an index"),
    ] {
        let found = findings(body);
        assert_eq!(found.len(), 1, "{body}: {found:?}");
        assert_eq!(found[0].construct, Construct::DynamicIndex);
        assert!(found[0].message.contains(what), "{body}: {found:?}");
    }
}

#[test]
fn memory_may_be_indexed() {
    for body in [
        "rows[id.x].a[id.y & 3u] = rows[n].v[n];",
        "shared_[id.x] = 1.0; rows[id.x].v.x = shared_[id.y];",
        "var a = array<f32, 3>(); a[1] = 2.0; rows[id.x].v.x = a[2] + a[FOUR - 3u];",
        "rows[id.x].v.x = TABLE[1];",
    ] {
        assert_eq!(findings(body), [], "{body}");
    }
}

#[test]
fn findings_tell_lines_of_text() {
    let found = findings("var a = array<f32, 3>();\nrows[id.x].v.x =\n    a[id.y];\nloop { }");
    let lines: Vec<_> = found.iter().map(|it| it.line).collect();
    assert_eq!(lines, [Some(13), Some(14)]);
    assert_eq!(
        found[0].to_string(),
        "`kernel`, line 13: a dynamic index: `a` has an index that is not constant"
    );
    assert_eq!(
        found[1].to_string(),
        "`kernel`, line 14: a loop that cannot be unrolled: it is never left"
    );
}

/// Read from SPIR-V, cleaned up, as the writers get it.
#[test]
fn kernels_are_looked_through_as_they_are_written() {
    for kernel in support::all() {
        let finished = finish::finish(&support::spirv(&kernel.name), &kernel).unwrap();
        let found = Ir::read(&finished.spirv, &kernel).unwrap().findings();
        if kernel.name == "total" {
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].construct, Construct::Loop);
            assert_eq!(found[0].line, None);
        } else {
            assert_eq!(found, [], "{}", kernel.name);
        }
    }
    // The same loop up to a constant.
    let source = include_str!("fixtures/total.spvasm")
        .replace("%n %count", "%n %four")
        .replace(
            "%one = OpConstant %uint 1",
            "%one = OpConstant %uint 1\n%four = OpConstant %uint 4",
        );
    let finished = finish::finish(&support::assemble(&source), &support::total()).unwrap();
    assert_eq!(
        finished.cost.loops, 1,
        "spirv-opt unrolls nothing by itself"
    );
    let found = Ir::read(&finished.spirv, &support::total())
        .unwrap()
        .findings();
    assert_eq!(found, []);
}
