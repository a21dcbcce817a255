#include "viewer/kept/provenance.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "archive/format/case_folder.h"
#include "archive/format/line_reader.h"
#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "base/json_or_null.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"

namespace kiroku::compare {
namespace {

constexpr const char* kLedgerFile = "ledger.jsonl";

/// Over the whole lines of the ledger, `size` at most.
crypto::MerkleFrontier tree_of(const std::filesystem::path& case_folder, std::uint64_t size) {
  const archive::FileOpening opening = archive::CaseFolder::open(case_folder).open_file(kLedgerFile);
  if (!opening.file)
    throw Error("cannot read " + (case_folder / kLedgerFile).string() + ": it " + opening.explanation);
  archive::LineReader reader(*opening.file);
  crypto::MerkleFrontier tree;
  archive::LedgerLine line;
  while (tree.size() < size && reader.next(line) && !line.torn && !line.too_long)
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  return tree;
}

crypto::Sha256Digest digest_of(const nlohmann::json& value) {
  crypto::Sha256Digest digest{};
  const auto bytes = crypto::from_hex(value.get<std::string>());
  if (!bytes || bytes->size() != digest.size()) throw Error("a hash of it is none");
  std::ranges::copy(*bytes, digest.begin());
  return digest;
}

std::vector<NamedFile> files_of(const nlohmann::json& list) {
  std::vector<NamedFile> files;
  for (const nlohmann::json& entry : list) {
    NamedFile& file = files.emplace_back();
    entry.at("role").get_to(file.role);
    entry.at("name").get_to(file.name);
    entry.at("bytes").get_to(file.bytes);
    file.sha256 = digest_of(entry.at("sha256"));
  }
  return files;
}

Provenance provenance_of(const nlohmann::json& document) {
  if (document.at("format") != kComparisonFormat) throw Error("its format is another");
  Provenance made;
  document.at("made_by").get_to(made.made_by);
  const auto made_at = parse_utc(document.at("made_at").get<std::string>());
  if (!made_at) throw Error("it does not say when it was made");
  made.made_at = *made_at;
  document.at("program").get_to(made.program);
  const nlohmann::json& of_case = document.at("case");
  of_case.at("id").get_to(made.case_state.case_id);
  of_case.at("ledger").at("size").get_to(made.case_state.ledger_size);
  made.case_state.ledger_root = digest_of(of_case.at("ledger").at("root"));
  const nlohmann::json& plan = document.at("plan");
  plan.at("name").get_to(made.plan);
  made.plan_seal = digest_of(plan.at("seal"));
  plan.at("sealed").get_to(made.plan_sealed);
  made.plan_files = files_of(plan.at("files"));
  if (!of_case.at("names_plan").is_null()) made.case_names_plan = of_case.at("names_plan").get<bool>();
  made.outputs = files_of(document.at("outputs"));
  // Documents of earlier versions have neither.
  if (const auto ct = document.find("ct"); ct != document.end() && ct->is_object()) {
    made.ct.emplace();
    ct->at("of_plan").get_to(made.ct->of_plan);
    if (const auto series = ct->find("series"); series != ct->end()) series->get_to(made.ct->series);
    made.ct->files = files_of(ct->at("files"));
  }
  if (const auto same = document.find("one_patient"); same != document.end() && !same->is_null())
    made.of_one_patient = same->get<bool>();
  return made;
}

nlohmann::ordered_json ct_json(const std::optional<ComparedCt>& ct) {
  if (!ct) return nullptr;
  nlohmann::ordered_json one{{"of_plan", ct->of_plan}};
  if (!ct->series.empty()) one["series"] = ct->series;
  one["files"] = files_json(ct->files);
  return one;
}

}  // namespace

std::vector<std::string> cautions_of(const Provenance& made) {
  std::vector<std::string> cautions;
  if (made.case_names_plan == false)
    cautions.emplace_back("The case was recorded by another plan than the one shown");
  if (made.of_one_patient == false)
    cautions.emplace_back("The CT states another patient's number than the case");
  if (made.ct && !made.ct->of_plan) {
    const std::string name = made.ct->files.empty() ? "" : made.ct->files.front().name;
    cautions.push_back("The CT shown is not part of the plan: " + name.substr(0, name.find('/')));
  }
  return cautions;
}

CaseState state_of(const std::filesystem::path& case_folder) {
  const crypto::MerkleFrontier tree = tree_of(case_folder, UINT64_MAX);
  return {archive::CaseReader::open(case_folder).opening().case_id, tree.size(), tree.root()};
}

std::optional<crypto::Sha256Digest> root_of_first(const std::filesystem::path& case_folder,
                                                  std::uint64_t size) {
  const crypto::MerkleFrontier tree = tree_of(case_folder, size);
  if (tree.size() != size) return {};
  return tree.root();
}

nlohmann::ordered_json file_json(const NamedFile& file) {
  return {{"role", file.role},
          {"name", file.name},
          {"bytes", file.bytes},
          {"sha256", crypto::to_hex(file.sha256)}};
}

nlohmann::ordered_json files_json(const std::vector<NamedFile>& files) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const NamedFile& file : files) all.push_back(file_json(file));
  return all;
}

nlohmann::ordered_json provenance_json(const Provenance& made, const std::string& stream) {
  nlohmann::ordered_json document{{"format", kComparisonFormat},
                                  {"made_by", made.made_by},
                                  {"made_at", format_utc(made.made_at)},
                                  {"program", made.program}};
  document["case"] = {
      {"id", made.case_state.case_id},
      {"ledger",
       {{"size", made.case_state.ledger_size}, {"root", crypto::to_hex(made.case_state.ledger_root)}}},
      {"stream", stream},
      {"names_plan", or_null(made.case_names_plan)},
      {"verified", false}};  // whoever compares takes segments by their hashes, and asks for no signature
  document["plan"] = {{"name", made.plan},
                      {"seal", crypto::to_hex(made.plan_seal)},
                      {"sealed", made.plan_sealed},
                      {"files", files_json(made.plan_files)}};
  document["ct"] = ct_json(made.ct);
  document["one_patient"] = or_null(made.of_one_patient);
  return document;
}

std::string document_text(const nlohmann::ordered_json& document) {
  return document.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

Provenance read_provenance(std::string_view text, const std::string& name) {
  const auto refuse = [&](const std::string& why) {
    return UsageError(name + " is no comparison: " + why + "; make one with kiroku compare");
  };
  try {
    // An hour of alignment is half a million numbers, of which nothing is asked here: they are read over, and
    // take no memory.
    const auto kept = [](int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
      return !(depth == 1 && event == nlohmann::json::parse_event_t::key && parsed == "organ_alignment");
    };
    return provenance_of(nlohmann::json::parse(text, kept));
  } catch (const nlohmann::json::exception&) {
    throw refuse("it is no JSON of that kind");
  } catch (const Error& error) {
    throw refuse(error.what());
  }
}

}  // namespace kiroku::compare
