#include "media/export/case_export.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <set>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "media/export/exporter.h"
#include "media/output_file.h"
#include "media/output_folder.h"

namespace kiroku::media {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kFormat = "kiroku-export/1";
constexpr std::int64_t kNsPerSecond = 1'000'000'000;

/// What cannot be an earlier export may be anything that somebody needs.
std::string why_kept(const fs::path& folder) {
  std::ifstream input(folder / kExportManifest);
  const ordered_json manifest = ordered_json::parse(input, nullptr, false);
  if (!manifest.is_object() || !manifest.contains("format") || manifest["format"] != kFormat ||
      !manifest.contains("files") || !manifest["files"].is_array()) {
    return "it is no earlier export";
  }
  std::set<std::string> known{kExportManifest};
  for (const ordered_json& file : manifest["files"]) {
    for (const char* name : {"file", "frame_times"}) {
      if (file.is_object() && file.contains(name) && file[name].is_string()) {
        known.insert(file[name].get<std::string>());
      }
    }
  }
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!known.contains(name) || !entry.is_regular_file())
      return "'" + name + "' in it is not of the earlier export";
  }
  return "";
}

crypto::Sha256Digest digest_of(const fs::path& file) {
  constexpr std::size_t kReadBytes = 1U << 20;
  std::ifstream input(file, std::ios::binary);
  crypto::Sha256 hash;
  std::string buffer(kReadBytes, '\0');
  while (input) {
    input.read(buffer.data(), std::ptrdiff_t(buffer.size()));
    hash.update(bytes_of(std::string_view(buffer).substr(0, std::size_t(input.gcount()))));
  }
  if (!input.eof()) throw Error("cannot read back " + file.string());
  return hash.finish();
}

/// "12.040000": seconds with six decimals, as ffprobe prints them.
std::string seconds_text(std::int64_t ns) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%s%lld.%06lld", ns < 0 ? "-" : "",
                static_cast<long long>(std::abs(ns) / kNsPerSecond),
                static_cast<long long>(std::abs(ns) % kNsPerSecond / 1000));
  return text.data();
}

/// When each picture is shown, as a table beside the film.
class FrameTimes {
 public:
  FrameTimes(fs::path file, std::int64_t zero_ns)
      : output_(std::move(file), false), zero_ns_(zero_ns), text_("frame,time,case_time\n") {}
  void add(std::int64_t time_ns) {
    if (count_ == 0) first_ns_ = time_ns;
    text_ += std::to_string(count_++) + "," + seconds_text(time_ns) + "," + seconds_text(zero_ns_ + time_ns) +
             "\n";
    constexpr std::size_t kPieceBytes = 256U << 10;
    if (text_.size() >= kPieceBytes) flush();
  }
  void commit() {
    flush();
    output_.commit();
  }
  /// Of the first picture; nothing where there was none.
  [[nodiscard]] std::optional<std::int64_t> first_ns() const { return first_ns_; }

 private:
  void flush() {
    output_.write(bytes_of(text_));
    text_.clear();
  }
  OutputFile output_;
  std::int64_t zero_ns_;
  std::string text_;
  std::uint64_t count_ = 0;
  std::optional<std::int64_t> first_ns_;
};

class CaseExport {
 public:
  CaseExport(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
             const CaseExportOptions& options)
      : recording_(recording),
        identities_(identities),
        options_(options),
        zero_ns_(export_zero_ns(recording, options.from_ns, options.to_ns)),
        folder_(options.folder, options.overwrite, why_kept) {
    for (const archive::StreamInfo& stream : recording.opening().streams) {
      std::uint64_t bytes = 0;
      for (const archive::SegmentEntry& segment : left_of(stream)) bytes += segment.file.bytes;
      total_bytes_ += bytes * endings_of(stream).size();
    }
  }

  CaseExportResult run() {
    ordered_json streams = ordered_json::array();
    for (const archive::StreamInfo& stream : recording_.opening().streams) streams.push_back(take(stream));
    if (result_.files.empty()) {
      throw UsageError("nothing that can be exported is left of case " + recording_.opening().case_id +
                       " in that time");
    }
    result_.manifest = head();
    result_.manifest["streams"] = std::move(streams);
    result_.manifest["files"] = std::move(files_);
    OutputFile manifest(folder_.path() / kExportManifest, false);
    const std::string text =
        result_.manifest.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    manifest.write(bytes_of(text));
    manifest.commit();
    folder_.commit();
    return std::move(result_);
  }

