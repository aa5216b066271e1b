//! From a log to figures and tables.
