//! Identification from any recording, by an exact likelihood with disturbances.
mod descent;
mod laplace;
mod lifted;
mod likelihood;
mod orthogonal;
mod record;
mod response;
mod theta;
#[cfg(test)]
mod vectors;
