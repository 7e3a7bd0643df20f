//! Arguments of `onecycle-lab reproduce`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use onecycle_cli::args::MOST_THREADS;

/// Reproduce the simulated tables and figures of the paper, each number beside the paper's.
///
/// Writes DIR/reproduction.html (one page that works offline) and DIR/reproduction.md.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab reproduce\n",
    "  onecycle-lab reproduce --quick\n",
    "  onecycle-lab reproduce table_4 table_5 -o out\n",
    "  onecycle-lab train --recipe research/program/reproduction/paper_network_untrimmed.toml -o paper.onnx\n",
    "  onecycle-lab reproduce table_4 table_6 table_7 --network paper.onnx\n\n",
    "Parts: phase, grid, grid_variants, figures, table_2_and_3, ablation, our_network, table_4,\n",
    "tuning_rules, rule_variants, table_5, table_6, table_7, modes, claims.\n",
    "Without --network, table_4, table_6 and table_7 train a network of the paper's size first, in 75 minutes\n",
    "on two cores (--quick: a small one, in seconds), and keep it in DIR/parts/paper_network.onnx.\n",
    "Finished parts are kept in DIR/parts and not computed again, and an interrupted training is\n",
    "resumed where it was at most 30 s before; --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable part, 5 output not written"
))]
pub(crate) struct Reproduce {
    /// Parts to reproduce [default: all]
    #[arg(value_name = "NAME")]
    pub(crate) names: Vec<Name>,
    /// Use small sizes, to test that everything runs; takes at most two minutes
    #[arg(long)]
    pub(crate) quick: bool,
    /// Network of table_4, table_6 and table_7: an ONNX file that `onecycle-lab train` wrote from a classifier's recipe
    #[arg(long, value_name = "FILE.onnx")]
    pub(crate) network: Option<PathBuf>,
    /// Folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "reproduction")]
    pub(crate) out: PathBuf,
    /// Discard the parts of an earlier run and start over
    #[arg(long)]
    pub(crate) restart: bool,
    /// Without effect: finished parts are always kept
    #[arg(long = "resume", hide = true)]
    _resume: bool,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
}

/// A part of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Name {
    Phase,
    Grid,
    GridVariants,
    Figures,
    Table2And3,
    Ablation,
    OurNetwork,
    Table4,
    TuningRules,
    RuleVariants,
    Table5,
    Table6,
    Table7,
    Modes,
    Claims,
}

impl Name {
    /// All of them, in the paper's order.
    pub(crate) const ALL: [Self; 15] = [
        Self::Phase,
        Self::Grid,
        Self::GridVariants,
        Self::Figures,
        Self::Table2And3,
        Self::Ablation,
        Self::OurNetwork,
        Self::Table4,
        Self::TuningRules,
        Self::RuleVariants,
        Self::Table5,
        Self::Table6,
        Self::Table7,
        Self::Modes,
        Self::Claims,
    ];

    /// Whether the part compares the network of the paper's size.
    pub(crate) fn reads_network(self) -> bool {
        matches!(self, Self::Table4 | Self::Table6 | Self::Table7)
    }

    /// The name in arguments and file names.
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Self::Phase => "phase",
            Self::Grid => "grid",
            Self::GridVariants => "grid_variants",
            Self::Figures => "figures",
            Self::Table2And3 => "table_2_and_3",
            Self::Ablation => "ablation",
            Self::OurNetwork => "our_network",
            Self::Table4 => "table_4",
            Self::TuningRules => "tuning_rules",
            Self::RuleVariants => "rule_variants",
            Self::Table5 => "table_5",
            Self::Table6 => "table_6",
            Self::Table7 => "table_7",
            Self::Modes => "modes",
            Self::Claims => "claims",
        }
    }
}

impl FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|name| name.as_str() == text);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::as_str).join(", ");
            format!("there is no part '{text}': choose from {names}")
        })
    }
}
