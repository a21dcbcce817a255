// 'kiroku plan seal' and 'kiroku plan verify'.
#include <algorithm>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/plan_reading.h"
#include "archive/appliance_log.h"
#include "archive/case_reader.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "sim/plan/plan_files.h"
#include "timestamp/request.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using timestamp::TokenVerdict;

struct Request {
  std::string file;
  std::optional<std::string> home, case_folder;
  std::vector<std::string> authorities, trust;
  bool json = false;
};

constexpr const char* kEnding = ".seal.json";

/// liver.json is sealed in liver.seal.json, beside it.
fs::path seal_file(const fs::path& plan) {
  fs::path file = plan;
  return file.replace_extension(kEnding);
}

/// liver.seal.embedded.tsr
fs::path token_file(const fs::path& seal, const std::string& authority) {
  fs::path file = seal;
  return file.replace_extension("." + authority + ".tsr");
}

void write(const fs::path& file, ByteView bytes) {
  OutputFile out(file);
  out.write(bytes);
  out.commit(OutputFile::Durability::kNow);
}

/// What an authority said to a seal.
struct Stamp {
  std::string authority;
  std::optional<UtcTime> gen_time;
  std::string problem;  // why there is no valid token
};

Stamp stamp(const recorder::NamedAuthority& authority, const fs::path& seal, ByteView digest,
            const timestamp::TrustStore& trust) {
  Stamp result{authority.name, {}, {}};
  try {
    const timestamp::Request request = timestamp::make_request(crypto::HashAlgorithm::kSha256, digest);
    const Bytes response = authority.source->ask(timestamp::encode_request(request));
    timestamp::Expectation expectation;
    expectation.algorithm = request.algorithm;
    expectation.imprint = request.imprint;
    expectation.nonce = request.nonce;
    const timestamp::TokenJudgement judgement = timestamp::judge_token(response, expectation, trust);
    if (judgement.code != timestamp::TokenCode::kValid) {
      result.problem = judgement.explanation;
      return result;
    }
    write(token_file(seal, authority.name), response);
    result.gen_time = judgement.info->gen_time;
  } catch (const Error& error) {
    result.problem = error.what();
  }
  return result;
}

ordered_json stamps_json(const std::vector<Stamp>& stamps) {
  ordered_json all = ordered_json::array();
  for (const Stamp& each : stamps) {
    ordered_json one{{"authority", each.authority}};
    if (each.gen_time) one["gen_time"] = format_utc(*each.gen_time);
    if (!each.problem.empty()) one["problem"] = each.problem;
    all.push_back(std::move(one));
  }
  return all;
}

int seal(const Request& request) {
  const fs::path plan_file = request.file, seal_path = seal_file(plan_file);
  if (fs::exists(seal_path)) {
    throw UsageError(seal_path.string() +
                     " is there already: kiroku plan verify tells whether it still holds; to seal a changed "
                     "plan, give that another name");
  }
  const Home home = Home::open(request.home);
  const Configuration configuration = home.configuration();
  const auto plan = read_plan_and_tell(request.file, request.json);
  if (!plan) return kRefused;
  PlanSeal made{plan->name, {}};
  {
    StepLine line;
    for (const sim::PlanFile& file : sim::files_of_plan(plan_file)) {
      line.show("hashing " + file.name);
      made.files.push_back(hashed(file.role, file.name, file.path));
    }
  }
  const Authorities authorities(home, configuration, request.authorities);
  const WritableHome writable(home);
  const std::string text = plan_seal_text(made);
  const crypto::Sha256Digest digest = crypto::sha256(bytes_of(text));
  write(seal_path, bytes_of(text));
  writable.log->plan_sealed(digest);
  std::vector<Stamp> stamps;
  for (const recorder::NamedAuthority& authority : authorities.named())
    stamps.push_back(stamp(authority, seal_path, digest, writable.trust));
  const bool stamped =
      std::ranges::any_of(stamps, [](const Stamp& each) { return each.gen_time.has_value(); });
  if (request.json) {
    print_json({{"seal", seal_path.string()},
                {"sha256", crypto::to_hex(digest)},
                {"files", made.files.size()},
                {"time_stamps", stamps_json(stamps)}});
  } else {
    for (const Stamp& each : stamps) {
      if (!each.problem.empty())
        print_error("kiroku", "warning: no time-stamp of " + each.authority + ": " + each.problem);
    }
    std::cout << seal_path.string() << ": " << made.files.size()
              << " files sealed, entered into the appliance log\n  seal  " << crypto::to_hex(digest) << "\n";
    for (const Stamp& each : stamps) {
      if (each.gen_time)
        std::cout << "  time  " << format_utc(*each.gen_time) << " by " << each.authority << "\n";
    }
    std::cout << "  next  kiroku record --plan " << printable(seal_path.string()) << " ...\n";
  }
  return stamped ? kDone : kNoAnswer;
}

