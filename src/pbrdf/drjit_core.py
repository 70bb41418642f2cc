"""Dr.Jit's core library, made to look for LLVM again after it has been imported.

Dr.Jit looks for LLVM once, when it is imported, and that may be before ``pbrdf`` can name a library: sorted imports put
``drjit`` and ``mitsuba`` first. What is done then depends on what it found:

* nothing, or a library older than Dr.Jit takes: it only has to look again;
* a library older than ``pbrdf`` takes: the core is shut down and started again, which arrays survive and compiled
  kernels and the objects of a scene do not, so it is done only where there are none yet.

The functions are those of ``drjit-core/jit.h``, under the names that a C++ compiler on Linux gives them.
"""

from __future__ import annotations

import ctypes
import struct
import sys
from pathlib import Path
from typing import Any

__all__ = ["look_for_llvm_again"]

# what Mitsuba registers with Dr.Jit: the domain names of the classes with virtual functions
DOMAINS = ("BSDF", "Emitter", "Medium", "PhaseFunction", "Sensor", "Shape", "Texture", "Volume")


def look_for_llvm_again(minimum: int) -> bool:
    """Let an imported Dr.Jit take the LLVM that ``DRJIT_LIBLLVM_PATH`` names, if it has none or one too old.

    Parameters
    ----------
    minimum
        Least major version that is not too old.

    Returns
    -------
    bool
        True if Dr.Jit has an LLVM of that version now. False if it cannot be changed any more: kernels have been
        compiled with the old one, a scene holds objects, CUDA is in use too, or the library is not the one known here.
    """
    import drjit as dr

    llvm = dr.JitBackend.LLVM

    def recent() -> bool:
        return bool(dr.has_backend(llvm)) and dr.detail.llvm_version()[0] >= minimum

    if recent():
        return True
    try:
        path = Path(dr.__file__).parent / "libdrjit-core.so"
        core = ctypes.CDLL(str(path))
        start, shut_down = core._Z8jit_initj, core._Z12jit_shutdowni
        if not dr.has_backend(llvm):
            _forget_search(path, start)
        elif _in_use(dr, core):
            return False
        else:
            shut_down(0)
        start(1 << llvm.value)
    except (OSError, AttributeError):
        return False
    return recent()


def _in_use(dr: Any, core: ctypes.CDLL) -> bool:
    """Whether a shutdown would take something away: compiled kernels, objects of scenes, arrays on a GPU."""
    if dr.has_backend(dr.JitBackend.CUDA) or dr.detail.launch_stats()[0] > 0:
        return True
    registered = core._Z21jit_registry_id_boundPKcS0_
    registered.argtypes = [ctypes.c_char_p, ctypes.c_char_p]
    mitsuba = sys.modules.get("mitsuba")
    variants = mitsuba.variants() if mitsuba else []
    return any(registered(v.encode(), d.encode()) > 0 for v in variants for d in DOMAINS)


def _forget_search(path: Path, start: Any) -> None:
    """Clear the note that LLVM has been searched for; without it :c:func:`jit_init` does not search again.

    No function clears it after a search that found nothing. It is the byte ``jitc_llvm_init_attempted``, whose place
    the symbol table of the library tells. Where the table does not name it once, nothing is changed.
    """
    symbols = _symbols(path.read_bytes())
    found = [(value, size) for name, (value, size) in symbols.items() if b"jitc_llvm_init_attempted" in name]
    if len(found) != 1 or found[0][1] != 1 or b"_Z8jit_initj" not in symbols:
        return
    here = ctypes.cast(start, ctypes.c_void_p).value or 0
    ctypes.c_bool.from_address(here - symbols[b"_Z8jit_initj"][0] + found[0][0]).value = False


def _symbols(elf: bytes) -> dict[bytes, tuple[int, int]]:
    """Address and size of every symbol by name, from a 64-bit little-endian ELF file; empty if it is stripped."""
    (sections_at,) = struct.unpack_from("<Q", elf, 0x28)
    entry, count = struct.unpack_from("<HH", elf, 0x3A)
    # type, offset, size, link of each section
    sections = [struct.unpack_from("<4xI16xQQI", elf, sections_at + i * entry) for i in range(count)]
    symbols = {}
    for kind, offset, size, link in sections:
        if kind != 2:  # SHT_SYMTAB
            continue
        names = sections[link][1]
        for name, _, _, _, value, length in struct.iter_unpack("<IBBHQQ", elf[offset : offset + size]):
            symbols[elf[names + name : elf.index(b"\0", names + name)]] = value, length
    return symbols
