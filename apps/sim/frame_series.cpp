#include "apps/sim/frame_series.h"

#include <cstdio>
#include <utility>

#include "apps/kiroku/output_file.h"
#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

namespace {

void remove_earlier_run(const fs::path& folder, const std::string& name,
                        const std::vector<std::string>& others) {
  std::error_code failed;
  const auto remove = [&](const fs::path& file) {
    fs::remove(file, failed);
    if (failed) throw IoError("remove", file, failed.value());
  };
  remove(folder / (name + ".pvd"));
  for (const std::string& other : others) remove(folder / other);
  if (!fs::is_directory(folder / "frames")) return;
  std::vector<fs::path> frames;
  for (const auto& entry : fs::directory_iterator(folder / "frames")) {
    if (entry.path().extension() == ".vtu") frames.push_back(entry.path());
  }
  for (const fs::path& frame : frames) remove(frame);
}

}  // namespace

void write_text_file(const fs::path& file, const std::string& text) {
  OutputFile out(file);
  out.write(bytes_of(text));
  out.commit(OutputFile::Durability::kEventually);
}

FrameSeries::FrameSeries(fs::path folder, std::string name, bool force,
                         const std::vector<std::string>& others)
    : folder_(std::move(folder)), name_(std::move(name)) {
  std::error_code failed;
  if (fs::exists(folder_) && !fs::is_directory(folder_))
    throw UsageError("--output is '" + folder_.string() + "', which is no folder: name another");
  if (fs::exists(folder_) && force) remove_earlier_run(folder_, name_, others);
  if (fs::exists(folder_) && !force && !fs::is_empty(folder_)) {
    throw UsageError("--output is '" + folder_.string() +
                     "', which is there and not an empty folder: name another, or give --force to replace "
                     "an earlier run");
  }
  fs::create_directories(folder_ / "frames", failed);
  if (failed) throw IoError("create", folder_ / "frames", failed.value());
}

void FrameSeries::add(double time_s, const std::string& vtu) {
  char name[32];
  std::snprintf(name, sizeof name, "frames/%05zu.vtu", count_++);
  write_text_file(folder_ / name, vtu);
  list_ += "    <DataSet timestep=\"" + number_text(time_s, 12) + "\" file=\"" + name + "\"/>\n";
}

void FrameSeries::finish() const {
  write_text_file(folder_ / (name_ + ".pvd"),
                  "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n  <Collection>\n" +
                      list_ + "  </Collection>\n</VTKFile>\n");
}

}  // namespace kiroku::apps
