#!/usr/bin/env python3
"""Runs the programs beside this script on LinuxCNC's trajectory planner and writes how long each takes.

Debian: apt-get install --no-install-recommends linuxcnc-uspace
Then, as an ordinary user (LinuxCNC refuses root), from a folder of his own:

    /usr/bin/python3 tests/planner/make_times.py [NAME.ngc ...] > times.txt

No display and no machine is needed: HAL's `sampler` counts the servo cycles, a millisecond each, from the first in which the
machine moves to the last. The limits of the machine are in the header of each program: `(RATE r, ACCELERATIONS x y z)` in mm/s
and mm/s2. A line of the result: program, seconds.
"""

import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
HEADER = re.compile(r"\(RATE ([\d.]+), ACCELERATIONS ([\d.]+) ([\d.]+) ([\d.]+)\)")

INI = """[EMC]
VERSION = 1.1
MACHINE = times
DEBUG = 0
[DISPLAY]
DISPLAY = {here}/drive.py
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = {folder}/var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
BASE_PERIOD = 0
SERVO_PERIOD = 1000000
[HAL]
HALFILE = LIB:core_sim.hal
HALFILE = {folder}/sample.hal
[TRAJ]
COORDINATES = XYZ
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = {rate}
MAX_LINEAR_VELOCITY = {rate}
DEFAULT_LINEAR_ACCELERATION = {most}
MAX_LINEAR_ACCELERATION = {most}
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.1
TOOL_TABLE = {folder}/tool.tbl
[KINS]
KINEMATICS = trivkins coordinates=XYZ
JOINTS = 3
"""

AXIS = """[AXIS_{letter}]
MAX_VELOCITY = {rate}
MAX_ACCELERATION = {acceleration}
MIN_LIMIT = -9000
MAX_LIMIT = 9000
[JOINT_{k}]
TYPE = LINEAR
MAX_VELOCITY = {rate}
MAX_ACCELERATION = {acceleration}
MIN_LIMIT = -9000
MAX_LIMIT = 9000
FERROR = 1000
MIN_FERROR = 1000
HOME_SEARCH_VEL = 0
HOME_LATCH_VEL = 0
HOME_SEQUENCE = 0
"""

SAMPLE = """loadrt sampler depth=200000 cfg=f
addf sampler.0 servo-thread
net speed motion.current-vel => sampler.0.pin.0
loadusr halsampler {folder}/samples
"""

DRIVE = """#!/usr/bin/python3
import time
import linuxcnc
command, status = linuxcnc.command(), linuxcnc.stat()


def until(right, seconds=600):
    end = time.time() + seconds
    while time.time() < end:
        status.poll()
        if right():
            return
        time.sleep(0.02)
    raise SystemExit("LinuxCNC does not answer")


command.state(linuxcnc.STATE_ESTOP_RESET)
command.state(linuxcnc.STATE_ON)
until(lambda: status.task_state == linuxcnc.STATE_ON)
command.mode(linuxcnc.MODE_MANUAL)
command.wait_complete()
for joint in range(3):
    command.home(joint)
until(lambda: all(status.homed[:3]))
command.teleop_enable(1)
command.mode(linuxcnc.MODE_AUTO)
command.wait_complete()
command.program_open("{program}")
time.sleep(0.3)
command.auto(linuxcnc.AUTO_RUN, 0)
time.sleep(0.5)
until(lambda: status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and status.queue == 0)
time.sleep(0.3)
command.abort()
"""


def seconds(program):
    """How long the machine moves in a program, s."""
    rate, *accelerations = map(float, HEADER.search(program.read_text()).groups())
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        ini = INI.format(here=folder, folder=folder, rate=rate, most=max(accelerations))
        for k, (letter, acceleration) in enumerate(zip("XYZ", accelerations)):
            ini += AXIS.format(k=k, letter=letter, rate=rate, acceleration=acceleration)
        (folder / "times.ini").write_text(ini)
        (folder / "sample.hal").write_text(SAMPLE.format(folder=folder))
        (folder / "tool.tbl").write_text("T1 P1 D1\n")
        drive = folder / "drive.py"
        drive.write_text(DRIVE.format(program=program))
        drive.chmod(0o755)
        run = subprocess.run(["linuxcnc", folder / "times.ini"], capture_output=True, text=True, timeout=900)
        if not (folder / "samples").exists():
            sys.exit(f"LinuxCNC did not start:\n{run.stdout}\n{run.stderr}")
        samples = [float(line) for line in (folder / "samples").read_text().split() if line != "overrun"]
        moving = [k for k, speed in enumerate(samples) if speed > 0.0]
        if not moving:
            sys.exit(f"{program.name} did not move:\n{run.stdout}\n{run.stderr}")
        return (moving[-1] - moving[0] + 1) / 1000.0


def main():
    names = sys.argv[1:] or sorted(path.name for path in HERE.glob("*.ngc"))
    for name in names:
        print(f"{name} {seconds(HERE / name):.3f}", flush=True)


main()
