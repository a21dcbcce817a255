#include "sim/mesh/pvd_reader.h"

#include <charconv>
#include <cmath>
#include <pugixml.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_reader.h"

namespace kiroku::sim {
namespace {

namespace fs = std::filesystem;

double time_of(const pugi::xml_node& frame, const std::string& refused) {
  const std::string_view text = frame.attribute("timestep").value();
  double time_s = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), time_s);
  if (failed != std::errc() || end != text.data() + text.size() || !std::isfinite(time_s)) {
    throw Error(refused + "the time step of '" + frame.attribute("file").value() + "' is '" +
                std::string(text) + "', no number");
  }
  return time_s;
}

}  // namespace

std::vector<ListedFrame> parse_pvd(std::string_view text, const fs::path& name) {
  const std::string refused = "cannot use " + name.string() + ": ";
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(text.data(), text.size());
  const pugi::xml_node list = document.child("VTKFile").child("Collection");
  if (!parsed || !list)
    throw Error(refused + "it is no list of frames (.pvd), or cut off; take what 'kiroku sim respire' wrote");
  std::vector<ListedFrame> frames;
  for (const pugi::xml_node& frame : list.children("DataSet")) {
    const fs::path file = fs::path(frame.attribute("file").value()).lexically_normal();
    if (file.empty() || file.is_absolute() || *file.begin() == "..")
      throw Error(refused + "its frame '" + file.string() + "' is not below the list's folder");
    const double time_s = time_of(frame, refused);
    if (!frames.empty() && !(time_s > frames.back().time_s)) {
      throw Error(refused + "the frame at " + number_text(time_s) + " s follows one at " +
                  number_text(frames.back().time_s) + " s");
    }
    frames.push_back({time_s, name.parent_path() / file});
  }
  if (frames.empty()) throw Error(refused + "it lists no frames");
  return frames;
}

std::vector<ListedFrame> read_pvd(const fs::path& file) { return parse_pvd(read_mesh_text(file), file); }

}  // namespace kiroku::sim
