#include <memory>

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

constexpr std::size_t kBlock = 1U << 20;

struct Request {
  std::vector<std::string> recipients, recipient_files;
  std::optional<std::string> output, input;
  bool passphrase = false, json = false;
};

crypto::AgeRecipients recipients_of(const Request& request) {
  crypto::AgeRecipients recipients;
  if (request.passphrase) {
    if (!request.recipients.empty() || !request.recipient_files.empty()) {
      throw UsageError(
          "a file is sealed either with a passphrase or to recipients: leave out -p, or -r and -R");
    }
    recipients.push_back(crypto::passphrase_recipient(ask_new_passphrase("the sealed file")));
  }
  for (const std::string& text : request.recipients) recipients.push_back(crypto::parse_recipient(text));
  for (const std::string& file : request.recipient_files) {
    for (auto& recipient : load_recipients(file)) recipients.push_back(std::move(recipient));
  }
  if (recipients.empty())
    throw UsageError(
        "nobody could open the result: name a recipient with -r age1..., or a file of them with -R");
  return recipients;
}

int run(const Request& request) {
  if (request.json && (!request.output || *request.output == "-")) {
    throw UsageError(
        "--json and the sealed file cannot both go to standard output: name a file with -o FILE");
  }
  const crypto::AgeRecipients recipients = recipients_of(request);
  InputStream input(request.input.value_or("-"));
  OutputStream output(request.output, input, true);
  std::uint64_t plain_bytes = 0, sealed_bytes = 0;
  crypto::AgeSealer sealer(recipients, [&](ByteView bytes) {
    output.write(bytes);
    sealed_bytes += bytes.size();
  });
  Progress progress("sealing");
  Bytes block(kBlock);
  for (std::size_t got = 0; (got = input.read(block)) > 0;) {
    sealer.write(ByteView(block).first(got));
    plain_bytes += got;
    progress.update(plain_bytes, input.size());
  }
  sealer.finish();
  // People delete the original next: the sealed file must be on the disk.
  output.commit(OutputFile::Durability::kNow);
  if (request.json) {
    print_json({{"file", *request.output}, {"plaintext_bytes", plain_bytes}, {"sealed_bytes", sealed_bytes}});
  }
  return kDone;
}

}  // namespace

void add_seal_command(Command& program) {
  Command& command = program.add_command("seal", "encrypts a file to recipients, as age does");
  const auto request = std::make_shared<Request>();
  command.argument("FILE", request->input, "what to seal; standard input if absent or '-'");
  command.option("-r,--recipient", "KEY", request->recipients, "an age1... recipient");
  command.option("-R,--recipients-file", "FILE", request->recipient_files,
                 "a file with one recipient a line");
  command.flag("-p,--passphrase", request->passphrase,
               "seals with a passphrase instead, asked on the terminal or taken from KIROKU_PASSPHRASE");
  command.option("-o,--output", "FILE", request->output, "where to; standard output if absent or '-'");
  command.flag("--json", request->json, "prints one JSON object when done");
  command.explain("The result is an age v1 file: 'age -d' and 'kiroku unseal' open it.");
  command.example(
      "kiroku seal -r age1ql3z7hjy54pw3hyww5ayyfg7zqgvc7w3j2elw8zmrj2kg5sfn9aqmcac8p -o notes.txt.age "
      "notes.txt",
      "only the holder of that recipient's identity can read notes.txt.age");
  command.example("tar c folder | kiroku seal -R recipients.txt > folder.tar.age",
                  "seals a folder in one pass");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
