"""The extension as it was packed and installed: known scenes, transforms, modifiers, modes, animations, and stopping."""

import re
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import bmesh
import bpy
import impinge
import numpy as np
import pytest
from bl_ext.user_default.impinge import bodies, job, meshes, places, question, state, text
from bl_ext.user_default.impinge.operators import scan, waiting
from conftest import CUBE, SIDES
from mathutils import Matrix


def check(which="ACTIVE", **options):
    """Presses Check, and gives what was found."""
    settings = bpy.context.scene.impinge
    settings.which = which
    for name, value in options.items():
        setattr(settings, name, value)
    assert bpy.ops.impinge.check() == {"FINISHED"}
    assert state.running is None
    return state.found.answer


def scene_of(*objects):
    """Pairs of triangles of two evaluated objects, by the module itself: what the extension must find."""
    arrays = []
    for object in objects:
        mesh = object.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        vertices = np.array([object.matrix_world @ vertex.co for vertex in mesh.vertices], np.float64)
        arrays += [vertices, np.array([triangle.vertices[:] for triangle in mesh.loop_triangles])]
    return impinge.pairs(*arrays)


def selected(object):
    return [polygon.index for polygon in object.data.polygons if polygon.select]


def test_the_wheel_comes_with_the_extension():
    import os

    assert os.path.realpath(impinge.__file__).startswith(os.path.realpath(os.environ["BLENDER_USER_RESOURCES"]))
    assert hasattr(bpy.types, "IMPINGE_PT_check") and "impinge" in bpy.types.Scene.bl_rna.properties


# A known scene.


def test_two_cubes(cube):
    a, b = cube("a"), cube("b", (1.5, 1.5, 1.5))
    answer = check("BETWEEN")
    assert answer.n_pairs == len(scene_of(a, b)) > 0
    # Three faces of each meet at the corner.
    assert answer.faces["a"].tolist() == [1, 3, 5] and answer.faces["b"].tolist() == [0, 2, 4]
    [place] = answer.places
    assert place.names == ("a", "b") and place.n_pairs == answer.n_pairs
    assert np.all(np.abs(place.position - 0.75) < 0.3) and 0.4 < place.radius < 1.0
    assert text.of_answer(answer, state.found.question) == f"{answer.n_pairs} pairs of 24 triangles in 1 place"
    assert text.lines_of_answer(answer, state.found.question) == [f"{answer.n_pairs} pairs in 1 place", "of 24 triangles"]
    assert text.lines_of_place(place, str) == ["a and", "b", f"{answer.n_pairs} pairs"]


def test_touching_counts_and_a_gap_does_not(cube):
    cube("a")
    b = cube("b", (2, 0, 0))
    assert check("BETWEEN").n_pairs > 0
    # The smallest gap that the numbers have.
    b.location.x = float(np.nextafter(np.float32(2), np.float32(3)))
    bpy.context.view_layer.update()
    answer = check("BETWEEN")
    assert answer.n_pairs == 0 and answer.places == [] and not any(map(len, answer.faces.values()))


def test_which_pairs(cube, add):
    # The second object cuts through itself, and not through the first.
    cube("a")
    crossed = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, -1], [0.6, 0.5, 1], [0.5, 0.6, 1]]
    add("crossed", np.add(crossed, [5, 0, 0]), [(0, 1, 2), (3, 4, 5)])
    assert check("ACTIVE").n_pairs == 1
    assert check("BETWEEN").n_pairs == 0
    answer = check("ALL")
    assert answer.n_pairs == 1 and answer.faces["crossed"].tolist() == [0, 1] and len(answer.faces["a"]) == 0


def test_welding(cube):
    # The faces of a cube, each with corners of its own, as of an STL file.
    made = cube("a")
    mesh = bpy.data.meshes.new("apart")
    mesh.from_pydata(np.concatenate([CUBE[list(side)] for side in SIDES]).tolist(), [], [range(4 * i, 4 * i + 4) for i in range(6)])
    made.data = mesh
    assert check(weld=True).n_pairs == 0
    assert check(weld=False).n_pairs > 0


# Transforms and units.


def test_transforms(cube):
    a = cube("a")
    b = cube("b")
    parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(parent)
    b.parent = parent
    parent.matrix_world = Matrix.Translation((10, 0, 0)) @ Matrix.Rotation(0.7, 4, "Z") @ Matrix.Diagonal((3, -1, 0.5, 1))
    bpy.context.view_layer.update()
    assert check("BETWEEN").n_pairs == 0
    a.location = (8, 0, 0)
    bpy.context.view_layer.update()
    answer = check("BETWEEN")
    assert answer.n_pairs == len(scene_of(a, b)) > 0
    assert all(7 <= place.position[0] <= 13 for place in answer.places)


def test_the_place_of_a_self_intersection_is_in_the_world(add):
    vertices = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, -1], [0.6, 0.5, 1], [0.5, 0.6, 1]]
    made = add("a", vertices, [(0, 1, 2), (3, 4, 5)], (100, 200, 300))
    made.rotation_euler = (0, 0, np.pi / 2)
    made.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    [place] = check().places
    # About (0.53, 0.53, 0), turned by a quarter, twice as large.
    assert np.abs(place.position - [99, 201, 300]).max() < 0.2
    # The segment from (0.55, 0.5) to (0.5, 0.55), twice as large.
    assert place.radius == pytest.approx(0.0707, rel=0.01)


def test_a_transform_cannot_change_a_self_intersection(grid):
    # Faces that touch exactly, in a space that rounds.
    made = grid("a", 4, lambda x, y: np.where(x == 0.5, 0.25, 0))
    still = check().n_pairs
    made.matrix_world = Matrix.Translation((0.1, 0.2, 1000.3)) @ Matrix.Rotation(0.3, 4, (1, 2, 3)) @ Matrix.Scale(0.7, 4)
    bpy.context.view_layer.update()
    assert check().n_pairs == still == 0


def test_units(cube, scene):
    cube("a")
    cube("b", (2.01, 0, 0))
    scene.unit_settings.system, scene.unit_settings.scale_length = "METRIC", 0.001
    scene.impinge.which = "BETWEEN"
    # The property is in Blender's units, whatever the scene shows.
    scene.impinge.distance = 0.02
    assert bpy.ops.impinge.clearance() == {"FINISHED"}
    [place] = state.found.answer.places
    assert place.distance == pytest.approx(0.01, rel=1e-4)
    from bl_ext.user_default.impinge import panel

    assert panel.length(bpy.context, 0.02) == "20 µm"
    scene.unit_settings.system = "NONE"
    assert panel.length(bpy.context, 0.02) == "0.02"


# Clearance.


def test_clearance(cube, scene):
    cube("a")
    cube("b", (2.5, 0, 0))
    cube("c", (0, 20, 0))
    scene.impinge.which, scene.impinge.distance = "BETWEEN", 0.49
    bpy.ops.impinge.clearance()
    assert state.found.answer.n_pairs == 0
    assert text.of_answer(state.found.answer, state.found.question) == "none of 36 triangles is near"
    assert text.lines_of_answer(state.found.answer, state.found.question) == ["nothing is near", "of 36 triangles"]
    scene.impinge.distance = 0.5
    bpy.ops.impinge.clearance()
    answer = state.found.answer
    [place] = answer.places
    assert place.names == ("a", "b") and place.distance == 0.5 and abs(place.position[0] - 1.25) < 1e-6
    # All around the two sides has a near edge or vertex, but not the sides away.
    assert 1 in answer.faces["a"] and 0 in answer.faces["b"] and 0 not in answer.faces["a"] and 1 not in answer.faces["b"]


