//! Reading of real EDS and DCF files and of files with anomalies.

mod odd_files;
mod real_files;
mod robustness;
