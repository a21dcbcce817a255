#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/named_roots.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/token_evidence_command.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "evidence/shared_token.h"
#include "timestamp/token_verifier.h"
#include "timestamp/trusted_list.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;
using timestamp::TokenJudgement;
using timestamp::TokenVerdict;

struct Request {
  std::string token;
  std::optional<std::string> data, digest, policy, home;
  NamedRoots roots;
  std::vector<std::string> untrusted, lists;
  bool json = false;
};

using timestamp::Qualification;
using timestamp::QualifiedService;
using timestamp::TrustedList;

std::vector<TrustedList> read_lists(const std::vector<std::string>& files) {
  std::vector<TrustedList> lists;
  for (const std::string& file : files) {
    const MappedFile xml(file);
    lists.push_back(timestamp::parse_trusted_list(text_of(xml.bytes()), file));
  }
  return lists;
}

bool was_granted(const QualifiedService& service) {
  return std::ranges::any_of(service.history, &timestamp::ServiceStatus::granted);
}

/// Lists are roots, too.
timestamp::TrustStore load_trust(const Request& request, const std::vector<TrustedList>& lists) {
  timestamp::TrustStore trust =
      lists.empty() ? required_trust(request.roots, request.home) : trust_of(request.roots, std::nullopt);
  for (const std::string& file : request.untrusted) trust.add_untrusted_file(file);
  for (const TrustedList& list : lists) {
    for (const QualifiedService& service : list.services) {
      if (!was_granted(service)) continue;
      for (const Bytes& certificate : service.certificates)
        trust.add_trusted(certificate, "a certificate of the trusted list of " + list.territory);
    }
  }
  return trust;
}

/// The hash function the token uses; nothing where the token cannot be read that far (judging says why).
std::optional<crypto::HashAlgorithm> algorithm_of(ByteView token_file) {
  std::string ignored;
  const auto response = timestamp::parse_response(token_file, ignored);
  if (!response || response->token.empty()) return {};
  const auto info = timestamp::parse_token_info(response->token, ignored);
  if (!info) return {};
  return info->algorithm;
}

Bytes digest_of(const std::string& hexadecimal) {
  std::optional<Bytes> digest = crypto::from_hex(hexadecimal);
  if (!digest)
    throw UsageError("--digest is '" + hexadecimal + "', which is no hash in lower-case hexadecimal digits");
  return std::move(*digest);
}

timestamp::Expectation expectation_of(const Request& request, ByteView token) {
  timestamp::Expectation expectation;
  expectation.policy = request.policy;
  if (request.digest) {
    expectation.imprint = digest_of(*request.digest);
    return expectation;
  }
  const MappedFile data(*request.data);
  if (const auto algorithm = algorithm_of(token)) {
    expectation.imprint = crypto::digest(*algorithm, data.bytes());
  } else {
    expectation.data = Bytes();
  }
  return expectation;
}

/// Of a token that many share: it must be over what the path leads to.
timestamp::Expectation expectation_of(const Request& request, const evidence::SharedToken& shared) {
  timestamp::Expectation expectation;
  expectation.policy = request.policy;
  expectation.algorithm = crypto::HashAlgorithm::kSha256;
  const Bytes digest =
      request.digest ? digest_of(*request.digest)
                     : crypto::digest(crypto::HashAlgorithm::kSha256, MappedFile(*request.data).bytes());
  expectation.imprint = shared.imprint_for(digest).value_or(Bytes());
  return expectation;
}

struct JudgedFile {
  TokenJudgement judgement;
  std::optional<std::size_t> steps;  // of the path from the hash to the imprint, where the token is shared
};

JudgedFile judge(const Request& request, ByteView file, const timestamp::TrustStore& trust) {
  if (!evidence::begins_as_record(file))
    return {timestamp::judge_token(file, expectation_of(request, file), trust), {}};
  const evidence::SharedTokenParse parsed = evidence::parse_shared_token(file);
  if (!parsed.shared) {
    TokenJudgement refused;
    refused.explanation = "it is no token that many share: " + parsed.explanation;
    return {std::move(refused), {}};
  }
  return {timestamp::judge_token(parsed.shared->token, expectation_of(request, *parsed.shared), trust),
          parsed.shared->path.size()};
}

std::string verdict_name(TokenVerdict verdict) {
  switch (verdict) {
    case TokenVerdict::kValid:
      return "valid";
    case TokenVerdict::kRefused:
      return "refused";
    case TokenVerdict::kCouldNotCheck:
      break;
  }
  return "could-not-check";
}

ordered_json info_json(const timestamp::TokenInfo& info) {
  return {{"gen_time", format_utc(info.gen_time)},
          {"accuracy_ns", info.accuracy_ns},
          {"serial", info.serial},
          {"policy", info.policy},
          {"algorithm", info.algorithm_name},
          {"imprint", crypto::to_hex(info.imprint)},
          {"nonce", info.nonce ? ordered_json(crypto::to_hex(*info.nonce)) : ordered_json(nullptr)}};
}

