"""From a recorder's files to the log format: mapping files, clocks, units, frames, smoothing and checks."""

from drift_drake.logs.importing.formats.files import InvalidRecordingError
from drift_drake.logs.importing.importer import ImportReport, RunReport, import_recordings
from drift_drake.logs.importing.mapping import InvalidMappingError, RecorderMapping, presets, read_mapping

__all__ = [
    "ImportReport",
    "InvalidMappingError",
    "InvalidRecordingError",
    "RecorderMapping",
    "RunReport",
    "import_recordings",
    "presets",
    "read_mapping",
]
