//! Linux: clock and thread set-up.