 private:
  static std::vector<std::string> endings_of(const archive::StreamInfo& stream) {
    if (stream.media.starts_with("video/") || stream.media.starts_with("audio/")) return {".mkv"};
    if (stream.kind == "vitals") return {".csv", ".jsonl"};
    return {".jsonl"};
  }

  [[nodiscard]] std::string utc_at(std::int64_t case_ns) const {
    return format_utc(recording_.wall_clock().at(case_ns));
  }

  [[nodiscard]] std::vector<archive::SegmentEntry> left_of(const archive::StreamInfo& stream) const {
    auto segments = recording_.segments(stream.name, options_.from_ns, options_.to_ns);
    std::erase_if(segments, [&](const auto& segment) { return recording_.is_erased(segment); });
    return segments;
  }

  [[nodiscard]] ordered_json head() const {
    const std::int64_t begins_ns = recording_.opening().begins_ns;
    const std::int64_t ends_ns = begins_ns + recording_.duration_ns();
    ordered_json head;
    head["format"] = kFormat;
    head["made"] = {{"utc", format_utc(utc_now())}, {"by", options_.made_by}, {"program", options_.program}};
    if (options_.purpose) head["purpose"] = *options_.purpose;
    head["case"] = recording_.opening().case_id;
    head["device"] = recording_.opening().device;
    head["case_span"] = {{"start_ns", begins_ns}, {"end_ns", ends_ns}};
    head["stretch"] = {{"start_ns", std::max(options_.from_ns, begins_ns)},
                       {"end_ns", std::min(options_.to_ns, ends_ns)}};
    head["zero"] = {{"case_ns", zero_ns_}, {"utc", utc_at(zero_ns_)}};
    head["verification"] = options_.verification;
    return head;
  }

  ordered_json take(const archive::StreamInfo& stream) {
    if (!left_of(stream).empty()) {
      for (const std::string& ending : endings_of(stream)) {
        if (ending == ".mkv") {
          take_pictures(stream);
        } else {
          take_lines(stream, stream.name + ending);
        }
      }
    }
    ordered_json erased = ordered_json::array();
    for (const archive::SegmentEntry& segment :
         recording_.segments(stream.name, options_.from_ns, options_.to_ns)) {
      const archive::ErasedEntry* const erasure = recording_.erasure_of(segment);
      if (erasure == nullptr) continue;
      erased.push_back({{"start_ns", segment.span.start_ns},
                        {"end_ns", segment.span.end_ns},
                        {"policy", erasure->policy}});
    }
    return {{"name", stream.name},
            {"kind", stream.kind},
            {"purpose", stream.purpose},
            {"source", stream.source},
            {"timing", stream.timing},
            {"gaps", told(recording_.gaps(stream.name))},
            {"sound_gaps", told(recording_.sound_gaps(stream.name))},
            {"erased", std::move(erased)}};
  }

  /// Those that the export meets.
  [[nodiscard]] ordered_json told(const std::vector<archive::GapEntry>& gaps) const {
    ordered_json told = ordered_json::array();
    for (const archive::GapEntry& gap : gaps) {
      if (!archive::meets(gap.span, options_.from_ns, options_.to_ns)) continue;
      told.push_back({{"start_ns", gap.span.start_ns},
                      {"end_ns", gap.span.end_ns},
                      {"time", seconds(gap.span.start_ns - zero_ns_)},
                      {"cause", archive::gap_cause_name(gap.cause)}});
    }
    return told;
  }

  static double seconds(std::int64_t ns) { return double(ns) / double(kNsPerSecond); }

  [[nodiscard]] ExportOptions request_for(const archive::StreamInfo& stream, const std::string& file) {
    ExportOptions request;
    request.stream = stream.name;
    request.zero_ns = zero_ns_;
    request.pass_over_erased = true;
    request.output = folder_.path() / file;
    request.progress = [this](std::uint64_t done, std::uint64_t) {
      if (options_.progress) options_.progress(done_bytes_ + done, total_bytes_);
    };
    return request;
  }

