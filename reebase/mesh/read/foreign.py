"""Files that are something else: named for what they are, with what to do, instead of what they are not.

Nobody reads all formats. But whoever sends a Collada file, a STEP file or a zip archive is helped by hearing that
this is what it is, and by which way it comes in.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePath

__all__ = ["archive_in_words", "in_words"]

_EXPORT = "Open it in a program that reads it, such as Blender or MeshLab, and export it as GLB, OBJ, PLY or STL."
_SOLID = "It describes exact solids; export it from the CAD program as 3MF or STL, with fine facets."
_POINTS = "It is points without a surface; reconstruct one (MeshLab and Open3D can) and send it as PLY, OBJ or STL."
_SCENE = "Export it from the program that made it as GLB, OBJ or STL."
_SIMULATION = "Save its surface as PLY, STL or OBJ; meshio and ParaView can."
_PICTURE = "A picture is not a mesh."
_UNPACK = "Unpack it and send the file inside."
_SEND = "Fetch the file itself (git lfs pull) and send that."

_SIGNATURES: tuple[tuple[bytes, str, str], ...] = (
    (rb"version https://git-lfs\.github\.com", "a pointer of Git LFS, not the file that it stands for", _SEND),
    (rb"\x1f\x8b", "compressed with gzip", _UNPACK),
    (rb"BZh[1-9]1AY", "compressed with bzip2", _UNPACK),
    (rb"\xfd7zXZ\x00", "compressed with xz", _UNPACK),
    (rb"\x28\xb5\x2f\xfd", "compressed with Zstandard", _UNPACK),
    (rb"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", _UNPACK),
    (rb"Rar!\x1a\x07", "a RAR archive", _UNPACK),
    (rb"PK\x05\x06", "a zip archive without files", _UNPACK),
    (rb"Kaydara FBX Binary|;\s*FBX \d", "an FBX file", _SCENE),
    (rb"BLENDER[-_]|BLENDER\d\d-", "a Blender file", _SCENE),
    (rb"MM.{4}[\x02\x3d]", "a 3DS file", _EXPORT),
    (rb"ISO-10303-21", "a STEP file", _SOLID),
    (rb"DBRep_DrawableShape|CASCADE Topology|Open CASCADE Topology", "a BREP file", _SOLID),
    (rb"3D Geometry File Format", "a Rhino 3DM file", _SOLID),
    (rb"PXR-USDC|#usda", "a USD file", _SCENE),
    (rb"#VRML", "a VRML file", _EXPORT),
    (rb"#\s*vtk DataFile", "a VTK file", _SIMULATION),
    (rb"\$MeshFormat", "a Gmsh file", _SIMULATION),
    (rb"\s*MeshVersionFormatted", "a Medit mesh", _SIMULATION),
    (rb"#?\s*\.PCD|VERSION \.7\s", "a PCD point cloud", _POINTS),
    (rb"LASF", "a LAS point cloud", _POINTS),
    (rb"DRACO", "a Draco file", _EXPORT),
    (rb"OCTM", "an OpenCTM file", _EXPORT),
    (rb"FORM.{4}(LWO|LXO)", "a LightWave file", _EXPORT),
    (rb"\*3DSMAX_ASCIIEXPORT", "an ASE file", _EXPORT),
    (rb"IDP[23O]", "a model of a Quake engine", _EXPORT),
    (rb"AC3D[0-9a-f]", "an AC3D file", _EXPORT),
    (rb"\s*0\s+SECTION", "a DXF file", _EXPORT),
    (rb"\x93NUMPY", "a NumPy array", "Save vertices and faces as PLY or OBJ."),
    (rb"\x89HDF", "an HDF5 file", _SIMULATION),
    (rb"\x89PNG|\xff\xd8\xff|GIF8|BM.{12}\x28", "a picture", _PICTURE),
    (rb"%PDF", "a PDF document", "Ask whoever made it for the model itself, as GLB, OBJ, PLY or STL."),
    (rb"\xff\xfe\xff\x0eS\x00k", "a SketchUp file", _SCENE),
    (rb"(?i)\s*<!doctype html|\s*<html", "a web page", "Perhaps it was saved in place of the file; send the file."),
)
_ROOTS = {
    "COLLADA": ("a Collada (DAE) file", _EXPORT),
    "X3D": ("an X3D file", _EXPORT),
    "amf": ("an AMF file", "Export it as 3MF or STL."),
    "VTKFile": ("a VTK file", _SIMULATION),
    "GIFTI": ("a GIFTI file", "Save its surface as PLY, OBJ or STL; nibabel and Connectome Workbench can."),
    "model": ("the model of a 3MF file without its archive", "Send the .3mf file."),
    "svg": ("an SVG drawing", _PICTURE),
    "html": ("a web page", "Perhaps it was saved in place of the file; send the file."),
}
# Nothing is given back: else the ways to tell comments apart would double with each of them.
_XML_ROOT = re.compile(
    rb"\s*+(?:<\?xml[^>]*+>)?+\s*+(?>(?:<!--.*?-->\s*+)*)(?:<!DOCTYPE\s++(\w+)|<(?:\w++:)?(\w+))", re.DOTALL
)
_SUFFIXES = {
    "dae": _ROOTS["COLLADA"], "x3d": _ROOTS["X3D"], "x3dv": _ROOTS["X3D"], "x3db": _ROOTS["X3D"],
    "amf": _ROOTS["amf"], "vtp": _ROOTS["VTKFile"], "vtu": _ROOTS["VTKFile"], "gii": _ROOTS["GIFTI"],
    "wrl": ("a VRML file", _EXPORT), "fbx": ("an FBX file", _SCENE), "3ds": ("a 3DS file", _EXPORT),
    "blend": ("a Blender file", _SCENE), "max": ("a 3ds Max file", _SCENE), "skp": ("a SketchUp file", _SCENE),
    "c4d": ("a Cinema 4D file", _SCENE), "ma": ("a Maya file", _SCENE), "mb": ("a Maya file", _SCENE),
    "ztl": ("a ZBrush file", _SCENE), "usd": ("a USD file", _SCENE), "usda": ("a USD file", _SCENE),
    "usdc": ("a USD file", _SCENE), "usdz": ("a USD archive", _SCENE), "abc": ("an Alembic file", _SCENE),
    "step": ("a STEP file", _SOLID), "stp": ("a STEP file", _SOLID), "iges": ("an IGES file", _SOLID),
    "igs": ("an IGES file", _SOLID), "brep": ("a BREP file", _SOLID), "sldprt": ("a SolidWorks file", _SOLID),
    "ipt": ("an Inventor file", _SOLID), "fcstd": ("a FreeCAD file", _SOLID), "3dm": ("a Rhino 3DM file", _SOLID),
    "ifc": ("an IFC file", _SOLID), "scad": ("an OpenSCAD program", "Render it and export 3MF or STL."),
    "gcode": ("a program for a printer", "Send the model that it was sliced from."),
    "xyz": ("a list of points", _POINTS), "pts": ("a list of points", _POINTS), "asc": ("a list of points", _POINTS),
    "pcd": ("a PCD point cloud", _POINTS), "las": ("a LAS point cloud", _POINTS), "laz": ("a LAZ point cloud", _POINTS),
    "e57": ("an E57 point cloud", _POINTS), "msh": ("a Gmsh file", _SIMULATION), "vtk": ("a VTK file", _SIMULATION),
    "mesh": ("a Medit mesh", _SIMULATION), "node": ("a TetGen file", _SIMULATION),
    "ele": ("a TetGen file", _SIMULATION),
    "dxf": ("a DXF file", _EXPORT), "dwg": ("a DWG file", _SOLID), "drc": ("a Draco file", _EXPORT),
    "ctm": ("an OpenCTM file", _EXPORT), "lwo": ("a LightWave file", _EXPORT), "ase": ("an ASE file", _EXPORT),
    "md2": ("a model of a Quake engine", _EXPORT), "ac": ("an AC3D file", _EXPORT), "bvh": ("a motion", _EXPORT),
    "mtl": ("a list of materials", "The mesh is in the OBJ file beside it; send that."),
    "bin": ("a buffer of a glTF file", "Export the scene as GLB, which holds everything, and send that."),
    "gz": ("compressed with gzip", _UNPACK), "zip": ("a zip archive", _UNPACK), "7z": ("a 7-Zip archive", _UNPACK),
    "rar": ("a RAR archive", _UNPACK), "tar": ("a tar archive", _UNPACK), "tgz": ("a tar archive", _UNPACK),
}  # fmt: skip
"""What a name says where the content says nothing."""

_PARTS = ("obj", "off", "ply", "stl", "glb", "gltf", "3mf")


def in_words(data: bytes, name: str | None = None) -> str | None:
    """What the file is and what to do, in two sentences, by its first bytes and then its name; None if unknown."""
    for pattern, what, advice in _SIGNATURES:
        if re.match(pattern, data, re.DOTALL):
            return f"The file is {what}. {advice}"
    root = _XML_ROOT.match(data[:4096].removeprefix(b"\xef\xbb\xbf"))
    if root is not None:
        tag = (root.group(1) or root.group(2)).decode("latin-1")
        if tag in _ROOTS:
            what, advice = _ROOTS[tag]
            return f"The file is {what}. {advice}"
    suffix = PurePath(name).suffix.lower().removeprefix(".") if name else ""
    if suffix in _SUFFIXES:
        what, advice = _SUFFIXES[suffix]
        return f"The name says that the file is {what}. {advice}"
    return None


def archive_in_words(names: Iterable[str]) -> str:
    """What a zip archive without a 3D model seems to be, by the names of its files, and what to do."""
    listed = list(names)
    suffixes = {PurePath(name).suffix.removeprefix(".") for name in listed}
    meshes = [name for name in listed if PurePath(name).suffix.removeprefix(".") in _PARTS]
    if len(meshes) == 1:
        shown = PurePath(meshes[0]).name[:60]
        return f"The file is a zip archive that holds the mesh {shown!r}. Unpack it and send that file."
    if meshes:
        return (
            f"The file is a zip archive that holds {len(meshes)} meshes. Unpack it and send each as a shape of its own."
        )
    for suffix in ("usdc", "usda", "dae", "amf", "fbx", "step", "stp", "brep"):
        if suffix in suffixes:
            what, advice = _SUFFIXES[suffix]
            return f"The file is a zip archive that holds {what}. {advice}"
    return "The archive holds no 3D model (no file 3D/3dmodel.model); is it a 3MF file?"
