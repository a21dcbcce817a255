#include "apps/quality/study_command.h"

#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/stamped_file.h"
#include "apps/kiroku/told_to_end.h"
#include "base/error.h"
#include "base/listen_address.h"
#include "crypto/encoding.h"
#include "http/server.h"
#include "viewer/study/closing.h"
#include "viewer/study/desk.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct ServeRequest {
  std::string folder, listen = "127.0.0.1:8450";
  bool json = false;
};

void require_films(const fs::path& folder, const study::Study& study) {
  StepLine line;
  line.show("looking whether the films are as they were");
  for (const Check& check : study::check_films(folder, study)) {
    if (check.answer != Check::Answer::kHolds)
      throw Error(check.text + ": these are not the films of the study, so that nobody is shown them");
  }
}

int serve(const ServeRequest& request) {
  constexpr std::uint16_t kExamplePort = 8450;
  const ListenAddress listen = parse_listen_address(request.listen, kExamplePort);
  if (!listen.is_loopback()) {
    throw UsageError("--listen " + request.listen +
                     " is reached from elsewhere, and films would travel there unencrypted: readers come to "
                     "this computer; name 127.0.0.1");
  }
  study::Desk desk(archive::real_file_system(), request.folder, Clock::system());
  require_films(request.folder, desk.study());
  end_when_told();
  http::ServerOptions options;
  options.listen = listen;
  options.answer = [&desk](const http::Request& asked) { return desk.answer(asked); };
  options.refuse = study::Desk::refuse;
  constexpr std::size_t kThreads = 4;
  options.threads = kThreads;
  const http::Server server(std::move(options));
  const std::string url = "http://" + ListenAddress{listen.host, server.port()}.to_string() + "/";
  if (request.json) {
    print_json({{"url", url}, {"study", desk.study().id}});
  } else {
    std::cout << "Readers find their films at " << url << "\n"
              << "Ctrl-C ends it; answers stay, and it may be started again.\n";
  }
  std::cout.flush();
  wait_until_told();
  return kDone;
}

struct StatusRequest {
  std::string folder;
  bool json = false;
};

int status(const StatusRequest& request) {
  const study::StudyOnDisk study = study::read_study(request.folder);
  const std::vector<study::Progress> progress = study::progress_of(request.folder, study);
  const bool closed = study::is_closed(request.folder);
  if (request.json) {
    ordered_json readers = ordered_json::array();
    for (std::size_t i = 0; i < progress.size(); ++i) {
      readers.push_back({{"reader", i + 1},
                         {"code", study.study.readers[i].code},
                         {"answered", progress[i].answered},
                         {"showings", progress[i].showings}});
    }
    print_json({{"study", study.study.id},
                {"title", study.study.title},
                {"made_utc", format_utc(study.study.made)},
                {"closed", closed},
                {"readers", std::move(readers)}});
    return kDone;
  }
  std::vector<std::vector<std::string>> rows{{"reader", "code", "answered", "of"}};
  for (std::size_t i = 0; i < progress.size(); ++i) {
    rows.push_back({std::to_string(i + 1), study.study.readers[i].code, std::to_string(progress[i].answered),
                    std::to_string(progress[i].showings)});
  }
  std::cout << "Study " << study.study.id
            << (study.study.title.empty() ? "" : " (" + printable(study.study.title) + ")") << ", "
            << (closed ? "closed" : "open") << ", made " << format_utc_for_people(study.study.made) << "\n"
            << format_table(rows, "rlrr", 2);
  return kDone;
}

struct CloseRequest {
  std::string folder;
  std::optional<std::string> home;
  std::vector<std::string> authorities;
  bool incomplete = false, json = false;
};

void require_done(const std::vector<study::Progress>& progress) {
  std::string missing;
  for (std::size_t i = 0; i < progress.size(); ++i) {
    if (progress[i].is_done()) continue;
    missing += (missing.empty() ? "reader " : ", reader ") + std::to_string(i + 1) + " judged " +
               std::to_string(progress[i].answered) + " of " + std::to_string(progress[i].showings) +
               " films";
  }
  if (!missing.empty())
    throw UsageError("the study is not at its end: " + missing + "; --incomplete closes it all the same");
}

