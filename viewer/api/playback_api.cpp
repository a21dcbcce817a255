#include <functional>
#include <memory>

#include <nlohmann/json.hpp>

#include "archive/format/json_writer.h"
#include "base/json_or_null.h"
#include "crypto/age_error.h"
#include "media/vital_codes.h"
#include "viewer/api/api.h"
#include "viewer/api/playback_store.h"
#include "viewer/http/own_folder.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;
using playback::CasePlayback;

constexpr std::int64_t kUsualBins = 1000;
constexpr std::int64_t kMostBins = 20'000;
constexpr int kPatienceMs = 5'000;
constexpr std::int64_t kLongestPointingNs = 600'000'000'000;
/// What is asked for in nanoseconds lies within the format's integers.
constexpr std::int64_t kLatestNs = std::int64_t{1} << 53;

/// Marks a response as a copy made for viewing, which no evidence is.
constexpr const char* kCopyHeader = "X-Kiroku-Copy";
constexpr const char* kCopy = "viewing copy";

std::int64_t time_of(const Request& request, const char* name) {
  const std::optional<std::int64_t> time = request.query_integer(name);
  if (!time) throw Refusal(400, std::string("'") + name + "' is missing: nanoseconds of the case clock");
  if (*time < -kLatestNs || *time > kLatestNs) {
    throw Refusal(400, std::string("'") + name + "' is no time of a case");
  }
  return *time;
}

Response nothing_recorded() { return Response::error(404, "nothing was recorded there"); }

std::string label_of(const playback::VitalSeries& series) {
  const media::VitalCode* const known = media::find_vital_code(series.code);
  return known == nullptr ? series.code : std::string(known->label);
}

ordered_json series_json(const std::string& stream, const playback::VitalSeries& series) {
  ordered_json bins = ordered_json::array(), questionable = ordered_json::array();
  std::optional<std::int64_t> known_to_ns;  // of the last of them
  for (const playback::VitalBin& bin : series.bins) {
    bins.push_back({bin.start_ns, bin.end_ns, bin.min, bin.max, bin.last});
    if (!bin.is_questionable) continue;
    if (known_to_ns == bin.start_ns) {
      questionable.back()[1] = bin.end_ns;
    } else {
      questionable.push_back({bin.start_ns, bin.end_ns});
    }
    known_to_ns = bin.end_ns;
  }
  return {{"code", series.code},
          {"label", label_of(series)},
          {"unit", series.unit},
          {"kind", series.is_wave ? "wave" : "numeric"},
          {"stream", stream},
          {"source", series.source},
          {"every_ns", series.every_ns},
          {"bins", std::move(bins)},
          {"questionable", std::move(questionable)}};
}

const char* kind_name(playback::TimelineToken::Kind kind) {
  switch (kind) {
    case playback::TimelineToken::Kind::kExternal:
      return "external";
    case playback::TimelineToken::Kind::kSelfIssued:
      return "self-issued";
    case playback::TimelineToken::Kind::kNotJudged:
      break;
  }
  return "not-judged";
}

/// The time line's first member, written at once: ten hours have tens of thousands of segments, and as many
/// objects would take longer than all the rest.
std::string segments_text(const std::vector<playback::TimelineSegment>& segments) {
  std::string text = "[";
  for (const playback::TimelineSegment& segment : segments) {
    if (text.size() > 1) text += ',';
    text += archive::JsonWriter()
                .text("stream", segment.stream)
                .count("index", segment.index)
                .integer("start_ns", segment.span.start_ns)
                .integer("end_ns", segment.span.end_ns)
                .flag("complete", segment.complete)
                .flag("erased", segment.erased)
                .finish();
  }
  return text + "]";
}

/// Its other members.
ordered_json timeline_json(const playback::Timeline& timeline) {
  ordered_json gaps = ordered_json::array();
  for (const archive::GapEntry& gap : timeline.gaps) {
    gaps.push_back({{"stream", gap.stream},
                    {"start_ns", gap.span.start_ns},
                    {"end_ns", gap.span.end_ns},
                    {"cause", archive::gap_cause_name(gap.cause)},
                    {"of_sound", gap.of_sound}});
  }
  ordered_json tokens = ordered_json::array();
  for (const playback::TimelineToken& token : timeline.tokens) {
    tokens.push_back({{"time_ns", token.time_ns},
                      {"gen_time", format_utc(token.gen_time)},
                      {"authority", token.authority},
                      {"kind", kind_name(token.kind)},
                      {"checkpoint", token.checkpoint}});
  }
  ordered_json checkpoints = ordered_json::array();
  for (const playback::TimelineCheckpoint& checkpoint : timeline.checkpoints) {
    checkpoints.push_back({{"time_ns", checkpoint.time_ns}, {"size", checkpoint.size}});
  }
  ordered_json brackets = ordered_json::array();
  for (const playback::TimelineBracket& bracket : timeline.brackets) {
    brackets.push_back({{"start_ns", bracket.start_ns},
                        {"end_ns", bracket.end_ns},
                        {"not_before", or_null(bracket.not_before)},
                        {"not_after", or_null(bracket.not_after)},
                        {"authority_before", or_null(bracket.authority_before)},
                        {"authority_after", or_null(bracket.authority_after)},
                        {"time", archive::time_proof_name(bracket.time)}});
  }
  return {{"gaps", std::move(gaps)},
          {"tokens", std::move(tokens)},
          {"checkpoints", std::move(checkpoints)},
          {"brackets", std::move(brackets)}};
}

