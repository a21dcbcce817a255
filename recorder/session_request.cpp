#include "recorder/session_request.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "archive/format/pointing_stream.h"
#include "base/error.h"
#include "base/foreign_json.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::milliseconds kShortestSegment{100};
// Format 1 allows ten seconds; the rest is for a source that is silent at a segment's end.
constexpr std::chrono::seconds kLongestSegment{9};
constexpr const char* kEventsStream = "events";

std::vector<std::string> names_of(const crypto::AgeRecipients& recipients) {
  std::vector<std::string> names;
  for (const auto& recipient : recipients) names.push_back(recipient->to_string());
  return names;
}

}  // namespace

std::size_t index_of(const std::vector<StreamRequest>& requests, const std::string& name) {
  const auto found = std::ranges::find(requests, name, &StreamRequest::name);
  return static_cast<std::size_t>(found - requests.begin());
}

void require_valid(const SessionOptions& options) {
  if (options.video.empty() && options.vitals.empty()) {
    throw UsageError("there is nothing to record: give at least one source");
  }
  for (std::size_t i = 0; i < options.video.size(); ++i) {
    const std::string& first = options.video[i].second_of;
    if (first.empty()) continue;
    const std::size_t found = index_of(options.video, first);
    if (found >= i || !options.video[found].second_of.empty()) {
      throw UsageError("stream '" + options.video[i].name + "' archives the pictures of '" + first +
                       "' a second time, and no stream before it has that name and a source of its own");
    }
  }
  if (options.segment_duration < kShortestSegment || options.segment_duration > kLongestSegment) {
    throw UsageError("a segment must last from 0.1 to 9 seconds");
  }
  if (options.stamp_interval <= std::chrono::nanoseconds(0)) {
    throw UsageError("the time between two time-stamps must be longer than nothing");
  }
  if (options.duration && *options.duration <= std::chrono::nanoseconds(0)) {
    throw UsageError("the duration must be longer than nothing");
  }
  for (const NamedAuthority& authority : options.authorities) {
    const auto same = [&](const NamedAuthority& other) { return other.name == authority.name; };
    if (!archive::is_short_name(authority.name) ||
        std::count_if(options.authorities.begin(), options.authorities.end(), same) > 1) {
      throw UsageError(
          "'" + authority.name +
          "' cannot name a time-stamping authority: names are unique, of up to 32 lower-case letters, "
          "digits and hyphens");
    }
  }
}

std::optional<SourceAddress> microphone_of(const StreamRequest& request) {
  if (request.microphone.empty()) return {};
  SourceAddress address = parse_source_address(request.microphone, Presence::kNotLookedAt);
  if (address.kind != SourceKind::kSound) {
    throw UsageError("microphone '" + request.microphone +
                     "' is none: write alsa:hw:1,0 as 'kiroku devices' lists it");
  }
  return address;
}

SourceAddress checked_address(const StreamRequest& request, const SessionOptions& options) {
  SourceAddress address = request.guard->look_up(
      request.source, request.may_be_absent ? Presence::kMayBeAbsent : Presence::kRequired);
  if (address.kind == SourceKind::kSound) {
    throw UsageError("source '" + address.stated +
                     "' has no pictures: name it as the microphone of a stream that has");
  }
  if (microphone_of(request) && address.unpaced()) {
    throw UsageError("source '" + address.stated +
                     "' states its own times: a microphone, which hears the present, cannot stand beside it");
  }
  if (address.unpaced() && !options.duration &&
      (address.kind == SourceKind::kSynthetic || address.option("loop", "0") == "1")) {
    throw UsageError("source '" + address.stated +
                     "' never ends and goes as fast as it can; say when to stop with --duration");
  }
  return address;
}

archive::StreamInfo stream_info(const StreamRequest& request, const SourceAddress& address, bool video) {
  archive::StreamInfo info;
  info.name = request.name;
  info.kind = video ? "video" : "vitals";
  info.media = video ? std::string(request.video.media()) : "application/jsonl";
  info.source = address.stated;
  if (!request.second_of.empty()) info.source += std::string(kPicturesOfStream) + request.second_of;
  if (const auto microphone = microphone_of(request)) info.source += "; sound from " + microphone->stated;
  info.profile = video ? std::string(profile_name(request.video.profile)) : "jsonl";
  info.purpose = request.purpose;
  info.recipients = names_of(request.recipients);
  info.timing = address.unpaced() || address.kind == SourceKind::kFile ? "source" : "arrival";
  return info;
}

archive::StreamInfo events_info(const crypto::AgeRecipients& recipients) {
  archive::StreamInfo info;
  info.name = info.kind = kEventsStream;
  info.media = "application/jsonl";
  info.source = "operator";
  info.profile = "jsonl";
  info.purpose = kEventsPurpose;
  info.recipients = names_of(recipients);
  return info;
}

archive::StreamInfo pointing_info(const crypto::AgeRecipients& recipients) {
  archive::StreamInfo info = events_info(recipients);
  info.name = archive::kPointingStream;
  info.source = "viewer";
  info.purpose = kPointingPurpose;
  return info;
}

std::vector<PatientNumber> numbers_of_subject(const Bytes& json) {
  std::vector<PatientNumber> numbers;
  try {
    const auto subject = parse_foreign_json<nlohmann::json>(text_of(json));
    const auto patient = subject.find("patient");
    if (!subject.is_object() || patient == subject.end() || !patient->is_object()) return {};
    const auto text = [&](const char* key) {
      const auto found = patient->find(key);
      if (found == patient->end()) return std::string();
      return found->is_string() ? found->get<std::string>() : found->is_number_integer() ? found->dump() : "";
    };
    if (!text("id").empty()) add_numbers(numbers, {{text("id"), text("id_issuer"), "", "", false}});
    if (!text("visit").empty()) add_numbers(numbers, {{text("visit"), "", "", "", true}});
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): a person's subject may be any JSON
  }
  return numbers;
}

nlohmann::ordered_json json_of(const ProfileDecision& decision, const std::vector<StreamRequest>& video) {
  nlohmann::ordered_json json;
  std::vector<std::string> streams = decision.streams;
  if (streams.empty() && !std::ranges::all_of(video, &std::string::empty, &StreamRequest::second_of)) {
    for (const StreamRequest& stream : video) {
      if (stream.second_of.empty()) streams.push_back(stream.name);
    }
  }
  if (!streams.empty()) json["streams"] = streams;
  json["to"] = profile_name(decision.profile);
  json["by"] = decision.by;
  if (!decision.why.empty()) json["why"] = decision.why;
  return json;
}

}  // namespace kiroku::recorder
