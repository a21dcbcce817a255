#include "viewer/http/static_files.h"

#include <algorithm>
#include <array>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "viewer/http/http_fields.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kIndex = "index.html";
/// Where Vite puts what has a hash in its name.
constexpr std::string_view kHashedFolder = "assets/";

constexpr std::array<std::pair<std::string_view, std::string_view>, 15> kTypes{
    {{".html", "text/html; charset=utf-8"},
     {".js", "text/javascript; charset=utf-8"},
     {".css", "text/css; charset=utf-8"},
     {".json", "application/json"},
     {".map", "application/json"},
     {".webmanifest", "application/manifest+json"},
     {".svg", "image/svg+xml"},
     {".png", "image/png"},
     {".jpg", "image/jpeg"},
     {".webp", "image/webp"},
     {".ico", "image/x-icon"},
     {".woff2", "font/woff2"},
     {".wasm", "application/wasm"},
     {".pdf", "application/pdf"},
     {".txt", "text/plain; charset=utf-8"}}};

std::string_view type_of(std::string_view name) {
  const std::string extension = fs::path(name).extension().string();
  const auto* const known =
      std::ranges::find(kTypes, extension, &std::pair<std::string_view, std::string_view>::first);
  return known == kTypes.end() ? "application/octet-stream" : known->second;
}

std::shared_ptr<const Bytes> read_file(const fs::path& file) {
  const Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat status {};
  if (!descriptor || ::fstat(descriptor.number(), &status) != 0) throw IoError("read", file, errno);
  Bytes bytes(static_cast<std::size_t>(status.st_size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::read(descriptor.number(), bytes.data() + done, bytes.size() - done);
    if (count < 0) throw IoError("read", file, errno);
    if (count == 0) throw Error(file.string() + " became shorter while it was read; try again");
    done += static_cast<std::size_t>(count);
  }
  return std::make_shared<const Bytes>(std::move(bytes));
}

bool is_hidden(const fs::path& relative) {
  return std::ranges::any_of(relative, [](const fs::path& part) { return part.string().starts_with('.'); });
}

}  // namespace

StaticFiles StaticFiles::load(const fs::path& folder) {
  StaticFiles out;
  std::error_code failed;
  for (fs::recursive_directory_iterator each(folder, failed), end; !failed && each != end;
       each.increment(failed)) {
    const fs::path relative = each->path().lexically_relative(folder);
    if (is_hidden(relative) || !fs::is_regular_file(each->symlink_status())) continue;
    std::string name = relative.generic_string();
    auto bytes = read_file(each->path());
    if (name.ends_with(".gz")) {
      out.files_[name.substr(0, name.size() - 3)].gzip = std::move(bytes);
    } else if (name.ends_with(".br")) {
      out.files_[name.substr(0, name.size() - 3)].brotli = std::move(bytes);
    } else {
      File& file = out.files_[name];
      file.type = type_of(name);
      file.entity_tag = "\"" + crypto::to_hex(crypto::sha256(*bytes)).substr(0, 32) + "\"";
      file.never_changes = name.starts_with(kHashedFolder);
      file.plain = std::move(bytes);
    }
  }
  std::erase_if(out.files_, [](const auto& each) { return each.second.plain == nullptr; });
  if (!out.files_.contains(kIndex)) {
    throw UsageError("there is no page in " + folder.string() +
                     " (no index.html): build it, or name its folder with --web DIR");
  }
  return out;
}

Response StaticFiles::respond(const Request& request) const {
  const std::optional<Target> target = parse_target(request.target);
  std::string name;
  for (const std::string& segment : target->segments) name += (name.empty() ? "" : "/") + segment;
  auto found = files_.find(name);
  if (found == files_.end() && name.find('.') == std::string::npos) found = files_.find(kIndex);
  if (found == files_.end()) {
    return Response::error(404, files_.empty() ? "this server has no page, only the addresses below /api"
                                               : "there is nothing at this address");
  }
  const File& file = found->second;
  const std::string_view accepted = request.header("accept-encoding");
  std::string_view coding;
  std::shared_ptr<const Bytes> bytes = file.plain;
  if (file.brotli && accepts_encoding(accepted, "br")) {
    bytes = file.brotli;
    coding = "br";
  } else if (file.gzip && accepts_encoding(accepted, "gzip")) {
    bytes = file.gzip;
    coding = "gzip";
  }
  Response out = Response::bytes(std::move(bytes), file.type).with("Vary", "Accept-Encoding");
  out.entity_tag = file.entity_tag;
  if (!coding.empty()) {
    // Another representation, so another strong tag (RFC 9110 section 8.8.3.3).
    out.entity_tag.insert(out.entity_tag.size() - 1, "-" + std::string(coding));
    out.headers.emplace_back("Content-Encoding", coding);
  }
  out.cache = file.never_changes ? "public, max-age=31536000, immutable" : "no-cache";
  return out;
}

}  // namespace kiroku::viewer