Response timeline_response(const std::vector<playback::TimelineSegment>& segments,
                           const ordered_json& others) {
  const std::string rest = others.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
  return Response::text("{\"segments\":" + segments_text(segments) + "," + rest.substr(1) + "\n",
                        "application/json");
}

/// The handlers' common part: who may watch has an identity, and what was watched is in the appliance log
/// before the first byte of it leaves.
class PlaybackApi {
 public:
  explicit PlaybackApi(ViewerContext& context)
      : context_(context),
        folder_(context.home().copies_folder),
        store_(folder_.path(), context.home().most_copy_bytes, *context.home().clock) {}

  [[nodiscard]] Response init(const Request& request) {
    return watch(request, [&](CasePlayback& playback, const std::string& stream) {
      const playback::InitSegment init = playback.init_segment(stream);
      return Response::bytes(init.bytes, "video/mp4; codecs=\"" + init.codecs + "\"")
          .with(kCopyHeader, kCopy);
    });
  }
  [[nodiscard]] Response piece(const Request& request) {
    return watch(request, [&](CasePlayback& playback, const std::string& stream) {
      Bytes piece = playback.piece(stream, request.number("piece"));
      if (piece.empty()) return nothing_recorded();
      return Response::bytes(std::move(piece), "video/mp4").with(kCopyHeader, kCopy);
    });
  }
  [[nodiscard]] Response sound(const Request& request) {
    return watch(request, [](CasePlayback& playback, const std::string& stream) {
      const auto init = playback.sound_init_segment(stream);
      return Response::json({{"codecs", init ? ordered_json(init->codecs) : ordered_json(nullptr)}});
    });
  }
  [[nodiscard]] Response sound_init(const Request& request) {
    return watch(request, [](CasePlayback& playback, const std::string& stream) {
      auto init = playback.sound_init_segment(stream);
      if (!init) return Response::error(404, "stream '" + stream + "' has no sound");
      return Response::bytes(std::move(init->bytes), "audio/mp4; codecs=\"" + init->codecs + "\"")
          .with(kCopyHeader, kCopy);
    });
  }
  [[nodiscard]] Response sound_piece(const Request& request) {
    return watch(request, [&](CasePlayback& playback, const std::string& stream) {
      Bytes piece = playback.sound_piece(stream, request.number("piece"));
      if (piece.empty()) return nothing_recorded();
      return Response::bytes(std::move(piece), "audio/mp4").with(kCopyHeader, kCopy);
    });
  }
  [[nodiscard]] Response thumbnail(const Request& request) {
    return watch(request, [&](CasePlayback& playback, const std::string& stream) {
      Bytes thumbnail = playback.thumbnail(stream, request.number("piece"));
      return thumbnail.empty() ? nothing_recorded() : Response::bytes(std::move(thumbnail), "image/jpeg");
    });
  }
  [[nodiscard]] Response frame(const Request& request) {
    const std::int64_t at_ns = time_of(request, "at_ns");
    const std::int64_t step = request.query_integer("step").value_or(0);
    if (step < -1 || step > 1) throw Refusal(400, "'step' must be -1, 0 or 1");
    return watch(request, [&](CasePlayback& playback, const std::string& stream) {
      auto picture = playback.archived_picture(stream, at_ns, static_cast<playback::Step>(step));
      if (!picture) return nothing_recorded();
      return Response::bytes(std::move(picture->png), "image/png")
          .with("X-Kiroku-Frame-Time-Ns", std::to_string(picture->time_ns));
    });
  }

