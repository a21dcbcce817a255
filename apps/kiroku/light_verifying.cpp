#include "apps/kiroku/light_verifying.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/progress.h"
#include "apps/kiroku/home.h"
#include "archive/reading/case_reader.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "light/ledger_lights.h"
#include "light/light_judge.h"
#include "light/sound_code.h"
#include "media/light/light_reading.h"
#include "media/light/sound_reading.h"

namespace kiroku::apps {
namespace {

using light::LightAnswer;
using light::SecondLight;
using nlohmann::ordered_json;

constexpr std::size_t kMostPrinted = 24;  // stretches, for people

UtcTime utc_of_second(std::int64_t second) { return UtcTime(std::chrono::seconds(second)); }

std::string share_text(std::uint64_t of, std::uint64_t all) {
  // Rounded down: 100 % is all of them.
  const std::uint64_t tenths = all == 0 ? 0 : of * 1'000 / all;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " %";
}

std::string delay_text(std::int64_t ns) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f s", static_cast<double>(ns) / 1e9);
  return text.data();
}

std::int64_t delay_at(const light::LightReport& report, double share) {
  const auto last = static_cast<double>(report.delays_ns.size() - 1);
  return report.delays_ns[static_cast<std::size_t>(share * last)];
}

/// What is compared: how people are told of it.
enum class Medium { kPictures, kSound };

std::string count_text(std::uint64_t count, Medium medium) {
  if (medium == Medium::kPictures) return std::to_string(count) + (count == 1 ? " second" : " seconds");
  return std::to_string(count) + (count == 1 ? " stretch" : " stretches") + " of " +
         std::to_string(light::kSoundPeriodSeconds) + " s";
}

/// One sentence that answers. `is_whole`: every segment that is there could be looked at.
std::string answer_text(const light::LightReport& report, bool is_whole) {
  const bool agrees_in_part = report.answer == LightAnswer::kAgrees && !is_whole;
  switch (agrees_in_part ? LightAnswer::kInPart : report.answer) {
    case LightAnswer::kAgrees:
      return "light and ledger agree: the pictures show the codes that this ledger had in their seconds, so "
             "they were finished after its lines of then were written";
    case LightAnswer::kInPart:
      return "light and ledger agree as far as codes could be read; of the other seconds light says nothing";
    case LightAnswer::kDisagrees:
      return "LIGHT AND LEDGER DISAGREE: some pictures show a code that the ledger did not have in that "
             "second";
    case LightAnswer::kNotSeen:
      return "could not check: no code could be read in any picture; there was no display in the picture, or "
             "the film was made without it";
    case LightAnswer::kNoPictures:
      return "could not check: there are no pictures to look at";
  }
  return {};
}

/// Whether codes were read, so that they count.
bool shows_codes(const light::LightReport& report) {
  return report.answer != LightAnswer::kNotSeen && report.answer != LightAnswer::kNoPictures;
}

std::string answer_text(const media::StreamSound& sound) {
  const light::LightReport& report = sound.light.report;
  const bool agrees_in_part = report.answer == LightAnswer::kAgrees && sound.light.unread_segments > 0;
  switch (agrees_in_part ? LightAnswer::kInPart : report.answer) {
    case LightAnswer::kAgrees:
      return "sound and ledger agree: the sound carries the codes that this ledger had then, so it was "
             "finished after its lines of then were written";
    case LightAnswer::kInPart:
      return "sound and ledger agree as far as codes could be heard; of the other stretches sound says "
             "nothing";
    case LightAnswer::kDisagrees:
      return "SOUND AND LEDGER DISAGREE: some sound carries a code that the ledger did not have then";
    case LightAnswer::kNotSeen:
      if (sound.light.report.agreeing > 0)
        return "could not check: one stretch alone seems to carry its code, and not to the bit, as noise "
               "sometimes does";
      return "could not check: no code could be heard; no loudspeaker played it, it was too faint beside the "
             "room's own sound, or the sound was made without it";
    case LightAnswer::kNoPictures:
      if (sound.unheard > sound.too_slow) return "could not check: the sound could not be decoded";
      return sound.too_slow > 0 ? "could not check: the sound has fewer than 16,000 samples a second, which "
                                  "carry no code"
                                : "could not check: there is no stretch of sound as long as a code";
  }
  return {};
}

std::string stretch_text(const light::LightStretch& stretch, Medium medium, std::int64_t begins_ns) {
  const bool is_sound = medium == Medium::kSound;
  const std::string when = format_duration(stretch.start_ns - begins_ns) + " to " +
                           format_duration(stretch.end_ns - begins_ns) + " (" +
                           count_text(stretch.seconds, medium) + "): ";
  switch (stretch.light) {
    case SecondLight::kOld: {
      const std::string shown = format_utc_for_people(utc_of_second(*stretch.shown_second));
      return is_sound ? when + "sound repeats the code of another time of this case, first that of " + shown +
                            ": it was recorded then, repeated, or played back in the room"
                      : when + "pictures repeat the code of another second of this case, first that of " +
                            shown + ": they were taken then, repeated, or the display stood still";
    }
    case SecondLight::kForeign:
      return is_sound ? when +
                            "sound carries a code that this ledger never had: the display followed another "
                            "case, another room's loudspeaker or a recording that was played was heard, or "
                            "the sound is of another day or recorder"
                      : when +
                            "pictures show a code that this ledger never had: the display followed another "
                            "case, or they are of another day or recorder";
    default:
      return is_sound
                 ? when + "no code could be heard: drowned, switched off, or sound that was made without it"
                 : when +
                       "no code could be read: covered, out of the picture, or pictures that were made "
                       "without it";
  }
}

/// What no line of the first `entries` can be older than; nothing where no token that holds tells.
const archive::Bracket* bracket_of(const LightQuestion& question, std::uint64_t entries) {
  for (const archive::Bracket& bracket : question.brackets) {
    if (bracket.first_entry < entries && entries <= bracket.last_entry + 1)
      return bracket.not_before ? &bracket : nullptr;
  }
  return nullptr;
}

/// Since when the pictures cannot have been finished, and who says so.
std::string since_text(const LightQuestion& question, const light::LightReport& report, Medium medium,
                       std::int64_t begins_ns) {
  if (report.agreeing == 0 || !shows_codes(report) || question.is_tampered) return {};
  if (report.exact == 0)
    return "  no code was read well enough to say since when: each agrees as far as codes could be "
           "corrected\n";
  const archive::Bracket* bracket = bracket_of(question, report.exact_entries);
  if (bracket == nullptr)
    return "  no time-stamp that holds is among the lines whose codes were read: nobody but the recorder "
           "says when that was\n";
  const std::string when = (medium == Medium::kSound ? "  the sound at " : "  the pictures at ") +
                           format_duration(report.exact_shown_ns - begins_ns) +
                           (medium == Medium::kSound ? " was" : " were") + " finished after " +
                           format_utc_for_people(*bracket->not_before);
  return question.by_outside_clocks
             ? when + ": by the time-stamp of an outside authority (" + bracket->authority_before +
                   ") that their code is made of\n"
             : when + " by the recorder's own authority (" + bracket->authority_before +
                   "): its clock is the recorder's, and nobody outside says when that was\n";
}

std::string text_of(const LightQuestion& question, const media::StreamLight& stream, Medium medium,
                    const std::string& answer, std::int64_t begins_ns) {
  const light::LightReport& report = stream.report;
  const bool is_sound = medium == Medium::kSound;
  std::string text = answer + ".\n";
  if (question.is_tampered)
    text += "  THE CASE READS AS TAMPERED: what agrees with its ledger proves nothing\n";
  if (report.seconds > 0) {
    text += "  agrees in " + std::to_string(report.agreeing) + " of " + count_text(report.seconds, medium) +
            " (" + share_text(report.agreeing, report.seconds) + "), nearly to the bit in " +
            std::to_string(report.exact) + "; another " + (is_sound ? "time" : "second") + "'s code in " +
            std::to_string(report.old) + ", another ledger's in " + std::to_string(report.foreign) +
            ", none " + (is_sound ? "heard" : "read") + " in " + std::to_string(report.unread) + "\n";
  }
  if (report.crowded > 0)
    text += "  " + count_text(report.crowded, medium) +
            " were not compared: the ledger has so many lines then that any " +
            (is_sound ? "sound" : "picture") + " would fit; no recorder writes so many\n";
  if (!report.delays_ns.empty()) {
    text += std::string("  a code is ") + (is_sound ? "heard " : "seen ") +
            delay_text(delay_at(report, 0.5)) + " after its second began (half of them), " +
            delay_text(delay_at(report, 0.95)) + " (95 % of them), " + delay_text(report.delays_ns.back()) +
            " at most\n";
  }
  text += since_text(question, report, medium, begins_ns);
  if (report.beside_foreign > 0) {
    text += "  " + count_text(report.beside_foreign, medium) +
            (is_sound ? " that agree carry another code beside it, of a second display, or of sound that was "
                        "played into the room\n"
                      : " that agree show another ledger's code beside it, of a second display perhaps\n");
  }
  if (stream.unread_segments > 0) {
    text += std::string("  could not ") + (is_sound ? "listen to " : "look at ") +
            std::to_string(stream.unread_segments) + " of " + std::to_string(stream.segments) +
            " segments: " + stream.why_unread + "\n";
  }
  if (stream.erased > 0) text += "  " + std::to_string(stream.erased) + " segments were erased by policy\n";
  // What disagrees comes first where not all is printed.
  std::vector<light::LightStretch> stretches = report.stretches;
  if (stretches.size() > kMostPrinted) {
    std::stable_sort(stretches.begin(), stretches.end(), [](const auto& a, const auto& b) {
      return (a.light == SecondLight::kUnread) < (b.light == SecondLight::kUnread);
    });
  }
  for (std::size_t i = 0; i < std::min(stretches.size(), kMostPrinted); ++i)
    text += "  " + stretch_text(stretches[i], medium, begins_ns) + "\n";
  const std::uint64_t more =
      report.more_stretches + (stretches.size() > kMostPrinted ? stretches.size() - kMostPrinted : 0);
  if (more > 0) text += "  and " + std::to_string(more) + " more such stretches (--json)\n";
  return text;
}

/// Of sound, a stretch stands where pictures have a second.
ordered_json json_of(const LightQuestion& question, const std::string& name, const media::StreamLight& stream,
                     Medium medium, const std::string& answer) {
  const light::LightReport& report = stream.report;
  const char* const counted = medium == Medium::kSound ? "periods" : "seconds";
  ordered_json json{
      {"stream", name},
      {"answer", light::answer_name(report.answer)},
      {"text", answer},
      {medium == Medium::kSound ? "period_s" : "pictures",
       medium == Medium::kSound ? static_cast<std::uint64_t>(light::kSoundPeriodSeconds) : report.pictures},
      {counted, report.seconds},
      {"agreeing", report.agreeing},
      {"old", report.old},
      {"foreign", report.foreign},
      {"unread", report.unread},
      {"exact", report.exact},
      {"crowded", report.crowded},
      {"beside_foreign", report.beside_foreign},
      {"segments", stream.segments},
      {"unread_segments", stream.unread_segments},
      {"erased_segments", stream.erased},
      {"delay_ns", nullptr},
      {"finished_after", nullptr},
      {"stretches", ordered_json::array()},
      {"more_stretches", report.more_stretches}};
  if (stream.unread_segments > 0) json["why_unread"] = stream.why_unread;
  if (!report.delays_ns.empty()) {
    json["delay_ns"] = {{"least", report.delays_ns.front()},
                        {"median", delay_at(report, 0.5)},
                        {"p95", delay_at(report, 0.95)},
                        {"most", report.delays_ns.back()}};
  }
  const archive::Bracket* bracket = report.exact > 0 ? bracket_of(question, report.exact_entries) : nullptr;
  if (bracket != nullptr) {
    json["finished_after"] = {{"utc", format_utc(*bracket->not_before)},
                              {"authority", bracket->authority_before},
                              {"outside", question.by_outside_clocks},
                              {"entries", report.exact_entries},
                              {"shown_ns", report.exact_shown_ns}};
  }
  for (const light::LightStretch& stretch : report.stretches) {
    ordered_json one{{"light", light::second_light_name(stretch.light)},
                     {"start_ns", stretch.start_ns},
                     {"end_ns", stretch.end_ns},
                     {counted, stretch.seconds}};
    if (stretch.shown_second) one["shown"] = format_utc(utc_of_second(*stretch.shown_second));
    json["stretches"].push_back(std::move(one));
  }
  return json;
}

/// 1 before 3 before 0.
int worse_of(int one, int other) {
  return one == kAnswerIsNo || other == kAnswerIsNo ? kAnswerIsNo : std::max(one, other);
}

int status_of(const media::StreamLight& stream) {
  if (stream.report.answer == LightAnswer::kDisagrees) return kAnswerIsNo;
  return stream.report.answer == LightAnswer::kAgrees && stream.unread_segments == 0 ? kDone : kNoAnswer;
}

/// An excerpt has no tree of the whole ledger before it, from which codes are made.
LightOutcome of_excerpt() {
  const std::string why =
      "could not check: codes are made of a whole ledger, and an excerpt has a part of it";
  return {kNoAnswer, "Light: " + why + "; compare the whole case.\n",
          ordered_json{
              {"streams", ordered_json::array()}, {"sound", ordered_json::array()}, {"could_not_check", why}}
              .dump()};
}

LightOutcome read(const std::optional<Home>& home, const LightQuestion& question) {
  if (archive::is_excerpt(question.folder)) return of_excerpt();
  const archive::CaseReader recording = archive::CaseReader::open(question.folder);
  if (question.lines_root != recording.lines_root()) {
    throw Error(
        "the ledger of " + question.folder.string() +
        " is not the one that was verified: it changed in between, so light was not compared; find out "
        "what writes to it");
  }
  std::vector<std::string> names = question.streams;
  if (names.empty()) {
    for (const archive::StreamInfo& stream : recording.opening().streams)
      if (stream.kind == "video") names.push_back(stream.name);
  }
  for (const std::string& name : names) {
    if (recording.stream(name).kind != "video")
      throw UsageError("--light-stream: stream '" + name + "' has no pictures");
  }
  const crypto::AgeIdentities identities = load_identities(question.identities, home);
  const light::LedgerLights ledger = light::LedgerLights::of(question.folder);
  ordered_json streams = ordered_json::array(), sounds = ordered_json::array();
  LightOutcome outcome;
  // Without a name every stream may be the room's. The ones without a code count where there is no other.
  // Sound without a code never counts: a room needs no loudspeaker. Sound with one makes nothing better: it
  // says nothing of pictures.
  bool is_seen = false;
  int seen_status = kDone, heard_status = kDone;
  const std::int64_t begins_ns = recording.opening().begins_ns;
  for (const std::string& name : names) {
    Progress progress("reading light");
    const auto update = [&](std::uint64_t done, std::uint64_t total) { progress.update(done, total); };
    const media::StreamLight stream = media::read_light(recording, ledger, name, identities, update);
    progress.clear();
    const std::string answer = answer_text(stream.report, stream.unread_segments == 0);
    outcome.text +=
        "Light in stream " + name + ": " + text_of(question, stream, Medium::kPictures, answer, begins_ns);
    streams.push_back(json_of(question, name, stream, Medium::kPictures, answer));
    if (shows_codes(stream.report) || !question.streams.empty()) {
      is_seen = true;
      seen_status = worse_of(seen_status, status_of(stream));
    }
    Progress listening("listening for codes");
    const media::StreamSound sound =
        media::read_sound(recording, ledger, name, identities,
                          [&](std::uint64_t done, std::uint64_t total) { listening.update(done, total); });
    listening.clear();
    // What could not be opened was told of its pictures.
    if (sound.with_sound == 0 && sound.unheard == 0) continue;
    const std::string heard = answer_text(sound);
    outcome.text +=
        "Sound in stream " + name + ": " + text_of(question, sound.light, Medium::kSound, heard, begins_ns);
    sounds.push_back(json_of(question, name, sound.light, Medium::kSound, heard));
    if (shows_codes(sound.light.report)) heard_status = worse_of(heard_status, status_of(sound.light));
  }
  if (names.empty()) outcome.text = "Light: could not check: the case has no stream of pictures.\n";
  outcome.status = worse_of(is_seen ? seen_status : kNoAnswer, heard_status);
  outcome.json = ordered_json{{"proves_nothing", question.is_tampered},
                              {"streams", std::move(streams)},
                              {"sound", std::move(sounds)}}
                     .dump(-1, ' ', false, ordered_json::error_handler_t::replace);
  log_access(home, question.folder, "read the codes of a display in the pictures and the sound");
  return outcome;
}

}  // namespace

ReadLight light_reading(const std::shared_ptr<std::optional<std::string>>& asked_home) {
  return [asked_home](const LightQuestion& question) { return read(Home::find(*asked_home), question); };
}

}  // namespace kiroku::apps
