#include "apps/configuration/viewer_configuration.h"

#include "apps/configuration/table_reader.h"
#include "base/listen_address.h"

namespace kiroku::apps {
namespace {

constexpr std::uint16_t kExamplePort = 8443;

}  // namespace

ViewerConfiguration read_viewer(TableReader& top) {
  ViewerConfiguration viewer;
  const toml::table* table = top.table("viewer");
  if (table == nullptr) return viewer;
  TableReader reader(*table, "[viewer]", top.file());
  reader.text("listen", [&](const std::string& text) {
    static_cast<void>(parse_listen_address(text, kExamplePort));
    viewer.listen = text;
  });
  reader.text("certificate", [&](const std::string& text) { viewer.certificate = text; });
  reader.text("key", [&](const std::string& text) { viewer.key = text; });
  reader.refuse_unknown_keys();
  if (viewer.listen.empty()) reader.refuse(table->source(), "[viewer] needs a 'listen'");
  if (viewer.certificate.empty() != viewer.key.empty()) {
    reader.refuse(table->source(), "'certificate' and 'key' belong together: give both or none");
  }
  return viewer;
}

ViewerConfiguration parse_viewer_configuration(std::string_view toml, const std::string& name_for_errors) {
  const toml::table root = toml::parse(toml);
  TableReader top(root, "the file", name_for_errors);
  return read_viewer(top);
}

}  // namespace kiroku::apps
