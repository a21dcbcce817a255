// Files that a comparison is written to, where it is not kept in a home. Functions; not thread-safe.
#pragma once

#include <filesystem>

#include "apps/sim/comparison_request.h"
#include "base/bytes.h"

namespace kiroku::apps {

/// kKept: no file of the caller's, but kept in the home for the viewer.
enum class ComparisonOutput { kDocument, kPage, kFilm, kKept };

/// By its ending; kiroku::UsageError for another.
ComparisonOutput output_form(const std::filesystem::path& output);

/// liver.html has its document in liver.comparison.json: a plan is often called liver.json.
std::filesystem::path document_of(const std::filesystem::path& output);

/// kiroku::UsageError where the request's output or its document is there and may not be replaced, or is
/// something else: a seal that holds is not written over by accident.
void require_free(const ComparisonRequest& request, const std::filesystem::path& document);

/// kiroku::UsageError where it is there and may not be replaced.
void write_output(const std::filesystem::path& file, ByteView bytes, bool force);

/// Tokens of an earlier document of that name would say that this one differs.
void remove_tokens(const std::filesystem::path& document);

}  // namespace kiroku::apps
