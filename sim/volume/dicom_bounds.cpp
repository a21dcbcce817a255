#include "sim/volume/dicom_bounds.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>
#include <zlib.h>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr std::uint32_t kUndefined = 0xFFFFFFFF;
constexpr std::uint32_t kItem = 0xFFFEE000, kItemEnd = 0xFFFEE00D, kSequenceEnd = 0xFFFEE0DD;
constexpr std::size_t kChunk = std::size_t{1} << 20U;

/// Bytes of a file, or inflated ones.
class Content {
 public:
  virtual ~Content() = default;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// As many as there are, at most `length`.
  virtual std::size_t read(std::uint64_t at, unsigned char* into, std::size_t length) const = 0;
};

class FileContent : public Content {
 public:
  explicit FileContent(const std::filesystem::path& file)
      : name_(file), opened_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
    struct stat state {};
    if (!opened_ || ::fstat(opened_.number(), &state) != 0) throw IoError("read", file, errno);
    size_ = static_cast<std::uint64_t>(std::max<off_t>(state.st_size, 0));
  }
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  std::size_t read(std::uint64_t at, unsigned char* into, std::size_t length) const override {
    std::size_t done = 0;
    while (done < length) {
      const ssize_t count =
          ::pread(opened_.number(), into + done, length - done, static_cast<off_t>(at + done));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) throw IoError("read", name_, errno);
      if (count == 0) break;
      done += static_cast<std::size_t>(count);
    }
    return done;
  }

 private:
  const std::filesystem::path name_;
  const Descriptor opened_;
  std::uint64_t size_ = 0;
};

class MemoryContent : public Content {
 public:
  explicit MemoryContent(std::vector<unsigned char> bytes) : bytes_(std::move(bytes)) {}
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  std::size_t read(std::uint64_t at, unsigned char* into, std::size_t length) const override {
    if (at >= bytes_.size()) return 0;
    const std::size_t count = std::min<std::size_t>(length, bytes_.size() - static_cast<std::size_t>(at));
    std::memcpy(into, bytes_.data() + at, count);
    return count;
  }

 private:
  const std::vector<unsigned char> bytes_;
};

std::uint32_t number16(const unsigned char* at) { return at[0] + 256U * at[1]; }
std::uint32_t number32(const unsigned char* at) { return number16(at) + 65536U * number16(at + 2); }
std::uint32_t tag_at(const unsigned char* at) { return number16(at) << 16U | number16(at + 2); }

