#!/bin/sh
# Set everything up, then run gentamp-lp (or the tests) inside it.
#
#   sh run.sh learn tasks/unstack.yaml     any gentamp-lp command
#   sh run.sh test                         lint, types, Prolog and Python tests
#
# Needs Debian or Ubuntu with Python 3.11 or newer; elsewhere install SWI-Prolog 9 and Python yourself.
set -eu
cd "$(dirname "$0")"

need() { # package names
    echo "installing: $*" >&2
    if [ "$(id -u)" = 0 ]; then root=""; else root="sudo"; fi
    $root apt-get update -qq >/dev/null
    $root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$@" >/dev/null
}

packages=""
command -v swipl >/dev/null 2>&1 || packages="$packages swi-prolog-nox"
command -v python3 >/dev/null 2>&1 || packages="$packages python3"
python3 -c "import ensurepip, venv" >/dev/null 2>&1 || packages="$packages python3-venv"
if [ -n "$packages" ]; then
    command -v apt-get >/dev/null 2>&1 || { echo "please install:$packages" >&2; exit 2; }
    # shellcheck disable=SC2086
    need $packages
fi

stamp=.venv/.installed
if [ ! -e "$stamp" ] || [ pyproject.toml -nt "$stamp" ]; then
    [ -x .venv/bin/python ] || python3 -m venv .venv
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]' >&2
    touch "$stamp"
fi

if [ "${1:-}" = test ]; then
    shift
    command -v chromedriver >/dev/null 2>&1 || need chromium chromium-driver ||
        echo "no browser could be installed: the report page is not tested in one" >&2
    .venv/bin/ruff check .
    .venv/bin/mypy
    .venv/bin/lint-imports --no-logo
    exec .venv/bin/python -m pytest "$@"
fi
exec .venv/bin/gentamp-lp "$@"
