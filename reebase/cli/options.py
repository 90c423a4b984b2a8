"""Options that several commands share, so that they read the same everywhere."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from reebase.denoise import METHODS
from reebase.pipeline import PROFILES, Profile, profile_named

DEFAULT = Profile()
URL = "http://127.0.0.1:8000"

Named = Annotated[
    str,
    typer.Option("--profile", help=f"Where an option is not given, its value is from: {' or '.join(PROFILES)}."),
]
Bands = Annotated[int, typer.Option(help="Bands of the Reeb graph.", min=2, max=1024)]
Levels = Annotated[str, typer.Option(help="Bands of equal area, or of equal width in the field: area or width.")]
Denoise = Annotated[str, typer.Option(help=f"Denoising filter: none, {', '.join(sorted(METHODS))}.")]
Iterations = Annotated[int, typer.Option(help="Iterations of the filter.", min=1)]
Threshold = Annotated[float, typer.Option(help="Branches with less than this share are pruned.", min=0.0, max=0.99)]
Saliency = Annotated[str, typer.Option(help="What a branch's share is of: area or length.")]
Field = Annotated[str, typer.Option(help="fiedler, eigenfunction:K, auto_diffusion:T, geodesic_integral or height.")]
Area = Annotated[str, typer.Option(help="Node area: band or ring.")]
Operator = Annotated[str, typer.Option(help="Laplace-Beltrami operator: auto, cotangent or tufted.")]
Components = Annotated[
    str, typer.Option(help="Of a shape in several parts: joined, the skeleton of all, or largest, of the largest part.")
]
Root = Annotated[str, typer.Option(help="The root node: median, or centroid as in the thesis.")]
Labels = Annotated[
    Path | None,
    typer.Option(
        help="CSV with the columns file, label; by default DIR/labels.csv. Without one, the folder that holds a file "
        "is its label, however deep, and a file directly in DIR has none."
    ),
]
JsonOut = Annotated[
    Path | None, typer.Option("--json", help="Write the result as JSON here; - is standard output, without the table.")
]
Url = Annotated[str, typer.Option(help="Where the service answers.", envvar="REEBASE_URL")]
Key = Annotated[
    str | None,
    typer.Option(help="API key, where the service wants one.", envvar="REEBASE_API_KEY", show_envvar=True),
]


def profile(context: typer.Context, named: str) -> Profile:
    """The named profile with the parameters that were given on the command line. Raises UnknownName, ParameterError."""
    given = {
        field.name: context.params[field.name]
        for field in dataclasses.fields(Profile)
        if (source := context.get_parameter_source(field.name)) is not None and source.name != "DEFAULT"
    }
    return dataclasses.replace(profile_named(named), **given)
