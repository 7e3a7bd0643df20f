//! The dependencies between crates, as ARCHITECTURE.md draws them, and between the files of each crate.
//!
//! Crates: read from `cargo metadata` of both workspaces, dependencies for tests and builds included. On-board code depends
//! only on on-board code; nothing that ships depends on the research.
//! Files: read from the sources. No file takes names from a file that, directly or not, takes names from it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use crate::imports::{Files, circles};
use serde::Deserialize;
use serde_json::{Value, json};

/// Each crate with the crates of both workspaces that it may depend on, tests included.
const ALLOWED: [(&str, &[&str]); 13] = [
    ("onecycle-onboard", &[]),
    ("onecycle-plant", &["onecycle-design", "onecycle-onboard"]),
    ("onecycle-link", &[]),
    ("onecycle-design", &["onecycle-onboard"]),
    // `plant` for its tests alone.
    (
        "onecycle-identify",
        &["onecycle-design", "onecycle-onboard", "onecycle-plant"],
    ),
    ("onecycle", &PARTS),
    (
        "onecycle-lab",
        &[
            "onecycle-design",
            "onecycle-identify",
            "onecycle-onboard",
            "onecycle-plant",
        ],
    ),
    (
        "onecycle-cli",
        &[
            "onecycle",
            "onecycle-design",
            "onecycle-identify",
            "onecycle-link",
            "onecycle-live",
            "onecycle-onboard",
            "onecycle-plant",
        ],
    ),
    // `onecycle` and `plant` for its tests alone.
    (
        "onecycle-live",
        &[
            "onecycle",
            "onecycle-link",
            "onecycle-onboard",
            "onecycle-plant",
        ],
    ),
    (
        "onecycle-lab-cli",
        &[
            "onecycle",
            "onecycle-cli",
            "onecycle-lab",
            "onecycle-design",
            "onecycle-identify",
            "onecycle-link",
            "onecycle-onboard",
            "onecycle-plant",
        ],
    ),
    (
        "onecycle-py",
        &["onecycle", "onecycle-cli", "onecycle-plant"],
    ),
    ("onecycle-lab-py", &["onecycle-lab-cli"]),
    (
        "onecycle-fuzz",
        &[
            "onecycle",
            "onecycle-cli",
            "onecycle-lab",
            "onecycle-link",
            "onecycle-live",
            "onecycle-onboard",
        ],
    ),
];

/// Crates of the workspace in `research/`.
const RESEARCH: [&str; 5] = [
    "onecycle-lab",
    "onecycle-lab-cli",
    "onecycle-lab-py",
    "onecycle-py",
    "onecycle-fuzz",
];

/// What the library ships.
const PARTS: [&str; 5] = [
    "onecycle-design",
    "onecycle-identify",
    "onecycle-link",
    "onecycle-onboard",
    "onecycle-plant",
];

/// The part of `cargo metadata` that matters here.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    #[serde(default)]
    manifest_path: String,
    dependencies: Vec<Dependency>,
}

/// `kind` is `None` for a normal dependency, else `dev` or `build`.
#[derive(Deserialize)]
struct Dependency {
    name: String,
    kind: Option<String>,
    #[serde(default)]
    optional: bool,
}

impl Metadata {
    fn package(&self, name: &str) -> Option<&Package> {
        self.packages.iter().find(|package| package.name == name)
    }

    /// A sentence for every arrow that is not allowed and every crate that has no row, or no crate.
    fn offences(&self) -> Vec<String> {
        let mut offences = Vec::new();
        for (name, _) in ALLOWED {
            if self.package(name).is_none() {
                offences.push(format!("{name} is in no workspace"));
            }
        }
        for package in &self.packages {
            let row = ALLOWED.iter().find(|(name, _)| *name == package.name);
            let Some((_, allowed)) = row else {
                offences.push(format!("{} has no row in ALLOWED", package.name));
                continue;
            };
            for dependency in &package.dependencies {
                let on = dependency.name.as_str();
                if self.package(on).is_some() && !allowed.contains(&on) {
                    let kind = dependency.kind.as_deref().unwrap_or("normal");
                    offences.push(format!("{on} <- {} ({kind})", package.name));
                }
            }
        }
        offences
    }

    /// What a crate depends on, other than for its tests.
    fn shipped_dependencies(&self, of: &str) -> Option<Vec<&Dependency>> {
        let dependencies = self.package(of)?.dependencies.iter();
        let is_shipped = |dependency: &&Dependency| dependency.kind.as_deref() != Some("dev");
        Some(dependencies.filter(is_shipped).collect())
    }
}

