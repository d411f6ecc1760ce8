"""The colours of hits, for programs that find hits alone. No shadows, no mirrors."""

import numpy as np

from study.core.scene_json import Content


def colours(
    scene: Content, d: np.ndarray, met: np.ndarray, p: np.ndarray, n: np.ndarray, which: np.ndarray
) -> np.ndarray:
    """Linear colours of rays in the unit directions `d` (rays × 3), of which those of the mask `met` hit the
    shapes `which` at `p` with the unit normals `n`. As common/scenes/README.md has them."""
    d = d[met]
    n = np.where((n * d).sum(1, keepdims=True) > 0, -n, n)
    colour = np.array([m.color for m in scene.of_shapes])[which]
    shininess = np.array([m.shininess for m in scene.of_shapes])[which]
    to = np.subtract(scene.light.position, p)
    away = np.linalg.norm(to, axis=1, keepdims=True)
    to /= away
    facing = (n * to).sum(1, keepdims=True)
    emission = np.array(scene.light.emission) / away
    shine = np.maximum(-((2 * facing * n - to) * d).sum(1), 0) ** shininess
    made = colour * (0.01 + np.maximum(facing, 0) * emission)
    made += np.where(facing > 0, 0.2 * shine[:, None] * emission, 0)
    far = np.linalg.norm(p, axis=1, keepdims=True)
    made *= np.exp(-scene.fog * far**3)
    out = np.broadcast_to(np.array(scene.background), (len(met), 3)).copy()
    out[met] = np.where(far <= scene.march.bounds_radius, made, out[met])
    return out
