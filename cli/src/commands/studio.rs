//! `onecycle studio`: the page that needs no installation.

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use super::PROGRAM;
use crate::args::Studio;
use crate::failure::{Failure, exit};
use crate::output::{print, tell, write_text};

/// The page, if the program was built with it: build.rs.
#[cfg(feature = "studio")]
const PAGE: Option<&str> = Some(include_str!(concat!(env!("OUT_DIR"), "/studio.html")));
#[cfg(not(feature = "studio"))]
const PAGE: Option<&str> = None;

const MISSING: &str = "this program was built without the studio: open onecycle-studio.html of the same release, or build the \
    page in the sources with `web/build.sh`, which writes web/target/studio.html";

pub(crate) fn run(arguments: &Studio) -> Result<ExitCode, Failure> {
    let page = PAGE.ok_or_else(|| Failure::usage(MISSING))?;
    write_text(&arguments.out, page)?;
    print(&format!("{}\n", arguments.out.display()))?;
    if !arguments.no_open && !opens(&arguments.out) {
        let news = format!(
            "no browser was found: open {} in one",
            arguments.out.display()
        );
        tell(PROGRAM, &news);
    }
    Ok(ExitCode::from(exit::DONE))
}

/// Opens a file in the browser of the system.
fn opens(path: &Path) -> bool {
    let (program, before): (&str, &[&str]) = if cfg!(target_os = "windows") {
        ("cmd", &["/C", "start", ""])
    } else if cfg!(target_os = "macos") {
        ("open", &[])
    } else {
        ("xdg-open", &[])
    };
    let mut command = Command::new(program);
    command.args(before).arg(path);
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    quiet.status().is_ok_and(|status| status.success())
}