/// One thing that was looked at.
struct Check {
  enum class Answer { kHolds, kDiffers, kUnknown };
  std::string what;
  Answer answer = Answer::kHolds;
  std::string text;
};

const char* answer_name(Check::Answer answer) {
  switch (answer) {
    case Check::Answer::kHolds:
      return "holds";
    case Check::Answer::kDiffers:
      return "differs";
    case Check::Answer::kUnknown:
      break;
  }
  return "could-not-check";
}

std::vector<Check> check_files(const PlanSeal& seal, const fs::path& folder) {
  using Answer = Check::Answer;
  std::vector<Check> checks;
  std::size_t same = 0;
  for (const SealedFile& file : seal.files) {
    try {
      const SealedFile now = hashed(file.role, file.name, folder / file.name);
      if (now.sha256 == file.sha256) {
        ++same;
      } else {
        checks.push_back({"files", Answer::kDiffers, file.name + " is not what was sealed"});
      }
    } catch (const IoError& error) {
      checks.push_back({"files", Answer::kUnknown, error.what()});
    }
  }
  if (checks.empty())
    checks.push_back({"files", Answer::kHolds, "all " + std::to_string(same) + " are as they were sealed"});
  // A picture added to a volume changes what is planned on, too.
  try {
    for (const sim::PlanFile& file : sim::files_of_plan(folder / seal.files.front().name)) {
      if (std::ranges::find(seal.files, file.name, &SealedFile::name) == seal.files.end())
        checks.push_back({"files", Answer::kDiffers, file.name + " was not there when the plan was sealed"});
    }
  } catch (const Error&) {
    // Told above: the plan or what it names is not as it was.
  }
  return checks;
}

std::vector<Check> check_tokens(const Request& request, const std::optional<Home>& home, const fs::path& seal,
                                const crypto::Sha256Digest& digest) {
  using Answer = Check::Answer;
  timestamp::TrustStore trust;
  for (const std::string& file : request.trust) trust.add_trusted_file(file);
  if (request.trust.empty() && home) trust.add_trusted_file(home->trust_file());
  std::vector<Check> checks;
  const std::string stem = seal.stem().string() + ".";  // liver.seal.
  std::vector<fs::path> tokens;
  for (const auto& entry : fs::directory_iterator(seal.has_parent_path() ? seal.parent_path() : ".")) {
    if (entry.path().extension() == ".tsr" && entry.path().filename().string().starts_with(stem))
      tokens.push_back(entry.path());
  }
  std::ranges::sort(tokens);
  for (const fs::path& token : tokens) {
    timestamp::Expectation expectation;
    expectation.algorithm = crypto::HashAlgorithm::kSha256;
    expectation.imprint = Bytes(digest.begin(), digest.end());
    const timestamp::TokenJudgement judgement =
        timestamp::judge_token(read_small_file(token, "the time-stamp"), expectation, trust);
    const std::string name = token.filename().string();
    switch (timestamp::verdict_of(judgement.code)) {
      case TokenVerdict::kValid:
        checks.push_back({"time", Answer::kHolds,
                          "existed at " + format_utc(judgement.info->gen_time) + ", says " + name + " (" +
                              judgement.root_subject + ")"});
        break;
      case TokenVerdict::kRefused:
        checks.push_back({"time", Answer::kDiffers, name + ": " + judgement.explanation});
        break;
      case TokenVerdict::kCouldNotCheck:
        checks.push_back({"time", Answer::kUnknown, name + ": " + judgement.explanation});
        break;
    }
  }
  if (checks.empty())
    checks.push_back({"time", Answer::kUnknown, "there is no time-stamp beside " + seal.filename().string()});
  return checks;
}

