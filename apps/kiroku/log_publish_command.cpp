#include "apps/kiroku/log_publish_command.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/log_publishing.h"
#include "apps/verify/verify_command.h"
#include "archive/storage/file_system.h"
#include "base/error.h"
#include "base/json_or_null.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "witness/cosigning.h"
#include "witness/following.h"
#include "witness/tiles.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using witness::Followed;
using witness::Following;

ordered_json as_json(const std::optional<crypto::Checkpoint>& checkpoint) {
  if (!checkpoint) return nullptr;
  return {
      {"origin", checkpoint->origin}, {"size", checkpoint->size}, {"root", crypto::to_hex(checkpoint->root)}};
}

ordered_json as_json(const std::vector<fs::path>& folders) {
  ordered_json names = ordered_json::array();
  for (const fs::path& folder : folders) names.push_back(folder.string());
  return names;
}

ordered_json as_json(const Followed& followed, const std::string& folder) {
  return {{"folder", folder},
          {"outcome", witness::following_name(followed.what)},
          {"kept", as_json(followed.kept)},
          {"shown", as_json(followed.shown)},
          {"common_entries", or_null(followed.common)},
          {"evidence", or_null(followed.evidence.string())},
          {"not_kept", or_null(followed.not_kept)},
          {"lacks_signature", followed.lacks_signature},
          {"earlier_forks", as_json(followed.earlier_forks)},
          {"why", or_null(followed.why)}};
}

/// Counts leaf hashes as the bytes that they have.
std::function<void(std::uint64_t)> shown_by(Progress& progress) {
  return [&progress](std::uint64_t leaves) { progress.update(leaves * sizeof(crypto::Sha256Digest), 0); };
}

/// `older`: what an older state comes to.
int status_of(Following what, int older) {
  switch (what) {
    case Following::kBegun:
    case Following::kSame:
    case Following::kGoesOn:
      return kDone;
    case Following::kOlder:
      return older;
    case Following::kTwoHistories:
      return kAnswerIsNo;
    case Following::kCouldNotTell:
      break;
  }
  return kNoAnswer;
}

// ---- publish ----

struct PublishRequest {
  std::string folder;
  std::optional<std::string> home;
  bool json = false;
};

int publish(const PublishRequest& request) {
  const Home home = Home::open(request.home);
  Progress progress("publishing");
  const Publication published = publish_log(home, request.folder, shown_by(progress));
  progress.clear();
  if (request.json) {
    ordered_json object = as_json(published.came, request.folder);
    object["rest"] = published.rest;
    print_json(object);
  } else {
    std::cout << printable(published_text(published.came, request.folder)) << "\n";
    for (const std::string& sentence : published.rest) std::cout << printable(sentence) << "\n";
  }
  const int status = status_of(published.came.what, kAnswerIsNo);
  return status == kDone && published.is_rest_unsigned ? kNoAnswer : status;
}

// ---- follow ----

struct FollowRequest {
  std::string source, copy;
  std::vector<std::string> devices;
  bool json = false;
};

/// A sentence a line.
std::vector<std::string> followed_text(const Followed& followed, const std::string& copy) {
  switch (followed.what) {
    case Following::kBegun:
      return {"BEGUN: " + copy + " has the log's " + entries_text(followed.shown) + ".",
              "Nothing was there to compare with. From now on the log must go on from these."};
    case Following::kSame:
      return {"SAME: the log has the " + entries_text(followed.shown) + " that it had."};
    case Following::kGoesOn:
      return {"GOES ON: the log has " + entries_text(followed.shown) + ", and its first " +
              std::to_string(followed.kept->size) + " are what they were."};
    case Following::kOlder:
      return {
          "OLDER: the log is shown with " + entries_text(followed.shown) + ", and had " +
              entries_text(followed.kept) + " before.",
          "What is shown is a beginning of what was. Ask once more later: if it stays so, somebody cut the "
          "log off, or shows an old copy."};
    case Following::kTwoHistories:
      return {"TWO HISTORIES: one device signed both, and they cannot be one.",
              followed.common ? "The first " + counted(*followed.common, "entry", "entries") +
                                    " are the same. Behind that each goes its own way."
                              : std::string("Where they part its tiles do not tell."),
              "Either the holder of the device's key made both, or its recorder wrote to another disk for a "
              "time, or went on from an older copy that was put back.",
              "If one was changed on the disk and signed on, it says so itself (damage-found).",
              "The copy: " + copy + ", " + entries_text(followed.kept),
              "The other one: " +
                  (followed.evidence.empty() ? std::string("not kept") : followed.evidence.string()) + ", " +
                  entries_text(followed.shown),
              followed.evidence.empty() ? "Keep what you were shown." : "Keep both."};
    case Following::kCouldNotTell:
      break;
  }
  return {"COULD NOT TELL: " + followed.why + ".",
          followed.evidence.empty()
              ? "Nothing was taken into the copy."
              : "What was shown is kept beside the copy: " + followed.evidence.string()};
}

