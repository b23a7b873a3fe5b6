//! The repository itself: the order of its files, its documentation and its fuzzing corpus.

mod arrows;
mod documentation;
mod fuzz_corpus;
mod modules;
mod names;
mod rust_files;
