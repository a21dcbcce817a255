#include "apps/kiroku/named_roots.h"

#include "base/error.h"

namespace kiroku::apps {

void add_root_options(Command& command, NamedRoots& roots, const std::string& when) {
  command.option("--trust", "PEM", roots.trust,
                 when + "roots of outside time-stamping authorities; instead of the home's");
  command.option(
      "--own-authority", "PEM", roots.own_authority,
      when + "roots of the recorder's own authority, whose time is self-issued; instead of the home's");
}

timestamp::TrustStore trust_of(const NamedRoots& roots, const std::optional<Home>& home) {
  timestamp::TrustStore trust;
  if (roots.empty() && home) trust = home->trust();
  for (const std::string& file : roots.trust) trust.add_trusted_file(file);
  for (const std::string& file : roots.own_authority) trust.add_own_authority_file(file);
  return trust;
}

timestamp::TrustStore required_trust(const NamedRoots& roots, const std::optional<std::string>& home) {
  if (!roots.empty()) return trust_of(roots, std::nullopt);
  const std::optional<Home> found = Home::find(home);
  if (!found) throw UsageError("no trusted root is known: name the authority's with --trust PEM");
  return found->trust();
}

}  // namespace kiroku::apps
