//! The repository itself: the order of its folders, its documentation and its fuzzing corpus.

mod arrows;
mod documentation;
mod fuzz_corpus;
