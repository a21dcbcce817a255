// 'kiroku witness': being a witness of logs, and asking witnesses.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/verify/witness_judgement.h"
#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/utc_time.h"
#include "crypto/cosignature.h"
#include "crypto/cosigning_key.h"
#include "crypto/witness_policy.h"
#include "witness/cosigning.h"
#include "witness/store.h"
#include "witness/witness.h"
#include "witness/witness_server.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr unsigned kOwnerOnly = 0600;

/// What a witness is: its key and name, and what it remembers.
struct WitnessFolder {
  fs::path folder;
  [[nodiscard]] fs::path key_file() const { return folder / "witness.key"; }
  [[nodiscard]] fs::path public_key_file() const { return folder / "witness.pub"; }
  [[nodiscard]] fs::path database() const { return folder / "witness.sqlite"; }

  void require() const {
    if (!fs::exists(public_key_file()))
      throw UsageError("there is no witness in " + folder.string() + ": 'kiroku witness init' makes one");
  }
  [[nodiscard]] crypto::CosignerKey key() const {
    require();
    std::string text(text_of(read_small_file(public_key_file(), "the witness's key")));
    while (text.ends_with('\n')) text.pop_back();
    return crypto::CosignerKey::parse(text);
  }
};

constexpr const char* kEd25519 = "ed25519";
constexpr const char* kMlDsa44 = "ml-dsa-44";

struct Request {
  std::string folder, name, log_key, listen = "127.0.0.1:3171";
  std::optional<std::string> origin, home, output, policy, algorithm;
  bool json = false;
};

void write_new(const fs::path& file, ByteView bytes, unsigned mode) {
  OutputFile out(file, mode);
  out.write(bytes);
  out.commit(OutputFile::Durability::kNow);
}

int init(const Request& request) {
  const WitnessFolder witness{request.folder};
  if (fs::exists(witness.key_file()) || fs::exists(witness.public_key_file()))
    throw UsageError("there is a witness in " + request.folder +
                     " already; a new one needs a folder of its own");
  const bool is_ed25519 = request.algorithm == kEd25519;
  const auto key = crypto::CosigningKey::generate(is_ed25519 ? crypto::CosignatureAlgorithm::kEd25519
                                                             : crypto::CosignatureAlgorithm::kMlDsa44);
  const crypto::CosignerKey public_key = key.public_key(request.name);
  std::error_code failed;
  fs::create_directories(witness.folder, failed);
  if (failed) throw IoError("create", witness.folder, failed.value());
  witness::Store::make(witness.database());
  write_new(witness.key_file(), key.to_pem().bytes(), kOwnerOnly);
  write_new(witness.public_key_file(), bytes_of(public_key.to_string() + "\n"), 0666);
  if (request.json) {
    print_json({{"folder", request.folder}, {"key", public_key.to_string()}});
    return kDone;
  }
  std::cout << "A witness is in " << printable(request.folder) << ". Its key, for the policies of others:\n"
            << public_key.to_string() << "\nNext: kiroku witness trust " << printable(request.folder)
            << " LOG-KEY for each log, then kiroku witness serve " << printable(request.folder) << "\n"
            << "Keep witness.key from others, and never put back an old copy of witness.sqlite: it keeps the "
               "witness from cosigning two histories.\n";
  return kDone;
}

int trust(const Request& request) {
  const WitnessFolder witness{request.folder};
  witness.require();
  std::string text = request.log_key;
  if (fs::is_regular_file(text)) {
    text = text_of(read_small_file(text, "the log's key"));
    while (text.ends_with('\n')) text.pop_back();
  }
  const crypto::VerifierKey key = crypto::VerifierKey::parse(text);
  const std::string origin = request.origin.value_or(archive::log_origin(key.name()));
  witness::Store store(witness.database());
  const bool is_new = store.add_key(origin, key);
  if (is_new && store.log(origin)->keys.size() > 1) {
    print_error("kiroku",
                "warning: several keys now speak for " + printable(origin) +
                    ", which is right where one device changed its key. Two devices of one name would "
                    "keep each other from being cosigned: give one of them another name");
  }
  if (request.json) {
    print_json({{"origin", origin}, {"key", key.to_string()}, {"new", is_new}});
    return kDone;
  }
  std::cout << (is_new ? "Witnessed from now on: " : "Witnessed already: ") << printable(origin) << "\n";
  return kDone;
}

