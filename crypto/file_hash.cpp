#include "crypto/file_hash.h"

#include <cerrno>
#include <fstream>

#include "base/bytes.h"
#include "base/error.h"

namespace kiroku::crypto {

FileHash hash_file(const std::filesystem::path& file) {
  std::error_code unknown;
  if (std::filesystem::is_directory(file, unknown)) throw IoError("read", file, EISDIR);
  if (std::filesystem::exists(file, unknown) && !std::filesystem::is_regular_file(file, unknown))
    throw Error("cannot read " + file.string() + ": it is a pipe, a socket or a device and no file");
  errno = 0;
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoError("read", file, errno == 0 ? ENOENT : errno);
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  FileHash found;
  Sha256 hash;
  Bytes piece(kPiece);
  while (in) {
    in.read(reinterpret_cast<char*>(piece.data()), static_cast<std::streamsize>(piece.size()));
    const auto read = static_cast<std::size_t>(in.gcount());
    hash.update(ByteView(piece).first(read));
    found.bytes += read;
  }
  if (in.bad()) throw IoError("read", file, EIO);
  found.sha256 = hash.finish();
  return found;
}

}  // namespace kiroku::crypto
