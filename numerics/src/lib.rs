//! What Hankel's mathematics is measured by. Nothing here runs in a renderer: these are the
//! yardsticks that kernels are held against before they ship.

pub mod accuracy;
pub mod biases;
pub mod families;
pub mod judge;
pub mod numbers;
pub mod peer;
pub mod published;
pub mod report;
pub mod speed;
pub mod stress;