/// A log that does not know the seal tells only that it is not this appliance's, or not as it was sealed.
Check check_log(const std::optional<Home>& home, const crypto::Sha256Digest& digest) {
  using Answer = Check::Answer;
  if (!home) return {"log", Answer::kUnknown, "there is no home here whose appliance log could be asked"};
  const auto record = find_seal(*home, digest);
  if (!record) {
    return {"log", Answer::kUnknown,
            "the appliance log of " + home->folder().string() +
                " does not know this seal: it was made by another appliance, or changed since"};
  }
  return {"log", Answer::kHolds,
          "entered at " + format_utc(record->utc) + ", entry " + std::to_string(record->seq)};
}

/// Whether the log held the seal before the case began: the case's first entry states the log's size and root
/// as they were then.
Check check_order(const std::optional<Home>& home, const archive::OpenEntry& open,
                  const crypto::Sha256Digest& digest) {
  using Answer = Check::Answer;
  if (!home || home->device().to_string() != open.device) {
    return {"order", Answer::kUnknown,
            "which came first is known to the log of the appliance that recorded the case: give its --home"};
  }
  crypto::MerkleFrontier tree;
  archive::for_each_log_line(home->log_folder(), [&](const archive::LogLine& line) {
    if (tree.size() < open.appliance_log_size) tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
  });
  if (tree.size() != open.appliance_log_size || tree.root() != open.appliance_log_root) {
    return {"order", Answer::kDiffers,
            "the appliance log is not the one that " + open.case_id + " was begun under"};
  }
  const auto record = find_seal(*home, digest);
  if (!record || record->seq >= open.appliance_log_size)
    return {"order", Answer::kDiffers, "the seal came after the case had begun"};
  return {"order", Answer::kHolds,
          "sealed before the first picture: the case begins with a log of " +
              std::to_string(open.appliance_log_size) + " entries, the seal is entry " +
              std::to_string(record->seq)};
}

/// Whether the case says that it was recorded by this plan, and which came first.
std::vector<Check> check_case(const std::optional<Home>& home, const fs::path& folder,
                              const crypto::Sha256Digest& digest) {
  using Answer = Check::Answer;
  const archive::CaseReader reader = archive::CaseReader::open(folder);
  const archive::OpenEntry& open = reader.opening();
  if (!open.plan) return {{"case", Answer::kDiffers, open.case_id + " names no plan"}};
  if (*open.plan != digest)
    return {{"case", Answer::kDiffers, open.case_id + " was recorded by another plan"}};
  return {{"case", Answer::kHolds, open.case_id + " was recorded by this plan"},
          check_order(home, open, digest)};
}

