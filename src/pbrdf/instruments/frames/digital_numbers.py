"""The numbers of files made those of the camera's converter, and what they betray about it.

A converter of fewer than 16 bits stands in 16-bit numbers right- or left-aligned. Left-aligned, all numbers are
multiples of 2^(16 − bits): 16 for 12 bits, 64 for 10, 4 for 14. That is seen in the frames, as right-aligned numbers
are not all multiples of it, and stated with ``alignment`` of the detector.

Pixels that are saturated below the stated end of the range pile up at one number: many read the largest number there
is, and hardly any the numbers just below it, which noise would otherwise spread them over.

A picture of nothing but 0 beside others that are not is probably none: files that are made before they are filled read
so where their writer was interrupted.
"""

from __future__ import annotations

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import Frames, layers_of
from pbrdf.instruments.polarimeter.detector import Detector

__all__ = ["ConvertedFrames", "require_range", "trailing_zeros"]

#: Bits of the numbers in files of more than 8.
_CONTAINER = 16
#: Numbers of at least so many sizes say that they are multiples of something by more than chance.
_ENOUGH = 16
#: Pictures that vary by so many times the variance of noise, and by more than this share, are not equally bright.
_FLICKER, _STEADY = 10.0, 5e-4
#: Pictures that a note names at most.
_TOLD = 3
#: Pixels that a sample has at most, and that are counted at a time.
_SAMPLE = 2**18
#: As many pixels at the largest number are a pile, if they are so many times those of a number just below it.
_PILE, _PILED = 12, 6.0
#: Where more than this share of the other pixels stands in piles too, with next to nothing at so many numbers on
#: either side, there is no noise that would spread them.
_WITHOUT_NOISE, _NEAR = 0.3, 3


