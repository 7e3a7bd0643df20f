//! Result of `onecycle-lab classify`.

use onecycle_lab::paper::network::{NoPick, Pick};

/// What the classifier says of one recording.
pub(crate) struct Classified {
    pub(crate) name: String,
    pub(crate) pick: Result<Pick, NoPick>,
}
