//! What a kernel's author may get wrong gives an error at the place, in words that help.

#[test]
fn misuse_is_explained() {
    trybuild::TestCases::new().compile_fail("tests/misuse/*.rs");
}
