// [viewer] of kiroku.toml: the viewer that kirokud serves itself, with live pictures. Pure functions,
// thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace kiroku::apps {

class TableReader;

struct ViewerConfiguration {
  std::string listen;            // "0.0.0.0:8443"; empty: none
  std::string certificate, key;  // PEM files, relative to the home; empty: the home's own
};

/// The section, where `top` has one. Throws kiroku::UsageError as parse_configuration() does.
ViewerConfiguration read_viewer(TableReader& top);

/// The section of a file that parse_configuration() has taken.
ViewerConfiguration parse_viewer_configuration(std::string_view toml, const std::string& name_for_errors);

}  // namespace kiroku::apps
