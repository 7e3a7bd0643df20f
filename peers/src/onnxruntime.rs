//! onnxruntime, by the shared library that its Python package brings along.

use std::process::Command;

use ort::environment::Environment;
use ort::session::Session;
use ort::value::TensorRef;

use crate::Failure;
use crate::networks::Case;
use crate::rounds::Contender;

/// Prints where the library lies.
const SCRIPT: &str = "
import glob, os, onnxruntime
folder = os.path.join(os.path.dirname(onnxruntime.__file__), 'capi')
names = ('libonnxruntime.*', 'onnxruntime.dll')
print([path for name in names for path in glob.glob(os.path.join(folder, name))][0])
";

/// The library that the interpreter named by `PYTHON` has, loaded.
pub(crate) fn environment() -> Result<Environment, Failure> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&python)
        .args(["-c", SCRIPT])
        .output()
        .map_err(|error| format!("{python} cannot be run: {error}"))?;
    if !found.status.success() {
        return Err(format!("{python} has no onnxruntime; name one that has by PYTHON").into());
    }
    let path = String::from_utf8(found.stdout)?;
    Ok(ort::init_from(path.trim())?.build()?)
}

pub(crate) fn contender<'a>(
    environment: &Environment,
    case: &'a Case,
) -> Result<Contender<'a>, Failure> {
    let builder = Session::builder(environment)?.with_intra_threads(1);
    let builder = builder.map_err(|error| error.to_string())?;
    let mut builder = (builder.with_inter_threads(1)).map_err(|error| error.to_string())?;
    let mut session = builder.commit_from_file(&case.model)?;
    Ok(Contender::new("onnxruntime", move |sample, outputs| {
        let inputs = TensorRef::from_array_view(([1, sample.len()], sample))?;
        let found = session.run(ort::inputs![inputs])?;
        let (_, values) = found[0].try_extract_tensor::<f32>()?;
        outputs.clear();
        outputs.extend_from_slice(values);
        Ok(())
    }))
}