std::string answer_name(Qualification::Answer answer) {
  switch (answer) {
    case Qualification::Answer::kQualified:
      return "qualified";
    case Qualification::Answer::kNotQualified:
      return "not-qualified";
    case Qualification::Answer::kUnknown:
      break;
  }
  return "unknown";
}

void print_judgement_json(const JudgedFile& judged, TokenVerdict verdict,
                          const std::optional<Qualification>& qualification) {
  const TokenJudgement& judgement = judged.judgement;
  print_json({{"verdict", verdict_name(verdict)},
              {"code", timestamp::code_name(judgement.code)},
              {"text", judgement.explanation},
              {"signer", judgement.signer_subject},
              {"root", judgement.root_subject},
              {"time", verdict == TokenVerdict::kValid
                           ? ordered_json(timestamp::authority_kind_name(judgement.authority))
                           : ordered_json(nullptr)},
              {"qualification", qualification ? ordered_json{{"answer", answer_name(qualification->answer)},
                                                             {"text", qualification->sentence}}
                                              : ordered_json(nullptr)},
              {"shared", judged.steps ? ordered_json{{"steps", *judged.steps}} : ordered_json(nullptr)},
              {"token", judgement.info ? info_json(*judgement.info) : ordered_json(nullptr)}});
}

void print_judgement(const JudgedFile& judged, TokenVerdict verdict,
                     const std::optional<Qualification>& qualification) {
  const TokenJudgement& judgement = judged.judgement;
  const bool valid = verdict == TokenVerdict::kValid;
  std::cout << (valid                               ? paint(Colour::kGreen, "VALID")
                : verdict == TokenVerdict::kRefused ? paint(Colour::kRed, "REFUSED")
                                                    : paint(Colour::kYellow, "COULD NOT BE CHECKED"))
            << ": " << printable(judgement.explanation) << "\n";
  if (!valid) std::cout << "  code      " << timestamp::code_name(judgement.code) << "\n";
  if (judgement.info) {
    const timestamp::TokenInfo& info = *judgement.info;
    const char* note = valid ? "" : ", as the token says";
    std::cout << "  time      " << format_utc(info.gen_time) << " (" << format_local(info.gen_time) << ")"
              << note << "\n";
    if (info.accuracy_ns > 0) std::cout << "  accuracy  " << double(info.accuracy_ns) / 1e9 << " s\n";
    std::cout << "  serial    " << info.serial << "\n"
              << "  policy    " << printable(info.policy) << "\n"
              << "  imprint   " << printable(info.algorithm_name) << " " << crypto::to_hex(info.imprint)
              << "\n";
  }
  if (judged.steps) {
    std::cout << "  shared    "
              << (*judged.steps == 0 ? std::string("with nobody: the imprint is the hash itself")
                                     : "with others: " + std::to_string(*judged.steps) +
                                           (*judged.steps == 1 ? " step leads" : " steps lead") +
                                           " from the hash to the imprint")
              << "\n";
  }
  if (!judgement.signer_subject.empty())
    std::cout << "  signer    " << printable(judgement.signer_subject) << "\n";
  if (!judgement.root_subject.empty())
    std::cout << "  root      " << printable(judgement.root_subject) << "\n";
  if (valid) {
    const bool outside = judgement.authority == timestamp::TimeAuthority::kOutside;
    std::cout << "  clock     "
              << (outside ? "external: an outside authority's"
                          : "self-issued: the recorder's own, no outside clock stands behind it")
              << "\n";
  }
  if (qualification) {
    const char* answer = qualification->answer == Qualification::Answer::kQualified ? "yes: "
                         : qualification->answer == Qualification::Answer::kNotQualified
                             ? "no: "
                             : "could not be told: ";
    std::cout << "  qualified " << answer << qualification->sentence << "\n";
  }
}

int run(const Request& request) {
  if (request.data.has_value() == request.digest.has_value()) {
    throw UsageError("name what the token is about, with either --data FILE or --digest HEX");
  }
  const Bytes token = read_small_file(request.token, "the token");
  const std::vector<TrustedList> lists = read_lists(request.lists);
  const JudgedFile judged = judge(request, token, load_trust(request, lists));
  const TokenVerdict verdict = timestamp::verdict_of(judged.judgement.code);
  std::optional<Qualification> qualification;
  if (!lists.empty()) qualification = timestamp::judge_qualification(judged.judgement, lists);
  if (request.json) {
    print_judgement_json(judged, verdict, qualification);
  } else {
    print_judgement(judged, verdict, qualification);
  }
  return verdict == TokenVerdict::kValid ? kDone : verdict == TokenVerdict::kRefused ? kAnswerIsNo : kRefused;
}

struct ServicesRequest {
  std::vector<std::string> lists;
  std::optional<std::string> output;
  bool force = false, json = false;
};

