// To what patients of a home's cases consented. Functions; one thread at a time.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/configuration/consent_configuration.h"
#include "apps/kiroku/home.h"
#include "archive/upkeep/consents.h"

namespace kiroku::apps {

/// [consent] of the home's kiroku.toml; the defaults where the home has no such file.
ConsentConfiguration consent_configuration(const Home& home);

/// As the home's log states them, which must go on from the newest checkpoint that the home keeps, and from
/// the one that witnesses cosigned, where there is one. Throws kiroku::Error where nobody can tell.
archive::Consents standing_consents(const Home& home);

/// Before a case is used for a purpose: enters that in the appliance log while a consent to it stands. No
/// withdrawal is entered in between. Throws kiroku::UsageError where the case is none of this home's, where
/// the purpose is none of the site's, and where no consent stands, with the reason; kiroku::Error where
/// nobody can tell, and where the log cannot be written.
void enter_use(const Home& home, const std::filesystem::path& case_folder, const std::string& purpose,
               const std::string& what);

/// The same as every command that hands a case out does it, before the first byte leaves: with a purpose as
/// enter_use(), and true; without one false, where the site does not demand a purpose. Throws
/// kiroku::UsageError, too, where it does and the case is the home's own or a copy of one, by its identifier,
/// and where a purpose is named and there is no home.
bool enter_purpose(const std::optional<Home>& home, const std::filesystem::path& case_folder,
                   const std::optional<std::string>& purpose, const std::string& what);

}  // namespace kiroku::apps
