"""The command line as a user runs it."""

import os
import subprocess
import sys


def run(*args, cwd=None, env=None):
    command = [sys.executable, "-m", "gentamp_lp", *args]
    done = subprocess.run(
        command,
        cwd=cwd,
        capture_output=True,
        text=True,
        env={**os.environ, "NO_COLOR": "1", **(env or {})},
        timeout=300,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done