int list(const Request& request) {
  const WitnessFolder witness{request.folder};
  witness.require();
  const witness::Store store(witness.database());
  nlohmann::ordered_json logs = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows{{"log", "keys", "cosigned entries"}};
  for (const witness::KnownLog& log : store.logs()) {
    const std::string size = log.latest ? std::to_string(log.latest->size) : "none yet";
    rows.push_back({printable(log.origin), std::to_string(log.keys.size()), size});
    nlohmann::ordered_json keys = nlohmann::ordered_json::array();
    for (const crypto::VerifierKey& key : log.keys) keys.push_back(key.to_string());
    logs.push_back({{"origin", log.origin}, {"keys", keys}});
    if (log.latest) logs.back()["size"] = log.latest->size;
  }
  if (request.json) {
    print_json({{"key", witness.key().to_string()}, {"logs", logs}});
  } else {
    std::cout << format_table(rows, "lrr", 0);
  }
  return kDone;
}

int serve(const Request& request) {
  const WitnessFolder folder{request.folder};
  const crypto::CosignerKey public_key = folder.key();
  if (is_open_to_others(folder.key_file())) {
    throw UsageError(
        folder.key_file().string() +
        " can be read or written by others than its owner: chmod 600 it, and make a new witness if it "
        "was read");
  }
  const auto key = crypto::CosigningKey::from_pem(
      text_of(read_small_file(folder.key_file(), "the witness's private key")));
  if (key.public_key(public_key.name()) != public_key)
    throw UsageError("witness.key and witness.pub in " + request.folder + " do not belong together");
  witness::Store store(folder.database());
  witness::Witness witness(store, public_key.name(), key);
  end_when_told();
  const witness::WitnessServer server(witness, request.listen);
  if (request.json) {
    print_json({{"url", server.url()}, {"key", public_key.to_string()}, {"logs", store.logs().size()}});
  } else {
    std::cout << "Witnessing " << store.logs().size() << (store.logs().size() == 1 ? " log" : " logs")
              << " on " << server.url() << "\nKey: " << public_key.to_string() << "\nCtrl-C ends it.\n";
  }
  std::cout.flush();
  wait_until_told();
  return kDone;
}

int ask(const Request& request) {
  const Home home = Home::open(request.home);
  const std::string policy_file = request.policy.value_or((home.folder() / "witnesses.txt").string());
  const auto policy = crypto::WitnessPolicy::parse(
      text_of(read_small_file(policy_file, "the policy of witnesses")), policy_file);
  const bool anybody = std::any_of(policy.witnesses().begin(), policy.witnesses().end(),
                                   [](const auto& witness) { return !witness.url.empty(); });
  if (!anybody) {
    throw UsageError("no witness of " + policy_file +
                     " has an address: write it behind its key, 'witness NAME KEY http://ADDRESS/'");
  }
  const witness::LogToShow log = witness::read_log_to_show(home.log_folder(), home.device());
  const auto outcomes = witness::cosign_log(log, policy, witness::ask_over_http());
  const std::string note = witness::cosigned_note(log, outcomes);
  const auto now = std::chrono::duration_cast<std::chrono::seconds>(utc_now().time_since_epoch()).count();
  const crypto::WitnessedNote judged = crypto::judge_witnesses(policy, note, static_cast<std::uint64_t>(now));
  const bool any =
      std::any_of(outcomes.begin(), outcomes.end(), [](const auto& each) { return !each.line.empty(); });
  const fs::path file = request.output ? fs::path(*request.output) : home.newest_witnessed_note();
  // One that has its quorum is not given up for a newer one that lacks it.
  const bool is_kept = any && (request.output || judged.quorum || !fs::exists(file));
  if (is_kept) {
    std::error_code failed;
    if (!request.output) fs::create_directories(file.parent_path(), failed);
    if (failed) throw IoError("create", file.parent_path(), failed.value());
    OutputFile out(file);
    out.write(bytes_of(note));
    out.commit(OutputFile::Durability::kNow);
  }
  nlohmann::ordered_json answers = nlohmann::ordered_json::array();
  for (const witness::CosigningOutcome& outcome : outcomes) {
    answers.push_back({{"witness", outcome.witness}, {"cosigned", !outcome.line.empty()}});
    if (!outcome.why.empty()) answers.back()["why"] = outcome.why;
  }
  if (request.json) {
    nlohmann::ordered_json object{{"entries", log.checkpoint.size},
                                  {"witnesses", answers},
                                  {"quorum", judged.quorum},
                                  {"rest", witness::words_of_rest(log)}};
    if (is_kept) object["note"] = file.string();
    print_json(object);
  } else {
    for (const witness::CosigningOutcome& outcome : outcomes) {
      std::cout << "  " << printable(outcome.witness) << ": "
                << (outcome.line.empty() ? printable(outcome.why) : "cosigned") << "\n";
    }
    std::cout << "The first " << log.checkpoint.size << " entries of the log are "
              << witnessed_words(policy.asks_for_none(), judged.quorum)
              << (is_kept ? ": " + printable(file.string()) : std::string())
              << (!is_kept && fs::exists(file) ? "; the note that was kept before stays" : "") << "\n";
    for (const std::string& sentence : witness::words_of_rest(log)) std::cout << printable(sentence) << "\n";
  }
  return judged.quorum && !witness::is_rest_unsigned(log) ? kDone : kNoAnswer;
}

