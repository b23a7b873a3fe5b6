"""The program around an arm: Ctrl-C, forks, garbage, the end, and the interpreter's lock."""

import ctypes
import gc
import os
import signal
import subprocess
import sys
import textwrap

import pytest
import takt
from conftest import ARM6, HOME


def run(program):
    """Another Python that runs this program. Returns what it prints."""
    text = f"ARM6 = {str(ARM6)!r}\n" + textwrap.dedent(program)
    # A shell starts jobs in the background with SIGINT ignored, and what is ignored is inherited.
    listening = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    command = [sys.executable, "-c", text]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, preexec_fn=listening)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_loop_goes_on_while_python_holds_its_lock(arm):
    before = arm.state.slot
    # A call of `PyDLL` keeps the lock. A loop that waited for it would not run at all.
    ctypes.PyDLL(None).usleep(300_000)
    assert arm.state.slot > before + 100


def test_ctrl_c_in_a_move_stops_in_control_and_raises():
    printed = run("""
        import os, signal, threading, takt
        with takt.Arm(ARM6, simulated=True, record=False) as arm:
            events = arm.events()
            threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
            try:
                arm.move([2, 1, 1, -2, 1, 2], speed=0.02)
            except KeyboardInterrupt:
                print("interrupted")
            while arm.state.phase != "holding":
                events.wait()
            print(*(event.words for event in events.poll() if event.kind == "phase"))
            assert abs(arm.state.position_set[0]) < 1.9
            arm.move([0, 0, 0, -0.1, 0, 0.1])
        print("closed")
    """)
    assert printed.startswith("interrupted") and printed.rstrip().endswith("closed")


def test_ctrl_c_during_bring_up_ends_it():
    printed = run("""
        import os, signal, threading, takt
        config = open(ARM6).read().replace('mode = "csp"', 'mode = "csp"\\npower_up = "8 s"')
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            takt.Arm(config, simulated=True, record=False)
        except KeyboardInterrupt:
            print("interrupted")
    """)
    assert printed.strip() == "interrupted"


def test_ctrl_c_ends_a_simulation_that_would_take_for_ever():
    printed = run("""
        import os, signal, threading, takt
        sim = takt.simulate(ARM6)
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            sim.run(1e9)
        except KeyboardInterrupt:
            print("interrupted")
        sim.step(500)
        print(sim.state.phase)
    """)
    assert printed.split() == ["interrupted", "holding"]


def test_a_program_that_does_not_close_its_arm_leaves_it_shut_down():
    """The recording has the end of the run: it was closed in control."""
    printed = run("""
        import atexit, takt
        arm = takt.Arm(ARM6, simulated=True, record=False)
        events = arm.events()
        # Registered later, and so called earlier than the end of takt: this one shows that the order is turned round.
        atexit.register(lambda: print("ending", arm.has_ended))
        import takt._takt as inner
        atexit.unregister(inner._close_all)
        atexit.register(lambda: print(*(event.words for event in events.poll() if event.kind == "phase")))
        atexit.register(inner._close_all)
    """)
    assert "disabling → disabled" in printed and "ending True" in printed


def test_an_arm_that_nobody_has_any_more_is_shut_down():
    arm = takt.Arm(ARM6, simulated=True, record=False)
    events = arm.events()
    del arm
    gc.collect()
    assert any("disabling → disabled" in event.words for event in events)


def test_after_the_end_every_command_says_so():
    arm = takt.Arm(ARM6, simulated=True, record=False)
    arm.close()
    arm.close()
    assert arm.has_ended
    for command in [lambda: arm.move(HOME), arm.stop, arm.enable, arm.follow]:
        with pytest.raises(takt.EndedError, match="has ended"):
            command()


def test_an_exception_in_a_with_ends_the_run_and_is_passed_on():
    with pytest.raises(ZeroDivisionError), takt.Arm(ARM6, simulated=True, record=False) as arm:
        arm.move(HOME, wait=False)
        1 / 0
    assert arm.has_ended


def test_a_fork_is_told_that_the_arm_is_not_its_own(arm):
    child = os.fork()
    if child == 0:
        # No test of the child may reach pytest.
        result = 1
        try:
            arm.move(HOME)
        except takt.EndedError as error:
            result = 0 if str(os.getppid()) in str(error) else 2
        finally:
            arm.close()
            os._exit(result)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    arm.move(HOME, timeout=60)


def test_a_fork_may_drop_its_copy(arm):
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        takt._takt._close_all()
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    assert not arm.has_ended


def test_a_fork_may_close_its_copy_of_a_server(arm):
    server = arm.serve(f"fork-{os.getpid()}")
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        result = 1
        try:
            server.close()
            result = 0
        finally:
            os._exit(result)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    with takt.connect(f"fork-{os.getpid()}") as client:
        assert not client.has_ended
    server.close()
