#include "apps/sim/comparison_outputs.h"

#include "apps/common/file.h"
#include "apps/kiroku/stamped_file.h"
#include "archive/storage/file_stamps.h"
#include "base/error.h"
#include "viewer/kept/provenance.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// Only comparisons are replaced by comparisons.
void require_comparison(const fs::path& file) {
  if (fs::exists(file))
    (void)compare::read_provenance(text_of(read_small_file(file, "the comparison")), file.string());
}

}  // namespace

ComparisonOutput output_form(const fs::path& output) {
  const fs::path ending = output.extension();
  if (ending == ".json") return ComparisonOutput::kDocument;
  if (ending == ".html") return ComparisonOutput::kPage;
  if (ending == ".mp4") return ComparisonOutput::kFilm;
  throw UsageError(
      "the output " + output.string() +
      " must end in .mp4 (a film), .html (a page with figures and pictures) or .json (the figures)");
}

fs::path document_of(const fs::path& output) {
  fs::path document = output;
  if (output_form(output) != ComparisonOutput::kDocument) document.replace_extension(".comparison.json");
  return document;
}

void require_free(const ComparisonRequest& request, const fs::path& document) {
  for (const fs::path& file : {fs::path(*request.output), document}) {
    if (fs::exists(file) && !request.force)
      throw UsageError(file.string() +
                       " is already there; choose another name, or overwrite it with --force");
  }
  require_comparison(document);
}

void write_output(const fs::path& file, ByteView bytes, bool force) {
  if (fs::exists(file) && !force)
    throw UsageError(file.string() + " is already there; choose another name, or overwrite it with --force");
  write_durably(file, bytes);
}

void remove_tokens(const fs::path& document) {
  for (const fs::path& token : archive::tokens_beside(document)) fs::remove(token);
}

}  // namespace kiroku::apps
