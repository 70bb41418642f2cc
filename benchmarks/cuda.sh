#!/bin/sh
# pbrdf on an NVIDIA card against the processor of the same machine, in under four minutes:
#
#     benchmarks/cuda.sh WHEELS [--rehearse]
#
# WHEELS is a folder of wheels for this machine's Python; nothing is fetched from anywhere. Made beforehand by
#
#     python3 -m pip download -d WHEELS pip PACKAGE…     with the packages that `benchmarks/cuda.sh --requirements` names
#
# Packages that the machine's own Python has may be missing there. In a temporary virtual environment, the sources of
# this work tree are measured by benchmarks/cuda.py: evaluation, batch fit and render, each with its own time limit, and
# the tests marked `cuda` are run. A table is printed; JSON files go to $OUT if that is set. Without Mitsuba the render
# is left out, and the script says so.
#
# --rehearse takes Dr.Jit's LLVM backend in the card's place: everything but the card is tried, the ratios mean nothing.
# Exit status: 0 if everything ran and the results of card and processor agree.
set -u
HERE=$(cd "$(dirname "$0")" && pwd)
TREE=$(dirname "$HERE")
PYTHON=${PYTHON:-python3}

requirements() {
  "$PYTHON" - "$TREE/pyproject.toml" <<'END'
import sys, tomllib
project = tomllib.load(open(sys.argv[1], "rb"))["project"]
print("\n".join([*project["dependencies"], *project["optional-dependencies"]["render"], "pytest>=8", "hypothesis>=6.100"]))
END
}

case "${1:-}" in
--requirements)
  requirements
  exit 0
  ;;
"" | -*)
  sed -n '2,17s/^# \{0,1\}//p' "$0"
  exit 2
  ;;
esac
WHEELS=$1
DEVICE=cuda
[ "${2:-}" = --rehearse ] && DEVICE=llvm
[ -d "$WHEELS" ] || { echo "no folder $WHEELS" >&2; exit 2; }

WORK=$(mktemp -d) || exit 1
trap 'rm -rf "$WORK"' EXIT
trap 'exit 130' INT TERM
RESULTS=${OUT:-$WORK}
STARTED=$(date +%s)

"$PYTHON" -m venv "$WORK/venv" || exit 1
RUN="$WORK/venv/bin/python"
# what the machine's Python has, if that is a virtual environment itself, too
"$PYTHON" - "$("$RUN" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/machine.pth" <<'END'
import pathlib, site, sys, sysconfig
places = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), *site.getsitepackages()}
pathlib.Path(sys.argv[1]).write_text("\n".join(sorted(places)) + "\n")
END
# one after the other: what cannot be had is told, and the rest goes on
requirements | while IFS= read -r requirement; do
  "$RUN" -m pip install -q --disable-pip-version-check --no-index --find-links "$WHEELS" --no-compile "$requirement" \
    || echo "not installed: $requirement"
done

export PYTHONPATH="$TREE/src" PYTHONUNBUFFERED=1 DRJIT_CACHE_DIR="$WORK/kernels"
mkdir "$WORK/kernels"
status=0
for piece in machine evaluation:45 fit:90 render:45; do
  name=${piece%%:*} limit=${piece##*:}
  [ "$limit" = "$name" ] && limit=20
  timeout "$limit" "$RUN" "$HERE/cuda.py" "$name" --device "$DEVICE" --json "$RESULTS/cuda-$name.json"
  result=$?
  [ $result -eq 124 ] && echo "$name: not done in $limit s"
  [ $result -ne 0 ] && status=1
  # without the card nothing below can run
  [ "$name" = machine ] && [ $result -ne 0 ] && exit 1
done

# in a rehearsal the same tests on LLVM: those marked for the card would all be skipped
if [ "$DEVICE" = cuda ]; then chosen="-m cuda"; else chosen="-k llvm"; fi
# shellcheck disable=SC2086 # two words
timeout 60 "$RUN" -m pytest -q -p no:cacheprovider -c "$TREE/pyproject.toml" --rootdir "$TREE" $chosen \
  "$TREE/tests/test_devices.py" "$TREE/tests/rendering/test_bsdf_matrices.py::test_every_variant" || status=1
echo "$(($(date +%s) - STARTED)) s in all, status $status"
exit $status