fn names<'a>(dependencies: &[&'a Dependency]) -> Vec<&'a str> {
    let name = |dependency: &&'a Dependency| dependency.name.as_str();
    dependencies.iter().map(name).collect()
}

/// Both workspaces.
fn workspaces() -> Metadata {
    let packages = ["", "research/"].map(|folder| workspace(folder).packages);
    Metadata {
        packages: packages.into_iter().flatten().collect(),
    }
}

/// A workspace as cargo reads it; without its dependencies it needs neither lock nor network.
fn workspace(folder: &str) -> Metadata {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let manifest = format!("{}/../{folder}Cargo.toml", env!("CARGO_MANIFEST_DIR"));
    let output = Command::new(cargo)
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .args(["--locked", "--offline", "--manifest-path", &manifest])
        .output()
        .expect("cargo runs");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo metadata: {complaint}");
    serde_json::from_slice(&output.stdout).expect("cargo metadata is JSON")
}

/// The allowed graph in full, as cargo would describe it.
fn made_up() -> Value {
    let packages = ALLOWED.map(|(name, allowed)| {
        let dependencies = allowed.iter().map(|on| json!({"name": on, "kind": null}));
        json!({"name": name, "dependencies": dependencies.collect::<Vec<_>>()})
    });
    json!({ "packages": packages })
}

fn offences_of(metadata: Value) -> Vec<String> {
    let metadata: Metadata = serde_json::from_value(metadata).expect("the graph is well formed");
    metadata.offences()
}

#[test]
fn only_the_allowed_arrows() {
    assert_eq!(workspaces().offences(), Vec::<String>::new());
}

// Firmware pays for every crate that comes along.
#[test]
fn onboard_ships_with_libm_alone() {
    let metadata = workspace("");
    let shipped = metadata.shipped_dependencies("onecycle-onboard");
    assert_eq!(names(&shipped.unwrap()), ["libm"]);
}

// Nothing that ships depends on the research, for its tests neither.
#[test]
fn the_research_is_next_door() {
    let ships = workspace("").packages;
    for package in &ships {
        for dependency in &package.dependencies {
            let on = dependency.name.as_str();
            assert!(!RESEARCH.contains(&on), "{on} <- {}", package.name);
        }
        assert!(!RESEARCH.contains(&package.name.as_str()));
    }
    let research = workspace("research/").packages;
    let names: Vec<&str> = research.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, RESEARCH);
}

#[test]
fn the_library_ships_with_its_parts_alone() {
    let metadata = workspace("");
    // `serde` and `rayon` are optional.
    let mut shipped = metadata.shipped_dependencies("onecycle").unwrap();
    shipped.retain(|dependency| !dependency.optional);
    assert_eq!(names(&shipped), [&PARTS[..], &["thiserror"]].concat());
    let identify = metadata.shipped_dependencies("onecycle-identify").unwrap();
    assert!(!names(&identify).contains(&"onecycle-plant"));
}

// Lints and profiles: what comes after the dependencies, without comments and without profiles of crates that only one
// workspace has.
#[test]
fn both_workspaces_are_built_alike() {
    let settings = |folder: &str| -> BTreeSet<String> {
        let path = format!("{}/../{folder}Cargo.toml", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        let (_, settings) = text.split_once("[workspace.lints.rust]").unwrap();
        let tables = settings.split("\n[").map(|table| {
            let lines = table.lines().filter(|line| !line.starts_with('#'));
            lines.collect::<Vec<_>>().join("\n").trim().to_owned()
        });
        tables.collect()
    };
    let (ships, research) = (settings(""), settings("research/"));
    assert_eq!(ships.difference(&research).count(), 0, "{ships:?}");
    let mut own = research.difference(&ships);
    assert!(own.all(|table| table.starts_with("profile.release.package.onecycle-lab")));
}

#[test]
fn the_allowed_graph_passes() {
    assert_eq!(offences_of(made_up()), Vec::<String>::new());
}

#[test]
fn a_forbidden_arrow_is_named() {
    let mut metadata = made_up();
    metadata["packages"][0]["dependencies"] = json!([
        {"name": "libm", "kind": null},
        {"name": "onecycle-plant", "kind": "dev"},
    ]);
    let expected = "onecycle-plant <- onecycle-onboard (dev)";
    assert_eq!(offences_of(metadata), [expected]);
}

#[test]
fn a_crate_without_a_row_is_named() {
    let mut metadata = made_up();
    metadata["packages"][2] = json!({"name": "onecycle-radio", "dependencies": []});
    let expected = [
        "onecycle-link is in no workspace",
        "onecycle-radio has no row in ALLOWED",
    ];
    assert_eq!(offences_of(metadata), expected);
}

#[test]
fn dependencies_for_tests_are_not_shipped() {
    let mut metadata = made_up();
    metadata["packages"][0]["dependencies"] = json!([
        {"name": "libm", "kind": null},
        {"name": "cc", "kind": "build"},
        {"name": "proptest", "kind": "dev"},
    ]);
    let metadata: Metadata = serde_json::from_value(metadata).expect("the graph is well formed");
    let shipped = metadata.shipped_dependencies("onecycle-onboard");
    assert_eq!(names(&shipped.unwrap()), ["libm", "cc"]);
}

// ---------------------------------------------------------------- files
/// Adds the source files of a folder; programs beside the library are crates of their own.
fn add_sources(folder: &Path, below: &str, files: &mut Files) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let file = format!("{below}{name}");
        if path.is_dir() {
            add_sources(&path, &format!("{file}/"), files);
        } else if file.ends_with(".rs") && file != "main.rs" {
            files.insert(file, std::fs::read_to_string(&path).unwrap());
        }
    }
}

