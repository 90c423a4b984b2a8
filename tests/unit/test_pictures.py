"""Pictures: files of the right kind and size, marks where they belong, and refusals that say what is missing."""

from __future__ import annotations

import io
import sys

import numpy as np
import numpy.typing as npt
import pytest

from reebase.errors import MissingPackage, NoFaces, ParameterError, UnknownName
from reebase.mesh.mesh import Mesh
from reebase.pictures import (
    HitPanel,
    Panel,
    View,
    answer_picture,
    contact_sheet,
    matrix_plot,
    picture,
    placed,
    precision_recall_plot,
)
from reebase.pictures.canvas import PALETTE, printable
from reebase.skeleton.graph import Skeleton
from reebase.warm import sample
from tests.shapes import capsule, flipped, grid, icosphere, moved, torus

PNG = b"\x89PNG\r\n\x1a\n"
CURVES = {"matching": ([0.0, 0.5, 1.0], [1.0, 0.8, 0.4]), "literal": ([0.0, 0.5, 1.0], [0.7, 0.5, 0.2])}


def pixels(data: bytes) -> npt.NDArray[np.float64]:
    """Rows from the top, (h, w, 3), in [0, 1]."""
    from matplotlib.image import imread

    return np.asarray(imread(io.BytesIO(data), format="png"))[:, :, :3].astype(float)


def colour(code: str) -> npt.NDArray[np.float64]:
    return np.array([int(code[at : at + 2], 16) for at in (1, 3, 5)]) / 255


def path(positions: list[list[float]]) -> Skeleton:
    """A chain of nodes; its endpoints are the first and the last."""
    nodes = np.array(positions, dtype=float)
    count = len(nodes)
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1).astype(np.int32)
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    ones = np.ones(count)
    return Skeleton(
        positions=nodes, areas=ones, ring_areas=ones, bands=np.arange(count, dtype=np.int32), edges=edges,
        lengths=lengths, endpoints=np.array([0, count - 1], dtype=np.int32), root=count // 2,
    )  # fmt: skip


def long_mesh() -> tuple[Mesh, Skeleton]:
    mesh = capsule()
    along = int(np.argmax(np.ptp(mesh.vertices, axis=0)))
    middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2
    reach = np.ptp(mesh.vertices, axis=0)[along] * 0.45
    steps = [-1.0, -0.4, 0.0, 0.5, 1.0]
    return mesh, path([list(middle + step * reach * np.eye(3)[along]) for step in steps])


def test_a_picture_is_a_png_of_that_size_with_something_on_white() -> None:
    data = picture(torus(), size=200, title="torus")
    assert data.startswith(PNG)
    image = pixels(data)
    assert image.shape == (200, 200, 3)
    assert (image[0, 0] == 1).all()
    assert 0.2 < (image.min(axis=2) < 0.95).mean() < 0.8


def test_an_svg_picture_is_an_svg() -> None:
    assert b"<svg" in picture(icosphere(1), size=64, format="svg")


@pytest.mark.parametrize("format", ["png", "svg"])
def test_the_same_input_gives_the_same_bytes(format: str) -> None:
    mesh, skeleton = long_mesh()
    first, second = (picture(mesh, skeleton, size=128, format=format) for _ in range(2))
    assert first == second
    assert precision_recall_plot(CURVES, format=format) == precision_recall_plot(CURVES, format=format)


def test_a_closed_surface_fills_its_panel_up_to_the_margin() -> None:
    seen = placed(icosphere(3), icosphere(3).vertices, 100)
    assert np.abs(seen[:, :2].min() - 8) < 0.5
    assert np.abs(seen[:, :2].max() - 92) < 0.5


@pytest.mark.parametrize("view", [None, "principal", "upright"])
def test_endpoints_are_drawn_where_they_project(view: str | None) -> None:
    mesh, skeleton = long_mesh()
    size = 512
    image = pixels(picture(mesh, skeleton, size=size, view=view))
    ends = placed(mesh, skeleton.positions[skeleton.endpoints], size, view)[:, :2]
    for number, (x, y) in enumerate(ends):
        # The numeral covers the centre; the disc is around it.
        around = image[size - 1 - int(y) - 7 : size - int(y) + 7, int(x) - 7 : int(x) + 8].reshape(-1, 3)
        assert (np.abs(around - colour(PALETTE[number])).max(axis=1) < 0.03).mean() > 0.3
    for number in range(2):
        anywhere = np.abs(image - colour(PALETTE[number])).max(axis=2) < 0.03
        rows, columns = np.nonzero(anywhere)
        assert np.hypot(columns - ends[number][0], size - 1 - rows - ends[number][1]).max() < 14


