//! Shared by the end-to-end tests: messages, small healthy participants, and functions that start the program as a user does.

pub mod compiler;
pub mod diary;
pub mod faulty;
pub mod fixture;
pub mod fmus;
pub mod long;
pub mod machine;
pub mod modules;
pub mod offender;
pub mod packages;
pub mod page;
pub mod participants;
pub mod program;
pub mod rust;
pub mod samples;
pub mod sources;
pub mod workspace;
