#include "apps/kiroku/token_evidence_command.h"

#include <deque>
#include <iostream>
#include <map>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/named_roots.h"
#include "apps/verify/judging.h"
#include "base/error.h"
#include "evidence/record_verifier.h"
#include "evidence/xml_record.h"

namespace kiroku::apps {
namespace {

using evidence::RecordJudgement;
using evidence::Standing;
using nlohmann::ordered_json;

struct Request {
  std::string record;
  std::vector<std::string> files;
  NamedRoots roots;
  std::optional<std::string> policy, home;
  bool json = false;
};

/// Files as a record's data, each hashed once with each algorithm. They must outlive the objects.
std::vector<evidence::DataObject> objects_of(const std::vector<std::string>& names,
                                             const std::deque<MappedFile>& files) {
  std::vector<evidence::DataObject> objects;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto known = std::make_shared<std::map<crypto::HashAlgorithm, Bytes>>();
    const ByteView bytes = files[i].bytes();
    objects.push_back({names[i],
                       [known, bytes](crypto::HashAlgorithm algorithm) -> std::optional<Bytes> {
                         const auto at = known->find(algorithm);
                         if (at != known->end()) return at->second;
                         return known->emplace(algorithm, crypto::digest(algorithm, bytes)).first->second;
                       },
                       bytes});
  }
  return objects;
}

struct Judged {
  const char* form = "";
  RecordJudgement judgement;
};

/// Of the files those of which the canonical XML was there, and not the bytes. A record that does not hold
/// tells of none.
std::vector<std::string> only_as_canonical(const RecordJudgement& judgement, const Request& request) {
  std::vector<std::string> names;
  if (judgement.standing() != Standing::kHolds) return names;
  for (std::size_t i = 0; i < request.files.size(); ++i)
    if (judgement.only_as_canonical[i]) names.push_back(request.files[i]);
  return names;
}

Judged judge(const Request& request) {
  const MappedFile record(request.record);
  std::deque<MappedFile> files;
  for (const std::string& name : request.files) files.emplace_back(name);
  const std::vector<evidence::DataObject> objects = objects_of(request.files, files);
  const timestamp::TrustStore trust = required_trust(request.roots, request.home);
  std::optional<evidence::Policy> policy;
  if (request.policy) policy = read_policy(*request.policy);
  const evidence::JudgingRules rules{
      .trust = &trust, .policy = policy ? &*policy : nullptr, .now = utc_now(), .objects_may_join = false};
  const std::string cannot = "cannot read the evidence record " + request.record + ": ";
  if (!evidence::begins_as_xml(record.bytes())) {
    const evidence::RecordParse parsed = evidence::parse_record(record.bytes());
    if (!parsed.record) throw Error(cannot + parsed.explanation);
    return {"rfc4998", evidence::judge_record(*parsed.record, objects, rules)};
  }
  const evidence::XmlRecord read = [&] {
    try {
      return evidence::XmlRecord::parse(text_of(record.bytes()));
    } catch (const Error& error) {
      throw Error(cannot + error.what());
    }
  }();
  return {"rfc6283", read.judge(objects, rules)};
}

const char* kind_name(evidence::StampKind kind) {
  switch (kind) {
    case evidence::StampKind::kFirst:
      return "first";
    case evidence::StampKind::kTimeStampRenewal:
      return "time-stamp-renewal";
    case evidence::StampKind::kHashTreeRenewal:
      break;
  }
  return "hash-tree-renewal";
}

const char* verdict_name(Standing standing) {
  return standing == Standing::kHolds     ? "holds"
         : standing == Standing::kRefused ? "refused"
                                          : "could-not-check";
}

std::string time_of(const std::optional<UtcTime>& time) { return time ? format_utc(*time) : "unknown"; }

void print_as_json(const Judged& judged, const Request& request) {
  const RecordJudgement& judgement = judged.judgement;
  const auto time = [](const std::optional<UtcTime>& at) {
    return at ? ordered_json(format_utc(*at)) : ordered_json(nullptr);
  };
  ordered_json stamps = ordered_json::array(), problems = ordered_json::array();
  for (const evidence::TimeStampJudgement& each : judgement.time_stamps) {
    stamps.push_back(
        {{"place", evidence::place_of(each.chain, each.index)},
         {"kind", kind_name(each.kind)},
         {"algorithm", each.algorithm},
         {"time", time(each.token.info ? std::optional(each.token.info->gen_time) : std::nullopt)},
         {"code", timestamp::code_name(each.token.code)},
         {"signer", each.token.signer_subject},
         {"other_values", each.other_values}});
  }
  for (const evidence::Problem& each : judgement.problems)
    problems.push_back({{"code", each.code}, {"place", each.place}, {"text", each.text}});
  print_json({{"verdict", verdict_name(judgement.standing())},
              {"form", judged.form},
              {"since", time(judgement.since())},
              {"newest", time(judgement.newest())},
              {"outside", judgement.outside()},
              {"end", judgement.end
                          ? ordered_json{{"time", format_utc(judgement.end->time)}, {"of", judgement.end->of}}
                          : ordered_json(nullptr)},
              {"only_as_canonical_xml", only_as_canonical(judgement, request)},
              {"time_stamps", std::move(stamps)},
              {"problems", std::move(problems)}});
}

void print(const Judged& judged, const Request& request) {
  const RecordJudgement& judgement = judged.judgement;
  const Standing standing = judgement.standing();
  const std::vector<std::string> canonical = only_as_canonical(judgement, request);
  const std::string count = std::to_string(request.files.size());
  const std::string files =
      request.files.size() != 1
          ? count + " files were there" +
                (canonical.empty() ? ""
                                   : ", " + std::to_string(canonical.size()) + " of them as canonical XML,")
      : canonical.empty() ? "the file was there"
                          : "the file's canonical XML was there";
  // What no outside clock stands behind is said by the recorder, and proved to nobody.
  const std::string holds = judgement.outside()
                                ? paint(Colour::kGreen, "HOLDS") + ": "
                                : paint(Colour::kYellow, "HOLDS") + ", by the recorder's own word: ";
  std::cout << (standing == Standing::kHolds ? holds + files + " at "
                : standing == Standing::kRefused
                    ? paint(Colour::kRed, "REFUSED") + ": the record says since "
                    : paint(Colour::kYellow, "COULD NOT BE CHECKED") + ": the record says since ")
            << time_of(judgement.since()) << "\n";
  for (const evidence::TimeStampJudgement& each : judgement.time_stamps) {
    std::cout << "  " << evidence::place_of(each.chain, each.index) << "  " << kind_name(each.kind) << ", "
              << printable(each.algorithm) << ", "
              << time_of(each.token.info ? std::optional(each.token.info->gen_time) : std::nullopt) << ", "
              << printable(each.token.signer_subject) << "\n";
  }
  if (standing == Standing::kHolds) {
    for (const std::string& name : canonical)
      std::cout
          << "  XML       " << printable(name)
          << ": how it is written is not covered, nor are comments where the record's method leaves them "
             "out\n";
    if (const std::size_t others = judgement.time_stamps.front().other_values; others > 0)
      std::cout << "  others    " << others << " more hash " << (others == 1 ? "value is" : "values are")
                << " of data that was not given\n";
    std::cout << "  clock     "
              << (judgement.outside() ? "external: outside authorities'"
                                      : "self-issued: a time-stamp is the recorder's own authority's")
              << "\n";
    if (judgement.end)
      std::cout << "  until     " << format_utc(judgement.end->time) << ", when "
                << printable(judgement.end->of) << " ends: renew it before\n";
  }
  for (const evidence::Problem& each : judgement.problems)
    std::cout << "  " << each.code << ": " << printable(each.text) << "\n";
}

int run(const Request& request) {
  const Judged judged = judge(request);
  if (request.json)
    print_as_json(judged, request);
  else
    print(judged, request);
  switch (judged.judgement.standing()) {
    case Standing::kHolds:
      return kDone;
    case Standing::kRefused:
      return kAnswerIsNo;
    case Standing::kCouldNotCheck:
      break;
  }
  return kRefused;
}

}  // namespace

void add_token_evidence_command(Command& token) {
  Command& command =
      token.add_command("evidence", "judges an evidence record (RFC 4998, RFC 6283) over files");
  const auto request = std::make_shared<Request>();
  command.argument("RECORD", request->record, "the record: DER (.ers), or XML");
  command.arguments("FILE", request->files, "the data that it is to prove: all of it, in any order");
  add_root_options(command, request->roots);
  command.option("--policy", "FILE", request->policy,
                 "until when algorithms count; without it those known here count for ever");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "For records that an archive made, over a case's files or over others. A case's own record is judged "
      "with the case by 'kiroku verify'. Of data that is XML a record in XML may cover the canonical form "
      "alone, which is then said: how it is written may be new, and comments. Exit status: 0 holds, 1 "
      "refused, 2 could not be checked or unusable input.");
  command.example("kiroku token evidence handed-over.xml case.tar --trust archive-roots.pem",
                  "since when an archive's record proves what it was given");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
