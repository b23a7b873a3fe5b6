//! Reading EDS and DCF files as they are met.

mod odd_files;
mod real_files;
mod robustness;
