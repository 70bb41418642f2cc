"""Cells ``%%sh`` of the tutorials, run when the kernel of a build starts: the output in one piece, without colours.

IPython's own writes it in pieces of 100 bytes, which MyST-NB ends with line breaks, and its kernel asks for colours.
"""

import os
import subprocess

from IPython.core.magic import register_cell_magic


@register_cell_magic
def sh(line: str, cell: str) -> None:
    """Run the lines of a cell in a shell; one that fails ends the build."""
    plain = {
        name: value for name, value in os.environ.items() if name not in ("FORCE_COLOR", "CLICOLOR_FORCE")
    }
    done = subprocess.run(
        ["sh", "-e", "-c", cell],
        env=plain,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    print(done.stdout, end="")
    done.check_returncode()
