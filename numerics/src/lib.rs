//! What Hankel's mathematics is measured by. Nothing here runs in a renderer: these are the
//! yardsticks that kernels are held against before they ship.

pub mod numbers;
pub mod report;
