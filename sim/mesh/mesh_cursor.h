// Reading a mesh file through a bounded cursor: words and numbers of text, or numbers of binary blocks. Not
// thread-safe.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

namespace kiroku::sim {

/// Every refusal is one kiroku::Error: "cannot read liver.msh, line 17: the number of nodes is 'abc', ...".
/// In a binary file the place is a byte, counted from 0. The first letters of a sentence say what was looked
/// for: `what`.
class MeshCursor {
 public:
  /// The text must outlive the cursor. `name` stands in errors.
  MeshCursor(std::string_view text, std::string name);

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Bytes not read yet: nothing in the file can be more than these, however large the count before it.
  [[nodiscard]] std::size_t remaining() const { return text_.size() - at_; }

  /// Numbers are binary from here on (or text again), in this byte order.
  void set_binary(bool binary, std::endian order = std::endian::native);
  [[nodiscard]] bool binary() const { return binary_; }

  /// Past white space; whether anything is left.
  bool more();
  /// The next word, past white space; empty at the end.
  std::string_view word();
  /// The rest of this line, without white space around it, and past its end.
  std::string_view line();
  /// Past `end`, wherever it comes next; refused where it does not.
  void skip_past(std::string_view end) { until(end); }
  /// What comes before `end`, which is passed too.
  std::string_view until(std::string_view end);

  /// Words of the text, whatever the mode: for headers.
  std::int64_t text_integer(const char* what);
  std::uint64_t text_count(const char* what);
  double text_real(const char* what);

  /// In the mode that is set; `bytes` is the width in binary: 4 or 8.
  std::int64_t integer(std::size_t bytes, const char* what);
  std::uint64_t count(std::size_t bytes, const char* what);
  /// Finite. `bytes`: 4 for single, 8 for double precision.
  double real(std::size_t bytes, const char* what);
  /// Raw bytes of a binary block.
  std::string_view take(std::size_t bytes, const char* what);

  /// Refuses at the word read last.
  [[noreturn]] void fail(const std::string& sentence) const;

 private:
  std::string_view expected_word(const char* what);
  template <typename Number>
  Number binary_number(const char* what);

  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0, last_ = 0;  // next byte; beginning of what was read last
  bool binary_ = false, ever_binary_ = false, swapped_ = false;
};

}  // namespace kiroku::sim
