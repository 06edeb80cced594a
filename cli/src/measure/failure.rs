//! What may go wrong when something is measured, and whose turn it is then.

use hankel_numerics::accuracy::AccuracyError;
use hankel_numerics::biases::BiasError;
use hankel_numerics::judge::{JudgeError, TableError};
use hankel_numerics::report::ReportError;
use hankel_numerics::speed::SpeedError;
use hankel_numerics::stress::StressError;

use crate::failure::{Blame, Failure, blame_of_input, blame_of_output};

impl From<SpeedError> for Failure {
    fn from(error: SpeedError) -> Self {
        let blame = match &error {
            SpeedError::Order(_) | SpeedError::Rows(_) | SpeedError::Rounds => Blame::Input,
            SpeedError::Kernel { .. } | SpeedError::Call(_) => Blame::Kernel,
            SpeedError::Worker(..) | SpeedError::Peer(_) | SpeedError::Io(_) => Blame::Machine,
        };
        Self::new(blame, &error, None)
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        let blame = match &error {
            ReportError::Output(error) => blame_of_output(error),
            _ => Blame::Machine,
        };
        Self::new(blame, &error, None)
    }
}

/// A kernel that does not run is its own fault; the rest is that of the arguments or the machine.
fn blame_of_stress(error: &StressError) -> Blame {
    match error {
        StressError::Family { .. } | StressError::Order(_) | StressError::Samples(_) => {
            Blame::Input
        }
        StressError::Kernel { .. } | StressError::Backend { .. } => Blame::Kernel,
        StressError::Peer(_) => Blame::Machine,
    }
}

impl From<StressError> for Failure {
    fn from(error: StressError) -> Self {
        Self::new(blame_of_stress(&error), &error, None)
    }
}

impl From<AccuracyError> for Failure {
    fn from(error: AccuracyError) -> Self {
        let blame = match &error {
            AccuracyError::Order(_) | AccuracyError::Samples(_) => Blame::Input,
            AccuracyError::Family(_) | AccuracyError::NoKernel { .. } => Blame::Kernel,
            AccuracyError::Kernel(error) => blame_of_stress(error),
            AccuracyError::Peer(_) => Blame::Machine,
        };
        Self::new(blame, &error, None)
    }
}

impl From<BiasError> for Failure {
    fn from(error: BiasError) -> Self {
        Self::new(Blame::Input, &error, None)
    }
}

impl From<JudgeError> for Failure {
    fn from(error: JudgeError) -> Self {
        Self::new(Blame::Input, &error, None)
    }
}

impl From<TableError> for Failure {
    fn from(error: TableError) -> Self {
        let blame = match &error {
            TableError::Input(error) => blame_of_input(error),
            TableError::Output(error) => blame_of_output(error),
            _ => Blame::Input,
        };
        Self::new(blame, &error, None)
    }
}
