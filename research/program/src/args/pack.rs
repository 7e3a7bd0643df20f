//! Arguments of `onecycle-lab pack`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use onecycle_cli::args::{phase_margin, share};
use onecycle_cli::packs::PackSource;

/// Show, check and exchange packs: files that hold all an identifier knows.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab pack show default\n",
    "  onecycle-lab pack verify my.pack\n",
    "  onecycle-lab pack export my.pack --onnx my.onnx\n",
    "  onecycle-lab pack import learnt.onnx --like default -o learnt.pack\n",
    "  onecycle-lab pack margin default --phase-margin 45 -o calm.pack\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 4 a pack does not give the outputs it ",
    "must, 5 output not written"
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
    Margin(MarginPack),
}

/// Show what a pack holds, how many bytes each part takes, and its card.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  onecycle-lab pack show default\n  onecycle-lab pack show my.pack --json\n"
)]
pub(crate) struct ShowPack {
    /// The pack; default is the one built in
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
    /// Print it as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Check a pack: its length, its hash, every part of it, and the outputs it must give.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  onecycle-lab pack verify default\n  onecycle-lab pack verify my.pack\n"
)]
pub(crate) struct VerifyPack {
    /// The pack; default is the one built in
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
}

/// Write the network of a pack, the normalisation of its inputs included, as ONNX.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab pack export default --onnx network.onnx\n",
    "  onecycle-lab pack export my.pack --onnx my.onnx --samples samples.npz\n",
    "  python3 experiments/onnx_check.py my.onnx samples.npz\n"
))]
pub(crate) struct ExportPack {
    /// The pack; default is the one built in
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
    /// The model to write
    #[arg(long, value_name = "OUT.onnx")]
    pub(crate) onnx: PathBuf,
    /// Write random inputs and the outputs for them too, to check the model with
    #[arg(long, value_name = "OUT.npz")]
    pub(crate) samples: Option<PathBuf>,
}

/// Make a pack of a network that was trained elsewhere; everything else is taken from another pack.
///
/// The model is an ONNX file with 34 inputs and 14 outputs. If it begins with a normalisation of its
/// inputs, the pack gets that one, else the normalisation of the other pack. Weights are stored in
/// bytes if the other pack stores them in bytes.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab pack import learnt.onnx --like default -o learnt.pack\n",
    "  onecycle-lab pack import learnt.onnx --like my.pack -o learnt.pack\n"
))]
pub(crate) struct ImportPack {
    /// The network, an ONNX file
    #[arg(value_name = "MODEL.onnx")]
    pub(crate) model: PathBuf,
    /// The pack that gives everything but the network; default is the one built in
    #[arg(long, value_name = "PACK|default")]
    pub(crate) like: PackSource,
    /// The pack to write
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: PathBuf,
}

/// Make a pack whose controllers have another phase margin; everything else is taken from this pack.
///
/// The identifier stays the same, so nothing is trained: only the table of gains is computed again.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab pack margin default --phase-margin 35 -o calm.pack\n",
    "  onecycle-lab pack margin default --phase-margin 27 --extra-ise 2% -o quieter.pack\n"
))]
pub(crate) struct MarginPack {
    /// The pack; default is the one built in
    #[arg(value_name = "FILE|default")]
    pub(crate) pack: PackSource,
    /// Phase margin of the controllers, in degrees
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = phase_margin)]
    pub(crate) phase_margin: f64,
    /// How much more than the least a step may cost (ISE), 0 to 50 %, such as 2% or 0.02. The controllers are as quiet at the
    /// actuator as that allows: 2 % save 15 % of the derivative gain
    #[arg(long, value_name = "SHARE", default_value = "0", allow_negative_numbers = true, value_parser = extra_ise)]
    pub(crate) extra_ise: f64,
    /// The pack to write
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: PathBuf,
}

/// How much more than the least a step may cost, a share.
fn extra_ise(text: &str) -> Result<f64, String> {
    let extra = share(text)?;
    if (0.0..=0.5).contains(&extra) {
        Ok(extra)
    } else {
        Err("the extra cost lies between 0 % and 50 %, such as 2% or 0.02".to_owned())
    }
}