  /// One file, or several where pictures change their size or form.
  void take_pictures(const archive::StreamInfo& stream) {
    std::int64_t from_ns = options_.from_ns;
    for (int number = 1; from_ns < options_.to_ns; ++number) {
      const std::string name = stream.name + (number == 1 ? "" : "-" + std::to_string(number));
      const archive::Span tried{from_ns, options_.to_ns};
      std::int64_t until_ns = take_film(stream, name, tried);
      if (until_ns < options_.to_ns) take_film(stream, name, {from_ns, until_ns});
      from_ns = until_ns;
    }
  }

  /// Where it ended: before the stretch's end nothing was written, since pictures change there.
  std::int64_t take_film(const archive::StreamInfo& stream, const std::string& name,
                         const archive::Span& stretch) {
    const std::string file = name + ".mkv", times_file = name + ".frames.csv";
    ExportOptions request = request_for(stream, file);
    request.from_ns = stretch.start_ns;
    request.to_ns = stretch.end_ns;
    FrameTimes times(folder_.path() / times_file, zero_ns_);
    request.on_picture = [&times](std::int64_t time_ns) { times.add(time_ns); };
    try {
      const ExportResult result = export_stream(recording_, identities_, request);
      times.commit();
      enter(stream, file, result, times.first_ns(), times_file);
    } catch (const FormatChanged& change) {
      // A change at the very start cannot be: the first segment decides.
      if (change.at_ns() <= stretch.start_ns) throw;
      return change.at_ns();
    }
    return stretch.end_ns;
  }

  void take_lines(const archive::StreamInfo& stream, const std::string& file) {
    ExportOptions request = request_for(stream, file);
    request.from_ns = options_.from_ns;
    request.to_ns = options_.to_ns;
    enter(stream, file, export_stream(recording_, identities_, request), std::nullopt, "");
  }

  void enter(const archive::StreamInfo& stream, const std::string& file, const ExportResult& result,
             const std::optional<std::int64_t>& first_ns, const std::string& times_file) {
    const std::int64_t start_ns = first_ns ? zero_ns_ + *first_ns : result.start_ns;
    ordered_json entry{{"file", file},
                       {"stream", stream.name},
                       {"bytes", result.bytes},
                       {"sha256", crypto::to_hex(digest_of(folder_.path() / file))},
                       {"start_ns", start_ns},
                       {"end_ns", result.end_ns},
                       {"time", seconds(start_ns - zero_ns_)},
                       {"start_utc", utc_at(start_ns)},
                       {stream.kind == "video" ? "frames" : "lines", result.frames},
                       {"segments", result.segments},
                       {"incomplete_segments", result.incomplete},
                       {"uncounted_segments", result.uncounted}};
    if (result.left_out > 0) entry["left_out"] = result.left_out;
    result_.files.push_back(file);
    result_.bytes += result.bytes;
    if (!times_file.empty()) {
      const fs::path times = folder_.path() / times_file;
      entry["frame_times"] = times_file;
      entry["frame_times_sha256"] = crypto::to_hex(digest_of(times));
      result_.files.push_back(times_file);
      result_.bytes += fs::file_size(times);
    }
    files_.push_back(std::move(entry));
    for (const archive::SegmentEntry& segment : left_of(stream)) {
      if (archive::meets(segment.span, result.start_ns, result.end_ns)) done_bytes_ += segment.file.bytes;
    }
  }

  const archive::CaseReader& recording_;
  const crypto::AgeIdentities& identities_;
  const CaseExportOptions& options_;
  std::int64_t zero_ns_;
  OutputFolder folder_;
  std::uint64_t done_bytes_ = 0, total_bytes_ = 0;
  ordered_json files_ = ordered_json::array();
  CaseExportResult result_;
};

}  // namespace

CaseExportResult export_case(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                             const CaseExportOptions& options) {
  return CaseExport(recording, identities, options).run();
}

}  // namespace kiroku::media