def test_clearance_within_one_object(grid, scene):
    # A sheet folded over: the two halves are 0.05 apart.
    made = grid("a", 20)
    for vertex in made.data.vertices:
        x = vertex.co.x
        if x > 0.5:
            vertex.co.x, vertex.co.z = 1 - x, 0.05
    scene.impinge.which, scene.impinge.distance, scene.impinge.rings = "ACTIVE", 0.051, 3
    bpy.ops.impinge.clearance()
    answer = state.found.answer
    assert answer.n_pairs > 100 and answer.places[0].distance == pytest.approx(0.05, rel=1e-5)
    scene.impinge.distance = 0.049
    bpy.ops.impinge.clearance()
    assert state.found.answer.n_pairs == 0


def test_components():
    generator = np.random.default_rng(1)
    for n, m in ((1, 0), (5, 3), (200, 150), (2000, 1900)):
        a, b = generator.integers(0, n, (2, m))
        label = list(range(n))
        for _ in range(n):
            before = list(label)
            for i, j in zip(a, b):
                label[i] = label[j] = min(label[i], label[j])
            if label == before:
                break
        assert places.components(n, a, b).tolist() == label
    chain = np.arange(9999)
    assert not places.components(10000, chain, chain + 1).any()


# Modifiers.


def test_modifiers_count(grid, cube):
    sheet = grid("sheet", 8)
    cube("cube", (0.5, 0.5, 1.2), 0.2)
    assert check("BETWEEN").n_pairs == 0
    modifier = sheet.modifiers.new("up", "DISPLACE")
    modifier.strength, modifier.direction = 1.1, "Z"
    modifier.mid_level = 0
    bpy.context.view_layer.update()
    answer = check("BETWEEN")
    assert answer.n_pairs > 0 and set(answer.faces["sheet"]) < set(range(64)) and len(answer.faces["sheet"])
    modifier.show_viewport = False
    bpy.context.view_layer.update()
    assert check("BETWEEN").n_pairs == 0


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_faces_that_modifiers_make_lead_back_to_their_own(grid, cube, mode):
    cube("cube", (0.05, 0.05, 0), 0.02)
    sheet = grid("sheet", 8)
    sheet.modifiers.new("finer", "SUBSURF").levels = 2
    array = sheet.modifiers.new("copies", "ARRAY")
    array.relative_offset_displace = (3, 0, 0)
    # The copy is hit in another face.
    cube("other", (3.55, 0.55, 0), 0.02)
    bpy.context.view_layer.objects.active = sheet
    bpy.ops.object.mode_set(mode=mode)
    answer = check("BETWEEN")
    # Quads are 1/8 wide: (0.05, 0.05) is in the first one, (0.55, 0.55) in column 4, row 4.
    assert answer.faces["sheet"].tolist() == [0, 4 * 8 + 4]
    assert answer.n_made == 0
    # Nothing is left in the user's mesh.
    bpy.ops.object.mode_set(mode="OBJECT")
    assert numbers_of(sheet) == []


def numbers_of(object):
    """The layers of an object's own mesh that are, or could be, ours."""
    return [attribute.name for attribute in object.data.attributes if attribute.name.startswith(meshes.NUMBER)]


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_a_layer_of_the_user_s_own_may_have_the_name_of_ours(grid, cube, mode):
    cube("cube", (0.05, 0.05, 0), 0.02)
    sheet = grid("sheet", 8)
    for name in (meshes.NUMBER, f"{meshes.NUMBER}_0"):
        sheet.data.attributes.new(name, "INT", "FACE").data.foreach_set("value", np.arange(64, 0, -1, dtype=np.int32))
    sheet.modifiers.new("finer", "SUBSURF").levels = 2
    bpy.ops.object.mode_set(mode=mode)
    assert check("BETWEEN").faces["sheet"].tolist() == [0]
    assert bpy.ops.impinge.select() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert numbers_of(sheet) == [meshes.NUMBER, f"{meshes.NUMBER}_0"]
    assert [row.value for row in sheet.data.attributes[numbers_of(sheet)[1]].data] == list(range(64, 0, -1))


def test_faces_that_a_modifier_takes_from_another_object_are_of_no_face(cube):
    other = cube("other", (0.5, 0.5, 0.5))
    a = cube("a")
    # Both meshes are numbered.
    other.modifiers.new("finer", "SUBSURF").levels = 1
    union = a.modifiers.new("union", "BOOLEAN")
    union.object, union.operation = other, "UNION"
    answer = check("BETWEEN")
    # The corner of the other one sticks out of three faces of this one.
    assert answer.faces["a"].tolist() == [1, 3, 5] and answer.n_made > 0


def test_faces_of_nothing_are_counted(cube):
    a = cube("a")
    cube("b", (1.5, 0, 0))
    # Remeshing hands no numbers on.
    modifier = a.modifiers.new("new", "REMESH")
    modifier.mode, modifier.voxel_size = "VOXEL", 0.25
    answer = check("BETWEEN")
    assert answer.n_pairs > 0 and answer.n_made > 0 and len(answer.faces["a"]) == 0 and len(answer.faces["b"]) > 0


