// What the chunks of a body may not have. Header only, for servers that parse with Boost.Beast.
#pragma once

#include <cstdint>

#include <boost/beast/core/error.hpp>
#include <boost/beast/core/string_type.hpp>
#include <boost/beast/http/error.hpp>

namespace kiroku {

/// For on_chunk_header() of a parser, which keeps a reference to it. A chunk with extensions (RFC 9112
/// section 7.1.1) ends the request with bad_chunk_extension: some programs take a line feed within a quoted
/// extension for the end of the line, and see another request behind it. No client of these servers sends
/// any.
struct RefuseChunkExtensions {
  void operator()(std::uint64_t /*size*/, boost::beast::string_view extensions,
                  boost::beast::error_code& failed) const {
    if (!extensions.empty()) failed = boost::beast::http::error::bad_chunk_extension;
  }
};

}  // namespace kiroku
