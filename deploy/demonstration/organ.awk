# A CT of an organ that nobody has, as NRRD: a lobe, thick on one side and thin on the other, with two vessels in it. A smaller lobe above and a notch below
# make its outline like no mirror image of it, so that it can be found in pictures. LC_ALL=C awk -f organ.awk > organ.nrrd
BEGIN {
  columns = 64; rows = 48; slices = 44; mm = 3
  printf "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: %d %d %d\n", columns, rows, slices
  printf "space directions: (%d,0,0) (0,%d,0) (0,0,%d)\n", mm, mm, mm
  printf "space origin: (%d,%d,%d)\nencoding: ascii\n\n", -columns * mm / 2, -rows * mm / 2, -slices * mm / 2
  printf "-1000"  # air somewhere, as in every CT
  for (k = 0; k < slices; ++k)
    for (j = 0; j < rows; ++j)
      for (i = 0; i < columns; ++i)
        if (i + j + k > 0)
          printf "%s%d", i == 0 ? "\n" : " ", hounsfield((i - columns / 2) * mm, (j - rows / 2) * mm, (k - slices / 2) * mm)
  print ""
}
function hounsfield(x, y, z,   thin, share, lobe, notch) {
  thin = (x + 75) / 150
  # A voxel at the surface holds some of both sides, as in every CT.
  share = (1 - sqrt((x / 80) ^ 2 + (y / (48 - 26 * thin)) ^ 2 + (z / (44 - 22 * thin)) ^ 2)) * 7 + 0.5
  lobe = (1 - sqrt(((x + 50) / 20) ^ 2 + (y / 24) ^ 2 + ((z - 33) / 23) ^ 2)) * 5 + 0.5
  if (lobe > share) share = lobe
  notch = (sqrt(((x - 40) / 15) ^ 2 + ((z + 30) / 18) ^ 2) - 1) * 4 + 0.5
  if (notch < share) share = notch
  if (share <= 0) return -90
  if (share < 1) return -90 + 150 * share
  if ((y - 8 * sin(x / 22)) ^ 2 + (z - 10 * cos(x / 30)) ^ 2 < 30) return 170
  if ((y + 14 - x / 6) ^ 2 + (z + 6 + x / 5) ^ 2 < 14) return 160
  return 60 + 6 * sin(x / 3) * sin(y / 4 + z / 6)
}
