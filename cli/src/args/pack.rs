//! Arguments of `onecycle pack`.

use std::convert::Infallible;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Subcommand};

/// Show, verify, export and import packs: files with everything an identifier needs.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle pack show default\n",
    "  onecycle pack verify my.pack\n",
    "  onecycle pack export my.pack --onnx my.onnx\n",
    "  onecycle pack import learnt.onnx --like default -o learnt.pack\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 4 a pack fails its self-test, ",
    "5 output not written"
))]
pub(crate) struct Pack {
    #[command(subcommand)]
    pub(crate) action: PackAction,
}

#[derive(Debug, Subcommand)]
pub(crate) enum PackAction {
    Show(ShowPack),
    Verify(VerifyPack),
    Export(ExportPack),
    Import(ImportPack),
}

/// The source of a pack.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PackSource {
    /// The built-in pack.
    Embedded,
    File(PathBuf),
}

impl FromStr for PackSource {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            "default" => Self::Embedded,
            path => Self::File(path.into()),
        })
    }
}

impl fmt::Display for PackSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Embedded => f.write_str("default"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// Show the contents of a pack, the size of each part, and its card.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  onecycle pack show default\n  onecycle pack show my.pack --json\n"
)]
pub(crate) struct ShowPack {
    /// Pack; "default" is the built-in one
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Verify a pack: its length, its hash, its parts, and the outputs of its self-test.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  onecycle pack verify default\n  onecycle pack verify my.pack\n"
)]
pub(crate) struct VerifyPack {
    /// Pack; "default" is the built-in one
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
}

/// Export the network of a pack, with the normalisation of its inputs, as ONNX.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle pack export default --onnx network.onnx\n",
    "  onecycle pack export my.pack --onnx my.onnx --samples samples.safetensors\n",
    "  python3 experiments/onnx_check.py my.onnx samples.safetensors\n"
))]
pub(crate) struct ExportPack {
    /// Pack; "default" is the built-in one
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
    /// ONNX file to write
    #[arg(long, value_name = "OUT.onnx")]
    pub(crate) onnx: PathBuf,
    /// Also write random inputs and their outputs, to test the model with
    #[arg(long, value_name = "OUT.safetensors")]
    pub(crate) samples: Option<PathBuf>,
}

/// Make a pack from a network trained elsewhere; everything else is taken from another pack.
///
/// The network must have 34 inputs and 14 outputs. An ONNX model has its own activations, and its own
/// normalisation of the inputs if it begins with one; a safetensors file uses those of the other pack.
/// Weights are stored as bytes if the other pack stores them so.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle pack import learnt.onnx --like default -o learnt.pack\n",
    "  onecycle pack import learnt.safetensors --like my.pack -o learnt.pack\n"
))]
pub(crate) struct ImportPack {
    /// Network to import: .onnx or .safetensors
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,
    /// Pack to take everything but the network from; "default" is the built-in one
    #[arg(long, value_name = "PACK|default")]
    pub(crate) like: PackSource,
    /// Pack to write
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: PathBuf,
}