def test_endpoints_at_one_place_keep_a_disc_each() -> None:
    mesh, skeleton = long_mesh()
    skeleton = path([skeleton.positions[0].tolist(), skeleton.positions[2].tolist(), skeleton.positions[0].tolist()])
    image = pixels(picture(mesh, skeleton, size=512))
    areas = [(np.abs(image - colour(PALETTE[number])).max(axis=2) < 0.03).sum() for number in range(2)]
    assert min(areas) > 0.7 * max(areas)


def test_principal_axes_do_not_depend_on_how_the_mesh_lies() -> None:
    mesh = Mesh(icosphere(3).vertices * [3.0, 2.0, 1.0] + 0.3 * icosphere(3).vertices ** 2, icosphere(3).faces)
    turned = moved(mesh, (5, -3, 2), scale=7.0, seed=4)
    np.testing.assert_allclose(
        placed(mesh, mesh.vertices, 100)[:, :2], placed(turned, turned.vertices, 100)[:, :2], atol=1e-6
    )  # fmt: skip


@pytest.mark.parametrize("scale", [1e-160, 1e-12, 1e12, 1e150])
def test_the_unit_does_not_matter(scale: float) -> None:
    mesh = sample()
    seen = placed(Mesh(mesh.vertices * scale, mesh.faces), mesh.vertices * scale, 64)
    np.testing.assert_allclose(seen, placed(mesh, mesh.vertices, 64), atol=1e-6)


def test_upright_has_z_up_and_the_viewer_in_front() -> None:
    frame = View.upright().frame
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)
    assert frame[2, 0] == 0
    assert frame[2, 1] > 0.9
    assert frame[0, 2] > 0


def test_scalars_are_diverging_around_zero_viridis_else_and_grey_where_unknown() -> None:
    from matplotlib import colormaps

    mesh = grid(8, 8)
    view = View(np.eye(3))

    def middle_of(scalar: npt.NDArray[np.float64], x: float) -> npt.NDArray[np.float64]:
        found: npt.NDArray[np.float64] = pixels(picture(mesh, scalar=scalar, size=200, view=view))[100, int(x * 200)]
        return found / found.max()

    x = mesh.vertices[:, 0]
    signed = 2 * (x - x.min()) / np.ptp(x) - 1
    left, right = middle_of(signed, 0.12), middle_of(signed, 0.88)
    assert left[2] > left[0] + 0.3
    assert right[0] > right[2] + 0.3
    high = np.array(colormaps["viridis"](1.0)[:3])
    np.testing.assert_allclose(middle_of(signed + 1.5, 0.915), high / high.max(), atol=0.12)
    unknown = middle_of(np.where(signed > 0, np.nan, 1.0), 0.8)
    assert np.ptp(unknown) < 0.02
    assert np.ptp(middle_of(np.full(len(x), np.nan), 0.5)) < 0.02
    assert np.ptp(middle_of(np.full(len(x), 3.0), 0.5)) > 0.1


def test_open_surfaces_are_seen_from_behind_and_inverted_ones_from_outside() -> None:
    behind = View(np.diag([-1.0, 1.0, -1.0]))
    assert (pixels(picture(grid(4, 4), size=64, view=behind)).min(axis=2) < 0.95).mean() > 0.4
    ball = icosphere(2)
    inverted, outward = (pixels(picture(mesh, size=64))[12:-12, 12:-12] for mesh in (flipped(ball), ball))
    assert np.abs(inverted - outward).mean() < 0.02


def test_a_mesh_of_one_flat_point_is_drawn_as_nothing() -> None:
    point = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    assert (pixels(picture(point, size=64)) == 1).mean() > 0.9


def test_a_contact_sheet_has_rows_of_panels_with_titles() -> None:
    panels = [Panel(icosphere(1), title=f"sphere {number}", subtitle="round") for number in range(5)]
    image = pixels(contact_sheet(panels, columns=2, size=100, title="Spheres"))
    assert image.shape == (44 + 3 * (100 + 2 * 26), 200, 3)
    last = image[-100:]
    assert (last[:, :100].min(axis=2) < 0.9).mean() > 0.3
    assert (last[:, 100:] == 1).all()
    assert pixels(contact_sheet(panels[:4], size=50)).shape == (2 * (50 + 52), 100, 3)


