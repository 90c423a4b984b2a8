"""`reebase denoise`: one mesh in, one mesh out, with noise taken from it or added to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reebase.cli.output import STDOUT, Step, check_picture, check_target, progress, results, shown, write_bytes
from reebase.denoise import METHODS
from reebase.errors import ParameterError

if TYPE_CHECKING:
    from reebase.mesh.mesh import Mesh

__all__ = ["EPILOG", "denoise"]

EPILOG = "\n\n".join(["Methods:", *(f"{entry.name}: {entry.summary}" for entry in METHODS.values())])
"""Shown below the options."""


def denoise(
    mesh: Annotated[Path, typer.Argument(help="A mesh file.", exists=True, dir_okay=False)],
    target: Annotated[Path, typer.Argument(help="Write the result here; its suffix says the format.")],
    method: Annotated[
        str, typer.Option(help="How; 'none' leaves the mesh, to add noise only. The methods are below.")
    ] = "auto",
    iterations: Annotated[int, typer.Option(help="Iterations.", min=1, max=1000)] = 1,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the method; repeatable.")
    ] = None,
    boundary: Annotated[str, typer.Option(help="Boundary vertices: along their curve, fixed or free.")] = "curve",
    noise: Annotated[
        float | None, typer.Option(help="First add noise of this standard deviation, in mean edge lengths.", min=0.0)
    ] = None,
    kind: Annotated[str, typer.Option(help="Kind of noise: normal, hadamard or isotropic.")] = "normal",
    seed: Annotated[int, typer.Option(help="Seed of the noise.", min=0)] = 0,
    truth: Annotated[
        Path | None, typer.Option(help="The true mesh, with the same faces: print errors.", exists=True, dir_okay=False)
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a picture before and after (.png or .svg).")] = None,
) -> None:
    """Take noise from a mesh, or add some.

    With --noise and without --truth the mesh itself is the truth. Exit code 0: written. 2: a mesh or an option was
    refused.
    """
    from reebase.denoise import add_noise, apply_choice, choose, joined_soup
    from reebase.denoise import denoise as filtered
    from reebase.denoise.errors import same_faces
    from reebase.errors import unknown_name
    from reebase.mesh.read import read
    from reebase.mesh.write import WRITTEN, to_bytes

    check_target(target)
    if target == STDOUT or not target.suffix:
        raise ParameterError(f"{shown(target.name)} has no suffix that names a format, such as .ply or .off.")
    if target.suffix[1:].lower() not in WRITTEN:
        raise unknown_name("format to write", target.suffix[1:], WRITTEN)
    image = check_picture(picture)
    if method != "none":
        parameters = _parameters(method, set_ or [])
    elif set_:
        raise ParameterError("The method none has no parameters; leave --set out.")
    before = joined_soup(read(mesh))
    true = joined_soup(read(truth)) if truth is not None else before if noise is not None else None
    if noise is not None:
        before = add_noise(before, noise, kind, seed)
    if true is not None:
        same_faces(true, before)

    out = results()
    with progress() as begin:
        choice = choose(before, progress=_share(begin("choosing", 100))) if method == "auto" else None
        if method == "none":
            after = before
        elif choice is not None and iterations == 1:
            after = apply_choice(before, choice, boundary, progress=_share(begin("denoising", 100)))
        else:
            tell = _share(begin("denoising", 100))
            after = filtered(before, method, iterations, boundary=boundary, progress=tell, **parameters)
    if choice is not None:
        out.print(_said(choice))
    errors = [] if true is None else [(name, _errors(true, found)) for name, found in _stages(before, after)]
    data = to_bytes(after, target.suffix[1:].lower())
    drawn = None if picture is None else _drawn(before, after, image)
    write_bytes(target, data)
    if picture is not None and drawn is not None:
        write_bytes(picture, drawn)
    out.print(f"{shown(target.name)}: {len(after.vertices)} vertices, {len(after.faces)} faces")
    for name, values in errors:
        out.print(f"{name}: {', '.join(values)}")


def _share(step: Step) -> Callable[[float], None]:
    """Tells a step the share that is done, in percent."""
    return lambda share: step.update(int(100 * share))


def _parameters(method: str, given: list[str]) -> dict[str, Any]:
    """Parameters of a method from NAME=VALUE. Raises UnknownName, ParameterError."""
    from reebase.errors import unknown_name

    if method not in METHODS:
        raise unknown_name("method", method, ("none", *METHODS))
    found = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise ParameterError(f"--set takes NAME=VALUE; found {shown(text)!r}.", parameter="set", found=text)
        found[name] = _value(value)
    METHODS[method].checked(found)
    return found


def _value(text: str) -> str | bool | int | float:
    """A truth value, a whole number, a number, or the text itself."""
    if text.lower() in {"true", "false"}:
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _said(choice: Any) -> str:
    """A choice as options of this command, and its reason."""
    lines = []
    for part in choice.parts:
        options = "".join(f" --set {name}={value}" for name, value in part.parameters.items())
        lines.append(f"{part.share:.0%} of --method {part.method} --iterations {part.iterations}{options}")
    return "\n  ".join([f"auto: {lines[0] if lines else '--method none'}", *lines[1:], choice.reason])


def _stages(before: Mesh, after: Mesh) -> list[tuple[str, Mesh]]:
    return [("before", before)] if after is before else [("before", before), ("after", after)]


def _errors(truth: Mesh, found: Mesh) -> list[str]:
    """Every measure, with its unit. Raises ParameterError when the faces differ."""
    from reebase.denoise import measure_errors

    errors = measure_errors(truth, found)
    return [
        f"angle {errors.mean_angle:.2f} degrees",
        *([] if errors.edge_angle is None else [f"at sharp edges {errors.edge_angle:.2f} degrees"]),
        f"face normals {errors.face_normal_error:.4f}",
        f"visual {errors.visual_error:.4f} squared mean edges",
        f"displacement {errors.displacement:.4f} mean edges",
        f"distance {100 * errors.vertex_error:.4f} % of the diagonal",
        "volume not enclosed" if errors.volume_change is None else f"volume {errors.volume_change:+.3f} %",
    ]


def _drawn(before: Mesh, after: Mesh, kind: str) -> bytes:
    from reebase.pictures import Panel, contact_sheet

    panels = [Panel(found, title=name) for name, found in _stages(before, after)]
    return contact_sheet(panels, len(panels), size=640, format=kind)