std::string pem_of(ByteView der) {
  const std::string text = crypto::to_base64(der, crypto::Base64Padding::kPadded);
  constexpr std::size_t kLine = 64;  // RFC 7468
  std::string pem = "-----BEGIN CERTIFICATE-----\n";
  for (std::size_t at = 0; at < text.size(); at += kLine) pem += text.substr(at, kLine) + "\n";
  return pem + "-----END CERTIFICATE-----\n";
}

int list_services(const ServicesRequest& request) {
  const std::vector<TrustedList> lists = read_lists(request.lists);
  if (request.output && !request.force && std::filesystem::exists(*request.output))
    throw UsageError(*request.output + " is there already: name another file, or give --force to replace it");
  std::string pem;
  ordered_json json = ordered_json::array();
  std::size_t written = 0;
  for (const TrustedList& list : lists) {
    if (!request.json) {
      std::cout << "trusted list of " << list.territory << ", number " << list.sequence << " of "
                << format_utc(list.issued).substr(0, 10)
                << (list.next_update ? ", tells until " + format_utc(*list.next_update).substr(0, 10) : "")
                << "\n";
    }
    for (const QualifiedService& service : list.services) {
      const timestamp::ServiceStatus& now = service.history.front();
      if (request.json) {
        json.push_back({{"territory", list.territory},
                        {"provider", service.provider},
                        {"service", service.name},
                        {"status", now.name},
                        {"since", format_utc(now.since)},
                        {"certificates", service.certificates.size()}});
      } else {
        std::cout << "  " << now.name << " since " << format_utc(now.since).substr(0, 10) << "  "
                  << service.provider << ": " << service.name << "\n";
      }
      if (!was_granted(service)) continue;
      for (const Bytes& certificate : service.certificates) {
        pem += pem_of(certificate);
        ++written;
      }
    }
  }
  if (request.output) {
    OutputFile file(*request.output);
    file.write(bytes_of(pem));
    file.commit(OutputFile::Durability::kEventually);
  }
  if (request.json) {
    print_json(json);
  } else if (request.output) {
    std::cout << "certificates of services that are or were granted, in " << printable(*request.output)
              << ": " << written << "\n";
  }
  return kDone;
}

void add_services_command(Command& token) {
  Command& command =
      token.add_command("services", "lists the qualified time-stamping services of EU trusted lists");
  const auto request = std::make_shared<ServicesRequest>();
  command.arguments("LIST", request->lists, "trusted lists of member states, XML (ETSI TS 119 612)");
  command.option(
      "-o,--output", "PEM", request->output,
      "writes the certificates of services that are or were granted, for --trust of 'kiroku verify'");
  command.flag("--force", request->force, "replaces a file that is there");
  command.flag("--json", request->json, "prints one JSON array instead");
  command.explain(
      "The lists' own signatures are not verified: get them from their publishers, whom the European "
      "Commission's "
      "list of lists names.");
  command.example("kiroku token services AT.xml SK.xml -o qualified.pem",
                  "what two member states list; then: kiroku verify CASE --trust qualified.pem");
  command.on_run([request] { return list_services(*request); });
}

}  // namespace

void add_token_command(Command& program) {
  Command& token = program.add_command("token", "judges RFC 3161 time-stamps and evidence records");
  add_services_command(token);
  add_token_evidence_command(token);
  Command& command = token.add_command("verify", "judges one time-stamp token or response");
  const auto request = std::make_shared<Request>();
  command.argument("TOKEN", request->token,
                   "the token or response file (.tsr), or a shared token (.ers), DER");
  command.option("--data", "FILE", request->data, "the file that was time-stamped");
  command.option("--digest", "HEX", request->digest,
                 "its hash instead, by the token's hash function; SHA-256 of a shared token");
  add_root_options(command, request->roots);
  command.option("--untrusted", "PEM", request->untrusted, "certificates that help to build a chain");
  command.option(
      "--trusted-list", "XML", request->lists,
      "EU trusted list of a member state: its qualified time-stamping services are trusted, too, and it is "
      "said whether the token was a qualified one at its time");
  command.option("--policy", "OID", request->policy, "the policy the token must carry, such as 1.2.3.4");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Exit status: 0 valid, 1 refused, 2 could not be checked (no root fits) or unusable input.");
  command.example(
      "kiroku token verify CASE/tokens/00000001.embedded.tsr --data CASE/checkpoints/00000001.note "
      "--own-authority own-authority.pem",
      "judges the time-stamp over a case's first checkpoint");
  command.example(
      "kiroku token verify CASE/tokens/00000132.swiss.ers --data CASE/checkpoints/00000132.note --trust "
      "swiss.pem",
      "judges one that many rooms share");
  command.example("kiroku token verify 00000132.swiss.tsr --data 00000132.note --trusted-list AT.xml",
                  "whether it is a qualified electronic time stamp by Austria's list");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
