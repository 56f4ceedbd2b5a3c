#!/bin/sh
# Make a virtual environment, also where Debian's Python comes without ensurepip (python3-venv).
set -eu
python=$1
venv=$2
if [ -z "$python" ]; then
    echo "no python3.11 and no python3 found; give one: make PYTHON=/path/to/python3.11" >&2
    exit 2
fi
"$python" - <<'CHECK'
import sys
if sys.version_info < (3, 11):
    sys.exit(f"Python {sys.version.split()[0]} is too old: 3.11 is needed (make PYTHON=python3.11)")
if sys.version_info >= (3, 12):
    print("note: PyBullet has wheels up to Python 3.11; pip now builds it, which needs a C++ "
          "compiler, the Python headers and some minutes", file=sys.stderr)
CHECK
if "$python" -c 'import ensurepip' 2>/dev/null; then
    "$python" -m venv "$venv"
elif "$python" -m pip --version >/dev/null 2>&1; then
    "$python" -m venv --without-pip "$venv"
    "$python" -m pip --python "$venv/bin/python" install --quiet pip
else
    echo "this Python has neither ensurepip nor pip: on Debian, apt install python3-venv" >&2
    exit 2
fi
