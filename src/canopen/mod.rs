//! canopen.
