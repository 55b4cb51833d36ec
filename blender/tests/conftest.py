"""Installs the packed extension into Blender as a user would, once, and gives each test an empty scene."""

import os
import sys

import bpy
import numpy as np
import pytest


def pytest_configure(config):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    result = bpy.ops.extensions.package_install_files(
        filepath=os.environ["IMPINGE_EXTENSION"], repo="user_default", enable_on_install=True, overwrite=True
    )
    assert result == {"FINISHED"}, result


def pytest_sessionfinish(session, exitstatus):
    session.config.exit_status = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    # After a mesh of a million triangles the module bpy 4.5 hangs at exit, in the destructor of a condition on which a thread of its own
    # still waits.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(getattr(config, "exit_status", 1))


@pytest.fixture(autouse=True)
def scene():
    """The only scene, emptied."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    from bl_ext.user_default.impinge import state

    state.running = None
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 20
    return scene


@pytest.fixture
def add():
    """Adds an object from vertices and polygons."""

    def add(name, vertices, polygons, location=(0, 0, 0)):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(map(float, vertex)) for vertex in vertices], [], [tuple(map(int, polygon)) for polygon in polygons])
        made = bpy.data.objects.new(name, mesh)
        made.location = location
        bpy.context.scene.collection.objects.link(made)
        bpy.context.view_layer.objects.active = made
        made.select_set(True)
        return made

    return add


CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


@pytest.fixture
def cube(add):
    """Adds a cube of the given half edge, of six quads."""

    def cube(name, location=(0, 0, 0), half=1.0):
        return add(name, CUBE * half, SIDES, location)

    return cube


@pytest.fixture
def grid(add):
    """Adds a sheet of n by n quads over the unit square, in the plane z = 0."""

    def grid(name, n=8, height=lambda x, y: 0 * x):
        x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij"))
        at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
        quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
        return add(name, np.stack([x, y, height(x, y)], axis=1), quads)

    return grid
