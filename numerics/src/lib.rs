//! What Hankel's mathematics is measured by. Nothing here runs in a renderer: these are the
//! yardsticks that kernels are held against before they ship.

pub mod families;
pub mod numbers;
pub mod peer;
pub mod report;
pub mod speed;
