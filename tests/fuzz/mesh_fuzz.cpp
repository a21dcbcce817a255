// Mesh files of every format, and the checks of what was read: nothing but kiroku::Error may come of them.
#include "base/error.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_reader.h"
#include "sim/mesh/mesh_writer.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kiroku::sim;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const auto parse : {parse_msh, parse_vtk, parse_veg}) {
    try {
      const MeshFile file = parse(text, "mesh", LengthUnit::kMillimetre);
      check_mesh(file.mesh);
      msh_text(file.mesh, LengthUnit::kMillimetre);
    } catch (const kiroku::Error&) {
    }
  }
  return 0;
}