def test_curves_take_part(cube):
    cube("cube")
    curve = bpy.data.curves.new("tube", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    line = curve.splines.new("POLY")
    line.points.add(1)
    line.points[0].co, line.points[1].co = (-3, 0.3, 0.2, 1), (3, 0.3, 0.2, 1)
    tube = bpy.data.objects.new("tube", curve)
    bpy.context.scene.collection.objects.link(tube)
    tube.select_set(True)
    answer = check("BETWEEN")
    assert len(answer.places) == 2 and answer.faces["cube"].tolist() == [0, 1]


# Edit Mode and selections.


def test_edit_mode_counts_selected_faces(cube, scene):
    cube("b", (1.5, 0, 0))
    cube("c", (-1.5, 0, 0))
    a = cube("a")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    everything = check("BETWEEN")
    edited = bmesh.from_edit_mesh(a.data)
    edited.faces.ensure_lookup_table()
    edited.faces[1].select_set(True)
    bmesh.update_edit_mesh(a.data)
    some = check("BETWEEN")
    assert 0 < some.n_pairs < everything.n_pairs
    assert some.faces["a"].tolist() == [1] and len(some.faces["c"]) == 0 and len(some.faces["b"])
    # The panel says so, for there may be more.
    assert text.lines_of_answer(some, state.found.question)[-1] == "selected faces only"
    assert text.of_answer(some, state.found.question).endswith(", selected faces only")
    assert "selected" not in text.of_answer(everything, state.found.question)
    assert check("BETWEEN", selected_only=False).n_pairs == everything.n_pairs
    # What was moved in Edit Mode is seen there.
    scene.impinge.selected_only = True
    for vertex in edited.verts:
        vertex.co.z += 100
    bmesh.update_edit_mesh(a.data)
    assert check("BETWEEN").n_pairs == 0


def select_face(object, face):
    """Enters Edit Mode, and selects this face alone."""
    bpy.context.view_layer.objects.active = object
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    edited = bmesh.from_edit_mesh(object.data)
    edited.faces.ensure_lookup_table()
    edited.faces[face].select_set(True)
    bmesh.update_edit_mesh(object.data)


@pytest.mark.parametrize("kind", ["TRIANGULATE", "BEVEL", "SOLIDIFY", "SUBSURF"])
def test_selected_faces_count_behind_modifiers(cube, kind):
    a = cube("a")
    cube("b", (1.5, 0, 0), 0.8)
    cube("c", (-1.5, 0, 0), 0.8)
    a.modifiers.new("modifier", kind)
    for face, hit, free in ((0, "c", "b"), (1, "b", "c")):
        select_face(a, face)
        answer = check("BETWEEN")
        assert answer.is_selected and answer.n_pairs > 0
        assert answer.faces["a"].tolist() == [face] and len(answer.faces[hit]) and not len(answer.faces[free])
    # Of the selected faces none intersects, and they still count alone.
    select_face(a, 2)
    answer = check("BETWEEN")
    assert answer.is_selected and answer.n_pairs == 0


def test_modifiers_whose_faces_come_from_no_selected_one_are_refused(cube):
    a = cube("a")
    cube("b", (1.5, 0, 0))
    modifier = a.modifiers.new("remesh", "REMESH")
    modifier.mode, modifier.show_in_editmode = "VOXEL", True
    select_face(a, 1)
    with pytest.raises(RuntimeError, match="Check: a: its modifiers make new faces"):
        check("BETWEEN")
    assert check("BETWEEN", selected_only=False).n_pairs > 0


def test_edit_mode_counts_selected_faces_that_are_near(cube, scene):
    cube("b", (2.1, 0, 0))
    cube("c", (-2.1, 0, 0))
    a = cube("a")
    scene.impinge.which, scene.impinge.distance = "BETWEEN", 0.15
    bpy.ops.impinge.clearance()
    everything = state.found.answer
    assert {frozenset(place.names) for place in everything.places} == {frozenset("ab"), frozenset("ac")}
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    edited = bmesh.from_edit_mesh(a.data)
    edited.faces.ensure_lookup_table()
    edited.faces[1].select_set(True)
    bmesh.update_edit_mesh(a.data)
    bpy.ops.impinge.clearance()
    [place] = state.found.answer.places
    assert set(place.names) == {"a", "b"} and 0 < place.n_pairs == state.found.answer.n_pairs < everything.n_pairs / 2


def test_select(cube):
    a, b = cube("a"), cube("b", (1.5, 1.5, 1.5))
    answer = check("BETWEEN")
    bpy.ops.object.select_all(action="DESELECT")
    assert bpy.ops.impinge.select() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH" and {o.name for o in bpy.context.objects_in_mode} == {"a", "b"}
    assert bpy.context.tool_settings.mesh_select_mode[:] == (False, False, True)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert selected(a) == answer.faces["a"].tolist() and selected(b) == answer.faces["b"].tolist()
    # Another mesh than the one that was checked, or as many faces in another order; nothing changes then, nor does the mode.
    for of_faces in (list(reversed(SIDES)), []):
        other = bpy.data.meshes.new("other")
        other.from_pydata(CUBE.tolist(), [], of_faces)
        a.data = other
        bpy.context.view_layer.objects.active = a
        bpy.ops.object.mode_set(mode="EDIT")
        with pytest.raises(RuntimeError, match="a has changed"):
            bpy.ops.impinge.select()
        assert bpy.context.mode == "EDIT_MESH"
        bpy.ops.object.mode_set(mode="OBJECT")


def test_select_knows_objects_by_more_than_their_names(cube, capfd):
    a, b = cube("a"), cube("b", (1.5, 1.5, 1.5))
    answer = check("BETWEEN")
    a.name, b.name = "c", "a"
    assert bpy.ops.impinge.select() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert selected(a) == answer.faces["a"].tolist() and selected(b) == answer.faces["b"].tolist()
    # Of two objects one is no longer there, and another one has its name.
    bpy.data.objects.remove(a)
    cube("a")
    capfd.readouterr()
    assert bpy.ops.impinge.select() == {"FINISHED"}
    assert "3 faces selected, a is no longer in the scene" in capfd.readouterr().out
    assert list(bpy.context.objects_in_mode) == [b]


def test_hidden_faces_are_counted_apart(cube):
    a = cube("a")
    cube("b", (1.5, 1.5, 1.5))
    hidden = np.zeros(6, bool)
    hidden[[1, 2]] = True
    a.data.polygons.foreach_set("hide", hidden)
    check("BETWEEN")
    assert state.found.answer.faces["a"].tolist() == [1, 3, 5]
    assert bpy.ops.impinge.select() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert selected(a) == [3, 5]


def test_linked_objects_may_have_the_same_name(cube, tmp_path):
    made = cube("same", (9, 0, 0))
    path = str(tmp_path / "other.blend")
    bpy.data.libraries.write(path, {made})
    bpy.data.objects.remove(made)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.objects = ["same"]
    [linked] = to.objects
    bpy.context.scene.collection.objects.link(linked)
    cube("same")
    linked.select_set(True)
    answer = check("BETWEEN")
    assert len(answer.names) == 2 and answer.n_pairs == 0 and answer.n_triangles == 24
    cube("third", (10.5, 1.5, 1.5))
    linked.select_set(True)
    assert check("BETWEEN").n_pairs > 0


def test_instances_are_not_looked_at_and_that_is_said(cube):
    a, b, part = cube("a"), cube("b", (5, 0, 0)), cube("part")
    collection = bpy.data.collections.new("parts")
    collection.objects.link(part)
    bpy.context.scene.collection.objects.unlink(part)
    instance = bpy.data.objects.new("instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(instance)
    for object in (a, b, instance):
        object.select_set(True)
    bpy.context.view_layer.update()
    answer = check("BETWEEN")
    assert answer.n_pairs == 0 and answer.instancers == ["instance"]
    asked = state.found.question
    assert text.besides(answer, asked) == ["instances of instance were not looked at"]
    assert text.lines_of_answer(answer, asked)[-1] == "instances not looked at"
    instance.select_set(False)
    answer = check("BETWEEN")
    assert answer.instancers == [] and text.besides(answer, asked) == []


def text_object(name, body="impinge"):
    """Adds a text of some thickness, selected and active."""
    curve = bpy.data.curves.new(name, "FONT")
    curve.body, curve.extrude = body, 0.3
    return added(name, curve)


def ball(name, location=(0, 0, 0)):
    """Adds a metaball, selected and active."""
    data = bpy.data.metaballs.new(name)
    data.elements.new()
    made = added(name, data)
    made.location = location
    return made


def added(name, data):
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    return made


def copies(kind):
    """What instances come from nodes: of another object, or of a mesh that is no object."""

    def inner(group):
        source = group.nodes.new("GeometryNodeObjectInfo" if kind == "object" else "GeometryNodeMeshCube")
        if kind == "object":
            source.inputs[0].default_value = bpy.data.objects["part"]
        points, instances, join = (group.nodes.new(f"GeometryNode{name}") for name in ("Points", "InstanceOnPoints", "JoinGeometry"))
        group.links.new(points.outputs[0], instances.inputs["Points"])
        group.links.new(source.outputs["Geometry" if kind == "object" else "Mesh"], instances.inputs["Instance"])
        group.links.new(instances.outputs[0], join.inputs[0])
        return join.inputs[0], join.outputs[0]

    return inner


def test_an_object_s_own_faces_are_no_instances_of_it(cube):
    cube("part", (9, 0, 0)).select_set(False)
    for object in (text_object("text"), ball("ball")):
        bpy.context.view_layer.objects.active = object
        answer = check("ACTIVE")
        assert answer.names == [object.name] and answer.n_triangles > 0 and answer.instancers == []
    # Real ones are still said, of any kind of object.
    for object in (cube("cube"), text_object("other")):
        bpy.context.view_layer.objects.active = object
        modifier = object.modifiers.new("nodes", "NODES")
        for kind in ("object", "mesh"):
            modifier.node_group = node_group(copies(kind))
            assert check("ACTIVE").instancers == [object.name]


def solid(grid, name="solid"):
    """A wave that cuts through itself only because a modifier makes it thick."""
    made = grid(name, 6, lambda x, y: np.sin(7 * x) * 0.3)
    made.modifiers.new("solid", "SOLIDIFY").thickness = 0.6
    return made


def test_a_disabled_active_object_is_refused(grid, scene):
    made = solid(grid)
    assert check("ACTIVE").n_pairs > 0
    inner = bpy.data.collections.new("inner")
    outer = bpy.data.collections.new("outer")
    scene.collection.children.link(outer)
    outer.children.link(inner)
    inner.objects.link(made)
    # Another object needs it, so that Blender keeps it evaluated, as it was.
    child = bpy.data.objects.new("child", None)
    scene.collection.objects.link(child)
    child.parent = made
    refused = "solid is disabled in the viewport, so that its modifiers are not evaluated"
    for press in (bpy.ops.impinge.check, bpy.ops.impinge.clearance, bpy.ops.impinge.scan):
        made.hide_viewport = True
        with pytest.raises(RuntimeError, match=refused):
            press()
        made.hide_viewport = False
    # It is in another collection that is not disabled.
    outer.hide_viewport = True
    assert check("ACTIVE").n_pairs > 0
    scene.collection.objects.unlink(made)
    with pytest.raises(RuntimeError, match=refused):
        bpy.ops.impinge.check()
    outer.hide_viewport, inner.hide_viewport = False, True
    with pytest.raises(RuntimeError, match=refused):
        bpy.ops.impinge.check()
    inner.hide_viewport = False
    # One of an excluded collection is not, and one that is only hidden in the view is evaluated.
    bpy.context.view_layer.layer_collection.children["outer"].exclude = True
    bpy.context.view_layer.layer_collection.children["outer"].children["inner"].exclude = False
    bpy.context.view_layer.objects.active = made
    made.hide_set(True)
    assert check("ACTIVE").n_pairs > 0


def test_disabled_objects_are_named(cube):
    objects = [cube(name, (x, 0, 0)) for name, x in (("a", 0), ("b", 1.5), ("c", 1.6))]
    objects[2].hide_viewport = True
    # Blender deselects it; a script can still ask about it.
    assert check("BETWEEN").names == ["a", "b"] and text.besides(state.found.answer, state.found.question) == []
    with bpy.context.temp_override(selected_objects=objects):
        answer = check("BETWEEN")
    assert answer.names == ["a", "b"] and set(answer.topology) == {"a", "b"} and answer.disabled == ["c"]
    assert text.besides(answer, state.found.question) == ["c is disabled in the viewport, and was not looked at"]
    assert text.lines_of_answer(answer, state.found.question)[-1] == "1 object disabled"
    objects[1].hide_viewport = True
    with bpy.context.temp_override(selected_objects=objects), pytest.raises(RuntimeError, match="select 2 or more objects .* 1 object"):
        bpy.ops.impinge.check()


def test_objects_without_faces_are_named(add, cube, scene, capfd):
    loose = add("loose", [[0, 0, 0], [1, 0, 0]], [])
    refused = "there is no active object with faces; loose has no faces"
    for press in (bpy.ops.impinge.check, bpy.ops.impinge.clearance):
        with pytest.raises(RuntimeError, match=refused):
            press()
    cube("a")
    scene.impinge.which = "BETWEEN"
    with pytest.raises(RuntimeError, match="1 object with faces is selected; loose has no faces"):
        bpy.ops.impinge.check()
    answer = check("ALL")
    asked = state.found.question
    assert text.whom(answer, asked) == "a with itself" and text.besides(answer, asked) == ["loose has no faces"]
    assert text.lines_of_answer(answer, asked)[-1] == "1 object without faces"
    cube("b", (1.5, 0, 0))
    answer = check("BETWEEN")
    assert text.whom(answer, asked) == "2 objects with each other and themselves" and answer.faceless == ["loose"]
    capfd.readouterr()
    assert bpy.ops.impinge.scan() == {"FINISHED"}
    assert "20 of 20 frames intersect, the first is 1; loose has no faces" in capfd.readouterr().out
    # One that has faces in some frames is not without.
    loose.data = bpy.data.objects["a"].data
    build = loose.modifiers.new("build", "BUILD")
    build.frame_start, build.frame_duration = 5, 10
    assert bpy.ops.impinge.scan() == {"FINISHED"}
    assert "no faces" not in capfd.readouterr().out


def test_the_first_metaball_has_the_faces_of_its_family(cube):
    cube("cube", (2.5, 0, 0)).select_set(False)
    ball("ball")
    ball("ball.001", (2.0, 0, 0))
    said = r"ball\.001 \(the first metaball of its family has the faces of all\) has no faces"
    with pytest.raises(RuntimeError, match=said):
        check("ACTIVE")
    bpy.data.objects["cube"].select_set(True)
    answer = check("BETWEEN")
    assert answer.names == ["cube", "ball"] and answer.n_pairs > 0
    assert len(answer.faceless) == 1 and answer.faceless[0].startswith("ball.001 (")


def test_the_scripts_of_the_guide(cube, capsys):
    guide = Path(__file__).resolve().parents[2] / "book/src/guides/blender.md"
    scan_all, read_answer = re.findall(r"```python\n(.*?)```", guide.read_text(), flags=re.S)
    a, b = cube("a"), cube("b", (1.5, 1.5, 1.5))
    a.select_set(False)
    exec(scan_all, {})
    assert capsys.readouterr().out.endswith("20 of 20 frames, the first is 1\n")
    exec(read_answer, {})
    out = capsys.readouterr().out
    assert "places: 1\n" in out and "a [1, 3, 5]\nb [0, 2, 4]\n('a', 'b') " in out
    b.location.x = 9
    exec(scan_all, {})
    assert capsys.readouterr().out.endswith("nothing intersects\n")


def test_whom_was_asked_about(cube):
    cube("a")
    cube("b", (1.5, 1.5, 1.5))
    said = {}
    for which in ("ACTIVE", "BETWEEN", "ALL"):
        answer = check(which)
        said[which] = text.whom(answer, state.found.question)
    assert said == {
        "ACTIVE": "b with itself", "BETWEEN": "2 objects with each other", "ALL": "2 objects with each other and themselves"
    }


def test_more_near_pairs_than_places_can_be_found_for(grid, monkeypatch):
    grid("a")
    bpy.context.scene.impinge.which = "ACTIVE"
    bpy.context.scene.impinge.rings = 0
    bpy.context.scene.impinge.distance = 0.5
    monkeypatch.setattr(question, "MOST_NEAR", 100)
    with pytest.raises(RuntimeError, match="more than 100 pairs are near: choose a smaller distance, or more rings"):
        bpy.ops.impinge.clearance()


def test_steps_of_a_scan_go_through_what_is_simulated(cube, grid, scene):
    cube("a", half=0.3).location = (0.5, 0.5, -0.4)
    cloth = grid("cloth", 6)
    cloth.modifiers.new("cloth", "CLOTH")
    bpy.context.view_layer.update()
    scene.frame_end = 21
    found = []
    for step in (5, 1):
        scene.impinge.which, scene.impinge.step = "BETWEEN", step
        assert bpy.ops.impinge.scan() == {"FINISHED"}
        found.append(scene.impinge.first_frame)
    first, fine = found
    assert fine and first and fine <= first < fine + 5, found
    assert list(scan.visited(scene, range(11, 22, 5))) == list(range(1, 22))
    cloth.modifiers.clear()
    assert list(scan.visited(scene, range(11, 22, 5))) == [11, 16, 21]


def node_group(inner):
    """A group of geometry nodes: what goes in goes through the node that `inner` adds, or the pair of nodes."""
    group = bpy.data.node_groups.new("group", "GeometryNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    enter, leave = inner(group)
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], enter)
    group.links.new(leave, group.nodes.new("NodeGroupOutput").inputs[0])
    return group


def drift(group):
    """A simulation that moves along x, by 0.3 per frame."""
    enter, leave = group.nodes.new("GeometryNodeSimulationInput"), group.nodes.new("GeometryNodeSimulationOutput")
    enter.pair_with_output(leave)
    move = group.nodes.new("GeometryNodeSetPosition")
    move.inputs["Offset"].default_value = (0.3, 0, 0)
    group.links.new(enter.outputs["Geometry"], move.inputs["Geometry"])
    group.links.new(move.outputs["Geometry"], leave.inputs["Geometry"])
    return enter.inputs["Geometry"], leave.outputs["Geometry"]


def within(inner_group):
    """A node that is the group."""

    def inner(group):
        node = group.nodes.new("GeometryNodeGroup")
        node.node_tree = inner_group
        return node.inputs[0], node.outputs[0]

    return inner


def test_simulations_in_nested_node_groups(cube, scene):
    cube("wall", (4, 0, 0))
    drifting = cube("drifting", half=0.5)
    modifier = drifting.modifiers.new("nodes", "NODES")
    # At frame f at 0.3 (f - 1): it touches from 2.5 on.
    scene.impinge.which, scene.impinge.step = "BETWEEN", 5
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 6, 16
    simulated = node_group(drift)
    for group in (simulated, node_group(within(simulated)), node_group(within(node_group(within(simulated))))):
        modifier.node_group = group
        scene.frame_set(1)
        assert bpy.ops.impinge.scan() == {"FINISHED"}
        assert (scene.impinge.n_frames, scene.impinge.first_frame) == (3, 11)
    # Neither a modifier without a group nor a node without one simulates.
    modifier.node_group = bpy.data.node_groups.new("empty", "GeometryNodeTree")
    modifier.node_group.nodes.new("GeometryNodeGroup")
    drifting.modifiers.new("none", "NODES")
    assert not scan.simulates(scene)


def test_select_of_objects_that_share_a_mesh(cube):
    a, b = cube("a"), cube("b", (1.5, 1.5, 1.5))
    b.data = a.data
    answer = check("BETWEEN")
    assert answer.faces["a"].tolist() == [1, 3, 5] and answer.faces["b"].tolist() == [0, 2, 4]
    bpy.ops.impinge.select()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert selected(a) == [0, 1, 2, 3, 4, 5]


def test_objects_that_share_a_mesh_in_edit_mode(grid):
    # Both orders: only one of the two is in Edit Mode, and the mesh of both.
    for active, other in (("a", "b"), ("b", "a")):
        a = grid("a", 4)
        b = bpy.data.objects.new("b", a.data)
        bpy.context.scene.collection.objects.link(b)
        b.select_set(True)
        b.rotation_euler = (np.pi / 2, 0, 0)
        b.location = (0, 0.5, -0.5)
        for made in (a, b):
            made.modifiers.new("finer", "SUBSURF").levels = 1
        bpy.context.view_layer.objects.active = bpy.data.objects[active]
        bpy.data.objects[other].select_set(False)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.data.objects[other].select_set(True)
        answer = check("BETWEEN", selected_only=False)
        assert answer.n_pairs > 0 and answer.n_made == 0 and all(len(answer.faces[name]) for name in "ab")
        bpy.ops.object.mode_set(mode="OBJECT")
        assert numbers_of(a) == []
        for made in (a, b):
            bpy.data.objects.remove(made)


def test_a_mesh_of_another_file_cannot_be_selected(cube, tmp_path, capfd):
    a = cube("a")
    a.data.name = "theirs"
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {a.data})
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.meshes = ["theirs"]
    a.data = wanted.meshes[0]
    b = cube("b", (1.5, 1.5, 1.5))
    answer = check("BETWEEN")
    assert answer.n_pairs > 0 and len(answer.faces["a"])
    bpy.context.view_layer.objects.active = a
    capfd.readouterr()
    bpy.ops.impinge.select()
    assert "Warning: 3 faces selected, not those of a (of another file)" in capfd.readouterr().out
    assert {made.name for made in bpy.context.objects_in_mode} == {"b"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert selected(b) == answer.faces["b"].tolist()


def test_faces_of_a_hidden_object_are_not_selected_and_that_is_said(cube, capfd):
    a, b = cube("a"), cube("b", (1.5, 1.5, 1.5))
    check("BETWEEN")
    b.hide_set(True)
    capfd.readouterr()
    assert bpy.ops.impinge.select() == {"FINISHED"}
    assert "Warning: 3 faces selected, not those of b (hidden)" in capfd.readouterr().out
    bpy.ops.object.mode_set(mode="OBJECT")
    a.hide_viewport = True
    assert bpy.ops.impinge.select() == {"CANCELLED"}
    assert "Warning: Select: no face selected, not those of a (hidden), b (hidden)" in capfd.readouterr().out


def test_select_one_place(cube):
    a = cube("a")
    cube("b", (1.5, 0, 0), 0.6)
    cube("c", (-1.5, 0, 0), 0.6)
    assert len(check("BETWEEN").places) == 2
    with pytest.raises(RuntimeError, match="go to a place"):
        bpy.ops.impinge.select(place_only=True)
    seen = []
    for _ in range(2):
        bpy.ops.impinge.step(by=1)
        bpy.ops.impinge.select(place_only=True)
        bpy.ops.object.mode_set(mode="OBJECT")
        seen += selected(a)
    assert sorted(seen) == [0, 1]


def test_step_takes_the_view_there(cube, scene):
    cube("a", (10, 0, 0))
    cube("b", (11.5, 0, 0), 0.6)
    cube("c", (8.5, 0, 0), 0.6)
    scene.frame_set(3)
    check("BETWEEN")
    scene.frame_set(1)
    [view] = [area.spaces.active.region_3d for area in bpy.context.screen.areas if area.type == "VIEW_3D"]
    view.view_perspective = "CAMERA"
    at = []
    for by in (1, 1, 1, -1, -1):
        assert bpy.ops.impinge.step(by=by) == {"FINISHED"}
        at.append(tuple(round(x, 3) for x in view.view_location))
        place = state.found.answer.places[state.found.place]
        assert np.allclose(view.view_location, place.position, atol=1e-5) and view.view_distance == pytest.approx(4 * place.radius)
    assert at[0] == at[2] == at[4] != at[1] == at[3]
    assert view.view_perspective == "PERSP" and scene.frame_current == 3


def test_an_answer_belongs_to_its_scene(cube, scene):
    from bl_ext.user_default.impinge import panel

    cube("a")
    cube("b", (1.5, 1.5, 1.5))
    scene.frame_set(9)
    check("BETWEEN")
    buttons = (panel.IMPINGE_PT_found, bpy.ops.impinge.step, bpy.ops.impinge.select)

    def can_be_pressed():
        return [button.poll(bpy.context) if button is panel.IMPINGE_PT_found else button.poll() for button in buttons]

    bpy.context.window.scene = bpy.data.scenes.new("other")
    assert can_be_pressed() == [False] * 3
    bpy.context.window.scene = scene
    scene.name = "renamed"
    assert can_be_pressed() == [True] * 3
    bpy.ops.ed.undo_push(message="before")
    bpy.context.scene.frame_set(3)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert can_be_pressed() == [True] * 3 and bpy.ops.impinge.step(by=1) == {"FINISHED"}
    assert bpy.context.scene.frame_current == 9


def test_the_view_stays_far_enough_from_a_small_place_to_draw_it(add, scene):
    add("floor", [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [(0, 1, 2, 3)])
    add("tip", [[0.1, 0.2, 1e-5], [-0.5, 0, -1], [0.5, 0, -1]], [(0, 1, 2)])
    [place] = check("BETWEEN").places
    assert 0 < place.radius < 1e-4
    [space] = [area.spaces.active for area in bpy.context.screen.areas if area.type == "VIEW_3D"]
    bpy.ops.impinge.step(by=1)
    # The view draws nothing nearer than this.
    assert space.region_3d.view_distance > 1.4 * space.clip_start
    space.clip_start = 1e-4
    bpy.ops.impinge.step(by=1)
    assert space.region_3d.view_distance < 0.01


def test_another_file_begins_without_an_answer(cube):
    cube("a")
    check()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert state.found is None
    from bl_ext.user_default.impinge import panel

    assert not panel.IMPINGE_PT_found.poll(bpy.context)


class Layout:
    """Takes what a panel draws; what Blender would refuse is refused."""

    def __init__(self, texts):
        self.texts = texts

    def row(self, align=False):
        return Layout(self.texts)

    column = row

    def prop(self, holder, name, expand=False):
        assert name in holder.bl_rna.properties, name
        self.texts.append(name)

    def label(self, text):
        self.texts.append(text)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.texts.append(text)

    def operator(self, name, text=None, icon="NONE"):
        assert icon in bpy.types.UILayout.bl_rna.functions["operator"].parameters["icon"].enum_items
        kind = getattr(bpy.types, name.replace(".", "_OT_").replace("impinge", "IMPINGE"))
        self.texts.append(kind.bl_label if text is None else text)
        return SimpleNamespace()


def drawn(part):
    texts = []
    part.draw(SimpleNamespace(layout=Layout(texts)), bpy.context)
    return texts


def test_the_panel_says_what_was_found(cube, scene):
    from bl_ext.user_default.impinge import panel

    cube("a")
    cube("b", (1.5, 1.5, 1.5))
    assert drawn(panel.IMPINGE_PT_check) == ["which", "weld", "Check"]
    assert not panel.IMPINGE_PT_found.poll(bpy.context)
    n = check("BETWEEN").n_pairs
    assert panel.IMPINGE_PT_found.poll(bpy.context)
    found = [f"{n} pairs in 1 place", "of 24 triangles"]
    assert drawn(panel.IMPINGE_PT_found) == [*found, "", "Go to a place", "", "Select All Faces"]
    bpy.ops.impinge.step(by=1)
    place = ["", "Place 1 of 1", "", "a and", "b", f"{n} pairs", "Select Faces of This Place"]
    assert drawn(panel.IMPINGE_PT_found) == [*found, *place, "Select All Faces"]
    scene.frame_set(4)
    assert drawn(panel.IMPINGE_PT_found)[2] == "in frame 1"
    assert drawn(panel.IMPINGE_PT_clearance) == ["distance", "Find Clearance"]
    assert drawn(panel.IMPINGE_PT_scan) == ["step", "mark", "Scan Frames"]
    bpy.ops.impinge.scan()
    assert {"20 of 20 frames intersect", "first_frame"} <= set(drawn(panel.IMPINGE_PT_scan))
    state.run(state.Running("Scan", SimpleNamespace(progress=(0, 0)), (3, 20)))
    # Its own panel shows the work, the others their buttons.
    assert drawn(panel.IMPINGE_PT_scan)[2:4] == ["Scan 3 of 20", ""] and "Check" in drawn(panel.IMPINGE_PT_check)
    # Progress of a check is counted in parts of its work, which mean nothing to a user.
    state.run(state.Running("Check", SimpleNamespace(progress=(449, 3903))))
    assert drawn(panel.IMPINGE_PT_check)[2:] == ["Check", ""]
    bpy.ops.object.mode_set(mode="EDIT")
    assert "selected_only" in drawn(panel.IMPINGE_PT_check)


def test_the_panel_offers_no_faces_where_none_were_found(cube):
    from bl_ext.user_default.impinge import panel

    cube("a")
    check()
    assert drawn(panel.IMPINGE_PT_found) == ["nothing intersects", "of 12 triangles"]
    assert not bpy.ops.impinge.select.poll()


# Animations.


def scan_counts(scene, frames):
    """Pairs of frames, as Check sees them."""
    before, counts = scene.frame_current, []
    for frame in frames:
        scene.frame_set(frame)
        counts.append(check("BETWEEN").n_pairs)
    scene.frame_set(before)
    return counts


def test_scan(cube, scene):
    moving = cube("moving")
    cube("still", (10, 0, 0))
    # At frame f at x = f: it touches from 8 to 12.
    for frame in (1, 20):
        moving.location.x = frame
        moving.keyframe_insert("location", frame=frame)
    action = moving.animation_data.action
    # Blender 4.4 and later keep them in channels per slot.
    curves = action.layers[0].strips[0].channelbags[0].fcurves if bpy.app.version >= (4, 4, 0) else action.fcurves
    for point in (point for curve in curves for point in curve.keyframe_points):
        point.interpolation = "LINEAR"
    scene.frame_set(5)
    scene.timeline_markers.new("mine", frame=2)
    scene.impinge.which = "BETWEEN"
    assert bpy.ops.impinge.scan() == {"FINISHED"}
    settings = scene.impinge
    assert (settings.is_hit, settings.first_frame, settings.n_frames, settings.n_hits) == (True, 8, 20, 5)
    assert scene.frame_current == 5
    marks = {marker.frame: marker.name for marker in scene.timeline_markers}
    assert list(sorted(marks)) == [2, 8, 13] and marks[13] == "free (impinge)"
    # The most pairs of the run. The number comes first, because the next marker cuts the name off.
    most = max(scan_counts(scene, range(8, 13)))
    assert marks[8] == f"{most} pairs at most (impinge)"
    # Each frame as Check sees it.
    for frame in (7, 8, 10, 12, 13):
        scene.frame_set(frame)
        assert (check("BETWEEN").n_pairs > 0) == (8 <= frame <= 12)
    bpy.ops.impinge.first_frame()
    assert scene.frame_current == 8
    # The number can be keyed.
    assert settings.keyframe_insert("first_frame", frame=1)

    settings.step = 3
    scene.frame_start = 9
    bpy.ops.impinge.scan()
    assert (settings.first_frame, settings.n_frames, settings.n_hits) == (9, 4, 2)
    assert sorted(marker.frame for marker in scene.timeline_markers) == [2, 9, 15]
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 14, 16
    bpy.ops.impinge.scan()
    assert not settings.is_hit and [marker.name for marker in scene.timeline_markers] == ["mine"]


def test_scan_of_topology_that_changes(cube, grid, scene):
    sheet = grid("sheet", 4)
    cube("cube", (3.5, 0.5, 0), 0.4)
    # One more copy per frame: the fourth one reaches the cube.
    array = sheet.modifiers.new("copies", "ARRAY")
    for frame in range(1, 7):
        array.count = frame
        array.keyframe_insert("count", frame=frame)
    scene.frame_end = 6
    scene.impinge.which = "BETWEEN"
    bpy.ops.impinge.scan()
    assert (scene.impinge.first_frame, scene.impinge.n_hits) == (4, 3)


def test_a_scan_says_whose_instances_were_not_looked_at(cube, scene, capfd):
    cube("part", (9, 0, 0)).select_set(False)
    empty = added("empty", None)
    empty.instance_type = "COLLECTION"
    empty.instance_collection = bpy.data.collections.new("parts")
    empty.instance_collection.objects.link(bpy.data.objects["part"])
    cube("b", (9, 0, 0))
    a = cube("a")
    # Copies, from frame 10 on.
    modifier = a.modifiers.new("nodes", "NODES")
    modifier.node_group = node_group(copies("object"))
    for frame in (1, 10):
        modifier.show_viewport = frame == 10
        modifier.keyframe_insert("show_viewport", frame=frame)
    scene.frame_set(1)
    for which, names in (("ACTIVE", "a"), ("BETWEEN", "empty, a")):
        scene.impinge.which = which
        assert bpy.ops.impinge.scan() == {"FINISHED"}
        assert f"none of 20 frames intersects; instances of {names} were not looked at" in capfd.readouterr().out


def test_a_scan_leaves_out_what_is_disabled_in_a_frame(cube, grid, scene, capfd):
    made = solid(grid)
    cube("cube", (0.5, 0.5, 0), 0.4)
    for frame, is_disabled in ((1, False), (10, True), (15, False)):
        made.hide_viewport = is_disabled
        made.keyframe_insert("hide_viewport", frame=frame)
    scene.frame_set(1)
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    for which in ("ACTIVE", "BETWEEN"):
        scene.impinge.which = which
        assert bpy.ops.impinge.scan() == {"FINISHED"}
        assert (scene.impinge.n_frames, scene.impinge.n_hits) == (20, 15)
        assert sorted(marker.frame for marker in scene.timeline_markers) == [1, 10, 15]
        said = "15 of 20 frames intersect, the first is 1; left out where disabled in the viewport: solid in 5 frames"
        assert said in capfd.readouterr().out
        # Blender deselects it on the way.
        assert {object.name for object in bpy.context.selected_objects} == {"cube", "solid"}


def test_scan_where_loose_vertices_come_and_go(add, cube, scene):
    made = add("loose", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [5, 5, 5]], [(0, 1, 2)])
    cube("cube", half=0.3)
    made.shape_key_add(name="Basis")
    # Welding makes one of the two loose vertices, in the first frame only.
    key = made.shape_key_add(name="apart")
    key.data[4].co.x = 7
    for frame in (1, 2):
        key.value = frame - 1
        key.keyframe_insert("value", frame=frame)
    scene.frame_set(1)
    scene.frame_end = 3
    scene.impinge.which = "BETWEEN"
    assert bpy.ops.impinge.scan() == {"FINISHED"}
    assert (scene.impinge.n_frames, scene.impinge.n_hits) == (3, 3)


def test_a_scan_goes_back_to_the_frame_and_its_part(cube, scene):
    cube("a")
    scene.frame_set(7, subframe=0.5)
    assert bpy.ops.impinge.scan() == {"FINISHED"}
    assert scene.frame_current_final == 7.5


def test_what_a_scan_says():
    from bl_ext.user_default.impinge.frames import Frames

    def said(*counts):
        seen = Frames(3, 2 + len(counts))
        for frame, n_pairs in zip(seen.wanted, counts):
            seen.add(frame, n_pairs)
        return text.of_frames(seen)

    assert said(0, 0) == "none of 2 frames intersects"
    assert said(0, 5) == "1 of 2 frames intersects, the first is 4"
    assert said(4, 5) == "2 of 2 frames intersect, the first is 3"
    assert said(0) == "frame 3 does not intersect" and said(9) == "frame 3 intersects"


def test_runs():
    from bl_ext.user_default.impinge.frames import Frames

    seen = Frames(1, 8)
    for frame, n_pairs in zip(seen.wanted, (0, 2, 5, 0, 0, 1, 3, 3)):
        seen.add(frame, n_pairs)
    assert seen.runs() == [(2, 3, 5, 4), (6, 8, 3, None)] and seen.first == 2 and seen.n_hits == 5


# Stopping, errors, and an interface that does not freeze.


def test_errors_name_the_object(cube):
    a = cube("broken")
    cube("b", (1.5, 0, 0))
    a.data.vertices[3].co.y = float("nan")
    bpy.context.scene.impinge.which = "BETWEEN"
    with pytest.raises(RuntimeError, match=r"Check: broken: .*3.*(NaN|nan)"):
        bpy.ops.impinge.check()
    assert state.found is None and state.running is None
    a.data.vertices[3].co.y = 1
    assert check("BETWEEN").n_pairs > 0


def test_nothing_to_ask(cube):
    bpy.context.scene.impinge.which = "BETWEEN"
    with pytest.raises(RuntimeError, match="Check: select 2 or more objects that have faces; 0 objects with faces are selected"):
        bpy.ops.impinge.check()
    cube("a")
    with pytest.raises(RuntimeError, match="1 object with faces is selected"):
        bpy.ops.impinge.check()


class Fake:
    """What an operator that was invoked has of Blender: without a window there are no events."""

    def __init__(self):
        self.timers, self.handlers, self.reports, self.drawn = [], [], [], 0
        area = SimpleNamespace(type="VIEW_3D", tag_redraw=self.draw)
        window = SimpleNamespace(screen=SimpleNamespace(areas=[area]))
        manager = SimpleNamespace(
            windows=[window],
            event_timer_add=lambda seconds, window: self.timers.append(seconds) or "timer",
            event_timer_remove=lambda timer: self.timers.pop(),
            modal_handler_add=self.handlers.append,
        )
        self.window_manager, self.window = manager, window

    def draw(self):
        self.drawn += 1

    def __getattr__(self, name):
        return getattr(bpy.context, name)


def invoke(kind, context, monkeypatch):
    """An operator that runs beside the interface; events go to its `modal`."""

    class Run(kind):
        def report(self, kinds, message):
            context.reports.append((kinds, message))

    operator = Run()
    monkeypatch.setattr(waiting, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    assert operator.invoke(context, None) == {"RUNNING_MODAL"} and context.handlers == [operator]
    return operator


def tick(operator, context, longest=None):
    # The time of this thread alone, for others may keep the machine busy.
    began = time.thread_time()
    result = operator.modal(context, SimpleNamespace(type="TIMER", value="NOTHING"))
    if longest is not None:
        longest.append(time.thread_time() - began)
    return result


class Scan(waiting.Waiting):
    """The scan without Blender's registration, whose instances only Blender can make."""

    label = "Scan"
    steps = scan.IMPINGE_OT_scan.steps


def test_a_scan_can_be_stopped(cube, scene, monkeypatch):
    moving = cube("moving")
    cube("still", (5, 0, 0))
    for frame in (1, 20):
        moving.location.x = frame
        moving.keyframe_insert("location", frame=frame)
    scene.impinge.which = "BETWEEN"
    # More than the frames of one look, for short ones share a look.
    scene.frame_end = 9999
    context = Fake()
    operator = invoke(Scan, context, monkeypatch)
    # A second button says that the first is busy.
    assert Scan.execute(SimpleNamespace(label="x", report=lambda *_: None, _is_busy=lambda: Scan._is_busy(operator)), context) == {"CANCELLED"}
    while not (state.running.frames and state.running.frames[0] >= 7):
        assert tick(operator, context) == {"PASS_THROUGH"}
        time.sleep(0.002)
    assert bpy.ops.impinge.cancel() == {"FINISHED"}
    result = {"PASS_THROUGH"}
    while result == {"PASS_THROUGH"}:
        result = tick(operator, context)
    assert result == {"CANCELLED"} and context.reports[-1] == ({"INFO"}, "Scan was cancelled")
    assert state.running is None and context.timers == [] and context.drawn > 1
    # What was seen by then is kept, and the frame is the one from before.
    assert 7 <= scene.impinge.n_frames < 9999 and scene.impinge.is_hit and scene.frame_current == 1


def test_an_object_that_goes_away_ends_a_scan(cube, scene, monkeypatch):
    cube("gone")
    cube("still")
    scene.impinge.which = "BETWEEN"
    scene.frame_end = 9999
    context = Fake()
    operator = invoke(Scan, context, monkeypatch)
    while not state.running.frames:
        assert tick(operator, context) == {"PASS_THROUGH"}
    # As an undo does it.
    bpy.data.objects.remove(bpy.data.objects["gone"])
    while tick(operator, context) == {"PASS_THROUGH"}:
        pass
    assert context.reports == [({"ERROR"}, "Scan: gone is no longer in the scene")]
    assert state.running is None and scene.frame_current == 1


def test_a_scan_goes_on_where_its_scene_is_renamed(cube, scene, monkeypatch):
    cube("a")
    cube("b")
    scene.impinge.which = "BETWEEN"
    scene.frame_set(5)
    scene.frame_end = 300
    context = Fake()
    operator = invoke(Scan, context, monkeypatch)
    while not state.running.frames:
        assert tick(operator, context) == {"PASS_THROUGH"}
    scene.name = "renamed"
    while tick(operator, context) == {"PASS_THROUGH"}:
        pass
    assert context.reports == [({"INFO"}, "300 of 300 frames intersect, the first is 1")]
    assert (scene.impinge.n_frames, scene.frame_current) == (300, 5)


class Broken(waiting.Waiting):
    label = "Broken"

    def steps(self, context):
        yield job.Job(lambda cancel, progress: 1)
        raise TypeError("not foreseen")


def test_what_is_not_foreseen_ends_the_work(monkeypatch):
    context = Fake()
    operator = invoke(Broken, context, monkeypatch)
    with pytest.raises(TypeError, match="not foreseen"):
        while tick(operator, context) == {"PASS_THROUGH"}:
            time.sleep(0.001)
    assert state.running is None and context.timers == []


class Check(waiting.Waiting):
    label = "Check"
    distance = lambda self, settings: None  # noqa: E731

    def steps(self, context):
        from bl_ext.user_default.impinge.operators.check import Asking

        return Asking.steps(self, context)


def big(add, n_triangles):
    """A torus that winds so tightly that it cuts through itself, made of arrays: Python loops would take minutes."""
    n = int((n_triangles / 2) ** 0.5)
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(n) * 2 * np.pi / n, indexing="ij")
    at = np.stack([(1 + 1.2 * np.cos(v)) * np.cos(u), (1 + 1.2 * np.cos(v)) * np.sin(u), np.sin(v)], axis=-1)
    index = np.arange(n * n).reshape(n, n)
    quads = np.stack([index, np.roll(index, -1, 0), np.roll(index, (-1, -1), (0, 1)), np.roll(index, -1, 1)], axis=-1).reshape(-1, 4)
    made = add("big", [], [])
    mesh = made.data
    mesh.vertices.add(n * n)
    mesh.vertices.foreach_set("co", at.astype(np.float32).ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.astype(np.int32).ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    return made


def test_a_million_triangles_do_not_freeze_the_interface(add, monkeypatch, capsys):
    made = big(add, 1_000_000)
    context, spans = Fake(), []
    began = time.perf_counter()
    operator = invoke(Check, context, monkeypatch)
    result = {"PASS_THROUGH"}
    while result == {"PASS_THROUGH"}:
        result = tick(operator, context, spans)
        time.sleep(0.005)
    whole = time.perf_counter() - began
    answer = state.found.answer
    assert result == {"FINISHED"} and answer.n_triangles > 990_000 and answer.n_pairs > 1000 and len(answer.places) >= 1
    with capsys.disabled():
        print(f"\n1 M triangles: {whole:.2f} s, {len(spans)} looks, the longest {1000 * max(spans):.0f} ms, the next {1000 * sorted(spans)[-2]:.0f} ms")
    # The first look reads the mesh, which only the main thread may do. None waits for the answer, which takes most of the time.
    assert max(spans) < whole / 3 and sorted(spans)[-2] < whole / 20 and len(spans) > 5
    # The selection of all of it.
    assert bpy.ops.impinge.select() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(selected(made)) == len(answer.faces["big"])


def test_a_check_can_be_stopped(add, monkeypatch):
    big(add, 1_000_000)
    context = Fake()
    operator = invoke(Check, context, monkeypatch)
    tick(operator, context)
    began = time.perf_counter()
    assert operator.modal(context, SimpleNamespace(type="ESC", value="PRESS")) == {"RUNNING_MODAL"}
    result = {"PASS_THROUGH"}
    while result == {"PASS_THROUGH"}:
        result = tick(operator, context)
        time.sleep(0.005)
    assert result == {"CANCELLED"} and state.found is None and state.running is None
    assert time.perf_counter() - began < 5.0


def test_jobs_fail_where_they_are_waited_for():
    def steps(seen):
        seen.append((yield job.Job(lambda cancel, progress: 1)))
        try:
            yield job.Job(lambda cancel, progress: 1 / 0)
        except ZeroDivisionError as error:
            seen.append(error)
        yield job.Job(lambda cancel, progress: progress(3, 4))
        return 5

    seen = []
    assert job.Driver(steps(seen)).run() == 5 and seen[0] == 1 and isinstance(seen[1], ZeroDivisionError)

    gate = threading.Event()
    driver = job.Driver(iter_of(job.Job(lambda cancel, progress: (progress(3, 4), gate.wait(10)))))
    assert not driver.poll() and not driver.poll()
    while driver.progress != (3, 4):
        time.sleep(0.001)
    driver.cancel()
    # It is not over before the work is.
    assert not driver.poll()
    gate.set()
    with pytest.raises(impinge.Cancelled):
        driver.run()


def test_short_jobs_do_not_wait_for_the_next_look():
    def steps():
        for _ in range(500):
            yield job.Job(lambda cancel, progress: 1)

    driver, n_looks = job.Driver(steps()), 1
    while not driver.poll(10.0):
        n_looks += 1
    assert n_looks < 250
    # One that is not short is not waited for.
    gate = threading.Event()
    driver = job.Driver(iter_of(job.Job(lambda cancel, progress: gate.wait(30))))
    assert not driver.poll(1000.0) and not driver.poll(1000.0)
    gate.set()
    driver.run()


def iter_of(one):
    yield one


def test_equal_points_stay_equal_in_the_world():
    generator = np.random.default_rng(2)
    points = np.repeat(generator.random((97, 3)).astype(np.float32), 3, axis=0)
    matrix = np.array(Matrix.Rotation(0.3, 4, (1, 2, 3)), np.float64)
    assert len(np.unique(bodies.to_world(matrix, points), axis=0)) == 97


def test_register_again():
    import addon_utils

    name = "bl_ext.user_default.impinge"
    addon_utils.disable(name)
    assert not hasattr(bpy.types, "IMPINGE_PT_check")
    assert addon_utils.enable(name) is not None and hasattr(bpy.types, "IMPINGE_PT_check")


def test_question_is_asked_with_the_panel_s_options(cube):
    cube("a")
    check("ACTIVE", weld=False)
    assert state.found.question == question.Question(itself=True, between=False, rings=2, weld=False)
