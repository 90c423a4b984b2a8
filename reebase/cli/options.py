"""Options that several commands share, so that they read the same everywhere."""

from __future__ import annotations

from typing import Annotated

import typer

from reebase.pipeline import Profile

DEFAULT = Profile()

Bands = Annotated[int, typer.Option(help="Bands of the Reeb graph.", min=2, max=1024)]
Denoise = Annotated[str, typer.Option(help="Denoising filter, or 'none'.")]
Iterations = Annotated[int, typer.Option(help="Iterations of the filter.", min=1)]
Threshold = Annotated[float, typer.Option(help="Branches with less than this share are pruned.", min=0.0, max=1.0)]
Saliency = Annotated[str, typer.Option(help="What a branch's share is of: area or length.")]
Field = Annotated[str, typer.Option(help="Scalar field: fiedler, eigenfunction:K or height.")]
Area = Annotated[str, typer.Option(help="Node area: band or ring.")]
Measure = Annotated[str, typer.Option(help="Dissimilarity: matching, matching_mean, greedy or literal.")]
Url = Annotated[str, typer.Option(help="Where the service answers.", envvar="REEBASE_URL")]
Key = Annotated[str | None, typer.Option(help="API key, where the service wants one.", envvar="REEBASE_API_KEY")]