class ConvertedFrames:
    """Frames in the numbers of the detector's converter.

    Parameters
    ----------
    frames
        As they are in the files.
    detector
        Bits and alignment.
    exposures
        How many exposures each number is the mean of; None: not stated.
    stability
        Stated relative standard deviation of the source.

    Attributes
    ----------
    shift
        By how many bits the numbers of the files were shifted down.

    Raises
    ------
    DataError
        If the numbers are not those of this detector.
    """

    def __init__(
        self, frames: Frames, detector: Detector, exposures: int | None = None, stability: float = 0.0
    ) -> None:
        self._frames, self._detector, self._stability = frames, detector, stability
        self.names, self.states = frames.names, frames.states
        self.rows, self.columns = frames.rows, frames.columns
        self.layers = layers_of(frames)
        self._levels = np.zeros(2**_CONTAINER, dtype=np.int64)
        self._said: list[str] = []
        self._repeats: dict[int, _Repeats] = {}
        self._blank: dict[int, np.ndarray] = {}
        self.shift = self._found_shift(exposures)

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        raw = self._frames.read(series, first_row, last_row)
        try:
            raw = shifted(raw, self.shift)
        except DataError as error:
            raise DataError(f"series {self.names[series]!r}: {error}") from None
        self._count(raw)
        blank = np.asarray(~raw.any(axis=(-2, -1)))
        self._blank[series] = np.logical_and(self._blank.get(series, blank), blank)
        if raw.ndim == 4:
            self._repeats.setdefault(series, _Repeats(raw.shape[:2])).add(raw)
        return raw

    @property
    def notes(self) -> list[str]:
        """What the numbers read so far betray, one sentence each."""
        said = [*self._said, *self._unwritten(), *self._unseen_alignment(), *self._flicker()]
        pile = _pile(self._levels, self._detector)
        if pile is None:
            return said
        top, count = pile
        share = count / self._levels.sum()
        end = int(self._detector.saturation)
        bits = (top + 1).bit_length() - 1
        whole = (top + 1).bit_count() == 1 and bits < self._detector.bits
        remedy = (
            f"bits = {bits} (and the gain that goes with it)"
            if whole and bits >= 8
            else f"full_scale = {top}"
        )
        return [
            *said,
            f"{count} pixels ({share:.2%}) read exactly {top}, the largest number there is, and hardly any the numbers "
            f"just below: they are probably saturated, and not marked, as the detector is said to end at {end}. If so, "
            f"set {remedy} in [detector]",
        ]

    def say(self, notes: list[str]) -> None:
        """Add to the notes."""
        self._said += notes

    def _unwritten(self) -> list[str]:
        """Pictures of nothing but 0."""
        found = [
            f"state {places[-1] + 1} of the series {self.names[series]!r}"
            for series, blank in sorted(self._blank.items())
            for places in np.argwhere(blank).tolist()
        ]
        if not found or len(found) == sum(blank.size for blank in self._blank.values()):
            return []
        more = f" and {len(found) - _TOLD} more" if len(found) > _TOLD else ""
        return [
            f"0 at every pixel that was read: {', '.join(found[:_TOLD])}{more}. If the camera saw light, it was "
            "never written, as the writer was interrupted: leave the series out, or take it again"
        ]

    def _unseen_alignment(self) -> list[str]:
        """Whether all numbers turned out to be multiples of something that the sample was too small to show."""
        held = np.flatnonzero(self._levels)
        if self.shift or self._detector.alignment is not None or held.size < _ENOUGH or held[-1] < 2**8:
            return []
        zeros = trailing_zeros(held.astype(np.uint32))
        if zeros < max(_CONTAINER - self._detector.bits, 2):
            return []
        true = _CONTAINER - zeros
        return [
            f"all numbers are multiples of {2**zeros}, and were read as they stand: if they are {true} bits in the "
            f'upper end of 16, set bits = {true} and alignment = "left" in [detector], else alignment = "right"'
        ]

    def _flicker(self) -> list[str]:
        """Whether repeats differ as a whole by more than the noise of their pixels and what is stated of the source."""
        found = [parts for repeats in self._repeats.values() for parts in repeats.variances(self._detector)]
        if not found:
            return []
        whole, noise = np.mean(found, axis=0)
        count = min(len(repeats.sums) for repeats in self._repeats.values())
        share = float(np.sqrt(max(whole - noise, 0.0)))
        if whole < _FLICKER * noise or share < _STEADY or share / np.sqrt(count) <= self._stability:
            return []
        return [
            f"the repeats of a state differ by {share:.2%} as a whole, as of light that is not steady; that does not "
            f"average away over a region: set stability = {share / np.sqrt(count):.2g} in [polarimeter]"
        ]

    def _count(self, raw: np.ndarray) -> None:
        flat = raw.reshape(-1)
        for first in range(0, flat.size, _SAMPLE):
            part = flat[first : first + _SAMPLE]
            if part.dtype.kind == "f":
                part = np.where(np.isfinite(part), np.clip(part, 0, 2**_CONTAINER - 1), 0)
            elif part.dtype.kind == "i" or part.dtype.itemsize > 2:
                part = np.clip(part, 0, 2**_CONTAINER - 1)
            self._levels += np.bincount(part.astype(np.intp), minlength=2**_CONTAINER)

    def _found_shift(self, exposures: int | None) -> int:
        detector = self._detector
        shift = _CONTAINER - detector.bits
        if detector.alignment is not None:
            return shift if detector.alignment == "left" else 0
        seen = np.zeros(0, dtype=np.uint16)
        for series in sorted({0, len(self.names) // 2, len(self.names) - 1}):
            sample = self._sample(series)
            if sample.dtype.kind == "f":
                _require_means(sample, detector, exposures)
                return 0
            if sample.dtype.itemsize == 1:
                return 0
            seen = np.union1d(seen, sample)
            # a number that is no multiple decides
            if (exposures or 1) > 1 or trailing_zeros(seen) < 2:
                return 0
            if seen.size >= _ENOUGH:
                break
        zeros = trailing_zeros(seen)
        top = int(seen.max(initial=0))
        beyond = top > 2**detector.bits - 1
        if zeros > shift and seen.size >= _ENOUGH:
            true = _CONTAINER - zeros
            raise DataError(
                f"all numbers are multiples of {2**zeros}, as those of {true} bits in the upper end of 16 are (the "
                f"largest is {top} = {top >> zeros} · {2**zeros}), but [detector] says bits = {detector.bits}: set "
                f"bits = {true}, and gain, read_noise and offset for its numbers; or, if the numbers are right as they "
                'stand, alignment = "right"'
            )
        if shift < 2 or zeros < shift or not (beyond or seen.size >= _ENOUGH):
            return 0
        self._said.append(
            f"all numbers are multiples of {2**shift}: they are read as {detector.bits} bits in the upper end of 16 "
            f'(the largest, {top}, as {top >> shift}). alignment = "left" in [detector] states it; if the numbers '
            'are right as they stand, set alignment = "right"'
        )
        return shift

    def _sample(self, series: int) -> np.ndarray:
        """Numbers of some rows in the middle of the pictures."""
        frames = self._frames
        high = min(max(_SAMPLE // (frames.columns * frames.states * self.layers), 2), frames.rows)
        first = (frames.rows - high) // 2
        return frames.read(series, first, first + high)


class _Repeats:
    """Sums over the pictures of a series whose states were repeated: how much whole pictures differ."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.sums = np.zeros(shape)
        self.pixels = 0

    def add(self, raw: np.ndarray) -> None:
        self.sums += raw.sum(axis=(2, 3), dtype=float)
        self.pixels += raw.shape[2] * raw.shape[3]

    def variances(self, detector: Detector) -> list[tuple[float, float]]:
        """Relative variance of the pictures of each state, and what the noise of pixels makes of it."""
        means = self.sums / self.pixels
        signal = means.mean(axis=0) - detector.black
        lit = signal > 0.0
        whole = means.var(axis=0, ddof=1)[lit] / signal[lit] ** 2
        noise = detector.variance(means.mean(axis=0))[lit] / self.pixels / signal[lit] ** 2
        return list(zip(whole.tolist(), noise.tolist(), strict=True))


def shifted(raw: np.ndarray, shift: int) -> np.ndarray:
    """Numbers shifted down; raises DataError if whole ones have something in the bits that fall away."""
    if not shift or raw.dtype.itemsize == 1:
        return raw
    if raw.dtype.kind == "f":
        return raw / 2.0**shift
    if (raw & raw.dtype.type(2**shift - 1)).any():
        raise DataError(
            f"not all numbers are multiples of {2**shift}, as those of {_CONTAINER - shift} bits in the upper end of "
            '16 are: set alignment = "right" and the right bits in [detector]'
        )
    values: np.ndarray = raw >> raw.dtype.type(shift)
    return values


def trailing_zeros(numbers: np.ndarray) -> int:
    """How many low bits are 0 in all the whole numbers; 16 if there is none but 0."""
    used = int(np.bitwise_or.reduce(numbers.reshape(-1), initial=0))
    return (used & -used).bit_length() - 1 if used else _CONTAINER


def require_range(raw: np.ndarray, detector: Detector) -> None:
    """Check that digital numbers are within the range of the detector's converter; raises DataError."""
    bits, top = detector.bits, 2**detector.bits - 1
    if raw.dtype.itemsize == 1 and bits > 8:
        raise DataError(
            f"its numbers have 8 bits, but [detector] says bits = {bits}: set bits = 8, and gain, read_noise and "
            "offset for its numbers"
        )
    if not raw.size:
        return
    largest = float(np.nanmax(raw)) if raw.dtype.kind == "f" else int(raw.max())
    if raw.dtype.kind == "i" and int(raw.min()) < 0:
        raise DataError(f"a pixel reads {int(raw.min())}: give numbers of the converter, 0 to {top}")
    if not largest > top:
        return
    shift = _CONTAINER - bits
    zeros = trailing_zeros(raw) if raw.dtype.kind != "f" and largest < 2**_CONTAINER else 0
    if shift and zeros >= shift:
        remedy = f'all are multiples of {2**shift}, as of {bits} bits in the upper end of 16: set alignment = "left"'
    elif zeros >= 2 and largest == (2**bits - 1) << zeros:
        # 10 bits in the upper end of 12: nothing says that a converter of 14 stands in the upper end of 16
        remedy = (
            f"all are multiples of {2**zeros}, as of {bits} bits in the upper end of {bits + zeros}: set bits = "
            f"{bits + zeros} and full_scale = {(2**bits - 1) << zeros}, and the gain that goes with them,"
        )
    elif zeros >= 2 and np.unique(raw).size >= _ENOUGH:
        true = _CONTAINER - zeros
        remedy = (
            f"all are multiples of {2**zeros}, as of {true} bits in the upper end of 16: set bits = {true} and "
            'alignment = "left", and the gain that goes with them,'
        )
    elif largest < 2**_CONTAINER:
        fits = max(int(largest).bit_length(), bits + 1)
        remedy = f"set bits = {fits}, or what the camera has, and the gain that goes with it"
        if raw.dtype.kind == "f" and shift:
            remedy += f', or alignment = "left" if they are means of {bits} bits in the upper end of 16,'
    else:
        remedy = (
            "give numbers of 16 bits at most; sums of exposures divided by their number, and exposures set"
        )
        raise DataError(f"a pixel reads {largest:g}, but {bits} bits end at {top}: {remedy} in [frames]")
    raise DataError(f"a pixel reads {largest:g}, but {bits} bits end at {top}: {remedy} in [detector]")


def _require_means(sample: np.ndarray, detector: Detector, exposures: int | None) -> None:
    """Check that numbers with decimals can be means of digital numbers; raises DataError."""
    if exposures is None:
        raise DataError(
            f"the numbers are of the type {sample.dtype}, as means of several exposures are: say of how many in "
            "[frames], exposures = 100, as their noise is that much less (1 if each is a single exposure)"
        )
    finite = sample[np.isfinite(sample)]
    if detector.bits > 1 and finite.size and 0.0 < finite.max() <= 1.0:
        raise DataError(
            f"the largest of the numbers is {finite.max():g}: digital numbers are wanted, not shares of the full "
            f"scale; multiply by {2**detector.bits - 1}"
        )


def _pile(levels: np.ndarray, detector: Detector) -> tuple[int, int] | None:
    """The largest number and how many pixels read it, if it is where they saturate below the detector's end."""
    held = np.flatnonzero(levels)
    if held.size < 3 or held[-1] >= detector.saturation:
        return None
    top = int(held[-1])
    count = int(levels[top])
    # numbers that are all multiples of something are looked at in steps of it
    step = 2 ** trailing_zeros(held.astype(np.uint32))
    steps = levels[::step]
    width = max(int(np.ceil(np.sqrt(detector.variance(float(top))) / step)), 3)
    last = top // step
    below = steps[max(last - width, 0) : last].mean()
    if count < _PILE or count < _PILED * below:
        return None
    if last >= _ENOUGH and (last + 1).bit_count() == 1:
        # 255, 1023 or 4095, in steps of 1, 4 or 16: where converters end
        return top, count
    rest = steps[:last]
    around = (np.convolve(rest, np.ones(2 * _NEAR + 1), "same") - rest) / (2 * _NEAR)
    piled = rest[(rest >= _PILE) & (rest > _PILED * around)].sum()
    return None if piled > _WITHOUT_NOISE * rest.sum() else (top, count)
