#!/usr/bin/env python3
"""Draws the picture of the README: two bodies, what collides in red and blue.

Needs the Python module, NumPy and matplotlib (for its PNG writer):  python scripts/picture.py docs/images/collision.png
"""

import sys

import matplotlib.colors
import matplotlib.image
import numpy as np

import impinge


def tube(curve, radius, n_along, n_around):
    """A closed tube of triangles around a closed curve: (v, 3) vertices and (f, 3) faces."""
    t = np.linspace(0.0, 2.0 * np.pi, n_along, endpoint=False)
    center = curve(t)
    tangent = curve(t + 1e-4) - center
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    angle = np.linspace(0.0, 2.0 * np.pi, n_around, endpoint=False)
    ring = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * up[:, None]
    vertices = (center[:, None] + radius * ring).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n_along), np.arange(n_around), indexing="ij")
    i1, j1 = (i + 1) % n_along, (j + 1) % n_around
    a, b, c, d = (x * n_around + y for x, y in ((i, j), (i1, j), (i1, j1), (i, j1)))
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return vertices.astype(np.float32), faces.astype(np.uint32)


def knot(t):
    r = 2.0 + np.cos(3.0 * t)
    return np.stack([r * np.cos(2.0 * t), r * np.sin(2.0 * t), -1.2 * np.sin(3.0 * t)], axis=1)


def ring(t):
    return np.stack([2.0 * np.cos(t), 2.0 * np.sin(t), 1.15 + 0.25 * np.sin(5.0 * t)], axis=1)


def draw(triangles, colors, width, height):
    """A picture of (n, 3, 3) triangles from above, nearest first, each point the mean of 3 x 3."""
    tilt = 0.75
    x, y, z = np.moveaxis(triangles, -1, 0)
    up, depth = y * np.cos(tilt) + z * np.sin(tilt), z * np.cos(tilt) - y * np.sin(tilt)
    scale = 3 * 0.46 * min(width / np.abs(x).max(), height / np.abs(up).max())
    px, py = x * scale + 1.5 * width, 1.5 * height - up * scale
    picture = np.ones((3 * height, 3 * width, 3))
    nearest = np.full((3 * height, 3 * width), -np.inf)
    for (x0, x1, x2), (y0, y1, y2), z, color in zip(px, py, depth, colors):
        twice_area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if twice_area == 0:
            continue
        left, right = int(min(x0, x1, x2)), int(max(x0, x1, x2)) + 2
        top, bottom = int(min(y0, y1, y2)), int(max(y0, y1, y2)) + 2
        u, v = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
        b = ((u - x0) * (y2 - y0) - (x2 - x0) * (v - y0)) / twice_area
        c = ((x1 - x0) * (v - y0) - (u - x0) * (y1 - y0)) / twice_area
        at = z[0] + b * (z[1] - z[0]) + c * (z[2] - z[0])
        part = np.s_[top:bottom, left:right]
        seen = (b >= 0) & (c >= 0) & (b + c <= 1) & (at > nearest[part])
        nearest[part][seen] = at[seen]
        picture[part][seen] = color
    return np.clip(picture.reshape(height, 3, width, 3, 3).mean(axis=(1, 3)), 0, 1)


def main():
    bodies = [tube(knot, 0.42, 130, 14), tube(ring, 0.36, 100, 13)]
    (va, fa), (vb, fb) = bodies
    pairs = impinge.pairs(va, fa, vb, fb)
    light = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])
    triangles, colors = [], []
    for (v, f), column, hit, base in zip(bodies, (0, 1), ("#d7263d", "#1b5fd9"), ("#c9ccd1", "#aeb4bd")):
        corners = v[f]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        shade = 0.45 + 0.55 * np.abs(normal @ light)
        color = np.tile(matplotlib.colors.to_rgb(base), (len(f), 1))
        color[np.unique(pairs[:, column])] = matplotlib.colors.to_rgb(hit)
        triangles.append(corners)
        colors.append(color * shade[:, None])
    matplotlib.image.imsave(sys.argv[1], draw(np.concatenate(triangles), np.concatenate(colors), 760, 480))
    print(f"{len(pairs)} pairs of {len(fa)} and {len(fb)} triangles")


if __name__ == "__main__":
    main()