/// Value representations with a length of four bytes behind two that are reserved (PS3.5 7.1.2).
bool has_long_length(std::string_view vr) {
  constexpr std::array<std::string_view, 13> kLong{"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                   "SV", "UC", "UN", "UR", "UT", "UV"};
  return std::ranges::find(kLong, vr) != kLong.end();
}
bool is_representation(std::string_view vr) {
  constexpr std::array<std::string_view, 21> kShort{"AE", "AS", "AT", "CS", "DA", "DS", "DT",
                                                    "FD", "FL", "IS", "LO", "LT", "PN", "SH",
                                                    "SL", "SS", "ST", "TM", "UI", "UL", "US"};
  return has_long_length(vr) || std::ranges::find(kShort, vr) != kShort.end();
}

struct Element {
  std::uint32_t tag = 0, length = 0;
  std::string vr;           // "" of an item, a delimiter, and where none is written
  std::uint64_t value = 0;  // where it begins
};

/// Nothing at the end, and where what stands there is no element.
std::optional<Element> element_at(const Content& content, std::uint64_t at, bool explicit_vr) {
  std::array<unsigned char, 12> head{};
  const std::size_t got = content.read(at, head.data(), head.size());
  if (got < 8) return std::nullopt;
  Element element{tag_at(head.data()), number32(head.data() + 4), "", at + 8};
  if (!explicit_vr || element.tag >> 16U == 0xFFFE) return element;
  element.vr = {static_cast<char>(head[4]), static_cast<char>(head[5])};
  if (!is_representation(element.vr)) return std::nullopt;
  if (!has_long_length(element.vr)) {
    element.length = number16(head.data() + 6);
    return element;
  }
  if (got < head.size()) return std::nullopt;
  element.length = number32(head.data() + 8);
  element.value = at + 12;
  return element;
}

struct Meta {
  std::uint64_t end = 132;
  std::string syntax;
  /// Whether nobody can read it otherwise: one transfer syntax, and an end where its stated length has it.
  bool is_sound = false;
};
Meta meta_of(const Content& content) {
  Meta meta;
  constexpr std::uint32_t kGroupLength = 0x00020000, kTransferSyntax = 0x00020010, kLongestUid = 64;
  std::optional<std::uint64_t> stated_end;
  std::size_t syntaxes = 0, lengths = 0;
  for (;;) {
    const auto element = element_at(content, meta.end, true);
    if (!element || element->tag >> 16U != 2 || element->length == kUndefined) break;
    if (element->tag == kGroupLength && ++lengths == 1 && element->length == 4) {
      std::array<unsigned char, 4> length{};
      if (content.read(element->value, length.data(), length.size()) == length.size())
        stated_end = element->value + length.size() + number32(length.data());
    }
    if (element->tag == kTransferSyntax && ++syntaxes == 1 && element->length <= kLongestUid) {
      std::array<char, kLongestUid> text{};
      const std::size_t got =
          content.read(element->value, reinterpret_cast<unsigned char*>(text.data()), element->length);
      meta.syntax.assign(text.data(), got);
      meta.syntax.erase(meta.syntax.find_last_not_of(std::string_view("\0 ", 2)) + 1);
    }
    meta.end = element->value + element->length;
  }
  meta.is_sound = syntaxes == 1 && lengths == 1 && stated_end == meta.end && !meta.syntax.empty();
  return meta;
}

// Explicit VR little endian, and JPIP's referenced pictures, deflated.
constexpr std::array<std::string_view, 3> kDeflated{"1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.4.95",
                                                    "1.2.840.10008.1.2.4.205"};

bool is_deflated(const std::string& syntax) {
  return std::ranges::find(kDeflated, syntax) != kDeflated.end();
}

/// Whether the name of a deflated encoding stands anywhere.
bool names_deflated(const Content& content) {
  constexpr std::size_t kLongest = 23;
  std::vector<char> chunk(kChunk + kLongest);
  for (std::uint64_t at = 0; at < content.size(); at += kChunk) {
    const std::size_t got = content.read(at, reinterpret_cast<unsigned char*>(chunk.data()), chunk.size());
    const std::string_view text(chunk.data(), got);
    if (std::ranges::any_of(kDeflated, [&](auto name) { return text.find(name) != std::string_view::npos; }))
      return true;
  }
  return false;
}

/// Items that begin in [begin, end), in either order of bytes: at least as many as lie within each other. In
/// a picture's own bytes such four stand once in gigabytes by chance.
std::size_t items_in(const Content& content, std::uint64_t begin, std::uint64_t end) {
  constexpr std::array<unsigned char, 4> kLittle{0xFE, 0xFF, 0x00, 0xE0}, kBig{0xFF, 0xFE, 0xE0, 0x00};
  std::vector<unsigned char> chunk(static_cast<std::size_t>(std::min<std::uint64_t>(kChunk, end - begin)) +
                                   kLittle.size() - 1);
  std::size_t items = 0;
  for (std::uint64_t at = begin; at < end && items <= kMostUnaskedItems; at += kChunk) {
    const std::size_t wanted = static_cast<std::size_t>(std::min<std::uint64_t>(chunk.size(), end - at));
    const std::size_t got = content.read(at, chunk.data(), wanted);
    for (const auto& pattern : {kLittle, kBig}) {
      const unsigned char *from = chunk.data(), *const last = from + got;
      while (const void* const found =
                 ::memmem(from, static_cast<std::size_t>(last - from), pattern.data(), pattern.size())) {
        ++items;
        from = static_cast<const unsigned char*>(found) + 1;
      }
    }
  }
  return items;
}

/// Follows sequences without recursion. What might be one counts as one, so that none lies deeper than it
/// says.
class Walk {
 public:
  Walk(const Content& content, std::string what) : content_(content), what_(std::move(what)) {}

  void follow(std::uint64_t begin, bool explicit_vr) {
    open_ = {{Kind::kElements, content_.size(), explicit_vr}};
    for (std::uint64_t at = begin;;) {
      while (open_.size() > 1 && at == open_.back().end) open_.pop_back();
      const Level& level = open_.back();
      if (at == content_.size()) return;
      const auto element = element_at(content_, at, level.explicit_vr);
      if (!element) refuse("cannot be followed at byte " + std::to_string(at));
      at = level.kind == Kind::kElements ? after(*element) : after_item(*element);
    }
  }

 private:
  enum class Kind { kElements, kItems, kFragments };
  struct Level {
    Kind kind;
    std::uint64_t end;  // kNone: where its delimiter stands
    bool explicit_vr;
  };
  static constexpr std::uint64_t kNone = UINT64_MAX;

  [[noreturn]] void refuse(const std::string& why) const { throw Error(what_ + ": its sequences " + why); }

  void enter(Kind kind, const Element& element, bool explicit_vr) {
    std::uint64_t end = kNone;
    if (element.length != kUndefined) end = element.value + element.length;
    for (const Level& level : open_) {
      if (end != kNone && level.end != kNone && end > level.end) refuse("are longer than what holds them");
    }
    open_.push_back({kind, end, explicit_vr});
    // Each sequence is a level, and so is each of its items.
    if (open_.size() > 2 * kMostDicomDepth)
      refuse("lie more than " + std::to_string(kMostDicomDepth) + " deep within each other");
  }

  /// Past a value that holds no elements.
  [[nodiscard]] std::uint64_t past(const Element& element) const {
    const std::uint64_t end = element.value + element.length;
    for (const Level& level : open_) {
      if (level.end != kNone && end > level.end) refuse("hold more than they are long");
    }
    return end;
  }

  /// Where the next element or item begins.
  std::uint64_t after(const Element& element) {
    const bool explicit_vr = open_.back().explicit_vr;
    if (element.tag == kItemEnd) {
      if (open_.size() == 1 || open_.back().end != kNone) refuse("end where none began");
      open_.pop_back();
      return element.value;
    }
    if (element.tag >> 16U == 0xFFFE) refuse("begin where none can");
    const bool is_open = element.length == kUndefined;
    constexpr std::uint32_t kPixelData = 0x7FE00010;
    if (explicit_vr && element.tag == kPixelData && element.vr != "SQ" && element.vr != "UN" && is_open) {
      enter(Kind::kFragments, element, explicit_vr);
    } else if (explicit_vr && element.vr == "SQ") {
      enter(Kind::kItems, element, explicit_vr);
    } else if (is_open) {
      if (explicit_vr && element.vr != "UN") refuse("have no length");
      enter(Kind::kItems, element, false);  // PS3.5 6.2.2: implicit within
    } else if (!explicit_vr && begins_with_item(element)) {
      enter(Kind::kItems, element, false);
    } else {
      return past(element);
    }
    return element.value;
  }

  std::uint64_t after_item(const Element& element) {
    if (element.tag == kSequenceEnd) {
      if (open_.back().end != kNone) refuse("end where none began");
      open_.pop_back();
      return element.value;
    }
    if (element.tag != kItem) refuse("hold something else than items");
    if (open_.back().kind == Kind::kFragments) {
      if (element.length == kUndefined) refuse("have no length");
      return past(element);
    }
    enter(Kind::kElements, element, open_.back().explicit_vr);
    return element.value;
  }

  [[nodiscard]] bool begins_with_item(const Element& element) const {
    std::array<unsigned char, 4> begin{};
    return element.length >= 8 && content_.read(element.value, begin.data(), begin.size()) == begin.size() &&
           tag_at(begin.data()) == kItem;
  }

  const Content& content_;
  const std::string what_;
  std::vector<Level> open_;
};

/// What cannot be inflated to its end is left to DCMTK, which says so.
std::vector<unsigned char> inflated(const Content& file, std::uint64_t begin, const std::string& what) {
  z_stream stream{};
  constexpr int kRaw = -MAX_WBITS;
  if (::inflateInit2(&stream, kRaw) != Z_OK) throw Error(what + ": there is no memory to inflate it");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> ended(&stream, ::inflateEnd);
  std::vector<unsigned char> in(kChunk), out, piece(kChunk);
  for (std::uint64_t at = begin;; at += kChunk) {
    stream.avail_in = static_cast<uInt>(file.read(at, in.data(), in.size()));
    stream.next_in = in.data();
    if (stream.avail_in == 0) return out;
    do {
      stream.avail_out = static_cast<uInt>(piece.size());
      stream.next_out = piece.data();
      const int state = ::inflate(&stream, Z_NO_FLUSH);
      out.insert(out.end(), piece.begin(), piece.end() - stream.avail_out);
      if (out.size() > kMostInflatedBytes) {
        throw Error(what + ": it inflates to more than " + std::to_string(kMostInflatedBytes >> 20U) +
                    " MiB, which no picture's file does; save it without compression");
      }
      if (state != Z_OK) return out;
    } while (stream.avail_out == 0);
  }
}

}  // namespace

