from __future__ import annotations

import numpy as np
import pytest

from reebase.denoise import add_noise, denoise
from reebase.mesh.mesh import Mesh
from tests.oracles import denoise as oracle
from tests.shapes import cylinder, icosphere, moebius, tetrahedron, torus

SHAPES = {"sphere": icosphere(2), "torus": torus(nu=20, nv=12), "cylinder": cylinder(), "moebius": moebius()}


@pytest.mark.parametrize("step", [1.0, 0.3])
@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_the_kernel_equals_its_slow_twin(mesh: Mesh, step: float) -> None:
    noisy = add_noise(mesh, 0.3, "isotropic", seed=11)
    found = denoise(noisy, "laplacian", boundary="free", step=step).vertices
    assert found == pytest.approx(oracle.laplacian(noisy, step), abs=1e-12)


def test_a_tetrahedron_turns_inside_out_at_a_third() -> None:
    """Each vertex goes to the mean of the other three: v -> -v / 3 about the centre."""
    found = denoise(tetrahedron(), "laplacian").vertices
    assert found == pytest.approx(-tetrahedron().vertices / 3, abs=1e-15)


def test_three_quarters_of_the_step_collapse_a_tetrahedron() -> None:
    found = denoise(tetrahedron(), "laplacian", step=0.75).vertices
    assert np.abs(found).max() < 1e-15
