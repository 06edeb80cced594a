//! What Hankel's commands need of the operating system, done in one way everywhere:
//! - [`fields`] reads structures by the names of their fields alone;
//! - [`input`] reads files of others: regular ones only, and none without a limit;
//! - [`output`] writes the files that a user asks for: whole or not at all, never over an input;
//! - [`overlooked`] has cargo see changes that come with an old date;
//! - [`process`] runs programs in a process group of their own, with a time limit;
//! - [`table`] reads tables in CSV, row by row;
//! - [`temporary`] makes folders that are gone after the command, however it ends;
//! - [`signals`] ends those programs and removes those folders when the command is interrupted;
//! - [`text`] makes text of others safe to print on a terminal.

pub mod fields;
pub mod input;
pub mod output;
pub mod overlooked;
pub mod process;
pub mod signals;
pub mod table;
pub mod temporary;
pub mod text;
