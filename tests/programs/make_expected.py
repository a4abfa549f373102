#!/usr/bin/env python3
"""Makes the expected motion of every program beside this script, by LinuxCNC's own interpreter.

Debian: apt-get install --no-install-recommends linuxcnc-uspace
Then:   tests/programs/make_expected.py [NAME.ngc ...]

Each NAME.ngc gives NAME.motion: a line for each motion that moves, mm and degrees, in machine coordinates less the tool's
length, as program::Program has them.

    r X Y Z A B C                              rapid
    f X Y Z A B C FEED                         straight, at feed
    a X Y Z A B C FEED CX CY CZ SENSE PLANE    arc: its centre, whole turns with their sense (+ anticlockwise), 17 18 19

rs274 prints four decimals. A line ends in `inch` where these were of inches.

M428 and M429, which switch kinematics, are remapped as in LinuxCNC's sample configurations of xyzac-trt and xyzbc-trt.
"""

import math
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).parent
CALL = re.compile(r"^\s*\d+\s+N\S*\s+([A-Z0-9_]+)\((.*)\)\s*$")


# The subprograms of the sample configurations, without their questions to a running machine.
SWITCH = "o<{code}remap>sub\nM68 E3 Q{on}\nM66 E0 L0\no<{code}remap>endsub\n"
INI = """[RS274NGC]
SUBROUTINE_PATH = {folder}
REMAP = M428 modalgroup=10 ngc=428remap
REMAP = M429 modalgroup=10 ngc=429remap
"""


class Control:
    """What canonical calls leave in force."""

    def __init__(self):
        self.work = [0.0] * 6
        self.shift = [0.0] * 6
        self.turn = 0.0
        self.length = [0.0] * 3
        self.feed = 0.0
        self.plane = 17
        self.at = [0.0] * 6
        self.unit = 1.0
        self.lines = []

    def lengths(self, numbers):
        """Values along X Y Z A B C in mm and degrees."""
        return [v * self.unit if k < 3 else v for k, v in enumerate(numbers)]

    def machine(self, place):
        x, y = place[0] + self.shift[0], place[1] + self.shift[1]
        angle = math.radians(self.turn)
        turned = [x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)]
        rest = [p + s for p, s in zip(place[2:], self.shift[2:])]
        return [p + w for p, w in zip(turned + rest, self.work)]

    def move(self, kind, place, more=()):
        place = self.machine(place)
        if kind != "a" and all(abs(p - q) < 1e-9 for p, q in zip(place, self.at)):
            return
        self.at = place
        words = [kind] + [number(v) for v in place] + [str(m) for m in more]
        self.lines.append(" ".join(words + ["inch"] * (self.unit != 1.0)))

    def call(self, name, words):
        n = [float(w) for w in words if re.fullmatch(r"-?\d+(\.\d+)?", w)]
        if name == "SET_G5X_OFFSET":
            self.work = self.lengths(n[1:7])
        elif name == "SET_G92_OFFSET":
            self.shift = self.lengths(n[:6])
        elif name == "SET_XY_ROTATION":
            self.turn = n[0]
        elif name == "USE_TOOL_LENGTH_OFFSET":
            length = self.lengths(n[:3])
            self.at = [a + o - l for a, o, l in zip(self.at, self.length, length)] + self.at[3:]
            self.length = length
        elif name == "SET_FEED_RATE":
            self.feed = n[0] * self.unit
        elif name == "USE_LENGTH_UNITS":
            self.unit = 25.4 if "INCH" in words[0] else 1.0
        elif name == "SELECT_PLANE":
            self.plane = {"XY": 17, "XZ": 18, "YZ": 19}[words[0][-2:]]
        elif name == "STRAIGHT_TRAVERSE":
            self.move("r", self.lengths(n[:6]))
        elif name == "STRAIGHT_FEED":
            self.move("f", self.lengths(n[:6]), [number(self.feed)])
        elif name == "ARC_FEED":
            self.arc(n)

    def arc(self, n):
        first, second, c1, c2, turns, end, a, b, c = n[:9]
        first, second, c1, c2, end = (v * self.unit for v in (first, second, c1, c2, end))
        u, v, w = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[self.plane]
        to, centre = [0.0] * 3, [0.0] * 3
        to[u], to[v], to[w] = first, second, end
        centre[u], centre[v], centre[w] = c1, c2, end
        middle = self.machine(centre + [0.0] * 3)[:3]
        more = [number(self.feed)] + [number(m) for m in middle] + [int(turns), self.plane]
        self.move("a", to + [a, b, c], more)


def number(value):
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def expected(program):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "rs274.var").write_text("")
        (folder / "tool.tbl").write_bytes((HERE / "tool.tbl").read_bytes())
        for code, on in [(428, 1), (429, 0)]:
            (folder / f"{code}remap.ngc").write_text(SWITCH.format(code=code, on=on))
        (folder / "rs274.ini").write_text(INI.format(folder=folder))
        command = ["rs274", "-g", "-i", "rs274.ini", "-t", "tool.tbl", "-v", "rs274.var", str(program.resolve())]
        ran = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
    control = Control()
    for line in ran.stdout.splitlines():
        found = CALL.match(line)
        if found:
            control.call(found[1], [w for w in re.split(r"[,\s]+", found[2]) if w])
    if "PROGRAM_END" not in ran.stdout:
        sys.exit(f"{program.name}: rs274 stopped: {ran.stderr.strip()} {ran.stdout.splitlines()[-1:]}")
    return control.lines


def main():
    names = sys.argv[1:] or sorted(p.name for p in HERE.glob("*.ngc"))
    for name in names:
        program = HERE / name
        lines = expected(program)
        program.with_suffix(".motion").write_text("\n".join(lines) + "\n")
        print(f"{name}: {len(lines)} motions")


if __name__ == "__main__":
    main()
