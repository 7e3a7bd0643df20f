//! Makes `plotly.js`, the script of the report pages, from the crate that has it whole. With the feature `studio` it also
//! looks for the page of the studio.

#[path = "build/bundle.rs"]
mod bundle;

use std::env;
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build");
    let folder = PathBuf::from(env::var("OUT_DIR")?);
    let sources = plotly::Plot::offline_js_sources();
    let whole = whole(&sources);
    std::fs::write(folder.join("plotly.js"), bundle::needed(whole))?;
    // For the tests of the bundle, which so do without the crate.
    std::fs::write(folder.join("plotly.whole.js"), whole)?;
    if env::var_os("CARGO_FEATURE_STUDIO").is_some() {
        studio(&folder)?;
    }
    Ok(())
}

/// The bundle among the scripts of the crate: the first; the other is for formulas.
fn whole(sources: &str) -> &str {
    let (_, behind) = sources.split_once('>').unwrap_or_default();
    behind.split("</script>").next().unwrap_or_default()
}

fn studio(folder: &Path) -> Result<(), Box<dyn Error>> {
    let named = env::var_os("ONECYCLE_STUDIO").map(PathBuf::from);
    let page = named.unwrap_or_else(|| PathBuf::from("../web/target/studio.html"));
    println!("cargo::rerun-if-env-changed=ONECYCLE_STUDIO");
    println!("cargo::rerun-if-changed={}", page.display());
    std::fs::copy(&page, folder.join("studio.html")).map_err(|error| {
        let page = page.display();
        format!("{page}: {error}: make the page with web/build.sh before a build with the feature studio")
    })?;
    Ok(())
}
