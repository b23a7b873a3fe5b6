//! pdo.
