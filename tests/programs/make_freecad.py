"""Makes a part and its programs with FreeCAD's Path workbench, without a screen.

Debian: apt-get install --no-install-recommends freecad
Then:   OUT=FOLDER QT_QPA_PLATFORM=offscreen freecadcmd tests/programs/make_freecad.py < /dev/null

The part is a block with a pocket, a boss in it and three holes; its operations are face, pocket, adaptive, profile and drill
with one tool of 5 mm, written by the post processors linuxcnc, grbl, mach3_mach4 and centroid.
"""

import importlib
import os

import FreeCAD
import MeshPart
import Part
import PathScripts.PathJob as PathJob
import PathScripts.PathUtils as PathUtils

OUT = os.environ.get("OUT", ".")


def model(doc):
    """The part, in mm, and its triangles in a file."""
    at = FreeCAD.Vector
    shape = Part.makeBox(60, 40, 15).cut(Part.makeBox(24, 20, 6, at(6, 10, 9)))
    shape = shape.fuse(Part.makeCylinder(4, 6, at(18, 20, 9)))
    for x, y in ((45, 10), (45, 30), (54, 20)):
        shape = shape.cut(Part.makeCylinder(2.5, 15, at(x, y, 0)))
    found = doc.addObject("Part::Feature", "Model")
    found.Shape = shape.removeSplitter()
    doc.recompute()
    mesh = MeshPart.meshFromShape(Shape=found.Shape, LinearDeflection=0.005, AngularDeflection=0.1)
    mesh.write(os.path.join(OUT, "freecad_part.stl"))
    return found


def main():
    doc = FreeCAD.newDocument("part")
    job = PathJob.Create("Job", [model(doc)], None)
    job.Stock.ExtZpos = 1.0
    tool = job.Tools.Group[0]
    tool.HorizFeed.Value, tool.VertFeed.Value = 20, 5
    tool.SpindleSpeed, tool.SpindleDir = 8000, "Forward"
    # With several controllers FreeCAD would ask on the screen.
    PathUtils.findToolController = lambda *a, **k: tool
    part = job.Model.Group[0]
    boxes = enumerate(face.BoundBox for face in part.Shape.Faces)
    floor = [f"Face{k + 1}" for k, box in boxes if abs(box.ZMin - 9) < 1e-6 and abs(box.ZMax - 9) < 1e-6]
    clear = {"Base": [(part, floor)]}
    coarse = {**clear, "StepOver": 60, "Tolerance": 0.5, "FinishingProfile": False}
    wanted = [("PathMillFace", "face", {}), ("PathPocketShape", "pocket", clear), ("PathAdaptive", "adaptive", coarse),
              ("PathProfile", "profile", {}), ("PathDrilling", "drill", {})]
    operations = []
    for module, name, properties in wanted:
        operation = importlib.import_module(f"PathScripts.{module}").Create(name)
        operation.ToolController = tool
        for key, value in properties.items():
            setattr(operation, key, value)
        doc.recompute()
        operations.append(operation)
    whole = [o for o in operations if o.Label != "adaptive"]
    export("linuxcnc", "job", [tool] + whole)
    for post in ("linuxcnc", "grbl", "mach3_mach4", "centroid"):
        for operation in operations:
            export(post, operation.Label, [tool, operation])


def export(post, name, objects):
    writer = importlib.import_module(f"PathScripts.post.{post}_post")
    writer.export(objects, os.path.join(OUT, f"freecad_{name}_{post}.nc"), "--no-show-editor")


main()
