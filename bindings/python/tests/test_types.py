"""The types say what is there."""

import subprocess
import sys

from conftest import ROOT


def test_the_stub_and_the_module_agree():
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "takt"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_program_is_checked_by_its_types(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        "import takt\n"
        "with takt.simulate('arm.toml') as sim:\n"
        "    sim.move([0.0], speed=0.5)\n"
        "    position: float = sim.state.position[0]\n"
        "    sim.stop(7)\n"
        "    sim.movee([0.0])\n"
    )
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", program], capture_output=True, text=True)
    wrong = [line.split(":")[1] for line in done.stdout.splitlines() if ": error:" in line]
    assert wrong == ["5", "6"], done.stdout


def test_the_examples_are_typed():
    # lerobot is not installed here: its classes are taken for any.
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "--allow-subclassing-any"]
    done = subprocess.run([*command, ROOT / "bindings" / "python" / "examples"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