std::shared_ptr<Request> with_folder(Command& command) {
  const auto request = std::make_shared<Request>();
  command.argument("DIR", request->folder, "the witness's folder");
  return request;
}

}  // namespace

void add_witness_command(Command& program) {
  Command& group =
      program.add_command("witness", "witnesses logs of others, and asks witnesses about this one's");
  group.explain(
      "A witness cosigns a log's checkpoint only where it goes on from the one that it cosigned before. So "
      "whoever "
      "holds a device's key cannot show two logs to people who ask for the cosignatures of the same "
      "witnesses. A "
      "witness is run by somebody else: another hospital, a notary, an organisation of patients (C2SP "
      "tlog-witness).");

  Command& initial = group.add_command("init", "makes a witness: a folder with a key and an empty memory");
  const auto made = with_folder(initial);
  initial.writes("DIR");
  initial.required_option("--name", "NAME", made->name,
                          "what it is called in cosignatures: hospital.example/witness");
  initial.choice("--algorithm", {kMlDsa44, kEd25519}, made->algorithm,
                 "what it signs with; a quantum computer could forge ed25519", kMlDsa44);
  initial.flag("--json", made->json, "prints one JSON object instead");
  initial.example("kiroku witness init /var/lib/witness --name notary.example/w1", "a new witness");
  initial.on_run([made] { return init(*made); });

  Command& trusting = group.add_command("trust", "takes in a log: from now on it is cosigned");
  const auto trusted = with_folder(trusting);
  trusting.argument("KEY", trusted->log_key, "the log's key, or a file that holds it: a home's device.pub");
  trusting.option("--origin", "TEXT", trusted->origin, "what its checkpoints call the log",
                  "that of a kiroku device's own log");
  trusting.flag("--json", trusted->json, "prints one JSON object instead");
  trusting.example("kiroku witness trust /var/lib/witness device.pub", "the log of a recorder");
  trusting.on_run([trusted] { return trust(*trusted); });

  Command& listing = group.add_command("logs", "which logs it knows, and how far it cosigned them");
  const auto listed = with_folder(listing);
  listing.flag("--json", listed->json, "prints one JSON object instead");
  listing.on_run([listed] { return list(*listed); });

  Command& serving = group.add_command("serve", "answers logs over HTTP until Ctrl-C");
  const auto served = with_folder(serving);
  serving.option("--listen", "ADDRESS:PORT", served->listen, "where to listen; port 0 takes a free one");
  serving.flag("--json", served->json, "prints one JSON object with the URL, then serves");
  serving.explain(
      "It trusts nothing of whoever asks: the log's signature and the proof decide. Answers are signed, so "
      "TLS is "
      "not needed; put a web server before it where it is wished. It may serve while logs are taken in.");
  serving.example("kiroku witness serve /var/lib/witness --listen 0.0.0.0:3171",
                  "for the hospital's network");
  serving.on_run([served] { return serve(*served); });

  Command& asking = group.add_command("ask", "has the appliance log's newest checkpoint cosigned");
  const auto asked = std::make_shared<Request>();
  asking.option("--witnesses", "FILE", asked->policy,
                "which witnesses, where they are, how many must have cosigned (C2SP tlog-policy)",
                "witnesses.txt of the home");
  asking.option("-o,--output", "NOTE", asked->output, "where the cosigned checkpoint goes",
                "witnessed/ of the home");
  add_home_option(asking, asked->home);
  asking.flag("--json", asked->json, "prints one JSON object instead");
  asking.explain(
      "A policy of witnesses is a text: 'witness A KEY http://notary.example:3171/', 'witness B KEY URL', "
      "'group "
      "both 2 A B', 'quorum both'. A witness that is away costs its line and nothing else. Exit status 0 "
      "where the "
      "quorum is met, 3 where it is not, or where entries of the log lack a checkpoint that was to follow "
      "them.");
  asking.example("kiroku witness ask", "once an hour, by a timer");
  asking.example("kiroku log --verify --witnesses witnesses.txt", "who cosigned the log, and how far");
  asking.on_run([asked] { return ask(*asked); });
}

}  // namespace kiroku::apps
