//! Why a connection or a vehicle does not serve.

/// Why something with a vehicle could not be done. Nothing was changed unless the error says so.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// No message at all.
    #[error("no vehicle was heard within {0} s")]
    Silent(f64),
    /// Messages came, but no heartbeat of an autopilot.
    #[error("messages come, but no heartbeat of an autopilot within {0} s")]
    NoAutopilot(f64),
    /// With a key: the messages have no signature.
    #[error("the messages of the vehicle are not signed, so none was accepted")]
    Unsigned,
    /// With a key: the messages are signed with another one, or their time stamps are old.
    #[error(
        "the signatures of the vehicle do not belong to this key, so none of its messages was accepted"
    )]
    WrongKey,
    /// The vehicle is heard and answers nothing.
    #[error("the vehicle is heard, but does not answer")]
    Unanswered {
        /// Whether the questions were signed.
        is_signed: bool,
    },
    /// The vehicle is not heard any more.
    #[error("the link to the vehicle is lost")]
    Lost,
    /// The vehicle does not list its logs.
    #[error("the vehicle does not list its logs")]
    NoLogs,
    /// The firmware does not have a parameter.
    #[error("the firmware has no parameter {0}")]
    NoParameter(String),
    /// The vehicle refuses a command.
    #[error("the vehicle refuses {command}: {result}")]
    Refused {
        /// What was asked.
        command: &'static str,
        /// Answer of the vehicle, and its last message of text.
        result: String,
    },
}
