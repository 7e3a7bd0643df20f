//! Separators of the columns.

/// Separator of the columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Tab,
    Semicolon,
    Bar,
    Comma,
    /// One or more blanks or tabs.
    Blanks,
}

impl Separator {
    /// All separators; the first wins where two split a file equally well.
    pub(super) const ALL: [Self; 5] = [
        Self::Tab,
        Self::Semicolon,
        Self::Bar,
        Self::Comma,
        Self::Blanks,
    ];

    /// The byte that separates the cells of a clean line.
    pub(super) fn byte(self) -> u8 {
        match self {
            Self::Tab => b'\t',
            Self::Semicolon => b';',
            Self::Bar => b'|',
            Self::Comma => b',',
            Self::Blanks => b' ',
        }
    }
}
