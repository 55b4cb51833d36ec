"""Objects of Blender as bodies: evaluated, with modifiers as the viewport has them."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager

import bmesh
import numpy as np

from .bodies import Body

__all__ = ["KINDS", "chosen", "disabled", "faceless", "instancers", "meant", "named", "read", "topology"]

#: Kinds of objects that have faces.
KINDS = ("MESH", "CURVE", "SURFACE", "FONT", "META")
#: What follows the numbers in `persistent_id` of an instance: its own, then those of the instances in which it is.
NO_ID = 2**31 - 1
#: Begins the names of layers of the objects' own meshes that live while a question is read: the number of each face, from 1.
NUMBER = "impinge_number"


def chosen(context, which):
    """Full names of the objects with faces that a question is about."""
    return [object.name_full for object in _meant(context, which) if object.type in KINDS]


def meant(context, which):
    """Full names of all objects that a question is about, also of those that only make instances."""
    return [object.name_full for object in _meant(context, which)]


def _meant(context, which):
    """The active object, or all that are selected."""
    active = context.view_layer.objects.active
    return ([active] if active else []) if which == "ACTIVE" else context.selected_objects


def named(scene, names):
    """Objects by their full names, in which a linked object has its library; None for those that are no longer there."""
    objects = {object.name_full: object for object in scene.objects}
    return [objects.get(name) for name in names]


def disabled(context, names):
    """Those of these full names whose objects are disabled in the viewport in this frame, or all collections that they are in: Blender does
    not evaluate their modifiers. Objects that are hidden in the view only (`H`) are evaluated.
    """
    layers = _layers(context.view_layer.layer_collection)
    enabled = {object.name_full for layer in layers for object in layer.collection.objects if not object.hide_viewport}
    return [name for name in names if name not in enabled]


def _layers(layer):
    """The collections of a view layer that are not disabled in the viewport. One that is excluded may have one in it that is not."""
    if layer.collection.hide_viewport:
        return
    if not layer.exclude:
        yield layer
    for child in layer.children:
        yield from _layers(child)


def faceless(scene, names):
    """These full names of objects without faces, as messages call them."""
    family = " (the first metaball of its family has the faces of all)"
    return [name + family if object.type == "META" else name for name, object in zip(names, named(scene, names))]


def instancers(context, names):
    """Those of these full names whose objects' instances are seen in this frame, but are no faces of theirs."""
    names = [name for name, object in zip(names, named(context.scene, names)) if object is not None and _can_instance(object)]
    if not names:
        # A scene may show very many instances of others: of 200,000 the list takes half a second.
        return []
    depsgraph = context.evaluated_depsgraph_get()
    parents = {instance.parent.original for instance in depsgraph.object_instances if _is_of_another(instance)}
    of_parents = {object.name_full for object in parents}
    return [name for name in names if name in of_parents]


def _can_instance(object):
    return object.instance_type != "NONE" or any(modifier.type in ("NODES", "PARTICLE_SYSTEM") for modifier in object.modifiers)


def _is_of_another(instance):
    """Whether it shows anything but an object's own faces: of a curve, a text, a metaball these are an instance, too, which is in none."""
    if not instance.is_instance or instance.parent is None:
        return False
    return instance.object.original != instance.parent.original or instance.persistent_id[1] != NO_ID


def topology(object):
    """Equal for an object whose own mesh has the faces that it had."""
    if object.type != "MESH":
        return None
    mesh = object.data
    digest = hashlib.blake2b(_corners(mesh).tobytes(), digest_size=16)
    digest.update(_get(mesh.polygons, "loop_start", np.int32).tobytes())
    return object.session_uid, len(mesh.polygons), digest.digest()


def read(context, names, selected_only=False):
    """The bodies in this frame, without those of objects that are disabled.

    Where `selected_only`, triangles count that come from selected faces of objects in Edit Mode; if none is selected, all count.
    """
    objects = named(context.scene, names)
    if None in objects:
        raise ValueError(f"{names[objects.index(None)]} is no longer in the scene")
    absent = set(disabled(context, names))
    objects = [object for name, object in zip(names, objects) if name not in absent]
    for object in objects:
        if object.mode == "EDIT":
            object.update_from_editmode()
    selections = [_selection(object) for object in objects]
    bodies = [_read(context, object) for object in objects]
    unknown = [object for object, body in zip(objects, bodies) if body.polygons is None]
    with _numbered(context, unknown) as layers:
        for ix, object in enumerate(objects):
            if object in unknown:
                bodies[ix] = _read(context, object, layers)
    if selected_only and any(map(np.any, selections)):
        for body, selection in zip(bodies, selections):
            body.selected = _selected(body, selection)
    return bodies


