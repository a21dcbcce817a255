// How other programs speak with a running recorder: one JSON object a line over a Unix socket, one answer a
// line. Who may connect is decided by the socket's mode (0660) and its folder. Connections are bounded, in
// all and of one user: the idlest makes room for one more. One that does not end its line, or take its
// answer, within a minute is closed. Arrays and objects nest at most 64 deep (base/foreign_json.h).
//
//   {"do":"status"}                                  {"ok":true,"rooms":[…],…}
//   {"do":"start","room":"or-1","subject":{…}}       {"ok":true,"case":"…"}
//       instead of "subject" also "procedure":"<key of one that was listed>","by":"<who chose it>"; also
//       "plan":"<hash of the sealed plan that the case follows>", and "plan_patients":["…"], whose CT it was
//       made on: "warning" of the answer says where the case is about another patient
//   {"do":"procedures","room":"or-1"}                {"ok":true,"procedures":[{"key":"…","subject":{…}}],
//                                                     "ways":[…]}
//   {"do":"subject","room":"or-1","subject":{…}}     {"ok":true,"case":"…"}
//       of the case that runs; or "procedure" as above
//   {"do":"stop","room":"or-1","wait":true}          {"ok":true,"case":"…"}
//       also between cases, where the next one would begin by itself ("tries_again" of the status)
//   {"do":"mark","room":"or-1","text":"…"}           {"ok":true,"case":"…"}
//   {"do":"profile","room":"or-1","profile":"…"}     {"ok":true,"case":"…"}
//       also "stream", "why", "by"
//   anything that cannot be done                     {"ok":false,"error":"one sentence"}
//
// "room" may be left out where there is only one. What acts on the case that runs (subject, stop, mark and
// profile) may carry "case":"…", the one that is meant: it is refused where another one runs, or none, so
// that what somebody prepared while one case ran never reaches the next one. Of a stop between cases, it is
// the last case.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/error.h"

namespace kiroku::recorder {

/// Answers a request; may take its time, and is called from several threads. What it throws becomes an error
/// answer.
using ControlHandler = std::function<nlohmann::ordered_json(const nlohmann::json& request)>;

class ControlServer {
 public:
  /// Listens on `socket`; one that a dead process left behind is replaced. Throws kiroku::Error where a
  /// living process answers there, or the path is too long or cannot be written.
  ControlServer(std::filesystem::path socket, ControlHandler handler);
  /// Throws kiroku::UsageError where nothing could listen on `socket`: its path is too long, its folder is
  /// not there (but below /run, where a service's is made as it starts), or something else lies in its place.
  static void check(const std::filesystem::path& socket);
  /// Waits for answers under way.
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
