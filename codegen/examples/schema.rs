//! Prints the manifest's schema: `cargo run -p hankel-codegen --example schema > codegen/manifest.schema.json`.

fn main() {
    print!("{}", hankel_codegen::manifest::schema());
}