def _selection(object):
    """Which faces of the object's own mesh are selected in Edit Mode; empty in other modes, and of other kinds of objects."""
    if object.type != "MESH" or object.mode != "EDIT":
        return np.empty(0, bool)
    return _get(object.data.polygons, "select", bool)


def _selected(body, selection):
    """Which triangles come from selected faces of the object's own mesh. Modifiers may drop the flags of the faces that they hand on."""
    selected = np.zeros(len(body.polygons), bool)
    if selection.any():
        is_own = body.polygons >= 0
        selected[is_own] = selection[body.polygons[is_own]]
        if not selected.any() and not is_own.all():
            raise ValueError(f"{body.name}: its modifiers make new faces, and none is known to come from a selected one: switch Selected Faces Only off")
    return selected


def _read(context, object, layers=None):
    """The body. Its polygons are None if only numbers could tell them: those in `layers`."""
    evaluated = object.evaluated_get(context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    if mesh is None:
        return _body(object, np.empty((0, 3)), np.empty((0, 3), int), np.empty(0, int), evaluated)
    try:
        mesh.calc_loop_triangles()
        vertices = _get(mesh.vertices, "co", np.float32, 3)
        triangles = _corners(mesh)[_get(mesh.loop_triangles, "loops", np.int32, 3)]
        polygon = _get(mesh.loop_triangle_polygons, "value", np.int32)
        if layers is not None:
            numbers = mesh.attributes.get(layers.get(object.data, ""))
            is_known = numbers is not None and numbers.domain == "FACE" and len(numbers.data) == len(mesh.polygons)
            origin = _get(numbers.data, "value", np.int32) - 1 if is_known else np.full(len(mesh.polygons), -1, np.int32)
            origin = origin[polygon]
        else:
            origin = polygon if _is_same(object, mesh) else None
        return _body(object, vertices, triangles, origin, evaluated)
    finally:
        evaluated.to_mesh_clear()


def _body(object, vertices, triangles, polygons, evaluated):
    return Body(object.name_full, vertices, triangles, polygons, np.array(evaluated.matrix_world, np.float64))


def _get(rows, name, dtype, width=1):
    out = np.empty(len(rows) * width, dtype)
    rows.foreach_get(name, out)
    return out.reshape(-1, width) if width > 1 else out


def _corners(mesh):
    """The vertex of each corner. Of a million triangles the attribute takes 2 ms, and `MeshLoop.vertex_index` 120."""
    attribute = mesh.attributes.get(".corner_vert")
    return _get(mesh.loops, "vertex_index", np.int32) if attribute is None else _get(attribute.data, "value", np.int32)


def _is_same(object, mesh):
    """Whether modifiers have left the faces of the object's own mesh as they were."""
    if object.type != "MESH":
        return False
    own = object.data
    if len(own.polygons) != len(mesh.polygons) or len(own.loops) != len(mesh.loops):
        return False
    ends = [_get(one.polygons, "loop_start", np.int32) for one in (own, mesh)]
    return np.array_equal(*ends) and np.array_equal(_corners(own), _corners(mesh))


@contextmanager
def _numbered(context, objects):
    """Numbers the faces of the objects' own meshes meanwhile: modifiers hand the numbers on to the faces that they make of them.

    Gives the names of the layers by mesh. Each mesh has its own, because a modifier may take in the faces of another one.
    """
    # Of objects that share a mesh in Edit Mode only one is in that mode.
    meshes = {object.data: object.data.is_editmode for object in objects if object.type == "MESH" and object.data.is_editable}
    layers = {}
    for ix_mesh, (mesh, is_edited) in enumerate(meshes.items()):
        # Blender gives the layer another name if the mesh has one of this name.
        name = f"{NUMBER}_{ix_mesh}"
        if is_edited:
            edited = bmesh.from_edit_mesh(mesh)
            layer = edited.faces.layers.int.new(name)
            layers[mesh] = layer.name
            for ix, face in enumerate(edited.faces):
                face[layer] = ix + 1
            bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)
        else:
            numbers = mesh.attributes.new(name, "INT", "FACE")
            layers[mesh] = numbers.name
            numbers.data.foreach_set("value", np.arange(1, len(mesh.polygons) + 1, dtype=np.int32))
            mesh.update_tag()
    try:
        if meshes:
            context.view_layer.update()
        yield layers
    finally:
        for mesh, is_edited in meshes.items():
            if is_edited:
                edited = bmesh.from_edit_mesh(mesh)
                edited.faces.layers.int.remove(edited.faces.layers.int[layers[mesh]])
                bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)
            elif layers[mesh] in mesh.attributes:
                mesh.attributes.remove(mesh.attributes[layers[mesh]])
        if meshes:
            context.view_layer.update()
