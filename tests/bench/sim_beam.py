#!/usr/bin/env python3
"""sim_beam.py N FOLDER: a cantilever of 100 x 10 x 10 mm with N cells across (N=8: 6,561 nodes, N=12: 20,449), clamped at x = 0 and pulled down at
the other end, as beam.msh + beam.json (kiroku sim solve) and beam.inp (CalculiX: same nodes, same tetrahedra, same loads)."""
import sys

YOUNG_PA, POISSON, LOAD_N = 10e3, 0.45, 1e-4
# From corner to opposite corner along the axes in each of their six orders; the second half is turned.
ORDERS = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]

n, folder = int(sys.argv[1]), sys.argv[2]
cells = (10 * n, n, n)


def number(i, j, k):  # from 1, x fastest
    return 1 + i + (cells[0] + 1) * (j + (cells[1] + 1) * k)


nodes = [
    (100 * i / cells[0], 10 * j / n, 10 * k / n) for k in range(n + 1) for j in range(n + 1) for i in range(cells[0] + 1)
]
tetrahedra = []
for k in range(n):
    for j in range(n):
        for i in range(cells[0]):
            for turned, order in enumerate(ORDERS):
                at = [i, j, k]
                corners = [number(*at)]
                for axis in order:
                    at[axis] += 1
                    corners.append(number(*at))
                if turned >= 3:
                    corners[2], corners[3] = corners[3], corners[2]
                tetrahedra.append(corners)
left = [i + 1 for i, node in enumerate(nodes) if node[0] == 0]
right = [i + 1 for i, node in enumerate(nodes) if node[0] == 100]

with open(f"{folder}/beam.msh", "w") as out:
    out.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(nodes)}\n")
    out.writelines(f"{i + 1} {x!r} {y!r} {z!r}\n" for i, (x, y, z) in enumerate(nodes))
    out.write(f"$EndNodes\n$Elements\n{len(tetrahedra)}\n")
    out.writelines(f"{i + 1} 4 2 1 1 {a} {b} {c} {d}\n" for i, (a, b, c, d) in enumerate(tetrahedra))
    out.write("$EndElements\n")
with open(f"{folder}/beam.json", "w") as out:
    out.write(
        f"""{{"mesh": "beam.msh", "length_unit": "mm",
 "materials": [{{"region": "all", "young_modulus_pa": {YOUNG_PA}, "poisson_ratio": {POISSON}}}],
 "fixed": [{{"box": [[0, 0, 0], [0, 10, 10]], "displacement": [0, 0, 0]}}],
 "forces": [{{"box": [[100, 0, 0], [100, 10, 10]], "force_n": [0, 0, {-LOAD_N}]}}]}}
"""
    )
# CalculiX in mm, N and MPa; it reads numbers of at most 20 characters. Displacements and stress go into the result file, as in the .vtu.
with open(f"{folder}/beam.inp", "w") as out:
    out.write("*NODE, NSET=ALL\n")
    out.writelines(f"{i + 1}, {x!r}, {y!r}, {z!r}\n" for i, (x, y, z) in enumerate(nodes))
    out.write("*ELEMENT, TYPE=C3D4, ELSET=BODY\n")
    out.writelines(f"{i + 1}, {a}, {b}, {c}, {d}\n" for i, (a, b, c, d) in enumerate(tetrahedra))
    out.write("*NSET, NSET=LEFT\n" + "".join(f"{node},\n" for node in left))
    out.write(f"*MATERIAL, NAME=TISSUE\n*ELASTIC\n{YOUNG_PA / 1e6!r}, {POISSON}\n*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE\n")
    out.write("*BOUNDARY\nLEFT, 1, 3\n*STEP\n*STATIC, SOLVER=SPOOLES\n*CLOAD\n")
    out.writelines(f"{node}, 3, {-LOAD_N / len(right):.12e}\n" for node in right)
    out.write("*NODE FILE\nU, RF\n*EL FILE\nS\n*END STEP\n")
print(f"{len(nodes)} nodes, {len(tetrahedra)} tetrahedra")
