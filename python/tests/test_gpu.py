"""The GPU backend through the module. These tests fail where there is no adapter."""

import numpy as np
import pytest

import impinge
from shapes import ball, lattice_tetrahedra, soup


@pytest.fixture(scope="module")
def device():
    devices = impinge.devices()
    assert devices, "these tests need a GPU or a software driver"
    return devices[0]


def test_devices_say_what_they_are(device):
    assert device == impinge.devices()[0]
    assert device.name in repr(device)
    assert device.interface in ("vulkan", "metal", "dx12")
    assert device.driver and isinstance(device.is_software, bool)
    assert device.max_binding >= 1 << 27
    hardware = [not each.is_software for each in impinge.devices()]
    assert hardware == sorted(hardware, reverse=True)


@pytest.mark.parametrize("method", ["clusters", "cells"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_same_bytes_as_the_cpu(device, method, dtype):
    vertices, faces = ball()
    scene = impinge.Scene()
    scene.add(vertices.astype(dtype), faces)
    moving = scene.add(vertices.astype(dtype) + dtype(0.3), faces)
    scene.add(*soup(300, 0.2, 5, dtype))
    scene.add(*lattice_tetrahedra(100, 3, 4), kind="tetrahedra")
    gpu = impinge.Detector(method=method, backend="gpu", device=device.name)
    cpu = impinge.Detector("cpu")
    for shift in [0.3, 0.1]:
        scene.set_positions(moving, vertices.astype(dtype) + dtype(shift))
        answer, truth = gpu.detect(scene), cpu.detect(scene)
        assert len(truth) > 100
        assert answer.hash == truth.hash
        assert np.array_equal(answer.rows, truth.rows)
        assert answer.stats.backend == device.name
        assert truth.stats.backend == "cpu"


@pytest.mark.parametrize("backend", ["gpu", "auto"])
def test_a_device_that_is_not_there(backend):
    with pytest.raises(RuntimeError, match="no such adapter"):
        impinge.Detector(backend=backend, device="no such adapter")
    detector = impinge.Detector("cpu", device="no such adapter")
    assert detector.detect(impinge.Scene()).stats.backend == "cpu"
