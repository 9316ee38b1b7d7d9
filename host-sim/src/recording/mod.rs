//! Event recordings: one folder a format, found by looking inside.