  [[nodiscard]] Response vitals(const Request& request) {
    const std::int64_t from_ns = time_of(request, "from_ns");
    const std::int64_t to_ns = time_of(request, "to_ns");
    const std::int64_t bins = request.query_integer("bins").value_or(kUsualBins);
    if (bins < 1 || bins > kMostBins) throw Refusal(400, "'bins' must be from 1 to 20000");
    return answer(request, "watched vital signs", [&](CasePlayback& playback) {
      ordered_json series = ordered_json::array(), alarms = ordered_json::array(),
                   texts = ordered_json::array(), notices = ordered_json::array(),
                   unreadable = ordered_json::array();
      for (const archive::StreamInfo& stream : playback.recording().opening().streams) {
        if (stream.kind != "vitals") continue;
        const playback::VitalsView view =
            playback.vitals(stream.name).view(from_ns, to_ns, static_cast<std::size_t>(bins), kPatienceMs);
        if (view.complete_to_ns < to_ns && is_long(from_ns, to_ns, bins)) {
          return Response::error(503, "the vital signs of this case are still being read")
              .with("Retry-After", "3");
        }
        for (const auto& one : view.series) series.push_back(series_json(stream.name, one));
        for (const playback::AlarmSpan& alarm : view.alarms) {
          alarms.push_back({{"start_ns", alarm.start_ns},
                            {"end_ns", alarm.end_ns},
                            {"text", alarm.text},
                            {"priority", alarm.priority},
                            {"ended", alarm.ended},
                            {"questionable", alarm.is_questionable}});
        }
        for (const playback::TimedText& text : view.texts) {
          texts.push_back({{"time_ns", text.time_ns},
                           {"code", text.code},
                           {"text", text.text},
                           {"questionable", text.is_questionable}});
        }
        for (const playback::TimedNotice& notice : view.notices) {
          notices.push_back({{"time_ns", notice.time_ns},
                             {"notice", notice.notice},
                             {"text", notice.text},
                             {"stream", stream.name}});
        }
        for (const playback::UnreadableStretch& stretch : view.unreadable) {
          unreadable.push_back({{"start_ns", stretch.span.start_ns},
                                {"end_ns", stretch.span.end_ns},
                                {"problem", stretch.problem}});
        }
      }
      return Response::json({{"series", std::move(series)},
                             {"alarms", std::move(alarms)},
                             {"texts", std::move(texts)},
                             {"notices", std::move(notices)},
                             {"unreadable", std::move(unreadable)}});
    });
  }

  [[nodiscard]] Response values(const Request& request) {
    const std::int64_t at_ns = time_of(request, "at_ns");
    return answer(request, "watched vital signs", [&](CasePlayback& playback) {
      ordered_json values = ordered_json::array();
      for (const archive::StreamInfo& stream : playback.recording().opening().streams) {
        if (stream.kind != "vitals") continue;
        for (const playback::VitalSeries& series : playback.vitals(stream.name).values_at(at_ns)) {
          values.push_back({{"code", series.code},
                            {"label", label_of(series)},
                            {"unit", series.unit},
                            {"kind", series.is_wave ? "wave" : "numeric"},
                            {"value", series.bins.front().last},
                            {"time_ns", series.bins.front().last_ns},
                            {"questionable", series.bins.front().is_questionable}});
        }
      }
      return Response::json({{"values", std::move(values)}});
    });
  }

  [[nodiscard]] Response pointing(const Request& request) {
    return answer(request, "watched pointing", [](CasePlayback& playback) {
      ordered_json strokes = ordered_json::array();
      for (const playback::PointingStroke& stroke : playback.pointing_strokes()) {
        strokes.push_back({{"start_ns", stroke.start_ns},
                           {"end_ns", stroke.end_ns},
                           {"by", stroke.by},
                           {"role", stroke.role},
                           {"stream", stroke.stream},
                           {"points", stroke.points}});
      }
      return Response::json({{"strokes", std::move(strokes)}});
    });
  }

  [[nodiscard]] Response points(const Request& request) {
    const std::int64_t from_ns = time_of(request, "from_ns");
    const std::int64_t to_ns = time_of(request, "to_ns");
    if (to_ns - from_ns > kLongestPointingNs) throw Refusal(400, "ask for ten minutes at most");
    return answer(request, "watched pointing", [&](CasePlayback& playback) {
      ordered_json points = ordered_json::array();
      for (const media::PointingLine& line : playback.pointing(from_ns, to_ns)) {
        points.push_back({{"time_ns", line.time_ns},
                          {"by", line.at.by},
                          {"role", line.at.role},
                          {"stream", line.at.stream},
                          {"x", line.at.x},
                          {"y", line.at.y}});
        if (line.at.picture_ns) points.back()["picture_ns"] = *line.at.picture_ns;
      }
      return Response::json({{"points", std::move(points)}});
    });
  }

