// Lines of a plaintext, in constant memory. A function; thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "crypto/byte_source.h"

namespace kiroku::media {

/// Calls `visit` with every line, without its LF, and its number from 1. What stands after the last LF is
/// passed over if `tolerate_cut`. Throws kiroku::Error, with `name`, for a line longer than `longest`, or a
/// last line without LF; whatever the source or `visit` throws.
void for_each_line(const crypto::ByteSource& source, const std::string& name, std::size_t longest,
                   bool tolerate_cut,
                   const std::function<void(std::uint64_t number, std::string_view)>& visit);

}  // namespace kiroku::media
