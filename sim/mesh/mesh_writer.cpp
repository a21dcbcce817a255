#include "sim/mesh/mesh_writer.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <future>

namespace kiroku::sim {
namespace {

/// The shortest text that reads back as the same number.
template <typename Number>
void append(std::string& text, Number value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text.append(digits.data(), end);
}

void append_row(std::string& text, std::span<const double> values) {
  for (const double value : values) {
    assert(std::isfinite(value));
    append(text, value);
    text += ' ';
  }
  text.back() = '\n';
}

std::span<const double> in_unit(const Vector3& node, LengthUnit unit, Vector3& storage) {
  storage = node * units_per_metre(unit);
  return {storage.data(), 3};
}

void append_field(std::string& text, const VtuField& field) {
  const std::size_t components = std::max<std::size_t>(field.components.size(), 1);
  text += "<DataArray type=\"Float64\" Name=\"" + field.name + "\" NumberOfComponents=\"" +
          std::to_string(components) + '"';
  for (std::size_t i = 0; i < field.components.size(); ++i) {
    text += " ComponentName" + std::to_string(i) + "=\"" + field.components[i] + '"';
  }
  text += " format=\"ascii\">\n";
  for (std::size_t at = 0; at < field.values.size(); at += components) {
    append_row(text, field.values.subspan(at, components));
  }
  text += "</DataArray>\n";
}

template <typename Value>
void append_integers(std::string& text, const char* type, const char* name, std::size_t count, Value value) {
  text += std::string("<DataArray type=\"") + type + "\" Name=\"" + name + "\" format=\"ascii\">\n";
  for (std::size_t i = 0; i < count; ++i) {
    append(text, value(i));
    text += '\n';
  }
  text += "</DataArray>\n";
}

std::string cell_data_text(const TetMesh& mesh, const std::vector<VtuField>& cell_data) {
  std::string text = "<CellData>\n";
  for (const VtuField& field : cell_data) append_field(text, field);
  append_integers(text, "Int32", "region", mesh.tetrahedra.size(),
                  [&](std::size_t t) { return mesh.regions[t]; });
  text += "</CellData>\n";
  return text;
}

std::string geometry_text(const TetMesh& mesh, LengthUnit unit) {
  std::string text =
      "<Points>\n<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"ascii\">\n";
  Vector3 storage;
  for (const Vector3& node : mesh.nodes) append_row(text, in_unit(node, unit, storage));
  text +=
      "</DataArray>\n</Points>\n<Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">\n";
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    for (const std::uint32_t node : corners) {
      append(text, node);
      text += ' ';
    }
    text.back() = '\n';
  }
  text += "</DataArray>\n";
  append_integers(text, "Int64", "offsets", mesh.tetrahedra.size(),
                  [](std::size_t t) { return 4 * (t + 1); });
  append_integers(text, "UInt8", "types", mesh.tetrahedra.size(), [](std::size_t) { return 10; });
  text += "</Cells>\n";
  return text;
}

}  // namespace

std::string msh_text(const TetMesh& mesh, LengthUnit unit, const std::map<std::int32_t, std::string>& names) {
  std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
  if (!names.empty()) {
    text += "$PhysicalNames\n" + std::to_string(names.size()) + '\n';
    for (const auto& [region, name] : names) text += "3 " + std::to_string(region) + " \"" + name + "\"\n";
    text += "$EndPhysicalNames\n";
  }
  text += "$Nodes\n" + std::to_string(mesh.nodes.size()) + '\n';
  Vector3 storage;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    append(text, node + 1);
    text += ' ';
    append_row(text, in_unit(mesh.nodes[node], unit, storage));
  }
  text += "$EndNodes\n$Elements\n" + std::to_string(mesh.tetrahedra.size()) + '\n';
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    append(text, t + 1);
    text += " 4 2 ";
    append(text, mesh.regions[t]);
    text += ' ';
    append(text, mesh.regions[t]);
    for (const std::uint32_t node : mesh.tetrahedra[t]) {
      text += ' ';
      append(text, node + std::size_t{1});
    }
    text += '\n';
  }
  text += "$EndElements\n";
  return text;
}

std::string vtu_text(const TetMesh& mesh, LengthUnit unit, const std::vector<VtuField>& point_data,
                     const std::vector<VtuField>& cell_data) {
  // Two halves of about the same size, made at the same time.
  std::future<std::string> cells = std::async([&] { return cell_data_text(mesh, cell_data); });
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"" +
      std::to_string(mesh.nodes.size()) + "\" NumberOfCells=\"" + std::to_string(mesh.tetrahedra.size()) +
      "\">\n<PointData>\n";
  for (const VtuField& field : point_data) append_field(text, field);
  text += "</PointData>\n";
  const std::string geometry = geometry_text(mesh, unit);
  text += cells.get();
  text += geometry;
  text += "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
  return text;
}

}  // namespace kiroku::sim