  [[nodiscard]] Response timeline(const Request& request) {
    static const timestamp::TrustStore kNoTrust;
    const timestamp::TrustStore* trust = context_.home().trust;
    bool proofs_are_coming = false;
    if (const auto& stored = context_.home().stored) {
      // Asked before they are read: what comes meanwhile is asked for once more.
      const auto found = stored->find(request.parameter("case"));
      proofs_are_coming = found && found->proofs_are_coming;
      if (found && !found->problem.empty()) {
        context_.tell("checkpoints and time-stamps of " + request.parameter("case") +
                      " could not be fetched: " + found->problem);
      }
    }
    const playback::Timeline known =
        playback::timeline_of(context_.open_case(request), trust == nullptr ? kNoTrust : *trust);
    ordered_json timeline = timeline_json(known);
    timeline["proofs_coming"] = proofs_are_coming;
    const Session::Identities identities = request.session->identities();
    if (identities == nullptr || !may(request.session->role(), Right::kWatch)) {
      return timeline_response(known.segments, timeline);
    }
    ordered_json marks = ordered_json::array();
    try {
      const playback::TimelineMarks found = open(request, identities)->marks();
      for (const playback::TimelineMark& mark : found.marks)
        marks.push_back({{"time_ns", mark.time_ns}, {"text", mark.text}});
      timeline["events_lacking"] = found.events_lacking;
    } catch (const crypto::AgeError& error) {
      // kNoMatch: unlocked, for others' recordings.
      if (error.failure() != crypto::AgeFailure::kNoMatch) timeline["marks_problem"] = error.what();
      return timeline_response(known.segments, timeline);
    } catch (const Error& error) {
      timeline["marks_problem"] = error.what();  // the case can be watched without its marks
      return timeline_response(known.segments, timeline);
    }
    if (!marks.empty()) context_.enter_access_once(request, request.parameter("case"), "read marks");
    timeline["marks"] = std::move(marks);
    return timeline_response(known.segments, timeline);
  }

 private:
  static bool is_long(std::int64_t from_ns, std::int64_t to_ns, std::int64_t bins) {
    return playback::VitalPyramid::width_for(to_ns - from_ns, static_cast<std::size_t>(bins)) >=
           playback::VitalPyramid::kBaseNs;
  }

  PlaybackStore::Playback open(const Request& request, const Session::Identities& identities) {
    return store_.open(request.session, identities, context_.case_place(request));
  }

  Response watch(const Request& request,
                 const std::function<Response(CasePlayback&, const std::string& stream)>& give) {
    const std::string& stream = request.parameter("stream");
    return answer(request, "watched " + stream,
                  [&](CasePlayback& playback) { return give(playback, stream); });
  }

  Response answer(const Request& request, const std::string& deed,
                  const std::function<Response(CasePlayback&)>& give) {
    const Session::Identities identities = ViewerContext::require_unlocked(request);
    const PlaybackStore::Playback playback = open(request, identities);
    try {
      Response response = give(*playback);
      if (response.status == 200) context_.enter_access_once(request, request.parameter("case"), deed);
      return response;
    } catch (const crypto::AgeError& error) {
      throw Refusal(403, error.what());
    } catch (const Refusal&) {
      throw;
    } catch (const UsageError& error) {
      throw Refusal(404, error.what());
    } catch (const Error& error) {
      throw Refusal(422, error.what());  // what lies there is not what the ledger says, or damaged
    }
  }

  ViewerContext& context_;
  const OwnFolder folder_;
  PlaybackStore store_;
};

}  // namespace

void add_playback_routes(Router& router, ViewerContext& context) {
  const auto api = std::make_shared<PlaybackApi>(context);
  const auto add = [&](const std::string& pattern, Right right,
                       Response (PlaybackApi::*answer)(const Request&)) {
    router.add("GET", "api/cases/{case:case}/" + pattern, right,
               [api, answer](const Request& request) { return (*api.*answer)(request); });
  };
  add("streams/{stream:name}/init.mp4", Right::kWatch, &PlaybackApi::init);
  add("streams/{stream:name}/pieces/{piece:number}.mp4", Right::kWatch, &PlaybackApi::piece);
  add("streams/{stream:name}/sound", Right::kWatch, &PlaybackApi::sound);
  add("streams/{stream:name}/sound/init.mp4", Right::kWatch, &PlaybackApi::sound_init);
  add("streams/{stream:name}/sound/pieces/{piece:number}.mp4", Right::kWatch, &PlaybackApi::sound_piece);
  add("streams/{stream:name}/thumbnails/{piece:number}.jpg", Right::kWatch, &PlaybackApi::thumbnail);
  add("streams/{stream:name}/frame.png", Right::kWatch, &PlaybackApi::frame);
  add("vitals", Right::kWatch, &PlaybackApi::vitals);
  add("vitals/values", Right::kWatch, &PlaybackApi::values);
  add("pointing", Right::kWatch, &PlaybackApi::pointing);
  add("pointing/points", Right::kWatch, &PlaybackApi::points);
  add("timeline", Right::kReadCase, &PlaybackApi::timeline);
}

}  // namespace kiroku::viewer
