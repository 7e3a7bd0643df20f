//! What else a recording and a fit tell: harmonics without a model, whiteness of residuals, densities of draws.

pub mod density;
pub mod harmonics;
pub mod whiteness;
