"""The Magic Formula 5.2 beside that of the package commonroad-vehicle-models, written by others."""

from __future__ import annotations

import dataclasses
import itertools

import pytest
from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
from vehiclemodels.utils import tire_model

import atvrec

LOAD_N = 4000.0

# Terms that the package leaves out.
ABSENT = (
    "pex2 pex3 pex4 pkx2 pkx3 phx2 pey2 pey3 pey4 pky3 phy2 rex2 rey2 rhy2 rvy2"
).split()


def test_pure_and_combined_slip_with_camber_are_the_packages() -> None:
    # The package adds S_Vx inside the sine, where it does not belong.
    peer = dataclasses.replace(parameters_vehicle1().tire, p_vx1=0.0)
    coefficients = {
        name.replace("_", ""): value for name, value in dataclasses.asdict(peer).items()
    }
    # With P_KY2 = 1 the stiffness at the nominal load is P_KY1 F_z, as the package has it.
    coefficients |= dict.fromkeys(ABSENT, 0.0) | {"pky2": 1.0, "fnomin": LOAD_N}
    tyre = atvrec.Tyre.magic_formula_52(coefficients)
    angles, slips = (-0.3, -0.05, 0.0, 0.02, 0.2), (-0.5, -0.03, 0.0, 0.04, 0.6)
    for angle, slip, camber in itertools.product(angles, slips, (1e-4, 0.03, 0.08)):
        forces = tyre.forces(LOAD_N, angle, slip, camber)
        # Its longitudinal formula counts braking slip.
        pull = tire_model.formula_longitudinal(-slip, camber, LOAD_N, peer)
        pull = tire_model.formula_longitudinal_comb(slip, angle, pull, peer)
        side, friction = tire_model.formula_lateral(angle, camber, LOAD_N, peer)
        side = tire_model.formula_lateral_comb(slip, angle, camber, friction, LOAD_N, side, peer)
        assert float(forces["longitudinal_n"]) == pytest.approx(pull, abs=1e-8)
        assert float(forces["lateral_n"]) == pytest.approx(side, abs=1e-8)
