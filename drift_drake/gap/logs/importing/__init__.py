"""From a recorder's files to the log format: mapping files, clocks, units, frames, smoothing and checks."""
