#!/bin/sh
# Set everything up, then run gentamp-lp (or the tests) inside it.
#
#   sh run.sh learn tasks/unstack.yaml     any gentamp-lp command
#   sh run.sh test                         lint, types, Prolog and Python tests
#
# Needs Debian 12 or 13, or Ubuntu with Python 3.11 to 3.13; elsewhere install SWI-Prolog 9 and Python yourself.
set -eu
cd "$(dirname "$0")"

need() { # package names
    command -v apt-get >/dev/null 2>&1 || { echo "please install: $*" >&2; return 2; }
    echo "installing: $*" >&2
    if [ "$(id -u)" = 0 ]; then root=""; else root="sudo"; fi
    $root apt-get update -qq >/dev/null
    $root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$@" >/dev/null
}

packages=""
command -v swipl >/dev/null 2>&1 || packages="$packages swi-prolog-nox"
command -v python3 >/dev/null 2>&1 || packages="$packages python3"
python3 -c "import ensurepip, venv" >/dev/null 2>&1 || packages="$packages python3-venv"
# shellcheck disable=SC2086
[ -z "$packages" ] || need $packages

stamp=.venv/.installed
if [ ! -e "$stamp" ] || [ pyproject.toml -nt "$stamp" ]; then
    [ -x .venv/bin/python ] || python3 -m venv .venv
    pip_install() { .venv/bin/python -m pip install --quiet --disable-pip-version-check "$@"; }
    # PyBullet has wheels for some versions of Python only. pip knows if one fits; if none does, it compiles the source.
    wheel="--only-binary=pybullet"
    if ! pip_install --dry-run --no-deps "$wheel" pybullet >/dev/null 2>&1; then
        wheel=""
        headers=$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("include"))')
        { command -v g++ >/dev/null 2>&1 && [ -e "$headers/Python.h" ]; } || need g++ python3-dev
        echo "compiling PyBullet, which has no wheel for this Python: some minutes, only this once" >&2
    fi
    # shellcheck disable=SC2086
    pip_install $wheel --editable '.[dev]' >&2
    touch "$stamp"
fi

if [ "${1:-}" = test ]; then
    shift
    command -v chromedriver >/dev/null 2>&1 || need chromium chromium-driver ||
        echo "no browser could be installed: the report page is not tested in one" >&2
    .venv/bin/ruff check .
    .venv/bin/mypy
    .venv/bin/lint-imports --no-logo
    exec .venv/bin/python -m pytest -n logical --dist worksteal "$@"
fi
exec .venv/bin/gentamp-lp "$@"
