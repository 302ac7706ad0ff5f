"""Ctrl-C beside libraries in C, and where Python swallows it."""

import signal
import subprocess
import sys
import threading

import pytest

from gentamp_lp.solvers.interrupts import Held


def python(program):
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)


def test_ctrl_c_waits_for_the_end_of_the_block():
    reached = False
    with pytest.raises(KeyboardInterrupt), Held() as held:
        signal.raise_signal(signal.SIGINT)
        reached = held.pending
    assert reached
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_ctrl_c_can_be_forgotten():
    with Held() as held:
        signal.raise_signal(signal.SIGINT)
        held.pending = False


def test_other_threads_hold_nothing():
    def work():
        with Held() as held:
            seen.append(held.pending)

    seen = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [False]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_while_a_search_starts_does_not_leave_it_behind():
    """Lost between clingo and Python, the thread of the search would end the process with `terminate called`."""
    program = (
        "import signal, sys\n"
        "import clingo.control\n"
        "from gentamp_lp.solvers.asp import GroundProgram\n"
        "make = clingo.control.SolveHandle\n"
        "def pressed(*args):\n"
        "    signal.raise_signal(signal.SIGINT)\n"
        "    return make(*args)\n"
        "clingo.control.SolveHandle = pressed\n"
        "try:\n"
        "    GroundProgram([], '1 {at(P,H): H = 1..10} 1 :- P = 1..11. :- at(P,H), at(Q,H), P < Q.').solve()\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(130)\n"
    )
    done = python(program)
    assert done.returncode == 130, done.stderr


@pytest.mark.parametrize("again", [True, False])
def test_ctrl_c_is_not_lost_in_a_finalizer(again):
    program = (
        "import signal, time\n"
        "from gentamp_lp.solvers.interrupts import send_swallowed_again\n"
        f"{'send_swallowed_again()' if again else ''}\n"
        "class Slow:\n"
        "    def __del__(self): signal.raise_signal(signal.SIGINT)\n"
        "Slow()\n"
        "time.sleep(0.5)\n"
        "print('lost')\n"
    )
    done = python(program)
    assert (done.stdout == "") == again
    assert (done.returncode != 0) == again


def test_ctrl_c_while_prolog_starts_is_ours():
    program = (
        "import signal, sys\n"
        "from gentamp_lp.solvers.prolog import Prolog\n"
        "class Pressed(Prolog):\n"
        "    def _ask(self, goal):\n"
        "        answer = super()._ask(goal)\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "        return answer\n"
        "try:\n"
        "    Pressed()\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(130)\n"
    )
    done = python(program)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_ctrl_c_while_the_command_is_imported_gives_no_traceback():
    program = (
        "import signal, sys\n"
        "class Pressed:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'typer':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Pressed())\n"
        "from gentamp_lp.__main__ import main\n"
        "main()\n"
    )
    done = python(program)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
