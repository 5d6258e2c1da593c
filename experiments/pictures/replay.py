"""The tutorial's replay as a phone shows it: cars moved apart, at a moment at which the nominal one is ahead."""

from pathlib import Path

from experiments.pictures.photograph import photograph
from experiments.pictures.report import tutorial

HEIGHT = 700  # [px]
MOMENT = 5.2  # [s]
# The recording is read for a moment before it can be set to a time; Meshcat's own controls are left out.
PAUSED = """<script>addEventListener("load", () => setTimeout(() => {
  const time = document.getElementById("time"), signal = document.getElementById("drawn");
  document.getElementById("apart").click();
  signal.value = [...signal.options].findIndex(one => one.text.startsWith("yaw rate"));
  time.max = 100; time.value = MOMENT; time.dispatchEvent(new Event("input"));
}, 2500));</script><style>.dg { display: none !important; }</style>""".replace("MOMENT", str(MOMENT))


def take(out: Path) -> None:
    """Writes the picture."""
    with tutorial() as folder:
        photograph(folder / "replay.html", out, script=PAUSED, height=HEIGHT)
