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
    // What has the code of an instruction set: kernels, and functions that are apart. Lanes' numbers are of the module
    // `number`.
    assert!(
        has(&["9vectorize"]),
        "there is no code of an instruction set"
    );
    assert!(has(&["6number", "5apart"]), "no function is apart");
    let called: Vec<&&str> = names
        .iter()
        .filter(|it| it.contains("6number"))
        .filter(|it| !it.contains("9vectorize") && !it.contains("5apart"))
        .collect();
    assert!(
        called.is_empty(),
        "what calls these is not inlined: mark functions over lanes #[inline(always)], and write closures as functions \
         that are marked so: {called:#?}"
    );
}
