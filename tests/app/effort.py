"""A person's time at the pages, by the keystroke-level model of Card, Moran and Newell (1980), from what a test does.

No person was watched: the model adds up operators of a practised user who knows what to do. Each button and field is
one decision. Remarks are read once, at 200 words a minute; how long the machine works is not in it.
"""

from collections import defaultdict
from typing import Any

# [s]: a key (average typist), pointing, a press or release of the mouse, a hand to the keys or the mouse, a decision.
OPERATORS = {"K": 0.28, "P": 1.1, "B": 0.1, "H": 0.4, "M": 1.35}
WORDS = 200.0 / 60.0  # read [1/s]
# The step's name, its remarks, and all other text that is seen.
TEXTS = """() => {
  const kinds = ".warning, .refusal, .verdict, .note, .diff", lines = one => one.innerText.split("\\n");
  const places = [...document.querySelectorAll("#main, #uploads")];
  const remarks = places.flatMap(place => [...place.querySelectorAll(kinds)]
    .filter(one => one.checkVisibility() && !one.parentElement.closest(kinds)).flatMap(lines));
  return [document.querySelector("h1")?.textContent ?? "", remarks, places.flatMap(lines)];
}"""
OPENS = "MPBB" + "MPBB" + "KPBB" + "PBB"  # the button, the first file, the last one with the shift key, "Open"


class Effort:
    """Counts what is done on a page from now on, by step."""

    def __init__(self, page: Any, monkeypatch: Any) -> None:
        from playwright.sync_api import Keyboard, Locator

        self.page, self.hand, self.field = page, "P", ""
        self.done: dict[str, str] = defaultdict(str)
        self.words: dict[str, list[int]] = defaultdict(lambda: [0, 0])
        self.seen: list[set[str]] = [set(), set()]
        for owner, name, how in (
            (Locator, "click", self.points),
            (Locator, "select_option", lambda *_: self.does("MPBBPBB")),
            (Locator, "fill", self.types),
            (Locator, "set_input_files", lambda *_: self.does(OPENS)),
            (Keyboard, "press", lambda *_: self.does("K")),
        ):
            monkeypatch.setattr(owner, name, self._counted(getattr(owner, name), how))

    def _counted(self, act: Any, how: Any) -> Any:
        def counted(one: Any, *given: Any, **more: Any) -> Any:
            if getattr(one, "page", self.page) is self.page:
                self.reads()
                how(one, *given)
            return act(one, *given, **more)

        return counted

    def does(self, operators: str) -> None:
        """Adds operators to the step that is shown; hands go from the mouse to the keys and back where they have to."""
        for one in operators:
            if one in "KP" and one != self.hand:
                self.done[self.step] += "H"
                self.hand = one
            self.done[self.step] += one
        self.field = ""

    def points(self, place: Any) -> None:
        self.does("MPBB")
        self.field = str(place)

    def types(self, place: Any, words: str) -> None:
        """Over what a field has (Ctrl+A)."""
        self.does(("" if self.field == str(place) else "MPBB") + "KK" + "K" * len(words))

    def reads(self) -> None:
        """What has come onto the page since."""
        self.step, *texts = self.page.evaluate(TEXTS)
        for k, lines in enumerate(texts):
            new = {line.strip() for line in lines} - self.seen[k]
            self.seen[k] |= new
            self.words[self.step][k] += sum(any(q.isalnum() for q in word) for line in new for word in line.split())

    def table(self) -> str:
        """A row a step, as Markdown; seconds of the hands and of reading."""
        self.reads()
        rows = ["| step | points and presses | keys | decisions | hands and decisions [s] | words of remarks | reading "
                "them [s] | all words |", "| --- " * 8 + "|"]  # fmt: skip
        sums = [0.0] * 7
        for step in self.words:
            done, (remarks, every) = self.done[step], self.words[step]
            row = [done.count("P"), done.count("K"), done.count("M"), sum(OPERATORS[one] for one in done),
                   remarks, remarks / WORDS, every]  # fmt: skip
            sums = [a + b for a, b in zip(sums, row, strict=True)]
            rows.append(f"| {step} | " + " | ".join(f"{q:.0f}" for q in row) + " |")
        return "\n".join([*rows, "| all | " + " | ".join(f"{q:.0f}" for q in sums) + " |"])
