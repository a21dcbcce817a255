#include "viewer/playback/case_timeline.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include <nlohmann/json.hpp>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/brackets.h"
#include "archive/verify/folder_names.h"
#include "archive/verify/found_files.h"
#include "viewer/playback/case_events.h"

namespace kiroku::playback {
namespace {

constexpr std::size_t kLargestToken = std::size_t{1} << 20;
constexpr std::size_t kLargestNote = std::size_t{1} << 16;

using Kind = TimelineToken::Kind;

std::optional<std::string> read_file(const archive::CaseFolder& folder, const std::string& file,
                                     std::size_t most) {
  const archive::FileOpening opening = folder.open_file(file);
  return opening.file ? archive::read_small(*opening.file, most) : std::nullopt;
}

Kind kind_of(const archive::CaseFolder& folder, const archive::TokenEntry& token,
             const timestamp::TrustStore& trust) {
  const auto response = read_file(folder, token.file, kLargestToken);
  const auto note = read_file(folder, archive::note_path(token.checkpoint), kLargestNote);
  const auto name = archive::token_of_path(token.file);
  if (!response || !note || !name) return Kind::kNotJudged;
  std::string why;
  const auto judging = archive::judging_of(name->form, bytes_of(*response), bytes_of(*note), why);
  if (!judging) return Kind::kNotJudged;
  const timestamp::TokenJudgement judgement =
      timestamp::judge_token(judging->token, judging->expectation, trust);
  const bool holds = judgement.code == timestamp::TokenCode::kValid &&
                     judgement.info->gen_time == token.gen_time &&
                     judgement.info->accuracy_ns == token.accuracy_ns;
  if (!holds) return Kind::kNotJudged;
  return judgement.authority == timestamp::TimeAuthority::kOutside ? Kind::kExternal : Kind::kSelfIssued;
}

std::vector<TimelineCheckpoint> checkpoints_of(const std::filesystem::path& folder,
                                               const std::vector<std::int64_t>& entry_times) {
  std::vector<TimelineCheckpoint> checkpoints;
  std::error_code failed;
  for (const auto& file : std::filesystem::directory_iterator(folder / archive::kCheckpointsFolder, failed)) {
    const auto size = archive::size_of_note_name(file.path().filename().string());
    if (size && *size > 0 && *size <= entry_times.size()) {
      checkpoints.push_back({entry_times[*size - 1], *size});
    }
  }
  std::sort(checkpoints.begin(), checkpoints.end(),
            [](const TimelineCheckpoint& a, const TimelineCheckpoint& b) { return a.size < b.size; });
  return checkpoints;
}

std::vector<TimelineBracket> brackets_on_clock(const std::vector<archive::StampedToken>& tokens,
                                               const std::vector<std::int64_t>& entry_times) {
  std::vector<TimelineBracket> brackets;
  for (const archive::Bracket& bracket : archive::brackets_of(tokens, 0, entry_times.size())) {
    const std::size_t after = std::min<std::size_t>(bracket.last_entry + 1, entry_times.size() - 1);
    brackets.push_back({entry_times[bracket.first_entry], entry_times[after], bracket.not_before,
                        bracket.not_after, bracket.authority_before, bracket.authority_after, bracket.time});
  }
  return brackets;
}

}  // namespace

Timeline timeline_of(const archive::CaseReader& recording, const timestamp::TrustStore& trust) {
  Timeline timeline;
  const std::vector<std::int64_t>& entry_times = recording.entry_times();
  std::vector<archive::StampedToken> external, self_issued;
  const archive::CaseFolder folder = archive::CaseFolder::open(recording.folder());
  for (const archive::SegmentEntry& segment : recording.segments()) {
    timeline.segments.push_back(
        {segment.stream, segment.index, segment.span, segment.complete, recording.is_erased(segment)});
  }
  timeline.gaps = recording.gaps();
  for (const archive::CaseReader::StatedToken& stated : recording.tokens()) {
    const archive::TokenEntry& token = stated.entry;
    const Kind kind = kind_of(folder, token, trust);
    timeline.tokens.push_back({stated.mono_ns, token.gen_time, token.authority, token.checkpoint, kind});
    if (kind == Kind::kNotJudged) continue;
    (kind == Kind::kExternal ? external : self_issued)
        .push_back({stated.seq,
                    token.checkpoint,
                    token.gen_time,
                    token.accuracy_ns,
                    token.authority,
                    {},
                    {},
                    kind == Kind::kExternal});
  }
  timeline.checkpoints = checkpoints_of(recording.folder(), entry_times);
  const auto& proving = external.empty() ? self_issued : external;
  if (!proving.empty()) timeline.brackets = brackets_on_clock(proving, entry_times);
  return timeline;
}

TimelineMarks marks_of(const CaseMedia& media) {
  TimelineMarks found;
  found.events_lacking = for_each_event(media, [&](const nlohmann::json& event) {
    if (event.value("kind", "") != "mark") return;
    found.marks.push_back({event.value("time_ns", std::int64_t{0}), event.value("text", std::string())});
  });
  std::ranges::stable_sort(found.marks, {}, &TimelineMark::time_ns);
  return found;
}

}  // namespace kiroku::playback