def test_an_answer_colours_matched_endpoints_alike_and_the_others_grey() -> None:
    mesh, skeleton = long_mesh()
    query = Panel(mesh, skeleton, title="query")
    hits = [HitPanel(Panel(mesh, skeleton, title="crossed"), 0.25, ((0, 1),)), HitPanel(Panel(mesh), 0.5)]
    size = 256
    image = pixels(answer_picture(query, hits, columns=3, size=size))
    assert image.shape == (size + 52, 3 * size, 3)
    ends = placed(mesh, skeleton.positions[skeleton.endpoints], size)[:, :2]

    def near(panel: int, end: int, code: str) -> float:
        x, y = ends[end]
        row, column = image.shape[0] - 1 - int(y), panel * size + int(x)
        patch = image[row - 6 : row + 7, column - 6 : column + 7].reshape(-1, 3)
        return float((np.abs(patch - colour(code)).max(axis=1) < 0.03).mean())

    assert near(0, 0, PALETTE[0]) > 0.2
    assert near(0, 1, PALETTE[1]) > 0.2
    assert near(1, 1, PALETTE[0]) > 0.2
    assert near(1, 0, "#9aa3ab") > 0.2


def test_plots_are_files_of_their_kind() -> None:
    assert pixels(precision_recall_plot(CURVES, format="png", title="Curves")).shape == (480, 640, 3)
    svg = precision_recall_plot(CURVES)
    assert b"<svg" in svg
    assert b"matching" in svg
    values = np.abs(np.subtract.outer(np.arange(6.0), np.arange(6.0)))
    values[0, 5] = np.nan
    labels = ["ants", "ants", "crabs", "crabs", "hands", "hands"]
    assert pixels(matrix_plot(values, labels, title="D")).shape == (720, 720, 3)
    assert b"crabs" in matrix_plot(values, labels, format="svg")
    assert matrix_plot(np.zeros((1, 1)), ["one"], size=100).startswith(PNG)


def test_a_matrix_whose_values_crowd_is_coloured_by_rank() -> None:
    labels = ["ants"] * 3 + ["crabs"] * 3
    spread = np.abs(np.subtract.outer(np.arange(6.0), np.arange(6.0)))
    crowded = np.where(spread < 3, spread * 1e-3, 1000 + spread)
    assert b"rank of the dissimilarity" in matrix_plot(crowded, labels, format="svg")
    assert b"rank of the dissimilarity" not in matrix_plot(spread, labels, format="svg")
    # Ranks do not change where the order does not.
    assert matrix_plot(crowded, labels) == matrix_plot(spread, labels, ranks=True)
    assert matrix_plot(crowded, labels, ranks=False) != matrix_plot(crowded, labels)


def test_titles_fit_their_panel_and_survive_any_character() -> None:
    assert printable("two\nlines", 500, 10) == "two lines"
    assert len(printable("x" * 1000, 200, 10)) < 30
    assert printable("名 $a_b$", 500, 10) == "□ $a_b$"
    assert picture(icosphere(1), size=64, title="名 $\\frac{$ " + "x" * 1000).startswith(PNG)


@pytest.mark.parametrize(
    ("call", "error", "match"),
    [
        (lambda: picture(icosphere(1), size=3), ParameterError, "size"),
        (lambda: picture(icosphere(1), format="gif"), UnknownName, "png"),
        (lambda: picture(icosphere(1), view="sideways"), UnknownName, "upright"),
        (lambda: picture(icosphere(1), scalar=np.zeros(3)), ParameterError, "one value for each of the 42"),
        (lambda: picture(Mesh(np.zeros((3, 3)), np.empty((0, 3), dtype=int))), NoFaces, "drawn"),
        (lambda: View(np.ones((3, 3))), ParameterError, "rotation"),
        (lambda: contact_sheet([]), ParameterError, "at least one"),
        (lambda: contact_sheet([Panel(icosphere(1))], columns=0), ParameterError, "columns"),
        (lambda: answer_picture(Panel(icosphere(1)), [], columns=0), ParameterError, "columns"),
        (lambda: precision_recall_plot({}), ParameterError, "at least one"),
        (lambda: precision_recall_plot({"a": ([0.0], [])}), ParameterError, "1 recalls and 0 precisions"),
        (lambda: matrix_plot(np.zeros((2, 3)), ["a", "b"]), ParameterError, "square"),
        (lambda: matrix_plot(np.zeros((2, 2)), ["a"]), ParameterError, "labels"),
    ],
)  # fmt: skip
def test_refusals_name_the_cause(call: object, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        call()  # type: ignore[operator]


def test_without_matplotlib_the_missing_package_and_its_extra_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingPackage, match=r"reebase\[pictures\]"):
        picture(icosphere(1))


def test_global_settings_and_figures_are_left_alone() -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    had_pyplot = "matplotlib.pyplot" in sys.modules
    picture(icosphere(1), size=64, format="svg")
    precision_recall_plot(CURVES)
    assert dict(matplotlib.rcParams) == before
    assert ("matplotlib.pyplot" in sys.modules) == had_pyplot
