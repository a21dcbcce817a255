#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;
using timestamp::TokenJudgement;
using timestamp::TokenVerdict;

struct Request {
  std::string token;
  std::optional<std::string> data, digest, policy, home;
  std::vector<std::string> trust, own_authority, untrusted;
  bool json = false;
};

timestamp::TrustStore load_trust(const Request& request) {
  timestamp::TrustStore trust;
  if (request.trust.empty() && request.own_authority.empty()) {
    const std::optional<Home> home = Home::find(request.home);
    if (!home) throw UsageError("no trusted root is known: name the authority's with --trust PEM");
    trust = home->trust();
  }
  for (const std::string& file : request.trust) trust.add_trusted_file(file);
  for (const std::string& file : request.own_authority) trust.add_own_authority_file(file);
  for (const std::string& file : request.untrusted) trust.add_untrusted_file(file);
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

timestamp::Expectation expectation_of(const Request& request, ByteView token) {
  timestamp::Expectation expectation;
  expectation.policy = request.policy;
  if (request.digest) {
    expectation.imprint = crypto::from_hex(*request.digest);
    if (!expectation.imprint) {
      throw UsageError("--digest is '" + *request.digest +
                       "', which is no hash in lower-case hexadecimal digits");
    }
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

/// "external" or "self-issued", of a valid token.
std::string time_name(const TokenJudgement& judgement) {
  const bool outside = judgement.authority == timestamp::TimeAuthority::kOutside;
  return std::string(
      archive::time_proof_name(outside ? archive::TimeProof::kExternal : archive::TimeProof::kSelfIssued));
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

void print_judgement_json(const TokenJudgement& judgement, TokenVerdict verdict) {
  print_json(
      {{"verdict", verdict_name(verdict)},
       {"code", timestamp::code_name(judgement.code)},
       {"text", judgement.explanation},
       {"signer", judgement.signer_subject},
       {"root", judgement.root_subject},
       {"time", verdict == TokenVerdict::kValid ? ordered_json(time_name(judgement)) : ordered_json(nullptr)},
       {"token", judgement.info ? info_json(*judgement.info) : ordered_json(nullptr)}});
}

void print_judgement(const TokenJudgement& judgement, TokenVerdict verdict) {
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
}

int run(const Request& request) {
  if (request.data.has_value() == request.digest.has_value()) {
    throw UsageError("name what the token is about, with either --data FILE or --digest HEX");
  }
  const Bytes token = read_small_file(request.token, "the token");
  const TokenJudgement judgement =
      timestamp::judge_token(token, expectation_of(request, token), load_trust(request));
  const TokenVerdict verdict = timestamp::verdict_of(judgement.code);
  if (request.json) {
    print_judgement_json(judgement, verdict);
  } else {
    print_judgement(judgement, verdict);
  }
  return verdict == TokenVerdict::kValid ? kDone : verdict == TokenVerdict::kRefused ? kAnswerIsNo : kRefused;
}

}  // namespace

void add_token_command(Command& program) {
  Command& token = program.add_command("token", "judges RFC 3161 time-stamps");
  Command& command = token.add_command("verify", "judges one time-stamp token or response");
  const auto request = std::make_shared<Request>();
  command.argument("TOKEN", request->token, "the token or response file (.tsr), DER");
  command.option("--data", "FILE", request->data, "the file that was time-stamped");
  command.option("--digest", "HEX", request->digest, "its hash instead, by the token's hash function");
  command.option("--trust", "PEM", request->trust,
                 "roots of outside authorities that are trusted; instead of the home's");
  command.option("--own-authority", "PEM", request->own_authority,
                 "roots of the recorder's own authority, whose time is self-issued; instead of the home's");
  command.option("--untrusted", "PEM", request->untrusted, "certificates that help to build a chain");
  command.option("--policy", "OID", request->policy, "the policy the token must carry, such as 1.2.3.4");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Exit status: 0 valid, 1 refused, 2 could not be checked (no root fits) or unusable input.");
  command.example(
      "kiroku token verify CASE/tokens/00000001.embedded.tsr --data CASE/checkpoints/00000001.note "
      "--own-authority own-authority.pem",
      "judges the time-stamp over a case's first checkpoint");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
