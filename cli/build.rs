//! Makes `plotly.js`, the script of the pages, from the crate that has it whole.

#[path = "build/bundle.rs"]
mod bundle;

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=build");
    let folder = PathBuf::from(std::env::var("OUT_DIR")?);
    Ok(std::fs::write(folder.join("plotly.js"), bundle::script())?)
}
