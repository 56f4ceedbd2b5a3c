"""Make the mesh of the skin: ``python -m tools.make_skin`` writes ``veca_marl/data/skin_*.csv``.

Run it after a change of the bones' primitives in ``veca_marl/data/bones.csv``.
``--measure`` writes nothing and prints how far the stored mesh is from the felt skin.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from tools.make_skin.fit import fit
from tools.make_skin.loft import Loft, lofted
from tools.make_skin.measure import measured
from veca_marl.sim.body.anatomy import Skeleton, load_skeleton

FOLDER = Path(__file__).resolve().parents[2] / "veca_marl" / "data"
_DECIMALS = 6  # micrometres


def main() -> None:
    """Loft, fit and write, or measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--measure", action="store_true", help="measure the stored mesh")
    if parser.parse_args().measure:
        print("\n".join(measured()))
        return
    skeleton = load_skeleton()
    loft = lofted(skeleton)
    worst_m = fit(loft, skeleton)
    _write("skin_vertices.csv", ("bone", "x", "y", "z"), _vertex_rows(loft, skeleton))
    _write("skin_triangles.csv", ("bone", "a", "b", "c"), _triangle_rows(loft, skeleton))
    print(f"{FOLDER}: no outer taxel is farther than {1e3 * worst_m:.2f} mm from the felt skin")


def _vertex_rows(loft: Loft, skeleton: Skeleton) -> Iterable[Sequence[object]]:
    for owner, point in zip(loft.owners, loft.points, strict=True):
        # + 0.0 turns -0.0 into 0.0
        yield skeleton.bones[owner].name, *(float(x) for x in np.round(point, _DECIMALS) + 0.0)


def _triangle_rows(loft: Loft, skeleton: Skeleton) -> Iterable[Sequence[object]]:
    for triangle in np.argsort(loft.triangle_bones, kind="stable"):
        yield skeleton.bones[loft.triangle_bones[triangle]].name, *loft.triangles[triangle]


def _write(name: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with (FOLDER / name).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


if __name__ == "__main__":
    main()
