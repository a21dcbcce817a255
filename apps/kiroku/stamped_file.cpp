#include "apps/kiroku/stamped_file.h"

#include <algorithm>
#include <iostream>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/output_file.h"
#include "archive/storage/file_stamps.h"
#include "archive/verify/verdict.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"
#include "timestamp/request.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using Answer = Check::Answer;

}  // namespace

void write_durably(const fs::path& file, ByteView bytes) {
  OutputFile out(file);
  out.write(bytes);
  out.commit(OutputFile::Durability::kNow);
}

Stamp stamp_file(const recorder::NamedAuthority& authority, const fs::path& file,
                 const crypto::Sha256Digest& digest, const timestamp::TrustStore& trust) {
  Stamp result{authority.name, {}, {}, {}};
  try {
    const timestamp::Request request = timestamp::make_request(crypto::HashAlgorithm::kSha256, digest);
    const Bytes response = authority.source->ask(timestamp::encode_request(request));
    timestamp::Expectation expectation = archive::expectation_of(digest);
    expectation.nonce = request.nonce;
    const timestamp::TokenJudgement judgement = timestamp::judge_token(response, expectation, trust);
    if (judgement.code != timestamp::TokenCode::kValid) {
      result.problem = judgement.explanation;
      return result;
    }
    write_durably(archive::token_beside(file, authority.name), response);
    result.gen_time = judgement.info->gen_time;
    result.clock = judgement.authority;
  } catch (const Error& error) {
    result.problem = error.what();
  }
  return result;
}

ordered_json stamps_json(const std::vector<Stamp>& stamps) {
  ordered_json all = ordered_json::array();
  for (const Stamp& each : stamps) {
    ordered_json one{{"authority", each.authority}};
    if (each.gen_time) {
      one["gen_time"] = format_utc(*each.gen_time);
      one["kind"] = timestamp::authority_kind_name(each.clock);
    }
    if (!each.problem.empty()) one["problem"] = each.problem;
    all.push_back(std::move(one));
  }
  return all;
}

std::string stamp_lines(const std::vector<Stamp>& stamps) {
  std::string lines;
  for (const Stamp& each : stamps) {
    if (!each.gen_time) continue;
    lines += "  time  " + format_utc(*each.gen_time) + " by " + printable(each.authority);
    if (each.clock == timestamp::TimeAuthority::kOwn)
      lines += " (self-issued: by the recorder's own authority, no outside clock stands behind it)";
    lines += "\n";
  }
  return lines;
}

void warn_of_missing(const std::vector<Stamp>& stamps) {
  for (const Stamp& each : stamps) {
    if (!each.problem.empty())
      print_error("kiroku", "warning: no time-stamp of " + each.authority + ": " + each.problem);
  }
  const bool all_answered = std::ranges::all_of(stamps, &std::string::empty, &Stamp::problem);
  if (all_answered && time_of(stamps) == archive::time_proof_name(archive::TimeProof::kSelfIssued))
    print_error(
        "kiroku",
        "warning: no outside authority time-stamped it: the recorder's own proves to nobody else when "
        "this was there; add an [[authority]] to kiroku.toml, and its root to trust.pem");
}

bool any_valid(const std::vector<Stamp>& stamps) {
  return std::ranges::any_of(stamps, [](const Stamp& each) { return each.gen_time.has_value(); });
}

std::string_view time_of(const std::vector<Stamp>& stamps) {
  const bool outside = std::ranges::any_of(stamps, [](const Stamp& each) {
    return each.gen_time && each.clock == timestamp::TimeAuthority::kOutside;
  });
  return archive::time_proof_name(outside             ? archive::TimeProof::kExternal
                                  : any_valid(stamps) ? archive::TimeProof::kSelfIssued
                                                      : archive::TimeProof::kNone);
}

std::optional<SealRecord> find_record(const Home& home,
                                      const std::function<bool(const archive::LogEntryBody&)>& states) {
  std::optional<SealRecord> found;
  crypto::MerkleFrontier tree;
  archive::for_each_log_line(home.log_folder(), [&](const archive::LogLine& line) {
    if (found && found->is_signed) return;
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    const archive::LogEntryParse parsed = archive::parse_log_entry(line.json);
    if (!parsed.entry || !states(parsed.entry->body)) return;
    const bool is_signed = archive::is_signed_entry(home.log_folder(), home.device(), line.seq, tree.root());
    if (!found || is_signed) found = SealRecord{line.seq, line.utc, is_signed};
  });
  return found;
}

std::vector<Check> check_tokens(const NamedRoots& roots, const std::optional<Home>& home,
                                const fs::path& file, const crypto::Sha256Digest& digest) {
  return archive::check_tokens_beside(file, digest, trust_of(roots, home));
}

Check check_log(const std::optional<Home>& home, const std::string& what,
                const std::function<bool(const archive::LogEntryBody&)>& states) {
  if (!home) return {"log", Answer::kUnknown, "there is no home here whose appliance log could be asked"};
  const auto record = find_record(*home, states);
  if (!record) {
    return {"log", Answer::kUnknown,
            "the appliance log of " + home->folder().string() + " does not know this " + what +
                ": it was made by another appliance, or changed since"};
  }
  if (!record->is_signed) {
    return {
        "log", Answer::kUnknown,
        "entry " + std::to_string(record->seq) + " of the appliance log states this " + what +
            ", and this device did not sign it when it was written: the machine stopped at that moment, or "
            "somebody made it up"};
  }
  return {"log", Answer::kHolds,
          "entered at " + format_utc(record->utc) + ", entry " + std::to_string(record->seq)};
}

int tell_checks(const std::string& file, const std::string& title, const std::vector<Check>& checks,
                const ordered_json& head, bool json) {
  const Answer verdict = verdict_of(checks);
  if (json) {
    ordered_json object = head;
    object["verdict"] = answer_name(verdict);
    object["checks"] = ordered_json::array();
    for (const Check& check : checks) {
      object["checks"].push_back(
          {{"about", check.what}, {"answer", answer_name(check.answer)}, {"text", check.text}});
    }
    print_json(object);
  } else {
    std::cout << file << ": "
              << (verdict == Answer::kHolds     ? paint(Colour::kGreen, "HOLDS")
                  : verdict == Answer::kDiffers ? paint(Colour::kRed, "DIFFERS")
                                                : paint(Colour::kYellow, "COULD NOT BE CHECKED WHOLLY"))
              << (title.empty() ? "" : " (" + printable(title) + ")") << "\n";
    for (const Check& check : checks) {
      std::cout << "  " << check.what << std::string(check.what.size() < 7 ? 7 - check.what.size() : 1, ' ')
                << (check.answer == Answer::kHolds     ? ""
                    : check.answer == Answer::kDiffers ? "NO: "
                                                       : "not known: ")
                << printable(check.text) << "\n";
    }
  }
  return verdict == Answer::kHolds ? kDone : verdict == Answer::kDiffers ? kAnswerIsNo : kNoAnswer;
}

}  // namespace kiroku::apps