/// What stays true whatever is shown now.
std::vector<std::string> remarks(const Followed& followed) {
  std::vector<std::string> sentences;
  for (const fs::path& fork : followed.earlier_forks) {
    sentences.push_back("ANOTHER HISTORY was shown here before, signed by the same device: " + fork.string() +
                        ". That does not go away.");
  }
  if (!followed.not_kept.empty()) {
    sentences.push_back("What was shown is not kept, or not whole: " + followed.not_kept + ".");
  }
  const bool is_taken = followed.what == Following::kBegun || followed.what == Following::kGoesOn;
  if (is_taken && followed.lacks_signature) {
    sentences.emplace_back(
        "Its checkpoint lacks the signature by a key that the device has beside Ed25519: until a later one "
        "has "
        "it, a second history would accuse nobody.");
  }
  return sentences;
}

int follow(const FollowRequest& request) {
  if (request.devices.empty())
    throw UsageError(
        "whose log it is must be known from elsewhere: give --device, the recorder's device.pub");
  std::vector<crypto::VerifierKey> devices;
  for (const std::string& device : request.devices) {
    for (crypto::VerifierKey& key : load_device_keys(device)) devices.push_back(std::move(key));
  }
  const bool is_address = request.source.starts_with("http://") || request.source.starts_with("https://");
  const std::unique_ptr<witness::TileSource> source =
      is_address ? witness::tiles_over_http(request.source) : witness::tiles_in_folder(request.source);
  Progress progress("following");
  const Followed followed = follow_log(*source, archive::real_file_system(), request.copy, devices,
                                       witness::KeepEvidence::kYes, shown_by(progress));
  progress.clear();
  if (request.json) {
    print_json(as_json(followed, request.copy));
  } else {
    std::vector<std::string> sentences = followed_text(followed, request.copy);
    std::ranges::copy(remarks(followed), std::back_inserter(sentences));
    for (const std::string& sentence : sentences) std::cout << printable(sentence) << "\n";
  }
  return followed.earlier_forks.empty() ? status_of(followed.what, kNoAnswer) : kAnswerIsNo;
}

}  // namespace

void add_log_publish_command(Command& log) {
  Command& command =
      log.add_command("publish", "writes the log's tree as files that any web server can give out");
  const auto request = std::make_shared<PublishRequest>();
  command.argument("FOLDER", request->folder, "where to; it goes on from what was published there before");
  command.writes("FOLDER");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Hashes of the log's entries, and its newest checkpoint: the files of C2SP's tlog-tiles, without the "
      "entries. They tell how many entries there are, and nothing of users, cases and patients. Put the "
      "folder on a web server, or copy it to a store, and run the command again from time to time.");
  command.explain(
      "Nothing is published that does not go on from what was. Exit status: 0 it is published; 1 the folder "
      "has more, or another history; 2 wrong usage or unreadable; 3 it could not be told, or entries of the "
      "log lack a checkpoint that was to follow them.");
  command.example("kiroku log publish /srv/www/or-3", "once an hour, by a timer");
  command.on_run([request] { return publish(*request); });
}

void add_log_follow_command(Command& log) {
  Command& command =
      log.add_command("follow", "keeps a copy of a published log, and tells where it becomes another");
  const auto request = std::make_shared<FollowRequest>();
  command.argument("SOURCE", request->source,
                   "where it is published: an address of http or https, or a folder");
  command.argument("COPY", request->copy, "folder for the copy; made where it is not there");
  command.writes("COPY");
  command.option("--device", "FILE", request->devices,
                 "must be given: the recorder's key, a device.pub or the key itself");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "For somebody else than who runs the recorder. Each time the log must go on from the copy. Whoever "
      "holds the device's key and shows two people two logs is found out by either of them who follows one, "
      "and is shown the other.");
  command.explain(
      "Exit status: 0 one history; 1 two histories that one device signed: the other one is kept in the "
      "copy, and every later run says so; 2 wrong usage or unreadable; 3 nothing follows: an older state, "
      "tiles that are not there or do not fit, a checkpoint of another device.");
  command.example("kiroku log follow https://www.hospital.example/or-3 or-3-log --device device.pub",
                  "once a day, by a timer, at another hospital");
  command.example("kiroku log follow from-the-court or-3-log --device device.pub",
                  "whether what a court was shown is the same log");
  command.on_run([request] { return follow(*request); });
}

}  // namespace kiroku::apps
