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
    // Symbols of Rust's present mangling name the types that a generic function is made for, older ones a hash.
    if !has(&["_R", "hankel_shadows", "vectorize"]) {
        println!("not checked: symbols of this compiler do not name types");
        return;
    }
    let outside: Vec<&&str> = names
        .iter()
        .filter(|it| it.contains("5lanes4F32s") || it.contains("5lanes4F64s"))
        .collect();
    assert!(
        outside.is_empty(),
        "these are not inlined: mark them #[inline(always)], and write closures as functions that are marked so: \
         {outside:#?}"
    );
}
