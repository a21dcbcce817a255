// 'kiroku-fleet search-key': the keys by which a site finds cases by patient or procedure.
#include <cerrno>
#include <fcntl.h>
#include <iostream>
#include <memory>
#include <unistd.h>

#include "apps/fleet/commands.h"
#include "archive/search/search_key.h"
#include "archive/storage/file_system.h"
#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  std::string output;
  std::optional<std::string> from, appliance;
};

/// For its owner alone, and never in the place of another one: cases would not be found any more.
void write_new(const fs::path& file, const crypto::Secret& text) {
  const Descriptor written(::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!written && errno == EEXIST)
    throw UsageError(file.string() + " is there already and is not overwritten: name another file");
  if (!written) throw IoError("write", file, errno);
  const ssize_t count = ::write(written.number(), text.bytes().data(), text.size());
  if (count != static_cast<ssize_t>(text.size()) || ::fsync(written.number()) != 0) {
    const int error = count >= 0 && count != static_cast<ssize_t>(text.size()) ? ENOSPC : errno;
    ::unlink(file.c_str());
    throw IoError("write", file, error);
  }
  archive::real_file_system().sync_folder(file.has_parent_path() ? file.parent_path() : ".");
}

int run(const Request& request) {
  if (request.from.has_value() != request.appliance.has_value())
    throw UsageError("an appliance's key takes both: --from FILE, the site's key, and --appliance NAME");
  if (!request.from) {
    write_new(request.output, search::SiteKey::make().text());
    std::cout << "The site's search key is in " << printable(request.output)
              << ". Keep it with who searches, and a copy where neither the store nor the catalogue's server "
                 "can read it: without it nothing is found.\n"
                 "Next: 'kiroku-fleet search-key --from "
              << printable(request.output) << " --appliance NAME -o FILE' for each appliance that opts in.\n";
    return kDone;
  }
  write_new(request.output, search::SiteKey::read(*request.from).key_for(*request.appliance).text());
  std::cout << "The search key of " << printable(*request.appliance) << " is in " << printable(request.output)
            << ". Move it into that appliance's home, where its user alone may read and write it, name it in "
               "[search] of kiroku.toml, and keep no copy: it tells of the cases that follow it.\n";
  return kDone;
}

}  // namespace

void add_fleet_search_key_command(Command& program) {
  Command& command =
      program.add_command("search-key", "makes the keys by which cases are found by patient or procedure");
  const auto request = std::make_shared<Request>();
  command.required_option("-o,--output", "FILE", request->output, "where the key goes: a new file, mode 600");
  command.option("--from", "FILE", request->from, "the site's key, of which an appliance's is made");
  command.option("--appliance", "NAME", request->appliance, "whose key it is: the name by which it ships");
  command.explain(
      "Without --from it makes a site's key, which stays with who searches. An appliance's key is made of "
      "it, "
      "goes into the appliance's home, and changes with every case, so that a stolen appliance tells nothing "
      "of the cases before. Each call makes another one; all of a site are found by the site's key.");
  command.example("kiroku-fleet search-key -o site-search.key", "the site's key, once");
  command.example("kiroku-fleet search-key --from site-search.key --appliance or-1 -o or-1-search.key",
                  "a key for the appliance or-1");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
