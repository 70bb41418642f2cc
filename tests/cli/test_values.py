import pytest

from pbrdf.cli.values import angles, bounds, number, numbers, pairs, share, stokes_vector
from pbrdf.errors import PbrdfError


def test_lists_and_ranges_of_angles():
    assert angles("10,20,35.5", "--x") == [10.0, 20.0, 35.5]
    assert angles("0:1:0.1", "--x") == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    assert angles("-10:10:10, 45", "--x") == [-10.0, 0.0, 10.0, 45.0]
    assert angles("30:10:-10", "--x") == [30.0, 20.0, 10.0]
    assert angles("0:85:30", "--x") == [0.0, 30.0, 60.0]
    assert angles("5:5:1", "--x") == [5.0]


@pytest.mark.parametrize("text", ["", "a", "0:10", "0:10:0", "0:10:-1", "0:10:1:2", "nan", "0:1e9:1"])
def test_other_texts_are_no_angles(text):
    with pytest.raises(PbrdfError, match="--x"):
        angles(text, "--x")


def test_names_and_values():
    assert pairs(["a=b=c", " d = e "], "--x", "n=1") == {"a": "b=c", "d": "e"}
    assert numbers(["n=1.5", "k=-2e-1"], "--x", "n=1") == {"n": 1.5, "k": -0.2}
    assert bounds(["n=1:2"], "--x", "n=1:2") == {"n": (1.0, 2.0)}
    assert number(" 3 ", "--x") == 3.0
    assert (share("10%", "--x"), share(" 0.1 ", "--x")) == (0.1, 0.1)
    assert stokes_vector("natural", "--x") == (1.0, 0.0, 0.0, 0.0)
    assert stokes_vector("1,0,0.5,0", "--x") == (1.0, 0.0, 0.5, 0.0)


@pytest.mark.parametrize(
    ("read", "given"),
    [
        (pairs, ["n"]),
        (pairs, ["=1"]),
        (pairs, ["n=1", "n=2"]),
        (numbers, ["n=x"]),
        (numbers, ["n=inf"]),
        (bounds, ["n=1"]),
        (bounds, ["n=1:x"]),
    ],
)
def test_wrong_texts_are_named(read, given):
    with pytest.raises(PbrdfError, match="--x"):
        read(given, "--x", "n=1")


@pytest.mark.parametrize("text", ["", "%", "1%%", "ten%", "nan", "inf%"])
def test_other_texts_are_no_shares(text):
    with pytest.raises(PbrdfError, match="--x"):
        share(text, "--x")


@pytest.mark.parametrize("text", ["1_0", "٣"])
def test_what_only_python_takes_for_a_number_is_none(text):
    with pytest.raises(PbrdfError, match=r"--x: .* is not a number"):
        number(text, "--x")
