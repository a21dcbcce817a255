#include "sim/mesh/mesh_reader.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <sys/stat.h>

#include "base/ascii.h"
#include "base/error.h"

namespace kiroku::sim {

std::string read_mesh_text(const std::filesystem::path& file) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(file.c_str(), "rb"), &std::fclose);
  if (!in) throw IoError("read", file, errno);
  struct stat status {};
  if (::fstat(::fileno(in.get()), &status) != 0) throw IoError("read", file, errno);
  if (!S_ISREG(status.st_mode)) throw UsageError(file.string() + " is no regular file: name a mesh file");
  std::string text(static_cast<std::size_t>(status.st_size), '\0');
  if (std::fread(text.data(), 1, text.size(), in.get()) != text.size()) {
    throw IoError("read", file, std::ferror(in.get()) != 0 ? errno : EIO);
  }
  return text;
}

MeshFile read_mesh(const std::filesystem::path& file, LengthUnit unit) {
  const std::string ending = lower_case(file.extension().string());
  const auto parse = ending == ".msh"   ? parse_msh
                     : ending == ".vtk" ? parse_vtk
                     : ending == ".veg" ? parse_veg
                                        : nullptr;
  if (parse == nullptr) {
    throw UsageError("cannot read the mesh " + file.string() + ": its ending is none of .msh, .vtk, .veg");
  }
  return parse(read_mesh_text(file), file.string(), unit);
}

}  // namespace kiroku::sim
