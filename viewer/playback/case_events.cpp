#include "viewer/playback/case_events.h"

#include <optional>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "archive/format/pointing_stream.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "media/plaintext_lines.h"

namespace kiroku::playback {
namespace {

constexpr std::size_t kLongestEvent = std::size_t{16} << 20;

/// The event of a line as text, if the line's own commitment is among those of the ledger.
std::optional<nlohmann::json> committed_event(std::string_view line,
                                              const std::set<crypto::Sha256Digest>& commitments) {
  const auto parsed = parse_foreign_json(line);
  if (!parsed.is_object() || !parsed.contains("salt") || !parsed.contains("event") ||
      !parsed["salt"].is_string() || !parsed["event"].is_string()) {
    return std::nullopt;
  }
  const auto& event = parsed["event"].get_ref<const std::string&>();
  std::optional<Bytes> committed = crypto::from_hex(parsed["salt"].get_ref<const std::string&>());
  if (!committed) return std::nullopt;
  append(*committed, bytes_of(event));
  if (!commitments.contains(crypto::sha256(*committed))) return std::nullopt;
  return parse_foreign_json(event);
}

}  // namespace

void for_each_event(const CaseMedia& media, const std::function<void(const nlohmann::json& event)>& visit) {
  std::set<crypto::Sha256Digest> commitments;
  media.recording().for_each([&](const archive::CaseEntry& entry) {
    if (const auto* const mark = std::get_if<archive::MarkEntry>(&entry.body)) {
      commitments.insert(mark->commitment);
    }
  });
  if (commitments.empty()) return;
  for (const archive::StreamInfo& stream : media.recording().opening().streams) {
    if (stream.kind != "events" || archive::is_pointing(stream)) continue;
    for (const archive::SegmentEntry& segment :
         media.recording().segments(stream.name, INT64_MIN, INT64_MAX)) {
      if (media.recording().is_erased(segment)) continue;
      const media::SealedSegment plain = media.open(segment);
      media::for_each_line(plain, segment.file.file, kLongestEvent, !segment.complete,
                           [&](std::uint64_t, std::string_view line) {
                             const auto event = committed_event(line, commitments);
                             if (event && event->is_object()) visit(*event);
                           });
    }
  }
}

}  // namespace kiroku::playback
