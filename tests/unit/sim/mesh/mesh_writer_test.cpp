#include "sim/mesh/mesh_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/mesh/mesh_reader.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

TEST(MeshWriter, WritesMshThatReadsBackToTheBit) {
  TetMesh mesh = test::tet_grid({3, 2, 2}, {0.1, 1.0 / 3, 2e-7});
  for (std::size_t t = 0; t < mesh.regions.size(); ++t) mesh.regions[t] = static_cast<std::int32_t>(t % 3);
  const TetMesh read = parse_msh(msh_text(mesh, LengthUnit::kMetre), "m", LengthUnit::kMetre).mesh;
  EXPECT_EQ(read.nodes, mesh.nodes);
  EXPECT_EQ(read.tetrahedra, mesh.tetrahedra);
  EXPECT_EQ(read.regions, mesh.regions);
}

TEST(MeshWriter, WritesVtu) {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {0.001, 0, 0}, {0, 0.002, 0}, {0, 0, 0.0005}};
  mesh.tetrahedra = {{0, 1, 2, 3}};
  mesh.regions = {7};
  const std::vector<double> depth{0, 1, -2.5, 1e-300}, tensor{1, 2};
  EXPECT_EQ(vtu_text(mesh, LengthUnit::kMillimetre, {{"depth", {}, depth}}, {{"pair", {"A", "B"}, tensor}}),
            R"(<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<UnstructuredGrid>
<Piece NumberOfPoints="4" NumberOfCells="1">
<PointData>
<DataArray type="Float64" Name="depth" NumberOfComponents="1" format="ascii">
0
1
-2.5
1e-300
</DataArray>
</PointData>
<CellData>
<DataArray type="Float64" Name="pair" NumberOfComponents="2" ComponentName0="A" ComponentName1="B" format="ascii">
1 2
</DataArray>
<DataArray type="Int32" Name="region" format="ascii">
7
</DataArray>
</CellData>
<Points>
<DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii">
0 0 0
1 0 0
0 2 0
0 0 0.5
</DataArray>
</Points>
<Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">
0 1 2 3
</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">
4
</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">
10
</DataArray>
</Cells>
</Piece>
</UnstructuredGrid>
</VTKFile>
)");
}

}  // namespace
}  // namespace kiroku::sim
