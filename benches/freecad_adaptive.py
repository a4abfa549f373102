#!/usr/bin/python3
"""Lengths of FreeCAD's adaptive clearing on the pockets of scenes, at the engagement that the scenes ask for.

    apt-get install freecad-python3 python3-numpy
    /usr/bin/python3 benches/freecad_adaptive.py SCENE.toml...

Enters: scenes whose part is `surface = "pocket"` with `outline` and `islands` as points, a flat cutter, and a first toolpath with
`engagement`. Leaves: one line a scene with the lengths of cutting moves and of links at depth, mm. FreeCAD takes a stepover, so it is
searched until 95 % of the cutting length have no more than the engagement, by brute force on a raster: the front half of the
circumference against what was cleared up to a tenth of a radius behind. Helices and lifts do not count.
"""
import math
import sys
import time
import tomllib

sys.path.append("/usr/lib/freecad/lib")
import numpy as np
import FreeCAD  # noqa: F401  (libarea needs it)
import area

NEAR = 1.5  # degrees: a stepover is good enough
ROUNDS = 7


def plan(part, diameter, share):
    job = area.Adaptive2d()
    job.stepOverFactor = share
    job.toolDiameter = diameter
    job.helixRampDiameter = 0.8 * diameter
    job.keepToolDownDistRatio = 3.0
    job.stockToLeave = 0.0
    job.tolerance = 0.1
    job.forceInsideOut = False
    job.finishingProfile = True
    job.opType = area.AdaptiveOperationType.ClearingInside
    closed = lambda curve: [[float(x), float(y)] for x, y in curve + curve[:1]]
    xs, ys = zip(*part["outline"])
    x0, x1, y0, y1 = min(xs) - diameter, max(xs) + diameter, min(ys) - diameter, max(ys) + diameter
    stock = [[[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]]
    curves = [closed(curve) for curve in [part["outline"], *part.get("islands", [])]]
    begun = time.time()
    pieces = job.Execute(stock, curves, lambda paths: False)
    return pieces, time.time() - begun


def measure(part, diameter, pieces):
    radius = diameter / 2
    cell, step, behind = radius / 150, 0.05 * radius, 0.1 * radius
    xs, ys = zip(*part["outline"])
    x0, y0 = min(xs) - 1, min(ys) - 1
    stock = np.ones((int((max(ys) - y0 + 1) / cell) + 2, int((max(xs) - x0 + 1) / cell) + 2), bool)
    reach = int(radius / cell) + 1
    jj, ii = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = (ii**2 + jj**2) * cell * cell <= radius * radius

    def clear(x, y):
        i, j = int(round((x - x0) / cell)), int(round((y - y0) / cell))
        i0, i1 = max(0, i - reach), min(stock.shape[1], i + reach + 1)
        j0, j1 = max(0, j - reach), min(stock.shape[0], j + reach + 1)
        stock[j0:j1, i0:i1] &= ~disc[j0 - j + reach : j1 - j + reach, i0 - i + reach : i1 - i + reach]

    turns = (np.arange(180) + 0.5) * math.pi / 180 - math.pi / 2
    rim = radius - 0.75 * cell
    cut = link = gone = 0.0
    angles, lengths, waiting = [], [], []
    for piece in pieces:
        centre, last = piece.HelixCenterPoint, piece.StartPoint
        helix = math.hypot(last[0] - centre[0], last[1] - centre[1])
        for k in range(200):
            turn = k * math.pi / 100
            clear(centre[0] + helix * math.cos(turn), centre[1] + helix * math.sin(turn))
        for kind, points in piece.AdaptivePaths:
            points = [last, *points]
            for p, q in zip(points, points[1:]):
                length = math.hypot(q[0] - p[0], q[1] - p[1])
                if length == 0:
                    continue
                if kind != area.AdaptiveMotionType.Cutting:
                    while waiting:
                        clear(*waiting.pop(0)[:2])
                    link += length
                    continue
                cut += length
                count = max(1, math.ceil(length / step))
                ahead = math.atan2(q[1] - p[1], q[0] - p[0]) + turns
                for k in range(1, count + 1):
                    x, y = p[0] + (q[0] - p[0]) * k / count, p[1] + (q[1] - p[1]) * k / count
                    way = gone + length * k / count
                    while waiting and waiting[0][2] <= way - behind:
                        clear(*waiting.pop(0)[:2])
                    i = np.rint((x + rim * np.cos(ahead) - x0) / cell).astype(int)
                    j = np.rint((y + rim * np.sin(ahead) - y0) / cell).astype(int)
                    inside = (i >= 0) & (j >= 0) & (i < stock.shape[1]) & (j < stock.shape[0])
                    angles.append(float(stock[j[inside], i[inside]].sum()))
                    lengths.append(length / count)
                    waiting.append((x, y, way))
                gone += length
            last = points[-1]
    if not angles:
        return None
    angles, lengths = np.array(angles), np.array(lengths)
    order = np.argsort(angles)
    below = np.cumsum(lengths[order])
    p95 = angles[order][np.searchsorted(below, 0.95 * below[-1])]
    return cut, link, p95, angles.max()


def main():
    for file in sys.argv[1:]:
        with open(file, "rb") as text:
            scene = tomllib.load(text)
        part, diameter = scene["part"], float(scene["cutter"]["diameter"])
        asked = float(scene["toolpath"][0]["engagement"])
        low, high, best = 0.005, 0.9, None
        for _ in range(ROUNDS):
            share = math.sqrt(low * high)
            pieces, took = plan(part, diameter, share)
            found = measure(part, diameter, pieces)
            if found is None:
                break
            if best is None or abs(found[2] - asked) < abs(best[1][2] - asked):
                best = (share, found, took)
            if abs(found[2] - asked) <= NEAR:
                break
            low, high = (low, share) if found[2] > asked else (share, high)
        if best is None:
            print(f"{file}: FreeCAD plans nothing", flush=True)
            continue
        share, (cut, link, p95, most), took = best
        print(
            f"{file}: cut {cut:.0f} + links {link:.0f} = {cut + link:.0f} mm, engagement {p95:.0f} at 95 % and {most:.0f} at most"
            f" (asked {asked:g}), stepover {share:.3f}, planned in {took:.1f} s",
            flush=True,
        )


main()
