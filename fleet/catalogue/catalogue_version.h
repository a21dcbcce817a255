// Whether a database holds the catalogue of this program's version. Function; of one connection's thread.
#pragma once

#include "fleet/catalogue/postgres.h"

namespace kiroku::fleet {

/// Throws kiroku::UsageError, which says what to run, where it does not.
void require_catalogue_version(Postgres& database);

}  // namespace kiroku::fleet