void require_bounded_dicom(const std::filesystem::path& file) {
  const std::string what = "cannot read " + file.string();
  const FileContent content(file);
  const Meta meta = meta_of(content);
  // DCMTK may read otherwise what is not sound. However it does, sequences lie in items, which stand in the
  // file as they are unless it is deflated, and then its name stands there.
  const bool is_odd = !meta.is_sound && names_deflated(content);
  if (is_odd) {
    throw Error(what +
                ": its file meta information is damaged, and names a deflated encoding; save it without "
                "compression");
  }
  std::optional<MemoryContent> expanded;
  if (is_deflated(meta.syntax)) expanded.emplace(inflated(content, meta.end, what));
  const Content& elements = expanded ? static_cast<const Content&>(*expanded) : content;
  // Where it says what kind of file it is there are none; DCMTK would read them all the same.
  if (items_in(content, 0, meta.end) > 0)
    throw Error(what + ": its file meta information holds sequences, which is none");
  const std::uint64_t begin = expanded ? 0 : meta.end;
  if (items_in(elements, begin, elements.size()) <= kMostUnaskedItems) return;
  constexpr std::string_view kImplicit = "1.2.840.10008.1.2", kBigEndian = "1.2.840.10008.1.2.2";
  // Others have encodings of their own, under names of their own.
  const bool is_followed = meta.is_sound && meta.syntax.starts_with(kImplicit) && meta.syntax != kBigEndian;
  if (!is_followed) {
    throw Error(what + ": it has more than " + std::to_string(kMostUnaskedItems) +
                " items of sequences in an encoding in which they are not followed; save it as explicit VR "
                "little endian");
  }
  Walk(elements, what).follow(begin, meta.syntax != kImplicit);
}

}  // namespace kiroku::sim
