# A CT of a chest that nobody has, as NRRD: ribs, a spine and a right lung with vessels and a tumour, as the patient lies. With -v what=labels the lung
# (1) and its tumour (2) instead. LC_ALL=C awk -f chest.awk > ct.nrrd
BEGIN {
  columns = 66; rows = 52; slices = 60; mm = 4
  printf "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: %d %d %d\n", columns, rows, slices
  printf "space directions: (%d,0,0) (0,%d,0) (0,0,%d)\n", mm, mm, mm
  printf "space origin: (-140,-106,-110)\nencoding: ascii\n\n"
  for (k = 0; k < slices; ++k)
    for (j = 0; j < rows; ++j)
      for (i = 0; i < columns; ++i) printf "%d%s", voxel(mm * i - 70, mm * j - 104, mm * k - 110), i + 1 < columns ? " " : "\n"
}
function max(a, b) { return a > b ? a : b }
function voxel(x, y, z,   lung, tumour, across) {
  lung = (x / 40) ^ 2 + (y / 60) ^ 2 + (z / 80) ^ 2 < 1 && z > -50
  tumour = lung && x ^ 2 + (y + 15) ^ 2 + (z + 25) ^ 2 < 15 ^ 2
  if (what == "labels") return tumour ? 2 : lung ? 1 : 0
  if (tumour) return 30
  if (lung) return -820 + 350 * max(sin(0.09 * x + 0.04 * z) * sin(0.07 * y + 0.03 * z) * sin(0.06 * z - 0.05 * x), 0)
  if ((x - 62) ^ 2 + (y - 60) ^ 2 < 18 ^ 2) return 300 + 300 * sin(0.19 * z)
  across = sqrt(((x - 60) / 125) ^ 2 + (y / 95) ^ 2)
  if (across > 0.88 && across < 1 && sin(0.15 * (z + 0.3 * y)) > 0.4) return 600
  return across < 1 ? 20 : -1000
}
