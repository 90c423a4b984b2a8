"""Signatures against closed forms: traces, the sphere, and what must not change them."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError
from reebase.spectrum import eigenpairs, operator
from reebase.spectrum.eigen import Spectrum
from reebase.spectrum.signatures import heat_kernel_signature, wave_kernel_signature
from tests.shapes import capsule, icosphere

TIMES = np.array([0.002, 0.03, 0.3])
MESH = capsule()
OPERATOR = operator(MESH)
SPECTRUM = eigenpairs(OPERATOR, 30)
SHARES = OPERATOR.mass / OPERATOR.area


def test_the_mean_of_the_heat_signature_is_the_heat_trace():
    trace = np.exp(-np.outer(TIMES, SPECTRUM.eigenvalues)).sum(axis=1)
    np.testing.assert_allclose(SHARES @ heat_kernel_signature(SPECTRUM, TIMES), trace, rtol=1e-9)


def test_heat_signature_equals_the_sum_written_out():
    found = heat_kernel_signature(SPECTRUM, TIMES)
    for vertex in (0, 17):
        for column, t in enumerate(TIMES):
            terms = [np.exp(-value * t) * SPECTRUM.eigenvectors[vertex, i] ** 2
                     for i, value in enumerate(SPECTRUM.eigenvalues)]  # fmt: skip
            assert found[vertex, column] == pytest.approx(sum(terms), rel=1e-12)


def test_heat_falls_with_time_to_the_constant():
    found = heat_kernel_signature(SPECTRUM, [0.001, 0.01, 0.1, 1, 1000])
    assert (np.diff(found, axis=1) <= 1e-12).all()
    np.testing.assert_allclose(found[:, -1], 1.0, rtol=1e-9)


def test_both_are_constant_on_a_sphere():
    # 1 + 3 + 5 + 7 + 9 = 25 eigenpairs: whole multiplets, so no point is told from another.
    mesh = icosphere(4)
    spectrum = eigenpairs(operator(mesh), 25)
    heat = heat_kernel_signature(spectrum, TIMES)
    exact = sum((2 * l + 1) * np.exp(-4 * np.pi * l * (l + 1) * TIMES) for l in range(5))  # noqa: E741 - the degree
    np.testing.assert_allclose(heat, np.broadcast_to(exact, heat.shape), rtol=0.02)
    np.testing.assert_allclose(wave_kernel_signature(spectrum), 1.0, rtol=0.03)


def test_the_mean_of_the_wave_signature_is_one():
    np.testing.assert_allclose(SHARES @ wave_kernel_signature(SPECTRUM, 12), 1.0, rtol=1e-9)


def test_a_wave_of_one_energy_sees_the_eigenfunction_of_that_energy():
    narrow = wave_kernel_signature(SPECTRUM, 2, 1e-3)
    np.testing.assert_allclose(narrow[:, 0], SPECTRUM.eigenvectors[:, 1] ** 2, rtol=1e-9, atol=1e-12)


def test_signs_make_no_difference():
    signs = np.where(np.arange(30) % 3, 1.0, -1.0)
    turned = Spectrum(SPECTRUM.eigenvalues, SPECTRUM.eigenvectors * signs)
    np.testing.assert_array_equal(heat_kernel_signature(turned, TIMES), heat_kernel_signature(SPECTRUM, TIMES))
    np.testing.assert_array_equal(wave_kernel_signature(turned), wave_kernel_signature(SPECTRUM))


@pytest.mark.parametrize("times", [[-1.0], [np.nan], [np.inf], [[1.0, 2.0]]])
def test_refuses_times_that_are_none(times):
    with pytest.raises(ParameterError, match="times"):
        heat_kernel_signature(SPECTRUM, times)


def test_refuses_a_wave_that_cannot_be():
    with pytest.raises(ParameterError, match="two eigenpairs"):
        wave_kernel_signature(eigenpairs(OPERATOR, 1))
    for energies, width in ((0, 0.07), (4, 0.0), (4, np.nan)):
        with pytest.raises(ParameterError, match="positive"):
            wave_kernel_signature(SPECTRUM, energies, width)
