//! Every hand-made kernel in every language, checked by the tools of those languages.

mod support;

#[test]
fn show() {
    for kernel in support::all() {
        let finished =
            hankel_codegen::finish::finish(&support::spirv(&kernel.name), &kernel).unwrap();
        println!("{:?}", finished.cost);
        let ir = hankel_codegen::translate::Ir::read(&finished.spirv, &kernel).unwrap();
        println!("clean {}", ir.is_clean());
        for language in hankel_codegen::Language::ALL {
            match ir.write(language, &kernel, &Default::default()).unwrap() {
                hankel_codegen::translate::Written::Text(text) => {
                    println!("======= {language}\n{}", text.source);
                    println!(
                        "{:?} {:?} {:?} {:?} {:?}",
                        text.entry_point, text.places, text.sizes_slot, text.sized, text.requires
                    );
                }
                it => println!("{it:?}"),
            }
        }
    }
}
