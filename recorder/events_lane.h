// What happened beside the pictures: the operator's marks, and procedure data that came late. Sealed in the
// events stream, committed to in the ledger without revealing them.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "recorder/line_segments.h"

namespace kiroku::recorder {

/// One line an event: {"salt":"<64 hex digits>","event":"<JSON text>"}, the event being, as text inside a
/// string so that its bytes stay what they are,
///
///   {"time_ns":1500000000,"utc":"2026-08-05T09:15:03.500000Z","kind":"mark","text":"clip placed"}
///
/// or, of procedure data that came after the case had begun, and of their lack,
///
///   {"time_ns":…,"utc":"…","kind":"subject","subject":{"patient":{…},…}}
///   {"time_ns":…,"utc":"…","kind":"subject-missing","text":"the worklist of ris:104 does not answer"}
///
/// or, of the form in which pictures are archived (session.h, ProfileDecision),
///
///   {"time_ns":…,"utc":"…","kind":"profile","profile":{"streams":["endoscope"],"to":"lossless",…}}
///
/// or, of a case that begins with less than was recorded ahead, and of monitors or a plan that name another
/// patient,
///
///   {"time_ns":…,"utc":"…","kind":"ahead-left-out","text":"what was recorded ahead before … is not part …"}
///   {"time_ns":…,"utc":"…","kind":"patient-differs","text":"a monitor's messages name another patient …"}
///
/// or, of a source that says in its course that its pictures are shown otherwise than the first,
///
///   {"time_ns":…,"utc":"…","kind":"picture-turn","stream":"endoscope","text":"source 'film.mov', from …"}
///
/// The ledger's commitment is SHA-256(salt bytes ‖ event bytes): whoever can open the stream can prove what
/// was marked (`jq -j .event`), and nobody can guess it from the ledger.
class EventsLane {
 public:
  EventsLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info);
  /// The case begins at this time of its clock (0 unless it begins with what was recorded before).
  void begin(std::int64_t begins_ns);
  /// These from any thread. The commitment goes to the ledger at once, the sealed event with the next
  /// step(). Throw kiroku::Error after finish().
  void mark(const std::string& text);
  /// `json` is what a subject file holds: one JSON object. Throws kiroku::UsageError for anything else.
  void late_subject(const Bytes& json);
  void subject_missing(const std::string& why);
  void ahead_left_out(const std::string& why);
  void patient_differs(const std::string& how);
  /// `how` the pictures of `stream` are shown from now on.
  void picture_turn(const std::string& stream, const std::string& how);
  /// `decision` is the object under "profile".
  void profile(const nlohmann::ordered_json& decision);
  /// Seals what happened, in one segment that follows the one before. Called by the session's thread, about
  /// each segment's duration.
  void step(std::int64_t now_ns);
  /// Seals the rest. Throws nothing: problems go where the lanes' go.
  void finish(std::int64_t close_ns);

 private:
  void add(const std::string& kind, const std::string& key, const nlohmann::ordered_json& value);
  void add(const std::string& kind, const nlohmann::ordered_json& members);

  LaneContext context_;
  LineSegments segments_;
  std::mutex mutex_;  // guards the following
  std::vector<std::string> waiting_;
  bool closed_ = false;
};

}  // namespace kiroku::recorder
