"""Damaged inputs are read or refused with a sentence; `make fuzz` tries many more of them."""

from __future__ import annotations

import random

import pytest
from fuzz_kinds import Kind, kinds, write_seeds
from fuzz_mutations import damage, damaged_copy
from fuzz_run import FAULTS, classify, fuzz, infinite, one, plan, table

from pbrdf.data.readers import format_names
from pbrdf.errors import DataError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    pytest.importorskip("zarr")
    place = tmp_path_factory.mktemp("seeds")
    write_seeds(place, fit=False)
    return place


@pytest.mark.slow
def test_every_reader_and_every_other_input_is_a_kind_and_its_seeds_are_read(folder):
    found = {kind.name: kind for kind in kinds(folder)}
    assert [name for name in format_names() if not found[name].whole] == []
    assert {*format_names(), "analyser map", "instrument", "regions", "model", "frames", "workbook"} <= {
        *found
    }
    for name, kind in found.items():
        for seed in kind.seeds if kind.whole else ():
            assert classify(Kind(name, (seed,), kind.read), seed)[0] == "read", (name, seed.name)


@pytest.mark.slow
def test_a_reader_without_a_seed_is_given_those_of_the_others(folder, monkeypatch):
    from pbrdf.data import readers
    from pbrdf.data.formats.declaration import Reader

    monkeypatch.setattr(readers, "_registered", {"own": Reader("own", lambda path: None, (".own",))})
    (own,) = (kind for kind in kinds(folder) if kind.name == "own")
    assert not own.whole
    assert {seed.suffix for seed in own.seeds} >= {".csv", ".nc", ".brdf"}


def test_damage_is_the_same_every_time_and_of_every_sort():
    text = b"a,b\n1.5,2\n3,4\n" * 10
    made = {number: damage(text, random.Random(number)) for number in range(200)}
    assert all(damage(text, random.Random(number)) == content for number, content in made.items())
    assert len(set(made.values())) > 180
    assert min(map(len, made.values())) < len(text) < 10**5 < max(map(len, made.values()))


def test_outcomes_are_told_apart(tmp_path):
    def told(read):
        return classify(Kind("kind", (), read), tmp_path / "x")

    def refuse(path):
        raise DataError("no")

    def fail(path):
        raise KeyError("no")

    assert told(lambda path: {"a": [1.0]}) == ("read", "")
    assert told(lambda path: {"a": [float("inf")]})[0] == "infinite"
    assert told(refuse) == ("refused", "no")
    assert told(fail)[0] == "foreign"
    assert "KeyError at test_fuzz.py" in told(fail)[1]
    assert infinite([{"a": (1.0, float("-inf"))}])
    assert not infinite([1.0, "inf", None])


def test_inputs_are_shared_out_over_the_kinds():
    every = [Kind("a", (), str), Kind("b", (), str, 0.1), Kind("c", (), str)]
    names = [kind.name for kind in plan(every, 210)]
    assert (names.count("a"), names.count("b"), names.count("c")) == (100, 10, 100)
    assert names[:100] == [kind.name for kind in plan(every, 100)]


@pytest.mark.slow
def test_some_hundred_damaged_inputs_are_read_or_refused(folder):
    """Text in this process; what a library reads that may not survive it, in `make fuzz`."""
    chosen = [kind for kind in kinds(folder) if kind.name in _IN_THIS_PROCESS]
    assert len(chosen) == len(_IN_THIS_PROCESS)
    faults = [
        (number, kind.name, detail)
        for number, kind in enumerate(plan(chosen, 240))
        for outcome, detail in [one(kind, number)]
        if outcome in FAULTS
    ]
    assert faults == []


_IN_THIS_PROCESS = (
    "csv", "scatmech", "cornell", "pbsdf", "zemax", "rgl", "spectraray", "readings", "fred", "speos", "openmaterial",
    "lighttools", "woollam", "alta", "astm", "workbook parts", "raw frames", "analyser table", "instrument", "regions",
    "calibration table", "angle table", "band", "model",
)  # fmt: skip


@pytest.mark.slow
def test_some_inputs_of_every_kind_are_read_or_refused_in_processes_beside(folder):
    counts = fuzz(folder, 150, processes=1, quiet=True)
    assert sum(found.total() for found in counts.values()) == 150
    assert not any(found[fault] for found in counts.values() for fault in FAULTS), table(counts)
    assert sum(found["refused"] for found in counts.values()) > 50


@pytest.mark.slow
def test_a_reader_that_ends_the_process_or_does_not_end_is_counted(folder, monkeypatch, capsys):
    """A stub in place of the process beside: it leaves at the first input, and sleeps at the second."""
    import fuzz_run

    stub = folder / "stub.py"
    mark = folder / "begun"
    stub.write_text(
        "import pathlib, sys, time\n"
        f"mark = pathlib.Path({str(mark)!r})\n"
        "for line in sys.stdin:\n"
        "    if not mark.exists():\n"
        "        mark.touch(); sys.exit(1)\n"
        "    time.sleep(60)\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(fuzz_run, "__file__", str(stub))
    monkeypatch.setattr(fuzz_run, "_DEADLINE", 1.0)
    counts = fuzz(folder, 2, processes=1, quiet=True)
    assert sorted(outcome for found in counts.values() for outcome in found.elements()) == ["died", "endless"]
    assert "died: input 0" in capsys.readouterr().out


@pytest.mark.slow
def test_folders_are_damaged_as_a_whole(tmp_path):
    seed = tmp_path / "seed.zarr"
    (seed / "a").mkdir(parents=True)
    (seed / "a" / "0").write_bytes(bytes(100))
    (seed / ".zgroup").write_text('{"zarr_format": 2}', encoding="utf-8")
    states = set()
    for number in range(25):
        place = tmp_path / str(number)
        place.mkdir()
        copy = damaged_copy(seed, place, random.Random(number))
        states.add(tuple(sorted(path.name for path in copy.rglob("*") if path.is_file())))
    assert states >= {(".zgroup", "0"), ("0",), (".zgroup",)}
