// The page's files, read into memory once: what is served is what lay in the folder, and no address can reach
// anything else. Immutable; thread-safe.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "viewer/http/request.h"
#include "viewer/http/response.h"

namespace kiroku::viewer {

class StaticFiles {
 public:
  /// Every regular file below `folder`; links and names that begin with a dot are left out. FILE.br and
  /// FILE.gz are FILE compressed, for who accepts that. Throws kiroku::UsageError where there is no
  /// index.html, kiroku::IoError for what cannot be read.
  static StaticFiles load(const std::filesystem::path& folder);
  /// Of a server without a page: every address is answered with 404 and a sentence.
  StaticFiles() = default;

  /// A path without an extension that names no file is an address of the page itself and gets index.html.
  [[nodiscard]] Response respond(const Request& request) const;

 private:
  struct File {
    std::shared_ptr<const Bytes> plain, gzip, brotli;  // null: not there
    std::string type, entity_tag;
    bool never_changes = false;  // its name has its content's hash in it
  };
  std::map<std::string, File, std::less<>> files_;  // "assets/index-3f9c21ab.js"
};

}  // namespace kiroku::viewer
