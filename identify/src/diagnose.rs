//! Diagnostics of a recording and a fit: frequency response at the harmonics without a model, whiteness of residuals,
//! probability densities of draws.

pub mod density;
pub mod harmonics;
pub mod whiteness;
