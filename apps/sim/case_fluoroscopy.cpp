#include "apps/sim/case_fluoroscopy.h"

#include <cmath>
#include <utility>

#include "base/error.h"
#include "viewer/compare/fluoroscopy.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr double kNsPerS = 1e9;

/// Takes the pictures of a film that are next to the marks of a slower clock, however unevenly they came.
class Thinning {
 public:
  explicit Thinning(double most_a_second) : most_a_second_(most_a_second) {}
  /// `time_s` ascends, from 0.
  bool takes(double time_s) {
    // A camera's times jitter: a picture that comes a little before its mark is the one that is meant.
    constexpr double kEarly = 0.25;
    const double marks = std::floor(time_s * most_a_second_ + kEarly);
    if (marks < next_) return false;
    next_ = marks + 1;
    return true;
  }

 private:
  double most_a_second_, next_ = 0;
};

}  // namespace

FoundFluoroscopy find_case_fluoroscopy(const Home& home, const CaseFluoroscopyRequest& request) {
  const fs::path folder = find_case(home, request.named);
  // The page shows it as the case of this name, and the log names it so.
  if (!home.holds(folder)) {
    throw UsageError(folder.string() + " is no case of this home's archive, " + home.archive().string() +
                     ": give --home, or a film of it by --radiographs");
  }
  archive::CaseReader recording = archive::CaseReader::open(folder);
  std::string stream = compare::fluoroscopy_of(recording, request.stream, request.stream_option);
  return {std::move(recording), std::move(stream)};
}

CaseFluoroscopy read_case_fluoroscopy(const Home& home, const FoundFluoroscopy& found,
                                      const CaseFluoroscopyRequest& request) {
  const auto& [recording, stream] = found;
  const archive::Span stretch = recording.parse_stretch(request.from, request.to);
  const sim::Polarity polarity =
      request.polarity == "bone-white" ? sim::Polarity::kBoneWhite : sim::Polarity::kBoneBlack;
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  log_access(home, recording.folder(), "opened " + stream + " to fit a breathing lung");
  const std::int64_t begins_ns = recording.opening().begins_ns;
  playback::PictureSpan reader(recording, identities, stream, stretch.start_ns, stretch.end_ns);
  Thinning thinning(request.most_a_second);
  CaseFluoroscopy read{{recording.opening().case_id, stream, 0}, {}, 0};
  std::int64_t first_ns = 0;
  std::size_t bytes = 0;
  while (reader.next()) {
    const std::int64_t at_ns = reader.time_ns();
    if (at_ns < stretch.start_ns || at_ns >= stretch.end_ns) continue;
    if (read.pictures++ == 0) first_ns = at_ns;
    const double time_s = static_cast<double>(at_ns - first_ns) / kNsPerS;
    if (!thinning.takes(time_s)) continue;
    const std::vector<std::uint8_t> rgb = reader.rgb();
    sim::ProjectionImage image = compare::radiograph_of({reader.width(), reader.height(), 3, rgb}, polarity);
    bytes += image.values.size() * sizeof(float);
    viewer::BreathingBench::require_memory_for(bytes);
    read.radiographs.push_back(
        {time_s, std::move(image),
         "the picture of " + stream + " at " + archive::case_time_text(at_ns, begins_ns)});
  }
  if (read.radiographs.empty()) {
    throw UsageError("stream '" + stream + "' of " + read.recording.case_id +
                     " holds no picture in what was asked for: nothing was recorded then, or it was erased");
  }
  read.recording.first_s = static_cast<double>(first_ns - begins_ns) / kNsPerS;
  return read;
}

fs::path geometry_beside(const Home& home, const std::string& stream) {
  const fs::path file = home.folder() / (stream + ".geometry.json");
  if (std::error_code ignored; fs::exists(file, ignored)) return file;
  throw UsageError("nothing says how the fluoroscope of '" + stream +
                   "' saw the patient: give --geometry, or put " + file.string() + " there");
}

}  // namespace kiroku::apps
