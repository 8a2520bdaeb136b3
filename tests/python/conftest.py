from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import twofold

SCENE = "synthetic:desk?frames=40&width=320&height=240"


@pytest.fixture(scope="session")
def frames() -> list[twofold.Frame]:
    return list(twofold.Source(SCENE))


@pytest.fixture(scope="session")
def rig() -> twofold.CameraRig:
    return twofold.Source(SCENE).rig


@pytest.fixture(scope="session")
def finished() -> Iterator[twofold.Run]:
    """A run that is over."""
    run = twofold.run(SCENE, mode=twofold.RunMode.DETERMINISTIC)
    for _ in run:
        pass
    yield run


def grey(height: int, width: int) -> NDArray[np.uint8]:
    return (np.arange(height * width) % 251).astype(np.uint8).reshape(height, width)


@pytest.fixture
def stereo_yaml(tmp_path: Path) -> Path:
    file = tmp_path / "stereo.yaml"
    file.write_text(
        "sensor: stereo\nbaseline: 0.1\ncameras:\n  - size: [64, 48]\n    intrinsics: [50, 50, 31.5, 23.5]\n"
    )
    return file
