//! Prints a schema: `cargo run -p hankel-codegen --example schema > codegen/manifest.schema.json`, and
//! with `-- frame` that of `codegen/frame.schema.json`.

fn main() {
    if std::env::args().nth(1).as_deref() == Some("frame") {
        return print!("{}", hankel_codegen::frame::schema());
    }
    print!("{}", hankel_codegen::manifest::schema());
}
