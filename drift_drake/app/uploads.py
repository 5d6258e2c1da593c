"""A file that is dropped: streamed to the project's recordings, under its own name, if it can be read."""

from collections.abc import AsyncIterator
from pathlib import Path

from drift_drake.app.pages.parts import quietly
from drift_drake.app.project import Project
from drift_drake.app.recordings import Recordings
from drift_drake.common.errors import DriftDrakeError, OutputError
from drift_drake.common.safe_files import replacing

LONGEST_NAME = 160  # characters
PLACE = "recordings"
FIRST_DAY = "day 1"


class UnusableUploadError(DriftDrakeError, ValueError):
    """A file that cannot be taken; the message says why."""


def file_name(asked: str) -> str:
    """The name that a file gets in the folder.

    Raises:
        UnusableUploadError: it is none that a recording may have.
    """
    name = asked.replace("\\", "/").rsplit("/", 1)[-1].strip()
    if not name or name[0] in ".-" or len(name) > LONGEST_NAME or not name.isprintable():
        raise UnusableUploadError("give the file a plain name, which does not begin with a dot or a hyphen")
    return name


async def take(project: Project, readings: Recordings, asked: str, pieces: AsyncIterator[bytes]) -> str:
    """Writes a file that is sent, and says what it holds.

    Raises:
        UnusableUploadError: it has no plain name, is there already, or holds no recording.
    """
    name = file_name(asked)
    path = project.folder / PLACE / name
    if path.exists():
        raise UnusableUploadError(f"{name}: is there already; rename the file, or take the old one out of the folder")
    try:
        with replacing(path) as part, part.open("wb") as file:
            async for piece in pieces:
                file.write(piece)
    except OutputError as error:
        raise UnusableUploadError(str(error)) from None
    relative = str(Path(PLACE) / name)
    summary = await quietly(readings.summary, relative)
    if summary.found is None:
        path.unlink(missing_ok=True)
        raise UnusableUploadError(summary.refused)
    with project.changing() as data:
        days = [day for day in data["recordings"].values() if day]
        data["recordings"][relative] = days[-1] if days else FIRST_DAY
    return f"{name}: {sum(len(topic.columns) for topic in summary.found.topics)} columns"
