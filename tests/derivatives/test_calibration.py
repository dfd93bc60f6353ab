"""Data of a scene from measured results."""

import numpy as np
import pytest
from mpi4py import MPI
from pushed_block import PRESSURE, block

from signorini_fx import Coulomb, SceneError, calibrate, sensitivity
from signorini_fx.errors import ResultError
from signorini_fx.scenes import cli

FRICTION, YOUNG = "contact[0].friction.coefficient", "material.young"
OF = ["force bottom x step 1", "force bottom x step 2", "mean right x step 2"]
LOADS = {
    "displacement": {"boundary": "left", "x": 0.02, "factors": [0.5, 1.0]},
    "traction": {"boundary": "top", "y": -PRESSURE},
}


@pytest.fixture(scope="module")
def measured():
    """What a scene with the coefficient 0.22 gives."""
    scene = block(6, LOADS)
    contact = scene.contact[0].model_copy(update={"friction": Coulomb(0.22)})
    found = sensitivity(
        scene.model_copy(update={"contact": contact}), OF, [FRICTION], MPI.COMM_SELF
    )
    return {each.of: each.value for each in found}


def test_data_are_found_again(measured):
    """Both, from other values; three results that fit leave no deviation."""
    found = calibrate(block(6, LOADS), measured, [FRICTION, YOUNG], MPI.COMM_SELF)
    assert found.values == pytest.approx({FRICTION: 0.22, YOUNG: 5000.0}, rel=1e-6)
    assert max(found.deviations.values()) < 1e-5
    assert found.scene.contact[0].friction.coefficient == found.values[FRICTION]


def test_deviation_of_forces_that_scatter(tmp_path, capsys):
    """The force of a block that slides is the coefficient times a load: its best value is the mean,
    its deviation that of a mean.
    """
    loads = LOADS | {"displacement": LOADS["displacement"] | {"factors": [0.6, 0.8, 1.0]}}
    forces = [0.21, 0.22, 0.26]
    whole = PRESSURE * 3.0
    rows = [
        f"force bottom x step {k + 1},{-share * whole},{0.01 * whole}"
        for k, share in enumerate(forces)
    ]
    file = tmp_path / "measured.csv"
    file.write_text("\n".join(["of,value,deviation", *rows]))
    found = calibrate(block(6, loads), file, [FRICTION], MPI.COMM_SELF)
    assert found.values[FRICTION] == pytest.approx(np.mean(forces), rel=1e-6)
    assert found.deviations[FRICTION] == pytest.approx(0.01 / np.sqrt(3.0), rel=1e-6)
    scene = tmp_path / "s.toml"
    scene.write_text(
        'mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 6, ny = 2 } }\n'
        "material = { young = 5000.0, poisson = 0.3 }\n"
        f'traction = {{ boundary = "top", y = {-PRESSURE} }}\n'
        'displacement = { boundary = "left", x = 0.02, factors = [0.6, 0.8, 1.0] }\n'
        'contact = { boundary = "bottom", friction = { law = "coulomb", coefficient = 0.3 } }\n'
    )
    assert cli.main(["calibrate", str(scene), str(file), "--by", FRICTION]) == 0
    assert f"{FRICTION} = 0.23 +- 0.0058" in capsys.readouterr().out


def test_what_cannot_be_found(measured, tmp_path):
    """More data than results, data without influence, and no table: an error names each."""
    scene = block(6, LOADS)
    forces = {name: value for name, value in measured.items() if name.startswith("force")}
    with pytest.raises(SceneError, match="by: 3 data need as many measured results"):
        calibrate(scene, forces, [FRICTION, YOUNG, "material.poisson"], MPI.COMM_SELF)
    with pytest.raises(SceneError, match=r"material\.young: no measured result depends on it"):
        calibrate(scene, forces, [FRICTION, YOUNG], MPI.COMM_SELF)
    (tmp_path / "m.csv").write_text("what,value\nx,1\n")
    with pytest.raises(ResultError, match="columns of and value are expected"):
        calibrate(scene, tmp_path / "m.csv", [FRICTION], MPI.COMM_SELF)
