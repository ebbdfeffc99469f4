"""How well what is fitted to vertices of a mesh is known: one budget for every shape, whether it
was looked for, asked for, or grown as a planar face."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes._forms import Cylinder, Plane, Sphere
from turnscan.shapes._measure import measured_points
from turnscan.shapes._stripe_numbers import doubt_along
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import (
    Ground,
    Index,
    measured_part,
    prepared,
    sigma_of,
)
from turnscan.shapes.primitives._judged import cells
from turnscan.shapes.primitives._surface_kernels import CYLINDER, FREE, PLANE, SPHERE
from turnscan.shapes.verification._statistics import clumping

_Round = TypeVar("_Round", Sphere, Cylinder)


class Budget:
    """The uncertainty of parameters that were fitted to vertices by least squares.

    ``residual`` (n,) mm is how far the ``used`` vertices are off, ``J`` (n, k) its derivatives by
    the parameters. From each vertex's sigma, or its scatter where that is larger; more where
    neighbours are off together, and where an edge may have bent whole stripes.
    """

    def __init__(self, g: Ground, used: Index, residual: Floats, J: Floats) -> None:
        self.J, self.weight = J, 1.0 / g.scale[used] ** 2
        self.inverse = _inverse((J * self.weight[:, None]).T @ J)
        free = J.shape[1]
        count = max(len(residual) - free, 1)
        unit = max(1.0, float((self.weight * residual**2).sum()) / count)
        where = cells(g, used, g.together)
        unit *= clumping(residual * np.sqrt(self.weight), where, free)
        self.covariance = self.inverse * unit + self._bent(g, used, residual)

    def _bent(self, g: Ground, used: Index, residual: Floats) -> Floats:
        """(k, k) what stripes do that are known worse than usual: each is off as a whole."""
        free = self.J.shape[1]
        if g.stripe is None:
            return np.zeros((free, free))
        stripe = np.unique(g.stripe[used], return_inverse=True)[1]
        off = doubt_along(stripe, residual, g.scale[used], g.usual)
        pull = np.zeros((int(stripe.max(initial=-1)) + 1, free))
        np.add.at(pull, stripe, self.J * (self.weight * off)[:, None])
        moves = pull @ self.inverse
        return np.asarray(moves.T @ moves)

    def answer(self, along: Floats) -> Floats:
        """(k,) what the parameters do when the vertices move by so much (n,) mm outward."""
        return np.asarray(-self.inverse @ (self.J.T @ (self.weight * along)))


def _inverse(N: Floats) -> Floats:
    s = 1.0 / np.sqrt(np.maximum(np.diagonal(N), 1e-300))
    try:
        return np.linalg.inv(N * np.outer(s, s)) * np.outer(s, s)
    except np.linalg.LinAlgError:
        return np.full_like(N, np.inf)


@dataclass(frozen=True)
class Known:
    """What is known of a fitted form."""

    own: Floats
    """(k, k) covariance of its parameters from its points alone."""
    moves: Floats
    """(m, k) what they do with one standard deviation of each common cause."""
    frame: Floats
    """(2, 3) unit vectors that its axis or normal tilts along."""

    @property
    def covariance(self) -> Floats:
        """(k, k) from its points and all common causes."""
        return self.own + self.moves.T @ self.moves


def known(
    g: Ground, form: Plane | Sphere | Cylinder, used: Index, moves: Iterable[Floats]
) -> Known:
    """What is known of a form fitted to the ``used`` vertices; ``moves`` are (v, 3) mm each."""
    q = np.zeros(10)
    if isinstance(form, Plane):
        kind, q[:3], q[3:6] = PLANE, form.centre, form.normal
    elif isinstance(form, Sphere):
        kind, q[:3], q[5], q[6] = SPHERE, form.centre, 1.0, form.radius
    else:
        kind, q[:3], q[3:6], q[6] = CYLINDER, form.point, form.axis, form.radius
    points = g.vertices[used]
    residual, J = surface.jacobian(kind, q, points)
    budget = Budget(g, used, residual, J[:, FREE[kind]])
    n = surface.distances(kind, q, points)[1]
    answers = [budget.answer(np.einsum("ij,ij->i", n, np.asarray(m)[used])) for m in moves]
    free = len(budget.covariance)
    return Known(
        budget.covariance,
        np.array(answers, dtype=np.float64).reshape(-1, free),
        np.array(surface.frame(q[3:6])),
    )


def fit_whole(
    fit: Callable[[Floats, Floats | None], _Round], mesh: Mesh, moves: Iterable[Floats] = ()
) -> _Round:
    """A sphere or cylinder through every measured vertex of a mesh, as well known as the search for
    shapes would say; ``moves`` (v, 3) mm as for `find_shapes`. Of points without faces nothing is
    known but their scatter, or their sigma where that is larger.

    Raises what the ``fit`` does.
    """
    form = fit(*measured_points(mesh))
    if not len(mesh.faces):
        return form
    part, back = measured_part(mesh)
    ground = prepared(part, sigma_of(part), None)
    every = np.arange(len(part.vertices))
    found: Known = known(ground, form, every, (np.asarray(m)[back] for m in moves))
    turn = np.eye(len(found.covariance))
    if isinstance(form, Sphere):  # its centre is known along a frame, and told in x, y and z
        e1, e2 = found.frame
        turn[:3, :3] = np.stack([e1, e2, np.cross(e1, e2)])
    return replace(form, covariance=turn.T @ found.covariance @ turn)