int close(const CloseRequest& request) {
  archive::FileSystem& files = archive::real_file_system();
  const study::StudyOnDisk study = study::read_study(request.folder);
  const auto held = study::hold_study(files, request.folder);
  const std::vector<study::Progress> progress = study::progress_of(request.folder, study);
  if (!request.incomplete && !study::is_closed(request.folder)) require_done(progress);
  // Before anything is written: who asked for a time-stamp shall not get a study that is closed without one.
  const bool asked = request.home || !request.authorities.empty();
  const std::optional<Home> home = asked ? Home::open(request.home) : Home::find(request.home);
  std::optional<Authorities> authorities;
  if (home) authorities.emplace(*home, home->configuration(), request.authorities);
  const crypto::Sha256Digest digest = study::close_study(files, request.folder, study, Clock::system().utc());
  std::vector<Stamp> stamps;
  if (authorities) {
    const timestamp::TrustStore trust = home->trust();
    for (const recorder::NamedAuthority& authority : authorities->named())
      stamps.push_back(stamp_file(authority, fs::path(request.folder) / study::kSealedFile, digest, trust));
  }
  if (request.json) {
    ordered_json readers = ordered_json::array();
    for (const study::Progress& one : progress)
      readers.push_back({{"answered", one.answered}, {"showings", one.showings}});
    print_json({{"study", study.study.id},
                {"sha256", crypto::to_hex(digest)},
                {"readers", std::move(readers)},
                {"time", time_of(stamps)},
                {"time_stamps", stamps_json(stamps)}});
  } else {
    warn_of_missing(stamps);
    std::cout << "Closed: no answer can be changed any more without being noticed.\n  hash  "
              << crypto::to_hex(digest) << "\n";
    std::cout << stamp_lines(stamps);
    if (stamps.empty())
      std::cout << "  time  no home is here whose time-stamping authorities could be asked (--home)\n";
    std::cout << "  Give every reader this hash before the key is opened.\n"
              << "  next  kiroku quality study report " << printable(request.folder) << " --identity FILE\n";
  }
  return any_valid(stamps) ? kDone : kNoAnswer;
}

}  // namespace

void add_study_serve_command(Command& study) {
  Command& command = study.add_command("serve", "shows the films to readers in a browser of this computer");
  const auto request = std::make_shared<ServeRequest>();
  command.argument("FOLDER", request->folder, "what 'study make' made");
  command.writes("FOLDER");
  command.option("--listen", "ADDRESS:PORT", request->listen,
                 "where to listen, on this computer alone; port 0 takes a free one");
  command.flag("--json", request->json, "prints one JSON object with the address, then serves");
  command.explain(
      "Each reader signs in with a code and sees films in an order of their own. Keys 1 to 5 answer, Enter "
      "goes on. Answers are on the disk before the page says that they are stored. A reader may pause, close "
      "the window, and come again.");
  command.explain(
      "Chromium and Firefox of Debian play the films. Nothing is encrypted, so that it listens on loopback "
      "addresses only; on a computer that several people use at a time, everybody reaches the page, and "
      "only "
      "who has a code gets further.");
  command.example("kiroku quality study serve reading", "then open http://127.0.0.1:8450/");
  command.on_run([request] { return serve(*request); });
}

void add_study_status_command(Command& study) {
  Command& command = study.add_command("status", "says how far readers are, and their codes");
  const auto request = std::make_shared<StatusRequest>();
  command.argument("FOLDER", request->folder, "what 'study make' made");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.example("kiroku quality study status reading", "while readers read, too");
  command.on_run([request] { return status(*request); });
}

void add_study_close_command(Command& study) {
  Command& command = study.add_command("close", "freezes the answers, before the key is opened");
  const auto request = std::make_shared<CloseRequest>();
  command.argument("FOLDER", request->folder, "what 'study make' made");
  command.writes("FOLDER");
  command.flag("--incomplete", request->incomplete, "also where readers have not judged all films");
  command.option("--authority", "NAME", request->authorities, "asks only this authority of kiroku.toml");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Writes sealed.json: the hashes of study.json, key.age and all answers. Its own hash is printed and, "
      "where "
      "there is a home, time-stamped (sealed.AUTHORITY.tsr). From then on nothing is answered any more, and "
      "'study report' refuses what was changed.");
  command.explain(
      "Each time-stamp says whose clock it tells: self-issued is one of the recorder's own authority, which "
      "proves no time to others. Where there is no other, a warning says so. Exit status: 0 closed and "
      "time-stamped, self-issued or not, as for 'kiroku verify'; 3 closed without a time-stamp.");
  command.example("kiroku quality study close reading", "when every reader has judged every film");
  command.on_run([request] { return close(*request); });
}

void add_study_command(Command& quality) {
  Command& study =
      quality.add_command("study", "a blinded reading: what people can judge of films in each coding");
  study.explain(
      "'make' codes clips and seals which film is which, 'serve' shows them, 'close' freezes the answers, "
      "'report' opens the key and says what came of it.");
  add_study_make_command(study);
  add_study_serve_command(study);
  add_study_status_command(study);
  add_study_close_command(study);
  add_study_report_command(study);
}

}  // namespace kiroku::apps
