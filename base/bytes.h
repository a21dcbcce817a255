// Bytes and views of them. All functions are pure and thread-safe.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku {

using Bytes = std::vector<std::byte>;
using ByteView = std::span<const std::byte>;

/// The same memory seen as bytes; the text must outlive the view.
ByteView bytes_of(std::string_view text);
/// The same memory seen as characters; the bytes must outlive the view. No encoding is checked.
std::string_view text_of(ByteView bytes);
Bytes to_bytes(ByteView view);
Bytes to_bytes(std::string_view text);
void append(Bytes& to, ByteView more);

}  // namespace kiroku
