#include <algorithm>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/streams.h"
#include "base/error.h"
#include "crypto/age_file.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::vector<std::string> identities;
  std::optional<std::string> output, input;
  bool passphrase = false, keep_truncated = false, json = false;
};

/// A file sealed with a passphrase says so in its first lines.
bool is_passphrase_sealed(InputStream& input) {
  constexpr std::string_view kBeginning = "age-encryption.org/v1\n-> scrypt ";
  return text_of(input.peek(kBeginning.size())) == kBeginning;
}

crypto::AgeIdentities identities_for(const Request& request, InputStream& input) {
  const bool by_passphrase = is_passphrase_sealed(input);
  if (request.passphrase && !request.identities.empty()) {
    throw UsageError("a file opens either with a passphrase or with an identity: leave out -p or -i");
  }
  if (request.identities.empty() && (request.passphrase || by_passphrase)) {
    return {crypto::passphrase_identity(ask_passphrase(input.file().string()))};
  }
  return load_identities(request.identities, {});
}

struct Unsealed {
  std::uint64_t bytes = 0;
  bool whole = true;
};

/// By offset, with several threads.
Unsealed unseal_file(const InputStream& input, const crypto::AgeIdentities& identities, bool keep_truncated,
                     OutputStream& output) {
  const auto source = crypto::open_file_source(input.file());
  const auto truncation = keep_truncated ? crypto::Truncation::kTolerate : crypto::Truncation::kRefuse;
  const crypto::AgeFile file = crypto::AgeFile::open(*source, identities, truncation);
  Progress progress("unsealing");
  const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  Unsealed unsealed{0, !file.is_truncated()};
  const auto proceed = [&](std::uint64_t done) {
    unsealed.bytes = done;
    progress.update(done, file.plaintext_size());
  };
  if (output.descriptor() >= 0) {
    file.write_to(output.descriptor(), output.name(), proceed, threads);
  } else {
    file.read_all(
        [&](ByteView plaintext) {
          output.write(plaintext);
          proceed(unsealed.bytes + plaintext.size());
        },
        threads);
  }
  return unsealed;
}

Unsealed unseal_pipe(InputStream& input, const crypto::AgeIdentities& identities, OutputStream& output) {
  Unsealed unsealed;
  crypto::unseal_stream([&](std::span<std::byte> into) { return input.read(into); }, identities,
                        [&](ByteView plaintext) {
                          output.write(plaintext);
                          unsealed.bytes += plaintext.size();
                        });
  return unsealed;
}

int run(const Request& request) {
  if (request.json && (!request.output || *request.output == "-")) {
    throw UsageError(
        "--json and the opened file cannot both go to standard output: name a file with -o FILE");
  }
  InputStream input(request.input.value_or("-"));
  if (request.keep_truncated && !input.is_regular_file()) {
    throw UsageError("--keep-truncated needs a file to read from, not a pipe: name it");
  }
  const crypto::AgeIdentities identities = identities_for(request, input);
  OutputStream output(request.output, input, false);
  Unsealed unsealed;
  try {
    unsealed = input.is_regular_file() ? unseal_file(input, identities, request.keep_truncated, output)
                                       : unseal_pipe(input, identities, output);
  } catch (const crypto::AgeError& error) {
    throw Error("cannot open " + input.file().string() + ": " + error.what());
  }
  // The sealed file is still there: no need to wait for the disk.
  output.commit(OutputFile::Durability::kEventually);
  if (request.json)
    print_json({{"file", *request.output}, {"bytes", unsealed.bytes}, {"whole", unsealed.whole}});
  if (unsealed.whole) return kDone;
  print_error("kiroku", input.file().string() + " ends early: its first " + std::to_string(unsealed.bytes) +
                            " bytes were opened, the rest is missing");
  return kAnswerIsNo;
}

}  // namespace

void add_unseal_command(Command& program) {
  Command& command = program.add_command("unseal", "decrypts a file with an identity, as age -d does");
  const auto request = std::make_shared<Request>();
  command.argument("FILE", request->input, "what to open; standard input if absent or '-'");
  command.option("-i,--identity", "FILE", request->identities,
                 "identity file, as age-keygen or 'kiroku init' writes it");
  command.flag("-p,--passphrase", request->passphrase,
               "the file was sealed with a passphrase (usually noticed by itself)");
  command.option("-o,--output", "FILE", request->output, "where to; standard output if absent or '-'");
  command.flag("--keep-truncated", request->keep_truncated,
               "opens what is there of a file that ends early, and exits with 1");
  command.flag("--json", request->json, "prints one JSON object when done");
  command.explain(
      "A file named with -o appears only if all of the sealed file is genuine. Passphrases are asked on the "
      "terminal or taken from KIROKU_PASSPHRASE.");
  command.example("kiroku unseal -i identity.txt -o notes.txt notes.txt.age", "opens one file");
  command.example("kiroku unseal -i identity.txt CASE/segments/endoscope/00000000.ts.age | ffplay -",
                  "plays one segment of a case");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