int verify(const Request& request) {
  using Answer = Check::Answer;
  const fs::path seal_path = request.file;
  const Bytes bytes = read_small_file(seal_path, "the sealed plan");
  const PlanSeal seal = parse_plan_seal(text_of(bytes), request.file);
  const crypto::Sha256Digest digest = crypto::sha256(bytes);
  const std::optional<Home> home = Home::find(request.home);
  std::vector<Check> checks = check_files(seal, seal_path.parent_path());
  std::ranges::move(check_tokens(request, home, seal_path, digest), std::back_inserter(checks));
  checks.push_back(check_log(home, digest));
  if (request.case_folder) {
    std::ranges::move(check_case(home, find_case(home, *request.case_folder), digest),
                      std::back_inserter(checks));
  }
  const auto any = [&](Answer answer) {
    return std::ranges::any_of(checks, [&](const Check& check) { return check.answer == answer; });
  };
  const Answer verdict = any(Answer::kDiffers)   ? Answer::kDiffers
                         : any(Answer::kUnknown) ? Answer::kUnknown
                                                 : Answer::kHolds;
  if (request.json) {
    ordered_json all = ordered_json::array();
    for (const Check& check : checks)
      all.push_back({{"about", check.what}, {"answer", answer_name(check.answer)}, {"text", check.text}});
    print_json({{"seal", request.file},
                {"plan", seal.plan},
                {"sha256", crypto::to_hex(digest)},
                {"verdict", answer_name(verdict)},
                {"checks", all}});
  } else {
    std::cout << request.file << ": "
              << (verdict == Answer::kHolds     ? paint(Colour::kGreen, "HOLDS")
                  : verdict == Answer::kDiffers ? paint(Colour::kRed, "DIFFERS")
                                                : paint(Colour::kYellow, "COULD NOT BE CHECKED WHOLLY"))
              << (seal.plan.empty() ? "" : " (" + printable(seal.plan) + ")") << "\n";
    for (const Check& check : checks) {
      std::cout << "  " << check.what << std::string(check.what.size() < 7 ? 7 - check.what.size() : 1, ' ')
                << (check.answer == Answer::kHolds     ? ""
                    : check.answer == Answer::kDiffers ? "NO: "
                                                       : "not known: ")
                << printable(check.text) << "\n";
    }
    if (request.case_folder) std::cout << "  Whether the case itself is whole tells kiroku verify.\n";
  }
  return verdict == Answer::kHolds ? kDone : verdict == Answer::kDiffers ? kAnswerIsNo : kNoAnswer;
}

}  // namespace

void add_plan_seal_commands(Command& plan) {
  Command& sealed = plan.add_command("seal", "freezes a plan before the operation");
  const auto seal_request = std::make_shared<Request>();
  sealed.argument("PLAN", seal_request->file, "the plan (.json)");
  sealed.option("--authority", "NAME", seal_request->authorities, "asks only this authority of kiroku.toml");
  add_home_option(sealed, seal_request->home);
  sealed.flag("--json", seal_request->json, "prints one JSON object instead");
  sealed.explain(
      "Writes PLAN.seal.json beside the plan: the hashes of the plan, its mesh or what that is made of, and "
      "its volume. Their hash is entered into the appliance log and time-stamped (PLAN.seal.AUTHORITY.tsr). "
      "Nothing of the plan leaves the machine but that hash. Exit status: 0 sealed and time-stamped, 3 "
      "sealed "
      "without a time-stamp.");
  sealed.example("kiroku plan seal liver.json", "and then: kiroku record --plan liver.seal.json ...");
  sealed.on_run([seal_request] { return seal(*seal_request); });

  Command& verified = plan.add_command("verify", "tells whether a sealed plan still holds, and came first");
  const auto verify_request = std::make_shared<Request>();
  verified.argument("SEAL", verify_request->file, "the sealed plan (.seal.json)");
  verified.option("--case", "CASE", verify_request->case_folder,
                  "also whether that case was recorded by this plan, which was sealed before it");
  verified.option("--trust", "PEM", verify_request->trust,
                  "roots of time-stamping authorities; those of the home if absent");
  add_home_option(verified, verify_request->home);
  verified.flag("--json", verify_request->json, "prints one JSON object instead");
  verified.explain("Exit status: 0 all holds, 1 something differs, 3 something could not be checked.");
  verified.example("kiroku plan verify liver.seal.json --case 20260805T091502Z-3f9c21ab",
                   "was this operation planned so beforehand?");
  verified.on_run([verify_request] { return verify(*verify_request); });
}

}  // namespace kiroku::apps
