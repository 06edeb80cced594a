//! Kernels on SIMD lanes are compiled for the instruction set of the lanes, all of them.

use object::{Object, ObjectSymbol};

/// What is not inlined there is compiled for the baseline processor: each operation on lanes becomes a call with its
/// operands in memory. A closure of six moment shadow maps once was, and took five to ten times as long.
#[test]
fn everything_is_inlined_into_the_code_of_an_instruction_set() {
    assert!(hankel_shadows::entries().len() > 200);
    let me = std::env::current_exe().expect("the test has a path");
    let me = std::fs::read(me).expect("it can be read");
    let me = object::File::parse(&*me).expect("it is an executable file");
    let names: Vec<&str> = me.symbols().filter_map(|it| it.name().ok()).collect();
    let has = |parts: &[&str]| {
        names
            .iter()
            .any(|it| parts.iter().all(|part| it.contains(part)))
    };
    assert!(
        has(&["hankel_shadows"]),
        "the symbols of the test are stripped"
    );
    assert!(
        has(&["vectorize"]),
        "there is no code of an instruction set"
    );
    // An operation of two registers is a function of its own there (`compiled` in `lanes/number.rs`), and is called from
    // where it was not inlined.
    let called: Vec<&&str> = names
        .iter()
        .filter(|it| it.contains("number") && it.contains("compiled") && it.contains("lanes"))
        .collect();
    assert!(
        called.is_empty(),
        "what calls these is not inlined: mark functions over lanes #[inline(always)], and write closures as functions \
         that are marked so: {called:#?}"
    );
}
