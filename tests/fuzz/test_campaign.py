"""The long fuzz can be begun: its good inputs are made, and each kind of trial says what it tries."""

from pathlib import Path
from random import Random

import pytest

pytest.importorskip("hypothesis", reason="fuzzing needs the extra `test`")

import campaign  # noqa: F401  (it is a script, whose paths and imports may break unseen)
from as_command import Ended
from campaign_place import Place
from campaign_plug_ins import plug_ins
from campaign_seeds import make_seeds
from campaign_trials import TRIALS


def test_each_kind_of_trial_says_what_it_tries(tmp_path: Path) -> None:
    make_seeds(tmp_path / "seeds")
    for kind in TRIALS:
        for number in range(3 if kind is not plug_ins else 0):
            place = Place(tmp_path / f"{kind.__name__}{number}", tmp_path / "seeds", tmp_path / "corpus")
            place.folder.mkdir()
            words = next(kind(Random(f"{number}"), place))
            assert not isinstance(words, Ended)
            assert all(isinstance(word, str | Path) for word in words)