#[test]
fn no_file_imports_in_a_circle() {
    let mut found = Vec::new();
    for package in workspaces().packages {
        let folder = Path::new(&package.manifest_path).parent().unwrap();
        let mut files = Files::new();
        add_sources(&folder.join("src"), "", &mut files);
        assert!(files.contains_key("lib.rs"), "{}", package.name);
        for circle in circles(&files) {
            found.push(format!("{}: {}", package.name, circle.ties.join("\n  ")));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

fn made_up_files(files: &[(&str, &str)]) -> Files {
    let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
    files.iter().map(owned).collect()
}

// The report takes `Done` through two re-exports of its home, `commands/grid.rs`, which calls the report by a path.
// `settings.rs` is used by both and uses neither.
#[test]
fn a_circle_through_a_re_export_is_named() {
    let files = made_up_files(&[
        ("lib.rs", "mod commands; mod report; mod settings;"),
        ("commands.rs", "mod grid; pub use self::grid::*;"),
        (
            "commands/grid.rs",
            "use crate::{report as shown, settings}; pub struct Done;\n\
             fn run() { if settings::IS_LOUD { println!(\"{}\", shown::text(&Done)); } }",
        ),
        (
            "report.rs",
            "use crate::commands::{self, Done}; use super::settings::IS_LOUD;\n\
             pub fn text(done: &Done) -> String { String::new() }",
        ),
        ("settings.rs", "pub const IS_LOUD: bool = true;"),
    ]);
    let [circle] = &circles(&files)[..] else {
        panic!("{:?}", circles(&files));
    };
    assert_eq!(circle.files, ["commands/grid.rs", "report.rs"]);
    assert_eq!(
        circle.ties,
        [
            "commands/grid.rs <- report.rs: crate::commands::Done",
            "report.rs <- commands/grid.rs: shown::text",
        ]
    );
}

// Three files, each of which takes a name from the next; the last by a path alone, in the body of a function.
#[test]
fn a_long_circle_is_found() {
    let files = made_up_files(&[
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use super::b::B; pub struct A;"),
        ("b.rs", "pub struct B(crate::c::C);"),
        (
            "c.rs",
            "pub struct C; fn f() { let a = vec![crate::a::A]; }",
        ),
    ]);
    assert_eq!(circles(&files)[0].files, ["a.rs", "b.rs", "c.rs"]);
}

// A parent uses its child, the child its parent's names; a unit test uses what the file must not; a comment and a text
// use nothing; `other::x` is another crate's.
#[test]
fn what_is_allowed_is_no_circle() {
    let files = made_up_files(&[
        ("lib.rs", "mod low; mod high; pub const LIMIT: usize = 1;"),
        (
            "low.rs",
            "mod part; use self::part::Part; use crate::LIMIT; pub struct Low(Part);\n\
             // crate::high::High\n\
             const TEXT: &str = \"crate::high::High\"; use other::high::High;\n\
             #[cfg(test)] mod tests { use crate::high::High; }",
        ),
        ("low/part.rs", "use super::Low; pub struct Part;"),
        ("high.rs", "use crate::low::Low; pub struct High(Low);"),
    ]);
    assert_eq!(circles(&files), []);
}
